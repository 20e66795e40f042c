"""The journal: one file, whole or not at all, and when a restart may be offered."""

from __future__ import annotations

import json
import random
from dataclasses import replace
from pathlib import Path

import pytest
from cutting import shipped

from controller import journal
from controller.journal import Entry, Job
from controller.plan.route.spot import Spot

HOME = (0.0, 0.0, 260.0, 0.0, 0.0)
ALL = 0b11111


def job() -> Job:
    return Job.of("part.ngc", b"G0 X1\n", shipped(), HOME)


def entry() -> Entry:
    return Entry(job(), Spot(19, 0.25, 5, 12.125), True, 2, "HOLD", "NONE", ALL, 1.5e9)


def test_what_is_written_is_read_back_bit_for_bit(tmp_path: Path) -> None:
    kept = replace(entry(), spot=Spot(3, 1.0 / 3.0, 7, 0.1 + 0.2))
    journal.write(kept, tmp_path / "state" / "journal.json")
    assert journal.read(tmp_path / "state" / "journal.json") == (kept, "")


def test_a_journal_that_cannot_be_replaced_leaves_the_old_one_and_nothing_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "journal.json"
    journal.write(entry(), file)

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(journal.os, "fsync", full)
    with pytest.raises(OSError):
        journal.write(replace(entry(), tool=3), file)
    assert [p.name for p in tmp_path.iterdir()] == ["journal.json"]
    assert journal.read(file)[0] == entry()


def test_without_a_journal_there_is_nothing_to_offer_and_no_complaint(tmp_path: Path) -> None:
    assert journal.read(tmp_path / "journal.json") == (None, "")
    assert "no interrupted program" in journal.refusal(None, job(), ALL, 0, 5)


@pytest.mark.parametrize("seed", range(20))
def test_a_damaged_journal_is_told_in_a_sentence(seed: int, tmp_path: Path) -> None:
    rng, file = random.Random(seed), tmp_path / "journal.json"
    journal.write(entry(), file)
    text = file.read_text()
    cut = rng.randrange(len(text))
    file.write_text(rng.choice([text[:cut], text[:cut] + "\0" + text[cut:], "[]", '{"format": 1}', "null"]))
    found, why = journal.read(file)
    assert found is None and str(file) in why


def test_a_journal_of_another_format_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "journal.json"
    journal.write(entry(), file)
    values = json.loads(file.read_text())
    file.write_text(json.dumps(values | {"format": 99}))
    assert journal.read(file)[0] is None


@pytest.mark.parametrize(
    ("changes", "homed", "untrusted", "words"),
    [
        ({}, ALL, 0, ""),
        ({"tools_sha256": "another"}, ALL, 0, ""),
        ({"program_sha256": "another"}, ALL, 0, "the program changed"),
        ({"machine_sha256": "another"}, ALL, 0, "the machine file changed"),
        ({"offsets_sha256": "another"}, ALL, 0, "a work offset changed"),
        ({}, 0b10111, 0, "home all of them"),
        ({}, ALL, 0b00100, "home all of them"),
    ],
)
def test_a_restart_is_offered_only_where_the_machine_and_the_program_are_the_same(
    changes: dict[str, str], homed: int, untrusted: int, words: str
) -> None:
    why = journal.refusal(entry(), replace(job(), **changes), homed, untrusted, 5)  # type: ignore[arg-type]
    assert (words in why) if words else why == ""


def test_with_another_tool_the_place_is_the_fraction_of_the_block() -> None:
    assert journal.spot_of(entry(), job()) == entry().spot
    assert journal.spot_of(entry(), replace(job(), tools_sha256="another")) == Spot(19, 0.25)


def test_offsets_and_tools_count_by_their_values_and_the_machine_by_its_file() -> None:
    machine = shipped()
    moved = replace(machine, offsets=(machine.offsets[0]._replace(origin=(1.0, 2.0, 3.0)),))
    other = Job.of("part.ngc", b"G0 X1\n", moved, HOME)
    assert other.machine_sha256 == job().machine_sha256 and other.offsets_sha256 != job().offsets_sha256
