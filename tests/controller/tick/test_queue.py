"""What the tick has been given, each part alone: laws in plan time, rests, stop tables, a stop under way."""

from __future__ import annotations

import pytest
from numpy.polynomial import Polynomial

from controller.geometry.curves import Line
from controller.ipc.handoff import Law, Piece, PieceMessage, StopTable, dwell
from controller.motion.motions import JointMove, Motion, ThreadMove, ToolSpline
from controller.tick.brake import Brake
from controller.tick.queue import Entry, Queue, Stops

T = 0.002
ROWS = (  # of a law that goes on evenly at none of its knots: a look-up in the wrong polynomial is seen
    (0.0, 0.0, 0.0, 40.0, -30.0, 12.0),
    (7.0, 3.0, -2.0, 5.0, 4.0, -3.0),
    (11.0, -1.0, 6.0, -7.0, 2.0, 9.0),
    (2.0, 8.0, 1.0, 3.0, -5.0, 7.0),
)
KNOTS = (0.0, 0.5, 0.75, 1.5, 2.0)


def move_of(length: float = 50.0) -> Motion:
    end = (length, 0.0, 0.0)
    return JointMove(Line((0.0, 0.0, 0.0), end), length, (0.0, 0.0), (0.0, 0.0))


def to_rest(begin: float, end: float, seconds: float) -> Law:
    """From rest to rest (the quintic without acceleration at either end)."""
    way = end - begin
    cubes = (10.0 * way / seconds**3, -15.0 * way / seconds**4, 6.0 * way / seconds**5)
    return Law((0.0, seconds), ((begin, 0.0, 0.0, *cubes),))


def even(begin: float, speed: float, seconds: float) -> Law:
    return Law((0.0, seconds), ((begin, speed, 0.0, 0.0, 0.0, 0.0),))


def piece_of(law: Law, identity: int = 0) -> Piece:
    return Piece(identity, 1, law, law.duration_s)


def entry_of(law: Law, start_s: float = 0.0, motion: Motion | None = None) -> Entry:
    return Entry(piece_of(law), motion or move_of(), start_s)


# ---- a piece in plan time


@pytest.mark.parametrize("order", ["on", "back", "to and fro"])
def test_place_speed_and_acceleration_are_the_laws_whichever_time_is_asked_for(order: str) -> None:
    """What is kept of the last look-up (the polynomial it was in) may only save time."""
    start_s = 3.0
    entry = entry_of(Law(KNOTS, ROWS), start_s)
    times = [0.0, 0.3, 0.5, 0.6, 0.75, 1.1, 1.5, 1.9, 2.0]
    if order == "back":
        times.reverse()
    if order == "to and fro":
        times = [times[i * 5 % 9] for i in range(9)] + [1.9, 0.0, 1.9, 0.3, 0.6]
    for t in times:
        i = max(k for k in range(4) if KNOTS[k] <= t)
        law = Polynomial(ROWS[i])
        there = [float(law.deriv(k)(t - KNOTS[i])) for k in range(3)]
        assert entry.at(start_s + t) == pytest.approx(there, rel=1e-12, abs=1e-12), t


def test_before_and_behind_its_time_a_law_stands_at_its_ends() -> None:
    law = Law(KNOTS, ROWS)
    entry = entry_of(law, 3.0)
    assert entry.at(2.0) == entry.at(3.0) == pytest.approx(law.at(0.0))
    assert entry.at(9.0) == entry.at(5.0) == pytest.approx(law.at(2.0))


def test_a_plan_rests_in_a_dwell_and_at_the_ends_of_a_law_that_are_at_rest() -> None:
    law = to_rest(0.0, 50.0, 1.0)
    entry = entry_of(law, 2.0)
    assert entry.rests_at(2.0) and entry.rests_at(3.0)
    assert not entry.rests_at(2.5)
    assert entry_of(dwell(1.0).law).rests_at(0.0)
    assert Entry(dwell(1.0), None, 2.0).rests_at(2.5)
    at_speed = entry_of(even(0.0, 10.0, 1.0), 2.0)
    assert not at_speed.rests_at(2.0) and not at_speed.rests_at(3.0)


@pytest.mark.parametrize("seconds", [1e-7, 1e-6])
def test_a_law_does_not_rest_just_behind_its_beginning_or_before_its_end(seconds: float) -> None:
    """There it hardly moves yet, but it has begun: a clock that stood there would miss where it began."""
    entry = entry_of(to_rest(0.0, 50.0, 1.0), 2.0)
    assert abs(entry.at(2.0 + seconds)[1]) < 1e-6
    assert not entry.rests_at(2.0 + seconds) and not entry.rests_at(3.0 - seconds)


def test_a_law_backwards_is_no_rest() -> None:
    assert not entry_of(even(50.0, -10.0, 1.0)).rests_at(0.0)


def test_what_binds_holds_from_its_time_to_the_next() -> None:
    piece = piece_of(even(0.0, 10.0, 1.0))._replace(binds=((0.0, 3), (0.25, 11), (0.5, 1)))
    entry = Entry(piece, move_of(), 4.0)
    assert [entry.binding_at(4.0 + t) for t in (0.0, 0.2, 0.25, 0.4, 0.5, 0.9)] == [3, 3, 11, 11, 1, 1]
    assert entry_of(even(0.0, 10.0, 1.0)).binding_at(0.5) == 0


class Lines(ToolSpline):
    """Of a line each millimetre."""

    def line_at(self, s: float) -> int:
        return 100 + int(s)


def test_a_spline_tells_the_line_under_the_clock_and_another_motion_its_pieces() -> None:
    spline = Entry(piece_of(even(0.0, 10.0, 1.0)), object.__new__(Lines), 0.0)
    assert [spline.line_at(s) for s in (0.0, 7.5)] == [100, 107]
    assert entry_of(even(0.0, 10.0, 1.0)).line_at(7.5) == 1


# ---- a message


def queue_that_knows(motions: dict[int, Motion]) -> Queue:
    """Of each motion it has a piece, up to 6 s."""
    queue, pieces = Queue(), [piece_of(to_rest(0.0, 50.0, 6.0 / len(motions)), i) for i in motions]
    message = PieceMessage(1, 0.0, motions, tuple(pieces))
    queue.add(message, queue.entries_of(message, 0.0) or [], 0.0)
    return queue


def test_pieces_of_a_message_follow_one_another_from_its_time_on() -> None:
    first, second = move_of(), move_of(20.0)
    laws = to_rest(0.0, 50.0, 1.0), to_rest(0.0, 20.0, 0.5)
    pieces = (piece_of(laws[0], 4), dwell(0.25), piece_of(laws[1], 5))
    message = PieceMessage(1, 6.0, {5: second}, pieces)
    found = queue_that_knows({4: first}).entries_of(message, 6.0)
    assert found is not None
    assert [(e.start_s, e.end_s) for e in found] == [(6.0, 7.0), (7.0, 7.25), (7.25, 7.75)]
    assert [e.motion for e in found] == [first, None, second]


def test_a_motion_that_a_message_brings_again_counts_before_the_one_that_was_known() -> None:
    old, new = move_of(), move_of(20.0)
    message = PieceMessage(1, 0.0, {4: new}, (piece_of(to_rest(0.0, 20.0, 1.0), 4),))
    found = queue_that_knows({4: old}).entries_of(message, 0.0)
    assert found is not None and found[0].motion is new


def test_without_pieces_or_with_one_whose_motion_nobody_knows_there_is_nothing() -> None:
    queue = Queue()
    assert queue.entries_of(PieceMessage(1, 0.0), 0.0) is None
    known = piece_of(to_rest(0.0, 50.0, 1.0), 4)
    pieces = (known, known._replace(motion_id=0))
    assert queue.entries_of(PieceMessage(1, 0.0, {4: move_of()}, pieces), 0.0) is None


# ---- where stops begin


def table_of(start_s: float, rows: int, jerk: float = -1.0) -> StopTable:
    return StopTable.of(start_s, 2.0 * T, T, [[jerk, jerk]] * rows)


def test_a_stop_begins_at_just_its_time() -> None:
    stops, table = Stops(), table_of(1.0, 10)
    stops.add([table], 1.0, 0.0)
    for i in range(10):
        assert stops.row_at(1.0 + 2.0 * i * T) == (table, i)
        assert stops.row_at(1.0 + 2.0 * i * T + 1e-9) == (table, i), "rounding of the clock"
        assert stops.row_at(1.0 + 2.0 * i * T - 1e-9) == (table, i)
        assert stops.row_at(1.0 + (2.0 * i + 1.0) * T) is None
    assert stops.row_at(1.0 - 2.0 * T) is None
    assert stops.row_at(1.0 + 20.0 * T) is None


def test_no_stop_begins_where_the_plan_itself_is_as_quick() -> None:
    table = StopTable.of(0.0, T, T, [[-1.0], [], [-1.0, -2.0], []])
    stops = Stops()
    stops.add([table], 0.0, 0.0)
    assert [stops.row_at(i * T) is not None for i in range(4)] == [True, False, True, False]


def test_each_table_of_a_message_counts_and_those_of_messages_before_it() -> None:
    stops, tables = Stops(), [table_of(i * 20.0 * T, 10) for i in range(3)]
    stops.add(tables[:2], 0.0, 0.0)
    stops.add(tables[2:], tables[2].start_s, 0.0)
    for table in tables:
        assert stops.row_at(table.start_s + 6.0 * T) == (table, 3)


def test_from_where_the_plan_is_new_its_own_stops_count_and_none_of_the_old() -> None:
    stops, old = Stops(), table_of(0.0, 50)
    stops.add([old], 0.0, 0.0)
    new = table_of(41.0 * T, 3, jerk=-2.0)
    stops.add([new], 41.0 * T, 0.0)
    assert stops.row_at(40.0 * T) == (old, 20)
    assert stops.row_at(41.0 * T) == (new, 0)
    assert stops.row_at(42.0 * T) is None, "that one was made for a plan that is no more"
    assert stops.row_at(60.0 * T) is None


def test_tables_behind_the_clock_are_forgotten() -> None:
    stops = Stops()
    for i in range(100):
        start_s = i * 20.0 * T
        stops.add([table_of(start_s, 10)], start_s, start_s - 5.0 * T)
        assert len(stops._tables) <= 2
        assert stops.row_at(start_s) is not None
    stops.add([StopTable.of(0.0, T, T, [])], 0.0, 0.0)
    assert not stops._tables, "one without stops is not kept"


# ---- a stop under way


def integrated(
    state: tuple[float, float, float], jerks: list[float], seconds: float
) -> tuple[float, float, float]:
    """Exactly, jerk after jerk, each for so long."""
    for j in jerks:
        way = Polynomial([state[0], state[1], state[2] / 2.0, j / 6.0])
        state = float(way(seconds)), float(way.deriv()(seconds)), float(way.deriv(2)(seconds))
    return state


def test_before_its_first_stop_none_is_under_way() -> None:
    brake = Brake(T)
    assert not brake.active and brake.over


@pytest.mark.parametrize("held", [1, 3])
def test_a_stop_follows_its_jerks_each_as_long_as_the_table_has_it(held: int) -> None:
    state, jerks = (4.0, 12.0, -30.0), [-900.0, -400.0, 700.0, 650.0]
    table = StopTable.of(0.0, T, held * T, [[1.0], jerks, [2.0, 3.0]])
    brake = Brake(T)
    brake.begin(table, 1, state)
    assert brake.active and not brake.over and (brake.s, brake.v, brake.a) == state
    assert brake.left_at == state[1]
    for n in range(1, 4 * held):
        brake.step()
        whole, part = divmod(n, held)
        there = integrated(integrated(state, jerks[:whole], held * T), jerks[whole : whole + 1], part * T)
        assert (brake.s, brake.v, brake.a) == pytest.approx(there, rel=1e-12)
        assert not brake.over
    brake.step()
    assert brake.over and (brake.v, brake.a) == (0.0, 0.0), "to the last bit"
    assert brake.s == pytest.approx(integrated(state, jerks, held * T)[0], rel=1e-12)


def test_a_stop_that_is_taken_back_goes_the_same_way_again() -> None:
    brake = Brake(T)
    brake.begin(StopTable.of(0.0, T, 2 * T, [[-900.0, -400.0, 700.0]]), 0, (4.0, 12.0, -30.0))
    for _ in range(3):
        brake.step()
    saved, seen = brake.save(), []
    for _ in range(2):
        brake.restore(saved)
        seen.append([])
        while not brake.over:
            brake.step()
            seen[-1].append((brake.s, brake.v, brake.a))
    assert seen[0] == seen[1] and len(seen[0]) == 3


def test_a_stop_stands_at_once_where_the_drives_do() -> None:
    brake = Brake(T)
    brake.begin(StopTable.of(0.0, T, T, [[-900.0, -400.0]]), 0, (4.0, 12.0, -30.0))
    brake.step()
    brake.stand(4.5)
    assert brake.active and brake.over and (brake.s, brake.v, brake.a) == (4.5, 0.0, 0.0)


def on_the_way(s: float) -> Brake:
    brake = Brake(T)
    brake.begin(StopTable.of(0.0, T, T, [[-900.0]]), 0, (s, 12.0, 0.0))
    return brake


def through(*speeds_at_end: float) -> Queue:
    """A queue of motions of 50 mm, each as two pieces; at 0 mm/s the second ends at rest."""
    queue, pieces = Queue(), []
    for identity, speed in enumerate(speeds_at_end):
        second = even(25.0, speed, 1.0) if speed else Law((0.0, 1.0), ((25.0, 50.0, -25.0, 0.0, 0.0, 0.0),))
        pieces += [piece_of(law, identity) for law in (even(0.0, 25.0, 1.0), second)]
    motions = {identity: move_of() for identity in range(len(speeds_at_end))}
    message = PieceMessage(1, 0.0, motions, tuple(pieces))
    queue.add(message, queue.entries_of(message, 0.0) or [], 0.0)
    return queue


def test_a_stop_within_its_motion_stays_in_its_entry() -> None:
    brake = on_the_way(49.0)
    assert brake.come_to(through(25.0, 25.0), 0) == 0 and brake.s == 49.0
    brake = on_the_way(50.0)
    assert brake.come_to(through(25.0, 25.0), 1) == 1 and brake.s == 50.0


def test_a_stop_runs_on_by_what_it_is_beyond_the_motions_end_over_all_pieces_of_it() -> None:
    brake = on_the_way(53.0)
    assert brake.come_to(through(25.0, 25.0, 25.0), 0) == 2 and brake.s == pytest.approx(3.0)
    brake = on_the_way(111.0)
    assert brake.come_to(through(25.0, 25.0, 25.0), 1) == 4 and brake.s == pytest.approx(11.0)


def test_a_stop_goes_on_where_the_next_motion_is_entered_which_may_be_in_its_middle() -> None:
    """As behind a way back to the path."""
    queue, first, second = Queue(), piece_of(even(0.0, 25.0, 2.0), 0), piece_of(even(20.0, 25.0, 1.0), 1)
    message = PieceMessage(1, 0.0, {0: move_of(), 1: move_of()}, (first, second))
    queue.add(message, queue.entries_of(message, 0.0) or [], 0.0)
    brake = on_the_way(53.0)
    assert brake.come_to(queue, 0) == 1 and brake.s == pytest.approx(23.0)


def test_a_stop_ends_where_the_plan_rests_or_the_queue_is_over() -> None:
    """It was made to: what is beyond is rounding."""
    brake = on_the_way(50.0 + 1e-9)
    assert brake.come_to(through(0.0, 25.0), 0) == 0 and brake.s == 50.0
    brake = on_the_way(50.0 + 1e-9)
    assert brake.come_to(through(25.0), 1) == 1 and brake.s == 50.0


@pytest.mark.parametrize(("end", "leaves"), [(50.0, True), (50.0 - 1e-5, False), (20.0, False)])
def test_a_thread_is_left_where_its_motion_ends(end: float, leaves: bool) -> None:
    thread = ThreadMove(Line((0.0, 0.0, 0.0), (0.0, 0.0, -50.0)), 50.0, (0.0, 0.0), (0.0, 0.0))
    entry = entry_of(to_rest(0.0, end, 1.0), motion=thread)
    assert entry.thread is thread and entry.leaves_thread is leaves
    assert not entry_of(to_rest(0.0, end, 1.0)).leaves_thread, "a line that no spindle leads"
