# SPDX-License-Identifier: Apache-2.0
"""The names inside a sample folder: the command sample fills it, the command demo plays it."""

RECORDING = 'recording'
TRUTH = 'truth.npz'
SETTINGS = 'settings.yaml'
