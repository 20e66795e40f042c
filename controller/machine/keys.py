"""What the keys of a machine file mean, and ``config/KEYS.md``, which is made from it.

What a key may be and what it is where the file is silent stands where it is read (``toml_table``), and
nowhere else: the reference takes it from a reading of a file that has every key.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping

from controller.machine.equipment import M_CODES
from controller.machine.program_table import OWN_CODES
from controller.machine.toml_table import Known, Table

ARRAYS = (
    "bus",
    "axis",
    "tool",
    "file",
    "macro",
    "straightness",
    "changer.put_away",
    "changer.take",
    "changer.prepare",
)  # of tables, in double brackets
NAMES = (
    "offsets",
    "changer.put_away.move_mm",
    "changer.put_away.move_deg",
    "changer.take.move_mm",
    "changer.take.move_deg",
    "io.inputs",
    "io.outputs",
    "io.m_codes",
    "machine.own_codes",
    "io.analogue_out",
    "offsets.*.rotary_deg",
)
AS_ABOVE = ("spindle.override", "io.override")  # as of an axis
# Keys whose range, or what they are where the file is silent, is what the file has elsewhere.
ELSEWHERE = {
    "bus": ("the name of a `[[bus]]`", "the first"),
    "position_{unit}": ("within the travel", ""),
    "reference_{unit}": ("within the travel", "where it is homed"),
    "second_reference_{unit}": ("within the travel", "as `reference`"),
    "rest_{unit}": ("", "a tenth of `following_error`"),
    "at_speed_{unit}": ("", "`following_error`, narrowed as measured"),
    "in_position_{unit}": ("up to `rest`", "a tenth of `rest`"),
    "output": ("a name of `[io]`", ""),
    "inverted": ("names of `[io]`", ""),
    "corner_mm": ("up to `radius_mm`", ""),
    "moves": ("the name of a slide, but `along`", ""),
    "at_{unit}": ("numbers in brackets", "of `pitch`: the ends of the travel"),
    "up_{unit}": ("as many numbers as `at`", "half of `backlash` on either side"),
    "down_{unit}": ("as many numbers as `at`", "`up` and `backlash`"),
    "off_mm": ("as many numbers as `at`", ""),
    "from_mm": ("", "0, or where the one before ends"),
    "may_turn": ("", "true, but false of a probe"),
    "wear_radius_mm": ("up to 0.5 mm, and to half of the radius", ""),
}

_OVERRIDE = {
    "object": 'of the drive, as `"2210:01"`',
    "low": "least value that it really takes",
    "high": "largest value that it really takes",
    "access": "as the drive really has it",
    "default": "its value after power-on",
    "mappable": "whether a PDO takes it",
    "type": "of an object that the sheet lacks",
    "reason": "who says so; it is told with every commissioning",
}
_UNITS = {
    "velocity_unit_counts_s": "one unit of 6099h, 60B1h and 60FFh, where the drive does not tell",
    "acceleration_unit_counts_s2": "one unit of 6085h and 609Ah; left out: that of velocity, per second",
}
_STEP = {  # moves first, then the spindle's angle, then outputs, then the input
    "name": "of the step, as the operator calls it",
    "within_s": "not done by then: held, and told",
    "fails": "what he is told then",
    "move_mm": "of X Y Z by name: a machine position, or one of each pocket in brackets",
    "move_deg": "likewise of the rotaries",
    "orient": "the spindle comes to its angle, as by M19",
    "on": "outputs of `[io]` that are switched on",
    "off": "outputs of `[io]` that are switched off",
    "pocket": "outputs that say the pocket's number in binary, the least bit first",
    "input": "of `[io]`: says that the step is done",
    "level": "what it does then, or is; of a step that carries a change alone counts",
    "carries": "the tool is in its pocket (of `take`: in the spindle) when the step is done",
}
_BESIDE = ("name", "within_s", "fails", "on", "off", "pocket", "input", "level")  # of a step beside a cut
_DEVICE = {
    "bus": "on which it is",
    "node": "its CANopen node id",
    "eds": "its data sheet, seen from the machine file",
    "unsupervised": "accept it though it does not notice a dead controller, with a warning each time",
    "override": "where its data sheet is wrong",
}

# By table: * is a name that the file gives; {unit} is mm of a slide and deg of a rotary.
MEANINGS: Mapping[str, Mapping[str, str]] = {
    "machine": {
        "name": "as page and records call it",
        "period_s": "one tick: a setpoint of every axis",
        "sync": "nothing is left to choose: `directrix-pump` sends SYNC, without a stock the tick",
        "clearance_mm": "above a block's highest point, where the tool goes down with feed",
        "lead_mm": "so far off a surface its leads begin and end",
        "lead_feed": "of the tip on leads, mm/min; left out: as fast as the limits allow",
        "link_mm": "from surface to surface without a retract, where the way is no longer",
        "retract_mm": "machine position of Z at which the rotaries may turn freely",
        "rapid_share": "of the axes' limits that rapids use",
        "gouge": "what overcut, and a form tolerance that is exceeded, do to a program",
        "tolerance_mm": "of the form of surfaces, ends included; left out: none is held",
        "contour_error": "what is done where drives lead the tool off its path by more than `tolerance_mm`",
        "max_overcut_mm": "what is deeper is a gouge wherever it comes from",
        "placement": "of the cutter on surfaces",
        "tool_lines": "how the tool's axis goes between rotary words under G43.4",
        "joint_tolerance_mm": "gap between two surfaces that is rounding; 0: no blends",
        "joint_tolerance_deg": "the same for their normals at the contact",
        "arc_tolerance_mm": "most by which the ends of an arc may differ in their radius",
        "tip_acceleration_mm_s2": "largest of the tool's tip in the part, on feed moves",
        "axis_speed_deg_s": "largest angular speed of the tool's axis in the part",
        "kinematics": "what axes the machine has",
        "max_bus_share": "of a tick that the frames of a bus may take at their worst",
        "max_quick_stop_s": "a drive that takes longer to stop by itself is refused",
        "stock_ms": "for which the drives get their setpoints on time though a tick is late; 0: no stock",
        "late": "what more late ticks than `skip_limit_per_s` do",
        "skip_limit_per_s": "late ticks within a second of running",
        "longest_program_h": "a program that takes longer at its feeds and with its dwells is refused",
        "call_levels": "subs of a program that may call each other",
        "program_passes": "rounds of loops and calls of subs, together, in one run",
        "dialect": "how what differs between controls is read",
        "start_state": "the modal state in which a program begins: that of power-on, or the one in force",
        "without_point": 'what a length without a decimal point counts in under `fanuc`; "": refused',
        "macro_variables": "whose tool offsets #2001 to #2800 are under `fanuc`",
        "sub_folders": "folders of subs, searched in their order behind that of the program",
        "own_codes": f"codes of the machine's own ({OWN_CODES}): the name of a sub, or the code meant",
        "kept_parameters": "numbers, or [first, last], that outlive a program and a loss of power",
    },
    "tools": {
        "file": "the tool table, seen from the machine file",
        "change_s": "what a change by hand takes, for the time that `check` tells",
    },
    "offsets.*": {
        "origin_mm": "of the part, seen from the table with all rotaries at zero",
        "turned_deg": "about X, then Y, then Z of the table, all standing still",
        "rotary_deg": "by rotary: what its words are shifted by",
    },
    "bus": {
        "name": "by which axes and devices name it",
        "interface": "`virtual`, `socketcan`, or another of python-can's",
        "channel": "of the interface, as `can0`",
        "bit_rate": "bit/s; 0 on a virtual bus: frames take no time",
    },
    "axis": {
        "name": "X, Y, Z of a slide, A, B, C of a rotary",
        "kind": "a slide, a rotary under the work, or a rotary in the head",
        "direction": "of positive travel; a rotary turns the carried body about it, right-handed",
        "point_mm": "of a rotary: a point on its axis, with the machine at zero",
        "sense": "how a table rotary is shown: as the body turns, or as if the tool did (ISO 841)",
        "travel_{unit}": "[lower, upper]",
        "velocity_{unit}_s": "largest of this axis",
        "acceleration_{unit}_s2": "largest of this axis",
        "jerk_{unit}_s3": "largest of this axis",
        "counts_per_{unit}": "of the drive's position; its sign is the direction",
        **_DEVICE,
        "profile": "of the drive: a shipped one, or a file beside the machine file",
        "serial": "of the very drive that belongs here (1018h:04); 0: any of its kind",
        "homing": "how it finds its zero",
        "following_error_{unit}": "largest that the drive allows itself (6065h)",
        "following": "largest that the controller allows it",
        "brake": "whether it has a holding brake",
        "feedback_every": "its position comes with every so many SYNCs",
        "feed_forward": "whether the velocity goes with the target (60B1h)",
        "enable_group": "lowest first; disabled in reverse",
        "pitch": "what it misses of its targets: pitch and backlash, as ISO 230-2 has them",
        "clamp": "that holds it where it stands",
        "temperature": "where the drive tells how warm it is",
        "demand": "where the drive tells the setpoint that it goes by: those that it has missed are counted",
        "setpoint_deadline_ms": "without setpoints for so long (1400h:05) the drive says so, and stops",
        "quick_stop_{unit}_s2": "of the drive's own stop (6085h); left out: the largest acceleration",
        **_UNITS,
        "reference_{unit}": "where G28 leads",
        "second_reference_{unit}": "where G30 leads",
    },
    "axis.homing": {
        "method": "of CiA 402-2 (6098h); 0: the encoder is absolute",
        "group": "axes of a group home side by side, the groups in order",
        "position_{unit}": "of the axis at the homed point",
        "absolute": "the encoder knows where it is: never homed",
        "fast_{unit}_s": "search for the switch (6099h:01); left out: as the drive has it",
        "slow_{unit}_s": "search for the edge or the index (6099h:02); left out: as the drive has it",
        "acceleration_{unit}_s2": "609Ah; left out: as the drive has it",
    },
    "axis.following": {
        "rest_{unit}": "at rest",
        "at_speed_{unit}": "added at the largest velocity, and in proportion below it",
        "in_position_{unit}": "where motion has arrived: spindle, coolant and clamps wait for it",
        "ticks": "feedbacks in a row beyond it are a fault",
    },
    "axis.pitch": {
        "at_{unit}": "positions that were measured, rising",
        "up_{unit}": "there, come to in the positive sense: where it is, less where it was told to be",
        "down_{unit}": "the same in the negative sense; left out: as `up`, and `backlash` more",
        "backlash_{unit}": "what is lost on reversal, where the senses differ by the same everywhere",
    },
    "axis.clamp": {
        "output": "of `[io]`; 1: open",
        "input": "of `[io]`; 1: closed; left out: nothing reports",
        "open_s": "most that opening or closing may take",
    },
    "axis.temperature": {
        "index": "of the object",
        "sub": "its sub-index",
        "bits": "its size, signed",
        "tpdo": "number of the one that takes it, twice a second at most",
        "per_degree": "of its unit",
    },
    "axis.demand": {
        "tpdo": "number of the one that takes it",
        "index": "60FCh: that setpoint; 60F4h: by which the position is off it",
        "every": "with every so many SYNCs",
        "per_count": "of the object's unit in one count of the axis",
    },
    "axis.override": _OVERRIDE,
    "spindle": {
        "max_rev_min": "largest S",
        **_DEVICE,
        "profile": "of the drive, as of an axis",
        "counts_per_rev": "of its encoder; its sign is the direction of M3",
        "mode": "60FFh in mode 9 (csv) or 3 (pv)",
        "at_speed_share": "at speed within this share of the wanted one",
        "spin_up_s": "not at speed, or standing, by then: held, with a fault",
        "acceleration_rev_s2": "at which it is led to its speed in mode 9",
        "position": "its angle at every SYNC: G33, G33.1, G84 and G74 follow it",
        "adaptive": "its load leads the feed under M52 P1; left out: M52 P1 is refused",
        **_UNITS,
    },
    "spindle.position": {
        "counts_per_rev": "of what it tells; its sign is the direction of M3; left out: as above",
        "index": "object of the position, 32 bits",
        "sub": "its sub-index",
        "tpdo": "number of the one that takes it, at every SYNC",
        "load": "the torque (6077h) goes beside it",
        "gain_per_s": "of the loop that leads the spindle along a thread",
        "acceleration_rev_s2": "at most along a thread, in both directions; left out: as above",
        "most_lag_rev": "behind the thread by more: held, with a fault",
    },
    "spindle.adaptive": {
        "load_percent": "of the rated torque (6076h) that the feed is to keep",
        "min_share": "of F, below which the feed is not lowered",
        "max_share": "of F; above 1 a light cut is made faster than F says, within the limits of the axes",
        "fall_s": "time constant of a share that falls",
        "rise_s": "of one that rises, not shorter",
        "overload_percent": "of the rated torque: so high for `overload_s` is a dull or broken cutter: held",
        "overload_s": "see `overload_percent`",
    },
    "io": {
        **_DEVICE,
        "inputs": "name and bit; an input is 1 where all is well",
        "outputs": "name and bit",
        "inverted": "names whose wire is 0 when they are on",
        "digital_in": "names of inputs that programs wait for: P0, P1 ... of M66",
        "digital_out": "names of outputs that they switch: P0, P1 ... of M62 to M65",
        "held": "of them those that stay as they are at a program's end, a stop and a fault",
        "m_codes": f"what {M_CODES} switch",
        "analogue_out": "E0, E1 ... of M67 and M68, by name",
        "orient": "of M19: the spindle's drive goes to its angle",
    },
    "io.m_codes.*": {"output": "of `digital_out`", "on": "whether it is switched on or off"},
    "io.analogue_out.*": {
        "channel": "sub-index of 6411h",
        "low": "least Q",
        "high": "largest Q",
        "low_counts": "what the node is told for the least",
        "high_counts": "what it is told for the largest",
    },
    "io.orient": {
        "output": "on while the spindle is to be at its angle",
        "input": "1: it is there",
        "angle_deg": "where that is",
        "within_s": "not there by then: held, with a fault",
        "shift": "which way then leads the tip off the wall, for G76 and G87; left out: they are refused",
    },
    "changer": {
        "pockets": "the tools of pocket 1, 2 ...; 0: the pocket is nobody's",
        "put_away": "the steps that bring the tool of the spindle into its pocket",
        "take": "the steps that bring a tool into the empty spindle",
        "prepare": "the steps that bring its pocket to where it is taken; they run from T on, beside the cut",
    },
    "changer.put_away": _STEP,
    "changer.take": _STEP,
    "changer.prepare": {key: _STEP[key] for key in _BESIDE},
    "probe": {
        "input": "of `[io]`, on = touched",
        "tool": "its number in the tool table, which has its ball and length",
        "overtravel_mm": "so far it gives behind a touch; a feed at which its stop is longer is refused",
        "latency_ms": "from the touch to the frame of the input",
        "latch_tpdo": "number of the TPDO with which the drives tell where they were (60BAh); 0: none",
        "release_mm": "behind a touch it is free again within so much",
    },
    "setter": {
        "input": "of `[io]`, on = touched",
        "point_mm": "the middle of its face, seen from the table with all rotaries at zero",
        "radius_mm": "of its face",
        "overtravel_mm": "as of a probe",
        "latency_ms": "as of a probe",
        "latch_tpdo": "as of a probe",
    },
    "table": {
        "centre_mm": "of the disc's upper face, with all rotaries at zero",
        "normal": "out of that face",
        "radius_mm": "of the disc, for the check of collisions",
        "thickness_mm": "of the disc",
    },
    "straightness": {
        "along": "the axis whose position counts",
        "moves": "the axis that is off by it",
        "at_{unit}": "positions of the first, rising",
        "off_mm": "there: where the other axis is, less where it was told to be",
    },
    "thermal": {
        "shift_mm": "where X Y Z are, less where they were told to be, since the machine has become warm",
        "reference_mm": "where the reference sphere was when the machine was calibrated",
    },
    "macro": {
        "name": "of its button on the page, at MDI",
        "lines": "of program, run one after another as typed by hand",
        "role": "the least that the button asks for; who operates may type the lines in any case",
    },
    "file": {
        "name": "of a file that `eds` or `profile` names, as it is named there",
        "text": "all of it; records and back-ups have so what was beside the machine file",
    },
    "tool": {
        "number": "T of programs; T1 is in the spindle at power-on",
        "name": "as the operator calls it",
        "radius_mm": "at the end; of a ball end that of the ball",
        "length_mm": "from the gauge line to the tip",
        "flute_mm": "length that cuts, from the tip; what is above cuts nothing",
        "corner_mm": "rounding between end and flank: 0 flat end, `radius_mm` ball end",
        "taper_deg": "half angle of the flank, thicker upwards",
        "holder": "cylinders above the tip, a neck or a thick shank first; below them it is as the flute",
        "placement": "on surfaces; empty: as the machine has it",
        "below_mm": "so far the flank reaches below the lower edge, beside what a corner takes",
        "tolerance_mm": "of the form of surfaces cut with it; left out: as the machine has it",
        "wear_radius_mm": "added to the radius; negative where the cutter has become thinner",
        "wear_length_mm": "added to the length; negative where it has become shorter",
        "may_turn": "whether the spindle may turn with it; the probe of `[probe]` breaks of it",
        "centre_cutting": "its end cuts up to the axis; false: a plunge along stock of a surface is refused",
    },
    "tool.holder": {
        "from_mm": "above the tip",
        "length_mm": "of the cylinder",
        "radius_mm": "of the cylinder",
    },
}


def asked_for(top: Table) -> dict[str, dict[str, Known]]:
    """By table, as in ``MEANINGS``: every key that a reading of a whole file has asked for."""
    found: dict[str, dict[str, Known]] = defaultdict(dict)
    for name, table in _all(top, ""):
        if name not in (*NAMES, *AS_ABOVE):
            for key, known in table.known.items():
                before = found[name].get(key)
                found[name][key] = known if before is None else _both(before, known)
    return dict(found)


def _both(one: Known, other: Known) -> Known:
    """Of a key that two tables of one kind have been asked for: slides and rotaries have other names."""
    may_be = dict.fromkeys(text for text in (*one.allowed.split("; "), other.allowed) if text)
    return Known("; ".join(may_be), one.default or other.default, one.needed and other.needed)


def _all(table: Table, name: str) -> Iterator[tuple[str, Table]]:
    for one in table.below:
        own = "*" if name in NAMES else one.key
        whole = f"{name}.{own}" if name else own
        yield whole, one
        yield from _all(one, whole)


def spelled(key: str) -> tuple[str, ...]:
    """A key as files write it: once, or in mm and in degrees."""
    return tuple(key.format(unit=unit) for unit in ("mm", "deg")) if "{" in key else (key,)


def markdown(top: Table) -> str:
    """``config/KEYS.md`` from the table of a file with every key, once read."""
    known = asked_for(top)
    return "\n".join([HEAD, *(_section(name, keys, known[name]) for name, keys in MEANINGS.items())])


HEAD = """# The keys of a machine file

Made from where they are read (`controller/machine/keys.py`); a test holds it. Lengths are in mm, angles in
degrees, times in seconds, as the ends of the names say; what is not known is refused with its line. How they
go together, and examples, are in [README.md](README.md).
"""


def _section(name: str, keys: Mapping[str, str], known: Mapping[str, Known]) -> str:
    rows = (f"| {_row(key, meaning, known)} |" for key, meaning in keys.items())
    return "\n".join(
        [f"## {_title(name)}", "", "| key | what | may be | left out |", "|---|---|---|---|", *rows, ""]
    )


def _title(name: str) -> str:
    if name in ARRAYS:
        return f"`[[{name}]]`"
    first, _, rest = name.partition(".")
    head = f"`[[{first}]]`" if first in ARRAYS else f"`[{first}]`"
    shown = rest.replace(".*", ": a name, and in it").replace("*", "a name, and in it")
    return f"{head}: {shown}" if rest else head


def _row(key: str, meaning: str, known: Mapping[str, Known]) -> str:
    names = spelled(key)
    one = next(known[name] for name in names if name in known)
    may_be, left_out = ELSEWHERE.get(key, ("", ""))
    columns = (
        ", ".join(f"`{name}`" for name in names),
        meaning,
        may_be or one.allowed,
        left_out or _left_out(one),
    )
    return " | ".join(columns)


def _left_out(known: Known) -> str:
    """What a key is where the file is silent."""
    default = known.default
    if default is None:
        return "needed" if known.needed else "–"
    if isinstance(default, bool):
        return "`true`" if default else "`false`"
    if isinstance(default, float):
        return f"`{default:g}`"
    return f"`{default}`" if default not in ("", (), [], {}) else "–"
