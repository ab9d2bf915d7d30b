# SPDX-License-Identifier: Apache-2.0
"""The surface method: coarse to fine, with a slanted plane at every node."""
