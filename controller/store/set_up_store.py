"""What is set up at a machine, in the service's store: offsets and tools, and the tool in the spindle.

The service has it in memory, and puts what changes; whoever stands beside it reads here.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import sqlite3
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from controller import own_files
from controller.machine import setup_data
from controller.machine.model import Machine
from controller.machine.toml_table import ConfigError
from controller.messages import message, of_error
from controller.store import service_store, tool_store

FITTING = "fitting"  # document: values as ``setup_data`` has them
SPINDLE = "in_spindle"  # document: number of a tool, 0 = not known


def load(state: Path) -> dict[str, Any]:
    """What was set over the machine file; nothing where nothing was. Raises ConfigError."""
    file = state / service_store.FILE
    try:
        return setup_data.sound(service_store.document_of(state, FITTING), file)
    except FileNotFoundError:  # no service of this version has run yet
        return setup_data.read(state / setup_data.FILE, {})
    except (OSError, ValueError, sqlite3.Error) as error:
        raise ConfigError(message("file.kept_unread", file=file, why=of_error(error))) from error


def machine(state: Path) -> Machine:
    """The machine of the service that runs, or ran last, on a state folder, as it is fitted.

    Raises ConfigError, and OSError or ValueError where no service has noted it.
    """
    return setup_data.applied(setup_data.noted(state), load(state))


def sum_of(state: Path) -> str:
    """One hash of all that ``machine`` is made of. Raises ConfigError, OSError."""
    noted, fitted = own_files.read_bytes(state / setup_data.MACHINE), "{}"
    if (state / service_store.FILE).exists():
        fitted = _fitted(state, service_store.stamp(state))
    return hashlib.sha256(noted + b"\0" + fitted.encode()).hexdigest()


@lru_cache(maxsize=4)
def _fitted(state: Path, _: tuple[object, ...]) -> str:
    return json.dumps(load(state), sort_keys=True)


def file_with(file: Path | None, fitted: Mapping[str, Any], tools: Mapping[str, Any]) -> bytes:
    """The service's store as it is in ``file``, which is settled (None: an empty one), but as a back-up has
    it; without rows of ``tools`` those that are there.

    Raises ValueError for rows that cannot stand there.
    """
    with contextlib.closing(service_store.in_memory(file)) as sql:
        service_store.put_document(sql, FITTING, fitted)
        if tools:
            tool_store.replace(sql, tools)
        return sql.serialize()
