"""Values of the hand-over: stops prepared for every moment, and what a piece says of itself."""

from __future__ import annotations

import pickle

import pytest

from controller.ipc.handoff import PieceMessage, StopTable, dwell
from controller.state.modes import Binding, axis_binding, binding_text


def test_a_table_keeps_the_jerks_of_each_stop_and_says_where_it_ends() -> None:
    table = StopTable.of(1.0, 0.004, 0.002, [[-1.0, -2.0], [], [3.0]])
    assert len(table) == 3 and table.end_s == pytest.approx(1.012)
    assert [list(table.jerks[a:b]) for a, b in zip(table.first, table.first[1:], strict=False)] == [
        [-1.0, -2.0],
        [],
        [3.0],
    ]
    later = table.shifted(0.5)
    assert (later.start_s, later.end_s) == (1.5, pytest.approx(1.512)) and later.jerks is table.jerks


def test_a_message_with_stops_travels_whole() -> None:
    message = PieceMessage(3, 1.0, {}, (dwell(1.0),), (StopTable.of(1.0, 0.004, 0.002, [[0.5]]),), 7)
    assert pickle.loads(pickle.dumps(message)) == message


def test_what_binds_is_told_with_the_name_of_the_axis() -> None:
    axes = ("X", "Y", "Z", "A", "C")
    assert binding_text(Binding.FEED, axes) == "feed"
    assert binding_text(axis_binding(4, 1), axes) == "C acceleration"
    assert len({axis_binding(axis, order) for axis in range(5) for order in range(3)}) == 15
