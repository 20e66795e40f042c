"""The plan's end of the sockets, with nobody at the other one."""

from __future__ import annotations

import os
from pathlib import Path

from cutting import shipped

from controller.handoff import PieceMessage, SnapshotBoard, piece_pair, request_pair
from controller.session.plan_end import PlanEnd


def test_another_planner_never_uses_the_number_of_a_message_that_is_on_its_way(tmp_path: Path) -> None:
    path = str(tmp_path / "snapshot")
    board, (plan, tick), (operator, requests) = SnapshotBoard(path), piece_pair(), request_pair()
    board.write(*[0] * 53)  # the tick has answered none
    with tick, requests:
        end = PlanEnd(shipped(), os.dup(plan.fileno()), os.dup(operator.fileno()), path)
        end.send(PieceMessage(7, 0.0, {}, ()))
        end.planner = end.new_planner(shipped())
        assert 7 in end.planner.marks
    plan.close()
    operator.close()
