"""The virtual bus as a socketcand server on this computer's loopback address, and nowhere else.

Text over TCP, as socketcand's clients speak it (python-can, SavvyCAN, Kayak's raw mode):

    -> < hi >                               by us, at once
    <- < open can0 >     -> < ok >          any name will do: there is one bus
    <- < rawmode >       -> < ok >          from now on every frame comes
    <- < send 123 2 11 ff >                 identifier, count, bytes; eight digits: 29 bits
    -> < frame 123 1.234567 11FF >          time in s of the bus' clock
    -> < error 20000040 1.234567 >          an error frame of our CAN controller
    -> < error 20000004 1.234567 send: ...  > a command that is refused, and why
    <- < echo >          -> < echo >

A refusal in raw mode begins as an error frame does, because clients read it as one. A client that sends
faster than the bus carries is not read until its queue has room again. There is no word for remote frames
in this protocol: they are not passed on, and what looks like one is refused, as CAN FD is.
"""

from __future__ import annotations

import contextlib
import re
import socket

from drives.bench.virtual.intake import Host, Intake
from drives.pdo import ERROR_FLAG, EXTENDED_FLAG, FRAME, REMOTE_FLAG
from drives.ports.error_frames import CONTROLLER
from drives.ports.hub_protocol import NO_FD
from drives.texts import Key, TextError, said

LOOPBACK = "127.0.0.1"
PORT = 29536  # socketcand's own
COMMAND = re.compile(rb"<\s*([^<>]*?)\s*>")
LONGEST_COMMAND = 200  # bytes; more without an end is thrown away
# A client may read the answer to rawmode as a message of its own (python-can does), so nothing follows it
# at once: frames are kept until the client says something more, or for so long. The bus' clock may be
# behind by the 0.1 s that a hub's turn lasts at most.
QUIET_S = 0.2
MAX_KEPT = 8192  # frames in that time; at 1 Mbit/s some 4000 fit
HEX = re.compile(rb"[0-9A-Fa-f]{1,8}")
MAX_QUOTED = 60  # characters of a refused command


class _Refused(TextError):
    """A command that cannot be done, and why: in English, as the whole protocol is."""


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
        self._kept: list[bytes] | None = None  # frames, while it is quiet
        joined.setblocking(False)
        joined.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._intake = Intake(host, joined.fileno(), self._read)
        self._say(b"< hi >")

    def _say(self, text: bytes) -> None:
        if self.gone:
            return
        try:
            sent = self._socket.send(text)
        except BlockingIOError:
            self.lost += 1
            return
        except OSError:
            return  # gone; the read side notices
        if sent != len(text):
            self.leave()  # half a message in the stream: the rest would be nonsense

    # -- commands

    def _read(self) -> bool:
        """Everything it has said; False if a frame of it has to wait."""
        if not self._obey_all():
            return False
        try:
            received = self._socket.recv(65536)
        except BlockingIOError:
            return True
        except OSError:
            received = b""
        if not received:
            self.leave()
            return True
        self._text += received
        return self._obey_all()

    def _obey_all(self) -> bool:
        end, done = 0, True
        for found in COMMAND.finditer(self._text):
            done = self._obey(found[1].split())
            if not done or self.gone:
                break
            end = found.end()
        self._text = self._text[end:]
        if done and len(self._text) > LONGEST_COMMAND:
            self._text = b""
        return done

    def _obey(self, words: list[bytes]) -> bool:
        """Do one command; False if it is a frame that has to wait."""
        command = words[0] if words else b""
        self._end_quiet()  # who goes on has read the answer to rawmode
        try:
            if command == b"open" and not self._open:
                self._open = True
                self._say(b"< ok >")
            elif command == b"echo":
                self._say(b"< echo >")
            elif command == b"rawmode" and self._open:
                self._say(b"< ok >")
                self._join()
            elif command == b"send" and self._source >= 0:
                return self._submit(_frame(words[1:]))
            elif command == b"fdsend":
                raise _Refused(said("socketcand.fdsend", why=Key(NO_FD)))
            else:
                text = b" ".join(words)[:MAX_QUOTED].decode("ascii", "replace")
                raise _Refused(said("socketcand.not_here", command=text))
        except _Refused as refusal:
            self._refuse(str(refusal))
        return True

    def _refuse(self, why: str) -> None:
        """In raw mode a client takes the first two words for identifier and time of an error frame."""
        if self._source >= 0:
            why = f"{ERROR_FLAG | CONTROLLER:08X} {self._host.bus.now_s:.6f} {why}"
        self._say(f"< error {why} >".encode())

    def _submit(self, frame: bytes) -> bool:
        bus = self._host.bus
        if bus.submit(self._source, bus.now_s, int.from_bytes(frame[:4], "little"), frame):
            return True
        if bus.is_full(self._source):
            return False
        raise _Refused(said("socketcand.takes_none"))

    # -- frames

    def _join(self) -> None:
        if self._source < 0:
            bus = self._host.bus
            self._kept = []
            self._source = bus.connect(self._put)
            bus.agenda.add(bus.now_s + QUIET_S, lambda _now_s: self._end_quiet())

    def _end_quiet(self) -> None:
        kept, self._kept = self._kept, None
        for text in kept or ():
            self._say(text)

    def _put(self, frame: bytes, at_s: float) -> None:
        text = _told(frame, at_s)
        if not text:
            return
        if self._kept is None:
            self._say(text)
        elif len(self._kept) < MAX_KEPT:
            self._kept.append(text)
        else:
            self.lost += 1

    def leave(self) -> None:
        if self.gone:
            return
        self.gone = True
        if self._source >= 0:
            self._host.bus.disconnect(self._source)
        self._intake.close()
        self._socket.close()


def _frame(words: list[bytes]) -> bytes:
    """The packed frame of < send id count byte byte ... >. Raises _Refused."""
    if len(words) < 2 or not all(HEX.fullmatch(word) for word in words):
        raise _Refused(said("socketcand.no_frame"))
    name, count, *payload = words
    data, length = [int(word, 16) for word in payload], int(count, 16)
    can_id, highest = int(name, 16), 0x1FFF_FFFF if len(name) > 3 else 0x7FF
    if can_id > highest:
        facts = {"can_id": can_id, "digits": len(name), "highest": highest}
        raise _Refused(said("socketcand.identifier", **facts))
    if length > 8:
        raise _Refused(said("socketcand.too_long", length=length, why=Key(NO_FD)))
    if length and not data:
        raise _Refused(said("socketcand.remote", length=length))
    if length != len(data) or max(data, default=0) > 0xFF:
        raise _Refused(said("socketcand.other_length", length=length, given=len(data)))
    flag = EXTENDED_FLAG if len(name) > 3 else 0
    return FRAME.pack(can_id | flag, length, bytes(data))


def _told(frame: bytes, at_s: float) -> bytes:
    """A frame in the words of the protocol; none for a remote frame."""
    can_id, length, data = FRAME.unpack(frame)
    if can_id & ERROR_FLAG:
        return f"< error {can_id & 0x3FFF_FFFF:08X} {at_s:.6f} >".encode()
    if can_id & REMOTE_FLAG:
        return b""
    name = f"{can_id & 0x1FFF_FFFF:08X}" if can_id & EXTENDED_FLAG else f"{can_id:03X}"
    return f"< frame {name} {at_s:.6f} {data[:length].hex().upper()} >".encode()
