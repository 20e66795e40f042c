"""``directrix machine new``: a machine file from answers, with the meaning of each key."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from controller import atomic_file
from controller.cli import new_files, toml_rows
from controller.machine import drive_profiles, keys, machine_file
from controller.machine.named_files import SHIPPED
from controller.verify.console import Refused, answered, refusals, say, show

Tree = dict[str, Any]

# Shipped machines, by how each is built.
KINDS = ("trunnion", "fig4b", "fig4c", "fig4d", "oblique45", "table_head", "head_head", "three_axes")
EQUIPPED = "machining_centre"  # the shipped machine whose node, changer, probe and setter are taken
SPINDLES = ("none", "hand", "inverter", "modbus", "drive")
SPINDLE_TABLES: dict[str, Tree] = {
    "hand": {"max_rev_min": 24000, "by": "hand"},
    "inverter": {
        "max_rev_min": 18000,
        "by": "inverter",
        "acceleration_rev_s2": 60.0,
        "spin_up_s": 8.0,
        "inverter": {"channel": 1, "full_counts": 32767, "full_rev_min": 18000},
    },
    "modbus": {
        "max_rev_min": 18000,
        "by": "modbus",
        "acceleration_rev_s2": 60.0,
        "spin_up_s": 8.0,
        "modbus": {"port": "/dev/ttyUSB0", "profile": "delta_c2000", "station": 1, "rev_min_per_hz": 60.0},
    },
    "drive": {"max_rev_min": 12000, "bus": "can1", "node": 10, "counts_per_rev": 4096},
}
INVERTER_OUTPUTS = ("spindle_run", "spindle_reverse", "spindle_reset")
EQUIPMENT = ("io", "changer", "probe", "setter")
# Asked of each axis; {unit} is mm of a slide and deg of a rotary.
OF_AN_AXIS = ("travel_{unit}", "velocity_{unit}_s", "acceleration_{unit}_s2", "counts_per_{unit}")
STANDING = (0, 35, 37)  # methods of homing that move nothing
# What a search for a switch is given, as a share of what the axis can.
SEARCH = (
    ("fast_{}_s", "velocity_{}_s", 0.1),
    ("slow_{}_s", "velocity_{}_s", 0.01),
    ("acceleration_{}_s2", "acceleration_{}_s2", 0.1),
)
FROM_END_MM = 10.0  # of a travel, where a changer goes
MEANING_COLUMN = 40


@dataclass(slots=True)
class Answers:
    """What a builder is asked; each is an option of the command."""

    kind: str
    interface: str
    profile: str
    eds: str
    spindle: str
    equipment: list[str]

    def ask(self) -> None:
        """One after the other, what was given as an option as the default."""
        for kind in KINDS:
            head = (SHIPPED / f"{kind}.toml").read_text(encoding="utf-8").partition("\n")[0]
            show.print(f"  {kind:12} {head.strip('# ')}")
        self.kind = _prompt("kind", self.kind)
        self.interface = _prompt("interface", self.interface)
        self.profile = _prompt("profile", self.profile, ", ".join(drive_profiles.shipped()))
        self.eds = _prompt("eds", self.eds)
        self.spindle = _prompt("spindle", self.spindle, ", ".join(SPINDLES))
        parts = _prompt("with", " ".join(self.equipment), ", ".join(EQUIPMENT))
        self.equipment = parts.replace(",", " ").split()


def new(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml")],
    kind: str = "trunnion",
    interface: str = "virtual",
    profile: str = "simulated",
    eds: Annotated[str, typer.Option("--eds", metavar="SHEET.eds")] = "",
    spindle: str = "hand",
    equipment: Annotated[list[str] | None, typer.Option("--with")] = None,
    put: Annotated[list[str] | None, typer.Option("--set", metavar="TABLE.KEY=VALUE")] = None,
    ask: bool = False,
    overwrite: bool = False,
    as_json: bool = False,
) -> None:
    """Write a machine file that checks, from answers: asked for with --ask, or given as options."""
    with refusals(as_json):
        new_files.target(file, overwrite, "FILE.toml", ".toml")
        answers = Answers(kind, interface, profile, eds, spindle, equipment or [])
        if ask:
            answers.ask()
        tree = _tree(answers, file)
        if ask:
            _ask_axes(tree)
        for one in put or ():
            _put(tree, one)
        for axis in tree["axis"]:
            _search(axis)
        for sequence in ("put_away", "take"):
            for step in tree.get("changer", {}).get(sequence, ()):
                _within(step, tree["axis"])
        text = "\n".join([_head(file), *_written(tree)]) + "\n"
        whole = text if "tool" in tree else _with_tools(text)
        machine_file.read(whole, file.name, file.resolve().parent)
        atomic_file.write(file, text)
        if not answered(as_json, file=str(file), machine=tree["machine"]["name"]):
            show.print(say("cli.machine.new", file=file), soft_wrap=True)


def _with_tools(text: str) -> str:
    """As ``load`` reads it, with the tools of the shipped table. Raises OSError."""
    return f"{text}\n{(SHIPPED / machine_file.TOOL_TABLE).read_text(encoding='utf-8')}"


# ---- answers


def _ask_axes(tree: Tree) -> None:
    for axis in tree["axis"]:
        unit = "mm" if axis["kind"] == "linear" else "deg"
        for pattern in OF_AN_AXIS:
            key = pattern.format(unit=unit)
            given = typer.prompt(f"{axis['name']} {key}", default=toml_rows.value(axis[key]), err=True)
            axis[key] = _value(given)
        axis["homing"]["method"] = _value(
            typer.prompt(f"{axis['name']} homing.method", default=str(axis["homing"]["method"]), err=True)
        )


def _prompt(question: str, default: str, known: str = "") -> str:
    text = say(f"cli.machine.ask.{question}", known=known)
    answer: str = typer.prompt(text, default=default, err=True, show_default=bool(default))
    return answer.strip()


def _one_of(option: str, value: str, allowed: tuple[str, ...]) -> str:
    """Raises Refused."""
    if value not in allowed:
        raise Refused(say("cli.machine.one_of", option=option, value=value, allowed=", ".join(allowed)))
    return value


def _value(text: str) -> Any:
    """As TOML has it; words that are none of its values are a text."""
    try:
        return tomllib.loads(f"v = {text}")["v"]
    except tomllib.TOMLDecodeError:
        return text


# ---- the tree


def _tree(answers: Answers, file: Path) -> Tree:
    """The file's tables. Raises Refused."""
    tree = _shipped(_one_of("--kind", answers.kind, KINDS))
    wanted = {_one_of("--with", one, EQUIPMENT) for one in answers.equipment}
    spindle = _one_of("--spindle", answers.spindle, SPINDLES)
    tree["machine"]["name"] = file.stem
    for axis in tree["axis"]:
        axis["profile"] = answers.profile
        if answers.eds:
            axis["eds"] = os.path.relpath(answers.eds, file.resolve().parent)
    del tree["spindle"]
    if spindle != "none":
        tree["spindle"] = dict(SPINDLE_TABLES[spindle])
    if wanted or spindle == "inverter":
        tree["io"] = _io(wanted, spindle)
    equipped = _shipped(EQUIPPED)
    tree.update({name: equipped[name] for name in ("changer", "probe", "setter") if name in wanted})
    if {"changer", "probe"} & wanted:
        tree["tool"] = equipped["tool"]
        tree.pop("tools", None)
    # Spindle and node have a bus of their own: five drives fill one.
    names = [bus["name"] for bus in equipped["bus"]][: 2 if "io" in tree or spindle == "drive" else 1]
    rate = tree["bus"][0]["bit_rate"]
    tree["bus"] = [{"name": name, "interface": answers.interface, "bit_rate": rate} for name in names]
    for bus in tree["bus"] if answers.interface != "virtual" else ():
        bus["channel"] = bus["name"]
    for axis in tree["axis"]:
        axis["bus"] = names[0]
    return tree


def _search(axis: Tree) -> None:
    """How fast it looks for its switch, for drives leave that at 0: then homing never ends."""
    homing, unit = axis.get("homing", {}), "mm" if axis["kind"] == "linear" else "deg"
    if homing.get("absolute") or homing.get("method", 0) in STANDING:
        return
    for key, of, share in SEARCH:
        homing.setdefault(key.format(unit), float(f"{share * axis[of.format(unit)]:.3g}"))


def _within(step: Tree, axes: list[Tree]) -> None:
    """A step of the example's changer for these axes: positions within their travels, rotaries at zero."""
    for axis in axes:
        if axis["kind"] == "linear" and (place := step.get("move_mm", {}).get(axis["name"])) is not None:
            low, high = axis["travel_mm"]
            many = place if isinstance(place, list) else [place]
            inside = [min(max(one, low + FROM_END_MM), high - FROM_END_MM) for one in many]
            step["move_mm"][axis["name"]] = inside if isinstance(place, list) else inside[0]
    if "move_deg" in step:
        step["move_deg"] = {axis["name"]: 0.0 for axis in axes if axis["kind"] != "linear"}


def _io(wanted: set[str], spindle: str) -> Tree:
    """The node of the equipped machine, with the signals of what is there."""
    node = _shipped(EQUIPPED)["io"]
    if "changer" not in wanted:
        del node["orient"]
        node["inputs"], node["outputs"] = {"probe": 0, "setter": 1}, {"coolant": 0}
    for name in ("probe", "setter"):
        if name not in wanted:
            del node["inputs"][name]
    if spindle == "inverter":
        first = 1 + max(node["outputs"].values())
        node["outputs"] |= {name: first + n for n, name in enumerate(INVERTER_OUTPUTS)}
    return {key: value for key, value in node.items() if value != {}}


def _shipped(name: str) -> Tree:
    return tomllib.loads((SHIPPED / f"{name}.toml").read_text(encoding="utf-8"))


def _put(tree: Tree, setting: str) -> None:
    """``axis.X.travel_mm=[-250, 250]``: a key of a table, of rows by their name. Raises Refused."""
    path, equals, text = setting.partition("=")
    *tables, key = path.strip().split(".")
    here: Any = tree
    for name in tables:
        if isinstance(here, list):
            here = next((row for row in here if str(row.get("name", row.get("number"))) == name), None)
        else:
            here = here.setdefault(name, {})
        if here is None:
            break
    if not equals or not tables or not isinstance(here, dict):
        raise Refused(say("cli.machine.no_setting", setting=setting))
    here[key] = _value(text.strip())


# ---- the text


def _head(file: Path) -> str:
    """The first lines: where editors find the schema, and what the file is."""
    schema = os.path.relpath(keys.SCHEMA, file.resolve().parent)
    return f"#:schema {schema}\n# {say('cli.machine.head')}"


def _written(tree: Tree) -> Iterator[str]:
    meanings = {section.name: _meanings(section) for section in keys.sections()}
    for name, value in tree.items():
        rows = value if isinstance(value, list) else [value]
        for row in rows:
            yield from _table(f"[[{name}]]" if isinstance(value, list) else f"[{name}]", name, row, meanings)


def _meanings(section: keys.Section) -> dict[str, str]:
    return {name: key.means for key in section.keys for name in key.spelled}


def _table(
    title: str, name: str, row: Mapping[str, Any], meanings: Mapping[str, Mapping[str, str]]
) -> Iterator[str]:
    """Its own keys, then the tables in it."""
    yield f"\n{title}"
    below = []
    for key, value in row.items():
        if isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
            below += [(f"[[{name}.{key}]]", f"{name}.{key}", one) for one in value]
        elif isinstance(value, dict) and f"{name}.{key}" in meanings:
            below.append((f"[{name}.{key}]", f"{name}.{key}", value))
        else:
            means = meanings.get(name, {}).get(key, "")
            yield from toml_rows.noted(f"{key} = {toml_rows.value(value)}", means, MEANING_COLUMN)
    for one in below:
        yield from _table(*one, meanings)
