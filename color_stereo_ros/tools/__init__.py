# SPDX-License-Identifier: Apache-2.0
"""One module per subcommand of `color_stereo`, and what they share."""
