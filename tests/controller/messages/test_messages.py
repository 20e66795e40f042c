"""The catalogue of texts: every language says all of it, and says it whole."""

from __future__ import annotations

import json
import string
from pathlib import Path

import pytest
from support.suite.cases import each

from controller import messages
from controller.messages import LANGUAGES, Key, chain, message, several, text, with_sentences
from controller.program.program import Caller, ProgramError, refused_on_the_way
from controller.state.fault_table import words as words_of
from controller.state.modes import ALWAYS, FAULTS, Fault, Mode, Reaction, Recovery, Request, refusal, sentence
from drives import emergency_codes

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


def own(language: str) -> dict[str, str]:
    """What a language's own file says, without the English that fills its gaps."""
    found: dict[str, str] = json.loads((messages.FOLDER / f"{language}.json").read_text(encoding="utf-8"))
    return found


def test_english_and_german_are_there() -> None:
    assert list(LANGUAGES) == ["en", "de"]


@pytest.mark.parametrize("language", FOREIGN)
def test_every_text_is_in_every_language_with_the_same_placeholders(language: str) -> None:
    texts, english = own(language), own("en")
    assert texts.keys() == english.keys()
    for key, words in texts.items():
        assert placeholders(words) == placeholders(english[key]), key
        assert words == words.rstrip() and words[:1].isspace() == english[key][:1].isspace(), key


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_language_is_a_line_a_text_sorted_by_key_and_no_key_is_there_twice(language: str) -> None:
    """So that two who add texts seldom meet, and a tool that writes the file changes no other line."""
    written = (messages.FOLDER / f"{language}.json").read_text(encoding="utf-8")
    assert written == json.dumps(own(language), ensure_ascii=False, indent=2, sort_keys=True) + "\n"


def test_a_language_is_one_file_and_what_it_lacks_is_english(tmp_path: Path) -> None:
    (tmp_path / "en.json").write_text((messages.FOLDER / "en.json").read_text())
    (tmp_path / "fr.json").write_text('{"language": "Français", "page.frame.yes": "Oui"}')
    found = messages.languages(tmp_path)
    assert list(found) == ["en", "fr"] and found["en"] == ENGLISH
    assert found["fr"].name == "Français" and found["fr"].page["frame.yes"] == "Oui"
    assert found["fr"].texts["no_tick"] == ENGLISH.texts["no_tick"]
    (tmp_path / "fr.json").write_text('{"language": }')
    with pytest.raises(ValueError, match=r"fr\.json: .*line 1 column 14"):
        messages.languages(tmp_path)


@each("language", LANGUAGES)
@each("fault", Fault)
def test_words_are_whole_sentences_without_placeholders(fault: Fault, language: str) -> None:
    for words in words_of(fault, language):
        assert words == words.strip() and words.endswith(".") and words[0].isupper()
        assert "  " not in words and placeholders(words) == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_class_and_every_recovery_is_named(language: str) -> None:
    texts = LANGUAGES[language].texts
    assert all(texts[f"class.{reaction.name}"] for reaction in set(Reaction) - NO_SENTENCE)
    assert all(texts[f"recovery.{recovery.name}"] for recovery in Recovery)


@pytest.mark.parametrize("language", FOREIGN)
def test_nothing_was_left_in_english(language: str) -> None:
    parts = ("fault.", "cause.", "remedy.", "class.", "recovery.")
    for key, words in own(language).items():
        alike = key.startswith(parts) and words == ENGLISH.texts[key]
        assert not alike or key in ("class.NONE", "remedy.folder"), key


@each("language", LANGUAGES)
@each("fault", [fault for fault in Fault if fault is not Fault.NONE])
def test_a_remedy_names_the_steps_that_its_row_asks_for(fault: Fault, language: str) -> None:
    row, remedy = FAULTS[fault], words_of(fault, language).remedy
    steps = STEPS[language]
    if not row.position_trusted:
        assert steps[Recovery.HOME] in remedy, "what is not trusted must be homed"
    if row.recovery is Recovery.COMMISSION:
        assert steps[Recovery.COMMISSION] in remedy


def test_a_fault_row_speaks_english() -> None:
    for fault in Fault:
        assert FAULTS[fault].words == words_of(fault, "en")


def test_a_sentence_is_told_in_the_language_that_is_asked_for() -> None:
    said = sentence(Fault.FOLLOWING_ERROR, "C", Fault.NODE_RESET, language="de")
    assert said.startswith("Achse C: Die Achse ist nicht, wo sie sein soll")
    assert " Außerdem: Ein Antrieb startete neu" in said
    assert "Außerdem" not in sentence(Fault.EMCY, "C", Fault.EMCY, language="de")


def test_a_language_without_texts_is_refused_with_what_there_is() -> None:
    with pytest.raises(ValueError, match=r"language 'fr': there are no texts in it; allowed are en and de"):
        messages.of("fr")


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("mode", Mode)
def test_a_refused_request_names_itself_and_the_mode_in_every_language(mode: Mode, language: str) -> None:
    for request in set(Request) - ALWAYS:
        said = text(refusal(mode, request, standing=False, homed=0, away=True, axes="XYZAC"), language)
        assert not said or (request.name in said and mode.name in said and said.endswith(".")), said


def test_a_value_may_be_a_text_of_the_catalogue_itself_with_the_values_beside_it() -> None:
    waited = message("waited", seconds=3.0, what=Key("standstill"))
    assert text(waited) == "Waited 3 s for standstill in vain."
    assert "Stillstand" in text(waited, "de")
    assert "within 3 s" in text(message("silent_door", path="x", why=Key("no_answer_within"), seconds=3.0))


@pytest.mark.parametrize(
    ("what", "english", "german"),
    [
        (message("jog_limit", axis="A", limit=110.0, unit="deg"), "limit of 110 deg;", "von 110 Grad;"),
        (message("jog_limit", axis="X", limit=300.0, unit="mm"), "limit of 300 mm;", "von 300 mm;"),
        (
            message("maintenance_due", name="C", every=5.0, unit="turns"),
            "every 5 turns",
            "alle 5 Umdrehungen",
        ),
        (message("travel.unwind", axis="C", at=3.0), "at 3.000 deg", "auf 3.000 Grad"),
    ],
)
def test_a_unit_is_in_the_words_of_the_language(what: dict[str, object], english: str, german: str) -> None:
    assert english in text(what) and german in text(what, "de")


def test_texts_travel_as_json_and_several_are_read_one_after_the_other() -> None:
    both = several("part.ngc:3: G99 is no code.", message("stands_before"), "")
    assert text(json.loads(json.dumps(both))) == (
        "part.ngc:3: G99 is no code. The tool stands on the path before that block."
    )
    linked = message(
        "changed", program="a", line=1, what=chain("and", [Key("the_program"), Key("a_work_offset")])
    )
    assert "the program and a work offset changed" in text(linked)


def test_what_was_kept_before_keys_were_is_its_sentence_and_the_edge_adds_it_to_what_has_a_key() -> None:
    old, new = {"name": "A", "sentence": "X lags."}, {"name": "B", **message("no_tick")}
    in_german = with_sentences({"alarms": [old, new], "job": {"key": None, "values": None}}, "de")
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
    texts = LANGUAGES[language].texts
    with_reason = [key for key, words in texts.items() if "why" in placeholders(words)]
    assert len(with_reason) > 5
    for key in with_reason:
        values = {**dict.fromkeys(placeholders(texts[key]), 1), "why": why}
        words = text(message(key, **values), language)
        assert texts["no_why"] in words and "None" not in words and not words.endswith(" "), key


@pytest.mark.parametrize("language", LANGUAGES)
def test_only_parts_of_sentences_and_reasons_end_without_a_full_stop(language: str) -> None:
    # They end with a sentence, or words, of somebody else's.
    whole = {"refused", "not_ready", "form.would_do", "of_axis", "also", "own_error"}
    for key, words in LANGUAGES[language].texts.items():
        assert words.strip() or key == "class.NONE", key
        if words.endswith("}"):
            assert key in whole or "." in key or not words[0].isupper(), key


def test_every_emergency_code_of_the_drives_part_has_its_words() -> None:
    assert {f"emcy.{code:04X}" for code in emergency_codes.CODES} | {"emcy.unlisted"} == {
        key for key in own("en") if key.startswith("emcy.")
    }


def test_what_was_refused_on_the_way_ends_with_where_the_tool_stands() -> None:
    for key, calls, stands in (
        ("probe.not_touched", (), "without. The tool stands at the end of that way."),
        ("probe.not_touched", (Caller("o1 call", 3, ""),), "The tool stands at the end of that way."),
        ("path.nothing", (), ". The tool stands on the path before that block."),
    ):
        error = ProgramError("p", 1, 1, message(key, code="G38.2", word="G38.2")).within(calls)
        assert text(refused_on_the_way(error.placed)).endswith(stands)
