# SPDX-License-Identifier: Apache-2.0
"""`color_stereo trust`: fit the surface method's log-odds of being right on simulated scenes."""

SUMMARY = "fit the surface method's confidence to scenes with truth (for developers)"
NEEDS = '[tools]'


def add_arguments(parser):
    """Declare the arguments."""
    from ..evaluation.fits import arguments
    arguments.add_arguments(parser)


def run(args):
    """Run the fit of the model `trust`; `python -m ...evaluation.fits` has the others."""
    from ..evaluation.fits.run import run as run_fit
    run_fit('trust', args)
