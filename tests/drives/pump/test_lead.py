"""Rows that have the law of a thread alone, as they are led by what is left of the last correction."""

from __future__ import annotations

import pytest

from drives.pump.lead import Correction, Lead, LedRows
from drives.pump.plan_memory import Memory, PlanReader, PlanWriter

PER_MM, TURN, V, A = (0.0, -2000.0), -0.8, 20.0, 50.0
BEND = 0.003
LAST = Correction(0.1, 0.007, 0.2, 1.0, 0.05, 0.02, 0.015, 0.004)
KNOWN = 3
LED = (5.0, TURN, 0.25, 0.0, 0.0, 0.0)  # columns of a row that has its correction


def by_law(i: int) -> tuple[float, ...]:
    """(s, counts, columns of a thread)."""
    s = 0.04 * i
    law = LED if i < KNOWN else (TURN * V, TURN, 0.0, TURN * A, V, A)
    return (s, 7.0, 100.0 - 2000.0 * s, *law)


def led(i: int) -> tuple[float, ...]:
    """As it is to be sent: the step of the axes dies away, and what drifts goes on."""
    steps = [0.007 - BEND * (k + 1) for k in range(i - KNOWN + 1)]
    off_rev = 0.1 + sum(max(0.0, step) for step in steps)
    ahead_mm = 0.004 * (V + 0.5 * 0.004 * A)
    s, x, y, *_ = by_law(i)
    y += PER_MM[1] * (ahead_mm - off_rev / TURN)
    return (s, x, y, 1.02 * TURN * V + 0.015 * TURN * A + 0.05, TURN, ahead_mm, 0.0, 0.0, 0.0)


def test_a_row_by_the_law_is_led_by_what_is_left_of_the_last_correction_in_any_order() -> None:
    rows = LedRows(by_law, Lead(KNOWN, BEND, LAST, PER_MM))
    for i in (7, 3, 4, 20, 5):
        assert rows(i) == pytest.approx(led(i), abs=1e-9)
    assert rows(KNOWN - 1) == by_law(KNOWN - 1)
    assert LedRows(by_law, None)(7) == by_law(7)


def test_a_row_beside_the_thread_is_as_it_is() -> None:
    beside = (1.0, 7.0, 8.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert LedRows(lambda _: beside, Lead(0, BEND, LAST, PER_MM))(4) == beside


def test_the_pump_leads_them_as_the_tick_has_foreseen_it() -> None:
    memory = Memory(2, thread=True)
    writer, reader = PlanWriter(memory), PlanReader(memory)
    for i in range(9):
        writer.put(40 + i, by_law(i))
    lead = Lead(KNOWN, BEND, LAST, PER_MM)
    writer.publish(40, 40, 5, 10, None, True, lead)
    assert reader.take(40, True)
    assert [tuple(reader.row(i)) for i in range(9)] == [tuple(LedRows(by_law, lead)(i)) for i in range(9)]
    writer.publish(40, 40, 5, 10, None, True)
    assert reader.take(40, True)
    assert [tuple(reader.row(i)) for i in range(9)] == [by_law(i) for i in range(9)]
