"""When a guest's test may begin anew: only by the computer's own figures."""

from __future__ import annotations

import itertools
from pathlib import Path
from types import SimpleNamespace

import pytest
from guest import absence, host_figures
from guest.absence import Figures


def process(proc: Path, pid: int, session: int, waited_ns: int, name: str = "linux.uml") -> Path:
    """A process as proc(5) shows it."""
    folder = proc / str(pid)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "stat").write_text(f"{pid} ({name}) S 1 {pid} {session} 0 -1 4194560 2048\n")
    (folder / "schedstat").write_text(f"123456789 {waited_ns} 42\n")
    return folder


@pytest.mark.parametrize(
    ("seen", "away"),
    [
        (Figures(), False),
        (Figures(late_s=0.009, late_ticks=0, stolen=0.02, waited=0.05), False),
        (Figures(late_s=0.03, late_ticks=1), True),
        (Figures(stolen=0.2), True),
        (Figures(waited=0.9), True),
        (Figures(answered_s=0.005), False),
        (Figures(answered_s=0.012), True),
    ],
)
def test_each_figure_alone_says_that_the_computer_was_away(seen: Figures, away: bool) -> None:
    assert seen.away() is away
    assert ("was away" in str(seen)) is away


def test_the_figures_are_in_the_words() -> None:
    words = str(Figures(late_s=0.104, late_ticks=4, stolen=0.07, waited=0.25, answered_s=0.0034))
    for figure in ("4 ticks of 10 ms", "104 ms", "250 ms", "7 %", "3.4 ms"):
        assert figure in words


def test_of_several_seconds_the_worst_counts_and_late_ticks_add_up() -> None:
    seconds = absence.read(
        "1.0 0.0100 0 0.0100 0.2000 0.0040\n2.0 0.0300 2 0.0300 0.1000 0.0060\n3.0 0.0250 1 0.0200 0.0 0.0\n"
    )
    assert absence.worst(seconds) == Figures(3.0, 0.03, 3, 0.03, 0.2, 0.006)


def test_a_late_answer_counts_from_its_sync_and_drives_that_were_off_have_none() -> None:
    answers, sync, drive = absence.Answers(), 0x080, 0x185
    assert answers.longest_s([(0.0, sync), (0.01, sync)]) == 0.0
    assert answers.longest_s([(0.013, drive), (0.02, sync), (0.022, drive)]) == pytest.approx(0.013)
    assert answers.longest_s([(0.03, sync), (5.0, drive), (5.01, sync), (5.012, drive)]) == pytest.approx(
        0.002
    )


def test_a_line_that_is_being_written_is_left_for_later() -> None:
    assert absence.read("") == []
    assert absence.read("1.0 0.0100 0 0.0100 0.2000\n2.0 0.03") == [Figures(1.0, 0.01, 0, 0.01, 0.2)]


def test_only_seconds_since_then_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stall in an earlier part of a long test is no excuse for what comes later."""
    monkeypatch.setattr(absence, "RECORD", tmp_path / "record")
    absence.RECORD.write_text("100.0 0.5000 9 0.5000 1.0000\n101.0 0.0010 0 0.0100 0.0000\n")
    assert absence.since(99.0).away()
    assert not absence.since(100.0).away()


def test_the_second_in_which_it_is_asked_is_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stall that made a fault may still be unwritten when the fault is seen."""
    now_s = itertools.count(1000.0, 0.25)
    monkeypatch.setattr(absence, "RECORD", tmp_path / "record")

    def sleep(_: float) -> None:
        with absence.RECORD.open("a") as record:
            record.write("1000.6 0.2000 3 0.0000 0.0000\n")

    clock = SimpleNamespace(monotonic=lambda: next(now_s), sleep=sleep)
    monkeypatch.setattr(absence, "time", clock)  # of this module alone: other threads have theirs
    absence.RECORD.write_text("999.6 0.0010 0 0.0000 0.0000\n")
    assert absence.figures().late_ticks == 3
    clock.sleep = lambda _: None
    absence.RECORD.write_text("999.6 0.0010 0 0.0000 0.0000\n")
    with pytest.raises(AssertionError, match="nobody watches"):
        absence.figures()


def test_a_late_awakening_is_told_once_and_does_not_make_the_next_ones_late(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock_s, stall_s = [50.0], iter([0.0, 0.0, 0.3])

    def sleep(asked_s: float) -> None:
        clock_s[0] += asked_s + next(stall_s, 0.0)

    monkeypatch.setattr(absence, "time", SimpleNamespace(monotonic=lambda: clock_s[0], sleep=sleep))
    assert list(itertools.islice(absence.lates(), 5)) == pytest.approx([0.0, 0.0, 0.3, 0.0, 0.0], abs=1e-9)


def test_the_guests_waiting_is_counted_and_nobody_elses(tmp_path: Path) -> None:
    waiting = host_figures.Waiting(tmp_path)
    process(tmp_path, 10, 10, 1_000_000_000)
    process(tmp_path, 11, 10, 500_000_000, "a (b) c")
    process(tmp_path, 12, 7, 9_000_000_000)
    assert waiting.look("10") == pytest.approx(1.5)
    process(tmp_path, 10, 10, 1_250_000_000)
    (tmp_path / "11" / "schedstat").unlink()  # has ended, and what it had waited stays
    process(tmp_path, 13, 10, 250_000_000)
    assert waiting.look("10") == pytest.approx(2.0)


def test_what_the_host_tells_is_read_back() -> None:
    assert host_figures.read("cpu  1 2 3 4 5 6 7 8 0 0\nwaited 12.345 1000.500\n") == (12.345, 1000.5)
    assert host_figures.read("cpu  1 2 3 4 5 6 7 8 0 0\n") == (0.0, 0.0)
