"""The virtual bus as a socketcand server on this computer's loopback address, and nowhere else.

Text over TCP, as socketcand's clients speak it (python-can, SavvyCAN, Kayak's raw mode):

    -> < hi >                               by us, at once
    <- < open can0 >     -> < ok >          any name will do: there is one bus
    <- < rawmode >       -> < ok >          from now on every frame comes
    <- < send 123 2 11 ff >                 identifier, count, bytes; eight digits: 29 bits
    -> < frame 123 1.234567 11FF >          time in s of the bus' clock
    -> < error 20000040 1.234567 >          an error frame of our CAN controller
    <- < echo >          -> < echo >

There is no word for remote frames in this protocol: they are not passed on.
"""

from __future__ import annotations

import contextlib
import re
import socket

from drives.gateways.host import Host
from drives.pdo import ERROR_FLAG, EXTENDED_FLAG, FRAME, REMOTE_FLAG

LOOPBACK = "127.0.0.1"
PORT = 29536  # socketcand's own
COMMAND = re.compile(rb"<\s*([^<>]*?)\s*>")
LONGEST_COMMAND = 200  # bytes; more without an end is thrown away
# A client may read the answer to rawmode as a message of its own, so nothing follows it at once.
QUIET_S = 0.1


class SocketcandServer:
    """Listens on ``port`` (0 = any free one; see ``port``). Raises OSError when it is taken."""

    def __init__(self, host: Host, port: int = PORT) -> None:
        self._host = host
        self._guests: list[_Guest] = []
        self._server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._server.bind((LOOPBACK, port))
        except OSError:
            self._server.close()
            raise
        self._server.listen(8)
        self._server.setblocking(False)
        self.port: int = self._server.getsockname()[1]
        host.listen(self._server.fileno(), self._accept)

    def _accept(self) -> None:
        with contextlib.suppress(BlockingIOError):
            joined, _ = self._server.accept()
            self._guests = [guest for guest in self._guests if not guest.gone]
            self._guests.append(_Guest(self._host, joined))

    def restart(self) -> None:
        """Nothing is behind this gateway but guests."""

    def close(self) -> None:
        for guest in self._guests:
            guest.leave()
        self._host.forget(self._server.fileno())
        self._server.close()


class _Guest:
    """One client."""

    def __init__(self, host: Host, joined: socket.socket) -> None:
        self.gone = False
        self.lost = 0  # frames and answers that did not fit into its socket
        self._host = host
        self._socket = joined
        self._text = b""
        self._open = False
        self._source = -1
        self._from_s = 0.0
        joined.setblocking(False)
        joined.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        host.listen(joined.fileno(), self._read)
        self._say(b"< hi >")

    def _say(self, text: bytes) -> None:
        try:
            sent = self._socket.send(text)
        except BlockingIOError:
            self.lost += 1
            return
        except OSError:
            return  # gone; the read side notices
        if sent != len(text):
            self.leave()  # half a message in the stream: the rest would be nonsense

    def _read(self) -> None:
        try:
            received = self._socket.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            received = b""
        if not received:
            self.leave()
            return
        self._text += received
        end = 0
        for found in COMMAND.finditer(self._text):
            end = found.end()
            self._obey(found[1].split())
        self._text = self._text[end:]
        if len(self._text) > LONGEST_COMMAND:
            self._text = b""

    def _obey(self, words: list[bytes]) -> None:
        command = words[0] if words else b""
        if command == b"open" and not self._open:
            self._open = True
            self._say(b"< ok >")
        elif command == b"echo":
            self._say(b"< echo >")
        elif command == b"rawmode" and self._open:
            self._join()
            self._say(b"< ok >")
        elif command == b"send" and self._source >= 0:
            self._submit(words[1:])
        else:
            text = b" ".join(words).decode("ascii", "replace")
            self._say(f"< error {text}: not possible here; use open, rawmode, send, echo >".encode())

    def _join(self) -> None:
        if self._source < 0:
            self._from_s = self._host.bus.now_s + QUIET_S
            self._source = self._host.bus.connect(self._put)

    def _put(self, frame: bytes, at_s: float) -> None:
        if at_s < self._from_s:
            return
        can_id, length, data = FRAME.unpack(frame)
        if can_id & ERROR_FLAG:
            self._say(f"< error {can_id & 0x3FFF_FFFF:08X} {at_s:.6f} >".encode())
        elif not can_id & REMOTE_FLAG:
            name = f"{can_id & 0x1FFF_FFFF:08X}" if can_id & EXTENDED_FLAG else f"{can_id:03X}"
            self._say(f"< frame {name} {at_s:.6f} {data[:length].hex().upper()} >".encode())

    def _submit(self, words: list[bytes]) -> None:
        """Take < send id count byte byte ... >; nonsense is answered with an error."""
        try:
            can_id = int(words[0], 16) | (EXTENDED_FLAG if len(words[0]) > 3 else 0)
            data = bytes(int(word, 16) for word in words[2:])
            sound = int(words[1], 16) == len(data) <= 8 and can_id & ~EXTENDED_FLAG <= 0x1FFF_FFFF
        except (ValueError, IndexError):
            sound = False
        if not sound:
            self._say(b"< error send: write < send 123 2 11 ff > >")
            return
        bus = self._host.bus
        bus.submit(self._source, bus.now_s, can_id, FRAME.pack(can_id, len(data), data))

    def leave(self) -> None:
        if self.gone:
            return
        self.gone = True
        if self._source >= 0:
            self._host.bus.disconnect(self._source)
        self._host.forget(self._socket.fileno())
        self._socket.close()
