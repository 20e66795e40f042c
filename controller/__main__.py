"""The command line: the one file that knows all parts."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from controller import config
from controller.kinematics import Kinematics
from controller.machine import Joints, Machine, five
from controller.motions import SurfaceCut
from controller.plan import blocks, survey
from controller.plan import path as paths
from controller.plan.path import Chain, Stretch
from controller.plan.program import ProgramError
from controller.session import events as event_files
from controller.session.startup import SessionError
from controller.state import FAULTS, Fault
from controller.toml_table import ConfigError
from controller.verify import tables

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="A five-axis controller that cuts ruled surfaces themselves.",
)
USAGE: Any = typer.BadParameter.__mro__[1]  # click's UsageError, wherever this typer keeps it
tell = Console(stderr=True, highlight=False, soft_wrap=True)  # sentences, progress
show = Console(highlight=False)  # results

ProgramFile = Annotated[Path, typer.Argument(help="The part program.")]
MachineFile = Annotated[str, typer.Option("--machine", help="Machine file, or the name of a shipped one.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Gouge = Annotated[str, typer.Option("--gouge", help="'refuse' or 'warn'; default: the machine file's.")]
PeriodMs = Annotated[float | None, typer.Option("--period-ms", help="Instead of the machine file's period.")]

PARTS = {"cone": "example1_ready", "ruled": "example2_ready"}


class Refused(Exception):
    """Ends a command with exit code 1; the sentence goes to stderr, or into the JSON object."""

    def __init__(self, sentence: str, **facts: Any) -> None:
        super().__init__(sentence)
        self.facts = facts


def main() -> None:
    """Entry point of ``directrix``; a script that asks for JSON gets it for a wrong option too."""
    if "--json" not in sys.argv[1:]:
        app()
    try:
        sys.exit(app(standalone_mode=False))
    except USAGE as error:
        sentence = f"{error.format_message().rstrip('.')}; see --help for what is allowed."
        print(json.dumps({"ok": False, "error": sentence}))
        sys.exit(2)


@contextlib.contextmanager
def _refusals(as_json: bool) -> Iterator[None]:
    """Turns what a user can mend into one sentence and exit code 1."""
    try:
        yield
    except ProgramError as error:
        place = {"file": error.file, "line": error.line, "column": error.column}
        _refuse(as_json, str(error), {**place, "sentence": error.sentence})
    except Refused as error:
        _refuse(as_json, str(error), error.facts)
    except (ConfigError, SessionError, event_files.EventError) as error:
        _refuse(as_json, str(error), {})
    except OSError as error:
        name = f"{error.filename}: " if error.filename else ""
        _refuse(as_json, f"{name}{error.strerror}; check path, permission and space.", {})
    except _errors_of_drives() as error:
        _refuse(as_json, str(error), {})


def _errors_of_drives() -> tuple[type[Exception], ...]:
    """Imported where they are needed: ``check`` does without drives."""
    from drives.bus import BusError
    from drives.commission import CommissionError

    return BusError, CommissionError


def _refuse(as_json: bool, sentence: str, facts: dict[str, Any]) -> NoReturn:
    if as_json:
        print(json.dumps({"ok": False, "error": sentence, **facts}))
    else:
        tell.print(sentence, markup=False)
    raise typer.Exit(1)


# --- what several commands need ------------------------------------------------


def _machine(file: str, gouge: str = "", period_ms: float | None = None) -> Machine:
    machine = config.load(file)
    if gouge not in ("", "refuse", "warn"):
        raise Refused(f"--gouge {gouge} is not known; allowed are refuse and warn.")
    machine = replace(machine, gouge=gouge) if gouge else machine
    return machine if period_ms is None else config.with_period(machine, period_ms / 1e3)


def _notes(path: paths.Path, machine: Machine) -> dict[str, Any]:
    """What ``check`` and ``simulate`` say with --json of a program and of its machine."""
    notes = [{"line": note.place.line, "note": note.sentence} for note in path.notes]
    return {"notes": notes, "warnings": config.warnings(machine)}


def _budget_or_refuse(machine: Machine) -> None:
    from drives import budget

    sentences = budget.advice(
        config.node_settings(machine),
        config.bus_settings(machine),
        config.master_settings(machine),
        machine.max_bus_share,
        machine.period_s,
    )
    if sentences:
        raise Refused(" ".join(sentences))


def _read(file: Path) -> bytes:
    if not file.is_file():
        what = "this is a folder" if file.is_dir() else "there is no such file"
        raise Refused(f"{file}: {what}; give the path of a part program.")
    return file.read_bytes()


def _writable(*files: Path | None) -> None:
    """Refuse, before anything runs, what could not be written after it. Raises OSError."""
    for file in files:
        if file is not None:
            new = not file.exists()
            file.open("ab").close()
            if new:
                file.unlink()


def _trace(text: bytes, name: str, machine: Machine, kinematics: Kinematics, start: Joints) -> paths.Path:
    program = blocks.read(text, machine, name)
    if not program.blocks:
        raise ProgramError(name, 1, 1, "The program has no block that does anything; nothing to run.")
    return paths.trace(program, machine, kinematics, start)


def _home(machine: Machine) -> Joints:
    return five(tuple(axis.homing.position for axis in machine.axes))


def _stretches(path: paths.Path) -> dict[int, Stretch]:
    """Stretches by motion id: the planner counts them in the order of the path."""
    chains = (item for item in path.items if isinstance(item, Chain))
    return dict(enumerate(stretch for chain in chains for stretch in chain.stretches))


def _length_mm(stretches: dict[int, Stretch]) -> float:
    """Length of the first tool that cuts: its tip is what the path error is about."""
    lengths = (s.motion.length_mm for s in stretches.values() if isinstance(s.motion, SurfaceCut))
    return next(lengths, 0.0)


@contextlib.contextmanager
def _bar(title: str, quiet: bool) -> Iterator[Any]:
    """A progress bar on stderr; the block gets a function of the share done."""
    columns = (TextColumn("{task.description}"), BarColumn(None), TextColumn("{task.percentage:3.0f} %"))
    with Progress(
        *columns, TimeElapsedColumn(), console=tell, disable=quiet or not tell.is_terminal, transient=True
    ) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda share: bar.update(task, completed=min(share, 1.0))


# --- check ---------------------------------------------------------------------


@app.command()
def check(
    program: ProgramFile, machine: MachineFile = "trunnion", gouge: Gouge = "", as_json: Json = False
) -> None:
    """Read, plan and audit a program over its whole path; no bus, nothing moves."""
    with _refusals(as_json):
        made = _machine(machine, gouge)
        kinematics = Kinematics(made)
        path = _trace(_read(program), str(program), made, kinematics, _home(made))
        with _bar("planning", as_json) as progress:
            found = survey.survey(path, made, kinematics, progress)
        if as_json:
            facts = {**found.to_dict(), **_notes(path, made)}
            print(json.dumps({"ok": True, "program": str(program), **facts}))
            return
        _show_notes(path, str(program), made)
        if found.joints:
            show.print(tables.joints(found))
        cut = f"{found.cut_time_s:.2f} s cut {found.cut_length_mm:.4f} mm of C1"
        part = f"of which {cut}" if found.cuts_mm else "nothing is cut"
        show.print(f"{program.name} can run on {made.name}:\n{found.duration_s:.1f} s in all, {part}.")


def _show_notes(path: paths.Path, name: str, machine: Machine) -> None:
    for sentence in config.warnings(machine):
        tell.print(sentence, markup=False)
    for note in path.notes:
        tell.print(f"{name}:{note.place.line}:{note.place.column}: {note.sentence}", markup=False)


# --- simulate ------------------------------------------------------------------


@app.command()
def simulate(
    program: ProgramFile,
    machine: MachineFile = "trunnion",
    period_ms: PeriodMs = None,
    gouge: Gouge = "",
    trace_file: Annotated[Path | None, typer.Option("--trace", help="Write every tick (.npz).")] = None,
    events: Annotated[Path | None, typer.Option("--events", help="Requests at ticks (JSON lines).")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", help="Draw the cut (.png).")] = None,
    as_json: Json = False,
) -> None:
    """Run a program on the stepped clock, with bus and simulated drives, as fast as it can."""
    from controller.session.stepped import SteppedMachine
    from controller.verify import trace as traces

    with _refusals(as_json):
        made = _machine(machine, gouge, period_ms)
        _budget_or_refuse(made)
        planned_events = event_files.read(events) if events else ()
        text = _read(program)
        _writable(trace_file, plot)
        kinematics = Kinematics(made)
        path = _trace(text, str(program), made, kinematics, _home(made))
        if not as_json:
            _show_notes(path, str(program), made)
        bench = SteppedMachine(made)
        bench.come_up()
        began_s = time.perf_counter()
        with _bar("simulating", as_json) as progress:
            run = bench.run(path, planned_events, lambda s: progress(s / (s + 10.0)))
        took_s = time.perf_counter() - began_s
        stretches = bench.planner.stretches
        trace = traces.from_rows(run.rows, made, kinematics, stretches, first_tick=run.first_tick)
        figures = {
            "program": str(program),
            "machine": made.name,
            "period_s": made.period_s,
            "result": run.result,
            "fault": run.fault.name if run.fault is not Fault.NONE else None,
            **traces.summary(trace, made, kinematics, _length_mm(stretches)).to_dict(),
            "skips": run.skips,
            "assumed_resumes": run.assumed_resumes,
            "events_left": run.events_left,
            "wall_time_s": took_s,
            "times_real_time": len(trace.time_s) * made.period_s / took_s,
            **_notes(path, made),
        }
        _write(trace, made, stretches, trace_file, plot)
        if run.result == "fault":
            raise Refused(run.fault_text, **figures)
        if as_json:
            print(json.dumps({"ok": True, **figures}))
        else:
            show.print(tables.figures("Simulated on the stepped clock", figures))


def _write(
    trace: Any, machine: Machine, stretches: dict[int, Stretch], trace_file: Path | None, plot: Path | None
) -> None:
    if trace_file:
        trace.save(trace_file)
    if plot:
        from controller.verify import plots

        plots.cut_picture(trace, machine, stretches, plot)


# --- demo ----------------------------------------------------------------------


@app.command()
def demo(
    part: Annotated[str, typer.Option("--part", help="'cone' (Example 1) or 'ruled' (Example 2).")] = "cone",
    out: Annotated[Path, typer.Option("--out", help="Folder for picture and trace.")] = Path("demo"),
    as_json: Json = False,
) -> None:
    """Cut one of the paper's parts in real time on the virtual bus, with simulated drives."""
    from controller.session import live
    from controller.verify import trace as traces

    with _refusals(as_json):
        if part not in PARTS:
            raise Refused(f"--part {part} is not known; allowed are {' and '.join(PARTS)}.")
        made = config.load("trunnion")
        file = config.shipped_program(PARTS[part])
        out.mkdir(parents=True, exist_ok=True)
        picture, trace_file = out / f"{part}.png", out / f"{part}.npz"
        _writable(picture, trace_file)
        text, kinematics = file.read_bytes(), Kinematics(made)
        path = _trace(text, file.name, made, kinematics, _home(made))
        expected_s = survey.survey(path, made, kinematics).duration_s
        if not as_json:
            tell.print(
                f"Starting the virtual bus, five simulated drives, plan and tick; {file.name} on {made.name}."
            )
        with live.started(made, text, file.name) as machine:
            now = machine.ready()
            path = _trace(text, file.name, made, kinematics, five(now.joints))
            with _bar(f"cutting ({expected_s:.0f} s)", as_json) as progress:
                rows, last = machine.run(lambda now: progress(now.plan_time_s / expected_s))
        stretches = _stretches(path)
        trace = traces.from_rows(rows, made, kinematics, stretches)
        syncs = {
            name: asdict(traces.sync_intervals(s, made.period_s)) for name, s in machine.sync_stamps_s.items()
        }
        _write(trace, made, stretches, trace_file, picture)
        figures = {
            "program": str(file),
            "machine": made.name,
            "period_s": made.period_s,
            "result": "fault" if last.fault is not Fault.NONE else "completed",
            "fault": last.fault.name if last.fault is not Fault.NONE else None,
            **traces.summary(trace, made, kinematics, _length_mm(stretches)).to_dict(),
            "skips": last.skips,
            "sync": syncs,
            "picture": str(picture),
            "trace": str(trace_file),
        }
        if last.fault is not Fault.NONE:
            raise Refused(f"{FAULTS[last.fault].text} {FAULTS[last.fault].remedy}", **figures)
        if as_json:
            print(json.dumps({"ok": True, **figures}))
        else:
            show.print(tables.figures("Cut in real time on the virtual bus", figures))
            show.print(f"Picture: {picture}   Trace: {trace_file}", markup=False)


# --- bus, paper -----------------------------------------------------------------


@app.command("bus")
def bus_budget(machine: MachineFile = "trunnion", period_ms: PeriodMs = None, as_json: Json = False) -> None:
    """The bus budget: every frame of a tick at its worst length, per bus."""
    from drives import budget

    with _refusals(as_json):
        made = _machine(machine, "", period_ms)
        found = budget.of(
            config.node_settings(made), config.bus_settings(made), config.master_settings(made), made.period_s
        )
        fits = all(one.fits(made.max_bus_share) for one in found)
        if as_json and fits:
            print(
                json.dumps(
                    {"ok": True, "max_share": made.max_bus_share, "buses": [b.to_dict() for b in found]}
                )
            )
            return
        if not as_json:
            for one in found:
                show.print(tables.budget(one, made.max_bus_share))
        _budget_or_refuse(made)


@app.command("paper")
def paper_comparison(as_json: Json = False) -> None:
    """The paper's comparison, computed: off-line chords, its first-order step, and ours."""
    from controller.verify import paper, paper_table

    with _refusals(as_json):
        comparison = paper.compare(config.load("trunnion"))
        if as_json:
            print(json.dumps({"ok": True, **comparison.to_dict()}))
        else:
            paper_table.render(comparison, show)


if __name__ == "__main__":
    main()
