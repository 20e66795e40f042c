"""``directrix soak``: what it draws is drawn again, what it records is made again, what is wrong is kept."""

from __future__ import annotations

import functools
import gc
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.machines import interrupted_runs, stepped_runs
from support.parts import surface_trains
from support.soak import judged, live, scenarios, soak, stepped
from support.soak.memory import MOST_MB_H, TELLS_S, Growth, give_back, growth_of
from support.soak.scenarios import PARTS, Scenario, drawn
from support.soak.stepped import Came
from support.suite import own_process
from typer.testing import CliRunner

from controller.__main__ import app
from controller.ipc.handoff import COLUMN, ROW, STOOD
from controller.machine import setup_data
from controller.machine.model import Machine
from controller.state.modes import Mode
from controller.tick.cycle import Cycle
from controller.tick.stock import Stock
from controller.verify.console import EndedAsAsked

SEED = 4711
SOUND, FAULTY = 11, 43  # rapids at 5 ms; in the second something goes wrong
SHORT_S = 3.0  # of the machine, after which the operator stops a run


def test_what_is_drawn_depends_on_seed_and_number_alone() -> None:
    assert drawn(SEED, 7) == drawn(SEED, 7) != drawn(SEED, 8)
    some = [drawn(SEED, n) for n in range(60)]
    assert {one.kind for one in some} == set(PARTS)
    assert some[SOUND].kind == some[FAULTY].kind == "rapids"
    assert some[FAULTY].script and not some[SOUND].script


@pytest.fixture(autouse=True)
def short(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if not request.node.get_closest_marker("slow"):
        monkeypatch.setattr(stepped, "RUN_S", SHORT_S)


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Came]:
    """What came of a run by its number; each takes seconds."""
    return functools.cache(lambda number: stepped.run(drawn(SEED, number), tmp_path_factory.mktemp("run")))


@pytest.mark.parametrize("number", [SOUND, FAULTY])
def test_a_run_holds_and_its_record_is_made_again(number: int, once: Callable[[int], Came]) -> None:
    came = once(number)
    assert came.wrong == "" and came.ticks > 100 and came.record is not None
    done = CliRunner().invoke(app, ["replay", str(came.record), "--json"])
    told = json.loads(done.stdout)
    assert done.exit_code in (0, EndedAsAsked.exit_code) and told["compared_ticks"] > 100


def test_a_run_is_the_same_again(tmp_path: Path, once: Callable[[int], Came]) -> None:
    first, second = once(SOUND), stepped.run(drawn(SEED, SOUND), tmp_path)
    assert first.told == second.told and first.ticks == second.ticks


def test_a_joint_that_is_set_too_far_is_seen_and_kept_with_its_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For one tick, by so little that the tick's own check of velocity and acceleration lets it pass."""
    one, judge = drawn(SEED, SOUND), Cycle._judge
    jump = 0.2 * one.machine.axes[0].limits.acceleration * one.machine.period_s**2
    stood, at = list[float](), list[int]()  # X in the ticks of the program; where it is set

    def jumps(self: Cycle, *more: object) -> object:
        if self.modes.mode is Mode.RUNNING:
            x, *others = self.follow.joints
            stood.append(x)
            if not at and len(stood) > 100 and len(set(stood[-5:])) == 1:
                at.append(self.tick)
                self.follow.joints = (x + jump, *others)
        return judge(self, *more)  # type: ignore[arg-type]

    monkeypatch.setattr(Cycle, "_judge", jumps)
    monkeypatch.setattr(Stock, "foreseen", lambda *_: None)  # each tick judges its step itself
    found = soak.soak(SEED, 600.0, tmp_path, SOUND, 1)
    (folder,) = map(Path, found.kept)
    facts = json.loads((folder / "soak.json").read_text())
    assert facts["seed"] == SEED and facts["number"] == SOUND and "jerk" in facts["wrong"]
    assert at[0] <= facts["tick"] <= at[0] + 3
    assert (folder / "events.jsonl").exists() and (folder / "setpoints.npz").exists()
    assert one.program == (folder / "program.ngc").read_text()


def test_a_jump_behind_a_gap_is_seen_and_the_gap_itself_is_none(tmp_path: Path) -> None:
    """Drives that stood in a gap begin anew from there: that is no jump, and a jump is one."""
    machine = scenarios.live_machine(SEED)
    rows = np.zeros((200, len(ROW)))
    rows[:, COLUMN["tick"]], rows[:, COLUMN["sync_sent"]] = np.arange(200), 1.0
    x = rows[:, COLUMN["joint_command_0"]]  # at half its speed; then it stands, and is told to go no further
    x[:100] = 0.5 * machine.axes[0].limits.velocity * machine.period_s * np.arange(100)
    x[100:] = x[98]
    rows[100, COLUMN["sync_sent"]], rows[100, COLUMN["switches"]] = 0.0, STOOD
    assert [tick for tick, _ in judged.limits(machine, rows[100:])] == []
    assert [tick for tick, _ in judged.limits(machine, rows[5:])] == []
    x[150:] += 0.2
    assert {tick for tick, _ in judged.limits(machine, rows[5:])} <= {150, 151, 152}
    assert judged.limits(machine, rows[5:])


@pytest.mark.parametrize(("mb_h", "is_flat"), [(0.0, True), (1.0, True), (8.0, False)])
def test_a_leak_is_seen_in_an_hour_among_steps_and_noise(mb_h: float, is_flat: bool) -> None:
    rng = np.random.default_rng(7)
    at_s = np.arange(0.0, 3600.0, 20.0)
    taken = 60.0 + mb_h * at_s / 3600.0 + rng.normal(0.0, 0.5, len(at_s)) + 3.0 * (at_s > 900.0)
    taken[rng.integers(len(at_s), size=8)] += 20.0  # a run that lay in it
    grown = growth_of(list(zip(at_s.tolist(), taken.tolist(), strict=True)))
    assert grown.is_flat is is_flat, grown
    assert growth_of([(0.0, 10.0), (TELLS_S / 2.0, 10.0 + MOST_MB_H)]).is_flat  # too short to tell


def test_what_a_process_takes_for_one_program_after_another_is_no_leak() -> None:
    rng = np.random.default_rng(SEED)
    at_s = np.arange(0.0, 3600.0, 11.0)
    for mb_h, is_flat in ((0.0, True), (8.0, False)):
        taken = 51.0 - 6.0 * np.exp(-at_s / 120.0) + 12.0 * rng.random(len(at_s)) ** 3 + mb_h * at_s / 3600.0
        grown = growth_of(list(zip(at_s.tolist(), taken.tolist(), strict=True)))
        assert grown.is_flat is is_flat, grown


def test_what_befalls_a_live_machine_is_drawn_and_kills_come_first() -> None:
    machine = scenarios.live_machine(SEED)
    drawn_ = [scenarios.live(SEED, n, machine) for n in range(200)]
    assert drawn_[7] == scenarios.live(SEED, 7, machine)
    words = [" ".join(one.script.split()[2:3]) for one in drawn_]
    assert {"emcy", "nmt", "stop"} <= set(words[scenarios.KILL_RUNS :]) and "kill" in words
    assert "kill" not in words[scenarios.KILL_RUNS :]


@pytest.mark.slow
@pytest.mark.live
def test_runs_on_the_real_clock_hold(tmp_path: Path) -> None:
    """One with nothing, and one in which the tick is stopped for a moment: made again from their records."""
    machine = scenarios.live_machine(SEED)
    script = lambda n: scenarios.live(SEED, n, machine).script  # noqa: E731
    first = next(n for n in range(400) if not script(n) and "stop tick" in script(n + 1))
    found = soak.on_real_clock(SEED, 1e4, tmp_path, first, 2)
    assert found.runs == 2 and found.ticks > 100 and found.kept == []


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.parametrize("what", scenarios.KILLED)
def test_a_process_that_is_killed_in_a_run_costs_that_run_alone(what: str, tmp_path: Path) -> None:
    with live.opened(SEED, tmp_path) as on:
        of = scenarios.live(SEED, 0, on.machine)
        killed = live.run(on, replace(of, script=f"1.000 s: {what}"))
        after = live.run(on, of)
    assert (killed.wrong, after.wrong) == ("", "") and any(what in one for one in killed.told)
    assert after.ticks > 100


def broken(of: Scenario, _folder: Path) -> Came:
    return Came("raised", "it broke" if of.number == 1 else "", 3, 10)


def test_the_sum_counts_what_came_and_where_it_is_kept(tmp_path: Path) -> None:
    found = soak.soak(SEED, 60.0, tmp_path, 0, 3, run=broken)
    assert found.runs == 3 and found.ticks == 30 and found.results == {"raised": 3}
    assert found.kept == [str(tmp_path / f"{SEED}-1")] and not found.grown
    leaks = Growth(3600.0, 100.0, 108.0, 8.0)
    assert replace(found, processes={"soak 1": leaks}).grown == {"soak 1": (100.0, 108.0)}


def test_the_command_tells_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, once: Callable[[int], Came]
) -> None:
    from support.soak import soak as module

    monkeypatch.chdir(tmp_path)
    *others, _, draw = module.soak.__defaults__
    came = lambda of, _folder: once(of.number)  # noqa: E731
    monkeypatch.setattr(module.soak, "__defaults__", (*others, came, draw))
    words = ["soak", "--seed", str(SEED), "--first", str(SOUND), "--runs", "1", "--json"]
    done = CliRunner().invoke(app, words)
    told = json.loads(done.stdout)
    assert done.exit_code == 0 and told["runs"] == 1 and told["kept"] == [], done.output
    monkeypatch.setattr(module.soak, "__defaults__", (*others, broken, draw))
    wrong = CliRunner().invoke(app, [*words[:4], "1", "--runs", "1", "--language", "de"])
    assert wrong.exit_code == 1 and "hielten nicht" in wrong.output and f"soak/{SEED}-1" in wrong.output


@pytest.mark.slow
@pytest.mark.parametrize("number", range(120))
def test_any_run_holds(number: int, tmp_path: Path) -> None:
    came = stepped.run(drawn(1, number), tmp_path)
    assert came.wrong == "", (drawn(1, number).title, came)


def objects_after_runs(folder: str) -> list[int]:
    """How many there are after each of three runs, each with its replay."""
    counts: list[int] = []
    stepped.RUN_S = SHORT_S

    def told(*_: object) -> None:
        counts.append(len(gc.get_objects()))

    for _ in range(3):
        soak.soak(SEED, 600.0, Path(folder), FAULTY, 1, told)
    return counts


def test_runs_leave_nothing_behind_in_memory(tmp_path: Path) -> None:
    """What a run has made is gone after it, though replay freezes what is there."""
    counts = own_process.result_of(objects_after_runs, tmp_path)
    assert counts[2] - counts[1] < 1000, counts


def machines_after_paths() -> list[int]:
    """How many there are after each of three paths, each of another machine that nobody holds any more.

    With joints of surfaces led over into each other, which are remembered.
    """
    text = surface_trains.program(3, decimals=3).replace("G61", "G64 P0.01")
    counts = list[int]()
    for number in range(3):
        made = stepped_runs.shipped("trunnion")
        other = setup_data.applied(made, {"offsets": {"G55": [float(number), 0.0, 0.0]}})
        assert interrupted_runs.segments(text, other)
        del made, other
        give_back()
        counts.append(sum(type(one) is Machine for one in gc.get_objects()))
    return counts


def test_nothing_but_a_bounded_cache_keeps_a_machine_of_a_run() -> None:
    counts = own_process.result_of(machines_after_paths)
    assert counts[2] == counts[0], counts
