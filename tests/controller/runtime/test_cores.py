"""Which core a tick takes, on made-up computers; nothing here moves the process that tests."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Collection, Iterable
from dataclasses import replace
from pathlib import Path
from unittest.mock import MagicMock

import pytest
from support.machines.stepped_runs import shipped

from controller.machine.model import Bus
from controller.runtime import cores, planning, tick_process
from controller.runtime.children import Job
from drives import real_time

CHOICES = [
    # permitted, isolated, real time: the best first
    ({0, 1, 2}, [3], True, [3]),  # the usual affinity names no isolated core: it is asked for
    ({0, 1, 2}, [3], False, [3]),  # nobody else is there, whatever the priority
    ({0, 1, 4}, [2, 3, 4], True, [4]),  # somebody chose this one for the service
    ({0, 1, 2, 3}, [], True, [3, 2, 1]),
    ({0, 1, 2, 3}, [], False, []),  # among others it has to be movable
    ({0, 1}, [], True, [1]),
    ({0}, [], True, []),  # the only one is everybody's
    ({5}, [], True, []),
]


class Kernel:
    """Affinity of one process; ``refused`` are cores that its control group does not know."""

    def __init__(self, affinity: Iterable[int], refused: Iterable[int] = ()) -> None:
        self.affinity, self._refused = set(affinity), set(refused)

    def move(self, _pid: int, cpus: Collection[int]) -> None:
        if not set(cpus) - self._refused:
            raise OSError(22, "Invalid argument")
        self.affinity = set(cpus)


def on(
    kernel: Kernel, monkeypatch: pytest.MonkeyPatch, alone: list[int], claimed: Iterable[int] = ()
) -> Kernel:
    taken = set(claimed)
    monkeypatch.setattr(cores.os, "sched_getaffinity", lambda _: set(kernel.affinity))
    monkeypatch.setattr(cores.os, "sched_setaffinity", kernel.move)
    monkeypatch.setattr(cores, "isolated", lambda: alone)
    monkeypatch.setattr(cores, "_claimed", lambda cpu: cpu not in taken)
    return kernel


@pytest.mark.parametrize(("permitted", "alone", "real_time", "best"), CHOICES)
def test_a_tick_goes_to_an_isolated_core_or_to_the_last_of_several(
    permitted: set[int], alone: list[int], real_time: bool, best: list[int]
) -> None:
    assert cores.choice(permitted, alone, real_time) == best


def test_a_core_that_is_not_permitted_is_left_for_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = on(Kernel({0, 1}, refused={2}), monkeypatch, alone=[2, 3])
    assert cores.take(real_time=True) == 3 and kernel.affinity == {3}


def test_two_ticks_do_not_meet_on_one_core(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = on(Kernel(range(4)), monkeypatch, alone=[], claimed={3})
    assert cores.take(real_time=True) == 2 and kernel.affinity == {2}


def test_a_tick_for_which_there_is_no_core_may_go_where_it_could(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = on(Kernel({0, 1}), monkeypatch, alone=[], claimed={1})
    assert cores.take(real_time=True) is None and kernel.affinity == {0, 1}


@pytest.mark.parametrize(
    ("permitted", "alone", "left"),
    [
        ({0, 1, 2, 3}, [], {0, 1}),
        ({0, 1, 2}, [], {0, 1}),  # tick and pump share one: the others have two
        ({0, 1}, [], {0, 1}),  # one core is too little for all the others
        ({0}, [], {0}),
        ({0, 1, 2}, [3], {0, 1, 2}),  # the kernel keeps them off it
    ],
)
def test_the_others_stay_off_the_cores_of_tick_and_pump_where_two_are_left(
    permitted: set[int], alone: list[int], left: set[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    kernel = on(Kernel(permitted), monkeypatch, alone)
    cores.leave()
    assert kernel.affinity == left


def test_a_claim_ends_with_the_process_that_made_it() -> None:
    cpu = 10**6 + os.getpid()  # no computer has it
    words = [
        sys.executable,
        "-c",
        f"from controller.runtime import cores; print(cores._claimed({cpu})); input()",
    ]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None and other.stdout.readline() == "True\n"
        assert not cores._claimed(cpu)
        other.kill()
    assert subprocess.run(words, input="\n", capture_output=True, text=True).stdout == "True\n"


def test_the_isolated_cores_are_read_as_the_kernel_lists_them(tmp_path: Path) -> None:
    assert cores.isolated(tmp_path) == []
    (tmp_path / cores.ISOLATED).parent.mkdir(parents=True)
    for text, found in (("\n", []), ("3\n", [3]), ("2-3,7\n", [2, 3, 7])):
        (tmp_path / cores.ISOLATED).write_text(text)
        assert cores.isolated(tmp_path) == found


def test_what_a_tick_has_to_do_without_is_told_where_real_drives_hang_on_it() -> None:
    granted = real_time.Granted(dict.fromkeys(tick_process.PRIVILEGES, True))
    assert tick_process.lacking(granted, simulated=False) == ""
    granted |= {"fifo": False, "own_core": False}
    told = tick_process.lacking(granted, simulated=False)
    assert "without real-time priority, a core of its own" in told and "self-test" in told
    assert tick_process.lacking(granted, simulated=True) == ""


def test_the_tick_asks_for_its_core_when_it_has_its_priority_and_tells_what_it_lacks(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("bus", "machine_file", "cyclic", "children", "Cycle", "loop", "pump_process", "Memory"):
        monkeypatch.setattr(tick_process, name, MagicMock())
    for name in ("PieceInbox", "RequestInbox", "SnapshotBoard", "Recorder"):
        monkeypatch.setattr(tick_process, name, MagicMock())
    of_tick, of_pump = real_time.Granted(locked=True, fifo=True), real_time.Granted(locked=False, fifo=True)
    pump = tick_process.pump_process.PumpProcess.return_value  # type: ignore[attr-defined]
    pump.wait_until_ready.return_value = of_pump
    monkeypatch.setattr(tick_process.real_time, "prepare", lambda: of_tick)
    tick_process.Memory.create.return_value = (None, -1)  # type: ignore[attr-defined]
    tick_process.loop.Loop.return_value.error = None  # type: ignore[attr-defined]
    asked: list[bool] = []
    monkeypatch.setattr(tick_process.cores, "take", asked.append)  # and there is none
    monkeypatch.setattr(tick_process.cores, "give", lambda _, fifo: asked.append(fifo))
    tick_process.main(
        Job(replace(shipped(), buses=(Bus("x", "socketcan", "can0", 1_000_000),)), 0, 0, "", "")
    )
    assert asked == [True, True]
    assert "without locked memory, a core of its own" in capsys.readouterr().err


def test_a_plan_leaves_the_ticks_core_before_anything_else(monkeypatch: pytest.MonkeyPatch) -> None:
    def leave() -> None:
        raise StopIteration

    monkeypatch.setattr(cores, "leave", leave)
    with pytest.raises(StopIteration):
        planning.main(None)  # type: ignore[arg-type]


def test_every_privilege_that_a_tick_asks_for_has_its_words() -> None:
    asked = "import json; from drives import real_time; print(json.dumps(real_time.prepare()))"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)

    assert {*json.loads(done.stdout), "own_core"} == set(tick_process.PRIVILEGES)
