"""The comparison says what DESIGN's slips and the paper's printed figures say."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from rich.console import Console
from support.machines.shipped_kinds import machine

from controller.machine.kinematics import kinematics_of
from controller.verify import paper, tables
from controller.verify.paper import Method, PaperComparison


@pytest.fixture(scope="module")
def comparison() -> PaperComparison:
    return paper.compare(machine("fig4a"))


def ours(comparison: PaperComparison, period_s: float) -> Method:
    return next(m for m in comparison.methods if m.name == "paper.arc_length" and m.period_s == period_s)


def step(comparison: PaperComparison, between: str) -> Method:
    return next(m for m in comparison.methods if m.name == "paper.step" and m.between_samples == between)


def test_the_corrected_eq_7_is_a_frustum_like_surface_of_the_length_in_slip_1(comparison):
    surface = paper.eq7()
    u = np.linspace(0.0, 1.0, 11)
    upper, lower = surface.upper.at(u, np), surface.lower.at(u, np)
    assert np.allclose(lower[0], 3.0 * upper[0]) and np.allclose(lower[1], 3.0 * upper[1])
    assert surface.lower.at(1.0) == pytest.approx((0.0, 15.0, 0.0), abs=1e-12)
    assert comparison.length_mm == pytest.approx(23.5814, abs=5e-5)


@pytest.mark.parametrize(
    ("period_s", "contour_um", "axis_deg"),
    [(0.010, 0.23, 9e-5), (0.002, 0.01, 3.5e-6), (0.0005, 0.0006, 2.2e-7)],
)
def test_between_samples_joints_run_linearly_and_stay_within(comparison, period_s, contour_um, axis_deg):
    between = ours(comparison, period_s).between
    assert between.contour_mm * 1e3 <= contour_um
    assert between.axis_deg <= axis_deg


@pytest.mark.parametrize("period_s", paper.OUR_PERIODS_S)
def test_at_the_samples_only_rounding_is_left(comparison, period_s):
    at = ours(comparison, period_s).at
    assert at.contour_mm < 1e-9 and at.axis_deg < 1e-9 and at.axis_at_contact_deg < 1e-9
    assert at.feed_share < 1e-6 and at.machine_um < 1e-6


def test_the_error_between_samples_falls_with_the_square_of_the_period(comparison):
    coarse, fine = ours(comparison, 0.010).between, ours(comparison, 0.002).between
    assert coarse.contour_mm / fine.contour_mm == pytest.approx(25.0, rel=0.01)
    assert coarse.axis_deg / fine.axis_deg == pytest.approx(25.0, rel=0.01)


def test_the_chords_are_as_bad_as_the_paper_prints(comparison):
    chords = comparison.methods[0]
    assert chords.samples == 23
    assert chords.at.contour_mm < 1e-9 and chords.at.axis_deg < 1e-9
    assert chords.between.contour_mm == pytest.approx(0.011, abs=5e-4)
    assert chords.between.axis_deg == pytest.approx(0.017, abs=5e-4)
    assert chords.between.position_um == pytest.approx(43.0, rel=0.05)


def test_at_10_ms_a_linear_orientation_is_off_by_slip_6_and_not_by_the_printed_figure(comparison):
    linear, joints = step(comparison, "orientation"), step(comparison, "joints")
    assert linear.between.axis_deg == pytest.approx(0.00059, abs=5e-6)
    assert joints.between.axis_deg < linear.between.axis_deg / 5.0
    assert linear.printed is not None and linear.printed.axis_deg == 0.00018


def test_the_first_order_step_keeps_the_curve_but_not_the_feed(comparison):
    at = step(comparison, "joints").at
    assert at.contour_mm < 1e-9
    assert 1e-4 < at.feed_share < 2e-3
    assert ours(comparison, 0.010).at.feed_share < 1e-6


def test_0_016_degrees_of_tilt_move_the_linear_axes_by_43_um():
    kinematics = kinematics_of(machine("fig4a"))
    tilt = math.radians(0.016)
    part = machine("fig4a").offsets[0].origin
    still, tilted = (np.array(kinematics.linear(part, (a, 0.0), 0.0)) for a in (0.0, tilt))
    assert np.linalg.norm(tilted - still) * 1e3 == pytest.approx(43.0, abs=0.2)


def test_both_parts_have_the_lengths_and_times_of_slip_5(comparison):
    fast, slow, ruled = comparison.parts
    assert fast.lengths_mm == pytest.approx((94.2478,), abs=5e-5)
    assert ruled.lengths_mm == pytest.approx((50.5115, 36.7618), abs=5e-5)
    times = [part.cut_time_s for part in comparison.parts]
    assert times == pytest.approx([5.65, 56.5, 52.4], abs=0.06)
    assert slow.setpoints == math.ceil(slow.cut_time_s / 0.002) == 28275
    assert [part.reported_s for part in comparison.parts] == [65.0, 65.0, 60.0]


def test_the_foot_of_the_perpendicular_is_found_from_beside_the_curve():
    surface = paper.eq7()
    u = np.linspace(0.05, 0.95, 19)
    normal = surface.normal(u, np)
    beside = tuple(
        c + 0.3 * n for c, n in zip(surface.contact(u, np), (normal[0], normal[1], 0.0), strict=True)
    )
    assert paper.nearest(surface, beside, u + 0.01) == pytest.approx(u, abs=1e-12)


def test_as_json_it_holds_every_figure(comparison):
    data = json.loads(json.dumps(comparison.to_dict()))
    assert len(data["methods"]) == 6 and len(data["parts"]) == 3
    assert data["methods"][4]["between"]["contour_mm"] == ours(comparison, 0.002).between.contour_mm


def test_the_tables_fit_80_columns_and_cut_nothing_off(comparison):
    console = Console(width=80, record=True, quiet=False, file=open("/dev/null", "w"))  # noqa: SIM115
    tables.paper(comparison, console)
    text = console.export_text()
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text
    for figure in ("0.0091", "3.13e-06", "0.227", "0.00018", "43", "94.2478", "36.7618"):
        assert figure in text
