"""The local door of the service: who may speak through it, and how. Both sides.

A SEQPACKET socket in the file system, one JSON object a packet. Every request names a verb
and gets one answer with its ``id``; what takes long answers late, and others overtake it:

    {"id": 7, "verb": "hold", "args": {}}
    {"id": 7, "ok": true, "result": {...}}
    {"id": 7, "ok": false, "error": {"code": "refused", "mode": "RUNNING", "request": "HOME", ...}}

The kernel tells who connects (SO_PEERCRED): the same user, root, and members of the group that
owns the socket are let in. One thread reads all of it, so that a hold never waits behind
another verb's work: a handler that cannot answer at once gives a ``Future``.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import pwd
import selectors
import socket
import stat
import struct
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any

Values = dict[str, Any]
Answer = Values | Future[Values]
Handler = Callable[[str, Values], Answer]

CONTROL = "control.sock"  # in the runtime folder
MOST_BYTES = 200_000  # of a packet; bigger things go by their path in the store
MOST_PEERS = 64
CODES = ("refused", "bad", "busy", "gone")
FACTS = ("code", "sentence", "mode", "request", "sentence_de")  # of a refusal
ANSWER_S = 600.0  # a whole program may have to be read before the answer

_BUFFER_BYTES = 1 << 20
_CREDENTIALS = struct.Struct("3i")  # pid, uid, gid


class DoorError(Exception):
    """Why a request was not done: ``sentence`` for the operator, also in German where it is known.

    ``code``: "refused" by the machine's state, "bad" request, "busy", "gone" = nobody answers.
    """

    def __init__(
        self, code: str, sentence: str, mode: str = "", request: str = "", sentence_de: str = ""
    ) -> None:
        super().__init__(sentence)
        self.code, self.sentence, self.mode, self.request = code, sentence, mode, request
        self.sentence_de = sentence_de

    def to_dict(self) -> Values:
        return {name: getattr(self, name) for name in FACTS}

    @classmethod
    def from_dict(cls, said: Mapping[str, Any]) -> DoorError:
        return cls(**{name: str(said.get(name, "")) for name in FACTS})


def control_path(runtime: Path) -> Path:
    """Where the door is, in a runtime folder."""
    return runtime / CONTROL


def runtime_folder() -> Path:
    """Where sockets are unless told otherwise: systemd's folder, the user's, or a private one."""
    if given := os.environ.get("RUNTIME_DIRECTORY"):
        return Path(given.split(":")[0])
    if base := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(base) / "directrix"
    return Path(f"/tmp/directrix-{os.getuid()}")


def state_folder() -> Path:
    """Where what must last is kept unless told otherwise: systemd's folder, or the XDG state folder."""
    if given := os.environ.get("STATE_DIRECTORY"):
        return Path(given.split(":")[0])
    base = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    return Path(base) / "directrix"


# ---- the asking side


class Client:
    """Asks the service. Any number of threads may use one; each request has a connection to itself."""

    def __init__(self, path: Path, longest_s: float = ANSWER_S) -> None:
        """``path``: of the socket; ``longest_s``: how long an answer may take."""
        self._path, self._longest_s = path, longest_s
        self._idle: list[socket.socket] = []
        self._lock = threading.Lock()
        self._number = 0

    def ask(self, verb: str, **args: Any) -> Values:
        """The result of a verb. Raises DoorError."""
        own, fresh = self._take()
        try:
            return self._answer(own, verb, args)
        except ConnectionError:
            own.close()
            if fresh:
                raise DoorError("gone", self._gone()) from None
        except OSError as error:
            own.close()
            raise DoorError("gone", f"{self._gone()} ({error.strerror or 'no answer in time'})") from error
        # It was opened before the service was started anew; nothing of this request went out.
        own, _ = self._take(fresh=True)
        try:
            return self._answer(own, verb, args)
        except OSError as error:
            own.close()
            raise DoorError("gone", self._gone()) from error

    def close(self) -> None:
        with self._lock:
            for own in self._idle:
                own.close()
            self._idle.clear()

    def _answer(self, own: socket.socket, verb: str, args: Values) -> Values:
        with self._lock:
            self._number += 1
            number = self._number
        packet = _packed({"id": number, "verb": verb, "args": args})
        if len(packet) > MOST_BYTES:
            raise DoorError("bad", f"{verb}: {len(packet)} bytes are too many for one request; send a path.")
        own.send(packet)
        while True:
            said = _unpacked(own.recv(2 * MOST_BYTES))
            if said is None:
                raise ConnectionResetError
            if said.get("id") in (number, None):  # None: this peer was sent away
                break
        with self._lock:
            self._idle.append(own)
        if said.get("ok"):
            return dict(said.get("result") or {})
        raise DoorError.from_dict(said.get("error") or {})

    def _take(self, fresh: bool = False) -> tuple[socket.socket, bool]:
        """A connection, and whether it is new."""
        with self._lock:
            if fresh:
                for old in self._idle:
                    old.close()
                self._idle.clear()
            elif self._idle:
                return self._idle.pop(), False
        own = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        own.settimeout(self._longest_s)
        own.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
        try:
            own.connect(str(self._path))
        except OSError as error:
            own.close()
            raise DoorError("gone", f"{self._gone()} ({error.strerror})") from error
        return own, True

    def _gone(self) -> str:
        return f"{self._path}: the machine's service does not answer; start it with directrix serve."


# ---- the answering side


class _Peer:
    """One connection; answers may be sent by any thread."""

    def __init__(self, own: socket.socket) -> None:
        own.setblocking(False)
        own.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
        self.socket = own
        self._lock = threading.Lock()

    def send(self, said: Values) -> None:
        """One who does not read its answers loses them."""
        with self._lock, contextlib.suppress(OSError):
            self.socket.send(_packed(said))

    def close(self) -> None:
        with self._lock:
            self.socket.close()


class Server:
    """The door, open from construction to ``close``; ``handler`` is called in the door's own thread.

    A handler answers at once, or gives a Future; it raises DoorError where a request is not done.
    """

    def __init__(self, path: Path, handler: Handler, group: str = "") -> None:
        """``group``: whose members are let in besides the user; "" = the process' own. Raises OSError."""
        self._path, self._handler = path, handler
        self._listening = _listening(path, group)
        self._gid = os.stat(path).st_gid
        self._peers: dict[int, _Peer] = {}
        self._selector = selectors.DefaultSelector()
        self._wake, self._woken = socket.socketpair()
        self._selector.register(self._listening, selectors.EVENT_READ)
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._ending = False
        self._thread = threading.Thread(target=self._serve, name="door", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """No more requests; the socket is gone from the file system."""
        self._ending = True
        self._wake.send(b".")
        self._thread.join()
        for peer in self._peers.values():
            peer.close()
        for own in (self._listening, self._wake, self._woken):
            own.close()
        self._selector.close()
        self._path.unlink(missing_ok=True)

    def _serve(self) -> None:
        while not self._ending:
            for key, _ in self._selector.select():
                if key.fileobj is self._listening:
                    self._accept()
                elif key.fileobj is not self._woken:
                    self._read(key.fd)

    def _accept(self) -> None:
        try:
            own, _ = self._listening.accept()
        except OSError:
            return
        if len(self._peers) >= MOST_PEERS:
            own.close()
            return
        peer = _Peer(own)
        if not _let_in(own, self._gid):
            sentence = f"This user may not use {self._path}; add it to the group that owns the socket."
            peer.send({"id": None, "ok": False, "error": DoorError("refused", sentence).to_dict()})
            peer.close()
            return
        self._peers[own.fileno()] = peer
        self._selector.register(own, selectors.EVENT_READ)

    def _read(self, fileno: int) -> None:
        peer = self._peers[fileno]
        try:
            packet = peer.socket.recv(MOST_BYTES + 1)
        except BlockingIOError:
            return
        except OSError:
            packet = b""
        if not packet:
            self._selector.unregister(peer.socket)
            del self._peers[fileno]
            peer.close()
            return
        self._request(peer, packet)

    def _request(self, peer: _Peer, packet: bytes) -> None:
        said = _unpacked(packet) if len(packet) <= MOST_BYTES else None
        number = said.get("id") if said else None
        try:
            verb, args = _asked(said)
            answer = self._handler(verb, args)
        except DoorError as error:
            peer.send({"id": number, "ok": False, "error": error.to_dict()})
            return
        except Exception as error:  # one request's own mistake must not close the door for all
            peer.send({"id": number, "ok": False, "error": own_error(error).to_dict()})
            return
        if isinstance(answer, Future):
            answer.add_done_callback(lambda done: peer.send({"id": number, **_outcome(done)}))
        else:
            peer.send({"id": number, "ok": True, "result": answer})


def own_error(error: BaseException) -> DoorError:
    """A mistake of ours as an answer."""
    what = f"{type(error).__name__}: {error}"
    return DoorError("busy", f"The service met an error of its own; report this: {what}")


def _outcome(done: Future[Values]) -> Values:
    error = done.exception() if not done.cancelled() else DoorError("busy", "The request was given up.")
    if error is None:
        return {"ok": True, "result": done.result()}
    known = error if isinstance(error, DoorError) else own_error(error)
    return {"ok": False, "error": known.to_dict()}


def _asked(said: Values | None) -> tuple[str, Values]:
    """Verb and arguments of a packet. Raises DoorError."""
    if said is None:
        raise DoorError("bad", f"A request is one JSON object of at most {MOST_BYTES} bytes; correct it.")
    verb, args = said.get("verb"), said.get("args", {})
    if not isinstance(verb, str) or not isinstance(args, dict):
        raise DoorError("bad", 'A request has a "verb" (text) and "args" (an object); correct it.')
    return verb, args


def _packed(said: Values) -> bytes:
    return json.dumps(_plain(said), allow_nan=False, separators=(",", ":")).encode()


def _plain(value: Any) -> Any:
    """JSON has no infinity and no not-a-number; what is unknown is null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return value


def _unpacked(packet: bytes) -> Values | None:
    try:
        said = json.loads(packet, parse_constant=_no_number)
    except (ValueError, RecursionError):
        return None
    return said if isinstance(said, dict) else None


def _no_number(name: str) -> float:
    raise ValueError(f"{name} is no JSON")


def _listening(path: Path, group: str) -> socket.socket:
    """The socket, readable for user and group alone; one that was left behind is replaced."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o750)
    if path.exists() and _answers(path):
        raise FileExistsError(f"{path}: another service answers there; stop it first.")
    with contextlib.suppress(FileNotFoundError):
        if stat.S_ISSOCK(path.lstat().st_mode):
            path.unlink()
    own = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    own.setblocking(False)
    before = os.umask(0o117)
    try:
        own.bind(str(path))
    finally:
        os.umask(before)
    if group:
        import shutil

        shutil.chown(path, group=group)
    own.listen(MOST_PEERS)
    return own


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            return False
    return True


def _let_in(own: socket.socket, gid: int) -> bool:
    """Whether the kernel's word on the peer is one that we know."""
    _, peer_uid, peer_gid = _CREDENTIALS.unpack(
        own.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    )
    return peer_uid in (0, os.geteuid()) or gid in set(_groups(peer_uid, peer_gid))


def _groups(uid: int, gid: int) -> Iterator[int]:
    yield gid
    with contextlib.suppress(KeyError, OSError):
        yield from os.getgrouplist(pwd.getpwuid(uid).pw_name, gid)
