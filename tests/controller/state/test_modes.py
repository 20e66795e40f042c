"""The table of modes, and the sentence of every refusal."""

from __future__ import annotations

from typing import Any

import pytest
from support.suite.cases import each

from controller.messages import text
from controller.state.modes import (
    ALL_AXES,
    ALWAYS,
    PROGRESS,
    TRANSITIONS,
    Fault,
    Mode,
    Request,
    follows,
    refusal,
    sentence,
)

PAIRS = [(mode, request) for mode in Mode for request in Request]


def text_of(*asked: Any, **more: Any) -> str:
    """A refusal in words; "" where there is none."""
    return text(refusal(*asked, **more))


@each(("mode", "request_"), PAIRS)
def test_every_refusal_names_mode_request_and_reason_and_nothing_else_is_refused(
    mode: Mode, request_: Request
) -> None:
    said = text_of(mode, request_)
    assert (said == "") is (follows(mode, request_) is not None)
    if said:
        assert said.startswith(f"{request_.name} is refused in {mode.name}: ") and said.endswith(").")
        assert "; " in said  # the reason, and what to do


def test_every_mode_has_its_progress_and_every_request_a_mode_that_knows_it() -> None:
    assert set(PROGRESS) == set(Mode)
    assert {request for _, request in TRANSITIONS} | ALWAYS == set(Request)


def test_a_jog_starts_out_of_rest_only_and_comes_back_to_where_it_began() -> None:
    assert follows(Mode.OFF, Request.JOG_STOP) is Mode.OFF  # a key that goes up is no error
    assert {mode for mode, request in TRANSITIONS if request is Request.JOG} == {
        Mode.READY,
        Mode.HOLD,
        Mode.JOG,
    }
    assert PROGRESS[Mode.JOG] == {Mode.READY, Mode.HOLD, Mode.FAULT}


def test_a_start_names_the_axes_to_be_homed() -> None:
    axes = ("X", "Y", "Z", "A", "C")
    assert "Y, C must be homed" in text_of(Mode.READY, Request.START, untrusted=0b10010, axes=axes)
    assert "X must be homed" in text_of(Mode.READY, Request.START, homed=ALL_AXES & ~1, axes=axes)
    assert text_of(Mode.READY, Request.START) == ""


@pytest.mark.parametrize(
    ("mode", "request_", "interlock", "granted"),
    [
        (Mode.READY, Request.START, Fault.DOOR_OPEN, False),
        (Mode.READY, Request.JOG, Fault.DOOR_OPEN, False),
        (Mode.HOLD, Request.RESUME, Fault.DOOR_OPEN, False),
        (Mode.OFF, Request.ENABLE, Fault.DOOR_OPEN, True),
        (Mode.OFF, Request.ENABLE, Fault.ESTOP_INPUT, False),
        (Mode.READY, Request.DISABLE, Fault.ESTOP_INPUT, True),
        (Mode.RUNNING, Request.HOLD, Fault.DOOR_OPEN, True),
    ],
)
def test_an_interlock_is_told_with_its_own_text(
    mode: Mode, request_: Request, interlock: Fault, granted: bool
) -> None:
    said = text_of(mode, request_, interlock=interlock)
    assert said == ("" if granted else f"{request_.name} is refused in {mode.name}: {sentence(interlock)}")


def test_what_must_stand_or_be_back_is_said() -> None:
    assert "still move" in text_of(Mode.HOLD, Request.JOG, standing=False)
    assert "still move" in text_of(Mode.FAULT, Request.RESET, standing=False)
    assert text_of(Mode.JOG, Request.JOG, standing=False) == ""
    assert "let it return" in text_of(Mode.HOLD, Request.RESUME, away=True)
