"""A Modbus RTU slave on a pty: the far end of an inverter's serial line, by the protocol's text.

Functions 01h, 03h, 05h, 06h and 10h (Modbus Application Protocol 1.1b3, 6.1 to 6.12), CRC-16 as of Modbus
over Serial Line 1.02, 6.2.2. It shares nothing with what is tested.
"""

from __future__ import annotations

import os
import pty
import select
import threading
import tty
from collections.abc import Callable


def crc(frame: bytes) -> bytes:
    """Low byte first."""
    found = 0xFFFF
    for byte in frame:
        found ^= byte
        for _ in range(8):
            found = found >> 1 ^ 0xA001 if found & 1 else found >> 1
    return found.to_bytes(2, "little")


class Slave:
    """Addresses are those on the line. ``mute``: it answers nothing, and counts
    what it has ``ignored``; ``written``: what was, in its order."""

    def __init__(self, station: int, wrote: Callable[[Slave], None] = lambda _: None) -> None:
        self.registers: dict[int, int] = {}
        self.coils: dict[int, bool] = {}
        self.written: list[tuple[str, int, int]] = []
        self.mute, self.ignored = False, 0
        self._station, self._wrote = station, wrote
        self._end, self._far = pty.openpty()
        tty.setraw(self._far)
        self.path = os.ttyname(self._far)
        self._over = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._over = True
        self._thread.join()
        os.close(self._end)
        os.close(self._far)

    def _run(self) -> None:
        held = b""
        while not self._over:
            if not select.select([self._end], [], [], 0.02)[0]:
                held = b""  # silence begins a new frame
                continue
            held += os.read(self._end, 256)
            longest = 9 + held[6] if len(held) > 6 and held[1] == 0x10 else 8
            if len(held) < longest:
                continue
            frame, held = held[:longest], held[longest:]
            if frame[0] != self._station or crc(frame[:-2]) != frame[-2:]:
                continue
            if self.mute:
                self.ignored += 1
            else:
                answer = bytes([frame[0]]) + self._answer(frame[1], frame[2:-2])
                os.write(self._end, answer + crc(answer))

    def _answer(self, function: int, body: bytes) -> bytes:
        address, number = int.from_bytes(body[:2]), int.from_bytes(body[2:4])
        if function == 0x03:
            words = [self.registers.get(address + n, 0) for n in range(number)]
            return bytes([function, 2 * number]) + b"".join(word.to_bytes(2) for word in words)
        if function == 0x01:
            bits = sum(1 << n for n in range(number) if self.coils.get(address + n))
            return bytes([function, (number + 7) // 8]) + bits.to_bytes((number + 7) // 8, "little")
        if function == 0x05:
            self._write("coil", address, number >> 15)
        elif function == 0x06:
            self._write("register", address, number)
        elif function == 0x10:
            for n in range(number):
                self._write("register", address + n, int.from_bytes(body[5 + 2 * n : 7 + 2 * n]))
        else:
            return bytes([function | 0x80, 1])
        return bytes([function]) + body[:4]

    def _write(self, kind: str, address: int, value: int) -> None:
        self.written.append((kind, address, value))
        if kind == "coil":
            self.coils[address] = bool(value)
        else:
            self.registers[address] = value
        self._wrote(self)
