"""Requests at random against the stepped machine: each answered once, and a way out of every state."""

from __future__ import annotations

import random

import pytest
from support.machines import request_sequences
from support.machines.request_sequences import NotSo, Site
from support.suite.seed import SEED

from controller.ipc.handoff import Outcome
from controller.state.modes import Mode, Request


def test_all_requests_are_among_those_that_are_asked() -> None:
    """But what commissioning tells; a fault that needs it brings it into a sequence."""
    assert set(Request) - set(request_sequences.ASKED) == {Request.ARRANGED}


def test_every_request_is_answered_once_and_every_state_has_a_way_out() -> None:
    request_sequences.run(40, 21)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(40))
def test_so_it_is_in_many_sequences(part: int) -> None:
    request_sequences.run(160, SEED * 40 + part)


@pytest.fixture(scope="module")
def site() -> Site:
    return Site(random.Random(1))


def test_an_answer_that_is_given_twice_or_never_is_found(site: Site) -> None:
    """The judge itself is judged: a tick that answers otherwise than it should is told."""
    give = site.bench.cycle.answers.give
    for times in (0, 2):
        site.bench.cycle.answers.give = lambda *more, n=times: [give(*more) for _ in range(n)]  # type: ignore[method-assign, misc]
        site.answers.clear()
        site.asked.clear()
        site.ask(Request.HOLD)
        site.ticks(2)
        site.bench.cycle.answers.give = give  # type: ignore[method-assign]
        with pytest.raises(NotSo, match=f"is answered {times} times"):
            site._judge()


def test_an_answer_that_is_another_than_what_came_of_it_is_found(site: Site) -> None:
    site.answers.clear()
    site.asked.clear()
    number = site.ask(Request.HOLD)
    site.ticks(2)
    assert site.mode is Mode.READY and site.answers[number][0][0] is Outcome.REFUSED
    site._judge()
    site.answers[number] = [(Outcome.DONE, site.answers[number][0][1])]
    with pytest.raises(NotSo, match="is answered DONE"):
        site._judge()


def test_an_answer_that_comes_late_is_found(site: Site) -> None:
    site.answers.clear()
    site.asked.clear()
    number = site.ask(Request.OVERRIDE, 1.0)
    site.ticks(2)
    site._judge()
    site.asked[number] -= request_sequences.ANSWER_TICKS
    with pytest.raises(NotSo, match="is answered after"):
        site._judge()


def test_homing_of_no_axis_or_of_one_that_is_not_there_is_refused_and_answered(site: Site) -> None:
    site.ask(Request.DISABLE)
    site.ticks(60)
    assert site.mode is Mode.OFF
    for value in (0.0, 32.0, -1.0, 2.5, float("nan"), float("inf")):
        number = site.ask(Request.HOME, value)
        site.ticks(2)
        assert [came for came, _ in site.answers[number]] == [Outcome.REFUSED], value
        assert site.mode is Mode.OFF
