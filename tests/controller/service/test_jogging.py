"""A press of a key moves the machine until anybody stops it, and no request of it does so later."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from controller.service.jogging import MAX_ENDED, SILENCE_S, Presses


@dataclass
class Clock:
    now_s: float = 0.0

    def __call__(self) -> float:
        return self.now_s


def test_a_stop_from_anywhere_ends_the_press_that_is_held_and_the_next_one_moves() -> None:
    presses = Presses()
    assert presses.may_move("a") and presses.may_move("a")
    presses.end()
    assert not presses.may_move("a") and not presses.may_move("a")
    assert presses.may_move("b") and not presses.may_move("a")


def test_a_press_that_was_overtaken_by_its_own_end_moves_nothing() -> None:
    presses = Presses()
    presses.end("a")
    assert not presses.may_move("a")


def test_the_late_end_of_one_press_leaves_the_next_one_alone() -> None:
    presses = Presses()
    assert presses.may_move("a") and presses.may_move("b")
    presses.end("a")
    assert presses.may_move("b")


@pytest.mark.parametrize(("silence_s", "moves"), [(SILENCE_S / 2.0, False), (SILENCE_S, True)])
def test_without_a_name_a_press_is_over_when_it_was_silent_for_long(silence_s: float, moves: bool) -> None:
    presses = Presses(clock := Clock())
    assert presses.may_move("")
    presses.end()
    clock.now_s += silence_s
    assert presses.may_move("") is moves
    clock.now_s += SILENCE_S / 2.0
    assert presses.may_move("") is moves, "asking on is no silence"


def test_a_stop_before_any_press_stops_none_that_comes_later() -> None:
    presses = Presses(Clock())
    presses.end()
    assert presses.may_move("") and presses.may_move("a")


def test_only_the_latest_ends_are_remembered() -> None:
    presses = Presses()
    for i in range(MAX_ENDED + 1):
        presses.end(str(i))
    assert presses.may_move("0") and not presses.may_move("1")
