"""The local door of the service: who may speak through it, and how; and the asking side.

A SEQPACKET socket in the file system, one JSON object a packet. Every request names a verb
and gets one answer with its ``id``; what takes long answers late, and others overtake it:

    {"id": 7, "verb": "hold", "args": {}}
    {"id": 7, "ok": true, "result": {...}}
    {"id": 7, "ok": false, "error": {"code": "refused", "mode": "RUNNING", "request": "HOME",
                                     "key": "refused", "values": {...}}}

What is said is a key with its values (see ``messages``): whoever asked puts it into words. Beside ``args``
a request may name for whom it is, as the panel does: ``"by": {"user": "anna", "role": "operate", "address":
"10.0.0.7"}``.

The kernel tells who connects (SO_PEERCRED): the same user, root, and members of the group that
owns the socket are let in; and who answers, see ``asker.may_serve``. The answering side is
``controller.service.socket_server``.
"""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import socket
import threading
import time
from collections.abc import Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from controller import atomic_file, messages, own_files, sealed_file
from controller.ipc import internal_error
from controller.ipc.asker import Asker, may_serve, name_of, of_socket
from controller.messages import Key, Message, message, plain

Values = dict[str, Any]
Answer = Values | Future[Values]

CONTROL = "control.sock"  # in the runtime folder
RUNTIME = "runtime"  # in the state folder: a file that says which one that is
LAST = "last_told.json"  # in the state folder: status and facts, as they hold where nobody answers any more
MAX_BYTES = 200_000  # of a request; bigger things go by their path in the store
MAX_ANSWER = 2 * MAX_BYTES  # of an answer
MAX_PEERS = 64
CODES = ("refused", "bad", "missing", "busy", "gone", "silent", "unrecorded", "worn")
FACTS = ("code", "mode", "request")  # of a refusal, beside what it says
ANSWER_TIMEOUT_S = 600.0  # a whole program may have to be read before the answer
BUFFER_BYTES = 1 << 20  # of a socket


class CommandRefused(Exception):
    """Why a request was not done, for the operator; ``sentence`` is it in English.

    ``code``: "refused" by the machine's state, "bad" request, "missing": what it is about is not there,
    "busy", "gone" = nobody is there to answer, "silent" = somebody is, and does not; "unrecorded",
    "worn" = it would be done if that were confirmed.
    """

    def __init__(self, code: str, said: Message | str, mode: str = "", request: str = "") -> None:
        """``said``: a sentence alone where it has no key, as that of a program's reader."""
        self.said = plain(said)
        super().__init__(self.sentence)
        self.code, self.mode, self.request = code, mode, request

    @property
    def sentence(self) -> str:
        return messages.text(self.said)

    def to_dict(self) -> Values:
        return {**{name: getattr(self, name) for name in FACTS}, **self.said}

    @classmethod
    def from_dict(cls, told: Mapping[str, Any]) -> CommandRefused:
        values = told.get("values")
        key = Message(
            key=str(told.get("key") or "no_reason"), values=values if isinstance(values, dict) else {}
        )
        return cls(said=key, **{name: str(told.get(name, "")) for name in FACTS})


def control_path(runtime: Path) -> Path:
    """Where the door is, in a runtime folder."""
    return runtime / CONTROL


def runtime_folder() -> Path:
    """Where sockets are unless told otherwise: systemd's folder, the user's, or one in his state folder."""
    if given := os.environ.get("RUNTIME_DIRECTORY"):
        return Path(given.split(":")[0])
    if base := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(base) / "directrix"
    return state_folder() / "run"


def note_runtime(state: Path, runtime: Path) -> None:
    """Note beside what a service keeps where its sockets are. Raises OSError."""
    atomic_file.note(state / RUNTIME, str(runtime.absolute()))


def runtime_of(state: Path) -> Path:
    """Where the service of a state folder has, or had, its sockets; the usual place where none has run.

    Whoever works on a state folder asks for its own service by this: another user's usual place is
    not where systemd's service is.
    """
    try:
        noted = Path(own_files.read_text(state / RUNTIME))
        return noted if noted.is_absolute() and "\0" not in str(noted) else runtime_folder()
    except (OSError, ValueError):
        return runtime_folder()


def last_known(state: Path, what: str) -> Values:
    """The "status" or "facts" that the service of a state folder stored last, with ``gone_s``: so long ago.

    Empty where nothing is known.
    """
    try:
        file = state / LAST
        told, ago_s = sealed_file.read(file), time.time() - file.lstat().st_mtime
    except (OSError, ValueError):
        return {}
    found = told.get(what) if isinstance(told, dict) else None
    return {**found, "gone_s": max(0.0, ago_s)} if isinstance(found, dict) else {}


def state_folder() -> Path:
    """Where what must last is kept unless told otherwise: systemd's folder, or the XDG state folder."""
    if given := os.environ.get("STATE_DIRECTORY"):
        return Path(given.split(":")[0])
    base = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    return Path(base) / "directrix"


# ---- the asking side


def is_served(path: Path) -> bool:
    """Whether a service is behind a socket, be it that it hangs or that it does not let us in."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as probe:
        probe.setblocking(False)
        try:
            probe.connect(str(path))
        except OSError as error:
            return error.errno in (errno.EAGAIN, errno.EACCES)
    return True


class Client:
    """Asks the service. Any number of threads may use one; each request has a connection to itself."""

    def __init__(self, path: Path, longest_s: float = ANSWER_TIMEOUT_S) -> None:
        """``path``: of the socket; ``longest_s``: how long an answer may take."""
        self._path, self._longest_s = path, longest_s
        self._idle: list[socket.socket] = []
        self._lock = threading.Lock()
        self._number = 0

    def ask(self, verb: str, **args: Any) -> Values:
        """The result of a verb. Raises CommandRefused."""
        return self.ask_for(None, verb, args)

    def ask_for(self, asker: Asker | None, verb: str, args: Values) -> Values:
        """As ``ask``; ``asker``: for whom, None: this process' user."""
        number, packet = self._packet(verb, args, asker)
        own = self._take()
        try:
            try:
                own.send(packet)
            except ConnectionError:  # opened before the service was started anew: nothing went out
                own.close()
                own = self._take(fresh=True)
                with contextlib.suppress(ConnectionError):  # sent away at once: why is there to be read
                    own.send(packet)
            return self._answer(own, number)
        except ConnectionError as error:
            own.close()
            raise self._unanswered(verb) from error
        except OSError as error:
            own.close()
            raise self._silent(error) from error

    def close(self) -> None:
        with self._lock:
            for own in self._idle:
                own.close()
            self._idle.clear()

    def _packet(self, verb: str, args: Values, asker: Asker | None) -> tuple[int, bytes]:
        """The number of a request, and the request."""
        with self._lock:
            self._number += 1
            number = self._number
        by = {} if asker is None else {"by": asker.to_json()}
        packet = packed({"id": number, "verb": verb, "args": args, **by})
        if len(packet) > MAX_BYTES:
            raise CommandRefused("bad", message("long_request", verb=verb, bytes=len(packet)))
        return number, packet

    def _answer(self, own: socket.socket, number: int) -> Values:
        while True:
            told = unpacked(_received(own))
            if told is None:
                raise ConnectionResetError
            if told.get("id") in (number, None):
                break
        if told.get("id") is None:  # this peer was sent away
            own.close()
        else:
            with self._lock:
                self._idle.append(own)
        if told.get("ok"):
            return dict(told.get("result") or {})
        raise CommandRefused.from_dict(told.get("error") or {})

    def _take(self, fresh: bool = False) -> socket.socket:
        """A connection; ``fresh``: those that are there are of no use any more."""
        with self._lock:
            if fresh:
                for old in self._idle:
                    old.close()
                self._idle.clear()
            elif self._idle:
                return self._idle.pop()
        own = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        own.settimeout(self._longest_s)
        own.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
        try:
            own.connect(str(self._path))
            uid = of_socket(own)[0]
            if not may_serve(uid, self._path):
                own.close()
                raise CommandRefused("silent", message("stranger_serves", path=self._path, user=name_of(uid)))
        except (FileNotFoundError, ConnectionError) as error:
            own.close()
            raise CommandRefused("gone", message("no_service", path=self._path, why=error)) from error
        except OSError as error:
            own.close()
            raise self._silent(error) from error
        return own

    def _unanswered(self, verb: str) -> CommandRefused:
        """The service ended after it was asked: to ask the next one again might do a thing twice."""
        try:
            self._take(fresh=True).close()
        except CommandRefused as error:
            return error
        return CommandRefused("silent", message("started_anew", path=self._path, verb=verb))

    def _silent(self, error: OSError) -> CommandRefused:
        """Somebody holds the socket: what is loaded there may be running."""
        if isinstance(error, PermissionError):
            return CommandRefused("silent", message("stranger", path=self._path))
        why = error if error.strerror else Key("no_answer_within")
        return CommandRefused(
            "silent", message("silent_door", path=self._path, why=why, seconds=self._longest_s)
        )


def _received(own: socket.socket) -> bytes:
    """The next packet, also of a service that closed behind it and did not read what we had sent."""
    try:
        return own.recv(MAX_ANSWER)
    except ConnectionResetError:
        return own.recv(MAX_ANSWER)


# ---- what both sides need


def own_error(error: BaseException) -> CommandRefused:
    """A mistake of ours as an answer."""
    return CommandRefused("busy", message("own_error", error=internal_error.summary(error)))


def packed(told: Values) -> bytes:
    try:
        return _text(told)
    except (TypeError, ValueError):  # seldom, and to look for it first would cost more than to write
        return _text(as_json(told))


def _text(told: Values) -> bytes:
    return json.dumps(told, allow_nan=False, separators=(",", ":")).encode()


def as_json(value: Any) -> Any:
    """JSON has no infinity and no not-a-number; what is unknown is null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): as_json(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(one) for one in value]
    return value


def unpacked(packet: bytes) -> Values | None:
    try:
        told = json.loads(packet, parse_constant=_no_number)
    except (ValueError, RecursionError):
        return None
    return told if isinstance(told, dict) else None


def _no_number(name: str) -> float:
    raise ValueError(f"{name} is no JSON")
