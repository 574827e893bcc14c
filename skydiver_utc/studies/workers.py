# SPDX-License-Identifier: Apache-2.0
"""Where runs are computed: in this process, in local processes, or on a Dask cluster; one interface for all."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager

from skydiver_utc.parameters import ParameterError

AT_ONCE_ON_CLUSTER = 64  # runs: with fewer its workers would idle between two results
_CLOSE_S = 10


@contextmanager
def executor(workers: int, scheduler: str = "") -> Iterator[Executor]:
    """An executor; one worker is a thread of this process. Calls that have not begun are cancelled at the end.

    scheduler: address of a Dask cluster that runs already, whose workers have this package
    """
    if scheduler:
        with _cluster(scheduler) as cluster:
            yield cluster
        return
    pool: Executor
    if workers == 1:
        pool = ThreadPoolExecutor(1)
    else:
        # Before a worker imports NumPy: threads of its linear algebra would wait for one another on small matrices.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        # Spawned, because a fork would copy the thread that draws the progress bar in an unknown state.
        pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _follow_the_parent)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _cluster(scheduler: str) -> Iterator[Executor]:
    try:
        from distributed import Client
    except ModuleNotFoundError as error:
        raise ParameterError("--scheduler needs Dask: pip install skydiver_utc[studies]") from error
    try:
        client = Client(scheduler, set_as_default=False)  # within `distributed.comm.timeouts.connect`
    except (OSError, ValueError) as error:
        raise ParameterError(
            f"no Dask scheduler answers at {scheduler}: check the address ({error})"
        ) from error
    try:
        yield client.get_executor(pure=False, retries=0)
    finally:
        client.close(timeout=_CLOSE_S)


def _follow_the_parent() -> None:
    """Ignore Ctrl-C, which is the parent's, and exit with the parent: an idle worker would wait for ever."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_exit_with_the_parent, daemon=True).start()


def _exit_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
