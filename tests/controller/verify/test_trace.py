"""A trace is computed back from joints, survives its file, and measures what it says."""

from __future__ import annotations

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from support.parts import random_nurbs

from controller.geometry.vectors import Frame
from controller.ipc.handoff import COLUMN, ROW, of_axes
from controller.machine import machine_file
from controller.machine.model import Sense
from controller.motion.motions import SurfaceCut
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath
from controller.program.program import CutNurbs
from controller.runtime import checked
from controller.runtime.plan_news import PathNotes
from controller.verify import trace as traces
from controller.verify.trace import Setup, Trace

# The file's fields as promised to whoever reads traces.
FIELDS = {
    "time_s", "joint_command", "joint_setpoint", "joint_actual", "tool_tip", "tool_axis", "contact",
    "u", "feed_mm_s", "line", "cutting", "axes", "period_s", "machine",
}  # fmt: skip


@pytest.fixture(scope="module")
def cut(ruled_run) -> Trace:
    return traces.from_rows(ruled_run.rows, ruled_run.machine, ruled_run.kinematics, ruled_run.segments)


def surface_cuts(run) -> list[tuple[int, SurfaceCut]]:
    return [(i, s.motion) for i, s in run.segments.items() if isinstance(s.motion, SurfaceCut)]


def test_row_0_is_the_tick_of_cycle_start(ruled_run, cut):
    assert len(cut.time_s) == len(ruled_run.rows) - 3  # three rows before the machine runs
    assert cut.time_s[:3] == pytest.approx([0.0, 0.002, 0.004])
    later = traces.from_rows(
        ruled_run.rows, ruled_run.machine, ruled_run.kinematics, ruled_run.segments, first_tick=750
    )
    assert len(later.time_s) == len(ruled_run.rows) - 50 and later.time_s[0] == 0.0


def test_rows_of_a_machine_that_never_ran_make_an_empty_trace(ruled_run):
    empty = traces.from_rows(ruled_run.rows[:2], ruled_run.machine, ruled_run.kinematics, ruled_run.segments)
    assert empty.time_s.shape == (0,) and empty.tool_tip.shape == (0, 3)


def test_contact_lies_on_c1_and_the_axis_on_the_ruling(ruled_run, cut):
    for motion_id, motion in surface_cuts(ruled_run):
        here = (ruled_run.rows[3:, COLUMN["motion_id"]] == motion_id) & cut.cutting
        u = cut.u[here]
        lower = np.stack(motion.surface.contact(u, np), axis=1)
        tip, axis = (np.stack(v, axis=1) for v in motion.surface.pose(u, motion.offset_mm, np))
        assert np.abs(cut.contact[here] - lower).max() < 1e-9
        assert np.abs(cut.tool_tip[here] - tip).max() < 1e-9
        assert np.abs(cut.tool_axis[here] - axis).max() < 1e-11


def test_u_of_a_surface_in_parts_is_that_of_the_whole_curve():
    """A G6.2 block is cut as several motions; its contact is the lower curve at the u of trace and page."""
    upper, lower = random_nurbs.blade(6)
    machine = replace(machine_file.load("trunnion"), gouge="warn")
    task = checked.task(random_nurbs.text(upper, lower, 600.0).encode(), "blade.ngc", machine)
    chains = (item for item in checked.path_of(task).items if isinstance(item, ContinuousPath))
    segments = dict(enumerate(segment for chain in chains for segment in chain.segments))
    (block,) = (one for one in task.read() if isinstance(one, CutNurbs))
    cuts = {k: one for k, one in segments.items() if one.cutting}
    rows = np.zeros((5 * len(cuts), len(ROW)))
    rows[:, COLUMN["cutting"]], rows[:, COLUMN["motion_id"]] = 1.0, np.repeat(list(cuts), 5)
    for i, (k, one) in enumerate(cuts.items()):
        here, s = slice(5 * i, 5 * i + 5), np.linspace(0.0, one.motion.end, 5)
        joints = joints_along(one, s, task.kinematics)
        rows[here, COLUMN["s"]], rows[here, of_axes("joint_command", 5)] = s, joints
        way = PathNotes(machine).way(one)
        assert [way.in_block(each)["u"] for each in s] == pytest.approx(
            one.block_u(one.motion.arc.u_along(s)), abs=1e-9
        ), k
    made = traces.from_rows(rows, machine, task.kinematics, segments, first_tick=0)
    assert len(cuts) > 2 and (np.diff(made.u) > -1e-9).all()
    assert made.u[[0, -1]] == pytest.approx([0.0, 1.0], abs=1e-9)
    on_curve = np.stack(np.broadcast_arrays(*block.lower.at(made.u, np)), axis=1)
    assert np.abs(made.contact - on_curve).max() < 1e-6


def test_contact_and_u_are_nan_exactly_when_not_cutting(cut):
    assert np.array_equal(np.isnan(cut.u), ~cut.cutting)
    assert np.array_equal(np.isnan(cut.contact).any(axis=1), ~cut.cutting)
    assert 0 < cut.cutting.sum() < len(cut.cutting)
    assert cut.u[cut.cutting].min() == 0.0 and cut.u[cut.cutting].max() == 1.0


def test_approach_and_standstill_are_seen_in_the_frame_of_the_cut_they_lead_to(cut):
    first = int(np.argmax(cut.cutting))
    assert cut.tool_tip[first - 1] == pytest.approx(cut.tool_tip[first], abs=1e-9)
    assert cut.tool_tip[0] - cut.tool_tip[first] == pytest.approx((0.0, 0.0, 20.0), abs=1e-9)
    assert cut.line[0] == 0 and cut.line[first] == 18


def test_a_setup_given_for_a_motion_wins_over_the_guess(ruled_run, cut):
    table = {0: Setup(Frame(), 40.0)}
    seen = traces.from_rows(
        ruled_run.rows, ruled_run.machine, ruled_run.kinematics, ruled_run.segments, table
    )
    assert seen.tool_tip[10] - cut.tool_tip[10] == pytest.approx(ruled_run.machine.offsets[0].origin)


def test_joints_are_shown_in_degrees_and_in_the_configured_sense(ruled_run, cut):
    axes = tuple(replace(axis, sense=Sense.ISO) for axis in ruled_run.machine.axes)
    iso = replace(ruled_run.machine, axes=axes)
    shown = traces.from_rows(ruled_run.rows, iso, ruled_run.kinematics, ruled_run.segments)
    assert np.array_equal(shown.joint_command[:, :3], cut.joint_command[:, :3])
    assert np.array_equal(shown.joint_command[:, 3:], -cut.joint_command[:, 3:])
    assert np.array_equal(shown.tool_tip, cut.tool_tip)
    assert cut.joint_command[cut.cutting][-1, 4] == pytest.approx(92.0826, abs=1e-4)


def test_setpoints_are_the_counts_that_were_sent(ruled_run, cut):
    counts = ruled_run.rows[3:, COLUMN["setpoint_0"] : COLUMN["setpoint_0"] + 5]
    assert cut.joint_setpoint.dtype == np.int32
    assert np.array_equal(cut.joint_setpoint, counts)


def test_a_file_has_exactly_the_promised_fields_and_comes_back_equal(cut, tmp_path):
    path = tmp_path / "cut.npz"
    cut.save(path)
    with np.load(path) as file:
        assert set(file.files) == FIELDS
        assert file["line"].dtype.kind == "i" and file["cutting"].dtype == bool
    back = traces.load(path)
    for field in fields(Trace):
        before, after = getattr(cut, field.name), getattr(back, field.name)
        assert np.array_equal(before, after, equal_nan=field.name in ("u", "contact")), field.name
    assert back.axes == ("X", "Y", "Z", "A", "C") and back.period_s == 0.002
    assert json.loads(back.machine)["axes"][4]["kind"] == "table"


def test_the_same_trace_gives_the_same_bytes(cut, tmp_path):
    cut.save(tmp_path / "a.npz")
    cut.save(tmp_path / "b")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_file_without_a_field_is_refused_with_its_name(tmp_path):
    np.savez(tmp_path / "half.npz", time_s=np.zeros(3))
    with pytest.raises(ValueError, match=r"is not a trace: it has no .*joint_command"):
        traces.load(tmp_path / "half.npz")


def test_being_late_on_the_path_is_no_path_error(ruled_run, cut):
    late = replace(cut, joint_actual=np.vstack([cut.joint_command[:1]] * 7 + [cut.joint_command[:-7]]))
    errors = traces.path_errors(late, ruled_run.machine, ruled_run.kinematics, 40.0)
    assert errors.path_mm.max() < 1e-9 and errors.axis_deg.max() < 1e-9
    assert np.abs(traces.following_error(late)).max() > 0.1


def test_a_shifted_axis_is_a_path_error_of_its_shift(ruled_run, cut):
    shift = np.array([0.0, 0.0, 0.005, 0.0, 0.0])
    off = replace(cut, joint_actual=cut.joint_command + shift)
    errors = traces.path_errors(off, ruled_run.machine, ruled_run.kinematics, 40.0)
    assert errors.path_mm.max() <= 0.005 + 1e-12
    assert errors.path_mm[cut.cutting].max() > 0.0045
    tilted = replace(cut, joint_actual=cut.joint_command + np.array([0.0, 0.0, 0.0, 0.01, 0.0]))
    errors = traces.path_errors(tilted, ruled_run.machine, ruled_run.kinematics, 40.0)
    assert errors.axis_deg[~cut.cutting] == pytest.approx(0.01, rel=1e-3)


def test_a_lag_equal_on_all_axes_costs_little_path_error(ruled_run, cut):
    figures = traces.summary(cut, ruled_run.machine, ruled_run.kinematics, 40.0)
    assert figures.cut_length_mm == pytest.approx(50.5115 + 36.7618, abs=1e-3)
    assert figures.cut_time_s == pytest.approx(cut.cutting.sum() * 0.002)
    assert set(figures.following_error) == {"X", "Y", "Z", "A", "C"}
    assert figures.path_error_mm < figures.following_error["Y"]
    json.dumps(figures.to_dict())


@pytest.mark.parametrize(("behind", "short"), [(0.3, 0.0), (0.0, 0.6), (0.25, 0.75)])
def test_a_cut_that_begins_and_ends_within_a_tick_is_as_long_as_it_is(cut, behind, short):
    u = np.concatenate(([np.nan], (np.arange(11) + behind) / (10.0 + behind + short), [np.nan]))
    contact = np.column_stack((30.0 * u, 0.0 * u, 0.0 * u))
    made = replace(cut, u=u, contact=contact)
    assert traces.cut_length_mm(made) == pytest.approx(30.0, abs=1e-12)


def test_a_cut_that_is_begun_within_is_only_as_long_as_what_was_cut(cut):
    u = np.array([np.nan, 0.5, 0.6, 0.7, np.nan])
    made = replace(cut, u=u, contact=np.column_stack((30.0 * u, 0.0 * u, 0.0 * u)))
    assert traces.cut_length_mm(made) == pytest.approx(6.0)


def test_speeds_are_shares_of_the_limits(ruled_run, cut):
    moved = np.zeros_like(cut.joint_command[:3])
    moved[1:, 4] = 0.72  # degrees in 2 ms are 360 deg/s
    even = replace(cut, joint_command=moved)
    assert traces.speeds(even, ruled_run.machine)[1] == pytest.approx([0.0, 0.0, 0.0, 0.0, 1.0])


def test_sync_intervals_count_what_is_further_off_than_a_quarter_period():
    period_s = 0.002
    intervals = np.full(1000, period_s)
    intervals[10], intervals[20], intervals[30] = 2.4e-3, 2.6e-3, 1.4e-3
    found = traces.sync_intervals(np.concatenate(([5.0], 5.0 + np.cumsum(intervals))), period_s)
    assert found.count == 1000 and found.outside_share == pytest.approx(0.002)
    assert found.p50_s == pytest.approx(period_s) and found.max_s == pytest.approx(2.6e-3)
    with pytest.raises(ValueError, match="Two SYNCs"):
        traces.sync_intervals(np.array([1.0]), period_s)


# ---- of a recording ------------------------------------------------------------------


def recorded(run, folder, **changed):
    values = {"columns": np.array(ROW), "rows": run.rows, "period_s": run.machine.period_s, "machine": ""}
    np.savez_compressed(folder / "trace.npz", **{**values, **changed})
    return folder / "trace.npz"


def test_the_recording_of_a_fault_is_a_trace_from_its_first_row_on(ruled_run, tmp_path):
    file = recorded(ruled_run, tmp_path)
    assert traces.is_recording(file)
    read = traces.of_recording(file, ruled_run.machine, ruled_run.kinematics)
    whole = traces.from_rows(ruled_run.rows, ruled_run.machine, ruled_run.kinematics, ruled_run.segments)
    assert len(read.time_s) == len(ruled_run.rows) > len(whole.time_s)
    late = len(read.time_s) - len(whole.time_s)
    for name in ("joint_command", "joint_actual", "line", "cutting"):
        assert np.array_equal(getattr(read, name)[late:], getattr(whole, name)), name


def test_a_recording_of_a_version_that_kept_less_or_in_another_order_is_the_same_trace(ruled_run, tmp_path):
    wanted = traces.of_recording(recorded(ruled_run, tmp_path), ruled_run.machine, ruled_run.kinematics)
    less = {"columns": np.array([*ROW[-2::-1], "newer"]), "rows": ruled_run.rows[:, ::-1].copy()}
    less["rows"] = np.roll(less["rows"], -1, axis=1)
    read = traces.of_recording(recorded(ruled_run, tmp_path, **less), ruled_run.machine, ruled_run.kinematics)
    for name in ("time_s", "joint_command", "joint_setpoint", "joint_actual", "feed_mm_s", "line", "cutting"):
        assert np.array_equal(getattr(read, name), getattr(wanted, name)), name


def test_a_recording_of_another_version_or_period_is_refused_in_a_sentence(ruled_run, tmp_path):
    file = recorded(ruled_run, tmp_path, columns=np.array(ROW[1:]), rows=ruled_run.rows[:, 1:])
    with pytest.raises(ValueError, match="another version of Directrix"):
        traces.of_recording(file, ruled_run.machine, ruled_run.kinematics)
    file = recorded(ruled_run, tmp_path, period_s=0.004)
    with pytest.raises(ValueError, match=r"a period of 0\.004 s"):
        traces.of_recording(file, ruled_run.machine, ruled_run.kinematics)
