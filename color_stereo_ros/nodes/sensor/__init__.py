# SPDX-License-Identifier: Apache-2.0
"""range_node: inputs, worker, outputs and services, one module per capability."""
