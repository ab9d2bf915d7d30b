# SPDX-License-Identifier: Apache-2.0
"""The stress test: rigs as people have them, one disturbance at a time, with exact truth."""
