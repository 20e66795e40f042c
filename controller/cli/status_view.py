"""What ``directrix status`` shows: the machine's status as the REST interface has it, for a terminal.

Everything here takes the status' values as they come (mm, degrees, mm/min, s) and gives
something to print; what is missing shows as a dash, for a view must not fail when the
machine has something to say.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from controller.cli.speech import say
from controller.commands.table import SWITCHES
from controller.verify.console import word

Status = Mapping[str, Any]

COLOURS = {
    "READY": "green",
    "RUNNING": "bold green",
    "TOOL_CHANGE": "bold cyan",
    "HOLD": "bold yellow",
    "STOPPING": "yellow",
    "FAULT": "bold red",
    "HOMING": "cyan",
    "JOG": "cyan",
    "OFF": "dim",
}
COLUMNS = ("machine", "work", "to_go", "actual", "error")
BAR_CELLS = 30


def view(status: Status, alarms: Sequence[Mapping[str, Any]] = ()) -> RenderableType:
    """The whole of it: mode, positions, feed, job, alarms."""
    parts: list[RenderableType] = [_headline(status), *_next(status), _joints(status), *_state(status)]
    parts += [_feed(status), *_bits(status), *_job(status)]
    return Group(*parts, *_troubles(status), *_alarms(alarms))


def line(status: Status) -> str:
    """One line for logs and scripts, for instance ``RUNNING line 10 42 % left 0:31``."""
    job = status.get("job") or {}
    words = [str(status.get("mode", "?"))]
    if job:
        left = clock(job.get("left_s"))
        words.append(say("line", line=job.get("line", "-"), done=percent(done(job)), left=left))
    fault = status.get("fault")
    if fault:
        words.append(str(fault.get("name", fault)))
    return " ".join([*words, *([say("no_service")] if status.get("gone_s") is not None else [])])


def number(value: Any, places: int = 3) -> str:
    """A figure, or a dash where there is none."""
    return f"{value:.{places}f}" if isinstance(value, int | float) and not isinstance(value, bool) else "-"


def percent(share: Any) -> str:
    return f"{100.0 * share:.0f} %" if isinstance(share, int | float) else "- %"


def clock(seconds: Any) -> str:
    """Minutes and seconds, with hours where there are any; rounded up, so that 0:00 means done."""
    if not isinstance(seconds, int | float):
        return "-"
    minutes, left = divmod(-int(-seconds // 1), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{left:02d}" if hours else f"{minutes}:{left:02d}"


def _headline(status: Status) -> Text:
    mode = str(status.get("mode", "?"))
    told = Text.assemble((f" {mode} ", f"reverse {COLOURS.get(mode, '')}".strip()))
    if (gone_s := status.get("gone_s")) is not None:
        told.append(f"  {say('last_told', ago=clock(gone_s))}", "bold red")
    elif status.get("tick_alive") is False:
        told.append(f"  {say('no_tick')}", "bold red")
    if status.get("not_homed"):
        told.append(f"  {say('not_homed')}", "yellow")
    for switch in SWITCHES:
        if status.get(switch.name):
            told.append(f"  {say(switch.name)}", "cyan")
    for what in _waits(status):
        told.append(f"  {what}", "yellow")
    if holder := status.get("control"):
        told.append(f"  {say('control', holder=holder)}", "dim")
    return told


def _next(status: Status) -> Iterator[Text]:
    """What to do next, as the page has it."""
    step = status.get("next")
    if isinstance(step, Mapping) and step.get("sentence"):
        yield Text(f" {step['sentence']}", "bold")


def _state(status: Status) -> Iterator[Text]:
    """Where the tip is in the part, and the codes that are in force."""
    tip = status.get("tip")
    if isinstance(tip, Mapping):
        yield Text(say("tip", place="  ".join(f"{name} {number(value)}" for name, value in tip.items())))
    if codes := status.get("codes"):
        yield Text(" ".join(map(str, codes)), "dim")


def _waits(status: Status) -> Iterator[str]:
    """What is under way, or waited for."""
    sequence = status.get("sequence") or {}
    if sequence.get("state") == "running":
        yield say("under_way", name=sequence.get("name"))
    if message := (status.get("job") or {}).get("message"):
        yield str(message)
    changes = [status.get(name) for name in ("tool_change", "spindle_change", "change")]
    yield from (str(change.get("sentence", "")) for change in changes if change)
    if not any(changes) and status.get("waiting"):
        yield say("waiting")
    if interlock := status.get("interlock"):
        yield say("interlock", name=interlock)


def _bound(limited_by: str) -> str:
    """What holds the feed down, for instance "C acceleration", as the page has it."""
    axis, _, kind = limited_by.partition(" ")
    of_axis = f"{axis} {word(f'bound.{kind}')}" if word(f"bound.{kind}") else limited_by
    return word(f"bound.{limited_by}", of_axis)


def _joints(status: Status) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column(say("axis"))
    for column in COLUMNS:
        table.add_column(say(column), justify="right", min_width=10)
    table.add_column("")
    for name, joint in (status.get("joints") or {}).items():
        homed, limit = joint.get("homed"), joint.get("limit")
        marks = ("" if homed else say("not_homed"), say("at_limit") if limit else "")
        figures = (number(joint.get(column)) for column in COLUMNS)
        table.add_row(name, *figures, Text(" ".join(filter(None, marks)), "yellow"))
    return table


def _feed(status: Status) -> Text:
    feed = status.get("feed_mm_min") or {}
    programmed, actual = (number(feed.get(name), 0) for name in ("programmed", "actual"))
    told = Text(say("feed", programmed=programmed, actual=actual))
    if limited := status.get("limited_by"):
        told.append(f", {say('limited_by', what=_bound(str(limited)))}")
    shares = {"feed": percent(status.get("override")), "rapid": percent(status.get("rapid_override"))}
    told.append(f"   {say('overrides', **shares)}")
    spindle = status.get("spindle") or {}
    if spindle.get("on") or spindle.get("actual_rev_min") or spindle.get("rev_min"):
        reported = spindle.get("actual_rev_min")
        turns = number(spindle.get("rev_min") if reported is None else reported, 0)
        told.append(f"   {say('spindle', rev_min=turns)}")
    adaptive = status.get("adaptive") or {}
    if adaptive.get("on"):
        led = {"share": percent(adaptive.get("share")), "load": number(spindle.get("load"), 0)}
        told.append(f"   {say('adaptive', **led)}")
    return told


def _bits(status: Status) -> Iterator[Text]:
    """Inputs and outputs by name: bold is 1, a dash is not known. What a drive reported goes below them."""
    for kind in ("inputs", "outputs"):
        if bits := status.get(kind):
            told = Text(f"{say(kind)}:")
            for name, on in bits.items():
                told.append(f"  {name} {'-' if on is None else int(on)}", "bold" if on else "")
            yield told
    if levels := status.get("analogue_outputs"):
        values = "  ".join(
            f"{name} {'-' if value is None else f'{value:g}'}" for name, value in levels.items()
        )
        yield Text(f"{say('analogue_outputs')}:  {values}")
    for drive in status.get("drives") or ():
        counts = ("malformed", "missed_setpoints", "overdue_setpoints")
        for what in (
            (drive.get("error") or {}).get("sentence"),
            *(say(name, number=drive[name]) if drive.get(name) else None for name in counts),
        ):
            if what:
                yield Text(say("drive_of", axis=drive.get("axis", "-"), what=what), "yellow")


def done(job: Mapping[str, Any]) -> float | None:
    """Share of the program that is done; by its own time, for what is left counts changes and waits, too."""
    fraction = job.get("fraction")
    return float(fraction) if isinstance(fraction, int | float) else None


def _job(status: Status) -> Iterator[RenderableType]:
    job = status.get("job")
    if not job:
        yield Text(say("no_program"), "dim")
        return
    state = str(job.get("state") or "loaded")
    values = {key: job.get(key, "-") for key in ("name", "line")}
    yield Text(say("job", **values, state=word(f"state.{state}", state)))
    share = done(job)
    row = Table.grid(padding=(0, 1))
    row.add_row(
        ProgressBar(total=1.0, completed=share or 0.0, width=BAR_CELLS),
        percent(share),
        say("times", done=clock(job.get("elapsed_s")), left=clock(job.get("left_s"))),
    )
    yield row
    for key in ("next_tool", "next_stop"):
        if job.get(f"{key}_s") is not None:
            yield Text(say(key, time=clock(job[f"{key}_s"])))


def _troubles(status: Status) -> Iterator[Text]:
    if fault := status.get("fault"):
        yield Text(str(fault.get("sentence") or fault.get("name", "")), "bold red")
    sequence = status.get("sequence") or {}
    if sequence.get("state") == "failed":
        yield Text(f"{sequence.get('name')}: {sequence.get('sentence')}", "yellow")
    warning = status.get("warning")
    if isinstance(warning, Mapping):
        warning = warning.get("sentence") or warning.get("name")
    if warning:
        yield Text(str(warning), "yellow")


def _alarms(alarms: Sequence[Mapping[str, Any]]) -> Iterator[Text]:
    """Those that nobody has acknowledged yet."""
    for alarm in alarms:
        number, sentence = alarm.get("id", "-"), alarm.get("sentence", "")
        yield Text(say("alarm", number=number, sentence=sentence), "red")
