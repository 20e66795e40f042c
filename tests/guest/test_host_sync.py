"""SYNC that a measurement sends comes back from a real kernel, and none is sent where another sends it."""

from __future__ import annotations

import socket
import threading

from guest import on_can

from controller.cli import host_measure
from controller.machine import machine_file
from controller.runtime import wake_ups
from drives import bus, pdo

PERIOD_S = 0.02
SECONDS = 1.0


def test_each_sync_that_left_is_heard_once_with_its_interval() -> None:
    settings = machine_file.bus_settings(on_can.machine())
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as beside:
        beside.bind(("vcan0",))
        beside.setblocking(False)
        with wake_ups.echoes_of(settings, PERIOD_S) as echoes:
            (echo,) = echoes.values()
            sender = bus.open(settings[0], ())
            wake_ups.sync_turn(PERIOD_S, SECONDS, [sender], [echo])
            wake_ups.listen([echo], 0.1)
            sender.close()
        frames = []
        while True:
            try:
                frames.append(beside.recv(pdo.FRAME_BYTES))
            except BlockingIOError:
                break
    assert frames and {bytes(pdo.frame(pdo.SYNC))} == set(frames)
    assert 2 <= echo.heard == len(frames) <= round(SECONDS / PERIOD_S)
    assert echo.off.count == echo.heard - 1


def test_a_bus_on_which_another_sends_sync_is_not_silent() -> None:
    settings = machine_file.bus_settings(on_can.machine())
    with wake_ups.echoes_of(settings, PERIOD_S) as echoes:
        assert host_measure.is_silent(echoes)
        (other,) = (bus.open(one) for one in settings)
        over = threading.Event()

        def send() -> None:
            while not over.wait(PERIOD_S):
                other.send(pdo.frame(pdo.SYNC))

        sender = threading.Thread(target=send)
        sender.start()
        silent = host_measure.is_silent(echoes)
        over.set()
        sender.join()
        other.close()
        assert not silent
