"""The command line: the one file that knows all parts."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from controller import config
from controller.kinematics import Kinematics
from controller.machine import Joints, Machine
from controller.plan import blocks, survey
from controller.plan import path as paths
from controller.plan.path import Chain, Stretch
from controller.plan.program import ProgramError
from controller.session import events as event_files
from controller.session.startup import SessionError
from controller.state import FAULTS, Fault
from controller.toml_table import ConfigError

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False, help=__doc__)
tell = Console(stderr=True, highlight=False, soft_wrap=True)  # sentences, progress
show = Console(highlight=False)  # results

ProgramFile = Annotated[Path, typer.Argument(help="The part program.")]
MachineFile = Annotated[str, typer.Option("--machine", help="Machine file, or the name of a shipped one.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Gouge = Annotated[str, typer.Option("--gouge", help="'refuse' or 'warn'; default: the machine file's.")]
PeriodMs = Annotated[float, typer.Option("--period-ms", help="Another period than the machine file's.")]

PARTS = {"cone": "example1_ready", "ruled": "example2_ready"}


class Refused(Exception):
    """Ends a command with exit code 1; the sentence goes to stderr, or into the JSON object."""

    def __init__(self, sentence: str, **facts: Any) -> None:
        super().__init__(sentence)
        self.facts = facts


def main() -> None:
    """Entry point of ``directrix``."""
    app()


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
    except (ConfigError, SessionError, event_files.EventError, OSError) as error:
        _refuse(as_json, str(error), {})


def _refuse(as_json: bool, sentence: str, facts: dict[str, Any]) -> NoReturn:
    if as_json:
        print(json.dumps({"ok": False, "error": sentence, **facts}))
    else:
        tell.print(sentence, markup=False)
    raise typer.Exit(1)


# --- what several commands need ------------------------------------------------


def _machine(file: str, gouge: str = "", period_ms: float = 0.0) -> Machine:
    machine = config.load(file)
    if gouge not in ("", "refuse", "warn"):
        raise Refused(f"--gouge {gouge} is not known; allowed are refuse and warn.")
    machine = replace(machine, gouge=gouge) if gouge else machine
    return config.with_period(machine, period_ms / 1e3) if period_ms else machine


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
        raise Refused(f"{file}: there is no such file; give the path of a part program.")
    return file.read_bytes()


def _trace(text: bytes, name: str, machine: Machine, kinematics: Kinematics, start: Joints) -> paths.Path:
    program = blocks.read(text, machine, name)
    if not program.blocks:
        raise ProgramError(name, 1, 1, "The program has no block that does anything; nothing to run.")
    return paths.trace(program, machine, kinematics, start)


def _home(machine: Machine) -> Joints:
    a, b, c, d, e = (axis.homing.position for axis in machine.axes)
    return (a, b, c, d, e)


def _stretches(path: paths.Path) -> dict[int, Stretch]:
    """Stretches by motion id: the planner counts them in the order of the path."""
    chains = (item for item in path.items if isinstance(item, Chain))
    return dict(enumerate(stretch for chain in chains for stretch in chain.stretches))


@contextlib.contextmanager
def _bar(title: str, quiet: bool) -> Iterator[Any]:
    """A progress bar on stderr; the block gets a function of the share done."""
    columns = (TextColumn("{task.description}"), BarColumn(None), TextColumn("{task.percentage:3.0f} %"))
    with Progress(*columns, TimeElapsedColumn(), console=tell, disable=quiet, transient=True) as bar:
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
        path = _trace(_read(program), program.name, made, kinematics, _home(made))
        with _bar("planning", as_json) as progress:
            found = survey.survey(path, made, kinematics, progress)
        notes = [{"line": note.place.line, "note": note.sentence} for note in path.notes]
        if as_json:
            print(json.dumps({"ok": True, "program": str(program), **found.to_dict(), "notes": notes}))
            return
        _show_notes(path, program.name)
        show.print(_joint_table(found))
        show.print(
            f"{program.name} can run on {made.name}: {found.duration_s:.1f} s in all, of which "
            f"{found.cut_time_s:.2f} s cut {found.cut_length_mm:.4f} mm of C1."
        )


def _show_notes(path: paths.Path, name: str) -> None:
    for note in path.notes:
        tell.print(f"{name}:{note.place.line}:{note.place.column}: {note.sentence}", markup=False)


def _joint_table(found: survey.Survey) -> Table:
    table = Table(title="Joints over the whole path, mm and degrees")
    for head in ("axis", "from", "to", "travel", "velocity", "acceleration", "jerk"):
        table.add_column(head, justify="left" if head == "axis" else "right")
    for use in found.joints:
        shares = (use.velocity_share, use.acceleration_share, use.jerk_share)
        table.add_row(
            use.name,
            f"{use.lowest:.3f}",
            f"{use.highest:.3f}",
            f"{use.travel[0]:g} .. {use.travel[1]:g}",
            *(f"{100 * share:.1f} %" for share in shares),
        )
    return table


# --- simulate ------------------------------------------------------------------


@app.command()
def simulate(
    program: ProgramFile,
    machine: MachineFile = "trunnion",
    period_ms: PeriodMs = 0.0,
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
        kinematics = Kinematics(made)
        path = _trace(text, program.name, made, kinematics, _home(made))
        if not as_json:
            _show_notes(path, program.name)
        began_s = time.perf_counter()
        bench = SteppedMachine(made)
        bench.come_up()
        with _bar("simulating", as_json) as progress:
            run = bench.run(path, planned_events, lambda s: progress(s / (s + 10.0)))
        took_s = time.perf_counter() - began_s
        trace = traces.from_rows(
            run.rows, made, kinematics, bench.planner.stretches, first_tick=run.first_tick
        )
        figures = {
            "program": str(program),
            "machine": made.name,
            "period_s": made.period_s,
            "result": run.result,
            "fault": run.fault.name if run.fault is not Fault.NONE else None,
            **traces.summary(trace, made, kinematics).to_dict(),
            "skips": run.skips,
            "assumed_resumes": run.assumed_resumes,
            "wall_time_s": took_s,
            "times_real_time": len(trace.time_s) * made.period_s / took_s,
            "notes": [{"line": note.place.line, "note": note.sentence} for note in path.notes],
        }
        _write(trace, made, bench.planner.stretches, trace_file, plot)
        if run.result == "fault":
            raise Refused(run.fault_text, **figures)
        if as_json:
            print(json.dumps({"ok": True, **figures}))
        else:
            show.print(_figures_table("Simulated on the stepped clock", figures))


def _write(
    trace: Any, machine: Machine, stretches: dict[int, Stretch], trace_file: Path | None, plot: Path | None
) -> None:
    if trace_file:
        trace.save(trace_file)
    if plot:
        from controller.verify import plots

        plots.cut_picture(trace, machine, stretches, plot)


def _figures_table(title: str, figures: dict[str, Any]) -> Table:
    table = Table(title=title, show_header=False)
    table.add_column()
    table.add_column(justify="right")
    errors = figures["following_error"]
    rows = [
        ("program", Path(figures["program"]).name),
        ("result", figures["result"] if not figures["fault"] else f"{figures['result']}: {figures['fault']}"),
        ("motion in all", f"{figures['duration_s']:.2f} s, {figures['ticks']} ticks"),
        ("cut", f"{figures['cut_time_s']:.2f} s, {figures['cut_length_mm']:.4f} mm of C1"),
        ("largest following error", ", ".join(f"{k} {v:.3f}" for k, v in errors.items()) + " mm, deg"),
        ("largest path error", f"{1e3 * figures['path_error_mm']:.3f} um"),
        ("largest axis error", f"{figures['axis_error_deg']:.2e} deg"),
        ("skipped ticks", f"{figures['skips']}"),
    ]
    if "times_real_time" in figures:
        rows.append(("speed", f"{figures['times_real_time']:.1f} times real time"))
    for bus, sync in figures.get("sync", {}).items():
        ms = ("p50_s", "p99_s", "p999_s", "max_s")
        rows.append((f"SYNC intervals on {bus}", "p50 / p99 / p99.9 / max"))
        rows.append(("", " / ".join(f"{1e3 * sync[key]:.3f}" for key in ms) + " ms"))
        rows.append(("outside 1 +- 1/4 T", f"{100 * sync['outside_share']:.3f} % of {sync['count']}"))
    for name, value in rows:
        table.add_row(name, value)
    return table


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
        text, kinematics = file.read_bytes(), Kinematics(made)
        path = _trace(text, file.name, made, kinematics, _home(made))
        expected_s = survey.survey(path, made, kinematics).duration_s
        if not as_json:
            tell.print(
                f"Starting the virtual bus, five simulated drives, plan and tick; {file.name} on {made.name}."
            )
        with live.started(made, text, file.name) as machine:
            now = machine.ready()
            path = _trace(text, file.name, made, kinematics, _five(now.joints))
            with _bar(f"cutting ({expected_s:.0f} s)", as_json) as progress:
                rows, last = machine.run(lambda now: progress(now.plan_time_s / expected_s))
        stretches = _stretches(path)
        trace = traces.from_rows(rows, made, kinematics, stretches)
        syncs = {
            name: asdict(traces.sync_intervals(s, made.period_s)) for name, s in machine.sync_stamps_s.items()
        }
        out.mkdir(parents=True, exist_ok=True)
        picture, trace_file = out / f"{part}.png", out / f"{part}.npz"
        _write(trace, made, stretches, trace_file, picture)
        figures = {
            "program": str(file),
            "machine": made.name,
            "period_s": made.period_s,
            "result": "fault" if last.fault is not Fault.NONE else "completed",
            "fault": last.fault.name if last.fault is not Fault.NONE else None,
            **traces.summary(trace, made, kinematics).to_dict(),
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
            show.print(_figures_table("Cut in real time on the virtual bus", figures))
            show.print(f"Picture: {picture}   Trace: {trace_file}", markup=False)


def _five(values: tuple[float, ...]) -> Joints:
    a, b, c, d, e = values
    return (a, b, c, d, e)


# --- bus -----------------------------------------------------------------------


@app.command("bus")
def bus_budget(machine: MachineFile = "trunnion", period_ms: PeriodMs = 0.0, as_json: Json = False) -> None:
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
                show.print(_budget_table(one, made))
        _budget_or_refuse(made)


def _budget_table(one: Any, machine: Machine) -> Table:
    table = Table(title=f"{one.bus}: {one.bit_rate} bit/s, tick of {one.period_us:g} us")
    for head in ("frame", "id", "bytes", "per tick", "worst us", "typical us"):
        table.add_column(head, justify="left" if head == "frame" else "right")
    for row in (*one.cyclic, *one.background):
        table.add_row(
            row.what,
            f"{row.can_id:03X}h",
            str(row.data_bytes),
            f"{row.per_tick:g}",
            f"{row.worst_us:.0f}",
            f"{row.typical_us:.0f}",
        )
    share = f"{100 * one.share:.1f} % of the tick; allowed {100 * machine.max_bus_share:.0f} %"
    table.caption = f"every tick at its worst {one.total_us:.0f} us, {share}; typical {one.typical_us:.0f} us"
    return table


# --- paper ---------------------------------------------------------------------


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
