# SPDX-License-Identifier: Apache-2.0
"""The command `color_stereo`: one module per subcommand, and what they share."""
