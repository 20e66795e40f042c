"""What wears is counted as it was, kept over restarts, told once at its end, asked about before a start."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.fakes.fake_engine import FakeEngine, done
from support.machines.stepped_runs import shipped

from controller import messages
from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import COLUMN, ROW, of_axes
from controller.machine import machine_file, setup_data
from controller.machine.machine_file import ConfigError
from controller.machine.model import Machine, Tool
from controller.motion.motions import SurfaceCut
from controller.program.program import ProgramError
from controller.runtime import checked
from controller.service import status
from controller.service import usage as module
from controller.service.command_handlers import CommandHandlers
from controller.service.service import Service
from controller.service.usage import Usage
from controller.state.modes import Mode
from controller.store.service_store import ServiceStore

MACHINE = shipped()
NAMES = [axis.name for axis in MACHINE.axes]
FED = 7  # a motion at feed; the next one is a rapid
TEXT = "G21 G90 G54\nG1 X10. F3000\nM30\n"


def rows(path: np.ndarray, mode: Mode = Mode.RUNNING, fed: bool = True, first: int = 0) -> np.ndarray:
    """Of the recorder: commanded joints (mm, rad) tick by tick."""
    made = np.zeros((len(path), len(ROW)))
    made[:, COLUMN["tick"]] = np.arange(first, first + len(path))
    made[:, COLUMN["mode"]], made[:, COLUMN["rate"]] = mode, 1.0
    made[:, COLUMN["feed_mm_s"]] = 4.0
    made[:, COLUMN["motion_id"]] = FED if fed else FED + 1
    made[:, of_axes("joint_command", len(MACHINE.axes))] = path
    return made


def walk(ticks: int, seed: int = 3) -> np.ndarray:
    """To and fro, each axis at up to nine tenths of what it may."""
    most = np.array([0.9 * axis.limits.velocity * MACHINE.period_s for axis in MACHINE.axes])
    steps = np.random.default_rng(seed).uniform(-1.0, 1.0, (ticks, len(most)))
    return np.cumsum(steps * most, axis=0)


def value(usage: Usage, name: str) -> float:
    return next(float(one["value"]) for one in usage.to_json()["counters"] if one["name"] == name)


def gone(path: np.ndarray, axis: int) -> float:
    """Metres, or turns, by hand."""
    way = float(np.abs(np.diff(path[:, axis])).sum())
    return way / (2.0 * np.pi) if MACHINE.axes[axis].is_rotary else way / 1000.0


def test_every_axis_is_counted_to_and_fro_however_the_rows_come(tmp_path: Path) -> None:
    path, usage, at = walk(1000), Usage(ServiceStore(tmp_path), MACHINE), 0
    for size in (1, 7, 2, 490, 500):
        usage.take(rows(path[at : at + size], Mode.JOG, fed=False, first=at), 1, turning=True, fed={FED})
        at += size
    assert at == len(path)
    for i, name in enumerate(NAMES):
        assert value(usage, name) == pytest.approx(gone(path, i), rel=1e-9), name
    hours = MACHINE.period_s / 3600.0
    assert value(usage, "motion") == pytest.approx(999 * hours)
    assert value(usage, "spindle") == pytest.approx(1000 * hours)
    assert usage.to_json()["tools"] == []


def test_a_zero_that_is_found_is_no_travel_nor_is_a_drive_that_is_off(tmp_path: Path) -> None:
    usage, there = Usage(ServiceStore(tmp_path), MACHINE), walk(1)
    usage.take(rows(np.vstack((there, there + 250.0, there + 250.0))), 1, turning=False, fed={FED})
    usage.take(rows(there + 250.0 + walk(50), Mode.OFF, first=3), 1, turning=False, fed={FED})
    assert [value(usage, name) for name in (*NAMES, "motion", "spindle")] == [0.0] * (len(NAMES) + 2)


def test_a_tick_that_was_skipped_loses_no_way(tmp_path: Path) -> None:
    usage, path = Usage(ServiceStore(tmp_path), MACHINE), walk(100)
    kept = np.delete(np.arange(100), slice(40, 44))
    usage.take(rows(path)[kept], 1, turning=False, fed={FED})
    for i, name in enumerate(NAMES):
        assert value(usage, name) == pytest.approx(gone(path[kept], i), rel=1e-9)


def test_a_tool_counts_its_cut_and_the_parts_that_it_was_in(tmp_path: Path) -> None:
    usage = Usage(ServiceStore(tmp_path), MACHINE)
    usage.take(rows(walk(500)), 3, turning=False, fed={FED})
    usage.take(rows(walk(300), fed=False, first=500), 4, turning=False, fed={FED})
    usage.ended(whole_part=True)
    usage.take(rows(walk(100), first=800), 3, turning=False, fed={FED})
    usage.ended(whole_part=False)
    (tool,) = usage.to_json()["tools"]
    assert (tool["number"], tool["parts"]) == (3, 1)
    assert tool["cut_s"] == pytest.approx(600 * MACHINE.period_s)
    assert tool["cut_m"] == pytest.approx(600 * 4e-3 * MACHINE.period_s)


def test_a_tool_is_worn_by_its_time_its_way_or_its_parts(tmp_path: Path) -> None:
    usage = Usage(ServiceStore(tmp_path), MACHINE)
    usage.take(rows(walk(500)), 3, turning=False, fed={FED})
    cut_s, cut_m = 500 * MACHINE.period_s, 500 * 4e-3 * MACHINE.period_s
    for life in ((cut_s / 60.0, None, None), (None, None, cut_m)):
        for share, worn in ((0.999, True), (1.001, False)):
            usage.set_life(3, *(None if one is None else share * one for one in life))
            assert bool(usage.worn(3)) is worn
    usage.renew(3)
    assert usage.to_json()["tools"][0]["cut_m"] == 0.0


def test_all_of_it_is_there_after_a_restart(tmp_path: Path) -> None:
    usage = Usage(ServiceStore(tmp_path), MACHINE)
    usage.take(rows(walk(200)), 2, turning=True, fed={FED})
    usage.ended(whole_part=True)
    usage.set_life(2, 5.0, None)
    usage.set_item("grease", NAMES[0], 0.5)
    usage.save(at_once=True)
    assert Usage(ServiceStore(tmp_path), MACHINE).to_json() == usage.to_json()


def test_it_is_kept_now_and_then_and_a_full_disk_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = ServiceStore(tmp_path)
    usage = Usage(store, MACHINE)

    def full(*_: Any) -> None:
        raise OSError("full")

    usage.take(rows(walk(10)), 1, turning=False, fed={FED})
    monkeypatch.setattr(ServiceStore, "put", full)
    with pytest.raises(OSError):
        usage.save(at_once=True)
    monkeypatch.undo()
    usage.save()
    assert not store.has(module.DOCUMENT), "a moment after the last try"
    usage.save(at_once=True)
    assert store.document(module.DOCUMENT, lambda found: found["hours"]["motion"], 0.0) > 0.0


def test_what_comes_to_its_end_is_told_once_and_again_after_it_was_done(tmp_path: Path) -> None:
    usage = Usage(ServiceStore(tmp_path), MACHINE)
    usage.set_life(1, None, 2)
    usage.set_item("grease", NAMES[0], 1e-6)
    assert usage.due() == []
    for part in range(3):
        usage.take(rows(walk(50, seed=part)), 1, turning=False, fed={FED})
        usage.ended(whole_part=True)
        assert [key for key, _ in usage.due()] == [["maintenance_due"], ["tool_worn"], []][part]
    usage.save(at_once=True)
    assert Usage(ServiceStore(tmp_path), MACHINE).due() == [], "nor after a restart"
    usage.renew(1)
    usage.done("grease", "anna")
    assert usage.worn(1) == {} and usage.to_json()["items"][0]["used"] == 0.0
    usage.take(rows(walk(50)), 1, turning=False, fed={FED})
    assert [key for key, _ in usage.due()] == ["maintenance_due"]


def test_an_interval_begins_when_it_is_made(tmp_path: Path) -> None:
    usage = Usage(ServiceStore(tmp_path), MACHINE)
    usage.take(rows(walk(200)), 1, turning=False, fed={FED})
    usage.set_item("grease", NAMES[0], 1e-3)
    assert usage.to_json()["items"][0]["used"] == 0.0


# ---- at the door


def loaded(desk: CommandHandlers, service: Service) -> None:
    path = service.state / "part.ngc"
    path.write_text(TEXT)
    done(desk, "load", path=str(path))


def worn(service: Service, tool: int) -> None:
    service.usage.set_life(tool, None, 1)
    service.usage.take(rows(walk(5)), tool, turning=False, fed={FED})
    service.usage.ended(whole_part=True)


def test_a_worn_tool_in_the_spindle_starts_no_program_but_by_confirmation(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    loaded(desk, service)
    worn(service, 2)
    done(desk, "start")  # T1 is in the spindle
    done(desk, "stop")
    engine.now = engine.now._replace(mode=Mode.READY)
    service.watch.look()
    worn(service, 1)
    with pytest.raises(CommandRefused, match="T1, is worn") as refused:
        done(desk, "start")
    assert refused.value.code == "worn" and "verschlissen" in messages.text(refused.value.said, "de")
    done(desk, "tool_renewed", tool=1)
    assert service.usage.worn(1) == {}
    worn(service, 1)
    assert service.usage.worn(1)
    done(desk, "start", worn=True)


def test_a_worn_tool_with_a_sister_starts_and_the_run_has_it_in_its_place(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    loaded(desk, service)
    done(desk, "tool_life", tool=1, parts=1, sister=2)
    worn_again(service, 1)
    done(desk, "start")  # T1 is in the spindle: the next M6 changes it
    job = service.run.job
    assert job is not None and job.program.machine.sisters == ((1, 2),)
    assert job.fitted["sisters"] == {"1": 2} and "sisters" not in service.set_up.fitted
    assert service.set_up.applied(job.fitted).sisters == ((1, 2),)


def worn_again(service: Service, tool: int) -> None:
    service.usage.take(rows(walk(5)), tool, turning=False, fed={FED})
    service.usage.ended(whole_part=True)


@pytest.mark.parametrize(
    ("sisters", "worn_ones", "known", "found"),
    [
        ({1: 2}, [], {1, 2}, {}),
        ({1: 2}, [1], {1, 2}, {"1": 2}),
        ({1: 2, 2: 3}, [1, 2], {1, 2, 3}, {"1": 3, "2": 3}),
        ({1: 2, 2: 3}, [1, 2, 3], {1, 2, 3}, {}),
        ({1: 2, 2: 1}, [1, 2], {1, 2}, {}),  # round and round
        ({1: 2}, [1], {1}, {}),  # out of the table meanwhile
        ({}, [1], {1}, {}),
    ],
)
def test_a_sister_comes_in_the_place_of_what_is_worn(
    tmp_path: Path, sisters: dict[int, int], worn_ones: list[int], known: set[int], found: dict[str, int]
) -> None:
    usage = Usage(ServiceStore(tmp_path), MACHINE)
    for tool in (1, 2, 3):
        usage.set_life(tool, None, 1, None, sisters.get(tool))
    for tool in worn_ones:
        usage.take(rows(walk(5)), tool, turning=False, fed={FED})
        usage.ended(whole_part=True)
    assert usage.sisters(known) == found


def test_a_worn_tool_is_an_alarm_while_it_cuts(service: Service, engine: FakeEngine) -> None:
    service.usage.set_life(1, 1e-3, None)
    service.usage.take(rows(walk(100)), 1, False, {FED})
    for _ in range(2):
        service.run.take_rows(engine.now)
    assert [one["name"] for one in service.alarms.list()] == ["TOOL_WORN"]


def test_with_a_worn_tool_the_sister_is_told_that_a_start_from_there_brings(service: Service) -> None:
    service.usage.set_life(2, None, 1, None, 1)
    worn_again(service, 2)
    for told in (status.tool_change(MACHINE, 2, service.usage), service._worn(2)):
        assert told is not None and "brings its sister T1" in messages.text(told)
    assert service._worn(1) is None


def test_a_worn_tool_that_is_asked_for_is_told_as_such(service: Service) -> None:
    worn(service, 5)
    told = status.tool_change(MACHINE, 5, service.usage)
    assert "T5 is worn" in messages.text(told) and "T5 ist verschlissen" in messages.text(told, "de")


@pytest.mark.parametrize(
    ("verb", "args"),
    [
        ("tool_life", {"tool": 0}),
        ("tool_life", {"tool": 1, "cut_min": 0.0}),
        ("tool_life", {"tool": 1, "cut_m": 0.0}),
        ("tool_life", {"tool": 1, "parts": "many"}),
        ("tool_life", {"tool": 1, "sister": 1}),
        ("tool_life", {"tool": 1, "sister": 0}),
        ("tool_life", {"tool": 10**9}),
        ("maintenance", {"name": "", "counter": "X", "every": 1.0}),
        ("maintenance", {"name": "a\nb", "counter": "X", "every": 1.0}),
        ("maintenance", {"name": "a", "counter": "W", "every": 1.0}),
        ("maintenance", {"name": "a", "counter": "X", "every": float("nan")}),
        ("maintenance", {"name": "nobody"}),
        ("maintained", {"name": "nobody"}),
    ],
)
def test_what_cannot_be_is_refused(desk: CommandHandlers, verb: str, args: dict[str, Any]) -> None:
    with pytest.raises(CommandRefused) as refused:
        done(desk, verb, **args)
    assert refused.value.code == "bad" and messages.text(refused.value.said, "de") != refused.value.sentence


# Wear of a tool: corrections of radius and length beside what the tool table says, and Q below 0.

CUTTING = (machine_file.SHIPPED / "trunnion.toml").read_text() + (
    machine_file.SHIPPED / "tools.toml"
).read_text()
HEAD = "G21 G90 G54 G61\nT2 M6\nS9000 M3\n"
CONE = "G51 X20. Y0. Z0. I0. J0. K0. H10. R15. D40. F1000.\n"


def with_tool_2(**changes: object) -> Machine:
    built = machine_file.load("trunnion")
    tools = (replace(one, **changes) if one.number == 2 else one for one in built.tools)  # type: ignore[arg-type]
    return replace(built, tools=tuple(tools))


def cut(machine: Machine, text: str = CONE, side: str = "G42") -> SurfaceCut:
    task = checked.task(f"{HEAD}{side}\n{text}M30\n".encode(), "part.ngc", machine)
    walk = checked.walk_of(task, None, False)
    return next(one.motion for one in checked.segments(walk).values() if one.cutting)  # type: ignore[return-value]


def test_a_worn_cutter_is_led_and_looked_at_as_the_cutter_that_it_is() -> None:
    worn = with_tool_2(wear_radius_mm=-0.02, wear_length_mm=-0.1)
    measured = with_tool_2(radius_mm=1.48, length_mm=-0.1)
    found = cut(worn)
    assert found == cut(measured)
    assert (found.offset_mm, found.length_mm) == (pytest.approx(1.48), pytest.approx(-0.1))


def test_g43_takes_the_length_as_it_is() -> None:
    for form in ("G43", "G43 H2"):
        text = f"{HEAD}{form}\nG0 Z100.\n"
        ends = []
        for length in (0.0, -0.1):
            task = checked.task(text.encode(), "part.ngc", with_tool_2(wear_length_mm=length))
            ends.append(list(checked.segments(checked.path_of(task)).values())[-1].end)
        assert ends[1][2] - ends[0][2] == pytest.approx(-0.1)


def test_a_ball_stays_a_ball_and_the_holder_stays_on_the_spindle() -> None:
    ball = Tool(1, "", 3.0, 50.0, 15.0, corner_mm=3.0, holder=((20.0, 40.0, 8.0),))
    worn = replace(ball, wear_radius_mm=-0.05, wear_length_mm=-0.2).worn
    assert (worn.radius_mm, worn.corner_mm, worn.length_mm) == (2.95, 2.95, 49.8)
    assert worn.holder == ((19.8, 39.8, 8.0),)
    assert worn.worn == worn and ball.worn is ball


@pytest.mark.parametrize(
    ("key", "value"), [("wear_radius_mm", "-0.8"), ("wear_radius_mm", "0.6"), ("wear_length_mm", "-0.51")]
)
def test_more_than_wear_is_refused_with_what_is_allowed(key: str, value: str) -> None:
    with pytest.raises(ConfigError, match=rf"{key}.*0\.5"):
        machine_file.read(
            CUTTING.replace("radius_mm = 1.500", f"radius_mm = 1.500\n{key} = {value}"), "m.toml"
        )


def test_wear_is_read_and_what_the_operator_enters_keeps_it() -> None:
    wear = "radius_mm = 1.500\nwear_radius_mm = -0.01\nwear_length_mm = 0.02"
    machine = machine_file.read(CUTTING.replace("radius_mm = 1.500", wear), "m.toml")
    values = {"radius_mm": 1.6, "length_mm": 10.0, "flute_mm": 15.0}
    for entered, wears in ((values, (-0.01, 0.02)), ({**values, "wear_radius_mm": 0.0}, (0.0, 0.02))):
        again = setup_data.with_tool(machine, 2, entered)
        kept = next(one for one in again.tools if one.number == 2)
        assert (kept.radius_mm, kept.wear_radius_mm, kept.wear_length_mm) == (1.6, *wears)
        assert again.tool(2).radius_mm == pytest.approx(1.6 + wears[0])  # type: ignore[union-attr]


def test_q_below_0_brings_the_cutter_nearer() -> None:
    machine = with_tool_2()
    assert cut(machine, side="G42 Q-0.03").offset_mm == pytest.approx(1.47)
    assert cut(machine, side="G41 Q-0.03").offset_mm == pytest.approx(-1.47)


@pytest.mark.parametrize(
    ("side", "radius_mm", "sentence"),
    [("G42 Q-0.6", 1.5, r"Q-0\.6 takes 0\.6 mm more off"), ("G42 Q-0.4", 0.3, r"leaves nothing of T2")],
)
def test_q_below_what_wear_can_be_is_refused(side: str, radius_mm: float, sentence: str) -> None:
    with pytest.raises(ProgramError, match=sentence):
        cut(with_tool_2(radius_mm=radius_mm), side=side)
