"""Work that is spread: the same answers in the same order, whoever dies meanwhile."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from support.live import dask_cluster
from support.live.dask_cluster import Cluster

from controller import workers as workers_module
from controller.workers import Workers, WorkersLost, here

HANGS_S = 60.0  # no test is meant to come near


def squared(x: int) -> int:
    return x * x


def dies_once(mark: Path, x: int) -> tuple[int, int]:
    """Kills its own process at the first of the question 5."""
    if x == 5 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return x, os.getpid()


def dies(x: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return x


def meets(folder: Path, _x: int) -> int:
    """Its own process, when another one answers, too: one that starts late would find nothing left to do."""
    (folder / str(os.getpid())).touch()
    give_up_s = time.monotonic() + HANGS_S
    while len(list(folder.iterdir())) < 2 and time.monotonic() < give_up_s:
        time.sleep(0.01)
    return os.getpid()


def raises(x: int) -> int:
    if x == 3:
        raise ValueError("three")
    return x


@pytest.fixture(scope="module")
def two() -> Iterator[Workers]:
    with Workers(2) as workers:
        yield workers


def test_answers_come_in_the_order_of_the_questions(two: Workers) -> None:
    assert list(two.each(squared, range(40), 0.0)) == list(here(squared, range(40)))


def test_more_than_one_process_answers(two: Workers, tmp_path: Path) -> None:
    def pause(x: int) -> int:  # not of a module: a worker cannot have it
        return x

    with pytest.raises((AttributeError, TypeError)):
        list(two.each(pause, range(4), 0.0))
    assert len(set(two.each(partial(meets, tmp_path), range(8), 0.0)) - {os.getpid()}) == 2


def test_a_worker_that_dies_is_replaced_and_its_questions_are_asked_again(
    two: Workers, tmp_path: Path
) -> None:
    mark = tmp_path / "died"
    found = list(two.each(partial(dies_once, mark), range(30), 0.0))
    assert mark.exists() and [x for x, _ in found] == list(range(30))


def test_workers_that_die_at_once_are_one_sentence() -> None:
    with Workers(2) as workers, pytest.raises(WorkersLost, match="4 workers died one after the other"):
        list(workers.each(dies, range(4), 0.0))


def test_what_a_question_raises_is_raised_in_its_place(two: Workers) -> None:
    found = two.each(raises, range(6), 0.0)
    assert [next(found) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="three"):
        next(found)


def test_little_work_is_done_here_unless_workers_were_asked_for() -> None:
    with Workers() as workers:
        workers.count = 2
        pids = {pid for _, pid in workers.each(partial(dies_once, Path(__file__)), range(3), 0.1)}
    assert pids == {os.getpid()}


def test_workers_end_with_the_one_who_started_them() -> None:
    import subprocess
    import sys

    asks = (
        "import os, sys, time; from tests.controller.test_workers import dies_once; from pathlib import Path;"
        "from functools import partial; from controller.workers import Workers\n"
        "if __name__ == '__main__':\n"
        "    w = Workers(2); pids = {p for _, p in w.each(partial(dies_once, Path('/')), range(200), 0.0)}\n"
        "    print(*pids, flush=True); time.sleep(60)\n"
    )
    script = Path(os.environ.get("TMPDIR", "/tmp")) / f"directrix-asks-{os.getpid()}.py"
    script.write_text(asks)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[2]), *sys.path])}
    started = subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env=environment
    )
    try:
        assert started.stdout is not None
        pids = [int(word) for word in started.stdout.readline().split()]
        assert pids
    finally:
        started.kill()
        started.wait()
        script.unlink()
    until_s = time.monotonic() + HANGS_S
    while any(_lives(pid) for pid in pids) and time.monotonic() < until_s:
        time.sleep(0.05)
    assert not any(_lives(pid) for pid in pids)


def _lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def ends_its_cluster(who: int, mark: Path, x: int) -> int:
    """The question 5 kills a process of its cluster once: the worker that answers it, or another one."""
    if x == 5 and not mark.exists():
        mark.touch()
        os.kill(who or os.getpid(), signal.SIGKILL)
    return x


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    pytest.importorskip("distributed")
    with dask_cluster.opened(tmp_path, 1) as cluster:
        yield cluster


@pytest.mark.slow
def test_a_cluster_that_loses_its_last_worker_goes_on_with_the_next(cluster: Cluster, tmp_path: Path) -> None:
    mark = tmp_path / "died"
    begins = threading.Thread(target=lambda: (cluster.workers[0].wait(HANGS_S), cluster.begin_worker()))
    begins.start()
    with Workers(cluster=cluster.address) as workers:
        found = list(workers.each(partial(ends_its_cluster, 0, mark), range(30), 0.0))
    begins.join()
    assert mark.exists() and found == list(range(30))


@pytest.mark.slow
def test_a_cluster_without_workers_any_more_is_one_sentence(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers_module, "WORKER_BACK_S", 0.5)
    with Workers(cluster=cluster.address) as workers, pytest.raises(WorkersLost, match="has no workers"):
        list(workers.each(partial(ends_its_cluster, 0, tmp_path / "died"), range(30), 0.0))


@pytest.mark.slow
def test_a_cluster_without_its_scheduler_any_more_is_one_sentence(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(workers_module, "CONNECT_TIMEOUT_S", 1.0)
    ends = partial(ends_its_cluster, cluster.scheduler.pid, tmp_path / "died")
    with (
        Workers(cluster=cluster.address) as workers,
        pytest.raises(WorkersLost, match="no Dask scheduler answers there"),
    ):
        list(workers.each(ends, range(30), 0.0))
    assert "Traceback" not in capfd.readouterr().err
