"""A fault script for a whole machine: the lines of ``drives.bench.virtual.fault_script``, each on its bus.

    at 2.5 s: drop rpdo 4 x 20              the node's id names the bus, where it is the only one
    at 2.5 s: drop rpdo Y x 20              or the axis in its place (also: spindle, io)
    on can1: at sync 1200: drop sync x 2    the bus itself, where the machine has several

Times and SYNCs count on every bus from the moment that ``inject`` is given: where a program
begins, ``at sync 1`` is the SYNC of its tick 0, and ``at 0 s`` the time at which that is sent.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, NoReturn

from controller.machine import machine_file
from controller.machine.model import Machine
from drives import pdo
from drives.bench.virtual.fault_script import MASTER, Action, FaultScript, Injection, ScriptError, parse
from drives.bench.virtual.virtual_bus import SteppedBus
from drives.texts import message

NODE_BITS = 0x7F  # of an identifier (CiA 301, 7.3.5)
OF_IDENTIFIERS = ("babble", "foreign")  # these begin to send
LAST_OF_A_NODE = 0x7FF


class Station(NamedTuple):
    """A node of the machine."""

    name: str  # of the axis; "spindle", "io"
    bus: str
    node: int


class Aimed(NamedTuple):
    """One fault and the bus on which it happens; ``number``: its line in the file."""

    bus: str
    injection: Injection
    number: int

    @property
    def text(self) -> str:
        return f"on {self.bus}: {self.injection.text()}"


class Done(NamedTuple):
    """A line that has happened: when its first frame, or deed, was (s after the origin), and how many."""

    line: str
    time_s: float
    times: int


@dataclass(frozen=True, slots=True)
class MachineScript:
    """The faults of a run, in the order of writing."""

    faults: tuple[Aimed, ...] = ()
    seed: int = 0

    @staticmethod
    def read(text: str, machine: Machine) -> MachineScript:
        """Raises ScriptError with the number of the line."""
        stations, buses = stations_of(machine), [bus.name for bus in machine.buses]
        seeds, found = [], []
        for number, line in enumerate(text.splitlines(), 1):
            words = line.partition("#")[0].strip()
            try:
                if words.startswith("seed"):
                    seeds.append(FaultScript.read(words).seed)
                elif words:
                    found.append(Aimed(*_aimed(words, stations, buses), number))
            except ScriptError as error:
                own = error.said["values"]["why"] if error.said["key"] == "script.line" else error.said
                raise ScriptError(message("script.line", line=number, why=own)) from None
        return MachineScript(tuple(found), seeds[-1] if seeds else 0)

    @staticmethod
    def load(path: Path, machine: Machine) -> MachineScript:
        """Raises OSError, and ScriptError with file and line."""
        try:
            return MachineScript.read(path.read_text(encoding="utf-8"), machine)
        except UnicodeDecodeError as error:
            raise ScriptError(message("script.no_text", path=path, start=error.start)) from None
        except ScriptError as error:
            raise ScriptError(message("script.file", file=path, why=error)) from None

    def inject(self, buses: Mapping[str, SteppedBus], after_s: float = 0.0) -> Injected:
        """Have them happen on the machine's buses; times and SYNCs count from ``after_s`` on."""
        return Injected(self, buses, after_s)


class Injected:
    """A script at work on the buses of a machine."""

    def __init__(self, script: MachineScript, buses: Mapping[str, SteppedBus], after_s: float = 0.0) -> None:
        self._origins_s = {name: bus.now_s + after_s for name, bus in buses.items()}
        empty = FaultScript((), script.seed)
        self._injectors = {name: empty.inject(bus, self._origins_s[name]) for name, bus in buses.items()}
        self._faults: list[Aimed] = []
        self.add(script.faults)

    def add(self, faults: Sequence[Aimed]) -> None:
        """More of them; their times count from the same moment."""
        for fault in faults:
            self._injectors[fault.bus].add(fault.injection)
        self._faults += faults

    def done(self) -> list[Done]:
        """What has happened, line by line."""
        told = []
        for fault in self._faults:
            times_s = [at_s for at_s, line in self._log(fault) if line == fault.injection.text()]
            if times_s:
                told.append(Done(fault.text, times_s[0] - self._origins_s[fault.bus], len(times_s)))
        return told

    def left(self) -> list[str]:
        """The lines of which nothing has happened."""
        return [
            fault.text
            for fault in self._faults
            if all(line != fault.injection.text() for _, line in self._log(fault))
        ]

    def _log(self, fault: Aimed) -> Sequence[tuple[float, str]]:
        return self._injectors[fault.bus].log


def stations_of(machine: Machine) -> tuple[Station, ...]:
    """Axes, spindle and inputs and outputs, as far as they have a node."""
    return tuple(Station(node.name, node.bus, node.node) for node in machine_file.all_settings(machine))


def _aimed(words: str, stations: Sequence[Station], buses: Sequence[str]) -> tuple[str, Injection]:
    """A line's bus and fault. Raises ScriptError."""
    on, line = _on(words, buses)
    line, named = _numbered(line, stations)
    injection = parse(line)
    node = _node_of(injection)
    if named is not None:
        if on not in ("", named.bus):
            raise ScriptError(message("script.other_bus", name=named.name, bus=named.bus, on=on))
        return named.bus, injection
    here = [s for s in stations if s.node == node and on in ("", s.bus)]
    must = injection.node is not None and injection.node != MASTER
    if must and not here:
        ids = ", ".join(f"{s.node} ({s.name})" for s in stations if on in ("", s.bus))
        key = "script.not_on_bus" if on else "script.not_on_machine"
        raise ScriptError(message(key, node=node, bus=on, known=ids))
    if on or len(buses) == 1:
        return on or buses[0], injection
    if len({s.bus for s in here}) != 1:
        _refuse_bus(node, here, buses)
    return here[0].bus, injection


def _on(words: str, buses: Sequence[str]) -> tuple[str, str]:
    """The bus before the line, "" where none is named, and the line."""
    found = re.match(r"on\s+([^\s:]+)\s*:\s*", words)
    if found is None:
        if re.match(r"on\b", words):
            raise ScriptError(message("script.on", words=words, bus=buses[0]))
        return "", words
    if found[1] not in buses:
        raise ScriptError(message("script.no_bus", bus=found[1], names=", ".join(buses)))
    return found[1], words[found.end() :]


def _numbered(line: str, stations: Sequence[Station]) -> tuple[str, Station | None]:
    """The line with a node's number in the place of its name."""
    head, colon, rest = line.partition(":")
    tokens = rest.split()
    named = {station.name: station for station in stations}
    at = 1 if tokens and _takes_node(tokens[0]) else 2
    if at < len(tokens) and tokens[at] in named:  # "sto Y", "drop rpdo Y"
        station = named[tokens[at]]
        tokens[at] = str(station.node)
        return f"{head}{colon} {' '.join(tokens)}", station
    return line, None


def _takes_node(name: str) -> bool:
    """Whether an action's target is a node at once; of frames a word comes first, or A is an identifier."""
    return any(a.value == name and not a.of_frames and name not in OF_IDENTIFIERS for a in Action)


def _node_of(injection: Injection) -> int:
    """Whom it befalls: a node, or who owns the identifier; 0 = nobody alone."""
    if injection.node is not None:
        return injection.node
    can_id = injection.can_id or 0
    return can_id & NODE_BITS if pdo.EMCY < can_id <= LAST_OF_A_NODE else 0


def _refuse_bus(node: int, here: Sequence[Station], buses: Sequence[str]) -> NoReturn:
    if len(here) > 1:
        names, on = ", ".join(s.name for s in here), ", ".join(s.bus for s in here)
        raise ScriptError(message("script.which_axis", node=node, on=on, names=names, bus=here[0].bus))
    raise ScriptError(message("script.several_buses", bus=buses[0], names=", ".join(buses)))
