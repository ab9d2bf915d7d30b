# SPDX-License-Identifier: Apache-2.0
"""What must hold before a release, as one table: `make release-check`."""
