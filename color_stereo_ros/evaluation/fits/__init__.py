# SPDX-License-Identifier: Apache-2.0
"""
The commands that fit the models of the surface method to scenes with truth.

`python -m color_stereo_ros.evaluation.fits MODEL --output FILE` writes a file as those in
core/surface/models, and prints the fit beside what ships.

"""
