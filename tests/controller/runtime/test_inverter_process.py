"""The process that talks to an inverter on a serial line, with a Modbus slave on a pty behind it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.machines.modbus_slave import Slave

from controller.ipc.inverter_slot import Commanded, InverterSlot, Reported
from controller.machine.spindle import Modbus, Spindle
from controller.runtime import children, inverter_process
from controller.runtime.inverter_line import LineError

pytest.importorskip("pymodbus", reason="pip install 'directrix[modbus]'")
STATION = 3
GIVE_UP_S = 20.0


def delta(slave: Slave) -> None:
    """It has the frequency at once; 2000h to 2103h as its manual has them."""
    registers = slave.registers
    if registers.get(0x2002) == 2:
        registers[0x2100] = registers[0x2002] = 0
    turns = registers.get(0x2000, 0) & 3 == 2
    registers[0x2101] = 3 if turns else 0
    registers[0x2103] = registers.get(0x2001, 0) if turns else 0


def hitachi(slave: Slave) -> None:
    """Likewise; on the line each number is one less than in the manual."""
    turns = slave.coils.get(0x0000, False)
    slave.coils[0x000E] = turns
    if slave.coils.get(0x0003):
        slave.coils[0x0017] = False
    slave.registers[0x1000] = slave.registers.get(0, 0) if turns else 0
    slave.registers[0x1001] = slave.registers.get(1, 0) if turns else 0


MAPS = {
    "delta_c2000": (
        delta,
        [("register", 0x2001, 20000), ("register", 0x2000, 0x12)],
        [("register", 0x2001, 10000), ("register", 0x2000, 0x22)],
        [("register", 0x2000, 0x01)],
        [("register", 0x2002, 0x02)],
    ),
    "hitachi_wj200": (
        hitachi,
        [("register", 0, 0), ("register", 1, 20000), ("coil", 1, 0), ("coil", 0, 1)],
        [("register", 0, 0), ("register", 1, 10000), ("coil", 1, 1), ("coil", 0, 1)],
        [("coil", 0, 0)],
        [("coil", 3, 1), ("coil", 3, 0)],
    ),
}


class Side:
    """That of the tick: ``beat`` is what it does every time."""

    def __init__(self, slave: Slave, profile: str, folder: Path) -> None:
        paths = (str(folder / "wanted"), str(folder / "reported"))
        self.slot, self.wanted = InverterSlot(paths), Commanded()
        modbus = Modbus(slave.path, profile, STATION)
        spindle = Spindle(24000.0, "modbus", modbus=modbus)
        self.child = children.start("inverter", inverter_process.Job(spindle, paths, False), folder)

    def until(self, done: Callable[[Reported], bool], beats: bool = True) -> Reported:
        """The first report that is ``done``."""
        give_up_s = time.monotonic() + GIVE_UP_S
        while time.monotonic() < give_up_s:
            if beats:
                self.slot.want(self.wanted)
            now, count = self.slot.reported()
            if count and done(now):
                return now
            assert self.child.is_alive(), self.child.last_words()
            time.sleep(0.01)
        raise AssertionError((self.slot.reported(), self.child.last_words()))

    def order(self, rev_min: float, resets: int = 0) -> Reported:
        """What it reports of an order that it has carried out."""
        self.wanted = Commanded(rev_min, self.wanted.order + 1, resets)
        return self.until(lambda now: now.order == self.wanted.order)


@pytest.fixture(params=MAPS)
def profile(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def slave(profile: str) -> Iterator[Slave]:
    made = Slave(STATION, MAPS[profile][0])
    yield made
    made.close()


@pytest.fixture
def side(slave: Slave, profile: str, tmp_path: Path) -> Iterator[Side]:
    made = Side(slave, profile, tmp_path)
    yield made
    made.child.end()


def test_it_is_told_what_its_manual_says_and_what_it_answers_is_reported(
    side: Side, slave: Slave, profile: str
) -> None:
    _, forward, reverse, stop, reset = MAPS[profile]
    assert side.order(0.0) == Reported(0.0, 1, False, False)
    assert slave.written == stop, "before anything else"
    slave.written.clear()
    assert side.order(12000.0) == Reported(12000.0, 2, True, False)
    assert slave.written == forward
    slave.written.clear()
    assert side.order(-6000.0).rev_min == 6000.0
    assert slave.written == reverse
    if profile == "delta_c2000":
        slave.registers[0x2100] = 0x0100  # a warning
        slave.registers[0x2100] |= 0x15
    else:
        slave.coils[0x0017] = True
    side.until(lambda now: now.fault)
    slave.written.clear()
    assert not side.order(0.0, resets=1).fault
    assert slave.written == [*reset, *stop]
    side.order(3000.0, resets=1)
    slave.written.clear()
    side.child.end()
    assert slave.written == stop, "at its end, too"


def test_a_tick_that_is_silent_has_the_spindle_stopped(side: Side, slave: Slave, profile: str) -> None:
    side.order(12000.0)
    slave.written.clear()
    assert side.until(lambda now: not now.running, beats=False).order == 0
    assert slave.written == MAPS[profile][3]
    assert side.order(9000.0).rev_min == 9000.0, "it goes on when the tick does"


def test_what_is_not_answered_is_not_reported_and_is_told_anew_afterwards(
    side: Side, slave: Slave, profile: str
) -> None:
    side.order(12000.0)
    slave.mute = True
    side.until(lambda _: slave.ignored >= 2)
    before = side.slot.reported()[1]
    side.until(lambda _: slave.ignored >= 5)
    assert side.slot.reported()[1] == before, "silence"
    slave.written.clear()
    slave.registers.clear()
    slave.coils.clear()
    slave.mute = False
    side.until(lambda _: side.slot.reported()[1] > before)
    assert side.slot.reported()[0].rev_min == 12000.0
    assert slave.written[: len(MAPS[profile][1])] == MAPS[profile][1], "it may have been without power"


def test_why_it_does_not_answer_is_told_once_of_each_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inverter_process, "AGAIN_S", 0.0)
    answers = iter([True, False, False, True, False, True, True])

    class Deaf:
        def exchange(self, wanted: Commanded) -> Reported:
            if not next(answers, True):
                raise LineError("nothing")
            return Reported(order=wanted.order)

    slot, told, left = InverterSlot(), list[LineError](), iter(range(7))
    inverter_process.serve(slot, Deaf(), lambda: next(left, None) is not None, told.append)
    assert len(told) == 2 and slot.reported()[1] == 4, "and what was answered is reported"
