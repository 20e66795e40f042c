"""What is sent and answered, as OpenAPI shows it. Shown units: mm, degrees, mm/min, shares 0 to 1.

What is sent is taken strictly: no unknown key, no text for a number. What the service says
is shown as it says it; new facts of a newer service are no error.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from controller.api.answers import Texts
from controller.api.models_of_tick import DriveFacts, OfTick

Axis = Annotated[str, Field(pattern=r"^[XYZABC]$", description="Name of an axis of the machine file.")]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Number = float | None  # null: not known
Millimetres = Annotated[float, Field(ge=-1e5, le=1e5)]


class Sent(BaseModel):
    """A body that is sent."""

    model_config = ConfigDict(strict=True, extra="forbid")


class Told(BaseModel):
    """A body that is answered."""

    model_config = ConfigDict(extra="allow")


# ---- sent


class Load(Sent):
    """A program to be loaded; nothing moves before POST /cycle/start."""

    program: Annotated[str, Field(min_length=1, max_length=200, description="Name in the store.")]
    line: Annotated[int | None, Field(ge=1, le=10**9, description="Start there; null: at the beginning.")] = (
        None
    )
    fraction: Annotated[float | None, Field(ge=0.0, le=1.0, description="Of the block of that line.")] = None
    dry_run_mm: Annotated[
        float | None,
        Field(ge=0.0, le=1000.0, description="Spindle off, this far away along the tool axis."),
    ] = None
    block_delete: Annotated[bool, Field(description="Leave lines out that begin with /.")] = False
    restart: Annotated[
        bool, Field(description="Where it was interrupted, as GET /restart offers; without a line.")
    ] = False


class Switch(Sent):
    on: bool


class OffsetValues(Sent):
    """A work offset: where the part's origin is on the table, and how the part is turned."""

    origin_mm: Annotated[list[Millimetres], Field(min_length=3, max_length=3)]
    turned_deg: Annotated[
        list[Annotated[float, Field(ge=-360.0, le=360.0)]],
        Field(min_length=3, max_length=3, description="About X, then Y, then Z of the table."),
    ] = [0.0, 0.0, 0.0]
    rotary_deg: Annotated[
        dict[str, Annotated[float, Field(ge=-36000.0, le=36000.0)]] | None,
        Field(description="What words of rotary axes are shifted by; left out: as it is."),
    ] = None


class ToolValues(Sent):
    """A cutter; what is left out stays as it is: corner, taper, and all that only the machine file has."""

    name: Annotated[str, Field(max_length=60)] = ""
    radius_mm: Annotated[float, Field(gt=0.0, le=500.0)]
    length_mm: Annotated[float, Field(ge=0.0, le=2000.0, description="From the gauge line to the tip.")]
    flute_mm: Annotated[float, Field(gt=0.0, le=1000.0)]
    corner_mm: Annotated[
        float | None, Field(ge=0.0, le=500.0, description="Rounding of the end; the radius: a ball end.")
    ] = None
    taper_deg: Annotated[float | None, Field(ge=0.0, le=45.0, description="Half angle of the flank.")] = None
    wear_radius_mm: Annotated[float | None, Field(ge=-0.5, le=0.5, description="Added to the radius.")] = None
    wear_length_mm: Annotated[float | None, Field(ge=-0.5, le=0.5, description="Added to the length.")] = None
    centre_cutting: Annotated[
        bool | None,
        Field(
            description="Its end cuts up to the axis; else what plunges along stock of a surface is refused."
        ),
    ] = None


class Rename(Sent):
    name: Annotated[str, Field(min_length=1, max_length=200)]


# ---- answered


class Done(Told):
    """It was done, or is being done; the status shows how it goes on.

    Of a request that the tick itself answers, the result has its outcome: done, superseded by another one, or
    given_up: what was being prepared does not begin; with the mode and the tick of that answer.
    """

    request: str
    result: dict[str, Any] = {}


class FaultFacts(Told, Texts):
    name: str
    axis: str | None = None
    cause: Texts | None = Field(None, description="Where that usually comes from.")
    remedy: Texts | None = Field(None, description="What to do.")
    recovery: str | None = None
    position_trusted: bool | None = None
    recording: str | None = None
    number: int | None = Field(None, description="Of its alarm.")
    time_s: Number = Field(None, description="When it came, seconds since 1970.")


class Note(Told, Texts):
    """What a check remarks of a line."""

    line: int | None = None


class JobFacts(Told, Texts):
    """The texts say why it was refused, or ended before its end."""

    name: str | None = None
    sha256: str | None = None
    line: int | None = None
    block: int | None = None
    fraction: Number = Field(None, description="Of the whole program.")
    blocks: int | None = None
    elapsed_s: Number = None
    left_s: Number = Field(
        None,
        description="At the present override, with what is waited for as it last took on this machine; "
        "not with stops for the operator.",
    )
    next_tool_s: Number = Field(None, description="Until the next tool is changed; None: none is.")
    next_stop_s: Number = Field(
        None, description="Until it next stops for the operator: M0, M1 where that stops, a change by hand."
    )
    duration_s: Number = None
    text: str | None = Field(None, description="Of a line typed by hand, which is in no store.")
    dry_run_mm: Number = Field(None, description="So far away along the tool axis, the spindle off.")
    checking: Number = Field(None, description="Share of its check that is done, while it is under way.")
    notes: list[Note] = Field([], description="What its check remarks.")
    restart: list[Texts] = Field([], description="The state at the place where it begins in mid program.")
    state: str | None = Field(
        None,
        description="loading, loaded or refused; from its start on starting, running, held, stopping; then "
        "completed, stopped, refused, fault or interrupted: by the end of the service; it is not loaded.",
    )
    starts: Texts | None = Field(
        None, description="What a start begins with: program, line, tool and offset."
    )
    block_delete: bool | None = Field(None, description="Lines that begin with / were left out.")
    message: str | None = Field(None, description="What the program said last, by MSG and the like.")
    messages: list[str] | None = Field(None, description="The last of them, newest last.")
    verdict: VerdictFacts | None = Field(None, description="On its surfaces; None: none has a tolerance.")


class RestartFacts(Told, Texts):
    """The program that was interrupted last, and whether it may be gone on with; the texts say why not."""

    offered: bool
    program: str | None = Field(None, description="Its name in the store: POST /job with restart = true.")
    name: str | None = Field(None, description="What it was called when it ran.")
    sha256: str | None = None
    line: int | None = None
    fraction: Number = Field(None, description="Of the block.")
    says: Texts | None = Field(None, description="Where it was interrupted, and what a restart does.")
    change: bool | None = Field(None, description="In the middle of a tool change; line is that of M6.")
    fetch: int | None = Field(None, description="The tool that must be brought into the spindle before.")
    done: Number = Field(None, description="Share of the whole program.")
    left_s: Number = Field(None, description="Of the whole program, at 100 %.")
    exact: bool | None = Field(None, description="Otherwise at or before the place, at most 1 s of cut.")
    tool: int | None = None
    interrupted_s: Number = Field(None, description="Seconds since 1970.")


class RunOutcome(Told, Texts):
    """A run since the service began, and what came of it; the texts say why it ended early."""

    id: str = Field(description="As ``record`` of the facts in GET /runs; a start is answered with it.")
    program: str
    result: str | None = Field(
        None,
        description="null: it is under way. completed; refused: a line of it on the way; stopped, fault; "
        "interrupted: by the end of the service; not_started: it moved nothing.",
    )
    line: int | None = Field(None, description="Where it ended.")


class NextFacts(Told, Texts):
    """What to do next, in one sentence, and what may be asked for it as things are."""

    verb: str = Field("", description="Of the service, that is not refused now; empty: none.")
    args: dict[str, Any] = {}
    place: str = Field("", description="Where it is done: programs, changer, restart or alarms; empty: here.")
    waits: bool = Field(False, description="Nothing is to be done: it goes on by itself.")


class JointFacts(Told):
    """Figures of an axis, mm or degrees as programs write them."""

    machine: Number = Field(None, description="Where the axis is commanded to be.")
    work: Number = Field(
        None,
        description="What its word in the program is here: under offset, shifts, turns and the length in "
        "force; in a tilted plane and under tip control X Y Z are the place of the tip in the part.",
    )
    to_go: Number = Field(None, description="What work reads at the end of the motion, less what it reads.")
    actual: Number = Field(None, description="Where the drive says that it is, as machine.")
    error: Number = None
    homed: bool | None = None
    limit: str | None = Field(None, description="The end of the travel at which it stands: + or -.")


class TableFacts(Told):
    """Of the tool in the spindle, seen from the table with its rotaries at zero."""

    tip: list[float] | None = None
    axis: list[float] | None = None
    length_mm: Number = None


class MotionFacts(Told):
    what: str | None = Field(None, description="Of its kind: line, arc, cut, lead in ...")
    fraction: Number = Field(None, description="So much of it is done.")
    u: Number = Field(None, description="Along the surface that is cut.")


class CoolantFacts(Told):
    mist: bool | None = None
    flood: bool | None = None


class NoticeFacts(Told, Texts):
    name: str


class ToolChangeFacts(Told, Texts):
    number: int = Field(
        description="Of the tool that is to be put in; 0: the one that is in is to be taken out."
    )


class SpindleChangeFacts(Told, Texts):
    rev_min: Number = Field(description="Signed: below 0 counter-clockwise; 0: it is to stand.")


class SequenceFacts(Told, Texts):
    """Work that takes some time: homing, a load, a start ...; the texts say why it failed."""

    name: str
    state: str = Field(description="running, done or failed.")


class PocketFacts(Told):
    pocket: int
    tool: int | None = Field(None, description="Whose it is.")
    here: bool | None = Field(None, description="The tool is in it; null: not known, or nobody's.")


class ChangerFacts(Told):
    """Where the tools of a changer are, and what it does."""

    spindle: int | None = Field(None, description="The tool in it, 0 = none; null: not known.")
    pockets: list[PocketFacts] = []
    away: list[int] = Field([], description="Tools out of the machine.")
    unsure: list[int] = Field([], description="Tools of which nobody knows where they are.")
    step: dict[str, Any] | None = Field(None, description="Of the change under way, or that was broken off.")
    held: bool = Field(False, description="A change stands between two steps, and goes on by resume.")
    preparing: dict[str, Any] | None = Field(None, description="The pocket that is brought to the front.")
    ready: int | None = Field(None, description="The tool whose pocket is at the front.")
    doubt: Texts | None = Field(None, description="Why a change is refused until somebody confirms.")


class Status(OfTick, Told):
    """What the machine is doing, at most 50 ms ago; null: not known."""

    time_s: Number = None
    gone_s: Number = Field(None, description="So long ago this was told last: the service is gone. See last.")
    mode: str = Field(
        description="FAULT where the tick is gone or stands still; OFF before its first one; TOOL_CHANGE "
        "while a changer changes tools: a program runs, and goes on by itself."
    )
    tick_alive: bool | None = Field(None, description="Whether the tick's process is there.")
    plan_alive: bool | None = None
    not_homed: list[str] | None = Field(None, description="Axes that are not, or whose place is not trusted.")
    control: str | None = Field(None, description="Who holds the control token; null: nobody.")
    fault: FaultFacts | None = None
    job: JobFacts | None = None
    joints: dict[str, JointFacts] = {}
    work_offset: str | None = Field(None, description="In which the joints' work positions are.")
    next: NextFacts | None = None
    can_start: bool | None = Field(
        None, description="A start of the loaded program is not refused as things are."
    )
    restart: RestartFacts | None = Field(None, description="As GET /restart, without its name in the store.")
    run: RunOutcome | None = Field(None, description="The run under way, or the last; null: none yet.")
    ended_early: Texts | None = Field(
        None, description="Why the last run did not come to its end; until the next one, or POST /job/seen."
    )
    no_resume: Texts | None = Field(
        None, description="Why a held program cannot go on from here; null: it can."
    )
    stands_at_stop: bool | None = Field(
        None, description="Held by the program: M0, M1, M60, a change by hand."
    )
    aside: bool | None = Field(None, description="The tool stands off the path of a held program.")
    retract_room_mm: Number = Field(
        None, description="So far the tool can go off along its axis from here; null: not now."
    )
    tip: dict[str, Number] | None = Field(
        None, description="X Y Z of the tool in the spindle, in the part frame that is in force."
    )
    axis: dict[str, Number] | None = Field(None, description="Its axis there, I J K.")
    on_table: TableFacts | None = None
    limited_by: str | None = Field(
        None, description="What holds the feed down now: feed, corner ... or an axis and its limit."
    )
    in_block: MotionFacts | None = Field(None, description="The motion under way, or the last of a run.")
    codes: list[str] | None = Field(
        None,
        description="What is in force, one code of each group, and T H D F S: G1, G17, G21, G90 ... T1, F200"
        "; G43.1 Z20 instead of G43 and H where the length is by words",
    )
    coolant: CoolantFacts | None = None
    inputs: dict[str, bool | None] | None = Field(None, description="By their names.")
    outputs: dict[str, bool | None] | None = None
    analogue_outputs: dict[str, Number] | None = Field(
        None, description="Their values by name, as M67 and M68 said them."
    )
    drives: list[DriveFacts] = []
    commissioned: bool | None = Field(None, description="The drives' settings were written and read back.")
    tool: int | None = Field(None, description="In the spindle; null: not known.")
    notices: list[NoticeFacts] | None = Field(
        None, description="What forbids motion, and what stopped nothing, as sentences."
    )
    tool_change: ToolChangeFacts | None = Field(None, description="The tool that the program waits for.")
    spindle_change: SpindleChangeFacts | None = Field(
        None, description="How the operator is to switch the spindle, where the program waits for that."
    )
    change: Texts | None = Field(None, description="The tool change under way: tools and step, in words.")
    changer: ChangerFacts | None = Field(None, description="null: tools are changed by hand.")
    jogging: bool | None = None
    sequence: SequenceFacts | None = Field(None, description="What is, or was last, under way.")


class SurfaceFacts(Told):
    """One surface as cut by the whole program, its ends included, against its form tolerance."""

    line: int
    tool: int
    within: bool
    tolerance_mm: float
    exceeds_mm: float
    overcut_mm: float
    undercut_mm: float
    u: float = Field(description="Where it is off most; v counts from the upper edge.")
    v: float
    height_mm: float = Field(description="Of that place above the lower edge, along its ruling.")
    place: list[float] = Field(description="X, Y, Z in the part frame, mm.")
    by: str = Field(description="The motion that cuts there: cut, lead in, pivot ...")
    by_line: int
    remedies: list[str] = Field(
        description="What helps: double, optimal, radius, smaller, side, lead, joint, apart."
    )
    radius_mm: float = Field(description="Of a cutter that would do, about; 0 = none is known.")


class VerdictFacts(Told, Texts):
    """Whether all surfaces keep their form tolerance; the figures are of the one that is worst."""

    within: bool
    tolerance_mm: float
    largest_mm: float
    exceeds_mm: float
    surfaces: list[SurfaceFacts]
    left_out: int = Field(description="More surfaces than are told.")


class CheckFacts(Told):
    """What the check said: figures where it passed, else sentence, file, line and column: the file is the
    program itself, or one whose subs it calls."""

    state: str = Field(description="none, waiting, running, passed, refused or failed.")
    progress: float = 0.0
    result: dict[str, Any] = {}
    verdict: VerdictFacts | None = None  # none has a form tolerance
    over_limit: bool = Field(
        False,
        description="Whether an axis goes beyond its velocity, acceleration or jerk: `over` of its row in "
        "`joints`.",
    )


class ProgramFacts(Told):
    name: str
    sha256: Sha256
    size: int = Field(description="Bytes.")
    lines: int
    uploaded_s: float = Field(description="Seconds since 1970.")
    uploaded_by: str
    check: CheckFacts | None = None
    last_run: dict[str, Any] | None = None
    completed: int | None = Field(
        None, description="Runs under that name that came to their end: parts made; null: not known now."
    )


class Draft(Sent):
    """A program that is being written."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    text: Annotated[str, Field(max_length=1_000_000)]


class DraftRefusal(Told, Texts):
    line: int
    column: int


class DraftRead(Told):
    refusals: list[DraftRefusal] = Field(description="The first hundred, as they stand; none: it reads well.")


class LinesAround(Told):
    lines: list[str]


class ProgramList(Told):
    programs: list[ProgramFacts]


class AlarmFacts(Told, Texts):
    id: int
    at_s: float = Field(description="Seconds since 1970.")
    name: str
    axis: str
    facts: dict[str, Any]
    acknowledged_s: Number
    acknowledged_by: str | None


class AlarmList(Told):
    alarms: list[AlarmFacts]
    before: int | None = Field(description="For the next page; null: this was the last.")


class RunFacts(Told):
    id: int
    program: str
    sha256: str
    began_s: float
    ended_s: Number
    result: str
    facts: dict[str, Any]
    files: list[str] | None = Field(None, description="Of its record; null in lists.")


class RunList(Told):
    runs: list[RunFacts]
    before: int | None = Field(description="For the next page; null: this was the last.")


class RecordingFacts(Told):
    name: str
    files: list[str]
    bytes: int


class Health(Told):
    ok: bool


class RecordingList(Told):
    recordings: list[RecordingFacts]


class DriveList(Told):
    drives: list[DriveFacts]


class Terminals(Told):
    word: int | None = Field(
        description="60FDh: bit 0 negative limit, 1 positive limit, 2 reference switch; null: not reported."
    )


class OffsetList(Told):
    """``source`` of each: "file", or "machine" where it was set at the machine or by a program."""

    offsets: dict[str, Any]
    shift: dict[str, Any]  # of G92
    references: dict[str, Any]  # of G28 and G30
    parameters: dict[str, float]  # that outlive a program


class ToolList(Told):
    tools: dict[str, Any]
