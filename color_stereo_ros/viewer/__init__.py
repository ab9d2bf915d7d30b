# SPDX-License-Identifier: Apache-2.0
"""A page in the browser to look at pairs and at what was measured from them."""
