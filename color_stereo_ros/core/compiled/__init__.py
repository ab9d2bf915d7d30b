# SPDX-License-Identifier: Apache-2.0
"""Everything that touches the insides of numba, and the memory kernels work on."""
