"""A tool in a thread is known over a loss of power, and turned out of it by spindle and axis together."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest
from support.machines.tapping import Tapper, machine

from controller import own_database
from controller.ipc.handoff import blank
from controller.runtime.events import Event
from controller.service.thread_guard import UNKNOWN, InThread, ThreadGuard, way_out
from controller.state.modes import Mode, Request
from controller.store import service_store
from controller.store.service_store import ServiceStore
from drives.bench.simulated.spindle_motor import MotorParameters

LAGGING = MotorParameters(lag_s=0.02, slip=0.02, strongest_rev_s2=200.0)
PROGRAM = "G21 G90 G54 G40\nS600 {way}\nG0 X5. Y-50.\nG0 Z40.\nG33.1 Z34. K1.25\nG0 Z60.\nM30\n"


def at(turns: float, pitch: float = 1.25, line: int = 5):  # type: ignore[no-untyped-def]
    return blank()._replace(thread_rev=turns, thread_pitch_mm=pitch, line=line)


def again(state: Path) -> InThread | None:
    """What the next service finds."""
    with contextlib.closing(ServiceStore(state)) as store:
        return ThreadGuard(store).found


def test_what_is_in_a_thread_is_known_to_the_next_service(tmp_path: Path) -> None:
    guard = ThreadGuard(ServiceStore(tmp_path))
    for turns in (0.0, 0.5, 3.7, 7.2):
        guard.look(at(turns), "part.ngc")
    after = ThreadGuard(ServiceStore(tmp_path))
    after.look(blank(), "")  # a tick that has just begun
    assert after.found is not None
    assert after.found.turns == pytest.approx(7.2, abs=1.0)
    assert after.found[1:] == (1.25, 5, "part.ngc")


def test_what_has_come_out_is_forgotten(tmp_path: Path) -> None:
    guard = ThreadGuard(ServiceStore(tmp_path))
    for turns in (0.5, 7.2, 0.3, 0.0):
        guard.look(at(turns), "part.ngc")
    assert guard.found is None and again(tmp_path) is None


@pytest.mark.parametrize("turns", [(0.5,), (0.5, 3.7, 7.2)])
def test_a_depth_that_was_known_before_is_not_taken_for_the_one_that_is_damaged(
    tmp_path: Path, turns: tuple[float, ...]
) -> None:
    """A tap that is one turn deeper than it is withdrawn breaks."""
    with contextlib.closing(ServiceStore(tmp_path)) as store:
        store.put("usage", {})
        guard = ThreadGuard(store)
        for one in turns:
            guard.look(at(one), "part.ngc")
    damage(tmp_path, "thread")
    for _ in range(2):
        assert again(tmp_path) == UNKNOWN, "also to the service after that"


def test_another_loss_puts_no_tool_into_a_thread(tmp_path: Path) -> None:
    assert again(tmp_path) is None
    service_store.put(tmp_path, "usage", {})
    damage(tmp_path, "usage")
    assert again(tmp_path) is None


def damage(state: Path, name: str) -> None:
    """The newest of a document, by who keeps no sums."""
    with contextlib.closing(own_database.opened(state / service_store.FILE)) as sql:
        newest = f"SELECT max(generation) FROM documents WHERE name = '{name}'"
        sql.execute(f"UPDATE documents SET value = '7' WHERE name = '{name}' AND generation = ({newest})")


@pytest.mark.parametrize(("way", "share"), [("M3", 0.6), ("M4", 0.25)])
def test_a_stop_in_the_thread_is_turned_out_along_it(way: str, share: float, tmp_path: Path) -> None:
    program = PROGRAM.format(way=way)
    made = machine(slower=True)
    plain = Tapper(made, LAGGING)
    plain.run(program)
    first = next(i for i, now in enumerate(plain.seen) if now.thread_rev)
    ticks = first + round(share * len(plain.cut.turns))
    tapper, guard = Tapper(made, LAGGING), ThreadGuard(ServiceStore(tmp_path))
    assert tapper.run(program, Event(ticks, Request.STOP)).result == "stopped"
    for now in tapper.seen:
        guard.look(now, "part.ngc")
    found = again(tmp_path)  # after a loss of power
    assert guard.found is not None and found is not None
    depth = tapper.cut.way[-1]
    assert guard.found.depth_mm == pytest.approx(depth, abs=0.01)
    before = tapper.cut
    assert tapper.run(way_out(tapper.machine, guard.found)).result == "completed"
    out = tapper.cut
    right = -1.0 if way == "M3" else 1.0
    assert out.error_um(right / 1.25) < 5.0
    assert out.way.max() == pytest.approx(depth + 1.0, abs=0.01)
    assert out.joints[-1, 2] > before.joints[0, 2]
    for now in tapper.seen:
        guard.look(now, "")
    assert guard.found is None
    assert max(abs(now.spindle_actual_rev_min) for now in tapper.seen) < 80.0
    assert tapper.seen[-1].mode is Mode.READY
