"""What a data sheet shows to be impossible is a sentence with object, found and wanted."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from drives.commissioning import possible, sheet
from drives.profile import GENERIC
from drives.settings import IoSettings, MasterSettings, NodeSettings
from drives.texts import english

EDS = Path(__file__).parents[2] / "config" / "eds" / "simulated_drive.eds"
MASTER = MasterSettings()


def changed(section: str, key: str, value: str) -> sheet.Sheet:
    """The simulated drive's data sheet with one line of one section replaced or added; "" takes it away."""
    lines: list[str] = []
    here = ""
    for line in EDS.read_text(encoding="latin-1").splitlines():
        if line.startswith("["):
            here = line.strip("[]")
        if here.lower() == section.lower():
            if not key or line.startswith(f"{key}="):
                continue
            if line.startswith("["):
                line = f"{line}\n{key}={value}" if value else line
        lines.append(line)
    return sheet.read("\n".join(lines), "mine.eds", 1)


def problems(found: sheet.Sheet, **changes: object) -> list[str]:
    node = NodeSettings("X", "can", 1, "mine.eds", **changes)  # type: ignore[arg-type]
    return [english(problem) for problem in possible.problems(node, MASTER, found)]


def test_the_simulated_drive_can_all_of_it() -> None:
    assert problems(sheet.load(str(EDS), 1)) == []
    assert problems(sheet.load(str(EDS), 1), feed_forward=True, feedback_every=4, probe_tpdo=3) == []


@pytest.mark.parametrize(
    ("section", "key", "value", "sentence"),
    [
        ("607A", "", "", r"object 607Ah:00 is not in mine\.eds, but setpoints come by RPDO 1"),
        ("6041", "", "", r"object 6041h:00 is not in mine\.eds"),
        (
            "607A",
            "PDOMapping",
            "0",
            r"607Ah:00: .* not let it be mapped into RPDO 1 \(access rww, mappable no\)",
        ),
        ("607A", "AccessType", "ro", r"607Ah:00: .* mapped into RPDO 1 \(access ro, mappable yes\)"),
        ("6064", "AccessType", "wo", r"6064h:00: .* mapped into TPDO 1 \(access wo"),
        ("607A", "DataType", "0x0003", r"607Ah:00: mine\.eds gives it data type 0x0003, needed are 32 bits"),
        ("1016sub1", "", "", "1016h:01 is not in .* must notice a dead controller.* unsupervised = true"),
        ("6007", "", "", "6007h:00 is not in .* and stop"),
        ("605A", "AccessType", "ro", ""),
        ("605A", "HighLimit", "1", "605Ah:00: 2 is needed .* allows -?[0-9]+ to 1;"),
        ("60C2sub1", "HighLimit", "1", "60C2h:01: 2 is needed .* allows 1 to 1; change period_s"),
        ("60C2sub2", "AccessType", "const", ""),
        ("6065", "", "", "6065h:00 is not in"),
        ("6098", "LowLimit", "40", "6098h:00: 37 is needed .* choose another homing method"),
        ("1600", "", "", "RPDO 1: objects 1400h and 1600h are not both in mine.eds"),
        ("1A00sub2", "", "", ""),
        ("1000", "DefaultValue", "0x191", "1000h: mine.eds is of device profile 401, needed is 402"),
        ("6502", "DefaultValue", "0x1", "6502h: mine.eds says 0x1, .* without mode of operation 8"),
    ],
)
def test_a_mismatch_names_object_found_and_wanted(section: str, key: str, value: str, sentence: str) -> None:
    found = problems(changed(section, key, value))
    if sentence:
        assert any(re.search(sentence, each) for each in found), found
    else:
        assert found == [], "what is right by default need not be writable"


def test_every_mismatch_is_told_not_only_the_first() -> None:
    text = EDS.read_text(encoding="latin-1")
    for index in ("6007", "605A", "6065"):
        text = re.sub(rf"\[{index}\]\n(?:[^\[\n].*\n|\n)*", "", text)
    found = possible.problems(
        NodeSettings("X", "can", 1, "", period_s=0.00123), MASTER, sheet.read(text, "mine.eds")
    )
    for word in ("1.23 ms", "6007h", "605Ah", "6065h"):
        assert any(word in english(problem) for problem in found), word


def test_a_missing_object_that_the_profile_calls_optional_is_a_remark() -> None:
    profile = replace(GENERIC, optional=(0x6065,))
    found, remarks, _ = possible.of_profile(profile, changed("6065", "", ""), MASTER)
    assert found == []
    assert "object 6065h is not in the data sheet; the profile does without it." in map(english, remarks)


@pytest.mark.parametrize(
    ("word", "said"),
    [("0xFD010000", "counts_per_mm has 1 there"), ("0xFF410000", "counts_per_deg has 10 there")],
)
def test_a_position_in_si_units_says_what_counts_a_machine_file_is_to_have(word: str, said: str) -> None:
    """Which check of a machine and commissioning refuse otherwise; a sheet alone has no counts."""
    verdict = possible.of_profile(GENERIC, changed("60A8", "DefaultValue", word), MASTER)
    assert [said in english(one) for one in verdict.undecided] == [True] and not verdict.problems


def test_a_search_for_a_switch_at_a_speed_that_nobody_says_is_warned_of() -> None:
    """A drive that has 0 there stands still until homing is given up."""
    about = changed("6099sub1", "DefaultValue", "0")
    node = NodeSettings("X", "can", 1, "mine.eds", homing_method=24)
    for one, warned in (
        (node, True),
        (replace(node, homing_method=37), False),
        (replace(node, absolute=True), False),
        (replace(node, homing_fast_counts_s=500), False),
    ):
        told = [english(each) for each in possible.warnings(one, MASTER, about)]
        assert any("6099h:01" in each and "homing never ends" in each for each in told) is warned, told


# What reads like a refusal: something that somebody is to do, or to give up.
REFUSES = re.compile(r"is needed|override|choose|change |must ")


@pytest.mark.parametrize(
    ("section", "key", "value", "says"),
    [
        ("60B1", "PDOMapping", "0", r"object 60B1h:00: mine\.eds does not let it be mapped into RPDO 1"),
        ("60B1", "", "", r"object 60B1h:00 is not in mine\.eds"),
        ("1401", "", "", r"RPDO 2: objects 1401h and 1601h are not both in mine\.eds"),
    ],
)
def test_a_velocity_that_cannot_go_beside_the_target_is_a_remark_and_reads_like_one(
    section: str, key: str, value: str, says: str
) -> None:
    found, remarks, _ = possible.of_profile(GENERIC, changed(section, key, value), MASTER)
    assert found == []
    told = [one for one in map(english, remarks) if "feed_forward" in one]
    begins = "feed_forward = true is not for this drive, and is not needed: "
    assert all(one.startswith(begins) for one in told)
    assert any(re.match(says, one.removeprefix(begins)) for one in told), told
    assert not any(REFUSES.search(one) for one in map(english, remarks)), remarks
    (asked,) = (
        one for one in problems(changed(section, key, value), feed_forward=True) if re.search(says, one)
    )
    assert REFUSES.search(asked), "who asks for it is refused, and told what to do"


def test_other_choices_that_a_sheet_has_no_room_for_are_remarks_too() -> None:
    found, remarks, _ = possible.of_profile(GENERIC, changed("60E3sub1", "DefaultValue", "36"), MASTER)
    assert found == []
    assert not any(REFUSES.search(one) for one in map(english, remarks)), remarks
    told = [one for one in map(english, remarks) if one.startswith("method = ")]
    assert all(" is not for this drive, and is not needed: object 60E3h" in one for one in told)


def test_a_homing_method_that_the_sheet_does_not_list_is_told() -> None:
    found = sheet.load(str(EDS), 1)
    assert problems(found, homing_method=24) == []
    _, sentence = problems(found, homing_method=36)
    assert re.search(r"60E3h: simulated_drive\.eds lists the homing methods .*, wanted is 36;", sentence)


def test_unsupervised_is_the_operators_word_for_a_drive_without_heartbeat_consumer() -> None:
    found = changed("1016sub1", "", "")
    assert problems(found)
    assert problems(found, unsupervised=True) == []


def test_a_bit_rate_the_drive_does_not_have_is_told() -> None:
    found = sheet.read(EDS.read_text(encoding="latin-1"), "mine.eds")
    rates = found.dictionary.device_information.allowed_baudrates
    rates.clear()
    rates.add(500_000)
    node = NodeSettings("X", "can", 1, "")
    problem = possible.problems(node, MASTER, found, 1_000_000)[0]
    assert "1000 kbit/s is none of its bit rates; allowed are 500" in english(problem)


def test_a_drives_sheet_for_an_io_node_is_told() -> None:
    found = possible.problems(IoSettings("io", "can", 20, ""), MASTER, sheet.load(str(EDS), 1))
    assert any("device profile 402, needed is 401" in english(problem) for problem in found)
