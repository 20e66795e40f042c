"""What is said travels from whoever refuses to whoever asked, and is put into words there."""

from __future__ import annotations

import threading

import pytest

from controller.api import service_client
from controller.api.answers import Refusal
from controller.ipc.control_socket import CommandRefused
from controller.messages import LANGUAGES, Key, text
from controller.service import journal
from controller.service.refusals import by_fault, refused
from controller.service.sequencer import Sequencer
from controller.state.modes import Fault

HANGS_S = 60.0  # no test is meant to come near


def test_a_refusal_is_in_every_language_with_mode_and_request() -> None:
    error = refused("waited", "HOMING", "HOME", seconds=3.0, what=Key("standstill"))
    assert (error.code, error.mode, error.request) == ("refused", "HOMING", "HOME")
    assert error.sentence == str(error) == "Waited 3 s for standstill in vain."
    assert text(error.said, "de") == "3 s vergeblich gewartet: auf den Stillstand."


def test_a_refusal_keeps_what_it_says_through_the_door_and_the_panel() -> None:
    error = by_fault(Fault.DOOR_OPEN, "READY", "START")
    told = service_client.refusal(CommandRefused.from_dict(error.to_dict()))
    assert told.said == error.said and (told.facts.mode, told.facts.request) == ("READY", "START")
    assert "Tür" in text(told.said, "de") and "door" in text(told.said)


def test_a_refusal_that_is_a_sentence_alone_is_that_in_every_language() -> None:
    told = service_client.refusal(CommandRefused("bad", "part.ngc:3: G99 is no code."))
    assert {text(told.said, language) for language in LANGUAGES} == {"part.ngc:3: G99 is no code."}


def test_a_refusal_without_a_reason_says_that() -> None:
    assert "without a reason" in str(service_client.refusal(CommandRefused.from_dict({"code": "refused"})))


@pytest.mark.parametrize("key", ["control_held", "no_control"])
def test_a_refusal_of_the_panels_own_is_in_every_language(key: str) -> None:
    told = Refusal.of(409, "control", key, holder="anna").said
    assert text(told).startswith("anna holds control")
    assert text(told, "de").startswith("anna hat die Bedienung")


def test_work_that_failed_and_work_that_is_in_the_way_are_told() -> None:
    go = threading.Event()
    sequencer = Sequencer(lambda name, error: None)

    def work() -> dict[str, object]:
        go.wait(HANGS_S)
        raise refused("stopped", "READY", "START")

    under_way = sequencer.do("start", work)
    with pytest.raises(CommandRefused, match="start is under way"):
        sequencer.do("home", dict)
    go.set()
    with pytest.raises(CommandRefused):
        under_way.result(HANGS_S)
    assert sequencer.now is not None
    shown = sequencer.now.to_dict()
    assert shown["state"] == "failed" and text(shown, "de").startswith("Es wurde gestoppt")
    sequencer.wait()


def test_why_a_restart_is_not_offered_is_told() -> None:
    nothing = journal.Job("", "", "", "", "", (0.0,) * 5, 0.0)
    assert journal.refusal(None, nothing, 0, 0, 5) == {"key": "not_interrupted", "values": {}}
