"""The hub in wall clock: two processes, python-can and canopen as they come. No time is asserted."""

from __future__ import annotations

import argparse
import math
import select
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import canopen
import numpy as np
import pytest
from support.drives import hub_process
from support.drives.hub_guests import by_hub
from support.drives.stepped_drives import EDS, nodes

from drives import bus, commission, pdo
from drives.bench import options
from drives.bench.virtual import kernel_time
from drives.bench.virtual.fault_script import FaultScript, ScriptError
from drives.bench.virtual.hub import MAX_AHEAD_S, Hub
from drives.bench.virtual.hub_bus import HubBus
from drives.log import candump
from drives.log.frame_log import FrameLog
from drives.ports import hub_protocol
from drives.ports.hub_protocol import TIMED
from drives.settings import BusSettings, MasterSettings

FRAME_S = 0.001  # more than any takes
SOME = pdo.SERVICE_FILTERS


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[str, subprocess.Popen[bytes], Path]]:
    path, log = tmp_path / "can", tmp_path / "sync.npy"
    # A node that is still starting up sends a frame of its own accord, for which SYNC may have to wait.
    with hub_process.served(path, "--nodes", "1", "2", "--sync-log", str(log), nodes=(1, 2)) as process:
        yield str(path), process, log


def test_canopens_own_client_reads_and_writes_a_simulated_drive(
    served: tuple[str, subprocess.Popen[bytes], Path],
) -> None:
    network = canopen.Network(bus=HubBus(served[0]))
    network.connect()
    try:
        node = canopen.RemoteNode(1, EDS)
        network.add_node(node)
        node.sdo.RESPONSE_TIMEOUT = hub_process.ANSWER_S
        assert node.sdo[0x1000].raw == 0x20192
        assert node.sdo[0x1008].raw == "Directrix simulated drive, one axis, CiA 402"
        node.sdo[0x6065].raw = 4711
        assert node.sdo[0x6065].raw == 4711
        node.sdo[0x60C2][2].raw = -4
        assert node.sdo[0x60C2][2].raw == -4
        node.sdo.download(0x6065, 0, (99).to_bytes(4, "little"), force_segment=True)
        assert node.sdo[0x6065].raw == 99
        with pytest.raises(canopen.SdoAbortedError) as refused:
            node.sdo[0x605A].raw = 17
        assert refused.value.code == 0x06090031
    finally:
        network.disconnect()


def test_drives_behind_the_hub_are_commissioned_without_a_thread(
    served: tuple[str, subprocess.Popen[bytes], Path],
) -> None:
    port = bus.open(BusSettings("can", "virtual", served[0], 1_000_000), pdo.SERVICE_FILTERS)
    network = commission.Network(port, commission.wall_pump(port.fileno()), hub_process.ANSWER_S)
    commission.commission(network, nodes("XY"), MasterSettings())
    port.close()


def test_the_log_of_sync_is_written_at_sigterm(
    served: tuple[str, subprocess.Popen[bytes], Path],
) -> None:
    path, process, log = served
    settings = BusSettings("can", "virtual", path, 1_000_000)
    talker, listener = bus.open(settings), bus.open(settings)
    assert isinstance(talker, bus.HubSocket)
    begins_s = time.monotonic() + 0.05
    talker.keep()
    assert talker.send(pdo.frame(0x701))
    for n in range(20):
        talker.later(begins_s + 0.005 * n)
        assert talker.send(pdo.frame(pdo.SYNC))
    talker.hand_over()
    buffer, heard = bytearray(16), 0
    while heard < 20:
        commission.wall_pump(listener.fileno())()
        while listener.receive_into(buffer):
            heard += pdo.unpack(buffer)[0] == pdo.SYNC
    talker.close()
    listener.close()
    process.send_signal(signal.SIGTERM)
    process.wait(20)
    times_s = np.load(log)
    assert len(times_s) == 20
    assert np.diff(times_s) == pytest.approx(0.005, abs=1e-6), "the wire model's times, not the wake-ups'"


def test_python_can_frames_go_through_the_hub_unchanged(
    served: tuple[str, subprocess.Popen[bytes], Path],
) -> None:
    one, two = HubBus(served[0]), HubBus(served[0])
    try:
        sent = [
            can.Message(arbitration_id=0x333, data=b"\x01\x02\x03", is_extended_id=False),
            can.Message(arbitration_id=0x1ABCDEF0, data=bytes(8), is_extended_id=True),
            can.Message(arbitration_id=0x444, is_remote_frame=True, dlc=4, is_extended_id=False),
        ]
        for message in sent:
            one.send(message)
        got: list[can.Message] = []
        while len(got) < 3:
            message = two.recv(20.0)
            assert message is not None
            if message.arbitration_id < 0x700 or message.is_extended_id:
                got.append(message)
        assert all(any(a.equals(b, timestamp_delta=None) for b in got) for a in sent)
    finally:
        one.shutdown()
        two.shutdown()


class Watched(Hub):
    """It tells up to when everything has happened."""

    done_s = 0.0

    def turn(self, until_s: float) -> None:
        super().turn(until_s)
        self.done_s = self.bus.now_s


class InThread:
    """A hub of this process."""

    def __init__(self, folder: Path, bit_rate: int = 1_000_000, **options: object) -> None:
        self.path = str(folder / "here")
        self.hub = Watched(self.path, bit_rate, **options)  # type: ignore[arg-type]
        self._ends = False
        self._thread = threading.Thread(target=self.hub.run, args=(lambda: self._ends,))

    def __enter__(self) -> InThread:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends = True
        self._thread.join()
        self.hub.close()

    def port(self) -> bus.Port:
        return bus.open(BusSettings("can", "virtual", self.path, 1_000_000))

    def wait(self, met: Callable[[], bool]) -> None:
        until_s = time.monotonic() + 20.0
        while not met():
            assert time.monotonic() < until_s
            time.sleep(0.001)

    def settle(self) -> None:
        """Wait until everybody has been given what was counted: a frame counts when it begins."""
        end_s = time.monotonic() + FRAME_S
        self.wait(lambda: self.hub.done_s > end_s)


def test_a_hubs_path_is_there_when_it_can_be_joined_and_not_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "can"
    listen = socket.socket.listen

    def watched(own: socket.socket, backlog: int) -> None:
        assert not path.exists()
        listen(own, backlog)

    monkeypatch.setattr(socket.socket, "listen", watched)
    hub = Hub(str(path))
    HubBus(str(path)).shutdown()
    hub.close()
    assert list(tmp_path.iterdir()) == []


def test_a_client_that_does_not_read_is_told_how_many_frames_it_has_lost(tmp_path: Path) -> None:
    with InThread(tmp_path, bit_rate=0) as here:
        talker, sleeper = here.port(), here.port()
        sent = 0
        here.wait(lambda: len(here.hub._clients) == 2)
        joined = list(here.hub._clients.values())
        while not any(client.lost for client in joined):
            for _ in range(100):
                sent += talker.send(pdo.frame(0x181))
            here.wait(lambda sent=sent: here.hub.bus.frames == sent)  # type: ignore[misc]
        here.settle()
        buffer, got = bytearray(16), 0
        while sleeper.receive_into(buffer):
            got += 1
        assert sleeper.overflows == 0, "the word about it can only come when there is room again"
        talker.send(pdo.frame(0x182))
        here.wait(lambda: here.hub.bus.frames == sent + 1)
        here.wait(lambda: sleeper.receive_into(buffer))
        assert pdo.unpack(buffer)[0] == 0x182
        assert sleeper.overflows == sent - got > 0
        talker.close()
        sleeper.close()


def test_faults_and_a_log_are_the_hubs_own_matter(tmp_path: Path) -> None:
    log = FrameLog()
    script = FaultScript.read("at 0 s: drop 203 x 1\nat 0 s: falsify 204 byte 0 xor 80 x 1")
    with InThread(tmp_path, faults=script, log=log) as here:
        one, two = here.port(), here.port()
        here.wait(lambda: here.hub.bus.faults is not None and len(here.hub._clients) == 2)
        for n in range(2):
            assert one.send(pdo.frame(0x203, bytes([n])) + pdo.frame(0x204, bytes([n])))
            here.wait(lambda n=n: here.hub.bus.frames == 2 * n + 2)  # type: ignore[misc]
        here.settle()
        buffer, seen = bytearray(16), []
        while two.receive_into(buffer):
            seen.append(pdo.unpack(buffer))
        assert seen == [(0x204, b"\x80"), (0x203, b"\x01"), (0x204, b"\x01")]
        assert [pdo.unpack(frame) for _, frame in log.frames()] == seen
        one.close()
        two.close()


def test_the_masters_bus_off_leaves_the_other_clients_alone(tmp_path: Path) -> None:
    with InThread(tmp_path) as here:
        master, other = here.port(), here.port()
        here.wait(lambda: len(here.hub._clients) == 2)
        assert master.send(pdo.frame(0x80))
        here.wait(lambda: here.hub.bus.frames == 1)
        buffer = bytearray(16)
        here.wait(lambda: other.receive_into(buffer))
        hub_bus = here.hub.bus
        by_hub(here.hub, lambda: hub_bus.errors.switch_off(hub_bus.masters, hub_bus.now_s))
        here.wait(lambda: master.receive_into(buffer))
        assert pdo.unpack(buffer)[0] == pdo.ERROR_FLAG | 0x40
        master.send(pdo.frame(0x201))
        assert other.send(pdo.frame(0x181))
        here.wait(lambda: hub_bus.frames == 2)
        assert not other.receive_into(buffer)
        assert not master.receive_into(buffer)
        master.close()
        other.close()


def test_a_served_hub_takes_a_script_and_a_log_from_its_options(tmp_path: Path) -> None:
    (tmp_path / "script").write_text("at 0 s: drop 703\n")
    parser = argparse.ArgumentParser()
    options.add_options(parser)
    given = f"--faults {tmp_path}/script --log {tmp_path}/log"
    chosen = parser.parse_args(given.split())
    here = InThread(tmp_path)
    with options.equipped(here.hub, **vars(chosen)), here:
        port = here.port()
        assert port.send(pdo.frame(0x703, b"\x05") + pdo.frame(0x704, b"\x05"))
        here.wait(lambda: here.hub.bus.frames == 2)
        here.settle()
        port.close()
    ((at_s, _, frame),) = candump.read((tmp_path / "log").read_text().splitlines())
    assert pdo.unpack(frame)[0] == 0x704
    assert at_s > 1e9, "a candump log has wall-clock times"


def test_a_script_with_a_mistake_is_named_with_its_file(tmp_path: Path) -> None:
    (tmp_path / "script").write_text("\nat 0 s: dorp 703\n")
    with pytest.raises(ScriptError, match=r"script: line 2: 'dorp' is no fault"):
        options.read_script(tmp_path / "script")


def test_a_client_that_is_bus_off_joins_again_when_its_port_asks_for_it(tmp_path: Path) -> None:
    with InThread(tmp_path) as here:
        master, other = here.port(), here.port()
        here.wait(lambda: len(here.hub._clients) == 2)
        assert master.send(pdo.frame(0x80))
        buffer = bytearray(16)
        here.wait(lambda: other.receive_into(buffer))
        hub_bus = here.hub.bus
        by_hub(here.hub, lambda: hub_bus.errors.switch_off(hub_bus.masters, hub_bus.now_s))
        heard: list[int] = []

        def hears(can_id: int) -> bool:
            while master.receive_into(buffer):
                heard.append(pdo.unpack(buffer)[0])
            return can_id in heard

        here.wait(lambda: hears(pdo.ERROR_FLAG | 0x040))
        master.restart()
        here.wait(lambda: hears(pdo.ERROR_FLAG | 0x100))
        assert other.send(pdo.frame(0x181))
        here.wait(lambda: hears(0x181))
        master.close()
        other.close()


def test_a_port_whose_hub_has_ended_joins_the_next_one_at_its_place(tmp_path: Path) -> None:
    buffer = bytearray(16)
    with InThread(tmp_path) as here:
        port = here.port()
        here.wait(lambda: len(here.hub._clients) == 1)
    assert not port.receive_into(buffer)
    with InThread(tmp_path) as here:
        port.restart()
        here.wait(lambda: len(here.hub._clients) == 1)
        other = here.port()
        here.wait(lambda: len(here.hub._clients) == 2)
        assert other.send(pdo.frame(0x181))
        here.wait(lambda: port.receive_into(buffer))
        assert pdo.unpack(buffer)[0] == 0x181
        port.close()
        other.close()


def test_a_client_is_told_when_its_frames_did_not_fit_into_the_queue(tmp_path: Path) -> None:
    faults = FaultScript.read("at sync 2: queue_full master for 60 s")
    with InThread(tmp_path, faults=faults) as here:
        master = here.port()
        assert master.send(pdo.frame(0x80))  # who sends SYNC is the master
        assert master.send(pdo.frame(0x80))
        buffer = bytearray(16)

        def told() -> bool:
            master.send(pdo.frame(0x201))
            return master.receive_into(buffer)

        here.wait(told)
        can_id, data = pdo.unpack(buffer)
        assert (can_id, data[1]) == (pdo.ERROR_FLAG | 0x04, 0x02)
        master.close()


def test_a_port_hears_what_its_filters_let_through_and_nothing_else(tmp_path: Path) -> None:
    with InThread(tmp_path) as here:
        settings = BusSettings("can", "virtual", here.path, 1_000_000)
        talker, service = here.port(), bus.open(settings, pdo.SERVICE_FILTERS)
        here.wait(lambda: [client.many for client in here.hub._clients.values()] == [True, True])
        frames = [pdo.frame(can_id) for can_id in (0x080, 0x181, 0x201, 0x0C0, 0x581, 0x703)]
        assert talker.send(b"".join(frames))
        buffer, heard = bytearray(16), []

        def all_heard() -> bool:
            while service.receive_into(buffer):
                heard.append(pdo.unpack(buffer)[0])
            return heard[-1:] == [0x703]

        here.wait(all_heard)
        assert heard == [0x0C0, 0x581, 0x703]
        talker.close()
        service.close()


def test_who_takes_several_frames_gets_them_in_one_packet_and_a_log_gets_their_times(tmp_path: Path) -> None:
    hub = Hub(str(tmp_path / "can"))
    talker, many, log = (
        hub_protocol.connect(hub.path, first)
        for first in (hub_protocol.wishes(()), hub_protocol.wishes(()), hub_protocol.TIMES_FRAME)
    )
    frames = [bytes(pdo.frame(0x181 + n)) for n in range(3)]
    while len(hub._clients) < 3 or not all(one.many or one.timed for one in hub._clients.values()):
        hub.turn(time.monotonic())
    talker.send(b"".join(frames))
    while hub.bus.frames < 3 or hub.bus.next_event_s() < math.inf:
        hub.turn(time.monotonic())
    hub.close()
    got = b""
    while packet := many.recv(256):
        got += packet
    assert got == b"".join(frames)
    records = [one for packet in iter(lambda: log.recv(256), b"") for one in TIMED.iter_unpack(packet)]
    assert [frame for _, frame in records] == frames
    gaps = np.diff([at_s for at_s, _ in records])
    assert gaps == pytest.approx(hub.bus.frame_s(0x182, frames[1]), abs=5e-6), "the wire's times"
    for own in (talker, many, log):
        own.close()


@pytest.mark.parametrize(
    "now_s, looks_s, why",
    [
        (10.0001, 10.001, "the setpoints behind SYNC can wait until feedback is due"),
        (10.0015, 10.003, "and so can the next SYNC"),
        (10.0031, 0.0, "a SYNC that is late is taken when it comes"),
    ],
)
def test_in_a_rhythm_the_sender_of_sync_is_looked_at_once_a_period(
    tmp_path: Path, now_s: float, looks_s: float, why: str
) -> None:
    hub = Hub(str(tmp_path / "can"))
    port, other = (bus.open(BusSettings("can", "virtual", hub.path, 1_000_000)) for _ in range(2))
    while [client.many for client in hub._clients.values()] != [True, True]:
        hub.turn(time.monotonic())
    master, _ = hub._clients.values()
    assert hub._looks_s(10.0) == 0.0, "there is no rhythm yet"
    hub._alert_until_s = 0.0
    for at_s in (9.996, 9.998, 10.0):
        hub._keep_time(master, at_s)
    hub.bus.new_s = 10.0
    assert hub._looks_s(now_s) == pytest.approx(looks_s), why
    hub.bus.new_s = now_s - 1.0
    assert hub._looks_s(now_s) == pytest.approx(10.021 if looks_s else 0.0), "nothing new for a second"
    hub._alert_until_s = now_s + 1.0
    assert hub._looks_s(now_s) == 0.0, "somebody else speaks"
    hub._alert_until_s = 0.0
    device, frame = hub.bus.connect(lambda frame, at_s: None), bytes(pdo.frame(0x181))
    hub.bus.submit(device, hub.bus.now_s, 0x181, frame)
    assert hub._looks_s(now_s) == 0.0, "a device's frame is on its way"
    hub.bus.advance(hub.bus.now_s + FRAME_S)
    hub.bus.new_s = now_s - 1.0
    hub.bus.submit(device, hub.bus.now_s, 0x181, frame)
    assert hub._looks_s(now_s) == pytest.approx(10.021 if looks_s else 0.0), "it says the same once more"
    hub.bus.submit(device, hub.bus.now_s, 0x181, bytes(pdo.frame(0x181, b"\x01")))
    assert hub._looks_s(now_s) == 0.0, "it says something new"
    guest = HubBus(hub.path)
    while len(hub._clients) < 3 or hub.bus.frames < 1:
        hub.turn(time.monotonic())
    hub._alert_until_s = 0.0
    assert hub._looks_s(now_s) == 0.0, "a guest wants each frame when it comes"
    guest.shutdown()
    hub.close()
    port.close()
    other.close()


def test_a_hub_that_was_held_back_takes_what_there_was_room_for_when_it_was_sent(tmp_path: Path) -> None:
    hub = Hub(str(tmp_path / "can"))
    port = bus.open(BusSettings("can", "virtual", hub.path, 1_000_000))
    while not hub._clients:
        hub.turn(time.monotonic())
    packets = 30
    for _ in range(packets):  # 300 frames, more than a queue holds, and the wire's time for them between
        assert port.send(bytes(pdo.frame(0x201)) * 10)
        time.sleep(0.002)
    while hub.bus.frames < 10 * packets:
        hub.turn(time.monotonic())
    buffer = bytearray(16)
    assert not port.receive_into(buffer), "nothing was refused"
    port.close()
    hub.close()


def test_what_is_handed_over_while_the_hub_is_at_work_goes_out_when_it_was_handed_over(
    tmp_path: Path,
) -> None:
    hub = Hub(str(tmp_path / "can"))
    port = bus.open(BusSettings("can", "virtual", hub.path, 1_000_000))
    while not hub._clients:
        hub.turn(time.monotonic())
    near, far = socket.socketpair()
    sent_s: list[float] = []

    def keeps_it_long() -> None:
        near.recv(1)
        assert port.send(bytes(pdo.frame(pdo.SYNC)))
        sent_s.append(time.monotonic())
        time.sleep(0.05)

    hub.listen(near.fileno(), keeps_it_long)
    far.send(b"x")
    while not len(hub.syncs.times_s()):
        hub.turn(time.monotonic() + 1.0)
    assert hub.syncs.times_s()[0] < sent_s[0] + 0.02, "not when that work was over"
    near.close()
    far.close()
    port.close()
    hub.close()


def test_a_hub_kept_from_the_processor_once_it_is_awake_moves_no_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It wakes for an event of its own, and before it reads the clock others run: one of them sends SYNC."""
    hub = Hub(str(tmp_path / "can"))
    port = bus.open(BusSettings("can", "virtual", hub.path, 1_000_000))
    while [client.many for client in hub._clients.values()] != [True]:
        hub.turn(time.monotonic())
    around_s: list[float] = []

    def kept(*arguments: object, inner: Callable[..., object] = select.select) -> object:
        found = inner(*arguments)
        if not around_s:
            around_s.append(time.monotonic())
            assert port.send(pdo.frame(pdo.SYNC))
            around_s.append(time.monotonic())
            time.sleep(0.05)
        return found

    monkeypatch.setattr(kernel_time.select, "select", kept)
    hub.turn(time.monotonic())
    monkeypatch.undo()
    while not len(hub.syncs.times_s()):
        hub.turn(time.monotonic() + 0.01)
    taken_s = hub.bus.frame_s(pdo.SYNC, bytes(pdo.frame(pdo.SYNC)))
    assert around_s[0] <= hub.syncs.times_s()[0] - taken_s <= around_s[1] + kernel_time.AT_ONCE_S
    port.close()
    hub.close()


def test_a_port_hears_data_frames_of_11_bits_as_on_socketcan(tmp_path: Path) -> None:
    hub = Hub(str(tmp_path / "can"))
    settings = BusSettings("can", "virtual", hub.path, 1_000_000)
    talker, hears, all_ears = (bus.open(settings, filters) for filters in (((0, 0),), SOME, ((0, 0),)))
    said = [0x701 | pdo.REMOTE_FLAG, 0x701 | pdo.EXTENDED_FLAG, 0x701]
    for can_id in said:
        assert talker.send(pdo.frame(can_id, b"\5"))
    while hub.bus.frames < len(said):
        hub.turn(time.monotonic())
    hub.turn(time.monotonic() + 0.01)
    for port, wanted in ((hears, {0x701}), (all_ears, set(said))):
        buffer, heard = bytearray(pdo.FRAME_BYTES), set()
        while port.receive_into(buffer):
            heard.add(pdo.unpack(buffer)[0])
        assert heard == wanted
        port.close()
    talker.close()
    hub.close()


def test_sync_said_ahead_is_waited_for_and_no_longer(tmp_path: Path) -> None:
    hub = Hub(str(tmp_path / "can"))
    port = bus.open(BusSettings("can", "virtual", hub.path, 1_000_000))
    while [client.many for client in hub._clients.values()] != [True]:
        hub.turn(time.monotonic())
    (master,) = hub._clients.values()
    hub._alert_until_s = 0.0
    for n in range(20):
        hub._keep_time(master, 10.0 + 0.002 * n)
    hub.bus.new_s = 9.0
    for now_s in (10.001, 10.037):
        assert hub._looks_s(now_s) == pytest.approx(10.038 + 0.005), "nobody speaks before 10.04"
    assert hub._looks_s(10.042) == 0.0, "what comes late is taken when it comes"
    hub.bus.new_s = 10.0
    assert hub._looks_s(10.001) == pytest.approx(10.039), "what is new is there before the tick looks"
    hub.close()
    port.close()


def test_what_is_said_ahead_of_its_time_begins_when_it_is_due(tmp_path: Path) -> None:
    hub = Hub(str(tmp_path / "can"))
    port = bus.HubSocket(hub_protocol.connect(hub.path, hub_protocol.wishes(())), "can0")
    while not hub._clients:
        hub.turn(time.monotonic())
    before_s = time.monotonic()
    due_s = (before_s + 0.05, before_s + 0.1)
    port.keep()
    assert port.send(pdo.frame(pdo.SYNC))
    for at_s in due_s:
        port.later(at_s)
        assert port.send(pdo.frame(pdo.SYNC))
    port.hand_over()
    while len(hub.syncs.times_s()) < 1 + len(due_s):
        hub.turn(time.monotonic() + 1.0)
    times_s = hub.syncs.times_s()
    wire_s = times_s[1:] - due_s
    assert np.ptp(wire_s) < 2e-6 and 0.0 < wire_s.min() < 200e-6, (
        "by the wire's clock, whenever they are read"
    )
    assert hub._sync_s == pytest.approx(due_s[-1], abs=1e-6), "until then nobody speaks"
    hub.bus.new_s = due_s[-1] - 1.0
    assert hub._looks_s(due_s[0]) == 0.0, "a rhythm of 50 ms is none to wait for"
    port.keep()
    for at_s in (time.monotonic(), time.monotonic() + 4000.0):
        port.later(at_s)
        assert port.send(pdo.frame(pdo.SYNC))
    port.hand_over()
    hub.turn(time.monotonic())
    assert hub.bus.next_event_s() <= time.monotonic() + MAX_AHEAD_S, "nobody fills a queue for ever"
    port.close()
    hub.close()
