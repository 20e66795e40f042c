"""What others build on: OpenAPI, verbs of the socket, help, keys of machine file and texts, columns."""

from __future__ import annotations

import contextlib
import string
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import fields
from pathlib import Path
from typing import Any

import typer
from support.fakes.fake_engine import FakeEngine, done, served
from support.fakes.panels import Scene
from support.machines.spindle_machine import mill
from support.net import normal

from controller import messages
from controller.__main__ import COMMANDS, app
from controller.api import signals
from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import COLUMN
from controller.machine import keys as machine_keys
from controller.machine import machine_file
from controller.service.command_handlers import CommandHandlers
from controller.service.thread_guard import InThread
from controller.state.modes import Mode
from controller.state.setpoints import TABLES
from controller.verify.trace import Trace

EVERY_KEY = Path(__file__).resolve().parents[2] / "controller" / "machine" / "every_key.toml"
OF_FASTAPI = ("HTTPValidationError", "ValidationError")
ANSWER_S = 60.0


def openapi() -> str:
    """Paths, parameters and models; titles and what FastAPI adds of its own apart."""
    with tempfile.TemporaryDirectory() as folder:
        scene = Scene(Path(folder))
        found = scene.app.openapi()
        scene.store.close()
    found["info"].pop("version", None)
    for name in OF_FASTAPI:
        found["components"]["schemas"].pop(name, None)
    for path in found["paths"].values():
        for operation in path.values():
            if isinstance(operation, dict):
                operation.get("responses", {}).pop("422", None)
    return "".join(f"{line}\n" for line in sorted(normal.lines(_untitled(found))))


def _untitled(value: Any) -> Any:
    if isinstance(value, list):
        return [_untitled(one) for one in value]
    if not isinstance(value, dict):
        return value
    titles = {"title"} if isinstance(value.get("title"), str) else set()
    return {key: _untitled(one) for key, one in value.items() if key not in titles}


# ---- verbs of the socket


class _Asked(dict[str, Any]):
    """Arguments that note by which names they are asked for."""

    def __init__(self, values: dict[str, Any]) -> None:
        super().__init__(values)
        self.names: set[str] = set()

    def get(self, key: str, default: Any = None) -> Any:
        self.names.add(key)
        return super().get(key, default)

    def __getitem__(self, key: str) -> Any:
        self.names.add(key)
        return super().__getitem__(key)

    def __iter__(self) -> Iterator[str]:  # without this dict(asked) takes the values past __getitem__
        return super().__iter__()

    def __contains__(self, key: object) -> bool:
        self.names.add(str(key))
        return super().__contains__(key)


TOOL = {"name": "x", "radius_mm": 1.4, "length_mm": 8.0, "flute_mm": 15.0}
# Arguments with which each verb reads all that it takes; those that take none are not here.
ARGUMENTS: dict[str, tuple[dict[str, Any], ...]] = {
    "load": ({"path": "part.ngc", "name": "part.ngc"}, {"path": "part.ngc", "restart": True}),
    "single_block": ({"on": False},),
    "optional_stop": ({"on": True},),
    "adaptive_feed": ({"on": True},),
    "override": ({"share": 0.5},),
    "rapid_override": ({"share": 0.5},),
    "spindle_override": ({"share": 0.8},),
    "spindle": ({"rev_min": 100.0},),
    "coolant": ({"mist": False, "flood": True},),
    "clamps": ({"open": []},),
    "home": ({"axes": ["X"]},),
    "mdi": ({"text": "G4 P0.1", "still": True},),
    "macro": ({"name": "Park", "still": True, "role": "operate"},),
    "probe": ({"cycle": "probe_top", "values": {}},),
    "retract": ({"mm": 5.0},),
    "withdraw": ({"mm": 5.0},),
    "jog": ({"frame": "joint", "axis": "X", "speed": 0.5, "press": "p"},),
    "jog_step": ({"frame": "joint", "axis": "X", "distance": 1.0},),
    "jog_stop": ({"press": "p"},),
    "set_offset": ({"name": "G55", "values": [1.0, 2.0, 3.0]},),
    "set_tool": ({"number": 2, **TOOL},),
    "forget": ({"name": "G55"},),
    "acknowledge": ({"id": 1}, {}),
    "keep_run": ({"record": "part.ngc", "on": True},),
    "rows": ({"after": 0}, {}),
    "tool_life": ({"tool": 2, "cut_min": 10.0, "parts": 5, "cut_m": 3.0, "sister": 3},),
    "tool_renewed": ({"tool": 2},),
    "maintenance": ({"name": "oil", "counter": "motion", "every": 10.0}, {"name": "oil"}),
    "maintained": ({"name": "oil", "by": "me"},),
    "changer_confirm": ({"clear": True, "spindle": 1, "away": []},),
    "changer_pocket": ({"pocket": 1, "tool": 2},),
    "start": ({"worn": True, "unrecorded": True},),
}


def verbs() -> str:
    """Each verb of the socket, and the names of the arguments that it reads."""
    found: dict[str, set[str]] = {}
    for machine in (mill(), machine_file.load("machining_centre")):
        with tempfile.TemporaryDirectory() as folder:
            service = served(Path(folder), machine)
            desk = CommandHandlers(service)
            try:
                for verb in _verbs_of(desk):
                    found.setdefault(verb, set()).update(_read_arguments(desk, service, verb))
            finally:
                desk.close()
                service.close()
    return "".join(f"{verb} = {' '.join(sorted(names))}\n" for verb, names in found.items())


def _verbs_of(desk: CommandHandlers) -> list[str]:
    try:
        desk("none of them", {})
    except CommandRefused as error:
        return str(error.said["values"]["allowed"]).split(", ")
    raise AssertionError("a verb that there is not was done")


def _read_arguments(desk: CommandHandlers, service: Any, verb: str) -> set[str]:
    """What a machine that stands, with a program loaded, reads of the arguments; before it refuses, if so."""
    program = service.state / "part.ngc"
    program.write_text("G21 G90\nG4 P0.1\nM30\n")
    engine: FakeEngine = service.engine
    names: set[str] = set()
    for values in ARGUMENTS.get(verb, ({},)):
        engine.now = engine.now._replace(mode=Mode.READY)
        service.thread.found = InThread(4.0, 1.25, 7, "part.ngc") if verb == "withdraw" else None
        if verb == "start":
            done(desk, "load", path=str(program))
        asked = _Asked({**values, "path": str(program)} if "path" in values else values)
        with contextlib.suppress(CommandRefused):
            answer = desk(verb, asked)
            if isinstance(answer, Future):
                answer.result(ANSWER_S)
        names |= asked.names
    return names


# ---- the command line


def help_texts() -> str:
    """Of every verb its text, and its arguments and options with theirs."""
    before = sys.argv
    sys.argv = ["directrix", "check"]  # a command line of which only help is asked knows no bodies
    try:
        group: Any = typer.main.get_command(app)
        rows = (_of_command(name, group.load(name)) for name in sorted(COMMANDS))
        text = "".join(f"{line}\n" for one in rows for line in one)
    finally:
        sys.argv = before
    return text.replace(tempfile.gettempdir(), "/tmp")


def _of_command(name: str, command: Any) -> Iterator[str]:
    yield f"{name} = {_line(command.help)}"
    for option in command.params:
        if option.name == "help":
            continue
        names = " ".join(sorted((*option.opts, *option.secondary_opts))) or option.name
        kind = "|".join(option.type.choices) if hasattr(option.type, "choices") else "value"
        kind = "flag" if getattr(option, "is_flag", False) else kind
        needed = " needed" if option.required else ""
        yield f"{name} {names} ({kind}{needed}) = {_line(getattr(option, 'help', ''))}"
    for below, one in sorted(getattr(command, "commands", {}).items()):
        yield from _of_command(f"{name} {below}", one)


def _line(text: str | None) -> str:
    return " ".join((text or "").split())


# ---- keys and columns


def keys() -> str:
    """Of every key of the machine file what it may be, and what it is where the file is silent."""
    rows = [
        f"{one.name}.{name} = {machine_keys.allowed(key)} | {machine_keys.left_out(key, one.called)}\n"
        for one in machine_keys.sections()
        for key in one.keys
        for name in key.spelled
    ]
    return "".join(sorted(rows))


def texts() -> str:
    """Keys of all texts and what they have places for, by language."""
    rows = []
    for language, catalogue in messages.LANGUAGES.items():
        for section in ("page", "texts"):
            for key, text in sorted(getattr(catalogue, section).items()):
                places = sorted({name for _, name, _, _ in string.Formatter().parse(str(text)) if name})
                rows.append(f"{language} {section} {key} = {' '.join(places)}\n")
    return "".join(rows)


def columns() -> str:
    """In their order: of the recorder, of a run's record, of a trace; and the names of signals."""
    rows = [f"recorder {k:03d} = {name}\n" for name, k in COLUMN.items()]
    rows += [f"run {k:03d} = {name}\n" for table in TABLES for k, name in enumerate(table.columns)]
    rows += [f"trace {k:03d} = {one.name}\n" for k, one in enumerate(fields(Trace))]
    told = signals.names(machine_file.load("machining_centre"))
    return "".join([*rows, *(f"signal {name} = {unit}\n" for name, unit in sorted(told.items()))])
