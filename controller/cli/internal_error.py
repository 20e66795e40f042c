"""What a command says where it finds itself wrong: one sentence, and a file to send in."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import sys
import tempfile
import time
import traceback
from datetime import UTC, datetime
from pathlib import Path

from controller import journald, own_files
from controller.api import own_folder
from controller.ipc import control_socket, internal_error
from controller.verify.console import say
from controller.version import VERSION

EXIT_CODE = 70  # EX_SOFTWARE of sysexits.h
FOLDER = "crashes"  # in the state folder, the panel's in its own; ``directrix support`` takes it along
MAX_FILES = 20  # files there


def sentence(error: BaseException) -> str:
    """One sentence; the traceback goes into a file that it names."""
    kept = _saved_report("".join(traceback.format_exception(error)))
    what = kept if kept is not None else say("cli.own_error_line")
    return say("cli.own_error", error=internal_error.summary(error), what=what)


def end(error: BaseException, as_json: bool) -> int:
    """Says it where the command's answer would have been; the exit code."""
    if journald.has_stderr():  # of a service; its own /tmp goes with it
        traceback.print_exception(error)
    words = sentence(error)
    if as_json:
        print(json.dumps({"ok": False, "internal": True, "error": words}))
    else:
        print(words, file=sys.stderr)
    return EXIT_CODE


def _saved_report(text: str) -> Path | None:
    """The file of a new report, in the state folder or for this user alone; None: no room."""
    of = f"directrix {VERSION}, Python {platform.python_version()}"
    now = datetime.now(UTC).isoformat(timespec="seconds")
    head = f"{of}, {platform.platform()}\n{now}\n{' '.join(sys.argv)}\n\n"
    state = control_socket.state_folder()
    for folder in (state, own_folder.of(state)):  # the panel may not write in the service's
        with contextlib.suppress(OSError):  # there is none, or it is another's
            return _in_state(folder, head + text)
    try:
        handle, name = tempfile.mkstemp(prefix="directrix-error-", suffix=".txt")
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(head + text)
    except OSError:
        return None
    return Path(name)


def _in_state(state: Path, text: str) -> Path:
    """A file in a state folder, or in the panel's, of which the oldest ones go. Raises OSError."""
    folder = state / FOLDER
    if not state.is_dir():
        raise FileNotFoundError(str(state))
    own_files.make_folder(folder, state)
    file = folder / f"{time.time_ns()}-{os.getpid()}.txt"
    with own_files.new(file, state, mode=0o640) as out:
        out.write(text.encode("utf-8", errors="backslashreplace"))
    for name in own_files.names(folder, state)[:-MAX_FILES]:
        own_files.remove(folder / name, state)
    return file
