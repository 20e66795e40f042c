"""What a machine file says and hardly any machine has: it is asked about, and refuses nothing.

The sizes that real machines have stand with a key (``usual``). What only several keys show is a plain check
here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib.metadata import entry_points

from controller.geometry.vectors import angle_between
from controller.machine.axes import Axis, Homing, Kind
from controller.machine.declaration import Key, keys_of
from controller.machine.machine_file import LINEAR, RULES, MachineFile
from controller.machine.model import Bus, Machine
from controller.machine.named_files import NamedFiles
from controller.machine.reading import Check, File, Reading
from controller.machine.spindle import MODES, Spindle
from controller.machine.toml_table import ConfigError, parse, span
from controller.messages import Message

TRAVEL = {"mm": (10.0, 10_000.0), "deg": (2.0, 100_000.0)}  # from end to end
MAX_TO_SPEED_S = 5.0  # that an axis takes to its largest velocity,
MAX_TO_ACCELERATION_S = 2.0  # and to its largest acceleration
MAX_SEARCH_S = 600.0  # for the switch, along all of the travel, or one turn
TURN = math.tau
MAX_LEAN_DEG = 1.0  # of a slide from its axis: what is beyond it was built so
MIN_WINDOW_COUNTS = 2.0  # of the following error: what is below stops the drive at once
POSITIVE_LIMITS = (2, 18)  # methods of CiA 402 that look for the limit switch in the positive sense,
LIMIT_SWITCHES = (1, 17, *POSITIVE_LIMITS)  # and those in either
# Those of python-can 4 (can.interfaces.BACKENDS) and our own; a package of somebody else's may bring more.
INTERFACES = {
    *("canalystii", "cantact", "etas", "gs_usb", "iscan", "ixxat", "kvaser", "neousys", "neovi", "nican"),
    *("nixnet", "pcan", "robotell", "seeedstudio", "serial", "shared", "slcan", "socketcan", "socketcand"),
    *("systec", "udp_multicast", "usb2can", "vector", "virtual"),
}


def doubts(machine: Machine) -> list[Message]:
    """What is asked about the file of a machine, in the order of its lines; nothing of one without a file."""
    try:
        top = parse(machine.text, machine.name)
    except ConfigError:
        return []
    file = File(RULES, NamedFiles(top, None))
    Reading(file, MachineFile, top).value()
    if file.mistakes:  # a machine that was never a file
        return []
    for table in file.tables:
        for name, key in keys_of(table.of).items():
            with file.collecting():
                _check_usual(table, name, key)
    file.check(CHECKS)
    found = ConfigError.of_all(file.mistakes).mistakes if file.mistakes else ()
    return [
        _without_line(one, machine.name) if one.place[0].startswith("tool#") else one.said for one in found
    ]


def _without_line(doubt: ConfigError, file: str) -> Message:
    """The tools may stand in a file of their own."""
    return {**doubt.said, "values": {**doubt.said["values"], "where": file}}


def _check_usual(table: Reading, name: str, key: Key) -> None:
    """The sizes of what the file says are those of real machines."""
    written = key.name.format(unit=table.unit) if "{" in key.name else key.name
    if key.usual is None or name not in table.shown or not table.table.holds(written):
        return
    usual, value = key.usual_in(table.unit), table.shown[name]
    sizes = value if isinstance(value, tuple) else (value,)
    if usual is not None and not all(usual[0] <= abs(one) <= usual[1] for one in sizes):
        table.table.refuse(written, "unusual", usual=span(*usual))


# ---- what several keys show


def _check_travel(axis: Reading) -> None:
    lower, upper = axis["travel"]
    least, most = TRAVEL[axis.unit]
    if not least <= upper - lower <= most:
        axis.table.refuse(
            f"travel_{axis.unit}", "unusual_travel", length=upper - lower, usual=span(least, most)
        )


def _check_lean(axis: Reading) -> None:
    """A slide is square to a fraction of a degree, or it is built otherwise."""
    if axis["kind"] is Kind.LINEAR:
        frame = LINEAR[axis["name"]]
        off_deg = math.degrees(angle_between(axis["direction"], frame))
        if off_deg > MAX_LEAN_DEG:
            axis.table.refuse("direction", "leaning", off_deg=off_deg, frame=str([int(x) for x in frame]))


def _check_ramps(axis: Reading) -> None:
    """The largest velocity and acceleration are reached within seconds."""
    limits, unit = axis["limits"], axis.unit
    if (seconds := limits.velocity / limits.acceleration) > MAX_TO_SPEED_S:
        axis.table.refuse(f"acceleration_{unit}_s2", "slow_ramp", what=f"velocity_{unit}_s", seconds=seconds)
    if (seconds := limits.acceleration / limits.jerk) > MAX_TO_ACCELERATION_S:
        axis.table.refuse(f"jerk_{unit}_s3", "slow_ramp", what=f"acceleration_{unit}_s2", seconds=seconds)


def _check_window(axis: Reading) -> None:
    counts = axis["following_error"] * abs(axis["counts_per_unit"])
    if counts < MIN_WINDOW_COUNTS:
        axis.table.refuse(f"following_error_{axis.unit}", "narrow_window", counts=counts)


def _check_brake(axis: Reading) -> None:
    """Z comes down by its weight where nothing holds it."""
    if axis["name"] == "Z" and not axis["brake"]:
        axis.table.refuse("brake", "no_brake")


def _check_homing(homing: Reading) -> None:
    axis, unit = homing.above, homing.unit
    if axis is None:
        return
    fast, slow, limits = homing["fast"], homing["slow"], axis["limits"]
    if fast > limits.velocity:
        homing.table.refuse(f"fast_{unit}_s", "homing_above_velocity", what=f"velocity_{unit}_s")
    if fast and slow > fast:
        homing.table.refuse(f"slow_{unit}_s", "homing_slow_is_fast", what=f"fast_{unit}_s")
    way = axis["travel_max"] - axis["travel_min"]
    if axis["kind"] is not Kind.LINEAR:
        way = min(way, TURN)
    if fast and (seconds := way / fast) > MAX_SEARCH_S:
        homing.table.refuse(f"fast_{unit}_s", "homing_takes_long", minutes=seconds / 60.0)


def _check_limit_switch(homing: Reading) -> None:
    """A slide that is homed by a limit switch is at that end of its travel then."""
    axis = homing.above
    if axis is None or axis["kind"] is not Kind.LINEAR or homing["method"] not in LIMIT_SWITCHES:
        return
    is_upper = (homing["method"] in POSITIVE_LIMITS) == (axis["counts_per_unit"] > 0.0)
    lower, upper = axis["travel"]
    off = homing.as_written("position") - 0.5 * (lower + upper)
    if (off < 0.0) if is_upper else (off > 0.0):
        end = upper if is_upper else lower
        homing.table.refuse(f"position_{homing.unit}", "homing_other_end", method=homing["method"], end=end)


def _check_interface(bus: Reading) -> None:
    """One of python-can's, or of a package that brings it one."""
    brought = {one.name for one in entry_points(group="can.interface")}
    if bus["interface"] not in (known := INTERFACES | brought):
        bus.table.refuse("interface", "no_interface", known=", ".join(sorted(known)))


def _check_run_up(spindle: Reading) -> None:
    """It comes to its largest speed within the time that it has for that."""
    if spindle["by"] != "drive" or spindle["mode"] != MODES["csv"]:
        return
    seconds = spindle["max_rev_min"] / 60.0 / spindle["acceleration_rev_s2"]
    if seconds > spindle["spin_up_s"]:
        spindle.table.refuse("spin_up_s", "short_run_up", seconds=seconds)


CHECKS: Mapping[type, Sequence[Check]] = {
    Axis: (_check_travel, _check_lean, _check_ramps, _check_window, _check_brake),
    Bus: (_check_interface,),
    Homing: (_check_homing, _check_limit_switch),
    Spindle: (_check_run_up,),
}
