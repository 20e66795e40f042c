"""Refusals in both languages, from whoever refuses to whoever asked."""

from __future__ import annotations

import threading
from functools import partial

import pytest

from controller import journal
from controller.catalogue import LANGUAGES, Key
from controller.door import DoorError
from controller.panel import link
from controller.panel.answers import Refusal
from controller.service.refused import in_both, refused
from controller.service.sequencer import Sequencer
from controller.state import Fault, sentence

HANGS_S = 60.0  # no test is meant to come near


def test_a_refusal_says_the_same_in_both_languages_with_mode_and_request() -> None:
    error = refused("waited", "HOMING", "HOME", seconds=3.0, what=Key("standstill"))
    assert (error.code, error.mode, error.request) == ("refused", "HOMING", "HOME")
    assert error.sentence == "Waited 3 s for standstill in vain."
    assert error.sentence_de == "3 s vergeblich gewartet: auf den Stillstand."


def test_a_refusal_keeps_both_languages_through_the_door_and_the_panel() -> None:
    error = in_both(partial(sentence, Fault.DOOR_OPEN, "", Fault.NONE), "READY", "START")
    facts = link.refusal(DoorError.from_dict(error.to_dict())).facts
    assert (facts.sentence, facts.sentence_de) == (error.sentence, error.sentence_de)
    assert "Tür" in error.sentence_de and "door" in error.sentence
    assert (facts.mode, facts.request) == ("READY", "START")


def test_a_refusal_that_is_known_in_english_only_says_so_by_saying_nothing_in_german() -> None:
    assert link.refusal(DoorError("bad", "part.ngc:3: G99 is no code.")).facts.sentence_de is None


@pytest.mark.parametrize("key", ["control_held", "no_control"])
def test_a_refusal_of_the_panels_own_is_in_both_languages(key: str) -> None:
    facts = Refusal.told(409, "control", key, holder="anna").facts
    assert facts.sentence.startswith("anna holds control")
    assert facts.sentence_de is not None and facts.sentence_de.startswith("anna hat die Bedienung")


def test_work_that_failed_and_work_that_is_in_the_way_are_told_in_both_languages() -> None:
    go = threading.Event()
    sequencer = Sequencer(lambda name, error: None)

    def work() -> dict[str, object]:
        go.wait(HANGS_S)
        raise refused("stopped", "READY", "START")

    under_way = sequencer.do("start", work)
    with pytest.raises(DoorError) as busy:
        sequencer.do("home", dict)
    assert "start is under way" in busy.value.sentence and "start ist im Gang" in busy.value.sentence_de
    go.set()
    with pytest.raises(DoorError):
        under_way.result(HANGS_S)
    assert sequencer.now is not None
    shown = sequencer.now.to_dict()
    assert shown["state"] == "failed" and str(shown["sentence_de"]).startswith("Es wurde gestoppt")
    sequencer.wait()


@pytest.mark.parametrize("language", LANGUAGES)
def test_why_a_restart_is_not_offered_is_told_in_every_language(language: str) -> None:
    nothing = journal.Job("", "", "", "", "", (0.0,) * 5, 0.0)
    said = journal.refusal(None, nothing, 0, 0, 5, language)
    assert said == LANGUAGES[language].refusals["not_interrupted"]
