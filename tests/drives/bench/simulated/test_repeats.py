"""A drive that stands answers what it answered before; one that works every period out is the oracle."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from support.drives.stepped_drives import Bench

from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.inputs import POSITIVE_LIMIT

AT_REST = 200  # ticks
STEP = 500

Act = Callable[[Bench], object]


def now_s(bench: Bench) -> float:
    return bench.rig.now_s


ACTS: dict[str, Act] = {
    "nothing": lambda bench: None,
    "a setpoint that did not come": lambda bench: bench.tick(rpdo=False),
    "a SYNC that did not come": lambda bench: bench.wait(),
    "a long silence": lambda bench: bench.wait(30),
    "a SYNC too soon": lambda bench: bench.wait(0.3),
    "a jam": lambda bench: bench.drive.jam(True, now_s(bench)),
    "less torque": lambda bench: bench.drive.weaken(0.01, now_s(bench)),
    "safe torque off": lambda bench: bench.drive.torque_off(True, now_s(bench)),
    "a limit switch": lambda bench: bench.drive.press_switch(True, True, now_s(bench)),
    "a switch where it stands": lambda bench: bench.drive.place_switch(0, now_s(bench)),
    "a terminal": lambda bench: bench.drive.inputs.set(POSITIVE_LIMIT, now_s(bench)),
    "an error": lambda bench: bench.drive.inject(0x2310, now_s(bench)),
    "a panel": lambda bench: bench.drive.take_local_control(True),
    "a power failure": lambda bench: bench.drive.power_cycle(now_s(bench)),
    "another counting": lambda bench: bench.drive.axis.recount(1000.0),
    "no following error at all": lambda bench: bench.write(0x6065, 0, (0).to_bytes(4, "little")),
    "a position offset": lambda bench: bench.write(0x60B0, 0, (700).to_bytes(4, "little")),
    "a slow motor": lambda bench: bench.write(0x607F, 0, (1000).to_bytes(4, "little")),
    "a short way": lambda bench: bench.write(0x607D, 2, (5).to_bytes(4, "little")),
    "armed probes": lambda bench: bench.write(0x60B8, 0, (0x3131).to_bytes(2, "little")),
    "a brake at a terminal": lambda bench: bench.write(0x60FE, 2, (1).to_bytes(4, "little")),
    "velocity mode": lambda bench: bench.write(0x6060, 0, b"\x09"),
    "profile position": lambda bench: bench.write(0x6060, 0, b"\x01"),
    "stopped by NMT": lambda bench: bench.port.send(bytes.fromhex("0000000002000000 0200000000000000")),
}


def run(bench: Bench, act: Act) -> list[object]:
    """What it shows, tick by tick: at rest, disturbed, on the way to somewhere, and at rest again."""
    seen: list[object] = []

    def tick(word: int, target: int) -> None:
        bench.tick(word, [target])
        servo = bench.drive.axis.servo
        seen.append((bench.statuswords["X"], bench.actual["X"], servo.position, servo.velocity, servo.end))

    bench.enable()
    at = bench.actual["X"]
    for _ in range(AT_REST):
        tick(0x0F, at)
    act(bench)
    for _ in range(AT_REST):
        tick(0x0F, at)
    for k in range(1, 20):
        tick(0x0F, at + STEP * k)
    for word in (0x0F, 0x07, 0x06, 0x80, 0x06, 0x07, 0x0F):
        for _ in range(AT_REST):
            tick(word, at + STEP * 20)
    return [*seen, *bench.emergencies]


@pytest.mark.parametrize("what", ACTS)
def test_a_drive_at_rest_repeats_itself_and_nothing_else_is_different(what: str) -> None:
    plain, slow, repeats = Bench(), Bench(), []
    repeat = plain.drive._repeat
    plain.drive._repeat = lambda *how: (repeats.append(how), repeat(*how))[1]  # type: ignore[method-assign]
    slow.drive._may_repeat = lambda: False  # type: ignore[method-assign]
    assert run(plain, ACTS[what]) == run(slow, ACTS[what])
    assert len(repeats) > AT_REST / 2, "or nothing was tried"


@pytest.mark.parametrize("kind", [1, 255])
def test_a_drive_at_rest_goes_on_telling_what_else_it_tells(kind: int) -> None:
    """A second TPDO, with each SYNC or on change, of what a probe has latched meanwhile."""
    told: list[list[bytes]] = []
    for repeats in (True, False):
        bench, frames = Bench(), list[bytes]()
        drive = bench.drive
        entries = {
            key(0x1A01, 0): 1,
            key(0x1A01, 1): 0x60B9_0010,
            key(0x1801, 1): 0x281,
            key(0x1801, 2): kind,
        }
        drive.dictionary.values.update(entries)
        drive.configure()
        if not repeats:
            drive._may_repeat = lambda: False  # type: ignore[method-assign]
        bench.enable()
        bench.write(0x60B8, 0, (0x31).to_bytes(2, "little"))
        bench.rig.buses["can"].log(lambda one, kept=frames: kept.append(one[1]))  # type: ignore[misc]
        for n in range(AT_REST):
            if n == AT_REST // 2:
                assert (drive._rests is not None) is repeats
                drive.axis.sensors.probes.set_input(0, True)
            bench.tick(0x0F, [bench.actual["X"]])
        told.append([frame for frame in frames if frame[:2] == b"\x81\x02"])
    assert told[0] == told[1] and told[0][-1][8] == 3, "on, and the rising edge stored"


def test_a_drive_whose_demand_goes_on_by_itself_is_never_taken_for_one_at_rest() -> None:
    bench = Bench()
    bench.enable()
    for _ in range(AT_REST):
        bench.tick(0x0F, [bench.actual["X"]])
    assert bench.drive._rests is not None
    bench.write(0x6060, 0, b"\x09")
    bench.tick(0x0F, [0])
    bench.write(0x60FF, 0, (3000).to_bytes(4, "little"))
    for _ in range(AT_REST):
        bench.tick(0x0F, [0])
        assert bench.drive._rests is None
    assert bench.actual["X"] > 100
