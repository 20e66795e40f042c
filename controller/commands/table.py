"""The commands of the machine, and the requests of its tick.

A new command is a row here; what it does beyond asking the tick is a function of its name in
``service.command_handlers``, and its texts are "help.<verb>" and "client.<answer>" of the catalogue. One that
switches something in the tick has its request here, too, and is handled in ``tick.mode``.
"""

from __future__ import annotations

from enum import IntEnum

from controller.commands.arguments import (
    Argument,
    Choice,
    Given,
    Label,
    Named,
    Number,
    Several,
    Switch,
    Text,
    Whole,
)
from controller.commands.command import Access, Client, Command, Lane, Rest

MAX_AXES = 5  # of a machine: for so many there is room in what is laid out once for all (live state, masks)
MAX_OVERRIDE = 2.0
SPINDLE_OVERRIDES = (0.5, 1.5)  # below it is no override but a stop, which is another button
MAX_TOOL = 99_999
MAX_MACRO = 40  # letters of the name of one, so that it fits on a button
MAX_WHOLE = 2**53  # JSON has no larger ones that are exact
JOG_SEEN_S = 0.4  # age of the tick that whoever presses has seen; statuses come every 50 ms


class Request(IntEnum):
    """What the tick is asked for; the value of a datagram's first byte."""

    START = 1  # value: ``StaysOn``
    HOLD = 2
    RESUME = 3
    STOP = 4
    OVERRIDE = 5  # value: share of F, 1.0 = 100 %
    RAPID_OVERRIDE = 6  # value: share of the rapid speed
    ENABLE = 7
    DISABLE = 8
    HOME = 9  # value: bit mask of the axes, bit i = i-th [[axis]]
    RESET = 10
    ESTOP = 11
    SINGLE_BLOCK = 12  # value: 1 = stop at the end of each block, 0 = run through
    OPTIONAL_STOP = 13  # value: 1 = M1 stops, 0 = it does not
    JOG = 14  # a datagram of its own: pieces.Jog; sent again and again while a key is down
    JOG_STOP = 15  # the key is up
    ARRANGED = 16  # a datagram of its own: what commissioning has found of the drives
    PLAN_LOST = 17  # of the service: the process that knows the rest of the program has died
    SPINDLE_OVERRIDE = 18  # value: share of S
    SPINDLE = 19  # value: rev/min by hand, without a program; signed, 0 = off
    COOLANT = 20  # value: 0 off, 1 mist, 2 flood, 3 both; of a program until it says otherwise
    CLAMPS = 21  # value: bit mask of the axes whose clamps are open by hand
    PREPARE = 22  # value: outputs of a tool changer's preparation, see ``Changer.output_word``
    ADAPTIVE_FEED = 23  # value: 1 = adaptive feed also without M52 P1, 0 = as the program says


# ---- arguments that several commands have

PRESS = Argument("press", Label(40), default="", is_local=True)
AXIS = Text(1, 1, "^[XYZABC]$")
NUMBERED = r"G54\.(1 P([1-9]|[1-3][0-9]|4[0-8])|2 P[1-8])"
SET_NAME = rf"^(G5[4-9]|G59\.[1-3]|{NUMBERED}|G92|G28|G30|T[0-9]{{1,5}}|#[0-9]{{1,4}}|all)$"
ON = (Argument("on", Switch()),)
FRAME = Argument("frame", Choice(("joint", "part", "tool")))
JOGGED = Argument(
    "axis",
    Text(3, 1, "^([XYZABC]|[XYZ][+-][XYZ])$"),
    "Name of an axis of the machine file, or two linear ones for the diagonal between them: X+Y, X-Y.",
)
JOG_FEED = Argument(
    "feed",
    Number(0.0, 1e6, above=True),
    "At most so many mm/min along the line, degrees/min of a rotary.",
    None,
)
TOOL = Argument("tool", Whole(1, MAX_TOOL))
ITEM = Argument("name", Text(60, 1))
STILL = Argument(
    "still",
    Switch(),
    'Refused with the code "moves" where an axis would move, the spindle turn, a tool be changed or '
    "an output be switched.",
    False,
)
FREE = ("OFF", "READY", "FAULT")  # modes in which offsets and tools may be changed


def share(highest: float = 1.0, lowest: float = 0.0) -> tuple[Argument, ...]:
    """The argument of an override."""
    return (Argument("share", Number(lowest, highest), "1.0 = 100 %."),)


def look(name: str, *arguments: Argument, lane: Lane | None = None) -> Command:
    """A command that changes nothing; what it answers is more than done, so its route is written by hand."""
    return Command(name, Access.LOOK, arguments, lane=lane)


def given(*names: str) -> tuple[Argument, ...]:
    """Arguments that the handler alone reads, as they depend on one another."""
    return tuple([Argument(name, Given(), default=None) for name in names])


# ---- the table

PANEL_LOSSES = ("store_gone", "store_lost", "store_rows", "users_lost", "users_lost_some")  # keys of texts
ALL: tuple[Command, ...] = (
    look("status", lane=Lane.QUICK),
    look("facts"),
    look("restart"),
    Command(
        "load",
        Access.MOVE,
        given("path", "name", "sha256", "files", "line", "fraction", "dry_run_mm")
        + given("block_delete", "restart", "unchecked"),
        needs=("not_running",),
        modes=("OFF", "READY"),
        lane=Lane.SLOW,
        one_at_a_time=True,
    ),
    Command(
        "unload",
        Access.MOVE,
        needs=("not_running",),
        modes=FREE,
        lane=Lane.SLOW,
        rest=Rest("DELETE", "job", "Forget the loaded program; refused while it runs."),
    ),
    Command(
        "seen",
        Access.OPERATE,
        rest=Rest(
            "POST", "job/seen", "Somebody has read why the last run ended early; it is not told again."
        ),
        client=Client("seen", "seen"),
    ),
    Command(
        "start",
        Access.MOVE,
        (
            Argument(
                "unrecorded",
                Switch(),
                "Also where the disk takes no record of it: such a run is not gone on with after a loss of "
                "power, nor made again, and a fault in it leaves no recording.",
                False,
            ),
            Argument(
                "worn", Switch(), "Also where the tool in the spindle is at the end of its life.", False
            ),
        ),
        Request.START,
        needs=("loaded", "mode", "not_in_thread", "not_worn", "not_running", "changer", "damage"),
        rest=Rest(
            "POST",
            "cycle/start",
            "Cycle start of the loaded program.\n\n"
            'Where the disk cannot take what the run leaves behind, it is refused with the code "unrecorded";'
            ' with\n"worn" where the tool in the spindle is at the end of its life.',
            bodiless=True,
        ),
        one_at_a_time=True,
    ),
    Command(
        "hold",
        Access.STOP,
        (PRESS,),
        Request.HOLD,
        rest=Rest("POST", "cycle/hold", "Slow down to rest on the path, at once. Needs no control token."),
        client=Client("hold", "held"),
    ),
    Command(
        "resume",
        Access.MOVE,
        (),
        Request.RESUME,
        rest=Rest("POST", "cycle/resume", "Go on after a hold."),
        client=Client("resume", "resumed", waits=True),
    ),
    Command(
        "stop",
        Access.STOP,
        (PRESS,),
        Request.STOP,
        rest=Rest(
            "POST",
            "cycle/stop",
            "Slow down to rest on the path and end the program. Needs no control token.",
        ),
        client=Client("stop", "stopped"),
    ),
    Command(
        "estop",
        Access.STOP,
        (PRESS,),
        Request.ESTOP,
        rest=Rest(
            "POST",
            "machine/estop",
            "Ask for an emergency stop. This is no safety function: that is the machine's own circuit.",
        ),
        client=Client("estop", "estop"),
    ),
    Command(
        "single_block",
        Access.MOVE,
        ON,
        Request.SINGLE_BLOCK,
        bit=1,
        state="Stop after every block.",
        rest=Rest(
            "PUT", "cycle/single_block", "Stop at the end of every block, or run through.", body="Switch"
        ),
    ),
    Command(
        "optional_stop",
        Access.MOVE,
        ON,
        Request.OPTIONAL_STOP,
        bit=2,
        state="M1 stops.",
        rest=Rest("PUT", "cycle/optional_stop", "Whether M1 stops.", body="Switch"),
    ),
    Command(
        "adaptive_feed",
        Access.MOVE,
        ON,
        Request.ADAPTIVE_FEED,
        bit=64,
        state="The load of the spindle leads the feed without M52 P1, too.",
        needs=("adaptive",),
        rest=Rest(
            "PUT",
            "cycle/adaptive_feed",
            "Whether the load of the spindle leads the feed of every cut, or only where the program says "
            "M52 P1.",
            body="Switch",
        ),
        client=Client("adaptive", "adaptive"),
    ),
    Command(
        "override",
        Access.MOVE,
        share(MAX_OVERRIDE),
        Request.OVERRIDE,
        rest=Rest(
            "PUT", "overrides/feed", "Scale the programmed feed; acts at once.", "", "Share", "An override."
        ),
    ),
    Command(
        "rapid_override",
        Access.MOVE,
        share(),
        Request.RAPID_OVERRIDE,
        rest=Rest(
            "PUT",
            "overrides/rapid",
            "Scale the speed of rapids; acts at once.",
            body="RapidShare",
            body_text="An override of rapids; they never go faster than planned.",
        ),
    ),
    Command(
        "spindle_override",
        Access.MOVE,
        share(SPINDLE_OVERRIDES[1], SPINDLE_OVERRIDES[0]),
        Request.SPINDLE_OVERRIDE,
        rest=Rest(
            "PUT",
            "overrides/spindle",
            "Scale the programmed spindle speed; acts at once, and the feed goes on meanwhile.",
            body="SpindleShare",
            body_text="An override of the spindle.",
        ),
    ),
    Command(
        "spindle",
        Access.MOVE,
        (Argument("rev_min", Number(-1e6, 1e6), "Signed; 0 = off."),),
        Request.SPINDLE,
        needs=("spindle", "changer", "mode"),
        rest=Rest(
            "PUT",
            "machine/spindle",
            "Turn the spindle by hand, in READY; a program that starts begins with it off (MDI does not).",
            body_text="The spindle by hand.",
        ),
        client=Client("spindle", "spindle_turns", "spindle_off", negative=True),
    ),
    Command(
        "coolant",
        Access.MOVE,
        (Argument("mist", Switch(), default=False), Argument("flood", Switch(), default=False)),
        Request.COOLANT,
        rest=Rest(
            "PUT",
            "machine/coolant",
            "Coolant by hand: in READY, and of a program until it says otherwise.",
            body_text="Coolant by hand.",
        ),
        client=Client("coolant", "coolant"),
    ),
    Command(
        "clamps",
        Access.MOVE,
        (Argument("open", Several(AXIS, MAX_AXES), "Axes whose clamps are open."),),
        Request.CLAMPS,
        rest=Rest(
            "PUT",
            "machine/clamps",
            "Open and close clamps by hand, in READY.",
            body_text="Clamps by hand.",
        ),
        client=Client("clamps", "clamps", renamed=(("open", "axes"),)),
    ),
    Command(
        "enable",
        Access.MOVE,
        (),
        Request.ENABLE,
        lane=Lane.SLOW,
        rest=Rest("POST", "machine/enable", "Drives on; the machine stands."),
        client=Client("enable", "enabled"),
        one_at_a_time=True,
    ),
    Command(
        "disable",
        Access.MOVE,
        (PRESS,),
        Request.DISABLE,
        lane=Lane.STOP,
        rest=Rest("POST", "machine/disable", "Drives off, brakes first."),
        client=Client("disable", "disabled"),
    ),
    Command(
        "home",
        Access.MOVE,
        (Argument("axes", Several(AXIS, MAX_AXES, 1), "null: all.", None),),
        Request.HOME,
        needs=("mode", "not_running", "not_in_thread", "changer"),
        modes=("READY",),  # there the drives are switched off first
        lane=Lane.SLOW,
        rest=Rest("POST", "machine/home", "Home all axes, or some."),
        client=Client("home", "homed"),
        one_at_a_time=True,
    ),
    Command(
        "reset",
        Access.MOVE,
        (),
        Request.RESET,
        lane=Lane.SLOW,
        rest=Rest("POST", "machine/reset", "Leave a fault; nothing starts by it."),
        client=Client("reset", "reset"),
        one_at_a_time=True,
    ),
    Command(
        "mdi",
        Access.MOVE,
        (Argument("text", Text(1000, 1), "One or more blocks."), STILL),
        Request.START,
        needs=("not_in_thread", "damage"),
        lane=Lane.SLOW,
        rest=Rest("POST", "mdi", "Run one or more blocks as they are given."),
        client=Client("mdi", "started", waits=True),
        one_at_a_time=True,
    ),
    Command(
        "macro",
        Access.MOVE,
        (
            Argument("name", Text(MAX_MACRO, 1), "As `macros` of the facts has it.", in_path="name"),
            STILL,
            Argument(
                "role", Choice(("view", "operate", "set_up")), default="set_up", is_local=True, is_role=True
            ),
        ),
        Request.START,
        needs=("not_in_thread", "damage"),
        lane=Lane.SLOW,
        rest=Rest(
            "POST",
            "macros/{name}",
            "Run the lines of a macro of the machine file (`macros` of the facts) as if they were typed at "
            "MDI.\n\nRefused to who has not the role that the macro asks for.",
            bodiless=True,
        ),
        client=Client("macro", "started", waits=True),
        one_at_a_time=True,
    ),
    Command(
        "probe",
        Access.MOVE,
        (
            Argument("cycle", Text(20), "A name that GET has."),
            Argument("values", Named(10, -1000.0, 1000.0, 8), default={}),
            Argument("offset", Text(10), "To be set: G54 to G59.3, or none.", "none"),
        ),
        Request.START,
        needs=("not_in_thread",),
        lane=Lane.SLOW,
        rest=Rest(
            "POST",
            "probing",
            "Run one; what it finds is among the messages of the job, and in the offset where it sets one.",
            body="Cycle",
            body_text="Values that are not named are as usual.",
        ),
        one_at_a_time=True,
    ),
    look("probed"),
    Command(
        "retract",
        Access.MOVE,
        (Argument("mm", Number(0.0, 1000.0, above=True), "Along the tool axis."),),
        needs=("not_in_thread", "changer"),
        modes=("HOLD", "READY"),
        lane=Lane.SLOW,
        rest=Rest(
            "POST",
            "cycle/retract",
            "In a hold, or ready: move back along the tool axis, to look, to change the insert, or after a "
            "fault.\n\nAt most by the status' `retract_room_mm`; a refusal says how far.",
        ),
        client=Client("retract", "retracted"),
        one_at_a_time=True,
    ),
    Command(
        "withdraw",
        Access.MOVE,
        (
            Argument(
                "mm",
                Number(0.0, 500.0, above=True),
                "Along the thread; left out: as deep as known.",
                None,
            ),
            Argument("is_out", Switch(), "The tool has been turned out by hand: nothing moves.", False),
        ),
        Request.START,
        modes=("OFF", "HOLD"),  # where it has been turned out by hand
        lane=Lane.SLOW,
        rest=Rest(
            "POST",
            "cycle/withdraw",
            "Out of a thread in which a fault, a stop or a loss of power has left the tool: in step.\n\n"
            "Until then nothing else moves the machine but a resume. What is known of the thread is the "
            "notice\nIN_THREAD of the status.",
        ),
        client=Client("withdraw", "withdrawn", renamed=(("is_out", "out"),)),
        one_at_a_time=True,
    ),
    Command(
        "return",
        Access.MOVE,
        modes=("HOLD",),
        lane=Lane.SLOW,
        rest=Rest(
            "POST",
            "cycle/return",
            "Back to a place off the part, beside the path, with the tool that is in the spindle now.\n\n"
            "A resume then leads in and goes on. Refused where the way would lead into a surface of the "
            "program.",
            name="return_",
        ),
        client=Client("return", "returned"),
        one_at_a_time=True,
    ),
    # Dead-man: the axes come to rest 200 ms after the last request. Requests can overtake each other on their
    # way, so a late one could start what a stop has ended: it is known by the name of its press, and refused;
    # a stop from anywhere ends the press of a key that is held (``service.jogging``). So is one that a panel
    # which hung has kept, sooner than others (``seen_s``): by then nobody may be pressing any more.
    Command(
        "jog",
        Access.MOVE,
        (
            FRAME,
            JOGGED,
            Argument("speed", Number(-1.0, 1.0), "Share of the jog speed, with its sign."),
            JOG_FEED,
            Argument(
                "press",
                Label(40),
                "Names one press of a key. A stop or a hold by anybody ends it: what comes of it afterwards "
                "is refused; press anew under another name. Without a name, 200 ms of silence do.",
                "",
            ),
        ),
        Request.JOG,
        needs=("not_in_thread", "mode"),
        rest=Rest(
            "POST",
            "jog",
            "Move on along an axis; repeat at least every 200 ms, at limits it comes to rest.",
            body_text="Go on moving. Must be repeated: without it the axes come to rest after 200 ms.",
            seen_s=JOG_SEEN_S,
        ),
    ),
    Command(
        "jog_step",
        Access.MOVE,
        (
            FRAME,
            JOGGED,
            Argument("distance", Number(-1000.0, 1000.0), "mm or degrees, with its sign."),
            JOG_FEED,
        ),
        Request.JOG,
        needs=("not_in_thread", "mode"),
        rest=Rest("POST", "jog/step", "Move by a distance; at limits it comes to rest."),
    ),
    Command(
        "jog_stop",
        Access.STOP,
        (Argument("press", Label(40), "The one that ended; empty: whichever jogs.", ""),),
        Request.JOG_STOP,
        rest=Rest("POST", "jog/stop", "Come to rest. Needs no control token.", idle_is_done=True),
    ),
    Command(
        "set_offset",
        Access.MOVE,
        given("name", "values", "reads", "tool"),
        modes=FREE,
        lane=Lane.SLOW,
    ),
    Command(
        "set_tool",
        Access.MOVE,
        given("number", "reads", "remove"),
        modes=(*FREE, "HOLD"),
        lane=Lane.SLOW,
        open_ended=True,
    ),
    Command(
        "forget",
        Access.MOVE,
        (Argument("name", Text(20, 1, SET_NAME), in_path="name"),),
        modes=FREE,
        lane=Lane.SLOW,
        rest=Rest(
            "DELETE",
            "offsets/{name}",
            "Back to the machine file's: an offset, G92, G28, G30, a tool (T3), a parameter (#500), or all.",
        ),
    ),
    look("drives"),
    look("alarms"),
    Command(
        "acknowledge",
        Access.OPERATE,
        (Argument("id", Whole(0, MAX_WHOLE), default=None),),
        lane=Lane.LOOK,
    ),
    Command(
        "panel_damaged",
        Access.OPERATE,
        (
            Argument("key", Choice(PANEL_LOSSES)),
            Argument("values", Named(4, 0.0, MAX_WHOLE, 1000), "Of the text of that key."),
        ),
        lane=Lane.LOOK,
    ),
    Command(
        "keep_run",
        Access.OPERATE,
        (Argument("record", Text(200, 1), "Name of its folder."), *ON),
        lane=Lane.LOOK,
    ),
    look("rows", *given("after", "most", "kept")),
    look("buses"),
    look("terminals", Argument("axis", AXIS)),
    look("usage"),
    Command(
        "tool_life",
        Access.OPERATE,
        (
            TOOL,
            Argument("cut_min", Number(0.1, 1e6), "Minutes of cutting.", None),
            Argument("cut_m", Number(0.1, 1e6), "Metres of cutting.", None),
            Argument("parts", Whole(1, 1_000_000), default=None),
            Argument("sister", Whole(1, MAX_TOOL), "What comes in its place at M6 once it is worn.", None),
        ),
        needs=("tool_in_table",),
    ),
    Command("tool_renewed", Access.OPERATE, (TOOL,), needs=("tool_in_table",)),
    Command(
        "maintenance",
        Access.SET_UP,
        (
            ITEM,
            Argument("counter", Text(40), "An axis, motion or spindle.", ""),
            Argument(
                "every",
                Number(0.001, 1e9),
                "In the counter's unit; null: no such job any more.",
                None,
            ),
        ),
    ),
    look("changer"),
    Command(
        "changer_confirm",
        Access.MOVE,
        (
            Argument("spindle", Whole(0, MAX_TOOL), "The tool in it, 0 = it is empty."),
            Argument("away", Several(Whole(1, MAX_TOOL), 999), "Out of the machine.", []),
            Argument("clear", Switch(), "You have looked, and nothing of it touches the spindle.", False),
        ),
        needs=("not_running",),
        modes=FREE,
        lane=Lane.SLOW,
        rest=Rest(
            "POST",
            "changer/confirm",
            "Where every tool is, as you see it: after a change that was interrupted nothing moves before.",
            name="confirm",
            body="ToolPlaces",
            body_text="Every tool that is not named is in its pocket.",
        ),
    ),
    Command(
        "changer_pocket",
        Access.MOVE,
        (
            Argument("pocket", Whole(1, 999), in_path="number"),
            Argument("tool", Whole(0, MAX_TOOL), "Whose it is, 0 = nobody's."),
        ),
        modes=FREE,
        lane=Lane.SLOW,
        rest=Rest(
            "PUT",
            "changer/pockets/{number}",
            "Give a pocket to a tool; where all tools are must be confirmed then.",
            name="pocket",
            body="Pocket",
        ),
    ),
    Command("maintained", Access.OPERATE, (ITEM, Argument("by", Label(60), default=""))),
)

# A route that is asked again and again while a key is held; it is noted once.
REPEATED = tuple([f"/{command.rest.path}" for command in ALL if command.rest and command.rest.seen_s])
COMMANDS: dict[str, Command] = {command.name: command for command in ALL}
SWITCHES: tuple[Command, ...] = tuple([command for command in ALL if command.is_switch])
SWITCHED = {Request(one.request): one for one in SWITCHES if one.request is not None}
OVERRIDES = (Request.OVERRIDE, Request.RAPID_OVERRIDE, Request.SPINDLE_OVERRIDE)
ENDS = frozenset([command.name for command in ALL if command.way is Lane.STOP])  # a press that is held, too
