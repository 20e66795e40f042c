"""``directrix soak``: what it draws is drawn again, what it records is made again, what is wrong is kept."""

from __future__ import annotations

import gc
import json
from dataclasses import replace
from pathlib import Path

import pytest
from support.soak import soak, stepped
from support.soak.scenarios import PARTS, Scenario, drawn
from support.soak.stepped import Came
from typer.testing import CliRunner

from controller.__main__ import app
from controller.tick.cycle import Cycle

SEED = 4711
SOUND = next(n for n in range(100) if not drawn(SEED, n).script and drawn(SEED, n).kind == "rapids")
FAULTY = next(n for n in range(100) if drawn(SEED, n).script and drawn(SEED, n).kind == "rapids")


def test_what_is_drawn_depends_on_seed_and_number_alone() -> None:
    assert drawn(SEED, 7) == drawn(SEED, 7) != drawn(SEED, 8)
    kinds = {drawn(SEED, n).kind for n in range(60)}
    assert kinds == set(PARTS)


@pytest.mark.parametrize("number", [SOUND, FAULTY])
def test_a_run_holds_and_its_record_is_made_again(number: int, tmp_path: Path) -> None:
    came = stepped.run(drawn(SEED, number), tmp_path)
    assert came.wrong == "" and came.ticks > 100 and came.record is not None
    done = CliRunner().invoke(app, ["replay", str(came.record), "--json"])
    told = json.loads(done.stdout)
    assert done.exit_code == 0 and told["compared_ticks"] > 100


def test_a_run_is_the_same_again(tmp_path: Path) -> None:
    first, second = (stepped.run(drawn(SEED, SOUND), tmp_path / name) for name in "ab")
    assert first.told == second.told and first.ticks == second.ticks


def test_a_joint_that_is_set_too_far_is_seen_and_kept_with_its_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For one tick, by so little that the tick's own check of velocity and acceleration lets it pass."""
    one, judge = drawn(SEED, SOUND), Cycle._judge
    at, jump = 300, 0.2 * one.machine.axes[0].limits.acceleration * one.machine.period_s**2

    def jumps(self: Cycle, *more: object) -> object:
        if self.tick == at:
            x, *others = self.follow.joints
            self.follow.joints = (x + jump, *others)
        return judge(self, *more)  # type: ignore[arg-type]

    monkeypatch.setattr(Cycle, "_judge", jumps)
    found = soak.soak(SEED, 600.0, tmp_path, SOUND, 1)
    (folder,) = map(Path, found.kept)
    facts = json.loads((folder / "soak.json").read_text())
    assert facts["seed"] == SEED and facts["number"] == SOUND and "jerk" in facts["wrong"]
    assert at <= facts["tick"] <= at + 3
    assert (folder / "events.jsonl").exists() and (folder / "setpoints.npz").exists()
    assert one.program == (folder / "program.ngc").read_text()


def broken(of: Scenario, _folder: Path) -> Came:
    return Came("raised", "it broke" if of.number == 1 else "", 3, 10)


def test_the_sum_counts_what_came_and_where_it_is_kept(tmp_path: Path) -> None:
    found = soak.soak(SEED, 60.0, tmp_path, 0, 3, run=broken)
    assert found.runs == 3 and found.ticks == 30 and found.results == {"raised": 3}
    assert found.kept == [str(tmp_path / f"{SEED}-1")] and found.is_flat
    assert not replace(found, settled_mb=100.0, memory_mb=200.0).is_flat


def test_the_command_tells_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["soak", "--seed", str(SEED), "--first", str(SOUND), "--runs", "1", "--json"]
    done = CliRunner().invoke(app, words)
    told = json.loads(done.stdout)
    assert done.exit_code == 0 and told["runs"] == 1 and told["kept"] == [], done.output
    from support.soak import soak as module

    monkeypatch.setattr(module.soak, "__defaults__", (*module.soak.__defaults__[:-1], broken))
    wrong = CliRunner().invoke(app, [*words[:4], "1", "--runs", "1", "--language", "de"])
    assert wrong.exit_code == 1 and "hielten nicht" in wrong.output and f"soak/{SEED}-1" in wrong.output


@pytest.mark.slow
@pytest.mark.parametrize("number", range(200))
def test_any_run_holds(number: int, tmp_path: Path) -> None:
    came = stepped.run(drawn(1, number), tmp_path)
    assert came.wrong == "", (drawn(1, number).title, came)


def test_runs_leave_nothing_behind_in_memory(tmp_path: Path) -> None:
    """What a run has made is gone after it, though replay freezes what is there."""
    counts: list[int] = []

    def told(*_: object) -> None:
        counts.append(len(gc.get_objects()))

    soak.soak(SEED, 600.0, tmp_path, FAULTY, 1, told)
    soak.soak(SEED, 600.0, tmp_path, FAULTY, 1, told)
    soak.soak(SEED, 600.0, tmp_path, FAULTY, 1, told)
    assert counts[2] - counts[1] < 1000, counts
