"""The door from inside: lets in whom it may, reads one request after another, sends the answers.

One thread reads all of it, so that a hold never waits for another verb's work: a handler that
cannot answer at once gives a ``Future``. The protocol is told in ``controller.ipc.control_socket``.
"""

from __future__ import annotations

import contextlib
import errno
import os
import pwd
import selectors
import shutil
import socket
import stat
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from controller import own_files
from controller.ipc.asker import ROLES, Asker, asker, name_of, of_request, of_socket
from controller.ipc.asker import peer as peer_uid
from controller.ipc.control_socket import (
    BUFFER_BYTES,
    MAX_ANSWER,
    MAX_BYTES,
    MAX_PEERS,
    Answer,
    CommandRefused,
    Values,
    is_served,
    own_error,
    packed,
    unpacked,
)
from controller.messages import message
from controller.service.refusals import refused

Handler = Callable[[str, Values], Answer]
Hears = Callable[[Answer], object]
Noted = Callable[[str, Values, Asker, str], AbstractContextManager[Hears]]  # around one; last the peer's name


def _not_noted(verb: str, args: Values, asker: Asker, peer: str) -> AbstractContextManager[Hears]:
    return contextlib.nullcontext(lambda _: None)


class _Peer:
    """One connection; answers may be sent by any thread."""

    def __init__(self, own: socket.socket) -> None:
        own.setblocking(False)
        own.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
        self.socket, self.uid = own, of_socket(own)[0]
        self.user = name_of(self.uid)  # asked once: it may be a directory's, far away
        self._lock = threading.Lock()

    def answer(self, number: int | str | None, outcome: Values | BaseException) -> None:
        """One who does not read its answers loses them."""
        packet = _packet(number, outcome)
        with self._lock, contextlib.suppress(OSError):
            self.socket.send(packet)

    def close(self) -> None:
        with self._lock:
            self.socket.close()


class Server:
    """The door, open from construction to ``close``; ``handler`` is called in the door's own thread.

    A handler answers at once, or gives a Future; it raises CommandRefused where a request is not done.
    """

    def __init__(self, path: Path, handler: Handler, group: str = "", noted: Noted = _not_noted) -> None:
        """``group``: whose members are let in besides the user; "" = the process' own. ``noted`` is around
        each request, and may refuse it. Raises OSError.
        """
        self._path, self._handler, self._noted = path, handler, noted
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
        peer = _Peer(own)
        if (error := self._unwelcome(own)) is not None:
            peer.answer(None, error)
            peer.close()
            return
        self._peers[own.fileno()] = peer
        self._selector.register(own, selectors.EVENT_READ)

    def _unwelcome(self, own: socket.socket) -> CommandRefused | None:
        """Why a peer is sent away; None where it may stay."""
        if not _let_in(own, self._gid):
            return refused("stranger", path=self._path)
        if len(self._peers) >= MAX_PEERS:
            return refused("many_peers", code="busy", path=self._path, most=MAX_PEERS)
        return None

    def _read(self, fileno: int) -> None:
        peer = self._peers[fileno]
        try:
            packet = peer.socket.recv(MAX_BYTES + 1)
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
        said = unpacked(packet) if len(packet) <= MAX_BYTES else None
        number = _number(said)
        try:
            verb, args = _verb_and_args(said)
            asker.set(who := _asker(said, peer.user))
            peer_uid.set(peer.uid)
            with self._noted(verb, args, who, peer.user) as hear:
                answer = self._handler(verb, args)
                hear(answer)
        except Exception as error:  # one request's own mistake must not close the door for all
            peer.answer(number, error)
            return
        if isinstance(answer, Future):
            answer.add_done_callback(lambda done: peer.answer(number, done.exception() or done.result()))
        else:
            peer.answer(number, answer)


def _packet(number: int | str | None, outcome: Values | BaseException) -> bytes:
    """An answer. A result that makes none is a mistake of ours, which is told instead."""
    if not isinstance(outcome, BaseException):
        try:
            packet = packed({"id": number, "ok": True, "result": outcome})
            if len(packet) <= MAX_ANSWER:
                return packet
            outcome = refused("long_answer", code="busy", bytes=len(packet), most=MAX_ANSWER)
        except (TypeError, ValueError, RecursionError) as error:
            outcome = error
    known = outcome if isinstance(outcome, CommandRefused) else own_error(outcome)
    return packed({"id": number, "ok": False, "error": known.to_dict()})


def _number(said: Values | None) -> int | str | None:
    """Of a request; what else stands there may be nested deeper than can be given back."""
    number: Any = said.get("id") if said else None
    return number if isinstance(number, int | str) else None


def _verb_and_args(said: Values | None) -> tuple[str, Values]:
    """Verb and arguments of a packet. Raises CommandRefused."""
    if said is None:
        raise refused("no_object", code="bad", most=MAX_BYTES)
    verb, args = said.get("verb"), said.get("args", {})
    if not isinstance(verb, str) or not isinstance(args, dict):
        raise refused("no_verb_or_args", code="bad")
    return verb, args


def _asker(said: Values | None, peer: str) -> Asker:
    """Raises CommandRefused."""
    try:
        return of_request(said or {}, peer)
    except ValueError:
        raise refused("no_asker", code="bad", allowed=", ".join(ROLES)) from None


def _listening(path: Path, group: str) -> socket.socket:
    """The socket, readable for user and group alone; one that was left is replaced."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o750)
    if is_served(path):
        raise own_files.refusal(errno.EEXIST, message("another_service"), path)
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
        shutil.chown(path, group=group)
    own.listen(MAX_PEERS)
    return own


def _let_in(own: socket.socket, gid: int) -> bool:
    """Whether the kernel's word on the peer is one that we know."""
    peer_uid, peer_gid = of_socket(own)
    return peer_uid in (0, os.geteuid()) or gid in set(_groups(peer_uid, peer_gid))


def _groups(uid: int, gid: int) -> Iterator[int]:
    yield gid
    with contextlib.suppress(KeyError, OSError):
        yield from os.getgrouplist(pwd.getpwuid(uid).pw_name, gid)
