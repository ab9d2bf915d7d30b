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
"""
Who measures the tasks of a conversion: this process, processes of this machine, or a cluster.

Several processes are Dask's (extra [cluster]): it starts them, gives each one task after the
other, and gives the task of a process that was killed to another one.

"""

from contextlib import contextmanager
import logging
from multiprocessing.resource_tracker import ensure_running
import signal
import threading

from .working import forget_runs, measure_task
from ..core.compiled import one_thread
from ..errors import RecordingError

DEATHS = 10
"""Processes that may be killed over one task; chosen: a machine in trouble, not the task."""
PATIENCE = '15s'
"""Time that a scheduler has to answer; chosen: on a busy machine 5 s were too few."""
STARTS = 3
"""Tries to start the processes; chosen likewise."""
ENVIRONMENT = {'MALLOC_TRIM_THRESHOLD_': str(1 << 28), 'MALLOC_MMAP_THRESHOLD_': str(1 << 25)}
"""
Of local processes: memory of images is kept, where Dask's own values would return and fetch it
for each pair; that saves a quarter of the processor time (docs/scale.md). Dask sets it in this
process, too, while it starts others: numba's variables have no place here.
"""
QUIET = {'distributed.worker.profile.enabled': False,
         'distributed.worker.memory.monitor-interval': '1s',
         'distributed.scheduler.active-memory-manager.start': False,
         'distributed.admin.tick.interval': '1s',
         'distributed.admin.system-monitor.interval': '5s',
         'distributed.admin.system-monitor.gil.enabled': False}
"""
Dask watches its processes a hundred times a second, for a page that is not served here; that
costs a tenth of the processor time (docs/scale.md).
"""


def run_tasks(run, tasks, *, workers, scheduler=None, tick=lambda count: None):
    """
    Measure tasks, in any order.

    Parameters
    ----------
    run : Run
        The results of one method.
    tasks : list of Task
        What is to be done, independent of each other.
    workers : int
        Processes on this machine; 1 or a single task: this process measures.
    scheduler : str, optional
        Address of a Dask scheduler, such as tcp://host:8786: its workers measure.
    tick : callable
        Called with a number of pairs that are done: after each pair where this process measures,
        else after each task.

    Yields
    ------
    account : dict
        See `measure_task`.

    Raises
    ------
    RecordingError
        If a task fails, or its process is killed again and again.

    """
    if scheduler is None and min(workers, len(tasks)) <= 1:
        try:
            for task in tasks:
                yield measure_task(run, task, lambda: tick(1))
        finally:
            forget_runs()
        return
    with _client(min(workers, len(tasks)), scheduler) as client:
        for account in _distributed(client, run, tasks):
            tick(account['pairs'])
            yield account


def measure_alone(run, task):
    """Do what `measure_task` does, with one thread: the other processes have the other cores."""
    import cv2
    one_thread()
    cv2.setNumThreads(1)
    return measure_task(run, task)


@contextmanager
def _client(workers, scheduler):
    """Yield a client of a scheduler, or of processes that are started for it."""
    import dask
    from distributed import Client
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=PATIENCE)
        except (OSError, ValueError) as error:
            raise RecordingError(f'{scheduler}: no Dask scheduler answers there; start one with '
                                 '`dask scheduler`, or leave out --scheduler') from error
        with client:
            yield client
        return
    with dask.config.set({'distributed.nanny.pre-spawn-environ': ENVIRONMENT,
                          'distributed.scheduler.allowed-failures': DEATHS, **QUIET}), \
            _deaf_to_interrupts() as hear, _local_cluster(workers) as cluster:
        hear()
        with Client(cluster) as client:
            yield client


@contextmanager
def _deaf_to_interrupts():
    """
    Put off SIGINT until what is yielded is called; processes that begin before keep it blocked.

    A terminal sends Ctrl-C to all processes. This one acts, and ends the others, once they have
    begun. Blocking is not enough here: threads that were there before still take the signal.

    """
    ensure_running()  # its start would unblock the signal
    if threading.current_thread() is not threading.main_thread():  # nobody interrupts this one
        yield lambda: None
        return
    early = []
    usual = signal.signal(signal.SIGINT, lambda *_: early.append(True))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})

    def restore():
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        signal.signal(signal.SIGINT, usual)

    def hear():
        restore()
        if early:
            raise KeyboardInterrupt
    try:
        yield hear
    finally:
        restore()


def _local_cluster(workers):
    """Return a cluster of processes; one that is killed before it has begun is started again."""
    from distributed import LocalCluster
    for _ in range(STARTS):
        try:
            return LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None,
                                silence_logs=logging.CRITICAL)
        except RuntimeError as error:
            reason = error
    raise RecordingError(f'the processes of --workers {workers} do not start: {reason}; '
                         '--workers 1 does without them')


def _distributed(client, run, tasks):
    from distributed import as_completed, KilledWorker
    futures = client.map(measure_alone, [run] * len(tasks), tasks, pure=False)
    try:
        for _, account in as_completed(futures, with_results=True):
            yield account
    except KilledWorker as error:
        raise RecordingError(f'a task was given up, since {DEATHS} processes were killed while '
                             f'they measured it: {error}') from error
    finally:
        client.cancel(futures)
