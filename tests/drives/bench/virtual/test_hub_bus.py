"""python-can on the virtual bus: guests in a hurry, frames that it does not carry. No time is asserted."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import can
import pytest
from support.drives.hub_guests import TIMEOUT_S, Served, by_hub, heard, same, serving, until

from drives.bench.virtual.fault_script import FaultScript
from drives.bench.virtual.hub import Hub
from drives.bench.virtual.hub_bus import HubBus

MANY = 5000
WAITING = 400  # more than fit into a queue; at 10 kbit/s they take 3 s
ROOT = Path(__file__).parents[4]
PLAIN = can.Message(arbitration_id=0x123, data=b"\x11", is_extended_id=False)
FD = can.Message(arbitration_id=0x124, data=bytes(12), is_fd=True, is_extended_id=False)


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    with serving(tmp_path) as made:
        yield made


def numbered(n: int) -> can.Message:
    return can.Message(arbitration_id=0x100 + n % 512, data=n.to_bytes(2, "little"), is_extended_id=False)


def numbers_on(hub: Hub) -> list[int]:
    """Numbers of what goes over the wire from now on, as it comes."""
    found: list[int] = []
    bus = hub.bus
    by_hub(
        hub, lambda: bus.watch_all(lambda frame, _at_s: found.append(int.from_bytes(frame[8:10], "little")))
    )
    return found


def installed(folder: Path) -> dict[str, str]:
    """The environment of a process for which the package is installed, with the plugins it declares."""
    plugins = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    made = folder / "directrix-0.dist-info"
    made.mkdir()
    (made / "METADATA").write_text("Metadata-Version: 2.1\nName: directrix\nVersion: 0\n")
    lines = [
        f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in ways.items()) for group, ways in plugins.items()
    ]
    (made / "entry_points.txt").write_text("\n".join(lines))
    return {**os.environ, "PYTHONPATH": os.pathsep.join((str(folder), str(ROOT)))}


def test_python_can_finds_the_virtual_bus_by_the_name_of_its_plugin(served: Served, tmp_path: Path) -> None:
    tool = (
        "import can, sys\n"
        "bus = can.Bus(interface='directrix', channel=sys.argv[1], bitrate=1_000_000)\n"
        "bus.send(can.Message(arbitration_id=0x123, data=b'\\x11', is_extended_id=False))\n"
        "assert bus.recv(20.0).arbitration_id == 0x124\n"
        "bus.shutdown()\n"
    )
    native = served.native()
    process = subprocess.Popen(
        [sys.executable, "-c", tool, served.path], env=installed(tmp_path), cwd=tmp_path
    )
    assert [m.arbitration_id for m in heard(native, 1)] == [0x123]
    native.send(can.Message(arbitration_id=0x124, is_extended_id=False))
    assert process.wait(TIMEOUT_S) == 0
    native.shutdown()


# -- who sends faster than the bus carries


def test_5000_frames_of_a_fast_loop_are_all_on_the_bus_once(served: Served) -> None:
    found, guest = numbers_on(served.hub), served.native()
    for n in range(MANY):
        guest.send(numbered(n))
    until(lambda: len(found) >= MANY)
    assert sorted(found) == list(range(MANY))
    guest.shutdown()


def test_what_does_not_fit_within_the_time_out_is_an_exception_and_the_rest_arrives(tmp_path: Path) -> None:
    with serving(tmp_path, bit_rate=20_000) as slow:
        guest, found = slow.native(), numbers_on(slow.hub)
        taken, refused = [], 0
        for n in range(2000):
            try:
                guest.send(numbered(n), timeout=0.0)
                taken.append(n)
            except can.CanOperationError as refusal:
                assert "queue is full" in str(refusal)
                refused += 1
        assert refused > 0
        until(lambda: len(found) >= len(taken))
        assert sorted(found) == taken
        guest.shutdown()


def test_what_was_taken_goes_out_after_its_sender_has_left(served: Served) -> None:
    guest, found = served.native(), numbers_on(served.hub)
    for n in range(1000):
        guest.send(numbered(n))
    guest.shutdown()
    until(lambda: len(found) >= 1000)
    assert sorted(found) == list(range(1000))
    until(lambda: not served.hub._clients)


def test_a_guest_that_waits_does_not_hold_up_another(tmp_path: Path) -> None:
    with serving(tmp_path, bit_rate=10_000) as slow:
        busy, other, found = slow.native(), slow.native(), numbers_on(slow.hub)
        for n in range(WAITING):
            busy.send(numbered(n))
        other.send(can.Message(arbitration_id=0x001, data=b"\xff\xff", is_extended_id=False))
        until(lambda: 0xFFFF in found)
        assert len(found) < WAITING - 100, "it has the highest priority, and its own queue is empty"
        busy.shutdown()
        other.shutdown()


def test_a_queue_that_takes_nothing_is_told_by_an_error_frame(served: Served) -> None:
    guest, bus = served.native(), served.hub.bus
    guest.send(can.Message(arbitration_id=0x080, is_extended_id=False))  # who sends SYNC is the master
    # A frame counts when it begins; whose SYNC it was is known when it has arrived.
    until(lambda: bus.masters is not bus.controller)
    script = FaultScript.read("at 0 s: queue_full master for 60 s")
    by_hub(served.hub, lambda: script.inject(bus, bus.now_s))
    found: list[can.Message] = []

    def told() -> bool:
        guest.send(PLAIN)  # the bus is the hub's, and only its thread may look at its queues
        found.extend(filter(None, [guest.recv(0.0)]))
        return bool(found)

    until(told)
    (message,) = found
    assert message.is_error_frame
    assert (message.arbitration_id, message.data[1]) == (0x04, 0x02), (
        "a controller's overflow, of transmission"
    )
    guest.shutdown()


def test_a_listener_that_does_not_read_is_told_that_it_has_lost_frames(served: Served) -> None:
    sleeper, talker = served.native(), served.native()
    found = numbers_on(served.hub)
    for n in range(MANY):
        talker.send(numbered(n))
    until(lambda: len(found) >= MANY)
    by_hub(served.hub, lambda: None)  # whoever watches the bus hears a frame before the guests do
    while sleeper.recv(0.0) is not None:
        pass
    talker.send(PLAIN)
    first, second = heard(sleeper, 2)
    assert first.is_error_frame
    assert (first.arbitration_id, first.data[1]) == (0x04, 0x01), "a controller's overflow, of reception"
    assert same([second], [PLAIN])
    for guest in (sleeper, talker):
        guest.shutdown()


# -- remote frames


@pytest.mark.parametrize("dlc", range(9))
def test_the_plugin_carries_remote_frames_with_their_length_code(served: Served, dlc: int) -> None:
    one, two = served.native(), served.native()
    for extended in (False, True):
        sent = can.Message(arbitration_id=0x703, is_remote_frame=True, dlc=dlc, is_extended_id=extended)
        one.send(sent)
        (got,) = heard(two, 1)
        assert same([got], [sent])
        assert (got.is_remote_frame, got.dlc, bytes(got.data)) == (True, dlc, b"")
    for guest in (one, two):
        guest.shutdown()


def test_an_error_frame_of_the_bus_is_one_for_the_guest(served: Served) -> None:
    others = set(served.hub.bus._ports)
    guest = served.native()
    until(lambda: set(served.hub.bus._ports) != others)
    bus = served.hub.bus
    (source,) = set(bus._ports) - others
    by_hub(served.hub, lambda: bus.errors.switch_off(bus.errors.of(source), bus.now_s))
    (told,) = heard(guest, 1)
    assert told.is_error_frame
    assert told.arbitration_id == 0x40
    guest.shutdown()


# -- CAN FD


def test_the_plugin_refuses_can_fd_by_name(served: Served) -> None:
    guest = served.native()
    with pytest.raises(can.CanOperationError, match="CAN FD frames are not carried"):
        guest.send(FD)
    with pytest.raises(can.CanInitializationError, match="CAN FD frames are not carried"):
        HubBus(served.path, fd=True)
    guest.send(PLAIN)
    until(lambda: served.hub.bus.frames == 1)
    guest.shutdown()


@pytest.mark.parametrize(
    "message",
    [
        can.Message(arbitration_id=0x800, is_extended_id=False),
        can.Message(arbitration_id=1 << 29, is_extended_id=True),
        can.Message(arbitration_id=0x123, dlc=9, is_remote_frame=True, is_extended_id=False),
        can.Message(arbitration_id=0x123, data=bytes(9), is_extended_id=False),
    ],
)
def test_the_plugin_refuses_what_is_no_frame(served: Served, message: can.Message) -> None:
    guest = served.native()
    with pytest.raises(can.CanOperationError, match=r"identifier|length"):
        guest.send(message)
    guest.shutdown()


def test_no_hub_is_a_sentence_of_python_can(tmp_path: Path) -> None:
    with pytest.raises(can.CanInitializationError, match="there is no virtual bus at"):
        HubBus(str(tmp_path / "nothing"))
