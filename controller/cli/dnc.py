"""``directrix dnc``: programs over a serial line, into the program store and out of it."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from controller.api import dnc
from controller.api.dnc import LineError, LineSettings
from controller.api.dnc_format import Tape, TapeError, punched
from controller.api.store import Program, Store, StoreError
from controller.cli.speech import Verbs
from controller.ipc import control_socket
from controller.messages import Message, message
from controller.verify.console import Refused, bar, in_words, refusals, say, tell

app = Verbs(add_completion=False, no_args_is_help=True)

Port = Annotated[str, typer.Option("--port")]
Format = Annotated[Literal["7E2", "7E1", "8N1"], typer.Option("--format")]

LINE_ENDS = {"own": None, "lf": b"\n", "crlf": b"\r\n", "cr": b"\r", "lfcrcr": b"\n\r\r"}
BY = "serial line"
ANSWER_TIMEOUT_S = 5.0  # of the service


@app.command()
def receive(
    port: Port,
    baud: int = 9600,
    data_format: Format = "7E2",
    flow: Literal["xon", "rts", "none"] = "xon",
    name: str = "",
    forever: bool = False,
    silence_s: float = 20.0,
    wait_s: float = 600.0,
    state: Path | None = None,
    runtime: Path | None = None,
    as_json: bool = False,
) -> None:
    """Take a program from the line into the store, whole or not at all; it does not start.

    Several that come in one go are stored by their own numbers. What was left out within a line is told.
    """
    with refusals(as_json):
        # Who waits forever is in no hurry for the first one either.
        settings = LineSettings(port, baud, data_format, flow, silence_s, math.inf if forever else wait_s)
        settings.check()
        store = Store(state or control_socket.state_folder())
        used = _in_use(store.folder, runtime)
        while True:
            try:
                _take(settings, store, name, used, as_json)
            except (TapeError, StoreError) as error:
                if not forever or isinstance(error, LineError):
                    raise
                tell.print(in_words(error.said))
            if not forever:
                return


def _take(
    settings: LineSettings, store: Store, name: str, in_use: Callable[[], Collection[str]], as_json: bool
) -> None:
    """One transmission into the store; what was not kept of it is the refusal."""
    with bar(say("cli.dnc.receiving", port=settings.port), as_json) as progress, dnc.opened(settings) as line:
        came = dnc.receive(line, lambda count: progress(0.0, say("cli.dnc.bytes", count=count)))
    if name and len(came.tapes) > 1:
        listed = ", ".join(tape.name or say("cli.dnc.unnumbered") for tape in came.tapes)
        raise TapeError(message("cli.dnc.several", port=settings.port, count=len(came.tapes), listed=listed))
    for tape in came.tapes:
        _say(save_tape(store, tape, name, in_use()), "cli.dnc.received", as_json, tape.told)
    if came.problem:
        raise TapeError(came.problem)


def save_tape(store: Store, tape: Tape, name: str, in_use: Collection[str]) -> Program:
    """Store the tape as a program. Raises StoreError."""
    called = name or tape.name or time.strftime("received %Y-%m-%d %H.%M.%S")
    with store.uploads.begin(called, size=len(tape.text), by=BY) as upload:
        upload.write(tape.text)
        return upload.commit(in_use)


def _in_use(state: Path, runtime: Path | None) -> Callable[[], Collection[str]]:
    """Asks the service what is loaded, each time anew; where none is there, nothing is."""

    def ask() -> Collection[str]:
        socket = control_socket.control_path(runtime or control_socket.runtime_of(state))
        if not control_socket.is_served(socket):
            return ()
        client = control_socket.Client(socket, longest_s=ANSWER_TIMEOUT_S)
        try:
            job = client.ask("status").get("job") or {}
        except control_socket.CommandRefused as error:
            sentence = message("cli.dnc.unknown_use", why=error)
            raise StoreError("running", sentence) from error
        finally:
            client.close()
        return [str(job[key]) for key in ("name", "sha256") if job.get(key)]

    return ask


@app.command()
def send(
    program: str,
    port: Port,
    baud: int = 9600,
    data_format: Format = "7E2",
    flow: Literal["xon", "rts", "none"] = "xon",
    file: bool = False,
    line_end: Literal["own", "lf", "crlf", "cr", "lfcrcr"] = "own",
    checksum: bool = True,
    await_start: bool = False,
    silence_s: float = 20.0,
    wait_s: float = 600.0,
    state: Path | None = None,
    as_json: bool = False,
) -> None:
    """Punch a program out; read back by receive it is identical."""
    with refusals(as_json):
        settings = LineSettings(port, baud, data_format, flow, silence_s, wait_s)
        settings.check()
        text = Path(program).read_bytes() if file else _of_store(program, state)
        try:
            tape = punched(text, settings.even_parity, LINE_ENDS[line_end], with_sum=checksum)
        except TapeError as error:
            raise Refused(f"{program}: {in_words(error.said)}") from error
        with bar(say("cli.dnc.sending", port=port), as_json) as progress, dnc.opened(settings) as line:
            dnc.send(line, tape, lambda count: progress(count / len(tape)), await_start)
        _say({"program": program, "bytes": len(tape)}, "cli.dnc.sent", as_json)


def _of_store(name: str, state: Path | None) -> bytes:
    store = Store(state or control_socket.state_folder())
    return store.programs.read(store.programs.get(name).sha256)


def _say(
    told: Program | dict[str, Any], done: str, as_json: bool, left_out: Collection[Message] = ()
) -> None:
    sentences = [in_words(one) for one in left_out]
    facts = (
        {"program": told.name, "bytes": told.size, "lines": told.lines, "sha256": told.sha256}
        if isinstance(told, Program)
        else told
    )
    if as_json:
        more = {"left_out": sentences} if sentences else {}
        print(json.dumps({"ok": True, **facts, **more}), flush=True)
        return
    tell.print(say(done, program=facts["program"], bytes=facts["bytes"]))
    for sentence in sentences:
        tell.print(f"{facts['program']}: {sentence}")
