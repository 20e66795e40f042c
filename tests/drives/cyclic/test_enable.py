"""The group and five simulated drives on the stepped bus: from power-on to motion and into faults."""

import struct

import pytest

from drives import pdo
from drives.bench.simulated.drive import SimulatedDrive
from drives.bench.simulated.parameters import Parameters
from drives.bench.virtual.virtual_bus import SteppedBus
from drives.cia402 import State, Wanted
from drives.cyclic.drive import Drive, DriveFault
from drives.cyclic.group import Group
from drives.settings import MasterSettings, NodeSettings

T = 0.002
NODES = (1, 2, 3, 4, 5)
SETUP = [  # what commissioning writes, as far as the cyclic side needs it: index, sub, bytes, value
    (0x1400, 1, 4, 0x8000_0200), (0x1400, 2, 1, 1),
    (0x1600, 0, 1, 0), (0x1600, 1, 4, 0x6040_0010), (0x1600, 2, 4, 0x607A_0020), (0x1600, 0, 1, 2),
    (0x1400, 1, 4, 0x200),
    (0x1800, 1, 4, 0x8000_0180), (0x1800, 2, 1, 1),
    (0x1A00, 0, 1, 0), (0x1A00, 1, 4, 0x6041_0010), (0x1A00, 2, 4, 0x6064_0020), (0x1A00, 0, 1, 2),
    (0x1800, 1, 4, 0x180),
    (0x60C2, 1, 1, 2), (0x60C2, 2, 1, 0xFD),
    (0x1017, 0, 2, 50), (0x6060, 0, 1, 8),
]  # fmt: skip
DOWNLOAD = {1: 0x2F, 2: 0x2B, 4: 0x23}


class Bench:
    """A group, its bus and the drives, advanced one period at a time."""

    def __init__(self):
        self.bus = SteppedBus()
        self.devices = [SimulatedDrive(node, Parameters(position_counts=1000 * node)) for node in NODES]
        for device in self.devices:
            self.bus.attach(device)
        self.service = self.bus.port()
        drives = [Drive(NodeSettings(f"axis {n}", "can0", n, "a.eds")) for n in NODES]
        master = MasterSettings(period_s=T)
        self.group = Group(drives, {"can0": self.bus.port(pdo.TICK_FILTERS)}, master)
        self.now_s = 0.0
        self.setpoints = [0] * 5
        self.fault = (DriveFault.NONE, -1)
        self._commission()

    def _commission(self):
        self._wait(0.1)
        for node in NODES:
            for index, sub, size, value in SETUP:
                if index in (0x1400, 0x1800) and sub == 1:
                    value += node
                data = struct.pack("<BHBI", DOWNLOAD[size], index, sub, value)
                self.service.send(pdo.frame(0x600 + node, data))
                self._wait(0.002)
        self.service.send(pdo.frame(0x000, b"\x01\x00"))
        self._wait(0.01)

    def _wait(self, seconds):
        self.now_s += seconds
        self.bus.advance(self.now_s)

    def tick(self, count=1, skip=False):
        for _ in range(count):
            self._wait(T)
            self.group.receive(self.now_s)
            self.fault = self.group.fault(self.now_s)
            if skip or not self.group.sync(self.now_s):
                continue
            for i, drive in enumerate(self.group.drives):
                if not drive.following:
                    self.setpoints[i] = drive.position
            self.group.command(self.setpoints, self.now_s)

    def enable(self):
        self.group.want(Wanted.ENABLED)
        for _ in range(100):
            self.tick()
            if self.group.following():
                return
        raise AssertionError(f"not enabled: {[drive.state for drive in self.group.drives]}")


@pytest.fixture
def bench():
    bench = Bench()
    bench.tick(3)
    return bench


def test_five_drives_enable_without_moving_a_count_and_then_follow(bench):
    assert [drive.state for drive in bench.group.drives] == [State.SWITCH_ON_DISABLED] * 5
    bench.enable()
    assert bench.group.positions == [1000, 2000, 3000, 4000, 5000]
    for _ in range(200):
        bench.setpoints = [s + 10 for s in bench.setpoints]
        bench.tick()
    bench.tick(100)
    assert bench.fault == (DriveFault.NONE, -1)
    assert bench.group.positions == [1000 * n + 2000 for n in NODES]
    assert sum(drive.lost for drive in bench.group.drives) == 0


def test_off_steps_down_and_nothing_is_at_fault(bench):
    bench.enable()
    bench.group.want(Wanted.OFF)
    bench.tick(20)
    assert [drive.state for drive in bench.group.drives] == [State.SWITCH_ON_DISABLED] * 5
    assert bench.fault == (DriveFault.NONE, -1)
    bench.enable()


def test_skipped_syncs_are_no_fault_of_the_drives(bench):
    bench.enable()
    bench.tick(5)
    bench.tick(1, skip=True)
    bench.tick(5)
    assert bench.fault == (DriveFault.NONE, -1)
    assert sum(drive.lost for drive in bench.group.drives) == 0


def test_a_drive_that_faults_is_named_and_can_be_reset_and_enabled_again(bench):
    bench.enable()
    bench.devices[3].inject(0x2310, bench.now_s)
    bench.tick(3)
    assert bench.fault == (DriveFault.EMCY, 3)
    assert bench.group.drives[3].emcy_code == 0x2310
    bench.group.want(Wanted.QUICK_STOP)
    bench.tick(100)
    bench.group.want(Wanted.RESET)
    bench.tick(10)
    assert bench.group.drives[3].state is State.SWITCH_ON_DISABLED
    bench.enable()
    assert bench.fault == (DriveFault.NONE, -1)


@pytest.mark.parametrize(("lost", "fault"), [(1, DriveFault.NONE), (2, DriveFault.FEEDBACK_LOST)])
def test_feedback_that_the_bus_loses_is_a_fault_from_the_second_on(bench, lost, fault):
    bench.enable()
    bench.tick(5)
    left = lost

    def tamper(_at_s, can_id, _frame):
        nonlocal left
        if can_id == 0x182 and left:
            left -= 1
            return ()
        return (0.0,)

    bench.bus.tamper = tamper
    bench.tick(lost + 1)
    assert bench.fault[0] is fault
    assert bench.group.drives[1].lost == lost


def test_a_drive_restarted_under_way_is_lost(bench):
    bench.enable()
    bench.service.send(pdo.frame(0x000, b"\x81\x02"))
    seen = []
    for _ in range(30):
        bench.tick()
        seen.append(bench.fault)
    assert (DriveFault.FEEDBACK_LOST, 1) in seen
    assert bench.fault == (DriveFault.NODE_RESET, 1)


def test_a_controller_that_was_bus_off_is_named_sends_nothing_and_joins_again_at_reset(bench):
    bench.enable()
    bench.tick(5)
    errors = bench.bus.errors
    errors.switch_off(bench.bus.masters, bench.now_s, restarts=False)
    seen = set()
    for _ in range(150):  # the drives stop by themselves meanwhile
        bench.tick()
        seen.add(bench.fault)
    assert seen == {(DriveFault.BUS_OFF, 0)}
    heard = []
    bench.bus.watch(pdo.SYNC, lambda _frame, at_s: heard.append(at_s))
    bench.group.want(Wanted.RESET)
    bench.tick(1)
    assert len(heard) <= 1  # what was queued meanwhile does not come out at once
    bench.tick(50)
    assert len(heard) >= 49
    bench.enable()
    assert bench.fault == (DriveFault.NONE, -1)
