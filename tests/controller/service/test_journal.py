"""The journal: kept whole or not at all, and when a restart may be offered."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import blank
from controller.machine.offset_table import OFFSETS
from controller.messages import text
from controller.plan.restart.program_position import FORMER, Spot
from controller.service import journal
from controller.service.journal import Entry, Job, RunProgress
from controller.state.modes import Fault, Mode
from controller.store import service_store
from controller.store.service_store import ServiceStore

HOME = (0.0, 0.0, 260.0, 0.0, 0.0)
ALL = 0b11111


def job() -> Job:
    return Job.of("part.ngc", b"G0 X1\n", shipped(), HOME)


def entry() -> Entry:
    return Entry(job(), Spot(19, 0.25, 5, 12.125), True, 2, "HOLD", "NONE", ALL, 1.5e9)


def test_what_is_written_is_read_back_bit_for_bit(tmp_path: Path) -> None:
    kept = replace(entry(), spot=Spot(3, 1.0 / 3.0, 7, 0.1 + 0.2))
    store = ServiceStore(tmp_path)
    journal.write(kept, store)
    assert journal.read(store) == kept


def test_places_for_offsets_that_came_later_change_no_sum_until_one_is_set() -> None:
    """A run that an older version wrote down is gone on with: it had no G54.2 P1 to P8."""
    machine, n = shipped(), len(OFFSETS)
    older = replace(machine, offsets=machine.offsets[:n], turned_rad=machine.turned_rad[:n])
    older = replace(older, unset=tuple(name for name in machine.unset if name in OFFSETS))
    assert journal.fitted_sha256(machine) == journal.fitted_sha256(older)
    turned = replace(machine, unset=machine.unset[:-1])
    assert journal.fitted_sha256(turned) != journal.fitted_sha256(older)


def test_a_journal_that_cannot_be_replaced_stays_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = ServiceStore(tmp_path)
    journal.write(entry(), store)

    def full(*_: object) -> None:
        raise sqlite3.OperationalError("disk I/O error")

    with monkeypatch.context() as patched:
        patched.setattr(service_store, "put_document", full)
        kept = journal.Journal(store, last=replace(entry(), tool=3))
        kept.keep()
        assert str(store.file) in kept.problem
    assert journal.read(store) == entry()
    kept.keep()
    assert kept.problem == "" and journal.read(store) == kept.last


def test_without_a_journal_there_is_nothing_to_offer_and_no_complaint(tmp_path: Path) -> None:
    store = ServiceStore(tmp_path)
    assert journal.read(store) is None and store.losses == []
    assert "no interrupted program" in text(journal.refusal(None, job(), ALL, 0, 5))


@pytest.mark.parametrize("values", [[], {"format": 1}, {"format": 99}, None, "7"])
def test_a_journal_that_is_none_is_told_in_a_sentence(values: object, tmp_path: Path) -> None:
    store = ServiceStore(tmp_path)
    store.put(journal.DOCUMENT, values)
    assert journal.read(store) is None and "journal" in text(store.losses[0])


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
    why = text(journal.refusal(entry(), replace(job(), **changes), homed, untrusted, 5))  # type: ignore[arg-type]
    assert (words in why) if words else why == ""


def test_with_another_tool_the_place_is_the_fraction_of_the_block() -> None:
    assert journal.spot_of(entry(), job()) == entry().spot
    assert journal.spot_of(entry(), replace(job(), tools_sha256="another")) == Spot(19, 0.25, FORMER)


def test_offsets_and_tools_count_by_their_values_and_the_machine_by_its_file() -> None:
    machine = shipped()
    moved = replace(machine, offsets=(machine.offsets[0]._replace(origin=(1.0, 2.0, 3.0)),))
    other = Job.of("part.ngc", b"G0 X1\n", moved, HOME)
    assert other.machine_sha256 == job().machine_sha256 and other.offsets_sha256 != job().offsets_sha256


# --- what is written, and when


class Looked:
    """A journal with a clock and a snapshot that a test moves."""

    def __init__(self, folder: Path) -> None:
        self.store, self.now_s = ServiceStore(folder), 0.0
        self.journal = journal.Journal(self.store, lambda: self.now_s)
        self.journal.begin(job())
        self.snapshot = blank()._replace(at_rest=False, homed=ALL, motion_id=5, line=19)

    def look(self, fraction: float = 0.0, **changes: object) -> Entry | None:
        self.snapshot = self.snapshot._replace(**changes)  # type: ignore[arg-type]
        self.journal.look(self.snapshot, lambda _: np.zeros((0, 1)), lambda *_: RunProgress(fraction))
        return journal.read(self.store)

    def run(self, length: float) -> None:
        for s in np.arange(self.snapshot.s, self.snapshot.s + length, 0.1):
            self.now_s += 0.02
            self.look(mode=Mode.RUNNING, s=float(s))


def test_of_a_stop_beside_the_path_a_place_before_it_is_kept_and_of_one_on_it_the_very_place(
    tmp_path: Path,
) -> None:
    looked = Looked(tmp_path)
    looked.run(4.0)
    entry = looked.look(mode=Mode.HOLD, at_rest=True)
    assert entry is not None and entry.exact and entry.spot.s == looked.snapshot.s
    looked.run(4.0)
    entry = looked.look(mode=Mode.FAULT, fault=Fault.EMERGENCY_STOP, at_rest=True)
    assert entry is not None and not entry.exact
    assert looked.snapshot.s - 0.6 < entry.spot.s < looked.snapshot.s - 0.1


def test_with_other_tools_fitted_in_a_hold_line_and_fraction_count(tmp_path: Path) -> None:
    looked = Looked(tmp_path)
    looked.run(2.0)
    looked.look(0.25, mode=Mode.HOLD, at_rest=True)
    looked.journal.go_on_as(replace(job(), tools_sha256="another"))
    looked.journal.lost(looked.snapshot)
    looked.look(mode=Mode.RUNNING, at_rest=False, motion_id=-1)
    entry = looked.look(mode=Mode.HOLD, at_rest=True)
    assert entry is not None and entry.job.tools_sha256 == "another" and entry.spot == Spot(19, 0.25, FORMER)


def test_a_program_that_came_to_its_end_is_not_offered_again(tmp_path: Path) -> None:
    looked = Looked(tmp_path)
    looked.run(2.0)
    standing = looked.look(mode=Mode.READY, at_rest=True)
    assert standing is not None and not standing.ended
    looked.journal.completed(looked.snapshot)
    entry = journal.read(looked.store)
    assert entry is not None and entry.ended
    assert "no interrupted program" in text(journal.refusal(entry, job(), ALL, 0, 5))
    looked.look()
    assert journal.read(looked.store) == entry, "looks after that leave it so"
