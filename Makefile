# SPDX-License-Identifier: Apache-2.0
# Every target sets up what it needs in .venv, once.

PYTHON_RUN := .venv/bin/python
COLOR_STEREO := .venv/bin/color_stereo
# One process more than cores, four at most; the tests of a module stay together and share its fixtures.
ON_ALL_CORES := --numprocesses auto --maxprocesses 4 --dist loadfile

# Nothing that runs here is meant to be seen by, or to see, another machine.
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
# Hundreds of processes are started, and each would compile all modules anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help demo quick test proof bench evaluate floor versions tables docs release-check clean

help:  ## show this list
	@grep -E '^[a-z-]+:.*##' Makefile | sed -E 's/:.*## /\t/' | expand -t 15

demo:  ## play the samples through both nodes, show what comes out in demo_output/ and the browser
	@.ci/setup ros,tools,view
	@$(COLOR_STEREO) demo

quick:  ## run the tests that need no processes, no ROS and no simulator: some minutes
	@.ci/setup tools,view,test
	@$(PYTHON_RUN) -m pytest --quick

test:  ## run all tests, the colcon build included
	@.ci/setup ros,tools,sim,view,project,test
	@$(PYTHON_RUN) -m pytest $(ON_ALL_CORES)

proof:  ## run the tests that gain from length at full length, figures in proof_output/proof.json
	@.ci/setup ros,tools,sim,view,project,test
	@$(PYTHON_RUN) -m pytest --proof

bench:  ## measure times, beside OpenCV's matchers
	@.ci/setup ros,tools
	@$(COLOR_STEREO) bench

evaluate:  ## the paper's experiments on the simulated rig, as a report in evaluation_output/
	@.ci/setup ros,tools,sim
	@$(COLOR_STEREO) evaluate

floor:  ## run all tests on the oldest versions that are supported, Ubuntu 24.04's
	@VENV=.venv-floor PYTHONS=3.12 PIP_CONSTRAINT=constraints/oldest.txt \
	  .ci/setup ros,tools,sim,view,project,test
	@.venv-floor/bin/python -m pytest -p no:cacheprovider $(ON_ALL_CORES)

versions:  ## run all tests with the oldest, today's and the newest packages, and print a table
	@.ci/versions

tables:  ## make the tables in docs anew from the code
	@.ci/setup ros,tools
	@$(PYTHON_RUN) -m color_stereo_ros.cli.tables

docs:  ## build the site of the manual and the API in docs_output/
	@.ci/setup docs
	@$(PYTHON_RUN) -m sphinx -W --keep-going -q docs docs_output
	@echo docs_output/index.html

release-check:  ## build the package and run all checks of a release, as a table; WHOLE=1 adds colcon test
	@.ci/setup ros,tools,sim,view,project,test
	@$(PYTHON_RUN) .ci/release

clean:  ## remove everything that the other targets made
	rm -rf .venv .venv-floor .venv-newest build install log demo_output evaluation_output \
	  bench_output render_output process_output proof_output docs_output release_output \
	  .pytest_cache .numba_cache *.egg-info
	find color_stereo_ros test -name __pycache__ -prune -exec rm -rf {} +
