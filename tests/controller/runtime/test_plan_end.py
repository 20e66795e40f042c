"""The plan's end of the sockets, with nobody at the other one."""

from __future__ import annotations

import contextlib
import gc
import os
import weakref
from collections.abc import Iterator
from pathlib import Path

from support.machines.stepped_runs import shipped
from support.suite import own_process

from controller.ipc.handoff import PieceMessage, SnapshotBoard, blank, flat, piece_pair, request_pair
from controller.runtime.plan_end import PlanEnd


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[PlanEnd]:
    path = str(folder / "snapshot")
    board, (plan, tick), (operator, requests) = SnapshotBoard(path), piece_pair(), request_pair()
    board.write(flat(blank()))  # the tick has answered none
    with plan, tick, operator, requests:
        yield PlanEnd(shipped(), os.dup(plan.fileno()), os.dup(operator.fileno()), path, folder)


def test_another_planner_never_uses_the_number_of_a_message_that_is_on_its_way(tmp_path: Path) -> None:
    with alone(tmp_path) as end:
        end.send(PieceMessage(7, 0.0, {}, ()))
        end.planner = end.new_planner(shipped())
        assert 7 in end.planner.marks


class Ring:
    """Garbage that only the collector finds."""

    def __init__(self) -> None:
        self.own = self


def looked_through(folder: str) -> tuple[bool, bool]:
    """Whether what is there is looked through after a program was loaded, and is gone after another one."""
    with alone(Path(folder)) as end:
        there = Ring()
        gone = weakref.ref(there)
        end.load((), end.snapshot())
        found = any(one is there for one in gc.get_objects())
        del there
        end.load((), end.snapshot())
        return found, gone() is None


def test_the_collector_does_not_look_again_at_what_is_there_when_a_program_is_loaded(tmp_path: Path) -> None:
    found, is_gone = own_process.result_of(looked_through, tmp_path)
    assert not found and is_gone
