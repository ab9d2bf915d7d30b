# SPDX-License-Identifier: Apache-2.0
"""`color_stereo calibrate`: the commands that find out what a rig is; see `calibrating/`."""

SUMMARY = 'calibrate a rig: geometry and what else is beside it, each a command of its own'
NEEDS = ''
COMMANDS = 'calibrating'
