"""The catalogue of texts: every language says all of it, and says it whole."""

from __future__ import annotations

import importlib
import json
import pkgutil
import string

import pytest

from controller import messages
from controller.messages import LANGUAGES, Key, chain, said, several, text, told
from controller.state.modes import ALWAYS, FAULTS, Fault, Mode, Reaction, Recovery, Request, refusal, sentence

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
    for words in LANGUAGES[language].faults[fault]:
        assert words == words.strip() and words.endswith(".") and words[0].isupper()
        assert "  " not in words and placeholders(words) == []


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
        messages.of("fr")


@pytest.mark.parametrize("language", FOREIGN)
def test_every_refusal_has_its_words_with_the_same_placeholders_in_every_language(language: str) -> None:
    said = LANGUAGES[language].refusals
    assert list(said) == list(ENGLISH.refusals), "in the same order"
    for key, words in said.items():
        assert placeholders(words) == placeholders(ENGLISH.refusals[key]), key
        assert words == words.rstrip() and words[0].isspace() == ENGLISH.refusals[key][0].isspace(), key


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("mode", Mode)
def test_a_refused_request_names_itself_and_the_mode_in_every_language(mode: Mode, language: str) -> None:
    for request in set(Request) - ALWAYS:
        said = text(refusal(mode, request, standing=False, homed=0, away=True, axes="XYZAC"), language)
        assert not said or (request.name in said and mode.name in said and said.endswith(".")), said


def test_a_value_may_be_a_text_of_the_catalogue_itself_with_the_values_beside_it() -> None:
    waited = said("waited", seconds=3.0, what=Key("standstill"))
    assert text(waited) == "Waited 3 s for standstill in vain."
    assert "Stillstand" in text(waited, "de")
    assert "within 3 s" in text(said("silent_door", path="x", why=Key("no_answer_within"), seconds=3.0))


def test_no_two_modules_of_a_language_have_a_text_under_the_same_key() -> None:
    """One would hide the other."""
    found: list[tuple[str, str]] = []
    for one in pkgutil.iter_modules(messages.__path__):
        module = vars(importlib.import_module(f"controller.messages.{one.name}"))
        found += [(module["LANGUAGE"], key) for name in ("REFUSALS", "PAGE") for key in module.get(name, ())]
    assert len(found) > 1000 and [key for key in set(found) if found.count(key) > 1] == []


def test_texts_travel_as_json_and_several_are_read_one_after_the_other() -> None:
    both = several("part.ngc:3: G99 is no code.", said("stands_before"), "")
    assert text(json.loads(json.dumps(both))) == (
        "part.ngc:3: G99 is no code. The tool stands on the path before that block."
    )
    linked = said(
        "changed", program="a", line=1, what=chain("and", [Key("the_program"), Key("a_work_offset")])
    )
    assert "the program and a work offset changed" in text(linked)


def test_what_was_kept_before_keys_were_is_its_sentence_and_the_edge_adds_it_to_what_has_a_key() -> None:
    old, new = {"name": "A", "sentence": "X lags."}, {"name": "B", **said("no_tick")}
    in_german = told({"alarms": [old, new], "job": {"key": None, "values": None}}, "de")
    assert in_german["alarms"][0] == old and text(old, "de") == "X lags."
    assert in_german["alarms"][1]["sentence"] == LANGUAGES["de"].texts["no_tick"]
    assert in_german["job"]["sentence"] is None


@pytest.mark.parametrize("values", [{}, {"line": None}, {"line": 1.0, "off_mm": None, "off_deg": "x"}])
def test_a_text_of_another_version_is_shown_as_it_is(values: dict[str, object]) -> None:
    """A service may be newer than the panel that shows what it says: that must not fail."""
    assert text({"key": "of_tomorrow", "values": values}).startswith("of_tomorrow")
    assert text({"key": "beside", "values": values}).startswith("beside")


@pytest.mark.parametrize(
    ("wanted", "language"),
    [
        (("",), "en"),
        (("de",), "de"),
        (("fr, de-CH;q=0.9, en;q=0.8",), "de"),
        (("de;q=0.3, en; q=0.8",), "en"),
        (("de;q=0, *",), "en"),
        (('"><script>', "de"), "de"),
        (("en", "de"), "en"),
    ],
)
def test_the_first_language_is_chosen_that_there_is(wanted: tuple[str, ...], language: str) -> None:
    assert messages.chosen(*wanted) == language


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("why", ["", None, "  "])
def test_no_refusal_ends_where_its_reason_should_be(language: str, why: str | None) -> None:
    """An OSError may have no words; a job that is only being read has no reason."""
    texts = LANGUAGES[language].refusals
    with_reason = [key for key, words in texts.items() if "why" in placeholders(words)]
    assert len(with_reason) > 5
    for key in with_reason:
        values = {**dict.fromkeys(placeholders(texts[key]), 1.0), "why": why}
        words = text(said(key, **values), language)
        assert texts["no_why"] in words and "None" not in words and not words.endswith(" "), key


@pytest.mark.parametrize("language", LANGUAGES)
def test_only_parts_of_sentences_and_reasons_end_without_a_full_stop(language: str) -> None:
    # They end with a sentence, or words, of somebody else's.
    whole = {"refused", "not_ready", "form.would_do", "of_axis", "also", "own_error"}
    for key, words in LANGUAGES[language].refusals.items():
        assert words.strip(), key
        if words.endswith("}"):
            assert key in whole or "." in key or not words[0].isupper(), key
