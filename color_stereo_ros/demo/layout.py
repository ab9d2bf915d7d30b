# SPDX-License-Identifier: Apache-2.0
"""The names inside a sample folder: `color_stereo sample` fills it, `color_stereo demo` plays it."""

RECORDING = 'recording'
TRUTH = 'truth.npz'
SETTINGS = 'settings.yaml'
