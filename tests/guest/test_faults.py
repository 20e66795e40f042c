"""What a real CAN interface can do to a running machine: each fault is named, and the drives stop."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable

import pytest
from guest import on_can
from support.live.live_machines import Listener, Live, at, run, until

from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.runtime.startup import SessionError
from controller.state.modes import FAULTS, Fault, Mode
from drives import pdo

PROGRAM = "G21 G90 G54 G1 X150. F2400.\nM30\n"
DRY = "G21 G90 G54 G0 X5.\nM30\n"
INSTANT_S = 1.5  # of the path clock

PASSIVE = bytes([0, 0x20, 0, 0, 0, 0, 0, 0])  # CAN_ERR_CRTL_TX_PASSIVE
WARNING = bytes([0, 0x08, 0, 0, 0, 0, 0, 0])  # CAN_ERR_CRTL_TX_WARNING
CONTROLLER, BUS_OFF = 0x004, 0x040


def struck(machine: Machine, strike: Callable[[Live], None]) -> tuple[Snapshot, Live]:
    """A program struck on its way; the last snapshot, and the session that has ended by now.

    One that a computer which was away had ended before is begun anew.
    """
    for _ in range(on_can.ATTEMPTS):
        done: list[bool] = []
        with on_can.ready(PROGRAM, machine) as (running, _):

            def act(running: Live = running, done: list[bool] = done) -> None:
                done.append(True)
                strike(running)

            _, last = run(running, at(running, INSTANT_S, act))
        if done or not on_can.held_up(last.fault):
            break
    return last, running


def comes_up_again(machine: Machine) -> bool:
    """Whether a new start on the same drives commissions, homes, enables and runs."""
    with on_can.ready(DRY, machine) as (running, _):
        _, last = run(running)
    return (last.mode, last.fault) == (Mode.READY, Fault.NONE)


def named(*names: str) -> set[Fault]:
    return {Fault[name] for name in names if name in Fault.__members__}


def test_error_passive_stops_the_machine_and_a_warning_before_it_does_not() -> None:
    machine = on_can.machine()

    def strike(running: Live) -> None:
        on_can.error_frame(CONTROLLER, WARNING)
        seen = running.board.read()
        until(lambda: running.board.read().tick > seen.tick + 20)
        assert running.board.read().mode is Mode.RUNNING
        on_can.error_frame(CONTROLLER, PASSIVE)

    with on_can.drives():
        last, _ = struck(machine, strike)
        assert (last.mode, last.fault) == (Mode.FAULT, Fault.BUS_ERROR)
        assert not FAULTS[last.fault].position_trusted
        assert on_can.stopped(machine)
        assert comes_up_again(machine)


def test_bus_off_is_named_and_the_drives_behind_it_stop_by_themselves() -> None:
    machine = on_can.machine("can0", period_s=on_can.SERIAL_PERIOD_S)
    with on_can.drives(), on_can.adapter() as tell:
        last, _ = struck(machine, lambda _: tell("bus_off"))
        assert last.mode is Mode.FAULT and last.fault in named("BUS_OFF")
        assert "BUS-OFF" in on_can.ip("-d", "link", "show", "can0")
        assert on_can.stopped(on_can.machine("vcan0"))
        on_can.up(False, "can0")  # slcan knows no restart-ms: down and up is the way back
        on_can.up(True, "can0")
        assert comes_up_again(machine)


def test_a_full_transmit_queue_is_named_and_the_drives_stop_by_themselves() -> None:
    machine = on_can.machine()
    with on_can.drives():
        last, _ = struck(machine, lambda _: on_can.transmit_queue(0))
        assert (last.mode, last.fault) == (Mode.FAULT, Fault.SEND_FAILED)
        on_can.transmit_queue(128)
        assert on_can.stopped(machine)


def test_an_interface_that_goes_down_stops_the_machine() -> None:
    machine = on_can.machine()
    with on_can.drives():
        last, _ = struck(machine, lambda _: on_can.up(False))
        assert last.mode is Mode.FAULT and last.fault in named("SEND_FAILED", "BUS_ERROR", "BUS_OFF")
        on_can.up(True)
        assert on_can.stopped(machine)


def test_sync_ends_with_the_tick_and_the_drives_stop() -> None:
    machine = on_can.machine()
    with on_can.drives():
        with pytest.raises(SessionError, match="SIGKILL"):
            struck(machine, lambda running: os.kill(running.tick.pid, signal.SIGKILL))
        listener = Listener(machine)
        assert on_can.stopped(machine)
        listener.listen()
        assert listener.count(0x580 + 1) > 0
        assert listener.count(pdo.SYNC) == 0
