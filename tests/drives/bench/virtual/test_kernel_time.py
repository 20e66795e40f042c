"""The kernel's stamps on the clock of buses, with clocks that say what the test says."""

from __future__ import annotations

import struct

import pytest

from drives.bench.virtual import kernel_time
from drives.bench.virtual.kernel_time import AT_ONCE_S, TRUSTED_S, KernelTime

APART_S = 1_700_000_000.0


class Clocks:
    """Both of a computer; ``away_s`` somebody else has the processor after the next look at one."""

    def __init__(self) -> None:
        self.now_s, self.apart_s, self.away_s = 100.0, APART_S, 0.0

    def monotonic(self) -> float:
        now_s, self.now_s, self.away_s = self.now_s, self.now_s + self.away_s, 0.0
        return now_s

    def time(self) -> float:
        return self.now_s + self.apart_s

    def notes(self, at_s: float) -> list[tuple[int, int, bytes]]:
        """Of a packet that was taken then."""
        whole, rest = divmod(at_s + self.apart_s, 1.0)
        return [(1, kernel_time.SO_TIMESTAMPNS, struct.pack("qq", int(whole), round(rest * 1e9)))]


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch) -> Clocks:
    found = Clocks()
    monkeypatch.setattr(kernel_time, "time", found)
    return found


def taken_s(found: KernelTime, clocks: Clocks, at_s: float, lived_s: float = 0.0) -> float:
    return found.taken_s(clocks.notes(at_s), lived_s)


def test_a_packet_was_taken_when_the_kernel_says(clocks: Clocks) -> None:
    found = KernelTime()
    clocks.now_s = 105.0
    assert taken_s(found, clocks, 104.25) == pytest.approx(104.25, abs=1e-6)
    assert found.taken_s([], 0.0) == 105.0, "one without a stamp just now"


@pytest.mark.parametrize("away_s", [1.1 * AT_ONCE_S, 1e-3, 0.5])
def test_who_is_held_back_between_two_looks_at_clocks_does_not_believe_them(
    clocks: Clocks, away_s: float
) -> None:
    found = KernelTime()
    clocks.away_s = away_s
    found.look()
    clocks.now_s = 105.0
    assert taken_s(found, clocks, 104.25) == pytest.approx(104.25, abs=1e-6)


def test_a_clock_that_was_set_is_noticed_with_the_next_look(clocks: Clocks) -> None:
    found = KernelTime()
    clocks.apart_s += 0.3
    assert taken_s(found, clocks, 99.9) == 100.0, "after now it cannot have been"
    found.look()
    assert taken_s(found, clocks, 99.9) == pytest.approx(99.9, abs=1e-6)


def test_it_begins_though_it_is_held_back_at_once(clocks: Clocks) -> None:
    clocks.away_s = 0.01
    found = KernelTime()
    assert taken_s(found, clocks, 99.0) == pytest.approx(99.0, abs=0.006)


@pytest.mark.parametrize(
    ("at_s", "lived_s", "wanted_s"),
    [(99.0, 99.5, 99.5), (100.5, 0.0, 100.0), (100.0 - 1.1 * TRUSTED_S, 0.0, 100.0)],
    ids=["what the bus has lived through", "after now", "long ago"],
)
def test_no_packet_was_taken_then(clocks: Clocks, at_s: float, lived_s: float, wanted_s: float) -> None:
    assert taken_s(KernelTime(), clocks, at_s, lived_s) == pytest.approx(wanted_s)
