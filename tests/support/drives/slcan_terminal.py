"""A serial CAN adapter without hardware: a pseudo terminal that speaks slcan, and behind it a virtual bus.

``python -m support.drives.slcan_terminal PATH LINK`` has five simulated drives on that bus, until SIGTERM.
"""

from __future__ import annotations

import os
import sys
import tty

from drives.bench.simulated import SimulatedDrive
from drives.bench.simulated.serve import run
from drives.bench.virtual.hub import Hub
from drives.pdo import ERROR_FLAG, FRAME
from drives.ports import slcan
from drives.ports.error_frames import BUS_OFF, CONTROLLER, RX_PASSIVE, RX_WARNING, TX_PASSIVE, TX_WARNING

OK, REFUSED = b"\r", b"\a"


def state_line(frame: bytes) -> bytes:
    """The line that tells an error frame of bus-off or of the controller's status; else empty."""
    can_id, _, data = FRAME.unpack(frame)
    if can_id & BUS_OFF:
        return b"sb256256\r"
    if not can_id & CONTROLLER:
        return b""
    passive, warning = data[1] & (RX_PASSIVE | TX_PASSIVE), data[1] & (RX_WARNING | TX_WARNING)
    letter = "p" if passive else "w" if warning else "a"
    return f"s{letter}{data[7]:03d}{data[6]:03d}\r".encode()


class SlcanTerminal:
    """What a hub opens as a gateway; its guest opens ``link`` as it would /dev/ttyACM0."""

    def __init__(self, hub: Hub, link: str) -> None:
        self.source = -1
        self._hub, self._link, self._text = hub, link, b""
        self._master, self._slave = os.openpty()  # the slave stays open: no end of file between guests
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        os.symlink(os.ttyname(self._slave), link)
        hub.listen(self._master, self._read)

    def _read(self) -> None:
        *lines, self._text = (self._text + os.read(self._master, 65536)).split(b"\r")
        for text in lines:
            os.write(self._master, self._answer(text))

    def _answer(self, text: bytes) -> bytes:
        bus, letter = self._hub.bus, text[:1]
        if letter == b"O":
            self.source = bus.connect(self._put)
        elif letter == b"C":
            self._leave()
        elif letter in (b"t", b"T", b"r", b"R"):
            frame = slcan.frame(text)
            assert frame is not None and self.source >= 0, text
            sent = bus.submit(self.source, bus.now_s, int.from_bytes(frame[:4], "little"), frame)
            return (b"z\r" if letter.islower() else b"Z\r") if sent else REFUSED
        return OK

    def _put(self, frame: bytes, _at_s: float) -> None:
        is_error = int.from_bytes(frame[:4], "little") & ERROR_FLAG
        os.write(self._master, state_line(frame) if is_error else slcan.line(frame))

    def _leave(self) -> None:
        if self.source >= 0:
            self._hub.bus.disconnect(self.source)
            self.source = -1

    def restart(self) -> None:
        """Nothing: who is behind this adapter asks it by slcan."""

    def close(self) -> None:
        self._leave()
        self._hub.forget(self._master)
        os.unlink(self._link)
        os.close(self._master)
        os.close(self._slave)


def main(path: str, link: str) -> None:
    hub = Hub(path)
    hub.open_gateway(SlcanTerminal(hub, link))
    run(hub, [SimulatedDrive(node) for node in range(1, 6)])


if __name__ == "__main__":
    main(*sys.argv[1:])
