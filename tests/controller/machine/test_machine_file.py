"""Machine files: what they give, what they refuse, and that the shipped ones hold the paper's parts."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.shipped_kinds import TILTING
from support.machines.spindle_machine import without_spindle

from controller.geometry.curves import Bezier
from controller.geometry.surfaces import Cone, RuledSurface, Surface
from controller.geometry.vectors import Pose, Vector, add, norm, subtract
from controller.machine import machine_file, nodes
from controller.machine.kinematics import kinematics_of
from controller.machine.machine_file import ConfigError
from controller.machine.model import KEPT_OFFSETS, Kind, Machine, Sense
from drives.text_file import TextFile

TEXT = (machine_file.SHIPPED / "trunnion.toml").read_text()
TOOLS = (machine_file.SHIPPED / "tools.toml").read_text()
COMPLETE = f"{TEXT}\n{TOOLS}"


def changed(*pairs: tuple[str, str]) -> str:
    """The trunnion's file with the first occurrence of each text replaced."""
    text = COMPLETE
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


# ---- what the shipped trunnion says (issue item 1) --------------------------------


def test_the_trunnion_is_the_papers_fig_4a() -> None:
    machine = machine_file.load("trunnion")
    assert [axis.name for axis in machine.axes] == ["X", "Y", "Z", "A", "C"]
    assert machine.period_s == 0.002
    assert machine.offsets[0].origin == (8.0, 96.0, 120.0)
    tilt, turn = (machine.axes[i] for i in machine.rotary())
    assert (tilt.direction, tilt.point_mm) == ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert (turn.direction, turn.point_mm) == ((0.0, 0.0, 1.0), (0.0, 96.0, 120.0))
    assert machine.spindle is not None and machine.spindle.by == "hand"  # the verbatim programs have no M3


@pytest.mark.parametrize(
    ("axis", "limits"),
    [(0, (200.0, 2000.0, 50000.0)), (3, (180.0, 1500.0, 30000.0)), (4, (360.0, 3000.0, 60000.0))],
)
def test_limits_are_the_issues_in_mm_or_degrees(axis: int, limits: tuple[float, float, float]) -> None:
    found = machine_file.load("trunnion").axes[axis]
    unit = found.shown_per_unit
    values = (found.limits.velocity, found.limits.acceleration, found.limits.jerk)
    assert [v * unit for v in values] == pytest.approx(limits)


def test_tool_1_is_the_papers_cutter() -> None:
    tool = machine_file.load("trunnion").tool(1)
    assert tool is not None
    assert (tool.radius_mm, tool.length_mm, tool.flute_mm) == (3.0, 0.0, 15.0)


@pytest.mark.parametrize("name", machine_file.shipped())
def test_every_shipped_machine_loads_and_has_its_kinematics(name: str) -> None:
    machine = machine_file.load(name)
    assert machine.name == name
    kinematics_of(machine)


def test_eight_kinds_of_machine_are_shipped() -> None:
    expected = {"trunnion", "fig4b", "fig4c", "fig4d", "table_head", "head_head", "oblique45", "three_axes"}
    # The trunnion at other limits, on more buses, with a tool changer, and as it stands in a shop.
    same_again = {"xyzac_linuxcnc", "trunnion_two_buses", "trunnion_five_buses", "machining_centre", "shop"}
    assert set(machine_file.shipped()) == expected | same_again


def test_a_file_and_its_name_give_the_same_machine() -> None:
    assert machine_file.load(machine_file.SHIPPED / "trunnion.toml") == machine_file.load("trunnion")
    assert machine_file.load("trunnion.toml") == machine_file.load("trunnion")


def test_the_text_of_a_machine_needs_no_other_file() -> None:
    machine = machine_file.load("trunnion")
    assert machine_file.read(machine.text, "trunnion.toml") == machine


def test_a_copied_machine_file_finds_the_shipped_tool_table(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(TEXT)
    assert machine_file.load(tmp_path / "mine.toml").tools == machine_file.load("trunnion").tools


def test_a_tool_table_beside_the_machine_file_wins(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(TEXT)
    (tmp_path / "tools.toml").write_text(TOOLS.replace("3.000", "2.5"))
    tool = machine_file.load(tmp_path / "mine.toml").tool(1)
    assert tool is not None and tool.radius_mm == 2.5


# ---- units and senses --------------------------------------------------------------


def test_iso_sense_flips_travel_homing_and_counts_but_not_limits() -> None:
    pairs = (('sense = "carried"', 'sense = "iso"'), ("[-120.0, 120.0]", "[-30.0, 110.0]"))
    axis = machine_file.read(changed(*pairs), "m.toml").axes[3]
    assert axis.sense is Sense.ISO
    assert (math.degrees(axis.travel_min), math.degrees(axis.travel_max)) == pytest.approx((-110.0, 30.0))
    assert axis.limits.velocity == pytest.approx(math.radians(180.0))
    # Shown +10 degrees are carried -10 degrees; the drive's counts go with what is shown.
    shown_10 = 10.0 / axis.shown_per_unit
    assert shown_10 * axis.counts_per_unit == pytest.approx(2_000_000)


def test_a_direction_may_have_any_length() -> None:
    assert norm(machine_file.load("oblique45").axes[3].direction) == pytest.approx(1.0, abs=1e-15)


def test_a_work_offset_may_turn_the_part() -> None:
    text = changed(("G54 = [8.0, 96.0, 120.0]", "G55 = { origin_mm = [1, 2, 3], turned_deg = [0, 0, 37] }"))
    frame = machine_file.read(text, "m.toml").offsets[1]
    angle = math.radians(37.0)
    assert frame.origin == (1.0, 2.0, 3.0)
    assert frame.x == pytest.approx((math.cos(angle), math.sin(angle), 0.0))
    assert frame.z == pytest.approx((0.0, 0.0, 1.0))


def test_a_spindle_is_read_where_there_is_one() -> None:
    spindle = machine_file.read(COMPLETE, "m.toml").spindle
    assert spindle is not None and (spindle.max_rev_min, spindle.by) == (24000.0, "hand")
    assert machine_file.read(without_spindle(COMPLETE), "m.toml").spindle is None


def test_limits_of_the_tool_itself_are_read_where_there_are_any() -> None:
    machine = machine_file.load("trunnion")
    assert machine.tip_acceleration_mm_s2 is None and machine.axis_speed_rad_s is None
    text = COMPLETE.replace("gouge =", "tip_acceleration_mm_s2 = 500\naxis_speed_deg_s = 90.0\ngouge =")
    limited = machine_file.read(text, "m.toml")
    assert limited.tip_acceleration_mm_s2 == 500.0
    assert limited.axis_speed_rad_s == pytest.approx(math.pi / 2)


def test_what_surfaces_may_differ_by_at_a_joint_is_read_and_has_a_default() -> None:
    machine = machine_file.load("trunnion")
    assert (machine.joint_tolerance_mm, machine.joint_tolerance_deg) == (0.005, 0.2)
    text = COMPLETE.replace("gouge =", "joint_tolerance_mm = 0\njoint_tolerance_deg = 0.5\ngouge =")
    told = machine_file.read(text, "m.toml")
    assert (told.joint_tolerance_mm, told.joint_tolerance_deg) == (0.0, 0.5)


def test_what_the_ends_of_an_arc_may_differ_by_is_read_and_has_a_default() -> None:
    assert machine_file.load("trunnion").arc_tolerance_mm == 0.05
    text = COMPLETE.replace("gouge =", "arc_tolerance_mm = 2.8\ngouge =")
    assert machine_file.read(text, "m.toml").arc_tolerance_mm == 2.8


def test_dialect_offsets_and_reference_points_are_read_and_have_defaults() -> None:
    made = machine_file.read(COMPLETE, "m.toml")
    assert (made.dialect, made.without_point, made.axes[2].reference) == ("rs274", "", None)
    assert len(made.offsets) == len(KEPT_OFFSETS) == 65 and made.unset == KEPT_OFFSETS[1:]
    text = COMPLETE.replace("gouge =", 'dialect = "fanuc"\nwithout_point = "unit"\ngouge =')
    text = text.replace("[offsets]", '[offsets]\n"G59.1" = [1, 2, 3]\n"G54.1 P48" = [4, 5, 6]', 1)
    text = text.replace('name = "A"', 'name = "A"\nsecond_reference_deg = 30', 1)
    made = machine_file.read(text, "m.toml")
    assert (made.dialect, made.without_point) == ("fanuc", "unit")
    assert made.offsets[6].origin == (1.0, 2.0, 3.0) and made.offsets[56].origin == (4.0, 5.0, 6.0)
    assert "G59.1" not in made.unset and "G54.1 P47" in made.unset
    assert made.axes[3].second_reference == pytest.approx(math.radians(30.0))
    for wrong in ('dialect = "siemens"', 'without_point = "inch"'):
        with pytest.raises(ConfigError, match="allowed"):
            machine_file.read(COMPLETE.replace("gouge =", f"{wrong}\ngouge ="), "m.toml")


def test_another_period_is_taken_in_range_only() -> None:
    machine = machine_file.load("trunnion")
    assert machine_file.with_period(machine, 0.01).period_s == 0.01
    with pytest.raises(ConfigError, match=r"period_s = 0\.1: .* allowed: a number from 0\.0005 to 0\.01"):
        machine_file.with_period(machine, 0.1)


def test_a_file_from_before_the_pump_that_says_who_sends_sync_is_the_same_machine() -> None:
    before = machine_file.read(changed(("gouge =", 'sync = "tick"\ngouge =')), "m.toml")
    assert replace(before, text=COMPLETE) == machine_file.read(COMPLETE, "m.toml")


# ---- the drives' side --------------------------------------------------------------


def test_drives_get_counts_in_rising_order_also_with_a_turned_sign(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nodes, "eds_of", lambda profile, named="": "drive.eds")
    text = changed(("counts_per_mm = 200_000", "counts_per_mm = -1000"), ("-300.0, 300.0", "-100.0, 300.0"))
    x, _, z, *_ = machine_file.node_settings(machine_file.read(text, "m.toml"))
    assert (x.counts_min, x.counts_max) == (-300_000, 100_000)
    assert x.following_error_counts == 4000
    assert (z.homing_method, z.homing_position_counts, z.brake) == (37, 260 * 200_000, True)
    assert [x.node, z.node, x.bus, x.eds] == [1, 3, "can0", "drive.eds"]


def test_buses_and_master_are_handed_over() -> None:
    machine = machine_file.with_period(machine_file.load("trunnion"), 0.004)
    assert machine_file.bus_settings(machine)[0].bit_rate == 1_000_000
    assert machine_file.master_settings(machine).period_s == 0.004


def test_the_shipped_profile_names_a_data_sheet_that_is_there() -> None:
    assert Path(machine_file.eds_of("simulated")).is_file()


def test_an_unknown_profile_names_the_known_ones() -> None:
    with pytest.raises(
        ConfigError, match="profile epos9: there is no drive profile of this name; allowed: elmo"
    ):
        machine_file.eds_of("epos9")


# ---- refusals ----------------------------------------------------------------------

REFUSED = [
    # what is changed, what the sentence must contain
    ("gouge =", "gauge =", "[machine]: gauge = \"refuse\": this key is not known; .*did you mean 'gouge'"),
    ("[offsets]", "[ofsets]", "top level: ofsets = .* not known; .* did you mean 'offsets'"),
    ("travel_mm =", "travel =", "[[axis]] X: travel_mm: is missing; allowed: 2 numbers .*'travel'"),
    (
        "travel_mm = [-300.0, 300.0]",
        "travel_mm = [300.0, -300.0]",
        "X: travel_mm = [300.0, -300.0]: the lower",
    ),
    ("travel_mm = [-300.0, 300.0]", "travel_mm = [300.0]", "travel_mm = [300.0]: is not a list of 2"),
    ("travel_mm = [-300.0, 300.0]", "travel_mm = [-inf, inf]", "X: travel_mm = [-inf, inf]: is not"),
    ("period_s = 0.002", "period_s = 2", "[machine]: period_s = 2: is out of range; .* 0.0005 to 0.01"),
    ("period_s = 0.002", 'period_s = "2 ms"', 'period_s = "2 ms": is not a finite number'),
    ("period_s = 0.002", "period_s = nan", "period_s = nan: is not a finite number"),
    ("gouge =", "arc_tolerance_mm = 0\ngouge =", "arc_tolerance_mm = 0: .* from 0.001 to 3; change"),
    ("gouge =", "joint_tolerance_mm = -1\ngouge =", "joint_tolerance_mm = -1: .* from 0 to 1; change"),
    ("gouge =", "joint_tolerance_deg = 90\ngouge =", "joint_tolerance_deg = 90: .* from 0 to 5; change"),
    (
        "gouge =",
        "tip_acceleration_mm_s2 = 0\ngouge =",
        "[machine]: tip_acceleration_mm_s2 = 0: is not above zero",
    ),
    (
        "gouge =",
        'axis_speed_deg_s = "fast"\ngouge =',
        'axis_speed_deg_s = "fast": is not a finite number',
    ),
    ("gouge =", 'late = "ignore"\ngouge =', 'late = "ignore": .* allowed: "stop" or "count"'),
    ("gouge =", 'sync = "tik"\ngouge =', 'sync = "tik": .* allowed: "tick"; leave the key out'),
    (
        "gouge =",
        'sync = "kernel"\ngouge =',
        '[machine]: sync = "kernel": is not to be chosen any more, .*; leave the key out',
    ),
    ('kind = "linear"', 'kind = "liner"', "[[axis]] X: kind = \"liner\": .*'linear'"),
    ("direction = [1, 0, 0]", "direction = [-1, 0, 0]", "X: direction = [-1, .*: 30 degrees at most"),
    ("direction = [1, 0, 0]", "direction = [0, 0, 0]", "X: direction = [0, 0, 0]: has no length"),
    ("velocity_mm_s = 200.0", "velocity_mm_s = 0", "X: velocity_mm_s = 0: is not above zero"),
    ("velocity_mm_s = 200.0", "velocity_mm_s = true", "X: velocity_mm_s = true: is not a finite number"),
    ("[-9000.0, 9000.0]", "[-20000.0, 20000.0]", "C: travel_deg = .*does not fit a drive's 32-bit .* 10737"),
    ("counts_per_mm = 200_000", "counts_per_mm = 0", "X: counts_per_mm = 0: is zero"),
    ("node = 2", "node = 1", "node = 1: X and Y share it on bus can0"),
    ("node = 2", "node = 127", "Y: node = 127: is out of range .* from 1 to 126"),
    ('bus = "can0"', 'bus = "can1"', '[[axis]] X: bus = "can1": is not known; allowed: "can0"'),
    ("bit_rate = 1_000_000", "bit_rate = 999_999", "[[bus]] can0: bit_rate = 999999: .*500000"),
    ('"virtual"', '"socketcan"', "[[bus]] can0: channel.*is missing.*can0"),
    ("retract_mm = 260.0", "retract_mm = 600.0", "retract_mm = 600.0: is outside of Z's travel"),
    ('name = "Y"', 'name = "X"', 'X: name = "X": an axis above has this name'),
    ("method = 37", "methd = 37", "X homing: methd = 37: this key is not known; .*'method'"),
    ("[8.0, 96.0, 120.0]", "[8.0, 96.0]", "[offsets]: G54 = [8.0, 96.0]: is not a list of 3"),
    ("number = 1", "number = 7", "tool 1 is missing"),
    ("number = 2", "number = 1", "[[tool]] 1: number = 1: is used twice|end mill 3 mm.*is used twice"),
    ("radius_mm = 3.000", "radius_mm = -3", "radius_mm = -3: is not above zero"),
    ("brake = true", 'brake = "yes"', 'Z: brake = "yes": is not true or false'),
    ("gouge =", "gouge", 'm.toml:15:7: gouge "refuse" .*: is not TOML: there is no = after .*; add it'),
]


@pytest.mark.parametrize(("old", "new", "sentence"), REFUSED)
def test_a_wrong_machine_file_is_refused_with_place_value_and_remedy(
    old: str, new: str, sentence: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        machine_file.read(changed((old, new)), "m.toml")
    found = str(caught.value)
    assert re.match(r"m\.toml(:\d+){0,2}: ", found)
    _assert_matches(sentence, found)


def _assert_matches(sentence: str, found: str) -> None:
    """``.*`` skips, ``|`` chooses; all else is meant literally."""
    for choice in sentence.split("|"):
        rest, sound = found, True
        for piece in (p.strip() for p in choice.split(".*")):
            sound = sound and piece in rest
            rest = rest.partition(piece)[2]
        if sound:
            return
    pytest.fail(f"{found!r} does not say {sentence!r}")


def test_rotaries_that_cannot_tilt_are_refused() -> None:
    rows = ("direction = [1, 0, 0]\npoint_mm", "direction = [0, 0, 1]\npoint_mm")
    with pytest.raises(ConfigError, match=r"A: direction = .* cannot tilt it; .* from base to work"):
        machine_file.read(changed(rows), "m.toml")


def test_parallel_rotaries_are_refused() -> None:
    text = COMPLETE.replace("[0, 0, 1]\npoint_mm", "[1, 0, 0]\npoint_mm")
    with pytest.raises(ConfigError, match="the two rotaries are parallel"):
        machine_file.read(text, "m.toml")


def test_tools_in_two_places_are_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(COMPLETE)
    with pytest.raises(ConfigError, match="tools stand in two places"):
        machine_file.load(tmp_path / "mine.toml")


def test_a_mistake_in_the_tool_table_is_refused_under_its_own_name(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(TEXT)
    (tmp_path / "tools.toml").write_text(TOOLS.replace("flute_mm", "flut_mm"))
    with pytest.raises(
        ConfigError, match=r"^tools\.toml:\d+: \[\[tool\]\] .*: flute_mm: is missing.*'flut_mm'"
    ):
        machine_file.load(tmp_path / "mine.toml")


def test_bytes_that_are_not_utf8_are_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_bytes(b'[machine]\nname = "\xff"\n')
    with pytest.raises(ConfigError, match=r"mine\.toml: byte 18 is not UTF-8"):
        machine_file.load(tmp_path / "mine.toml")


def test_an_unknown_name_suggests_the_nearest_machine() -> None:
    with pytest.raises(ConfigError, match=r"trunion: no such machine file; .* did you mean 'trunnion'"):
        machine_file.load("trunion")


def test_an_unknown_program_names_the_shipped_ones() -> None:
    assert machine_file.shipped_program("example1").is_file()
    with pytest.raises(ConfigError, match=r"example1, example1_ready, example2, example2_ready"):
        machine_file.shipped_program("example3")


# ---- travel ------------------------------------------------------------------------

MARGIN_MM = 15.0  # leads, clearance and run-on around the surface


def _ruled(upper: list[Vector], lower: list[Vector]) -> Surface:
    return RuledSurface(upper=Bezier(tuple(upper)), lower=Bezier(tuple(lower)))


def _parts() -> Iterator[tuple[str, Surface]]:
    yield "example 1", Cone((0.0, 15.0, 0.0), (0.0, 0.0, 0.0), 10.0, 10.0, 2.0 * math.pi)
    upper = [(38.0, 22.0, 10.0), (21.5, -5.5, 10.0), (5.0, 5.0, 10.0), (10.5, 11.0, 10.0)]
    lower = [(38.0, 22.0, 0.0), (21.5, -11.0, 0.0), (-1.58, 3.3, 0.0), (3.6, 11.0, 0.0)]
    yield "example 2, first surface", _ruled(upper, lower)
    upper = [(10.5, 11.0, 10.0), (16.0, 16.5, 10.0), (35.8, 18.42, 10.0), (38.0, 22.0, 10.0)]
    lower = [(3.6, 11.0, 0.0), (8.78, 18.7, 0.0), (28.1, 18.7, 0.0), (38.0, 22.0, 0.0)]
    yield "example 2, second surface", _ruled(upper, lower)


def _reached(machine: Machine, pair: tuple[float, float]) -> bool:
    axes = [machine.axes[i] for i in machine.rotary()]
    return all(a.travel_min <= q <= a.travel_max for q, a in zip(pair, axes, strict=True))


def _sweep(machine: Machine, surface: Surface, offset: float) -> Iterator[tuple[float, ...]]:
    """Joints along a surface, from every branch at its beginning that the rotaries reach."""
    kinematics = kinematics_of(machine)
    part, length = machine.offsets[0], max(tool.length_mm for tool in machine.tools)
    poses = [surface.pose(0.001 + 0.998 * k / 200, offset) for k in range(201)]
    poses = [Pose(part.to_parent(tip), part.turn(axis)) for tip, axis in poses]
    starts = [pair for pair in kinematics.branches(poses[0].axis) if _reached(machine, pair)]
    assert starts
    for start in starts:
        near = start
        for pose in poses:
            joints = kinematics.inverse(pose, near, length)
            assert joints is not None
            near = (joints[machine.rotary()[0]], joints[machine.rotary()[1]])
            yield joints


@pytest.mark.parametrize("name", TILTING)
def test_both_examples_fit_into_the_travel_on_either_branch(name: str) -> None:
    machine = machine_file.load(name)
    for part, surface in _parts():
        for joints in (j for r in (-3.0, 3.0) for j in _sweep(machine, surface, r)):
            for q, axis in zip(joints, machine.axes, strict=True):
                margin = 0.0 if axis.is_rotary else MARGIN_MM
                assert axis.travel_min + margin <= q <= axis.travel_max - margin, (part, axis.name, q)
            assert joints[2] < machine.retract_mm - MARGIN_MM, (part, "retract height", joints[2])


@pytest.mark.parametrize("name", [n for n in TILTING if "head" not in n])
def test_no_tilt_lifts_the_part_to_the_retract_height(name: str) -> None:
    """Rotaries turn at the retract height with any tool; corners of the part stay below its tip."""
    machine = machine_file.load(name)
    kinematics, part = kinematics_of(machine), machine.offsets[0]
    length = max(tool.length_mm for tool in machine.tools)
    corners = [part.to_parent((x, y, z)) for x in (-20, 40) for y in (-20, 25) for z in (0, 10)]
    for tilt in range(-60, 61, 15):
        for turn in range(0, 360, 30):
            pair = (math.radians(tilt), math.radians(turn))
            highest = max(kinematics.linear(c, pair, length)[2] for c in corners)
            assert highest < machine.retract_mm, (tilt, turn, highest)


def test_a_head_stays_above_what_it_cuts() -> None:
    """A head's Z is where its gauge point is; the tip hangs below the pivot by pivot height and tool."""
    machine = machine_file.load("table_head")
    head = next(axis for axis in machine.axes if axis.kind is Kind.HEAD)
    tip = kinematics_of(machine).forward((0.0, 0.0, 0.0, math.radians(30.0), 0.0), 50.0).tip
    pivot = add((0.0, 0.0, 0.0), head.point_mm)
    assert norm(subtract(tip, pivot)) == pytest.approx(200.0)


# ---- drives of makers --------------------------------------------------------------


def machine_with(folder: Path, axis_keys: str) -> machine_file.Machine:
    text = changed(('node = 1\nprofile = "simulated"', f"node = 1\n{axis_keys}"))
    return machine_file.read(text, "m.toml", folder)


def test_a_machine_file_names_the_data_sheet_that_a_profile_does_not_bring(tmp_path: Path) -> None:
    (tmp_path / "epos.eds").write_text("x")
    keys = 'profile = "maxon_epos4"\neds = "epos.eds"\nserial = 4711'
    x, *others = machine_file.node_settings(machine_with(tmp_path, keys))
    assert (x.eds, x.serial, x.profile.name) == (TextFile("epos.eds", "x"), 4711, "maxon_epos4")
    assert {node.profile.name for node in others} == {"simulated"}


def test_a_profile_without_a_data_sheet_needs_one_from_the_machine_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"maxon_epos4: brings no data sheet.*add eds = \"path\""):
        machine_file.node_settings(machine_with(tmp_path, 'profile = "maxon_epos4"'))


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ('profile = "epos4"', r'm\.toml:\d+: \[\[axis\]\] X: profile = "epos4": is not known; .*maxon_epos4'),
        ('profile = "simulated"\neds = "gone.eds"', r'X: eds = "gone\.eds": there is no such file'),
        ('profile = "mine.toml"', r'X: profile = "mine\.toml": there is no such file'),
        ('profile = "simulated"\nserial = -1', r"X: serial = -1: is out of range"),
    ],
)
def test_a_wrong_profile_or_data_sheet_is_refused_at_its_axis(
    tmp_path: Path, keys: str, sentence: str
) -> None:
    with pytest.raises(ConfigError, match=sentence):
        machine_with(tmp_path, keys)


def test_the_shape_of_a_tool_and_the_table_under_the_work_are_read(tmp_path: Path) -> None:
    (tmp_path / "tools.toml").write_text(
        '[[tool]]\nnumber = 1\nname = "ball"\nradius_mm = 2.0\nlength_mm = 80.0\nflute_mm = 20.0\n'
        "corner_mm = 2.0\ntaper_deg = 5.0\n"
        "holder = [{ from_mm = 30.0, length_mm = 25.0, radius_mm = 16.0 },"
        " { length_mm = 40, radius_mm = 25 }]\n"
    )
    table = "[table]\ncentre_mm = [0, 96, 120]\nradius_mm = 150.0\n"
    file = tmp_path / "mine.toml"
    text = (machine_file.SHIPPED / "trunnion.toml").read_text()
    file.write_text(text.replace("[tools]", f"max_overcut_mm = 0.2\n\n{table}\n[tools]"))
    machine = machine_file.load(str(file))
    tool = machine.tools[0]
    assert (tool.corner_mm, math.degrees(tool.taper_rad)) == (2.0, pytest.approx(5.0))
    assert tool.holder == ((30.0, 55.0, 16.0), (55.0, 95.0, 25.0))
    assert machine.table is not None and machine.max_overcut_mm == 0.2
    assert machine.table.normal == (0.0, 0.0, 1.0) and machine.table.thickness_mm == 20.0


TOOL = '[[tool]]\nnumber = 1\nname = "x"\nradius_mm = 2.0\nlength_mm = 80.0\nflute_mm = 20.0\n'


def test_cutters_of_other_forms_are_read(tmp_path: Path) -> None:
    more = "taper_deg = 10\nbarrel_mm = 85", "end_mm = 6.0", "point_deg = 118", "corner_mm = 2\nback_mm = 2"
    rows = (TOOL.replace("1", str(k + 1)) + row for k, row in enumerate(more))
    (tmp_path / "tools.toml").write_text("\n".join(rows))
    (tmp_path / "mine.toml").write_text((machine_file.SHIPPED / "trunnion.toml").read_text())
    barrel, lens, drill, lollipop = machine_file.load(str(tmp_path / "mine.toml")).tools
    assert (barrel.barrel_mm, barrel.taper_rad) == (85.0, pytest.approx(math.radians(10.0)))
    assert (lens.end_mm, lollipop.back_mm, barrel.end_mm, lens.barrel_mm) == (6.0, 2.0, None, None)
    assert (drill.point_rad, lens.point_rad) == (pytest.approx(math.radians(118.0)), math.pi)


@pytest.mark.parametrize(
    ("row", "told"),
    [
        ("end_mm = 6.0\npoint_deg = 118.0", ":8: .*point_deg = 118.0: goes with another kind .* than end_mm"),
        ("taper_deg = 5.0\nback_mm = 1.0", ":7: .*taper_deg = 5.0: goes with another .* than back_mm"),
        ("end_mm = 1.9", ":7: .*end_mm = 1.9: .* a number from 2 on"),
        ("barrel_mm = 39.0", ":7: .*barrel_mm = 39.0: .* a number from 40 on"),
        ("back_mm = 2.5", ":7: .*back_mm = 2.5: .* from 0 to 2"),
    ],
)
def test_a_tool_that_no_one_grinds_is_refused_with_what_is_allowed(
    tmp_path: Path, row: str, told: str
) -> None:
    (tmp_path / "tools.toml").write_text(TOOL + row + "\n")
    (tmp_path / "mine.toml").write_text((machine_file.SHIPPED / "trunnion.toml").read_text())
    with pytest.raises(ConfigError, match=told):
        machine_file.load(str(tmp_path / "mine.toml"))


def test_a_corner_larger_than_the_cutter_is_refused(tmp_path: Path) -> None:
    (tmp_path / "tools.toml").write_text(
        '[[tool]]\nnumber = 1\nname = "x"\nradius_mm = 2.0\nlength_mm = 0\nflute_mm = 9\ncorner_mm = 2.5\n'
    )
    file = tmp_path / "mine.toml"
    file.write_text((machine_file.SHIPPED / "trunnion.toml").read_text())
    with pytest.raises(ConfigError, match=r"corner_mm = 2\.5: is out of range; allowed: a number"):
        machine_file.load(str(file))
