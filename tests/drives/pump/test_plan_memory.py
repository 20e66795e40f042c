"""Plans in shared memory: whole or not at all, whatever was half written, and what was played, back."""

from __future__ import annotations

import os
import random
import subprocess
import sys
from collections.abc import Iterator

import pytest

from drives.pump.plan_memory import (
    MAX_JERKS,
    NOTHING_PLAYED,
    ROWS,
    Memory,
    Phase,
    PlanReader,
    PlanWriter,
    Played,
    Stop,
)

DRIVES = 3
STOP = Stop((-4.0, 0.5, 4.0), 2, 1, 10.0, -0.25)
NOTHING = NOTHING_PLAYED


def row_of(period: int, plan: int = 0) -> tuple[float, ...]:
    return (period * 0.25, *(1000.0 * drive + period + plan * 1e-3 for drive in range(DRIVES)))


def publish(writer: PlanWriter, first: int, rows: int, plan: int = 0, stop: Stop | None = STOP) -> None:
    """A beginning with rows that name their period and plan."""
    for period in range(first, first + rows):
        writer.put(period, row_of(period, plan))
    writer.publish(first, first, rows, 5, stop, anew=True)


def read(reader: PlanReader) -> list[tuple[float, ...]]:
    return [reader.row(i) for i in range(reader.rows)]


def test_a_plan_is_read_as_it_was_published() -> None:
    memory = Memory(DRIVES)
    writer, reader = PlanWriter(memory), PlanReader(memory)
    assert not reader.take(0, True)
    publish(writer, 7, 9)
    assert reader.take(7, True)
    assert (reader.number, reader.first, reader.nominal, reader.rows, reader.hold) == (1, 7, 9, 9, 5)
    assert reader.stop is not None and reader.stop._replace(jerks=tuple(reader.stop.jerks)) == STOP
    assert read(reader) == [row_of(period) for period in range(7, 16)]
    assert not reader.take(8, False), "it is taken once"


@pytest.mark.parametrize("first", [ROWS - 9, ROWS - 1, ROWS, 5 * ROWS - 4])
def test_rows_go_over_the_end_of_their_area(first: int) -> None:
    memory = Memory(DRIVES)
    writer, reader = PlanWriter(memory), PlanReader(memory)
    publish(writer, first, 9)
    assert reader.take(first, True)
    assert read(reader) == [row_of(period) for period in range(first, first + 9)]


def test_a_plan_has_room_for_as_many_rows_and_jerks_as_an_area() -> None:
    memory = Memory(DRIVES)
    writer, reader = PlanWriter(memory), PlanReader(memory)
    publish(writer, 100, ROWS, stop=Stop([0.5] * MAX_JERKS, 1, 0, 1.0, 0.0))
    assert reader.take(100, True) and reader.rows == ROWS
    assert reader.stop is not None and len(reader.stop.jerks) == MAX_JERKS
    assert reader.row(ROWS - 1) == row_of(100 + ROWS - 1)


# -- half written


def used(memory: Memory, first: int, rows: int, jerks: int) -> Iterator[int]:
    """Places of an area that count for a plan."""
    yield from range(memory.rows_at - MAX_JERKS * 8 + jerks * 8)
    size = memory.row.size
    for period in range(first, first + rows):
        at = memory.rows_at + period % ROWS * size
        yield from range(at, at + size)


def test_a_plan_torn_at_any_byte_is_that_before_it_or_none() -> None:
    """Both ways round: the beginning is new, or the end."""
    first, rows = ROWS - 3, 5
    memory = Memory(DRIVES)
    writer = PlanWriter(memory)
    publish(writer, first, rows, plan=1)
    area = memory.areas[1]
    old = bytes(area)
    publish(writer, first, rows, plan=2)
    memory.areas[0][:] = bytes(len(area))
    publish(writer, first, rows, plan=3)
    new = bytes(area)
    whole = {n: [row_of(p, n) for p in range(first, first + rows)] for n in (1, 3)}
    taken = set()
    for at in used(memory, first, rows, len(STOP.jerks)):
        for torn in (new[:at] + old[at:], old[:at] + new[at:]):
            area[:] = torn
            reader = PlanReader(memory)
            if reader.take(first, True):
                assert read(reader) == whole[reader.number], at
                taken.add(reader.number)
    assert taken == {1, 3}


def test_a_plan_with_any_bit_wrong_is_none() -> None:
    first, rows = ROWS - 2, 4
    memory = Memory(DRIVES)
    publish(PlanWriter(memory), first, rows)
    area = memory.areas[1]
    good = bytes(area)
    jerks = len(STOP.jerks)
    unused = range(memory.rows_at - MAX_JERKS * 8 - 8, memory.rows_at - MAX_JERKS * 8)
    for at in used(memory, first, rows, jerks):
        if at in unused and not PlanReader(memory).take(first, True):
            continue
        for bit in range(8):
            area[at] ^= 1 << bit
            reader = PlanReader(memory)
            taken = reader.take(first, True)
            if taken:  # padding after the seal
                assert at in unused
                assert read(reader) == [row_of(p) for p in range(first, first + rows)]
            area[at] ^= 1 << bit
    assert bytes(area) == good


def test_a_head_of_zeros_is_no_plan_and_the_plan_before_it_goes_on() -> None:
    memory = Memory(DRIVES)
    writer, reader = PlanWriter(memory), PlanReader(memory)
    publish(writer, 0, 6)
    assert reader.take(0, True)
    publish(writer, 1, 6, plan=2)
    memory.areas[0][:64] = bytes(64)
    assert not reader.take(1, False)
    assert (reader.number, read(reader)) == (1, [row_of(period) for period in range(6)])


def test_where_the_newest_is_half_written_the_one_before_it_is_taken() -> None:
    memory = Memory(DRIVES)
    writer, reader = PlanWriter(memory), PlanReader(memory)
    for plan in (1, 2, 3):
        publish(writer, plan, 6, plan)
    memory.areas[1][memory.rows_at + 3 * memory.row.size] ^= 1  # of the third
    assert reader.take(4, True) and reader.number == 2


# -- refused


def test_a_plan_that_changes_what_has_gone_out_is_refused_and_counted() -> None:
    memory = Memory(DRIVES)
    writer, reader = PlanWriter(memory), PlanReader(memory)
    publish(writer, 0, 8)
    assert reader.take(0, True)
    writer.publish(1, 2, 6, 5, None)
    assert not reader.take(3, False)  # period 2 has been played by the first
    assert (reader.number, reader.refused) == (1, 1)
    assert not reader.take(4, False) and reader.refused == 1, "once"
    writer.publish(3, 4, 5, 5, None)
    assert reader.take(4, False) and reader.number == 3


def test_a_plan_that_begins_later_is_refused() -> None:
    memory = Memory(DRIVES)
    writer, reader = PlanWriter(memory), PlanReader(memory)
    publish(writer, 5, 8)
    assert not reader.take(4, True)
    assert reader.refused == 1


def test_after_silence_only_a_beginning_will_do() -> None:
    memory = Memory(DRIVES)
    writer, reader = PlanWriter(memory), PlanReader(memory)
    publish(writer, 0, 8)
    writer.publish(0, 9, 8, 5, None)
    assert not reader.take(2, True)
    writer.publish(0, 0, 8, 5, None, anew=True)
    assert reader.take(2, True) and reader.anew


# -- any sequence


@pytest.mark.parametrize("seed", range(40))
def test_whatever_is_published_and_when_it_is_looked_at_the_reader_has_what_a_plain_model_has(
    seed: int,
) -> None:
    """The model: each plan as a list of its own. Rows that do not change are written once only."""
    chance = random.Random(seed)
    memory = Memory(DRIVES)
    writer, reader = PlanWriter(memory), PlanReader(memory)
    period = chance.randrange(3 * ROWS)
    written: dict[int, tuple[float, ...]] = {}
    published: dict[int, list[tuple[float, ...]]] = {}
    firsts: dict[int, int] = {}
    tail = first = period
    for turn in range(300):
        if chance.random() < 0.7:
            first = max(first, period - chance.randrange(2))
            begin = max(first, chance.choice((tail, tail, first + chance.randrange(4))))
            begin = min(begin, tail) if tail > first else first
            tail = begin + chance.randrange(1, 40)
            for one in range(begin, tail):
                written[one] = row_of(one, turn)
                writer.put(one, written[one])
            rows = tail - first
            writer.publish(first, begin, rows, 5, None, anew=True)
            published[writer.number] = [written[one] for one in range(first, tail)]
            firsts[writer.number] = first
        if chance.random() < 0.6:
            newest = max(published, default=0)
            left = range(firsts[newest], firsts[newest] + len(published[newest])) if newest else ()
            due = newest > reader.number and period in left
            refused = reader.refused
            if reader.take(period, True):
                assert due and reader.number == newest
            else:
                assert not due or reader.refused == refused
            if reader.number:
                assert read(reader) == published[reader.number], f"seed {seed}, turn {turn}"
            period += chance.randrange(3)


# -- back, and between processes


def test_what_was_played_is_read_whole_or_as_it_was_before() -> None:
    memory = Memory(DRIVES)
    writer, reader = PlanWriter(memory), PlanReader(memory)
    assert writer.played() == NOTHING
    words = Played(12, 3, Phase.BRAKING, 2, 1, 123_456_789_012, 4, 55_000, 9)
    reader.report(words)
    assert writer.played() == words
    memory.record[0] += 1  # in the middle of the next
    memory.record[1] = 13
    assert writer.played() == words
    memory.record[0] += 1
    assert writer.played() == words._replace(period=13)


def test_two_mappings_of_one_file_are_one_memory() -> None:
    ours, descriptor = Memory.create(DRIVES)
    try:
        theirs = Memory(DRIVES, descriptor)
    finally:
        os.close(descriptor)
    publish(PlanWriter(ours), 0, 4)
    assert PlanReader(theirs).take(0, True)
    ours.muted, ours.at_once, ours.words[2], ours.positions[1] = 5, 20, 0x1000F, -7
    assert (theirs.muted, theirs.at_once, theirs.words[2], theirs.positions[1]) == (5, 20, 0x1000F, -7)
    PlanReader(theirs).report(NOTHING._replace(period=3))
    assert PlanWriter(ours).played().period == 3


PUBLISHES = """
import itertools, sys
from drives.pump.plan_memory import Memory, PlanWriter
writer = PlanWriter(Memory(3, int(sys.argv[1])))
print(flush=True)
for plan in itertools.count(1):
    for period in range(2040, 2060):
        writer.put(period, (float(plan), float(plan), 0.0, float(period)))
    writer.publish(2040, 2040, 20, 5, None, True)
"""


def test_a_tick_that_is_killed_while_it_publishes_leaves_a_whole_plan_or_none() -> None:
    for _ in range(4):
        memory, descriptor = Memory.create(DRIVES)
        with subprocess.Popen(
            [sys.executable, "-c", PUBLISHES, str(descriptor)],
            pass_fds=(descriptor,),
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        ) as tick:
            os.close(descriptor)
            assert tick.stdout is not None
            tick.stdout.readline()
            reader, taken = PlanReader(memory), 0
            while taken < 50:  # meanwhile it is read as well
                taken += reader.take(2040, True)
            tick.kill()
            tick.wait()
            reader.take(2040, True)
        (plan,) = {row[0] for row in read(reader)}
        assert plan == reader.number
        assert [row[3] for row in read(reader)] == list(range(2040, 2060))
