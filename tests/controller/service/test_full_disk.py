"""A service on a disk that is full: what ends the run is kept, all the same."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.fakes import cutting_service
from support.fakes.fake_engine import engine_of, served
from support.machines.planning_bench import Bench
from support.machines.stepped_runs import program

from controller.ipc.handoff import COLUMN
from controller.messages import message
from controller.service import journal, room, thread_guard
from controller.state.modes import Fault, Mode, Request
from controller.store import service_store
from controller.store.set_up_store import SPINDLE

TEXT = program("example2_ready.ngc", "1000.")


@pytest.fixture
def small(tmp_path: Path) -> Iterator[Path]:
    """On a disk of 24 MB."""
    mount = ["mount", "-t", "tmpfs", "-o", "size=24m", "none", str(tmp_path)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("no file system may be mounted here")
    yield tmp_path
    subprocess.run(["umount", "-l", str(tmp_path)], check=True)


def fill(folder: Path) -> None:
    with (folder / "others").open("ab", buffering=0) as file:
        while free := shutil.disk_usage(folder).free:
            file.write(bytes(min(free, 1 << 20)))


def test_an_emergency_stop_on_a_full_disk_is_kept_and_so_is_where_the_run_was(
    small: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However long the run went on after nothing more could be written."""
    monkeypatch.setattr(room, "SPARE_BYTES", 1 << 20)  # else no run begins here
    service = served(small)
    cutting_service.cut(service)
    service.watch.look()
    fill(small)
    for n in range(600):  # half a minute more than the reserve is enough for
        service.alarms.add("TEST", message("stopped"))
        service.journal.keep()
        assert service.journal.problem == "", n
    fill(small)
    engine = engine_of(service)
    engine.now = engine.now._replace(mode=Mode.FAULT, fault=Fault.EMERGENCY_STOP, fault_axis=-1, at_rest=True)
    service.watch.look()
    assert service.journal.problem == ""
    killed = small.parent / f"{small.name}-killed"
    killed.mkdir()
    for file in service.state.glob(f"{service_store.FILE}*"):
        shutil.copy(file, killed)
    try:
        for state in (service.state, killed):
            with contextlib.closing(service_store.ServiceStore(state)) as store:
                assert store.losses == []
                entry = journal.read(store)
                assert entry is not None and entry.fault == "EMERGENCY_STOP" and not entry.ended
                newest = store.rows("SELECT facts FROM alarms ORDER BY id DESC LIMIT 1")[0][0]
                assert '"EMERGENCY_STOP"' in newest
    finally:
        shutil.rmtree(killed)
        service.close()
    fill(small)
    after = served(small)  # nor does that forbid the next start
    assert after.interrupted is not None and after.interrupted.fault == "EMERGENCY_STOP"
    assert "EMERGENCY_STOP" in {alarm["name"] for alarm in after.alarms.list()}
    after.close()


@pytest.mark.parametrize("document", [thread_guard.DOCUMENT, SPINDLE])
def test_a_tool_in_a_thread_or_in_the_spindle_is_known_after_a_full_disk(
    document: str, small: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(room, "SPARE_BYTES", 1 << 20)
    service = served(small)
    fill(small)
    now = engine_of(service).now._replace(thread_pitch_mm=1.0)
    for n in range(1, 200):
        if document == SPINDLE:
            service.set_up.put_in(n)
            assert service.store.document(SPINDLE, int, 0) == n
        else:
            service.thread.look(now._replace(thread_rev=float(n)), "a.ngc")
            assert service.store.document(document, thread_guard.taken, None) == service.thread.found
    service.close()


def test_a_folder_that_takes_nothing_ends_the_start_in_a_sentence(small: Path) -> None:
    served(small).close()
    subprocess.run(["mount", "-o", "remount,ro", str(small)], check=True)
    with pytest.raises(OSError, match="Read-only"):
        served(small)


@pytest.mark.parametrize("takes_nothing", [False, True])
def test_an_emergency_stop_in_a_cut_is_gone_on_with_whatever_the_disk_took(
    takes_nothing: bool, small: Path
) -> None:
    """From the tick on, with the service's own plan: one that takes nothing is told, and has it all later."""
    bench = Bench(small)
    bench.armed(TEXT)
    bench.rows.append(bench.stepped.go(1000))
    fill(small)
    bench.store.rows(f"PRAGMA query_only = {int(takes_nothing)}")  # as of a disk that was remounted
    bench.rows.append(bench.stepped.go(300))
    bench.request(Request.ESTOP)
    modes, follow = bench.stepped.cycle.modes, bench.stepped.cycle.follow
    bench.go(lambda: modes.mode is Mode.FAULT and follow.at_rest)
    bench.rows.append(bench.stepped.go(400))
    led = bench.program_rows()[-1]
    assert modes.fault is Fault.EMERGENCY_STOP
    assert bool(bench.journal.problem) is takes_nothing
    bench.store.rows("PRAGMA query_only = 0")
    bench.rows.append(bench.stepped.go(400))
    assert not bench.journal.problem
    again = Bench(small)  # after a reset of all
    entry = again.offered(TEXT)
    assert entry.fault == "EMERGENCY_STOP" and entry.spot.motion_id == int(led[COLUMN["motion_id"]])
    assert 0.0 <= float(led[COLUMN["s"]]) - entry.spot.s < 20.0  # a second of feed
    again.armed(TEXT, spot=entry.spot, start=entry.job.start, in_spindle=2)
    again.until(Mode.READY)
    again.assert_cut(TEXT, again.machine, entry.spot)
