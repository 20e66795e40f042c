"""Faults on the bus while five drives move: each is named, nothing jumps, and reset brings all back."""

from dataclasses import replace

import pytest
from support.drives.group_bench import GroupBench, T, nodes

from drives.bench.virtual.fault_script import FaultScript
from drives.cia402 import Wanted
from drives.cyclic.drive_fault import DriveFault
from drives.profile import GENERIC, CyclicMode, Supervision

STEP = 50  # counts per period in motion
SETTLING = 1.15  # a servo catching up is a little faster than its path, and never more

FINE = (DriveFault.NONE, -1)
ROWS = [
    ("drop tpdo 3 x 1", [FINE], "one lost feedback is counted"),
    ("drop tpdo 3 x 2", [(DriveFault.FEEDBACK_LOST, 2)], "the second in a row is a fault"),
    ("drop rpdo 3 x 1", [FINE], "the next setpoint makes up for it"),
    ("drop sync x 1", [FINE], "no SYNC, no feedback: one lost of each drive"),
    ("duplicate tpdo 3 x 10", [FINE], "the same twice says nothing new"),
    ("duplicate rpdo 3 x 10", [FINE], "the same target again"),
    ("delay tpdo 3 by 500 us x 5", [FINE], "in time for the next tick"),
    ("delay rpdo 3 by 500 us x 5", [FINE], "before the next SYNC"),
    ("falsify tpdo 3 byte 0 xor 08 x 1", [(DriveFault.STATE_LOST, 2)], "bit 3 of the statusword: a fault"),
    ("corrupt rpdo 3 x 2", [FINE], "sent again by the controller"),
    ("silence 3 for 100 ms", [(DriveFault.FEEDBACK_LOST, 2)], "noticed by its feedback first"),
    ("node_reset 3", [(DriveFault.FEEDBACK_LOST, 2), (DriveFault.NODE_RESET, 2)], "off, then a boot-up"),
    ("bus_off 3 for 50 ms", [(DriveFault.FEEDBACK_LOST, 2)], "the drive's own controller is off"),
    ("bus_off master for 50 ms", [(DriveFault.BUS_OFF, 0)], "ours is off"),
    ("queue_full master for 5 ms", [(DriveFault.SEND_FAILED, 0), (DriveFault.SEND_FAILED, 1)], "ENOBUFS"),
    ("babble 000 for 40 ms", [(DriveFault.BUS_FLOODED, -1)], "nobody else gets a word in"),
]
WAYS = {
    "plain": {},
    "feed-forward": {"feed_forward": True},
    "interpolated": {"profile": replace(GENERIC, mode=CyclicMode.IP)},
    "guarded": {"profile": replace(GENERIC, supervision=Supervision.GUARDING)},
    "braked": {"brake": True},
}


def moving(**settings):
    bench = GroupBench(nodes("XYZ", **settings))
    bench.enable()
    bench.tick(30)
    for i in range(STEP):
        bench.tick(step=i)
    return bench


class Motion:
    """How fast the motors are. Without SYNC a simulated motor's periods are made up for later."""

    def __init__(self, devices):
        self.devices = devices
        self.seen = [device.axis.servo.position for device in devices]
        self.waited = [0] * len(devices)

    def fastest(self):
        """The most counts per period since a motor was last seen to move; called once per period."""
        fastest = 0.0
        for i, device in enumerate(self.devices):
            position = device.axis.servo.position
            self.waited[i] += 1
            if position != self.seen[i]:
                fastest = max(fastest, abs(position - self.seen[i]) / self.waited[i])
                self.seen[i], self.waited[i] = position, 0
        return fastest


def cases():
    """Every row with plain drives; in the other ways, and only now and then, those that could differ."""
    alike = ("babble", "corrupt", "delay", "duplicate")
    for way in WAYS:
        for line, faults, reason in ROWS:
            if way == "plain" or not line.startswith(alike):
                marks = [] if way == "plain" else [pytest.mark.slow]
                yield pytest.param(line, faults, reason, way, id=f"{line}, {way}", marks=marks)


@pytest.mark.parametrize(("line", "faults", "reason", "way"), list(cases()))
def test_each_fault_is_named_nothing_jumps_and_reset_brings_all_back(line, faults, reason, way):
    bench = moving(**WAYS[way])
    FaultScript.read(f"at 0 s: {line}").inject(bench.rig.buses["can"])
    watched = [d for d in bench.devices if not (line == "node_reset 3" and d.node == 3)]  # it counts anew
    motion, seen, stopped = Motion(watched), [], False
    for _ in range(100):
        bench.tick(step=0 if stopped else STEP)
        if bench.fault != FINE:
            if bench.fault not in seen:
                seen.append(bench.fault)
            if not stopped:
                bench.group.want(Wanted.QUICK_STOP)
                stopped = True
        assert motion.fastest() <= SETTLING * STEP, reason
    assert (seen or [FINE])[0] in faults, f"{reason}: {seen}"
    assert all(fault in faults for fault in seen[:2]), f"{reason}: {seen}"
    if seen:
        bench.tick(10)
        assert motion.fastest() < 0.1, "all stand"
    recover(bench, reason)


def recover(bench, reason):
    bench.tick(round(0.3 / T))
    if any(drive.nmt_state != 5 for drive in bench.group.drives):
        return  # it has to be commissioned again
    for wanted in (Wanted.QUICK_STOP, Wanted.RESET, Wanted.OFF):
        bench.group.want(wanted)
        bench.tick(60)
    bench.enable()
    bench.tick(30)
    assert bench.fault == FINE, reason
