"""Workers that diagnose bags: processes of this machine, or those of a Dask cluster."""

import asyncio
import logging
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from ctypes import CDLL
from functools import cache, partial
from importlib.util import find_spec
from multiprocessing import get_context, parent_process
from typing import TypeVar

import click
from attrs import frozen

from afm_scan_ros.cli.options import grouped
from afm_scan_ros.core.errors import InputError, ScanError

Task = TypeVar("Task")
Result = TypeVar("Result")
Outcome = tuple[Task, Result | BaseException]
LOST = "the process that worked on it was ended"
TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Parameters of glibc's ``mallopt``, from malloc.h."""
LARGEST_KEPT, MOST_KEPT = 2**25, 2**28
"""Bytes of an array, and of all free memory, that a worker keeps. glibc takes no larger array."""
PATIENCE = 30.0
"""How long a scheduler and its first worker are waited for, s, as Dask waits for a connection."""


@frozen
class WorkerOptions:
    """Where tasks are worked on: in so many processes, or by a Dask ``scheduler``."""

    jobs: int
    scheduler: str | None

    def run(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[Outcome[Task, Result]]:
        """Yield each task with its result, or with what ended it, as they are done."""
        if self.scheduler is None:
            return in_processes(work, tasks, self.jobs)
        return on_cluster(work, tasks, self.scheduler)


def _workers(jobs: int | None, scheduler: str | None) -> WorkerOptions:
    if scheduler is not None and find_spec("distributed") is None:
        raise InputError(
            "--scheduler needs dask.distributed, which is not installed:"
            " pip install 'afm_scan_ros[dask]'"
        )
    return WorkerOptions(jobs or os.cpu_count() or 1, scheduler)


worker_options = grouped(
    "workers",
    _workers,
    click.option("--jobs", type=click.IntRange(1), help="Processes, by default one for each core."),
    click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers are used."),
)


def in_processes(
    work: Callable[[Task], Result], tasks: Sequence[Task], jobs: int
) -> Iterator[Outcome[Task, Result]]:
    """Yield each task with its result, or with what ended it, as they are done.

    Where a process is killed, the tasks that were being worked on are tried again, each in a
    process alone. So a task that kills its process costs no other one.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # one process a core: more threads would wait
    waiting = deque(tasks)
    while waiting:
        doubtful = yield from _until_broken(work, waiting, jobs)
        for task in doubtful:
            lost = yield from _until_broken(work, deque([task]), 1)
            if lost:
                yield task, ScanError(f"{LOST} twice")


def _until_broken(
    work: Callable[[Task], Result], waiting: deque[Task], jobs: int
) -> Generator[Outcome[Task, Result], None, list[Task]]:
    """Yield outcomes; return the tasks that were being worked on when a process ended."""
    running: dict[Future[Result], Task] = {}
    count = min(jobs, len(waiting))
    with ProcessPoolExecutor(count, get_context("spawn"), _begin) as pool:
        while waiting or running:
            while waiting and len(running) < jobs:
                task = waiting.popleft()
                try:
                    running[pool.submit(work, task)] = task
                except BrokenProcessPool:
                    return [task, *running.values()]
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                error = future.exception()
                if isinstance(error, BrokenProcessPool):
                    return list(running.values())
                yield running.pop(future), error or future.result()
    return []


def _begin() -> None:
    """End with the process that began this one, which alone is interrupted by Ctrl-C.

    What is logged is in the results.
    """
    keep_freed_memory()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    logging.getLogger("afm_scan_ros").addHandler(logging.NullHandler())
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@cache
def keep_freed_memory() -> None:
    """Have glibc keep the memory of freed arrays for the next ones, once in a process.

    By default it returns them to the kernel, which then clears every page anew. So do the settings
    of Dask's workers. Does nothing where there is no glibc.
    """
    with suppress(AttributeError, OSError, TypeError):
        allocator = CDLL(None)
        allocator.mallopt(MMAP_THRESHOLD, LARGEST_KEPT)
        allocator.mallopt(TRIM_THRESHOLD, MOST_KEPT)


def _keeping_memory(work: Callable[[Task], Result], task: Task) -> Result:
    keep_freed_memory()
    return work(task)


async def _connect(address: str) -> None:
    """Open a connection and close it.

    A client that cannot connect is left half open. Where the garbage collector closes it while
    another client starts, both wait for the lock of their event loops.
    """
    from distributed.comm.core import connect  # noqa: PLC0415 - of an extra

    connection = await connect(address, timeout=PATIENCE)
    await connection.close()


def on_cluster(
    work: Callable[[Task], Result], tasks: Sequence[Task], address: str
) -> Iterator[Outcome[Task, Result]]:
    """Yield as ``in_processes`` does, from the workers of a scheduler.

    Dask gives the tasks of a worker that ended to others, and ends a task that ended four of them.
    Raises InputError where no scheduler answers, or no worker joins it within ``PATIENCE``.
    """
    from distributed import Client, as_completed  # noqa: PLC0415 - of an extra

    try:
        asyncio.run(_connect(address))
    except (OSError, ValueError) as error:
        raise InputError(
            f"--scheduler {address}: no Dask scheduler answers there: start it with 'dask"
            f" scheduler' ({type(error).__name__})"
        ) from error
    with Client(address, timeout=PATIENCE) as client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError as error:
            raise InputError(
                f"--scheduler {address}: it has no workers: start some with 'dask worker {address}'"
            ) from error
        futures = client.map(partial(_keeping_memory, work), tasks, pure=False)
        running = dict(zip(futures, tasks, strict=True))
        del futures  # the workers keep a result as long as there is a future of it
        for future in as_completed(running):
            failure = future.exception()  # waits where a result was lost, for it is computed anew
            if future.cancelled():
                failure = ScanError(LOST)
            yield running.pop(future), failure or future.result()
