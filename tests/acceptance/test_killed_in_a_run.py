"""Example 2 on the service of a simulated machine, killed or stopped at random instants: the rest is cut.

A hundred kills and stops of plan, tick, panel and service, with what came of each:

    DIRECTRIX_KILLS=15 python -m pytest -m "slow or live" -s -n 0 tests/acceptance/test_killed_in_a_run.py

What was cut before the kill and after the restart is made again on the stepped clock out of the
records: the same setpoints bit for bit, so what holds there held on the machine. A seed is
printed; ``DIRECTRIX_SEED`` repeats it, and ``DIRECTRIX_KILLS`` (default 1) asks for more instants.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import stored_journal
from support.fakes.fake_engine import served
from support.live.live_machines import gone, until
from support.live.replayed_runs import Again, again, assert_cut, assert_same_setpoints, facts, records
from support.live.served_machine import ROOT, Serving, Values, calm, calm_machine, serving
from support.machines.interrupted_runs import fresh, rest_of, resumed
from support.machines.stepped_runs import program

from controller import messages
from controller.ipc.handoff import COLUMN
from controller.machine import setup_data
from controller.plan.restart.program_position import ENTRY_ID, Spot
from controller.service import restart_preview
from controller.service.journal import Entry
from controller.state.modes import Mode

pytestmark = [pytest.mark.slow, pytest.mark.live]

TEXT = program("example2_ready.ngc", "1000.").replace("S12000 M3", "").replace("N220 M5\n", "")
MACHINE = calm_machine()
BEGIN = Spot(1, 0.0, 0, 0.0)
TRUE_S = 0.1  # after a kill the status says so
MAX_LOST_S = 1.0  # of cut, after a power loss or without a tick
SEED = int(os.environ.get("DIRECTRIX_SEED") or random.randrange(1_000_000))
WAY_OFF = 0.85  # of the program: behind it the tool leaves the part, and no path is left to be beside of
KILLS = int(os.environ.get("DIRECTRIX_KILLS") or 1)


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    folder = tmp_path_factory.mktemp("killed")
    with serving(folder, *calm(folder)) as running:
        running.ready()
        running.put_in(2)
        running.until(lambda _: records(running.state), "the record of the tool")
        yield running


@pytest.fixture(params=range(KILLS))
def instant(request: pytest.FixtureRequest) -> float:
    """A share of the program; most of it is cut."""
    seed = f"{SEED}-{request.param}-{request.node.originalname}"
    share = random.Random(seed).uniform(0.0, 0.95)
    print(f"DIRECTRIX_SEED={SEED} DIRECTRIX_KILLS={KILLS}: {request.node.name} at {share:.3f} of the program")
    return share


def until_in(service: Serving, share: float) -> Values:
    """The program is loaded, started, and has come so far; whatever a case before this one has left."""
    if service.status()["mode"] in ("OFF", "FAULT"):
        service.done("reset")
        service.home()
    service.load(TEXT)
    planned_s = service.status()["job"]["duration_s"]
    service.done("start")
    now = service.until(
        lambda now: now["mode"] == "READY" or (now["job"]["elapsed_s"] or 0.0) >= share * planned_s
    )
    if now["mode"] == "READY":  # nobody had time to look
        service.ended()
        return until_in(service, 0.8 * share)
    return now


def killed_s(service: Serving, role: str) -> float:
    """When the process was no more: a busy kernel takes its time to end one."""
    pid = service.pid(role)
    os.kill(pid, signal.SIGKILL)
    until(lambda: gone([pid]))
    return time.monotonic()


def told_within_s(service: Serving, since_s: float, holds: Callable[[Values], bool]) -> float:
    """How long after the kill the first status said so; one that was asked for after ``TRUE_S`` must."""
    while True:
        asked_s = time.monotonic()
        if holds(service.status()):
            return time.monotonic() - since_s
        assert asked_s - since_s < TRUE_S, "a status that is not true"


def interrupted(service: Serving, at_least: int) -> tuple[Path, Entry]:
    """The record of the run that was killed, and the journal as it was then."""
    service.until(lambda _: len(records(service.state)) >= at_least, "the record")
    entry = stored_journal.read(service.state)
    assert entry is not None
    return records(service.state)[-1], entry


def finish(service: Serving) -> Path:
    """The rest, as the journal offers it; the record. Where a tool is asked for, it is there."""
    before = len(records(service.state))
    service.done("load", path=str(service.state / "part.ngc"), name="part.ngc", restart=True)
    service.done("start")
    while (now := service.until(stands, "the end"))["mode"] == "HOLD":
        service.ask("resume")
        service.until(lambda now: now["mode"] != "HOLD")
    assert now["job"]["state"] == "completed", now
    service.until(lambda _: len(records(service.state)) > before, "the record")
    return records(service.state)[-1]


def stands(now: Values) -> bool:
    over = not now["job"] or now["job"]["state"] not in ("starting", "running", "stopping")
    return over and now["at_rest"] and now["mode"] in ("READY", "HOLD", "OFF", "FAULT")


def program_rows(done: Again) -> np.ndarray:
    """Ticks of the run, as far as it went, in which the program itself was moved along."""
    rows = done.run.rows[: len(done.live)]
    ids = rows[:, COLUMN["motion_id"]]
    return rows[(ids >= 0) & (ids < ENTRY_ID) & (rows[:, COLUMN["mode"]] == Mode.RUNNING)]


def places(rows: np.ndarray) -> list[tuple[int, float]]:
    return [(int(row[COLUMN["motion_id"]]), float(row[COLUMN["s"]])) for row in rows]


def assert_at_or_before(entry: Entry, first: Again, until_then: Again | None = None) -> None:
    """The restart begins at or before where the tool was led, and costs at most a second of the cut
    ``until_then``.
    """
    rows = program_rows(first)
    gone = places(rows)
    if not gone:
        return  # on the way into the program
    begin = (entry.spot.motion_id, entry.spot.s)
    assert begin <= gone[-1], (begin, gone[-1])
    cut = gone if until_then is None else places(program_rows(until_then))
    again_s = sum(place > begin for place in cut) * first.stepped.machine.period_s
    assert again_s <= MAX_LOST_S, again_s


def assert_rest(folder: Path, entry: Entry) -> None:
    """As recorded, and within 1e-6 mm of the program."""
    rest = again(folder, TEXT, MACHINE)
    show(entry, rest, folder.name)
    assert_same_setpoints(rest)
    assert_cut(rest, TEXT, entry.spot)


def tells_of_no_tick(now: Values) -> bool:
    fault = now["fault"] or {}
    return not now["tick_alive"] and now["mode"] == "FAULT" and fault.get("name") == "CONTROLLER_GONE"


def show(entry: Entry, rest: Again, what: str) -> None:
    """Where the journal has it that the tool stood, and where the restart joined the program."""
    rows = program_rows(rest)
    joined = places(rows)[0] if len(rows) else (entry.spot.motion_id, entry.spot.s)
    print(f"{what}: stood at motion {entry.spot.motion_id}, {entry.spot.s:.6f} mm; joined at {joined}")


def test_a_killed_plan_costs_nothing_of_the_cut(service: Serving, instant: float) -> None:
    done = len(records(service.state))
    until_in(service, instant)
    took_s = told_within_s(service, killed_s(service, "plan"), lambda now: not now["plan_alive"])
    print(f"plan killed: told after {1e3 * took_s:.0f} ms")
    now = service.until(stands)
    folder, entry = interrupted(service, done + 1)
    service.until(lambda now: now["plan_alive"])
    if now["mode"] == "READY" and now["job"]["state"] == "completed":
        return  # all of it had been planned, and was run to its end
    assert not now["not_homed"]
    if not entry.exact:  # the standstill was seen here before it was written there
        service.until(lambda _: stored_journal.read(service.state) != entry, "the standstill")
        _, entry = interrupted(service, done + 1)
    assert entry.exact
    service.done("reset" if now["mode"] == "FAULT" else "unload")
    service.done("enable")
    before = now["joints"]
    assert service.status()["joints"].keys() == before.keys()
    assert facts(folder)["result"] in ("fault", "stopped")
    assert_rest(finish(service), entry)


def test_a_killed_tick_costs_at_most_a_second_of_cut(service: Serving, instant: float) -> None:
    done = len(records(service.state))
    until_in(service, min(instant, WAY_OFF))
    took_s = told_within_s(service, killed_s(service, "tick"), tells_of_no_tick)
    print(f"tick killed: told after {1e3 * took_s:.0f} ms")
    service.until(lambda now: not now["tick_alive"] and now["fault"], "the loss")
    folder, entry = interrupted(service, done + 1)
    first = again(folder, TEXT, MACHINE)
    assert_same_setpoints(first, ended_itself=False)
    assert_at_or_before(entry, first)
    service.done("reset")
    told = [messages.text(one) for one in service.ask("alarms")["alarms"] if one["name"] == "BESIDE_THE_PATH"]
    assert "mm beside the path" in told[0]
    service.ready()
    assert_rest(finish(service), entry)


def test_a_killed_panel_costs_nothing_at_all(service: Serving, instant: float) -> None:
    where = ("--state", str(service.state), "--runtime", str(service.runtime), "--port", "0")
    with open(service.state / "panel.log", "ab") as log:
        panel = subprocess.Popen(
            [sys.executable, "-m", "controller", "panel", *where],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=log,
            stderr=log,
        )
    try:
        done = len(records(service.state))
        until_in(service, instant)
    finally:
        panel.send_signal(signal.SIGKILL)
        panel.wait()
    now = service.until(stands)
    assert (now["mode"], now["job"]["state"]) == ("READY", "completed")
    service.until(lambda _: len(records(service.state)) > done)
    whole = again(records(service.state)[-1], TEXT, MACHINE)
    assert_same_setpoints(whole)
    assert_cut(whole, TEXT, BEGIN)


def test_a_power_loss_costs_at_most_a_second_of_cut_and_starts_nothing(
    tmp_path: Path, instant: float
) -> None:
    """The service's own process, and with it all others and the simulated drives."""
    with serving(tmp_path, *calm(tmp_path)) as service:
        service.ready()
        service.put_in(2)
        until_in(service, instant)
        pids = [service.pid("tick"), service.pid("plan")]
        service.process.send_signal(signal.SIGKILL)
        service.process.wait()
        until(lambda: gone(pids))
    entry = stored_journal.read(tmp_path / "state")
    assert entry is not None and not entry.ended
    with serving(tmp_path, *calm(tmp_path)) as service:
        service.up()
        now = service.status()
        assert (now["mode"], len(now["not_homed"])) == ("OFF", 5)
        error = service.refused("load", path=str(service.state / "part.ngc"), restart=True)
        assert "home all of them first" in error.sentence
        service.home()
        assert_rest(finish(service), entry)


def alarms(raised: list[Values]) -> set[tuple[int, str]]:
    return {(one["id"], one["name"]) for one in raised}


def test_a_folder_copied_in_a_cut_is_gone_on_with_elsewhere(
    service: Serving, tmp_path: Path, instant: float
) -> None:
    """As a back-up of the disk has it, file by file while the machine cuts on."""
    done, before = len(records(service.state)), alarms(service.ask("alarms")["alarms"])
    ticks = [until_in(service, min(instant, WAY_OFF))["tick"]["number"]]
    shutil.copytree(service.state, tmp_path / "state")
    ticks.append(service.status()["tick"]["number"])
    service.ask("stop")
    service.ended()
    service.until(lambda _: len(records(service.state)) > done, "the record")
    folder = records(service.state)[-1]
    whole, first_tick = again(folder, TEXT, MACHINE), facts(folder)["first_tick"]
    assert_same_setpoints(whole)
    begun, copied = (replace(whole, live=whole.live[: max(0, tick - first_tick)]) for tick in ticks)
    other = served(tmp_path, setup_data.noted(tmp_path / "state"))
    try:
        entry = other.journal.last
        assert entry is not None and alarms(other.alarms.list()) <= before, (
            "opening the copy reports no damage"
        )
        if entry.ended:  # a computer so busy that the cut was over before it was copied
            assert facts(folder)["result"] == "completed"
            return
        job = restart_preview.gone_on_with(other, {"path": str(other.state / "part.ngc"), "name": "part.ngc"})
    finally:
        other.close()
    assert job.program.spot == entry.spot
    assert_at_or_before(entry, copied, begun)
    left = rest_of(TEXT, entry.spot, MACHINE, whole.start)
    rest = resumed(fresh(MACHINE), left, in_spindle=2)
    assert_cut(replace(whole, run=rest.run, stepped=rest.stepped), TEXT, entry.spot)


@pytest.mark.parametrize("role", ("plan", "tick", "service"))
def test_a_process_that_stands_for_a_while_costs_nothing_of_the_cut(
    service: Serving, instant: float, role: str
) -> None:
    """SIGSTOP and SIGCONT. A tick that stands for long is taken for gone by the drives, which then stop."""
    done = len(records(service.state))
    until_in(service, instant)
    pid = service.process.pid if role == "service" else service.pid(role)
    seconds = random.Random(f"{instant}{role}").uniform(0.1, 1.5)
    os.kill(pid, signal.SIGSTOP)
    try:
        if role == "tick":
            took_s = told_within_s(service, time.monotonic(), lambda now: now["tick"]["age_s"] > 0.04)
            print(f"tick stopped: its age is told after {1e3 * took_s:.0f} ms")
        time.sleep(seconds)
    finally:
        os.kill(pid, signal.SIGCONT)
    now = service.until(stands)
    print(f"{role} stood for {seconds:.2f} s: {now['mode']}, {now['job']['state']}")
    if now["job"]["state"] == "completed":
        service.until(lambda _: len(records(service.state)) > done)
        whole = again(records(service.state)[-1], TEXT, MACHINE)
        assert_same_setpoints(whole)
        assert_cut(whole, TEXT, BEGIN)
        return
    assert now["mode"] == "FAULT" and now["fault"], now
    _, entry = interrupted(service, done + 1)
    service.done("reset")
    service.home()
    assert_rest(finish(service), entry)
