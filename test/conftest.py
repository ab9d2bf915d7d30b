# SPDX-License-Identifier: Apache-2.0
# Copyright 2026 color_stereo_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""What holds for all tests: nodes end, and the lanes quick and proof choose among the tests."""

import os
import signal
import sys

import lanes

import proof

import pytest

FIGURES = pytest.StashKey()


def pytest_addoption(parser):
    """Declare the lanes; without an option all tests run, at short length."""
    group = parser.getgroup('lanes')
    group.addoption('--quick', action='store_true', help='only the tests that need neither '
                    'processes nor ROS nor the simulator')
    group.addoption('--proof', action='store_true', help='only the tests that gain from length, '
                    f'at full length; writes {proof.OUTPUT.relative_to(proof.ROOT)}')


def pytest_configure(config):
    """Prepare the lane, and the signals of the processes that tests start."""
    give_children_their_signals()
    config.addinivalue_line('markers', 'processes: starts processes, or needs ROS or the '
                            'simulator, though its source does not show it')
    config.addinivalue_line('markers', 'long: takes seconds without any of these')
    config.stash[FIGURES] = []
    config.option.loadscopereorder = False  # pytest-xdist would begin with files of many tests
    if config.getoption('quick'):
        lanes.keep_quick()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """Return one process more than cores: the tests of nodes wait for much of their time."""
    return len(os.sched_getaffinity(0)) + 1


def give_children_their_signals():
    """
    Let processes that are started obey SIGINT and SIGHUP where this one ignores them.

    A shell starts what ends in & with SIGINT ignored, nohup does so with SIGHUP, and so would all
    children be. A handler that does nothing is as deaf, but a new program gets the default
    instead of a handler.

    """
    for number in (signal.SIGINT, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, lambda *_: None)


def pytest_ignore_collect(collection_path, config):
    """Do not even import, in the quick lane, modules that import ROS or the simulator."""
    if config.getoption('quick') and collection_path.suffix == '.py':
        return bool(lanes.slow_imports(collection_path)) or None
    return None


def pytest_collection_modifyitems(config, items):
    """Put the tests of long files first; choose the tests of the lane."""
    lanes.longest_first(items)
    if config.getoption('quick'):
        chosen = [item for item in items if is_quick(item)]
    elif config.getoption('proof'):
        chosen = [item for item in items if 'effort' in item.fixturenames]
    else:
        return
    config.hook.pytest_deselected(items=list(set(items) - set(chosen)))
    items[:] = chosen


def is_quick(item):
    """Tell whether a test is short and needs no process, no ROS and no simulator."""
    return not (item.get_closest_marker('processes') or item.get_closest_marker('long')
                or lanes.needs_more_than_a_process(item.path, item.function.__name__))


def pytest_sessionfinish(session):
    """Write the figures of a proof."""
    config = session.config
    if config.getoption('proof') and not config.getoption('collectonly'):
        reports = config.pluginmanager.get_plugin('terminalreporter').stats
        proof.write(config.stash[FIGURES], {report.nodeid for outcome in ('failed', 'error')
                                            for report in reports.get(outcome, ())})


def pytest_terminal_summary(terminalreporter, config):
    """Show the figures of a proof."""
    if config.getoption('proof') and config.stash[FIGURES]:
        terminalreporter.section('figures')
        for figure in config.stash[FIGURES]:
            terminalreporter.write_line(proof.line_of(figure))
        terminalreporter.write_line(f'written to {proof.OUTPUT.relative_to(proof.ROOT)}')


@pytest.fixture(scope='session')
def effort(pytestconfig):
    """Return how long a test runs; whoever takes it is part of `make proof`."""
    return proof.Effort(pytestconfig.getoption('proof'))


@pytest.fixture
def figures(request):
    """Return what takes the figures of a test."""
    return proof.Figures(request.node.nodeid, request.config.stash[FIGURES])


@pytest.fixture(autouse=True)
def no_node_outlives_its_test():
    """End the nodes that a test has started and, since it failed, not stopped."""
    before = len(started_nodes())
    yield
    for node in started_nodes()[before:]:
        if node.process.poll() is None:
            node.process.kill()
            node.process.wait()


def started_nodes():
    """Return the node processes of this session; empty before a test asks for ROS."""
    rig = sys.modules.get('ros_rig')
    return rig.NodeProcess.started if rig else []
