# SPDX-License-Identifier: Apache-2.0
"""Settings: the single source of every name, default, unit and range."""
