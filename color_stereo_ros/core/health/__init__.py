# SPDX-License-Identifier: Apache-2.0
"""Whether the calibration still holds: the drift of one camera against the other, in the field."""
