"""Pieces from the plan to the tick: whole or not at all, never blocking, and never much at once."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest
from support.machines.tick_bench import rapid_law, straight

from controller.ipc.piece_socket import PieceInbox, PieceOutbox, encode, piece_pair
from controller.motion.pieces import STILL, Law, Piece, PieceMessage, StopTable, dwell
from controller.tick.queue import Stops

HERE = (0.0, 0.0, 0.0, 0.0, 0.0)
THERE = (100.0, 0.0, 0.0, 0.0, 0.0)
STEP_S = 0.004


def stop_table(stops: int, most: int, seed: int = 1) -> StopTable:
    """Stops of 0 (none can begin there) to ``most`` jerks, no two of which are alike."""
    draw = random.Random(seed)
    rows = [[float(i) + draw.random() for _ in range(draw.randint(0, most))] for i in range(stops)]
    return StopTable.of(1.0, STEP_S, 0.001, rows)


def jerks_at(stops: Stops, tau: float) -> list[float]:
    found = stops.row_at(tau)
    return (
        [] if found is None else list(found[0].jerks[found[0].first[found[1]] : found[0].first[found[1] + 1]])
    )


def test_a_message_comes_out_as_it_went_in() -> None:
    plan_end, tick_end = piece_pair()
    piece, move = straight(HERE, THERE, rapid_law, 3)
    sent = PieceMessage(1, 0.0, {3: move}, (piece, dwell(0.5, 9, stop=True)))
    assert PieceOutbox(plan_end).send(sent)
    inbox = PieceInbox(tick_end)
    assert inbox.take() == sent and inbox.was_heard()
    assert inbox.take() is None


def test_a_message_longer_than_a_packet_arrives_whole_or_not_yet() -> None:
    plan_end, tick_end = piece_pair()
    long = Law(tuple(map(float, range(5001))), tuple((float(i),) * 6 for i in range(5000)))
    packets = encode(PieceMessage(1, 0.0, {}, (Piece(-1, 0, long, 5000.0),)))
    assert len(packets) > 2
    inbox = PieceInbox(tick_end)
    for packet in packets[:-1]:
        plan_end.send(packet)
    assert inbox.take() is None
    plan_end.send(packets[-1])
    message = inbox.take()
    assert message is not None and message.pieces[0].law == long


def test_the_rest_of_a_message_whose_beginning_is_lost_is_not_taken() -> None:
    plan_end, tick_end = piece_pair()
    long = Law(tuple(map(float, range(5001))), tuple((float(i),) * 6 for i in range(5000)))
    for packet in encode(PieceMessage(1, 0.0, {}, (Piece(-1, 0, long, 5000.0),)))[1:]:
        plan_end.send(packet)
    PieceOutbox(plan_end).send(PieceMessage(2, 0.0, {}, (dwell(1.0),)))
    message = PieceInbox(tick_end).take()
    assert message is not None and message.sequence == 2


def test_a_full_socket_keeps_messages_waiting_and_in_order() -> None:
    plan_end, tick_end = piece_pair()
    outbox, inbox = PieceOutbox(plan_end), PieceInbox(tick_end)
    sequence = 1
    while outbox.send(PieceMessage(sequence, 0.0, {}, (Piece(-1, 0, STILL, 1.0),) * 400)):
        sequence += 1
    taken = []
    while (message := inbox.take()) is not None:
        taken.append(message.sequence)
    assert outbox.flush()
    while (message := inbox.take()) is not None:
        taken.append(message.sequence)
    assert taken == list(range(1, sequence + 1))


def test_a_dead_planner_reads_as_closed_and_not_as_an_error() -> None:
    plan_end, tick_end = piece_pair()
    inbox = PieceInbox(tick_end)
    plan_end.close()
    assert inbox.take() is None and inbox.closed and not inbox.was_heard()


def test_long_tables_of_stops_come_in_packets_of_their_own_and_are_the_same_stops() -> None:
    plan_end, tick_end = piece_pair()
    whole = stop_table(2000, 300)
    piece, move = straight(HERE, THERE, rapid_law, 3)
    sent = PieceMessage(1, 0.0, {3: move}, (piece,), (whole, stop_table(3, 2)))
    assert len(encode(sent)) > 40
    assert PieceOutbox(plan_end).send(sent)
    got = PieceInbox(tick_end).take()
    assert got is not None and (got.sequence, got.motions, got.pieces) == (1, sent.motions, sent.pieces)
    one, many = Stops(), Stops()
    one.add((whole,), 0.0, 0.0)
    many.add(got.stops[:-1], 0.0, 0.0)
    for i in range(-1, 2002):
        assert jerks_at(many, 1.0 + i * STEP_S) == jerks_at(one, 1.0 + i * STEP_S)
        assert jerks_at(many, 1.0 + (i + 0.5) * STEP_S) == []
    assert got.stops[-1] == sent.stops[-1]


@pytest.mark.parametrize(("stops", "most", "values"), [(500, 40, 300), (50, 40, 10), (400, 0, 60), (1, 0, 9)])
def test_parts_of_a_table_are_neighbours_and_no_longer_than_they_may_be(
    stops: int, most: int, values: int
) -> None:
    whole = stop_table(stops, most)
    parts = list(whole.parts(values))
    assert all(len(one.jerks) + len(one) <= values or len(one) == 1 for one in parts)
    assert all(before.end_s == pytest.approx(after.start_s) for before, after in pairwise(parts))
    assert sum(len(one) for one in parts) == stops
    assert [j for one in parts for j in one.jerks] == list(whole.jerks)


def test_a_tick_takes_no_more_than_so_many_packets_at_once() -> None:
    plan_end, tick_end = piece_pair()
    sent = PieceMessage(1, 0.0, {}, (dwell(1.0),), (stop_table(500, 300),))
    packets = len(encode(sent))
    assert PieceOutbox(plan_end).send(sent)
    inbox = PieceInbox(tick_end, packets=2)
    takes = 1
    while inbox.take() is None:
        assert inbox.was_heard() and not inbox.was_heard()
        takes += 1
    assert takes == (packets + 1) // 2
