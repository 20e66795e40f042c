"""The catalogue of texts: every language says all of it, and says it whole."""

from __future__ import annotations

import string

import pytest

from controller import catalogue
from controller.catalogue import LANGUAGES
from controller.state import ALWAYS, FAULTS, Fault, Mode, Reaction, Recovery, Request, refusal, sentence

ENGLISH = LANGUAGES["en"]
FOREIGN = [name for name in LANGUAGES if name != "en"]
NO_SENTENCE = {Reaction.NONE}

# What a remedy must name, by the recovery that its row asks for.
STEPS = {
    "en": {Recovery.HOME: "hom", Recovery.COMMISSION: "commission"},
    "de": {Recovery.HOME: "referenzier", Recovery.COMMISSION: "in Betrieb"},
}


def placeholders(text: str) -> list[str]:
    """The names, each once: a language may have to say one of them twice."""
    return sorted({name for _, name, _, _ in string.Formatter().parse(text) if name})


def test_english_and_german_are_there() -> None:
    assert list(LANGUAGES) == ["en", "de"]


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_fault_has_its_words_in_every_language(language: str) -> None:
    assert list(LANGUAGES[language].faults) == list(ENGLISH.faults), "in the same order"
    assert set(LANGUAGES[language].faults) == set(Fault)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("fault", Fault)
def test_words_are_whole_sentences_without_placeholders(fault: Fault, language: str) -> None:
    for text in LANGUAGES[language].faults[fault]:
        assert text == text.strip() and text.endswith(".") and text[0].isupper()
        assert "  " not in text and placeholders(text) == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_class_and_every_recovery_is_named(language: str) -> None:
    said = LANGUAGES[language]
    assert set(said.classes) == set(Reaction) and set(said.recoveries) == set(Recovery)
    assert all(said.classes[reaction] for reaction in set(Reaction) - NO_SENTENCE)
    assert all(said.recoveries.values())


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_frame_has_the_same_placeholders_in_every_language(language: str) -> None:
    said = {name: placeholders(text) for name, text in LANGUAGES[language].frames.items()}
    assert said == {name: placeholders(text) for name, text in ENGLISH.frames.items()}


@pytest.mark.parametrize("language", FOREIGN)
def test_nothing_was_left_in_english(language: str) -> None:
    said = LANGUAGES[language]
    for fault in Fault:
        assert not set(said.faults[fault]) & set(ENGLISH.faults[fault]), fault.name
    assert set(said.classes.values()) & set(ENGLISH.classes.values()) == {""}
    assert not set(said.recoveries.values()) & set(ENGLISH.recoveries.values())


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("fault", [fault for fault in Fault if fault is not Fault.NONE])
def test_a_remedy_names_the_steps_that_its_row_asks_for(fault: Fault, language: str) -> None:
    row, remedy = FAULTS[fault], LANGUAGES[language].faults[fault].remedy
    steps = STEPS[language]
    if not row.position_trusted:
        assert steps[Recovery.HOME] in remedy, "what is not trusted must be homed"
    if row.recovery is Recovery.COMMISSION:
        assert steps[Recovery.COMMISSION] in remedy


def test_a_fault_row_speaks_english() -> None:
    for fault in Fault:
        assert FAULTS[fault].words is ENGLISH.faults[fault]


def test_a_sentence_is_told_in_the_language_that_is_asked_for() -> None:
    said = sentence(Fault.FOLLOWING_ERROR, "C", Fault.NODE_RESET, language="de")
    assert said.startswith("Achse C: Die Achse ist nicht, wo sie sein soll")
    assert " Außerdem: Ein Antrieb startete neu" in said
    assert "Außerdem" not in sentence(Fault.EMCY, "C", Fault.EMCY, language="de")


def test_a_language_without_texts_is_refused_with_what_there_is() -> None:
    with pytest.raises(ValueError, match=r"language 'fr': there are no texts in it; allowed are en and de"):
        catalogue.of("fr")


@pytest.mark.parametrize("language", FOREIGN)
def test_every_refusal_has_its_words_with_the_same_placeholders_in_every_language(language: str) -> None:
    said = LANGUAGES[language].refusals
    assert list(said) == list(ENGLISH.refusals), "in the same order"
    for key, text in said.items():
        assert placeholders(text) == placeholders(ENGLISH.refusals[key]), key
        assert text == text.strip() or key in ("or", "and"), key


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("mode", Mode)
def test_a_refused_request_names_itself_and_the_mode_in_every_language(mode: Mode, language: str) -> None:
    for request in set(Request) - ALWAYS:
        said = refusal(mode, request, language=language, standing=False, homed=0, away=True, axes="XYZAC")
        assert not said or (request.name in said and mode.name in said and said.endswith(".")), said
        assert bool(said) == bool(refusal(mode, request, standing=False, homed=0, away=True, axes="XYZAC"))


def test_a_value_of_a_refusal_may_be_a_text_of_the_catalogue_itself() -> None:
    waited = {"seconds": 3.0, "what": catalogue.Key("standstill")}
    assert catalogue.refusal("waited", **waited) == "Waited 3 s for standstill in vain."
    assert "Stillstand" in catalogue.refusal("waited", "de", **waited)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("why", ["", None, "  "])
def test_no_refusal_ends_where_its_reason_should_be(language: str, why: str | None) -> None:
    """An OSError may have no words; a job that is only being read has no reason."""
    said = LANGUAGES[language].refusals
    with_reason = [key for key, text in said.items() if "why" in placeholders(text)]
    assert len(with_reason) > 5
    for key in with_reason:
        values = {**dict.fromkeys(placeholders(said[key]), 1.0), "why": why}
        told = catalogue.refusal(key, language, **values)
        assert said["no_why"] in told and "None" not in told and not told.endswith(" "), key


@pytest.mark.parametrize("language", LANGUAGES)
def test_only_parts_of_sentences_and_reasons_end_without_a_full_stop(language: str) -> None:
    whole = {"refused", "not_ready", "form.would_do"}  # they end with a sentence of somebody else's
    for key, text in LANGUAGES[language].refusals.items():
        assert text.strip(), key
        if text.endswith("}"):
            assert key in whole or "." in key or not text[0].isupper(), key
