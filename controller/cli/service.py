"""``directrix service``: the services of a machine under systemd, from the installation to its end."""

from __future__ import annotations

import contextlib
import json
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import typer

from controller.api import own_folder
from controller.cli import installation, locked, self_test, update
from controller.cli.host_lines import Line
from controller.cli.installation import ENVIRONMENT, STATE, TARGET, UNITS
from controller.cli.privileged import as_root, run
from controller.cli.speech import Verbs
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.runtime import drive_sheets
from controller.verify.console import Refused, answered, in_words, refusals, say, show, tell

app = Verbs(add_completion=False, no_args_is_help=True)

HIDDEN = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")  # ProtectHome=yes, PrivateTmp=yes
SHOWN = ("LoadState", "ActiveState", "SubState", "Result", "NRestarts", "MainPID", "StatusText")
NOT_RUNNING = 3  # exit code, as systemctl's


# --- install -----------------------------------------------------------------------------


@app.command()
def install(
    machine: str | None = None,
    simulate: bool | None = None,
    panel: str | None = None,
    start: bool = False,
    unlocked: bool = False,
    root: Path | None = None,
    as_json: bool = False,
) -> None:
    """Write the units, users, folders and CAN interfaces of a machine, to be started at every boot.

    What it writes it writes again each time, but never over /etc/directrix. Nothing moves by it.
    """
    with refusals(as_json):
        present = _present(root or Path("/"))
        source = _source(machine)
        named = source or installation.machine_named_in(present or "")
        made = machine_file.load(named)
        if problems := drive_sheets.refusal(made):
            raise Refused("\n".join(map(in_words, problems)))
        if root is None:
            _may_install(made, named, unlocked)
        serve = None if simulate is None else "--simulate" * simulate
        text = installation.environment(present, source, serve, panel)
        paths = _write(root or Path("/"), made, text)
        if root is None:
            _make_known(made)
            if start:
                run("systemctl", "start", TARGET)
        _tell_installed(as_json, paths, made, root is None and not start)


def _present(root: Path) -> str | None:
    file = root / ENVIRONMENT.relative_to("/")
    return file.read_text() if file.exists() else None


def _source(machine: str | None) -> str | None:
    """A file by its whole path: the service starts in another folder."""
    return str(Path(machine).resolve()) if machine is not None and Path(machine).is_file() else machine


def _may_install(machine: Machine, source: str, unlocked: bool) -> None:
    """Raises Refused, before anything is written. ``source``: path or name of the machine file."""
    as_root("install")
    if not unlocked and (others := locked.others()):
        raise Refused(say("cli.service.unlocked", others=", ".join(others), lock=locked.shipped()))
    if not Path("/run/systemd/system").is_dir():
        raise Refused(say("cli.service.no_systemd"))
    _seen_by_a_service(source)
    for bus in installation.interfaces(machine):
        if not bus.channel:
            raise Refused(say("cli.service.no_channel", name=bus.name))


def _seen_by_a_service(source: str) -> None:
    """Raises Refused."""
    for what, path in _needed(source):
        if path.startswith(tuple(f"{folder}/" for folder in HIDDEN)):
            raise Refused(say("cli.service.hidden", what=what, path=path, names=", ".join(HIDDEN)))


def _needed(source: str) -> Iterator[tuple[str, str]]:
    """What the services read, by the path that they are given and by the one where it ends."""
    python = Path(sys.executable).absolute()  # of a virtual environment: a link into the system's
    for path in dict.fromkeys((python, python.resolve())):
        yield say("cli.service.python"), str(path)
    yield (
        say("cli.service.package"),
        str(Path(machine_file.__file__).resolve()),
    )  # perhaps a checkout, installed as editable
    yield say("cli.service.machine"), source


def _write(root: Path, machine: Machine, environment: str) -> list[Path]:
    """Raises OSError. All texts are there before the first is written."""
    written = [*installation.files(machine), installation.File(ENVIRONMENT, environment)]
    for old in installation.written(root):
        old.unlink()  # of another machine perhaps, with other interfaces
    for file in written:
        path = root / file.path.relative_to("/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(file.text)
    for link in installation.links(machine):
        path = root / link.path.relative_to("/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.symlink_to(link.to)
        written.append(installation.File(link.path, ""))
    return [file.path for file in written]


def _make_known(machine: Machine) -> None:
    """Users, folders, units, interfaces. Raises Refused."""
    run("systemd-sysusers", "/etc/sysusers.d/directrix.conf")
    run("systemd-tmpfiles", "--create", "/etc/tmpfiles.d/directrix.conf")
    try:
        own_folder.part(STATE)
    except OSError as error:
        raise Refused(say("os_error_of", file=error.filename or STATE, why=error)) from error
    run("systemctl", "daemon-reload")
    names = [f"/sys/class/net/{bus.channel}" for bus in installation.interfaces(machine)]
    with contextlib.suppress(Refused):  # interfaces that are there already; others are met when they come
        run("udevadm", "control", "--reload")
        there = [name for name in names if Path(name).exists()]
        if there:
            run("udevadm", "trigger", "--action=add", "--settle", *there)
    with contextlib.suppress(Refused):  # nobody to reload: the service starts it
        run("networkctl", "reload")


def _tell_installed(as_json: bool, paths: list[Path], machine: Machine, hint: bool) -> None:
    if answered(as_json, machine=machine.name, written=list(map(str, paths))):
        return
    for path in paths:
        show.print(str(path))
    if hint:
        show.print(say("cli.service.start", target=TARGET))


# --- uninstall ---------------------------------------------------------------------------


@app.command()
def uninstall(root: Path | None = None, as_json: bool = False) -> None:
    """Stop the services and take away what install wrote; /etc/directrix and programs stay."""
    with refusals(as_json):
        below = root or Path("/")
        if root is None:
            as_root("uninstall")
        paths = installation.written(below)
        if root is None and (below / "etc/systemd/system" / TARGET) in paths:
            run("systemctl", "stop", *UNITS)
        paths += installation.enabled_lines(below)
        for path in paths:
            path.unlink()
            _remove_empty(path.parent)
        if root is None and shutil.which("systemctl"):
            run("systemctl", "daemon-reload")
        if as_json:
            print(json.dumps({"ok": True, "removed": list(map(str, paths))}))
        elif paths:
            show.print(say("cli.service.removed", count=len(paths), parent=ENVIRONMENT.parent, state=STATE))
        else:
            show.print(say("cli.service.nothing"))


def _remove_empty(folder: Path) -> None:
    """Folders that were made for links and drop-ins."""
    if folder.suffix in (".wants", ".d") and folder.name != "sysusers.d" and not any(folder.iterdir()):
        with contextlib.suppress(OSError):
            folder.rmdir()


app.command("sbom")(locked.sbom)
app.command("update")(update.update)
app.command("rollback")(update.rollback)


# --- status ------------------------------------------------------------------------------


@app.command()
def status(as_json: bool = False) -> None:
    """How the services are; exit code 3 when one of them does not run."""
    with refusals(as_json):
        units = _shown(run("systemctl", "show", "--property", ",".join(("Id", *SHOWN)), *UNITS))
        running = all(unit["ActiveState"] == "active" for unit in units)
        if as_json:
            print(json.dumps({"ok": running, "units": units}))
        else:
            for unit in units:
                show.print(_sentence(unit))
        if not running:
            raise typer.Exit(NOT_RUNNING)


def _shown(text: str) -> list[dict[str, str]]:
    """The blocks of `systemctl show`, one a unit."""
    blocks = [block for block in text.strip().split("\n\n") if block]
    return [dict(line.split("=", 1) for line in block.splitlines() if "=" in line) for block in blocks]


def _sentence(unit: dict[str, str]) -> str:
    if unit.get("LoadState") == "not-found":
        return say("cli.service.not_installed", unit=unit["Id"])
    words = [f"{unit['Id']}: {unit['ActiveState']} ({unit['SubState']})"]
    if unit.get("Result") not in (None, "", "success"):
        words.append(say("cli.service.ended_by", result=unit["Result"], unit=unit["Id"]))
    if unit.get("NRestarts", "0") not in ("0", ""):
        words.append(say("cli.service.restarted", count=unit["NRestarts"]))
    if unit.get("StatusText"):
        words.append(unit["StatusText"])
    return ", ".join(words)


# --- self-test ---------------------------------------------------------------------------


@app.command("self-test")
def self_tests(
    machine: str | None = None, seconds: float = 5.0, state: Path = STATE, as_json: bool = False
) -> None:
    """Whether this computer can run the machine: one line each, pass or fail, with the remedy.

    Run it as root, or in the service's place; while the machine runs it looks at the running tick.
    """
    with refusals(as_json):
        if not 0.0 < seconds <= 3600.0:
            raise Refused(say("cli.service.seconds", seconds=seconds))
        lines = self_test.run(machine_of(machine), state, seconds)
        _report(lines, as_json)


def machine_of(named: str | None) -> Machine:
    """The machine that somebody names, else the installed one. Raises ConfigError."""
    return machine_file.load(_source(named) or installation.machine_named_in(_present(Path("/")) or ""))


def _report(lines: Sequence[Line], as_json: bool) -> None:
    """Exit code 1 when a line failed."""
    failed = sum(not line.is_fit for line in lines)
    if as_json:
        rows: list[dict[str, Any]] = [line.to_dict() for line in lines]
        print(json.dumps({"ok": not failed, "failed": failed, "lines": rows}))
    for line in () if as_json else lines:
        show.print(f"{say(f'host.{line.verdict}'):<4}  {line.shown:<16} {line.found}", soft_wrap=True)
        if line.advice:
            show.print(f"      {'':<16} -> {line.advice}", soft_wrap=True)
    if failed:
        if not as_json:
            tell.print(say("self_test.failed", count=failed, all=len(lines)))
        raise typer.Exit(1)
