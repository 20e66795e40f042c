"""How a computer is measured for hours: wake-ups, SYNC and cyclictest in turns, counted in bounded memory.

In turns and not at once, because two who wait for the same core would measure each other. Where the machine
runs, its tick has the core: then its own account is taken, and SYNC is heard, which disturbs nobody.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from controller.runtime import wake_ups
from controller.runtime.wake_ups import Echoes, Histogram
from drives import bus

PROGRAM = "cyclictest"  # Debian: rt-tests
SHORTEST_TURN_S = 10.0
MAX_TURNS = 200  # of each kind; what is kept of one is three numbers
GUARD_S = 1.0  # for which a bus is heard before SYNC is sent on it
SHARES = (0.5, 0.99, 0.999, 0.9999, 0.99999)
Heard = Callable[[float], None]  # of the share that is done
ROW = re.compile(r"^(\d+)\s+(\d+)\s*$", re.M)
SUMMED = re.compile(r"^# (Max Latencies|Histogram Overflows):\s*(\d+)", re.M)
VERSION = re.compile(r"V\s*([\d.]+)")


@dataclass(frozen=True, slots=True)
class Turn:
    """One turn of wake-ups: when it was over (s), its worst (s), and how many came too late."""

    ended_s: float
    worst_s: float
    late: int


@dataclass
class Measured:
    """What a measurement has found so far."""

    period_s: float
    core: int | None = None  # on which it was measured, if on one
    late: Histogram = field(default_factory=Histogram)  # wake-ups
    syncs: dict[str, Histogram] = field(default_factory=dict)  # by bus: how far intervals are off
    from_tick: bool = False  # SYNC was the running tick's own
    other: Histogram | None = None  # cyclictest's
    other_version: str = ""
    real_time: bool = True
    minor_faults: int = 0
    major_faults: int = 0
    course: list[Turn] = field(default_factory=list)
    tick: Mapping[str, float] | None = None  # the running tick's own account
    ran_s: float = 0.0
    whole: bool = True  # it was not ended before its time

    @property
    def limit_s(self) -> float:
        """Beyond which a tick sends nothing."""
        return wake_ups.LATE_SHARE * self.period_s

    @property
    def is_fit(self) -> bool:
        """Something was measured, and of nothing more than one in a thousand came too late."""
        judged = [one for one in (self.late, *self.syncs.values()) if one.count]
        shares = [one.share_over(self.limit_s) for one in judged]
        if self.tick is not None:
            shares.append(self.tick["skips"] / max(self.tick["number"], 1))
        return bool(shares) and max(shares) <= wake_ups.MAY_BE_LATE

    def rows(self) -> list[tuple[str, str, Histogram]]:
        """(kind, bus, counts) of all that was counted, the reference last."""
        found = [("late", "", self.late)] if self.late.count else []
        found += [("sync", name, one) for name, one in self.syncs.items() if one.count]
        return [*found, *([("cyclictest", "", self.other)] if self.other and self.other.count else [])]

    def to_dict(self) -> dict[str, Any]:
        """For JSON; times in us."""
        return {
            "period_ms": 1e3 * self.period_s,
            "seconds": round(self.ran_s, 3),
            "whole": self.whole,
            "real_time": self.real_time,
            "core": self.core,
            "sync_from": "tick" if self.from_tick else "own" if self.syncs else None,
            "minor_faults": self.minor_faults,
            "major_faults": self.major_faults,
            "measured": [
                {"kind": kind, "bus": bus or None, **figures(one, self.limit_s)}
                for kind, bus, one in self.rows()
            ],
        }

    def run(
        self, seconds: float, echoes: Mapping[str, Echoes], senders: Sequence[bus.Port], heard: Heard
    ) -> None:
        """Turns for ``seconds`` in all; Ctrl-C ends it, with what was found until then."""
        self.syncs = {name: echo.off for name, echo in echoes.items()}
        kinds = ["late", *(["sync"] if senders else []), *([PROGRAM] if shutil.which(PROGRAM) else [])]
        rounds, turn_s = turns(seconds, len(kinds))
        with contextlib.suppress(KeyboardInterrupt):
            self.whole = False
            for done in range(rounds):
                for k, kind in enumerate(kinds):
                    heard((done + k / len(kinds)) / rounds)
                    self.turn(kind, turn_s, list(echoes.values()), senders)
                    self.ran_s += turn_s
            self.whole = True

    def listen(self, seconds: float, echoes: Mapping[str, Echoes], heard: Heard) -> None:
        """Beside a running machine: its SYNCs alone."""
        self.syncs, self.from_tick, self.whole = {name: one.off for name, one in echoes.items()}, True, False
        for one in echoes.values():
            one.begin()
        with contextlib.suppress(KeyboardInterrupt):
            while (left_s := seconds - self.ran_s) > 0.0:
                heard(self.ran_s / seconds)
                wake_ups.listen(list(echoes.values()), min(left_s, 1.0))
                self.ran_s += min(left_s, 1.0)
            self.whole = True

    def turn(self, kind: str, seconds: float, echoes: Sequence[Echoes], senders: Sequence[bus.Port]) -> None:
        """One of a kind, counted."""
        if kind == PROGRAM:
            self.other = self.other or Histogram()
            self.other_version = cyclictest(self.period_s, seconds, self.core, self.other)
            return
        own = Histogram()
        try:
            if kind == "sync":
                given = wake_ups.sync_turn(self.period_s, seconds, senders, echoes, self.core)
            else:
                given = wake_ups.turn(self.period_s, seconds, own, self.core)
            self.real_time = self.real_time and given.real_time
            self.minor_faults += given.minor_faults
            self.major_faults += given.major_faults
        finally:
            self.late.merge(own)
        if kind == "late":
            self.course.append(Turn(self.ran_s + seconds, own.worst_s, own.over(self.limit_s)))


def figures(counts: Histogram, limit_s: float) -> dict[str, Any]:
    """Percentiles and worst (us), and how many are over the limit."""
    found: dict[str, Any] = {"count": counts.count}
    found |= {f"p{100.0 * share:g}_us": round(1e6 * counts.quantile_s(share), 1) for share in SHARES}
    return found | {"worst_us": round(1e6 * counts.worst_s, 1), "over": counts.over(limit_s)}


def turns(seconds: float, kinds: int) -> tuple[int, float]:
    """(rounds, length of a turn in s), so that rounds are bounded however long it takes."""
    each_s = seconds / kinds
    rounds = min(max(round(each_s / SHORTEST_TURN_S), 1), MAX_TURNS)
    return rounds, each_s / rounds


def is_silent(echoes: Mapping[str, Echoes]) -> bool:
    """Whether nobody sends SYNC on these buses: two who do would have every drive latch twice."""
    before = sum(one.heard for one in echoes.values())
    wake_ups.listen(list(echoes.values()), GUARD_S)
    return sum(one.heard for one in echoes.values()) == before


# --- cyclictest ------------------------------------------------------------------------------


def cyclictest(period_s: float, seconds: float, core: int | None, into: Histogram) -> str:
    """One turn of it, with the period and priority of ours; its version, "" where it did not run."""
    command = [PROGRAM, "-m", "-q", "-t1", f"-i{round(period_s * 1e6)}", f"-p{wake_ups.PRIORITY}"]
    command += [f"-h{wake_ups.BINS}", f"-l{max(1, round(seconds / period_s))}"]
    command += [] if core is None else [f"-a{core}"]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode == 0:
        count_of(done.stdout, into)
    version = subprocess.run([PROGRAM, "--help"], capture_output=True, text=True, check=False)
    named = VERSION.search(version.stdout + version.stderr)
    return (named[1] if named else "?") if done.returncode == 0 else ""


def count_of(printed: str, into: Histogram) -> None:
    """Adds the histogram that it prints: rows of us and counts; largest and overflows are in comments."""
    for microseconds, count in ROW.findall(printed):
        into.put(int(microseconds), int(count))
    summed = {name: int(value) for name, value in SUMMED.findall(printed)}
    into.put(wake_ups.BINS, summed.get("Histogram Overflows", 0))
    into.reach(1e-6 * summed.get("Max Latencies", 0))
