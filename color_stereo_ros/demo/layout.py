# SPDX-License-Identifier: Apache-2.0
"""The names inside a sample folder, which `color_stereo sample` fills and the demonstration plays."""

RECORDING = 'recording'
TRUTH = 'truth.npz'
SETTINGS = 'settings.yaml'
