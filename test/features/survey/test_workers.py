"""Workers: each task has one outcome, whatever becomes of the process that works on it."""

import gc
import os
import signal
import time
from mmap import PAGESIZE
from pathlib import Path
from platform import libc_ver
from resource import RUSAGE_SELF, getrusage

import numpy as np
import pytest
from distributed import Client, LocalCluster

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.features.survey import workers
from afm_scan_ros.features.survey.workers import in_processes, on_cluster

KILLING, BAD = 3, 5


def work(task: tuple[int, str]) -> int:
    """Square a number; one ends its process, one raises."""
    number, folder = task
    if number == BAD:
        raise ValueError("bad")
    if number == KILLING:
        with (Path(folder) / "killed").open("a") as stream:
            stream.write("x")
        os._exit(1)
    return number**2


def killed_once(task: tuple[int, str]) -> int:
    """Square a number; one ends its process, the first time that it is tried."""
    number, folder = task
    if number == KILLING and not (Path(folder) / "killed").exists():
        (Path(folder) / "killed").touch()
        os._exit(1)
    return number**2


def pid(_: int) -> int:
    """Say which process this is, and stay in it."""
    time.sleep(0.01)
    return os.getpid()


@pytest.mark.evidence
def test_a_killed_process_costs_no_other_task(tmp_path: Path) -> None:
    tasks = [(number, str(tmp_path)) for number in range(8)]
    found = dict(outcomes := list(in_processes(work, tasks, 2)))
    assert len(outcomes) == len(found) == 8
    assert isinstance(found.pop(tasks[KILLING]), ScanError)
    assert isinstance(found.pop(tasks[BAD]), ValueError)
    assert found == {task: task[0] ** 2 for task in found}
    assert (tmp_path / "killed").read_text("utf-8") == "xx"


@pytest.mark.evidence
def test_a_task_whose_process_was_killed_is_tried_again(tmp_path: Path) -> None:
    tasks = [(number, str(tmp_path)) for number in range(6)]
    found = list(in_processes(killed_once, tasks, 2))
    assert sorted(found) == [(task, task[0] ** 2) for task in tasks]


def test_the_work_is_done_in_as_many_other_processes() -> None:
    found = {result for _, result in in_processes(pid, range(20), 2)}
    assert 1 <= len(found) <= 2
    assert os.getpid() not in found
    assert list(in_processes(pid, [], 2)) == []


def faults(_: int) -> float:
    """Share of the pages of arrays, made and freed again and again, that fault each time."""
    length, arrays, times = 2**19, 8, 5

    def fill() -> None:
        for array in [np.empty(length) for _ in range(arrays)]:
            array[:] = 1.0

    fill()
    before = getrusage(RUSAGE_SELF).ru_minflt
    for _ in range(times):
        fill()
    pages = times * arrays * length * 8 // PAGESIZE
    return (getrusage(RUSAGE_SELF).ru_minflt - before) / pages


@pytest.mark.evidence
@pytest.mark.skipif(libc_ver()[0] != "glibc", reason="another allocator")
def test_workers_keep_the_memory_of_arrays_that_are_freed() -> None:
    options = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None}
    with LocalCluster(host="127.0.0.1", silence_logs=50, **options) as cluster:
        ((_, on_dask),) = on_cluster(faults, [1], cluster.scheduler_address)
    ((_, here),) = in_processes(faults, [1], 1)
    assert isinstance(on_dask, float)
    assert isinstance(here, float)
    assert max(on_dask, here) < 0.1


@pytest.mark.evidence
def test_a_cluster_loses_nothing_with_a_worker(tmp_path: Path) -> None:
    tasks = [(number, str(tmp_path)) for number in range(8)]
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with LocalCluster(host="127.0.0.1", silence_logs=50, **options) as cluster:
        address = cluster.scheduler_address
        found = list(on_cluster(killed_once, tasks, address))
        again = list(on_cluster(work, [tasks[BAD]], address))
    assert sorted(found) == [(task, task[0] ** 2) for task in tasks]
    assert (tmp_path / "killed").exists()
    ((_, error),) = again
    assert isinstance(error, ValueError)


@pytest.mark.evidence
def test_a_result_that_is_lost_with_its_worker_is_computed_anew() -> None:
    options = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None}
    with LocalCluster(host="127.0.0.1", silence_logs=50, **options) as cluster:
        found = on_cluster(pid, range(3), cluster.scheduler_address)
        _, first = next(found)
        while cluster.scheduler.total_occupancy:
            time.sleep(0.01)
        (worker,) = cluster.scheduler.workers
        os.kill(first, signal.SIGKILL)
        while worker in cluster.scheduler.workers:
            time.sleep(0.01)
        results = [result for _, result in found]
    assert first not in results
    assert all(isinstance(result, int) for result in results)


@pytest.mark.parametrize("address", ["nowhere", "tcp://127.0.0.1:9"])
def test_a_scheduler_that_does_not_answer_is_named(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "PATIENCE", 2.0)
    said = f"--scheduler {address}: no Dask scheduler answers there"
    with pytest.raises(InputError, match=said):
        list(on_cluster(pid, [1], address))
    # The garbage collector would close one while the next test's starts, and both would hang.
    clients = [thing for thing in gc.get_objects() if type(thing) is Client]
    assert {client.status for client in clients} <= {"closed"}


def test_a_scheduler_without_workers_is_not_waited_for_without_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers, "PATIENCE", 2.0)
    options = {"n_workers": 0, "dashboard_address": None, "silence_logs": 50}
    with (
        LocalCluster(host="127.0.0.1", **options) as cluster,
        pytest.raises(InputError, match="it has no workers: start some with 'dask worker tcp"),
    ):
        list(on_cluster(pid, [1], cluster.scheduler_address))
