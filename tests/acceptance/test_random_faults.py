"""Random fault scripts against one invariant, and random healthy runs against none: see fault_judge.

    pytest -m slow tests/acceptance/test_random_faults.py                            some hundred
    DIRECTRIX_FAULT_SCRIPTS=10000 pytest -m soak tests/acceptance/test_random_faults.py -n 2
    DIRECTRIX_HEALTHY_RUNS=1000 pytest -m soak tests/acceptance/test_random_faults.py -n 2 -k healthy
    DIRECTRIX_HEALTHY_RUNS=1000 pytest -m soak tests/acceptance/test_random_faults.py -n 2 -k losses

A case that fails says how ``directrix simulate`` makes it again; its files stay in pytest's folder.
"""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import numpy as np
import pytest
from support.faults import fault_scripts, invariants, random_batches
from support.faults.fault_scripts import Batch, Draw
from support.faults.random_batches import Came
from support.machines.stepped_runs import shipped
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.machine.model import Machine
from controller.runtime.bench.observer import Seen, Sight, latency
from controller.state.modes import Fault, Mode

IN_A_BATCH = 40
IN_A_SMALL_BATCH = 4  # of the batches of which CI takes some
SCRIPTS = int(os.environ.get("DIRECTRIX_FAULT_SCRIPTS", "10000"))
HEALTHY = int(os.environ.get("DIRECTRIX_HEALTHY_RUNS", "1000"))
FEW, FEW_HEALTHY = 10 * len(fault_scripts.MACHINES), 5 * len(fault_scripts.MACHINES)  # small batches


def judge(of: Batch, came: list[Came], folder: Path) -> None:
    """Fails with every wrong, and the command that shows it."""
    told = []
    for n, one in enumerate(came):
        if one.wrongs:
            words = fault_scripts.written(of, one.case, folder / f"case-{n}")
            told += [*one.wrongs, f"  directrix {shlex.join(words)}"]
    assert not told, "\n".join([f"batch {of.number}, of {len(came)} cases:", *told])


def random_scripts(number: int, count: int, folder: Path) -> None:
    of = fault_scripts.batch(number)
    judge(of, random_batches.cases(of, count), folder)


def healthy_runs(number: int, count: int, folder: Path, draw: Draw = fault_scripts.healthy_case) -> None:
    of = fault_scripts.healthy_batch(number)
    came = random_batches.cases(of, count, draw=draw)
    wrong = [one for one in came if (one.fault, one.warned) != ("NONE", "NONE")]
    assert len(came) == count + 1 and not wrong, wrong
    judge(of, came, folder)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(FEW))
def test_who_is_off_has_said_so_and_everything_stands_in_time(number: int, tmp_path: Path) -> None:
    random_scripts(number, IN_A_SMALL_BATCH, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(FEW_HEALTHY))
def test_a_healthy_run_has_no_fault(number: int, tmp_path: Path) -> None:
    healthy_runs(number, IN_A_SMALL_BATCH, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(FEW_HEALTHY))
def test_a_run_with_single_losses_has_no_fault_and_no_warning(number: int, tmp_path: Path) -> None:
    healthy_runs(number, IN_A_SMALL_BATCH, tmp_path, fault_scripts.lossy_case)


@pytest.mark.soak
@pytest.mark.parametrize("number", range(-(-HEALTHY // IN_A_BATCH)))
def test_a_thousand_runs_with_single_losses(number: int, tmp_path: Path) -> None:
    healthy_runs(FEW_HEALTHY + number, IN_A_BATCH, tmp_path, fault_scripts.lossy_case)


@pytest.mark.soak
@pytest.mark.parametrize("number", range(-(-SCRIPTS // IN_A_BATCH)))
def test_ten_thousand_scripts(number: int, tmp_path: Path) -> None:
    random_scripts(FEW + number, IN_A_BATCH, tmp_path)


@pytest.mark.soak
@pytest.mark.parametrize("number", range(-(-HEALTHY // IN_A_BATCH)))
def test_a_thousand_healthy_runs(number: int, tmp_path: Path) -> None:
    healthy_runs(FEW_HEALTHY + number, IN_A_BATCH, tmp_path)


# ---- the fork is the run itself


def is_simulated_again(of: Batch, one: Came, trace: Path, folder: Path) -> None:
    """``directrix simulate`` makes the same run; it goes on longer where it records a fault."""
    words = fault_scripts.written(of, one.case, folder)
    again = folder / "again.npz"
    result = CliRunner().invoke(command_line.app, [*words, "--trace", str(again)])
    # 4: planted, or a stop that the case itself asks for, where the program had not ended before.
    expected = (1, 4) if one.fault != "NONE" else (0, 4) if one.case.events else (0,)
    assert result.exit_code in expected, result.output
    ours, theirs = np.load(trace), np.load(again)
    n = len(ours["time_s"])
    assert n > 10 and len(theirs["time_s"]) >= n
    for name in ours.files:
        kept = theirs[name][:n] if ours[name].shape[:1] == (n,) else theirs[name]
        assert ours[name].tobytes() == kept.tobytes(), name


def again(number: int, count: int, folder: Path) -> None:
    of = fault_scripts.batch(number)
    (folder / "traces").mkdir()
    came = random_batches.cases(of, count, folder / "traces")
    ours = [one for one in came if one.case.script]
    assert len(ours) == count
    for n, one in enumerate(ours):
        trace = folder / "traces" / f"{n}.npz"
        if trace.exists():  # not where homing has failed: nothing was run
            is_simulated_again(of, one, trace, folder / str(n))


def test_a_forked_run_is_what_simulate_makes_of_it(tmp_path: Path) -> None:
    again(0, 2, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(1, 2 * len(fault_scripts.MACHINES)))
def test_any_case_is_had_again_bit_for_bit(number: int, tmp_path: Path) -> None:
    again(number, 4, tmp_path)


# ---- the judge


def sight(machine: Machine, off: float = 0.0, fault_at: int = 10**9, **last: object) -> Sight:
    """X at 50 mm/s for 200 ticks and at rest for 300; from tick 100 on its motor is off by ``off``."""
    v, ticks = 50.0 * machine.period_s, []
    place = [min(n, 200) * v for n in range(500)]
    for n in range(500):
        motor = place[max(0, n - latency(machine))] + (off if n >= 100 else 0.0)
        failed = n >= fault_at
        ticks.append(
            Seen(
                tick=n,
                time_s=n * machine.period_s,
                mode=Mode.FAULT if failed else Mode.RUNNING,
                fault=Fault.FOLLOWING_ERROR if failed else Fault.NONE,
                fault_axis=0 if failed else -1,
                warning=Fault.NONE,
                on_path=True,
                untrusted=0,
                torque=31,
                recounted=0,
                command=(place[n], 0.0, 0.0, 0.0, 0.0),
                motors=(motor, 0.0, 0.0, 0.0, 0.0),
                zeros=(0.0,) * 5,
                speeds=(v / machine.period_s if n < 200 else 0.0, 0.0, 0.0, 0.0, 0.0),
                told=(motor, 0.0, 0.0, 0.0, 0.0),
            )
        )
    ticks[-1] = ticks[-1]._replace(**last)  # type: ignore[arg-type]
    return Sight(machine, tuple(ticks))


def test_the_judge_lets_pass_what_is_in_order() -> None:
    assert invariants.wrongs(sight(shipped())) == []
    assert invariants.wrongs(sight(shipped(), off=0.1)) == []
    assert invariants.wrongs(sight(shipped(), recounted=1, untrusted=1)) == []


def test_the_judge_sees_an_axis_that_is_off_and_a_jump() -> None:
    found = invariants.wrongs(sight(shipped(), off=2.5))
    assert any("X was off for" in one and "2.500" in one for one in found)
    assert not any("its velocity limit" in one for one in found)
    far = invariants.wrongs(sight(shipped(), off=20.0))
    assert any("times its velocity limit" in one for one in far)
    assert not any("was off" in one for one in invariants.wrongs(sight(shipped(), off=2.5, fault_at=99)))


def test_the_judge_sees_who_goes_on_after_a_fault() -> None:
    machine = shipped()
    moving = sight(machine, fault_at=5)
    ticks = tuple(s._replace(motors=(0.1 * s.tick, *s.motors[1:])) for s in moving.ticks)
    found = invariants.wrongs(Sight(machine, ticks))
    assert any("X moved 988 ms after FOLLOWING_ERROR" in one for one in found)
    assert any("X moves to the end" in one for one in found)
    coasting = tuple(s._replace(torque=30) for s in ticks)
    assert not any(" ms after" in one for one in invariants.wrongs(Sight(machine, coasting)))


def test_the_judge_sees_a_count_that_is_trusted_and_lost() -> None:
    found = invariants.wrongs(sight(shipped(), recounted=1))
    assert found == ["tick 499: X counts from another zero and is trusted"]
