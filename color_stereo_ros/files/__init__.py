# SPDX-License-Identifier: Apache-2.0
"""Files of all kinds, read and written as a whole; they know no ROS and no core."""
