# SPDX-License-Identifier: Apache-2.0
"""Times of the sensor and of the nodes, beside those of OpenCV's matchers."""
