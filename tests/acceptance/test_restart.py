"""Programs interrupted anywhere: what is left is cut as if nothing had been, after a restart or a look."""

from __future__ import annotations

import random
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.machines import stepped_runs
from support.machines.interrupted_runs import (
    EXAMPLE_2,
    LINES,
    TIPS,
    Items,
    along,
    assert_in_limits,
    assert_rest_is_cut,
    assert_sound,
    distance,
    fresh,
    program_rows,
    rest_of,
    resumed,
    segments,
    source,
    until,
    with_tool,
)
from support.machines.stepped_runs import Cut, cut
from support.suite import seed as suite_seed

from controller import messages
from controller.ipc.handoff import COLUMN, Jog, Snapshot, send_jog
from controller.machine.model import Joints, Machine
from controller.plan.restart import restart
from controller.plan.restart.program_position import Spot
from controller.runtime import starts
from controller.runtime.stepped import SteppedMachine
from controller.service import journal
from controller.service.journal import Journal
from controller.state.modes import Mode, Request
from controller.store.service_store import ServiceStore

PROGRAMS = {"example 2": EXAMPLE_2, "lines": LINES, "tips": TIPS}
BEGIN = "G21 G90 G54 G17 G61 T2 M6\nS8000 M3\nG43 H2\nG0 X0. Y0. Z60.\nG1 Z20. F1500.\n"
END = "G0 Z80.\nM30\n"
SUB = "G91 G1 X5. F1500.\nY4.\nG90\nM99\n"
OF_FANUC = {  # of what changes the meaning of words, or the order of lines
    "G51.1": f"{BEGIN}G51.1 X5.\nG1 X10. Y5.\nG2 X20. Y-5. R30.\nG1 X3. ,R2.\nY20. ,C1.\nX-10.\nG50.1\n{END}",
    "G16": f"{BEGIN}G16\nG1 X15. Y30.\nY60.\nG91 Y30.\nG90 X20.\nG15\nX0. Y0.\n{END}",
    "G254": f"{BEGIN}G254\nG1 X10. A10.\nY10. A-10. C20.\nX0.\nG255\nX5. Y5.\nG0 Z80.\nA0. C0.\nM30\n",
    "G68.2": f"{BEGIN}G0 Z60.\nG68.2 P2 Q1 X0. Y0. Z10.\nG68.2 P2 Q2 X10. Y0. Z10.\n"
    "G68.2 P2 Q3 X0. Y10. Z12.\nG53.1\nG0 X0. Y0. Z60.\nG1 Z10.\nX10. Y5.\nG3 X0. Y15. R20.\nG0 Z80.\nM30\n",
    "G13": f"{BEGIN}G13 I8. K16. Q4. Z15. D2\nG91 G12 I6. Z-1. L3 D2\nG90\n{END}",
    "G52": f"{BEGIN}G52 X5. Y-3. Z1.\nG68 X1. Y2. R30.\nG1 X10.\nY10.\nG69\nX0.\nG52 X0. Y0. Z0.\nX1.\n{END}",
    "M97": f"{BEGIN}M97 P100 L2\nG1 X1.\nM30\nN100 {SUB}",
    "M98": f"{BEGIN}M98 P1000 L2\nG1 X1.\nM30\nO1000\n{SUB}",
}


def slow(value: object) -> object:
    return pytest.param(value, marks=pytest.mark.soak)


SAME = 1e-6  # mm or rad
PERIOD_S = 0.004
JOINTS = slice(COLUMN["joint_command_0"], COLUMN["joint_command_0"] + 5)


def shipped(name: str = "trunnion", **changes: object) -> Machine:
    return stepped_runs.shipped(name, period_s=PERIOD_S, **changes)


@cache
def undisturbed(name: str, machine: str = "trunnion") -> Cut:
    return cut(PROGRAMS[name], shipped(machine))


def instants(name: str, machine: str, seed: int, count: int) -> list[int]:
    """Ticks of the run, most of them while it cuts."""
    rng, rows = random.Random(seed), undisturbed(name, machine).rows
    return sorted(rng.sample(range(20, len(rows) - 20), count))


def spot_at(done: Cut, tick: int) -> Spot:
    """The place of the last motion up to a tick."""
    rows = done.rows[: tick + 1]
    row = rows[rows[:, COLUMN["motion_id"]] >= 0.0][-1]
    return Spot(int(row[COLUMN["line"]]), 0.0, int(row[COLUMN["motion_id"]]), float(row[COLUMN["s"]]))


def assert_goes_on(name: str, machine: str, spot: Spot, stepped: SteppedMachine) -> None:
    """From a machine that stands somewhere the rest is cut as it was to be."""
    rest = rest_of(PROGRAMS[name], spot, stepped.machine)
    done = resumed(stepped, rest)
    assert_sound(done, (name, machine, spot))
    wanted = segments(PROGRAMS[name], stepped.machine)
    assert distance(done.rows, wanted, stepped.kinematics) < SAME
    assert_rest_is_cut(done.rows, wanted, rest.spot)
    assert np.abs(done.joints[-1] - undisturbed(name, machine).joints[-1]).max() < 1e-9


def restarts(name: str, machine: str, seed: int, count: int) -> None:
    """Again and again on one machine, each time from where the last one has left it."""
    stepped = fresh(shipped(machine))
    for tick in instants(name, machine, seed, count):
        assert_goes_on(name, machine, spot_at(undisturbed(name, machine), tick), stepped)


def test_a_restart_at_a_random_instant_cuts_the_rest_as_the_whole_run_did() -> None:
    restarts("lines", "trunnion", 3, 1)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", PROGRAMS)
def test_restarts_anywhere(name: str, seed: int) -> None:
    restarts(name, "trunnion", 50 + seed, 5)


@pytest.mark.soak
@pytest.mark.parametrize("machine", ["fig4c", "table_head", "head_head", "oblique45"])
def test_restarts_anywhere_of_example_2_on_other_machines(machine: str) -> None:
    restarts("example 2", machine, 7, 5)


@pytest.mark.slow
@pytest.mark.parametrize("code", OF_FANUC)
def test_restarts_anywhere_of_what_fanucs_controls_read_otherwise(code: str) -> None:
    machine, text = shipped(dialect="fanuc", without_point="unit", unset=()), OF_FANUC[code]
    whole = cut(text, machine)
    assert whole.run.result == "completed", whole.run.fault_text
    rng, stepped = random.Random(f"{suite_seed.SEED} {code}"), fresh(machine)
    for tick in sorted(rng.sample(range(20, len(whole.rows) - 20), 3)):
        rest = rest_of(text, spot_at(whole, tick), machine)
        done = resumed(stepped, rest)
        assert_sound(done, (code, tick))
        wanted = segments(text, stepped.machine)
        assert distance(done.rows, wanted, stepped.kinematics) < SAME
        assert_rest_is_cut(done.rows, wanted, rest.spot)
        assert np.abs(done.joints[-1] - whole.joints[-1]).max() < 1e-9


# --- the journal


def looking(stepped: SteppedMachine, kept: Journal) -> Snapshot:
    now = stepped.board.read()
    assert now is not None
    spot = stepped.planner.spot(now)
    known = journal.RunProgress(spot.fraction if spot is not None else 0.0)
    kept.look(now, stepped.recorder.last, lambda *_: known)
    return now


def job(name: str, stepped: SteppedMachine) -> journal.Job:
    return journal.Job.of(
        name, PROGRAMS[name].encode(), stepped.machine, source(PROGRAMS[name], stepped.machine).start
    )


def run_for(stepped: SteppedMachine, kept: Journal, ticks: int, modes: tuple[Mode, ...] = ()) -> np.ndarray:
    """Time passes with a look at every tenth tick."""
    rows = []
    for _ in range(ticks // 10):
        rows.append(stepped.go(10))
        looking(stepped, kept)
        if stepped.cycle.modes.mode in modes and stepped.cycle.follow.at_rest:
            break
    return np.concatenate(rows)


def last_place(rows: np.ndarray) -> tuple[int, float]:
    row = program_rows(rows)[-1]
    return int(row[COLUMN["motion_id"]]), float(row[COLUMN["s"]])


@pytest.mark.parametrize("how", [Request.HOLD, *map(slow, [Request.STOP, Request.ESTOP])])
def test_at_every_standstill_the_journal_has_the_very_place_and_the_rest_is_cut_from_there(
    how: Request, tmp_path: Path
) -> None:
    stepped, store = fresh(shipped()), ServiceStore(tmp_path)
    clock = lambda: stepped.clock.now_s()  # noqa: E731
    kept = Journal(store, clock)
    kept.begin(job("example 2", stepped))
    stepped.begin(Items(rest_of(EXAMPLE_2, Spot(1, 0.0), stepped.machine).items))
    tick = instants("example 2", "trunnion", 8, 1)[0] // 2 + 750
    rows = run_for(stepped, kept, tick)
    if how is Request.STOP:
        stepped.planner.drop()
    stepped.request(how)
    rows = np.concatenate([rows, run_for(stepped, kept, 4000, (Mode.HOLD, Mode.READY, Mode.FAULT))])
    entry = journal.read(store)
    assert entry is not None and not entry.ended
    if how is Request.ESTOP:  # each drive by a ramp of its own: at or before where the path was left
        assert not entry.exact and (entry.spot.motion_id, entry.spot.s) <= last_place(rows)
    else:
        assert entry.exact and (entry.spot.motion_id, entry.spot.s) == last_place(rows)
    again = fresh(shipped())
    now = job("example 2", again)
    assert journal.refusal(entry, now, 0x1F, 0, 5) is None
    assert_goes_on("example 2", "trunnion", journal.spot_of(entry, now), again)


@pytest.mark.soak
def test_after_a_power_loss_the_journal_is_at_or_before_what_was_cut_and_at_most_a_second_of_it(
    tmp_path: Path,
) -> None:
    stepped, store = fresh(shipped()), ServiceStore(tmp_path)
    kept = Journal(store, lambda: stepped.clock.now_s())
    kept.begin(job("example 2", stepped))
    stepped.begin(Items(rest_of(EXAMPLE_2, Spot(1, 0.0), stepped.machine).items))
    rng, looked, a_second_mm = random.Random(4), 0, 1000.0 / 60.0
    while stepped.cycle.modes.mode is not Mode.READY or looked == 0:
        rows = run_for(stepped, kept, 10 * rng.randrange(5, 60))
        entry = journal.read(store)
        here = spot_at_row(rows[-1], entry.spot) if entry is not None else None
        if entry is None or here is None or entry.exact:
            continue
        assert entry.spot.s <= here
        if rows[-1][COLUMN["cutting"]]:
            looked += 1
            assert here - entry.spot.s <= a_second_mm
    assert looked > 5


def spot_at_row(row: np.ndarray, spot: Spot) -> float | None:
    """The s of a row, if it is on the motion of the spot."""
    return float(row[COLUMN["s"]]) if int(row[COLUMN["motion_id"]]) == spot.motion_id else None


@pytest.mark.soak
def test_a_program_that_came_to_its_end_is_not_gone_on_with(tmp_path: Path) -> None:
    stepped, store = fresh(shipped()), ServiceStore(tmp_path)
    kept = Journal(store, lambda: stepped.clock.now_s())
    kept.begin(job("lines", stepped))
    stepped.begin(Items(rest_of(LINES, Spot(1, 0.0), stepped.machine).items))
    run_for(stepped, kept, 40_000, (Mode.READY,))
    assert stepped.planner.finished_path
    kept.completed(looking(stepped, kept))
    entry = journal.read(store)
    assert entry is not None and entry.ended
    assert "no interrupted program" in messages.text(journal.refusal(entry, entry.job, 0x1F, 0, 5))


# --- hold, look, go on


class Operator:
    """Holds a program on the stepped machine, leads the tool off and back, and goes on."""

    def __init__(self, text: str, machine: Machine | None = None) -> None:
        self.text, self.stepped = text, fresh(machine or shipped())
        self.rows: list[np.ndarray] = []
        self.stepped.begin(Items(rest_of(text, Spot(1, 0.0), self.stepped.machine).items))

    @property
    def now(self) -> Snapshot:
        found = self.stepped.board.read()
        assert found is not None
        return found

    @property
    def joints(self) -> Joints:
        return self.stepped.joints

    def hold_at(self, ticks: int) -> None:
        self.rows.append(self.stepped.go(ticks))
        self.stepped.request(Request.HOLD)
        self.rows += [self.stepped.go(5), until(self.stepped, Mode.HOLD)]

    def retract(self, by_mm: float) -> None:
        self.stepped.planner.retract(self.now, by_mm)
        self.rows.append(along(self.stepped))

    def go_back(self, *how: object) -> None:
        self.stepped.planner.go_back(self.now, *how)  # type: ignore[arg-type]
        self.rows.append(along(self.stepped))

    def jog(self, axis: int, by: float, speed: float = 20.0) -> None:
        direction = tuple(float(np.sign(by)) * (i == axis) for i in range(5))
        send_jog(self.stepped._operator, Jog(direction, speed, abs(by)))  # type: ignore[arg-type]
        self.rows += [self.stepped.go(20), until(self.stepped, Mode.HOLD)]

    def finish(self) -> np.ndarray:
        self.stepped.request(Request.RESUME)
        self.rows += [self.stepped.go(5), until(self.stepped, Mode.READY)]
        return np.concatenate(self.rows)


def tick_of(seed: int, name: str = "example 2") -> int:
    """An instant while the program cuts."""
    done = undisturbed(name)
    cutting = np.flatnonzero(np.isin(done.column("motion_id"), _feeds(name)))
    return int(random.Random(seed).choice(list(cutting[10:-10])))


def _feeds(name: str) -> list[int]:
    wanted = segments(PROGRAMS[name], shipped())
    return [number for number, segment in wanted.items() if segment.feed_mm_s is not None]


def look_and_go_on(name: str, seed: int) -> None:
    operator = Operator(PROGRAMS[name])
    operator.hold_at(tick_of(seed, name))
    held = operator.joints
    rng = random.Random(seed)
    operator.retract(rng.uniform(2.0, 15.0))
    operator.jog(0, rng.uniform(-30.0, 30.0))
    operator.jog(1, rng.uniform(-20.0, 20.0))
    operator.jog(2, rng.uniform(1.0, 10.0))
    operator.go_back()
    assert np.abs(np.subtract(operator.joints, held)).max() > 0.5, "off the part"
    rows = operator.finish()
    wanted = segments(PROGRAMS[name], operator.stepped.machine)
    assert distance(rows, wanted, operator.stepped.kinematics) < SAME
    assert_in_limits(rows[:, JOINTS], operator.stepped.machine, (name, seed))
    assert_rest_is_cut(rows, wanted, Spot(1, 0.0, 0, 0.0))
    assert np.abs(rows[-1, JOINTS] - undisturbed(name).joints[-1]).max() < 1e-9


@pytest.mark.parametrize("name", ["lines", slow("example 2"), slow("tips")])
def test_after_a_look_the_tool_comes_back_the_same_way_and_the_rest_is_cut(name: str) -> None:
    look_and_go_on(name, 1)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(2, 8))
@pytest.mark.parametrize("name", PROGRAMS)
def test_after_a_look_anywhere_the_rest_is_cut(name: str, seed: int) -> None:
    look_and_go_on(name, seed)


@pytest.mark.soak
def test_a_jog_out_of_a_hold_without_a_retract_comes_back_too() -> None:
    operator = Operator(EXAMPLE_2)
    operator.hold_at(tick_of(6))
    held = operator.joints
    operator.jog(2, 12.0)
    operator.stepped.request(Request.RESUME)
    operator.stepped.go(50)
    assert operator.stepped.cycle.modes.mode is Mode.HOLD, "a resume away from the path is refused"
    operator.go_back()
    assert 0.5 < np.abs(np.subtract(operator.joints, held)).max() < 20.0
    operator.finish()


@pytest.mark.soak
def test_a_longer_and_thicker_tool_goes_on_where_the_old_one_stopped() -> None:
    machine = shipped()
    operator = Operator(EXAMPLE_2)
    operator.hold_at(tick_of(5))
    spot = operator.stepped.planner.spot(operator.now)
    assert spot is not None and 0.0 < spot.fraction < 1.0
    operator.retract(20.0)
    other = with_tool(machine, 2, radius_mm=1.4, length_mm=8.0)
    rest = rest_of(EXAMPLE_2, Spot(spot.line, spot.fraction), other)
    operator.go_back(starts.back_with(rest, machine))
    assert 0.5 < np.abs(np.subtract(operator.joints, rest.target.joints)).max() < 20.0
    before = len(operator.rows)
    rows = operator.finish()
    after = np.concatenate(operator.rows[before:])
    wanted = segments(EXAMPLE_2, other)
    assert distance(after, wanted, operator.stepped.kinematics) < SAME
    assert_rest_is_cut(after, wanted, rest.spot)
    assert_in_limits(rows[:, JOINTS], machine, "another tool")


@pytest.mark.soak
def test_a_hold_on_the_way_off_or_back_is_a_hold_like_any_other() -> None:
    operator = Operator(EXAMPLE_2)
    operator.hold_at(tick_of(7))
    held = operator.joints
    for lead in (
        lambda: operator.stepped.planner.retract(operator.now, 10.0),
        lambda: operator.stepped.planner.go_back(operator.now),
    ):
        lead()
        operator.stepped.go(200)
        operator.stepped.request(Request.RESUME)
        operator.hold_at(150)
        operator.stepped.go(100)
        operator.stepped.request(Request.RESUME)
        operator.rows += [operator.stepped.go(5), until(operator.stepped, Mode.HOLD)]
    assert 0.5 < np.abs(np.subtract(operator.joints, held)).max() < 20.0
    rows = operator.finish()
    assert distance(rows, segments(EXAMPLE_2, shipped()), operator.stepped.kinematics) < SAME


# --- dry run


@pytest.mark.parametrize("name", ["lines", slow("example 2")])
def test_a_dry_run_follows_the_program_off_the_part_with_the_spindle_off(name: str) -> None:
    stepped = fresh(shipped())
    rest = restart.find(source(PROGRAMS[name], stepped.machine, 25.0), Spot(1, 0.0))
    stepped.begin(Items(rest.opened(rest.items)))
    spindle: set[float] = set()
    rows = []
    while stepped.cycle.modes.mode is not Mode.READY or not rows:
        rows.append(stepped.go(50))
        spindle.add(stepped.cycle.peripherals.rev_min)
        if stepped.cycle.modes.mode is Mode.HOLD:
            stepped.request(Request.RESUME)  # the tool is in
        assert len(rows) < 4000 and stepped.cycle.modes.mode is not Mode.FAULT, stepped.fault_text
    assert spindle == {0.0}
    assert_in_limits(np.concatenate(rows)[:, JOINTS], stepped.machine, "dry run")
