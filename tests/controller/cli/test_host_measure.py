"""A measurement in turns, what cyclictest prints, and the page that is published of it."""

from __future__ import annotations

import getpass
import json
import os
import re
import signal
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from support.fakes import computers
from typer.testing import CliRunner

from controller import messages
from controller.__main__ import app
from controller.cli import host, host_findings, host_measure, host_report, self_test
from controller.cli.host_measure import Measured
from controller.cli.host_view import Host
from controller.runtime import wake_ups
from controller.runtime.wake_ups import BINS, Given, Histogram
from controller.verify.console import spoken

PRINTED = """# /dev/cpu_dma_latency set to 0us
# Histogram
000000 000000
000014 000006
000250 000002
019999 000001
# Total: 000000009
# Min Latencies: 00014
# Avg Latencies: 00016
# Max Latencies: 20485
# Histogram Overflows: 00003
# Histogram Overflow at cycle number:
# Thread 0: 00021 00372 00406
"""


def quick(seconds: float, into: Histogram, late: int = 0) -> Given:
    """A turn of so many ticks, of which some are late."""
    count = round(seconds * 1000)
    into.put(20, count - late)
    into.put(300, late)
    into.worst_s = 300e-6 if late else 20.5e-6
    return Given(True, minor_faults=1)


@pytest.fixture
def fake_turns(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Turns that take no time; gives their kinds in order."""
    order: list[str] = []

    def turn(period_s: float, seconds: float, into: Histogram, cpu: int | None) -> Given:
        order.append("late")
        return quick(seconds, into)

    def cyclictest(period_s: float, seconds: float, core: int | None, into: Histogram) -> str:
        order.append("cyclictest")
        quick(seconds, into)
        return "2.4"

    monkeypatch.setattr(wake_ups, "turn", turn)
    monkeypatch.setattr(host_measure, "cyclictest", cyclictest)
    monkeypatch.setattr(host_measure.shutil, "which", lambda _: "/usr/bin/cyclictest")
    return order


def silent(share: float) -> None:
    """Nobody watches."""


# ---- turns -------------------------------------------------------------------------------


def test_turns_alternate_and_all_are_added_up(fake_turns: list[str]) -> None:
    found = Measured(0.001)
    found.run(60.0, {}, (), silent)
    assert fake_turns == ["late", "cyclictest"] * 3
    assert found.late.count == 30_000 and found.other is not None and found.other.count == 30_000
    assert (found.ran_s, found.whole, found.minor_faults, found.other_version) == (60.0, True, 3, "2.4")
    assert [one.ended_s for one in found.course] == [10.0, 30.0, 50.0]


@pytest.mark.parametrize("hours", [0.01, 1.0, 8.0, 24.0, 31 * 24.0])
@pytest.mark.parametrize("kinds", [1, 2, 3])
def test_however_long_it_takes_the_turns_are_few_and_fill_the_time(hours: float, kinds: int) -> None:
    rounds, turn_s = host_measure.turns(3600.0 * hours, kinds)
    assert 1 <= rounds <= host_measure.MAX_TURNS
    assert rounds * turn_s * kinds == pytest.approx(3600.0 * hours)
    assert turn_s >= host_measure.SHORTEST_TURN_S / 2


def test_ctrl_c_ends_it_with_what_was_found_until_then(
    fake_turns: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def turn(period_s: float, seconds: float, into: Histogram, cpu: int | None) -> Given:
        quick(seconds / 2, into)
        if len(fake_turns) == 2:
            raise KeyboardInterrupt
        fake_turns.append("late")
        return Given(True)

    monkeypatch.setattr(wake_ups, "turn", turn)
    found = Measured(0.001)
    found.run(600.0, {}, (), silent)
    assert not found.whole and found.late.count == 10_000 and len(found.course) == 1


@pytest.mark.parametrize(("late", "fit"), [(10, True), (11, False)])
def test_one_tick_in_a_thousand_may_be_late(late: int, fit: bool) -> None:
    found = Measured(0.001)
    quick(10.0, found.late, late)
    assert found.is_fit is fit


def test_sync_is_judged_as_the_wake_ups_are_and_cyclictest_is_not() -> None:
    found = Measured(0.001, other=Histogram())
    quick(10.0, found.late)
    assert found.other is not None
    quick(10.0, found.other, late=100)
    assert found.is_fit
    found.syncs["main"] = Histogram()
    quick(10.0, found.syncs["main"], late=11)
    assert not found.is_fit


def test_of_a_running_tick_what_it_left_out_counts_and_nothing_measured_is_not_fit() -> None:
    tick = {"number": 1000, "skips": 2, "late_max_ms": 0.4, "period_ms": 1.0}
    assert not Measured(0.001).is_fit
    assert not Measured(0.001, tick=tick).is_fit
    assert Measured(0.001, tick={**tick, "skips": 1}).is_fit


# ---- cyclictest --------------------------------------------------------------------------


def test_what_cyclictest_prints_is_counted_with_what_is_beyond_and_the_worst() -> None:
    found = Histogram()
    host_measure.count_of(PRINTED, found)
    assert (found.count, found.beyond, found.worst_s) == (12, 3, pytest.approx(0.020485))
    assert (found.bins[14], found.bins[250], found.bins[19_999]) == (6, 2, 1)
    assert found.over(250e-6) == 6


def program(folder: Path, code: int) -> None:
    file = folder / "cyclictest"
    file.write_text(
        '#!/bin/sh\n[ "$1" = --help ] && echo "cyclictest V 2.40" && exit 1\n'
        f'echo "$@" > {folder}/asked\ncat {folder}/printed\nexit {code}\n'
    )
    file.chmod(0o755)
    (folder / "printed").write_text(PRINTED)


def test_cyclictest_is_asked_for_the_same_period_priority_and_core(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program(tmp_path, code=0)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    found = Histogram()
    assert host_measure.cyclictest(0.0005, 10.0, 3, found) == "2.40" and found.count == 12
    words = (tmp_path / "asked").read_text().split()
    assert {"-i500", f"-p{wake_ups.PRIORITY}", "-a3", "-l20000", f"-h{BINS}"} <= set(words)


def test_a_cyclictest_that_may_not_run_counts_for_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program(tmp_path, code=1)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    found = Histogram()
    assert host_measure.cyclictest(0.001, 1.0, None, found) == "" and found.count == 0


# ---- the page ----------------------------------------------------------------------------


class Page(HTMLParser):
    """Elements and their attributes; open ones must be closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        if tag != "meta":
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: Any) -> None:
        self.attributes += [(tag, name, value or "") for name, value in attrs]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def measured() -> Measured:
    found = Measured(0.001, core=3, other=Histogram(), other_version="2.40")
    for n in range(5):
        found.turn("late", 1.0, (), ())
        assert len(found.course) == n + 1
    host_measure.count_of(PRINTED, found.other)  # type: ignore[arg-type]
    found.syncs["main"] = Histogram()
    quick(5.0, found.syncs["main"])
    return found


def page(root: Path, language: str) -> str:
    before = spoken.set(language)
    try:
        own = Host(root)
        return host_report.page(measured(), host_findings.look(own), own)
    finally:
        spoken.reset(before)


@pytest.mark.parametrize("language", messages.LANGUAGES)
@pytest.mark.parametrize("build", [computers.laptop, computers.industrial, computers.raspberry])
def test_the_page_is_whole_and_needs_no_other_file(
    build: Callable[[Path], Path], language: str, tmp_path: Path, fake_turns: list[str]
) -> None:
    text = page(build(tmp_path), language)
    read = Page()
    read.feed(text)
    assert not read.open and ("html", "lang", language) in read.attributes
    assert not [one for one in read.attributes if one[1] in ("src", "href") or one[0] in ("script", "link")]
    assert text.count("<svg") == 2 and text.count("<polyline") == 4 and text.count('class="limit"') == 2
    assert "url(" not in text and "<table>" in text


@pytest.mark.parametrize("build", [computers.laptop, computers.industrial, computers.raspberry])
def test_the_page_names_no_computer_nobody_and_none_of_their_folders(
    build: Callable[[Path], Path], tmp_path: Path, fake_turns: list[str]
) -> None:
    text = page(build(tmp_path), "en")
    words = set(re.findall(r"[\w-]+", text))
    assert not {socket.gethostname(), getpass.getuser(), "somewhere", "maker"} & words
    assert not {"annas--laptop-root", "annas--laptop", "PARTUUID", "UUID"} & words
    assert str(tmp_path) not in text and "/dev/mapper" not in text and "/home" not in text


def test_the_page_says_what_the_figures_are_of(tmp_path: Path, fake_turns: list[str]) -> None:
    text = page(computers.industrial(tmp_path), "en")
    for words in ("An industrial processor; 4", "6.1.0-26-rt-amd64", "isolcpus=managed_irq,domain,3"):
        assert words in text
    for words in ("Maker of boxes Box 4", "Debian GNU/Linux 12", "peak_pciefd", "2.40", "Directrix "):
        assert words in text
    assert "It holds 1 ms" in text and "<td>5000</td>" in text and "SYNC on main" in text


# ---- the verb ----------------------------------------------------------------------------


def invoke(*words: str) -> Any:
    return CliRunner().invoke(app, ["host", "measure", *words, "--json"])


@pytest.fixture
def no_tick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A computer on which no machine runs, whoever else runs one here."""
    root = computers.industrial(tmp_path / "root")
    monkeypatch.setattr(host, "Host", lambda: Host(root))
    return root


def test_it_measures_and_writes_its_page(no_tick: Path, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(host_measure.shutil, "which", lambda _: None)
    report = tmp_path / "out.html"
    done = invoke("--seconds", "0.05", "--period-ms", "1", "--report", str(report))
    told = json.loads(done.stdout)
    assert done.exit_code == (0 if told["ok"] else 1), done.output
    assert told["measured"][0]["kind"] == "late" and told["measured"][0]["count"] == 50
    assert told["period_ms"] == 1.0 and report.read_text().startswith("<!doctype html>")


@pytest.mark.parametrize(("late", "code"), [(0, 0), (50, 1)])
def test_its_exit_code_is_whether_the_period_is_held(
    late: int, code: int, no_tick: Path, tmp_path: Path, fake_turns: list[str], monkeypatch: Any
) -> None:
    monkeypatch.setattr(wake_ups, "turn", lambda period_s, seconds, into, cpu: quick(seconds, into, late))
    done = CliRunner().invoke(
        app, ["host", "measure", "--seconds", "20", "--period-ms", "1", "--report", str(tmp_path / "a.html")]
    )
    assert done.exit_code == code, done.output
    assert max(map(len, done.stdout.splitlines())) <= 80


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_whoever_ends_it_gets_the_page_of_what_was_measured(
    number: signal.Signals, no_tick: Path, tmp_path: Path, fake_turns: list[str], monkeypatch: Any
) -> None:
    def turn(period_s: float, seconds: float, into: Histogram, cpu: int | None) -> Given:
        quick(seconds, into)
        os.kill(os.getpid(), number)
        return Given(True)

    monkeypatch.setattr(wake_ups, "turn", turn)
    before = signal.getsignal(signal.SIGTERM)
    report = tmp_path / "a.html"
    # A shell lets what it starts in the background ignore Ctrl-C.
    inherited = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        done = invoke("--hours", "8", "--period-ms", "1", "--report", str(report))
    finally:
        signal.signal(signal.SIGINT, inherited)
    told = json.loads(done.stdout)
    assert done.exit_code == 0 and not told["whole"] and told["measured"][0]["count"] > 0
    assert "ended before its time" in report.read_text()
    assert signal.getsignal(signal.SIGTERM) == before


USAGE = [
    ("--hours", "1", "--seconds", "5"),
    ("--seconds", "0"),
    ("--seconds", "-1"),
    ("--hours", "1000"),
    ("--seconds", "nan"),
    ("--hours", "x"),
    ("--seconds", "1", "--period-ms", "1000"),
    ("--seconds", "1", "--machine", "no_such_machine"),
]


@pytest.mark.parametrize("words", USAGE, ids=[" ".join(words) for words in USAGE])
def test_what_cannot_be_asked_is_refused_with_exit_code_2(
    words: Sequence[str], no_tick: Path, tmp_path: Path
) -> None:
    report = tmp_path / "a.html"
    assert invoke(*words, "--report", str(report)).exit_code == 2 and not report.exists()


def test_a_page_that_could_not_be_written_is_refused_before_the_hours(no_tick: Path, tmp_path: Path) -> None:
    assert invoke("--hours", "8", "--report", str(tmp_path / "nowhere" / "a.html")).exit_code == 2


def test_while_the_machine_runs_sync_is_its_own(no_tick: Path, tmp_path: Path) -> None:
    computers.with_tick(no_tick, "3", 80, 1)
    done = invoke("--seconds", "1", "--send-sync", "--report", str(tmp_path / "a.html"))
    assert done.exit_code == 2 and "its tick" in json.loads(done.stdout)["error"]


class Heard:
    """A bus on which SYNC is heard."""

    def __init__(self, each: int) -> None:
        self.off, self.heard, self.each = Histogram(), 0, each

    def begin(self) -> None:
        """Nothing was before."""

    def listened(self) -> None:
        self.heard += self.each
        if self.each:
            quick(self.each / 1000.0, self.off)


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> dict[str, Heard]:
    """What is on the buses of a machine; to be filled."""
    buses: dict[str, Heard] = {}

    @contextmanager
    def echoes_of(settings: Sequence[Any], period_s: float) -> Iterator[dict[str, Heard]]:
        yield buses if settings else {}

    def listen(echoes: Sequence[Heard], seconds: float) -> None:
        for one in echoes:
            one.listened()

    monkeypatch.setattr(wake_ups, "echoes_of", echoes_of)
    monkeypatch.setattr(wake_ups, "listen", listen)
    return buses


def test_where_another_sends_sync_none_is_sent(
    no_tick: Path, heard: dict[str, Heard], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard["main"] = Heard(each=1)
    monkeypatch.setattr(host.bus, "open", lambda *_: pytest.fail("a bus was opened to send on"))
    done = invoke("--seconds", "1", "--send-sync", "--report", str(tmp_path / "a.html"))
    assert done.exit_code == 2 and "Nothing was sent" in json.loads(done.stdout)["error"]


def test_beside_a_running_machine_its_syncs_are_heard_and_nothing_else_is_done(
    no_tick: Path, heard: dict[str, Heard], fake_turns: list[str], tmp_path: Path, monkeypatch: Any
) -> None:
    computers.with_tick(no_tick, "3", 80, 1)
    heard["main"] = Heard(each=1000)
    faults = iter([(100, 7), (105, 8)])
    monkeypatch.setattr(Host, "tick_faults", lambda _: next(faults))
    tick = {"number": 9000, "skips": 0, "late_max_ms": 0.1, "period_ms": 1.0}
    monkeypatch.setattr(self_test, "running_tick", lambda _: tick)
    report = tmp_path / "a.html"
    done = invoke("--seconds", "3", "--period-ms", "1", "--report", str(report))
    told = json.loads(done.stdout)
    assert done.exit_code == 0 and fake_turns == [] and told["sync_from"] == "tick"
    assert [(one["kind"], one["bus"], one["count"]) for one in told["measured"]] == [("sync", "main", 3000)]
    assert "9000 ticks, 0 left out" in report.read_text()
    assert (told["minor_faults"], told["major_faults"]) == (5, 1)


def test_a_running_machine_without_such_a_bus_leaves_nothing_to_measure(
    no_tick: Path, heard: dict[str, Heard], tmp_path: Path
) -> None:
    computers.with_tick(no_tick, "3", 80, 1)
    assert invoke("--seconds", "1", "--report", str(tmp_path / "a.html")).exit_code == 2
