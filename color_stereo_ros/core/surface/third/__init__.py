# SPDX-License-Identifier: Apache-2.0
"""The pattern as a third view of the surface method; see docs/third_view.md."""
