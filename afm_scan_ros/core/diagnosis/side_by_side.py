"""Runs tasks in parallel threads; numpy releases the interpreter lock on long records."""

from collections.abc import Callable, Iterable
from concurrent.futures import Future
from threading import Thread
from typing import TypeVar

T = TypeVar("T")


def in_parallel(task: Callable[[str], T], names: Iterable[str]) -> dict[str, T]:
    """Run a task for each name in parallel; raise the first error among them.

    The threads are daemons, so an interrupted program does not wait for them.
    """
    results: dict[str, Future[T]] = {name: Future() for name in names}
    for name, result in results.items():
        Thread(target=_fulfil, args=(result, task, name), daemon=True).start()
    return {name: result.result() for name, result in results.items()}


def _fulfil(result: "Future[T]", task: Callable[[str], T], name: str) -> None:
    try:
        result.set_result(task(name))
    except BaseException as error:  # noqa: BLE001 - it is raised where the result is asked for
        result.set_exception(error)
