# SPDX-License-Identifier: Apache-2.0
"""The commands below `color_stereo calibrate`, one module each."""
