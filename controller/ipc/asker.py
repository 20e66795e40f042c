"""Who is behind a request: the kernel's word on the other end of a socket, and whom that speaks for."""

from __future__ import annotations

import os
import pwd
import socket
import stat
import struct
from collections.abc import Mapping
from contextvars import ContextVar
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

ROLES = ("view", "operate", "set_up")  # each may do what those before it may
LONGEST = 80  # characters of a name or an address
_CREDENTIALS = struct.Struct("3i")  # pid, uid, gid


@dataclass(frozen=True, slots=True)
class Asker:
    """A user of the panel, or of this computer; ``address``: where the panel has heard him from."""

    user: str
    role: str = ROLES[-1]
    address: str = ""

    def to_json(self) -> dict[str, str]:
        return asdict(self)


asker: ContextVar[Asker | None] = ContextVar("asker", default=None)  # for whom something is asked, or done
peer: ContextVar[int | None] = ContextVar("peer", default=None)  # the user at the socket; None: nobody else


def of_socket(own: socket.socket) -> tuple[int, int]:
    """Numbers of user and group at the other end (SO_PEERCRED); of a server, as it began to listen.

    Raises OSError.
    """
    sent = own.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    _, uid, gid = _CREDENTIALS.unpack(sent)
    return uid, gid


def of_request(request: Mapping[str, Any], peer: str) -> Asker:
    """Whom it names (``by``), else the user at the other end. Raises ValueError for what names nobody."""
    by = request.get("by")
    if by is None:
        return Asker(peer)
    found = {name: by.get(name, "") for name in ("user", "role", "address")} if isinstance(by, dict) else {}
    whole = found and all(isinstance(one, str) and len(one) <= LONGEST for one in found.values())
    if not whole or found["role"] not in ROLES or not found["user"]:
        raise ValueError("by")
    return Asker(**found)


def name_of(uid: int) -> str:
    """Of a user of this computer; the number where he has none."""
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return str(uid)


def may_serve(uid: int, path: Path) -> bool:
    """Whether it is right that this user has a socket: ourselves, root, or whose folder only root could make.

    So nobody is asked who has made a folder of that name where anybody may, as in /tmp. Raises OSError.
    """
    ours = (0, os.geteuid())
    if uid in ours:
        return True
    folder, above = path.parent.stat(), path.parent.parent.stat()
    others_write = (folder.st_mode | above.st_mode) & (stat.S_IWGRP | stat.S_IWOTH)
    return uid == folder.st_uid and above.st_uid in ours and not others_write
