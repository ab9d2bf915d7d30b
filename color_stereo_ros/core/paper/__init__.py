# SPDX-License-Identifier: Apache-2.0
"""The method of the paper: colors of one row are compared at all disparities."""
