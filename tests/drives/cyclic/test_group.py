"""The group on ports that are plain lists: what goes out in which order, and what is judged."""

import gc
import tracemalloc
from dataclasses import replace

import pytest

from drives import pdo
from drives.cia402 import Wanted
from drives.cyclic.drive import Drive, DriveFault
from drives.cyclic.following_error import MEASURE_EVERY
from drives.cyclic.group import MAX_FRAMES, Group
from drives.cyclic.io_node import IoNode
from drives.cyclic.spindle import SpindleDrive
from drives.load.stuffing import worst_bits
from drives.profile import GENERIC, Supervision
from drives.settings import IoSettings, MasterSettings, NodeSettings, SpindleSettings

OE_FOLLOWS = 0x1237
T = 0.002


class ListPort:
    """A port that keeps what is sent and hands out what was put in."""

    def __init__(self, packs=False):
        self.packs = packs
        self.incoming = []
        self.outgoing = []
        self.refuse = False
        self.overflows = 0
        self.restarts = 0

    def send(self, frame):
        if self.refuse:
            return False
        packet = bytes(frame)
        self.outgoing += [pdo.unpack(packet[i : i + 16]) for i in range(0, len(packet), 16)]
        return True

    def receive_into(self, buffer):
        if not self.incoming:
            return False
        buffer[:16] = self.incoming.pop(0)
        return True

    def close(self):
        pass

    def restart(self):
        self.restarts += 1

    def feedback(self, nodes, statusword=OE_FOLLOWS, position=100):
        for node in nodes:
            self.incoming.append(pdo.frame(0x180 + node, pdo.FEEDBACK.pack(statusword, position + node)))


def five(port, buses=("can0",) * 5):
    nodes = [
        NodeSettings(name, bus, i + 1, "a.eds")
        for i, (name, bus) in enumerate(zip("XYZAC", buses, strict=True))
    ]
    ports = port if isinstance(port, dict) else {"can0": port}
    return Group([Drive(node) for node in nodes], ports, MasterSettings(period_s=T))


def running(port, **kind):
    """A group whose five drives follow, at now = 0."""
    group = five(port, **kind)
    group.want(Wanted.ENABLED)
    port.feedback(range(1, 6))
    group.receive(0.0)
    assert group.following()
    return group


def tick(group, port, now_s, answering=range(1, 6), setpoints=(1, 2, 3, 4, 5)):
    group.receive(now_s)
    group.sync(now_s)
    group.command(setpoints, now_s)
    port.feedback(answering)


@pytest.mark.parametrize("packs", [False, True])
def test_sync_goes_out_before_the_setpoints_and_the_heartbeat_after_them(packs):
    port = ListPort(packs)
    group = running(port)
    assert group.sync(0.0)
    assert group.command((10, 20, 30, 40, -50), 0.0)
    ids = [can_id for can_id, _ in port.outgoing]
    assert ids == [0x80, 0x201, 0x202, 0x203, 0x204, 0x205, 0x77F]
    assert [pdo.COMMAND.unpack(data) for _, data in port.outgoing[1:6]] == [
        (0x0F, 10), (0x0F, 20), (0x0F, 30), (0x0F, 40), (0x0F, -50)
    ]  # fmt: skip
    assert port.outgoing[6][1] == b"\x05"


def test_our_heartbeat_comes_once_per_its_period():
    port = ListPort()
    group = running(port)
    for i in range(100):  # 0.2 s at 0.05 s
        tick(group, port, i * T)
    assert sum(can_id == 0x77F for can_id, _ in port.outgoing) == 4


def test_positions_are_those_of_the_drives_in_their_order():
    port = ListPort()
    assert running(port).positions == [101, 102, 103, 104, 105]


def test_one_drive_silent_for_two_syncs_is_named():
    port = ListPort()
    group = running(port)
    tick(group, port, 0.0)
    tick(group, port, T, answering=(1, 2, 4, 5))
    tick(group, port, 2 * T, answering=(1, 2, 4, 5))
    assert group.fault(2 * T) == (DriveFault.NONE, -1)
    group.receive(3 * T)
    assert group.fault(3 * T) == (DriveFault.FEEDBACK_LOST, 2)


def test_skipped_syncs_owe_nothing():
    port = ListPort()
    group = running(port)
    tick(group, port, 0.0)
    for i in range(1, 10):
        group.receive(i * T)
    assert group.fault(9 * T) == (DriveFault.NONE, -1)
    assert sum(drive.lost for drive in group.drives) == 0


def test_a_refused_setpoint_is_a_value_and_names_its_drive():
    port = ListPort()
    group = running(port)
    assert not group.command((1, 2, 2**31, 4, 5), 0.0)
    assert group.fault(0.0) == (DriveFault.SEND_FAILED, 2)


@pytest.mark.parametrize("packs", [False, True])
def test_a_full_queue_is_a_fault_and_no_exception(packs):
    port = ListPort(packs)
    group = running(port)
    port.refuse = True
    assert not group.sync(0.0)
    assert not group.command((1, 2, 3, 4, 5), 0.0)
    assert group.fault(0.0)[0] is DriveFault.SEND_FAILED
    group.receive(T)
    assert group.fault(T)[0] is DriveFault.SEND_FAILED  # and no feedback was owed
    group.want(Wanted.RESET)
    port.refuse = False
    group.want(Wanted.ENABLED)
    assert group.fault(T) == (DriveFault.NONE, -1)


def test_a_second_sync_producer_is_named():
    port = ListPort()
    group = running(port)
    port.incoming.append(pdo.frame(0x80))
    group.receive(T)
    assert group.fault(T) == (DriveFault.SYNC_FOREIGN, 0)
    assert group.foreign_syncs == 1


ERROR_FRAMES = [
    (0x040, 0x00, DriveFault.BUS_OFF, "bus-off"),
    (0x100, 0x00, DriveFault.BUS_OFF, "restarted: it had been off"),
    (0x044, 0x20, DriveFault.BUS_OFF, "bus-off and passive in one frame"),
    (0x004, 0x20, DriveFault.BUS_ERROR, "error passive in sending"),
    (0x004, 0x10, DriveFault.BUS_ERROR, "error passive in receiving"),
    (0x204, 0x20, DriveFault.BUS_ERROR, "error passive, with counters"),
    (0x004, 0x02, DriveFault.BUS_ERROR, "transmit overflow"),
    (0x004, 0x01, DriveFault.RX_OVERFLOW, "the controller's receive overflow"),
    (0x004, 0x0C, DriveFault.NONE, "error warnings"),
    (0x004, 0x40, DriveFault.NONE, "error active again"),
    (0x008, 0x00, DriveFault.NONE, "one violation on the wire: sent again by the controller"),
    (0x002, 0x05, DriveFault.NONE, "lost arbitration"),
    (0x008, 0x21, DriveFault.NONE, "a violation: this byte is the controller's only in a frame of its class"),
]


@pytest.mark.parametrize(("kind", "detail", "fault", "reason"), ERROR_FRAMES)
def test_error_frames_of_the_controller(kind, detail, fault, reason):
    port = ListPort()
    group = running(port)
    port.incoming.append(pdo.frame(0x2000_0000 | kind, bytes([0, detail, 0, 0, 0, 0, 0, 0])))
    group.receive(T)
    assert group.fault(T)[0] is fault, reason


def error_frame(kind, detail=0):
    return pdo.frame(0x2000_0000 | kind, bytes([0, detail, 0, 0, 0, 0, 0, 0]))


def test_bus_off_outranks_the_error_passive_that_led_to_it():
    port = ListPort()
    group = running(port)
    port.incoming += [error_frame(0x004, 0x20), error_frame(0x040)]
    group.receive(T)
    assert group.fault(T) == (DriveFault.BUS_OFF, 0)


@pytest.mark.parametrize(
    ("sign", "reason"),
    [
        (error_frame(0x100), "the controller says that it was restarted"),
        (pdo.frame(0x701, b"\x05"), "a heartbeat comes in again"),
    ],
)
def test_a_bus_that_is_off_gets_no_setpoints_that_would_come_out_at_its_restart(sign, reason):
    port = ListPort()
    group = running(port)
    port.incoming.append(error_frame(0x040))
    tick(group, port, T, answering=())
    for i in range(2, 60):
        assert not group.sync(i * T)
        assert not group.command((1, 2, 3, 4, 5), i * T)
    assert {can_id for can_id, _ in port.outgoing} == {0x77F}, "the heartbeat asks whether it is over"
    port.incoming.append(sign)
    group.receive(60 * T)
    assert group.sync(60 * T), reason
    assert group.command((1, 2, 3, 4, 5), 60 * T)
    assert group.fault(60 * T) == (DriveFault.BUS_OFF, 0), "it stays the fault until reset"
    group.want(Wanted.RESET)
    group.want(Wanted.ENABLED)
    assert group.fault(60 * T)[0] is not DriveFault.BUS_OFF


def test_a_reset_asks_the_port_of_a_bus_that_is_off_to_join_again():
    port = ListPort()
    group = running(port)
    group.want(Wanted.RESET)
    assert port.restarts == 0
    port.incoming.append(error_frame(0x040))
    group.receive(T)
    group.want(Wanted.RESET)
    assert port.restarts == 1
    assert group.sync(T)
    group.want(Wanted.ENABLED)
    port.incoming.append(error_frame(0x100))  # its word that it has done so
    group.receive(2 * T)
    assert group.fault(2 * T) == (DriveFault.NONE, -1)
    port.incoming.append(error_frame(0x100))  # nobody has asked for this one
    group.receive(3 * T)
    assert group.fault(3 * T) == (DriveFault.BUS_OFF, 0)


def test_a_reset_joins_a_hub_again_that_has_ended():
    port = ListPort()
    group = running(port)
    port.gone = True
    group.want(Wanted.RESET)
    assert port.restarts == 1


def test_error_frames_are_counted_and_a_port_need_not_take_packets():
    port = ListPort()
    del port.packs
    (line,) = running(port).lines
    assert (line.errors, line.off, line.packs, line.bus) == (0, False, False, "can0")
    for count in (1, 2):
        port.incoming.append(error_frame(0x008))
        line.drain(T)
        assert line.errors == count


def test_frames_lost_in_the_receive_queue_are_named():
    port = ListPort()
    port.overflows = 7  # before the group was there
    group = running(port)
    assert group.fault(0.0) == (DriveFault.NONE, -1)
    port.overflows += 1
    group.receive(T)
    assert group.fault(T) == (DriveFault.RX_OVERFLOW, 0)
    group.want(Wanted.RESET)
    group.want(Wanted.ENABLED)
    group.receive(2 * T)
    assert group.fault(2 * T) == (DriveFault.NONE, -1)
    assert [line.lost for line in group.lines] == [1]


def test_a_controller_s_word_about_lost_frames_is_counted_too():
    port = ListPort()
    group = running(port)
    (line,) = group.lines
    for detail in (0x01, 0x20, 0x01):
        port.incoming.append(error_frame(0x004, detail))
    port.overflows += 5
    group.receive(T)
    assert line.lost == 7
    group.want(Wanted.RESET)
    group.receive(2 * T)
    assert line.lost == 7, "a reset forgets the fault alone"


def test_spindle_and_io_alone_on_a_bus_get_heartbeat_and_sync_there():
    ports = {"can0": ListPort(packs=True), "can1": ListPort(packs=True)}
    group = Group(
        [Drive(NodeSettings("X", "can0", 1, ""))],
        ports,
        MasterSettings(period_s=T),
        SpindleDrive(SpindleSettings("S", "can1", 10, "", 4000.0)),
        [IoNode(IoSettings("panel", "can1", 20, ""))],
    )
    group.sync(0.0)
    group.command((0,), 0.0)
    assert [i for i, _ in ports["can0"].outgoing] == [0x80, 0x201, 0x77F]
    assert [i for i, _ in ports["can1"].outgoing] == [0x80, 0x20A, 0x214, 0x77F]
    group.want(Wanted.ENABLED)
    ports["can1"].incoming.append(error_frame(0x040))
    group.receive(T)
    assert group.fault(T) == (DriveFault.BUS_OFF, -1)


def test_frames_of_nobody_are_passed_over():
    port = ListPort()
    group = running(port)
    for can_id in (0x581, 0x601, 0x000, 0x186, 0x8000_0181, 0x4000_0181, 0x7E4):
        port.incoming.append(pdo.frame(can_id, b"\xff" * 6))
    group.receive(T)
    assert group.positions == [101, 102, 103, 104, 105]
    assert group.fault(T) == (DriveFault.NONE, -1)


def test_a_length_beyond_eight_does_not_raise():
    port = ListPort()
    group = running(port)
    port.incoming.append(pdo.FRAME.pack(0x181, 255, b"\xff" * 8))
    group.receive(T)
    assert group.drives[0].malformed == 1


def test_a_babbling_bus_does_not_hold_the_tick():
    port = ListPort()
    group = running(port)
    port.incoming = [pdo.frame(0x700, b"\x05")] * (MAX_FRAMES + 7)
    group.receive(T)
    assert len(port.incoming) == 7


def test_two_buses_get_a_sync_each_and_their_own_drives():
    ports = {"can0": ListPort(packs=True), "can1": ListPort(packs=True)}
    group = five(ports, buses=("can0", "can1", "can0", "can1", "can0"))
    group.sync(0.0)
    group.command((1, 2, 3, 4, 5), 0.0)
    assert [i for i, _ in ports["can0"].outgoing] == [0x80, 0x201, 0x203, 0x205, 0x77F]
    assert [i for i, _ in ports["can1"].outgoing] == [0x80, 0x202, 0x204, 0x77F]
    group.want(Wanted.ENABLED)
    ports["can1"].incoming.append(pdo.frame(0x2000_0040, bytes(8)))
    group.receive(T)
    assert group.fault(T) == (DriveFault.BUS_OFF, 1)


def test_a_tick_keeps_no_memory():
    port = ListPort(packs=True)
    group = running(port)
    for i in range(50):
        tick(group, port, i * T)
    port.outgoing.clear()
    gc.collect()
    tracemalloc.start()
    try:
        before = tracemalloc.take_snapshot()
        for i in range(50, 550):
            tick(group, port, i * T)
        port.outgoing.clear()
        after = tracemalloc.take_snapshot()
    finally:
        tracemalloc.stop()
    files = ("drive", "group", "line", "power_stage", "supervised")
    ours = [tracemalloc.Filter(True, f"*/drives/{file}.py") for file in files]
    grown = sum(
        s.size_diff for s in after.filter_traces(ours).compare_to(before.filter_traces(ours), "filename")
    )
    assert grown < 2000  # the last numbers, not five hundred ticks of them


def test_before_anything_is_heard_or_wanted_nothing_is_told_and_nothing_wrong():
    port = ListPort()
    group = five(port)
    assert (group.positions, group.wanted) == ([0] * 5, Wanted.OFF)
    port.incoming.append(pdo.frame(0x80))
    group.receive(0.0)
    assert group.fault(0.0) == (DriveFault.NONE, -1)


def test_what_is_wrong_with_a_bus_stays_until_reset_or_enabled_anew_and_counts_while_drives_are_to_work():
    port = ListPort()
    group = running(port)
    port.incoming.append(pdo.frame(0x80))
    group.receive(T)
    wrong, fine = (DriveFault.SYNC_FOREIGN, 0), (DriveFault.NONE, -1)
    for wanted, found in (
        (Wanted.ENABLED, wrong),
        (Wanted.QUICK_STOP, wrong),
        (Wanted.OFF, fine),
        (Wanted.QUICK_STOP, wrong),
        (Wanted.ENABLED, fine),
    ):
        group.want(wanted)
        assert group.fault(T) == found


def crowded(ports):
    """Two buses with all that talks: guarded, with feed-forward, a spindle, analogue outputs."""
    guards = replace(GENERIC, supervision=Supervision.GUARDING)
    return Group(
        [
            Drive(NodeSettings("X", "can0", 1, "")),
            Drive(NodeSettings("Y", "can1", 2, "", feed_forward=True)),
            Drive(NodeSettings("Z", "can1", 3, "", profile=guards)),
        ],
        ports,
        MasterSettings(period_s=T),
        SpindleDrive(SpindleSettings("S", "can1", 10, "", 4000.0)),
        [IoNode(IoSettings("panel", "can1", 20, "", analogue=(0, 5)))],
    )


@pytest.mark.parametrize("packs", [False, True])
def test_the_bits_of_every_frame_sent_and_heard_are_counted_on_its_bus(packs):
    ports = {name: ListPort(packs) for name in ("can0", "can1")}
    group = crowded(ports)
    group.sync(0.0)
    group.command((0, 0, 0), 0.0)
    kinds = {can_id for can_id, _ in ports["can1"].outgoing}
    assert kinds == {0x80, 0x202, 0x302, 0x203, 0x20A, 0x214, 0x314, 0x77F, pdo.REMOTE_FLAG | 0x703}
    assert [line.bits for line in crowded(ports).lines] == [0, 0]
    for line in group.lines:
        sent = ports[line.bus].outgoing
        remote = pdo.REMOTE_FLAG
        assert line.bits == sum(worst_bits(0 if can_id & remote else len(data)) for can_id, data in sent)
    before = group.lines[0].bits
    ports["can0"].incoming = [pdo.frame(0x701, b"\x05"), pdo.frame(0x123, bytes(8))]
    group.receive(T)
    assert group.lines[0].bits - before == worst_bits(1) + worst_bits(8)


@pytest.mark.parametrize("packs", [False, True])
@pytest.mark.parametrize(("bus", "first"), [("can0", 0), ("can1", 1)])
def test_a_bus_that_takes_no_frame_is_named_by_its_first_drive(bus, first, packs):
    ports = {name: ListPort(packs) for name in ("can0", "can1")}
    group = crowded(ports)
    group.want(Wanted.ENABLED)
    ports[bus].refuse = True
    assert group.sync(0.0) is False
    assert group.fault(0.0) == (DriveFault.SEND_FAILED, first)


@pytest.mark.parametrize("taken", [0x201, 0x20A, 0x77F, pdo.REMOTE_FLAG | 0x703, None])
def test_each_frame_that_does_not_go_out_is_told(taken):
    ports = {"can0": ListPort(), "can1": ListPort()}
    group = crowded(ports)
    group.want(Wanted.ENABLED)
    for line in group.lines:
        line.send = lambda frame, send=line.send: pdo.unpack(frame)[0] != taken and send(frame)
    assert group.command((0, 0, 0), 0.0) is (taken is None)
    first = {None: (DriveFault.NONE, -1), 0x201: (DriveFault.SEND_FAILED, 0)}
    assert group.fault(0.0) == first.get(taken, (DriveFault.SEND_FAILED, 1))


def test_a_bus_that_is_off_makes_a_tick_incomplete():
    port = ListPort()
    group = running(port)
    port.incoming.append(error_frame(0x040))
    group.receive(T)
    assert group.sync(T) is False and group.command((1, 2, 3, 4, 5), T) is False


def test_what_is_wrong_with_one_drive_can_be_asked_for_whatever_else_is_wrong():
    port = ListPort()
    group = running(port)
    for node in (2, 4):
        port.incoming.append(pdo.frame(0x700 + node, b"\x05"))
    group.receive(0.0)
    now_s = group.master.consumer_s + T
    port.incoming.append(pdo.frame(0x704, b"\x05"))
    group.receive(now_s)
    for asked in (group.fault_of, group.out_of_sight):
        found = [asked(i, now_s) for i in range(5)]
        assert found == [DriveFault.HEARTBEAT_LOST if i == 1 else DriveFault.NONE for i in range(5)]
        assert asked(1, T) is DriveFault.NONE


def test_each_drive_is_measured_once_in_so_many_syncs_and_not_all_in_one():
    port = ListPort()
    group = running(port)
    measured = []
    for drive in group.drives:
        drive.measure = lambda name=drive.settings.name: measured.append(name)
    ticks = []
    for i in range(MEASURE_EVERY):
        before = len(measured)
        tick(group, port, i * T)
        ticks.append(len(measured) - before)
    assert sorted(measured) == ["A", "C", "X", "Y", "Z"] and max(ticks) == 2


def test_a_bus_that_is_off_keeps_no_setpoint_from_the_drives_of_another():
    ports = {"can0": ListPort(), "can1": ListPort()}
    group = five(ports, buses=("can0", "can1", "can0", "can1", "can0"))
    ports["can0"].incoming.append(error_frame(0x040))
    group.receive(0.0)
    assert not group.command((1, 2, 3, 4, 5), 0.0)
    assert [i for i, _ in ports["can0"].outgoing] == [0x77F]
    assert [i for i, _ in ports["can1"].outgoing] == [0x202, 0x204, 0x77F]


def test_our_heartbeat_is_due_with_its_period_and_before_a_frame_was_sent_nothing_is_wrong():
    port = ListPort()
    group = five(port)
    group.want(Wanted.QUICK_STOP)
    assert group.fault(0.0) == (DriveFault.NONE, -1)
    for now_s in (0.0, group.master.heartbeat_s):
        port.outgoing.clear()
        group.command((0,) * 5, now_s)
        assert port.outgoing[-1] == (0x77F, b"\x05")


def test_a_late_tick_takes_the_answers_sync_by_sync_and_leaves_those_to_the_newest_one() -> None:
    port = ListPort()
    group = five(port)
    for count in range(1, 4):
        port.feedback((1, 2, 3, 4, 5), position=1000 * count)
        port.incoming.append(pdo.frame(pdo.HEARTBEAT + 1, bytes([pdo.NMT_OPERATIONAL])))
    seen = []
    for _ in range(2):
        for line in group.lines:
            line.expect()
        assert group.receive_answers(1.0, 3)
        seen.append(group.positions[0])
    for line in group.lines:
        line.expect()
    group.receive(1.0, 1, late=True)
    assert [*seen, group.positions[0]] == [1001, 2001, 3001]
    assert all(drive.lost == drive.again == 0 for drive in group.drives)
    assert not group.receive_answers(1.0, 3) and all(drive.lost == 0 for drive in group.drives)
    port.feedback((1, 2, 3, 4, 5), position=4000)
    port.feedback((1, 2, 3, 4, 5), position=5000)
    for line in group.lines:
        line.expect()
    group.receive(1.0, 1, late=True)  # the tick is late, and the newest SYNC has been answered
    assert group.positions == [4001, 4002, 4003, 4004, 4005]
    for line in group.lines:
        line.expect()
    group.receive(1.0)
    assert group.positions[4] == 5005 and all(drive.lost == 0 for drive in group.drives)


def test_where_one_drive_has_not_answered_the_others_answers_to_the_next_sync_are_not_taken() -> None:
    port = ListPort()
    group = five(port)
    port.feedback((1, 2, 4, 5), position=1000)
    port.feedback((1, 2, 3, 4, 5), position=2000)
    for line in group.lines:
        line.expect()
    assert group.receive_answers(1.0, 2)
    assert group.positions[:2] == [1001, 1002]
    # Of two answers the first is held against the SYNC that it may answer: that one was lost shows one later.
    for line in group.lines:
        line.expect()
    group.receive(1.0)
    assert group.positions == [2001, 2002, 2003, 2004, 2005]
    assert sum(drive.lost for drive in group.drives) == 1
