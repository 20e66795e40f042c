"""Fault confinement, ISO 11898-1: the counters, the limits, and what SocketCAN would tell of them."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from drives import pdo
from drives.bench.virtual.error_counters import Controller, Level


def after(transmit: int = 0, receive: int = 0) -> Controller:
    controller = Controller()
    for _ in range(transmit):
        controller.failed(sending=True)
    for _ in range(receive):
        controller.failed(sending=False)
    return controller


def test_transmit_errors_count_eight_and_lead_by_warning_and_passive_to_bus_off() -> None:
    levels = [after(transmit=n).level for n in (11, 12, 15, 16, 31, 32)]
    assert levels == [
        Level.ACTIVE, Level.WARNING, Level.WARNING, Level.PASSIVE, Level.PASSIVE, Level.OFF,
    ]  # fmt: skip


def test_a_receiver_becomes_passive_and_never_bus_off() -> None:
    controller = after(receive=1000)
    assert controller.level is Level.PASSIVE
    assert controller.receive == 255
    assert controller.succeeded(sending=False)
    assert controller.receive == 127
    assert controller.level is Level.WARNING


def test_each_success_takes_one_back_until_nothing_is_counted() -> None:
    controller = after(transmit=16)
    for _ in range(127):
        assert not controller.clean
        controller.succeeded(sending=True)
    assert controller.level is Level.ACTIVE
    controller.succeeded(sending=True)
    assert controller.clean


@given(st.lists(st.tuples(st.booleans(), st.booleans()), max_size=400))
def test_the_level_always_fits_the_counters(events: list[tuple[bool, bool]]) -> None:
    controller = Controller()
    for good, sending in events:
        before = controller.level
        changed = controller.succeeded(sending) if good else controller.failed(sending)
        assert changed == (controller.level is not before)
        worst = max(controller.transmit, controller.receive)
        if controller.level is not Level.OFF:
            assert controller.transmit < 256
            assert (controller.level is Level.PASSIVE) == (worst >= 128)
            assert (controller.level is Level.ACTIVE) == (worst < 96)
        else:
            assert controller.transmit >= 256


def test_the_error_frames_are_those_of_socketcan() -> None:
    rows = [
        # controller, class, status byte
        (after(transmit=12), 0x04, 0x08),
        (after(transmit=16), 0x04, 0x20),
        (after(receive=96), 0x04, 0x04),
        (after(receive=128), 0x04, 0x10),
        (after(transmit=16, receive=128), 0x04, 0x30),
        (after(), 0x04, 0x40),
        (after(transmit=32), 0x40, 0x00),
    ]
    for controller, error_class, status in rows:
        can_id, data = pdo.unpack(controller.error_frame())
        assert (can_id, data[1]) == (pdo.ERROR_FLAG | error_class, status)
        assert (data[6], data[7]) == (min(255, controller.transmit), controller.receive)


def test_a_restart_begins_with_nothing_counted() -> None:
    controller = after(transmit=32)
    assert not controller.failed(sending=True)
    assert not controller.succeeded(sending=True)
    controller.restart()
    assert controller.clean
    assert controller.level is Level.ACTIVE
