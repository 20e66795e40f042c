"""``directrix drives``: data sheets against profiles, and the drives of a machine over SDO."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from controller.cli import (
    drafted_profile,
    drive_buses,
    drive_tables,
    kept_drives,
    simulated_drives,
    stop_drives,
)
from controller.cli.drive_buses import Joined
from controller.cli.speech import Verbs
from controller.ipc import control_socket
from controller.machine import arrangement, drive_profiles, nodes
from controller.machine.model import Machine
from controller.messages import Message, is_message, message
from controller.verify.console import Refused, Undecided, answered, in_words, refusals, say, show, tell
from drives import commission as commissioning
from drives.commissioning import identity, lss, possible, sheet, survey, twins
from drives.commissioning.wanted import Settings
from drives.settings import MasterSettings, NodeSettings

app = Verbs(add_completion=False, no_args_is_help=True)

CHECKED_PERIOD_MS = 2.0


# --- check ---------------------------------------------------------------------------


@app.command()
def check(
    eds: Annotated[Path, typer.Option("--eds")],
    profile: Annotated[str, typer.Option("--profile")],
    period_ms: float | None = None,
    bit_rate: int = 0,
    as_json: bool = False,
) -> None:
    """A data sheet against a profile: objects, access, ranges, mapping, period, supervision."""
    with refusals(as_json):
        family = drive_profiles.load(profile)
        shortest_ms = max(CHECKED_PERIOD_MS, family.period_min_s * 1e3)
        period_s = _period_s(shortest_ms if period_ms is None else period_ms)
        master = MasterSettings(period_s=period_s)
        about = sheet.load(str(eds), 1, family.overrides)
        verdict = possible.of_profile(family, about, master, bit_rate)
        found, remarks, open_still = ([*map(in_words, part)] for part in verdict)
        facts = {"eds": str(eds), "profile": family.name, "period_s": period_s, "remarks": remarks}
        if not as_json:
            for remark in remarks:
                tell.print(f"{eds.name}: {remark}")
        if found:
            raise Refused(
                "\n".join(f"{eds.name}: {sentence}." for sentence in found), **facts, problems=found
            )
        if open_still:
            heading = say("cli.drives.undecided", name=eds.name)
            sentences = [f"{eds.name}: {sentence}." for sentence in open_still]
            raise Undecided("\n".join((heading, *sentences)), **facts, problems=[], undecided=open_still)
        if not answered(as_json, **facts, problems=[]):
            title = say("cli.drives.sheet_does", name=eds.name, profile=family.name, period=period_s * 1000.0)
            show.print(title)


def _period_s(period_ms: float) -> float:
    if not 0.0 < period_ms <= 1000.0:
        raise Refused(say("cli.drives.period", period_ms=period_ms))
    return period_ms / 1e3


# --- commission ------------------------------------------------------------------------


@app.command()
def commission(
    machine: str = "trunnion",
    bus: str = "",
    channel: str = "",
    period_ms: float | None = None,
    store: bool = False,
    set_node: str = "",
    as_json: bool = False,
) -> None:
    """Write everything that the machine file wants into its drives, read it back, and start them."""
    with refusals(as_json):
        made = drive_buses.machine(machine, period_ms)
        master = nodes.master_settings(made)
        outcomes = []
        with drive_buses.joined(made, bus, channel) as joined:
            for each in joined:
                drive_buses.see_alone(each, master)
            given = _set_node(joined, set_node, store) if set_node else None
            for each in joined:
                outcomes += commissioning.commission(
                    each.network, each.nodes, master, store=store, bit_rate=each.bus.bit_rate
                )
        found = [outcome.arranged for outcome in outcomes if outcome.arranged is not None]
        _keep(made, found)
        if as_json:
            rows = [_in_words(asdict(outcome)) for outcome in outcomes]
            print(json.dumps({"ok": True, "machine": made.name, "lss": given, "drives": rows}))
        else:
            if given:
                show.print(say("cli.drives.node_set", set_node=set_node, node=given["node"]))
            for outcome in outcomes:
                for warning in outcome.warnings:
                    sentence = say("sentence", text=commissioning.of_drive(outcome, warning))
                    tell.print(sentence)
            show.print(drive_tables.outcomes(outcomes))
        for one in found:
            for note in one.notes if not as_json else ():
                tell.print(in_words(note))


def _in_words(tree: Any) -> Any:
    """Values with the words of each text in its place, for JSON."""
    if is_message(tree):
        return in_words(tree)
    if isinstance(tree, dict):
        return {key: _in_words(value) for key, value in tree.items()}
    return [*map(_in_words, tree)] if isinstance(tree, list | tuple) else tree


def _keep(machine: Machine, found: Sequence[commissioning.Arranged]) -> None:
    """For ``directrix faults``; the drives are commissioned all the same where that cannot be."""
    folder = control_socket.state_folder() / arrangement.FOLDER
    try:
        arrangement.save(folder, machine, found)
    except OSError as error:
        tell.print(say("cli.drives.not_kept", folder=folder, why=error))


def _set_node(joined: Sequence[Joined], name: str, store: bool) -> dict[str, Any]:
    """LSS: by the serial number where the machine file has it, else the only drive without an id."""
    for each in joined:
        for node in each.nodes:
            if node.name == name:
                words = lss.Lss(each.network).assign(node.node, _identity(node), store)
                return {"drive": name, "node": node.node, "identity": words, "stored": store}
    known = ", ".join(node.name for each in joined for node in each.nodes)
    raise Refused(say("cli.drives.no_drive_to_set", name=name, known=known))


def _identity(node: Settings) -> lss.Identity | None:
    """All four words are needed to single a drive out: three of the data sheet, its serial number."""
    serial = node.serial if isinstance(node, NodeSettings) else 0
    if not serial:
        return None
    about = sheet.of(node)
    words = [about.identity(sub) for sub in (1, 2, 3)]
    if None in words:
        raise Refused(say("cli.drives.no_identity", name=node.name, eds=node.eds))
    return words[0] or 0, words[1] or 0, words[2] or 0, serial


# --- scan, status, dump ----------------------------------------------------------------


@app.command()
def scan(machine: str = "trunnion", bus: str = "", channel: str = "", as_json: bool = False) -> None:
    """Every node 1 .. 127 that answers, with its identity, beside what the machine file expects."""
    with refusals(as_json):
        made = drive_buses.machine(machine)
        rows: list[dict[str, Any]] = []
        missing: list[str] = []
        strange: list[Message] = []
        with drive_buses.joined(made, bus, channel) as joined:
            for each in joined:
                found = survey.scan(each.network)
                names = {node.node: node.name for node in each.nodes}
                rows += [{"bus": each.bus.name, **asdict(one), "name": names.get(one.node)} for one in found]
                silent = names.keys() - {one.node for one in found}
                at = {"bus": each.bus.name}
                missing += [
                    say("cli.drives.missing", **at, name=names[node], node=node) for node in sorted(silent)
                ]
                strange += [*_twins(each, found), *_strangers(each, found)]
        if not as_json:
            show.print(drive_tables.answering(rows))
        strangers = [in_words(one) for one in strange]
        facts = {"machine": made.name, "found": rows, "missing": missing, "strangers": strangers}
        sentences = [say("sentence", text=one) for one in strange]
        if missing:
            sentences.append(say("cli.drives.silent", names=", ".join(missing)))
        if sentences:
            raise Refused("\n".join(sentences), **facts)
        answered(as_json, **facts)


def _twins(joined: Joined, found: Sequence[survey.Found]) -> Iterator[Message]:
    """What is to be said of every node id that more than one drive has."""
    known = {node.node: node for node in joined.nodes}
    for one in found:
        if one.twins:
            what = twins.sentence(one.twins)
            if one.node in known:
                yield commissioning.of_drive(known[one.node], what)
            else:
                yield message("cli.drives.of_node", bus=joined.bus.name, node=one.node, why=what)


def _strangers(joined: Joined, found: Sequence[survey.Found]) -> Iterator[Message]:
    """What is to be said of every node that is not who data sheet and machine file say."""
    by_node = {one.node: one for one in found}
    for node in joined.nodes:
        if one := by_node.get(node.node):
            has = {1: one.vendor, 2: one.product, 4: one.serial}
            for word in identity.words_of(node, sheet.of(node)):
                known = has[word.sub]
                if known is not None and (mismatch := word.mismatch(known)):
                    yield commissioning.of_drive(node, mismatch)


@app.command()
def status(
    machine: str = "trunnion", bus: str = "", channel: str = "", drive: str = "", as_json: bool = False
) -> None:
    """How the drives are: NMT and power state, mode, position, errors. Changes nothing."""
    with refusals(as_json):
        made = drive_buses.machine(machine)
        found: list[survey.Status] = []
        with drive_buses.joined(made, bus, channel, drive) as joined:
            for each in joined:
                found += survey.status(each.network, each.nodes)
        if not answered(as_json, machine=made.name, drives=[asdict(one) for one in found]):
            show.print(drive_tables.status(found))


@app.command()
def dump(
    drive: str, machine: str = "trunnion", bus: str = "", channel: str = "", as_json: bool = False
) -> None:
    """Every object of one drive as it is now, beside the data sheet's default. Changes nothing."""
    with refusals(as_json):
        made = drive_buses.machine(machine)
        with drive_buses.joined(made, bus, channel, drive) as joined:
            entries = [
                entry for each in joined for node in each.nodes for entry in survey.dump(each.network, node)
            ]
        if not answered(as_json, drive=drive, objects=[_entry(entry) for entry in entries]):
            show.print(drive_tables.dump(entries))


def _entry(entry: survey.Entry) -> dict[str, Any]:
    return {**asdict(entry), "refused": in_words(entry.refused)}


# --- profile, save, restore, compare, stop, simulate ------------------------------------------------

app.command("profile")(drafted_profile.profile)
app.command("save")(kept_drives.save)
app.command("restore")(kept_drives.restore)
app.command("compare")(kept_drives.compare)
app.command("stop")(stop_drives.stop)
app.command("simulate")(simulated_drives.simulate)
