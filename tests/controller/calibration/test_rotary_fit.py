"""Rotaries from a probed sphere: on machines of every kind that are not as their file says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.machines.hidden_geometry import Errors, Hidden, hidden, probed

from controller.calibration import positions, rotary_fit, rotary_report
from controller.calibration.positions import Probe, Sphere
from controller.calibration.refusal import Refusal
from controller.geometry.vectors import add, angle_between, cross, norm, subtract, unit
from controller.machine import machine_file
from controller.machine.model import Kind, Pitch

KINDS = tuple(
    name
    for name in machine_file.shipped()
    if len(machine_file.load(name).rotary()) == 2 and "buses" not in name
)
PROBE = Probe(100.0, 3.0)
RADIUS = 12.7
# What tables measured by ISO 230-2 leave, and what axes have that nobody has measured.
MEASURED = Errors(backlash_mm=5e-4, pitch_mm=5e-4, scale=2e-6)
UNMEASURED = Errors(backlash_mm=0.01, pitch_mm=0.01, scale=3e-5)


def with_tables(machine):
    """As after a measurement of every axis: there is a table, here of a machine that needs none."""
    table = Pitch((-1.0, 1.0), (0.0, 0.0), (0.0, 0.0))
    return replace(machine, axes=tuple(replace(axis, pitch=table) for axis in machine.axes))


def sphere_on(machine, rng) -> Sphere:
    tables = [machine.axes[i].point_mm for i in machine.rotary() if machine.axes[i].kind is Kind.TABLE]
    beside = (60.0 * rng.uniform(0.5, 1), 40.0 * rng.uniform(-1, 1), 30.0 + 40.0 * rng.uniform())
    return Sphere(add(tables[-1] if tables else (0.0, 0.0, 0.0), beside), RADIUS)


def places(machine, sphere, rng, count):
    found = positions.reachable(machine, sphere, PROBE)
    return [found[i] for i in rng.choice(len(found), min(count, len(found)), replace=False)]


def off(found, real: Hidden, index: int) -> tuple[float, float]:
    """(mm, rad): how far the found point is from the true axis, and the angle between the axes."""
    a, b = found.axes[index], real.machine.axes[index]
    return norm(cross(unit(b.direction), subtract(a.point_mm, b.point_mm))), angle_between(
        a.direction, b.direction
    )


def calibrated(machine, seed, errors, count):
    rng = np.random.default_rng(seed)
    real, sphere = hidden(machine, rng, errors), sphere_on(machine, rng)
    touches = probed(machine, real, sphere, PROBE, places(machine, sphere, rng, count), rng)
    return real, rotary_fit.fit(touches, machine, RADIUS), touches


@pytest.mark.parametrize("kind", KINDS)
def test_without_other_errors_and_scatter_the_rotaries_come_back(kind):
    machine, rng = machine_file.load(kind), np.random.default_rng(1)
    real, sphere = hidden(machine, rng, Errors()), sphere_on(machine, rng)
    touches = probed(machine, real, sphere, PROBE, places(machine, sphere, rng, 8), rng, 0.0)
    fit = rotary_fit.fit(touches, machine, RADIUS)
    for index in machine.rotary():
        mm, rad = off(fit.machine, real, index)
        assert mm < 3e-5 and rad < math.radians(3e-5), (kind, machine.axes[index].name, mm, rad)


def keeps_its_bounds(kind, machine, seeds, errors, count):
    for k in seeds:
        real, fit, _ = calibrated(machine, [k, KINDS.index(kind)], errors, count)
        for index, (mm, rad) in zip(machine.rotary(), fit.bounds(), strict=True):
            found = off(fit.machine, real, index)
            yield found, (mm, rad)
            assert found[0] <= mm and found[1] <= rad, (kind, k, machine.axes[index].name, found, (mm, rad))


@pytest.mark.parametrize("kind", KINDS[::4])
def test_with_measured_axes_centres_are_back_within_2_um_and_directions_within_their_bound(kind):
    for found, bound in keeps_its_bounds(kind, with_tables(machine_file.load(kind)), [0], MEASURED, 28):
        assert found[0] < 0.002 and found[1] < math.radians(0.0013)
        assert bound[0] < 0.007 and bound[1] < math.radians(0.003)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("first", range(0, 20, 5))
def test_20_random_machines_of_every_kind(first, kind):
    made, seeds = with_tables(machine_file.load(kind)), range(first, first + 5)
    for found, _ in keeps_its_bounds(kind, made, seeds, MEASURED, 28):
        assert found[0] < 0.002 and found[1] < math.radians(0.0015)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("first", range(0, 20, 5))
def test_20_random_machines_of_every_kind_whose_axes_nobody_has_measured_keep_what_is_told(first, kind):
    seeds = range(first, first + 5)
    assert len(list(keeps_its_bounds(kind, machine_file.load(kind), seeds, UNMEASURED, 20))) == 10


@pytest.mark.parametrize("kind", ["trunnion", "table_head", "head_head"])
def test_axes_that_nobody_has_measured_are_told_by_a_larger_bound_that_is_kept(kind):
    rows = list(keeps_its_bounds(kind, machine_file.load(kind), range(1), UNMEASURED, 20))
    assert max(bound[0] for _, bound in rows) > 0.01


def test_the_dispersion_is_that_of_the_file_before_and_of_the_scatter_after():
    machine = with_tables(machine_file.load("trunnion"))
    _, fit, touches = calibrated(machine, 5, MEASURED, 20)
    told = rotary_report.report(fit, machine)
    assert told["dispersion_um"]["before"]["max"] > 50.0
    assert told["dispersion_um"]["after"]["max"] < 3.0
    assert told["touches"] == len(touches) and told["positions"] == 20
    assert 0.7 < told["scatter_um"] < 1.3 and told["valuation"] > 95.0


def test_positions_that_turn_one_rotary_only_leave_the_other_as_it_is_and_say_so():
    machine = machine_file.load("trunnion")
    rng = np.random.default_rng(3)
    real, sphere = hidden(machine, rng, Errors()), sphere_on(machine, rng)
    touches = probed(machine, real, sphere, PROBE, [(0.0, 0.4 * k) for k in range(12)], rng)
    fit = rotary_fit.fit(touches, machine, RADIUS)
    told = rotary_report.report(fit, machine)
    assert {name.split(".")[0] for name in told["unseen"]} == {"A"}
    assert told["valuation"] < 5.0
    assert off(fit.machine, real, 4)[0] < fit.bounds()[1][0]


def test_positions_to_add_narrow_the_widest_bound():
    machine = with_tables(machine_file.load("trunnion"))
    rng = np.random.default_rng(4)
    real, sphere = hidden(machine, rng, MEASURED), sphere_on(machine, rng)
    few = [(0.0, 0.0), (0.0, 1.0), (0.0, 2.0), (0.1, 0.0), (0.2, 0.0)]
    touches = probed(machine, real, sphere, PROBE, few, rng)
    before = rotary_fit.fit(touches, machine, RADIUS)
    advice = positions.advise(machine, sphere, PROBE, 4, done=touches)
    more = probed(machine, real, sphere, PROBE, [*few, *advice.positions], rng)
    after = rotary_fit.fit(more, machine, RADIUS)
    worst = [max(row[i] for row in fit.bounds()) for fit in (before, after) for i in (0, 1)]
    assert worst[2] < 0.5 * worst[0] and worst[3] < 0.5 * worst[1]


def test_a_touch_that_is_wrong_is_told():
    machine = machine_file.load("trunnion")
    _, _, touches = calibrated(machine, 6, Errors(), 12)
    touches.joints[37, 0] += 0.03
    assert 37 in rotary_fit.fit(touches, machine, RADIUS).doubtful()


def test_a_change_that_is_too_large_is_refused():
    machine = machine_file.load("trunnion")
    _, fit, _ = calibrated(machine, 7, Errors(centre_mm=0.5), 12)
    told = rotary_report.report(fit, machine)
    rotary_report.refuse_large(told)
    with pytest.raises(Refusal, match="would move by"):
        rotary_report.refuse_large(told, max_mm=1e-3)


def test_too_few_touches_and_a_machine_without_rotaries_are_refused():
    machine = machine_file.load("trunnion")
    _, _, touches = calibrated(machine, 8, Errors(), 12)
    with pytest.raises(Refusal, match="3 positions"):
        rotary_fit.fit(touches.chosen(np.arange(18)), machine, RADIUS)
    with pytest.raises(Refusal, match="no rotary axis"):
        rotary_fit.fit(touches, machine_file.load("three_axes"), RADIUS)
