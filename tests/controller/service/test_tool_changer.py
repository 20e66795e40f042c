"""A tool changer: nothing moves that its journal does not know, and no tool is lost in what it knows."""

from __future__ import annotations

import contextlib
import math
import random
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_engine import engine_of, served
from support.machines.changer_bench import (
    BESIDE,
    CHANGER,
    LONGEST,
    ChangerBench,
    change,
    machine,
    nothing_moves,
)
from support.machines.stored_tools import StoredTools

from controller.ipc.control_socket import CommandRefused
from controller.machine import machine_file
from controller.machine.toml_table import ConfigError
from controller.messages import Message, text
from controller.motion.pieces import FIRST_MARK
from controller.plan.restart.program_position import AFTER_CHANGE, ENTRY_ID, Spot
from controller.plan.segment import ContinuousPath
from controller.program import blocks
from controller.program.program import Act, Action, Changing, ProgramError, Select
from controller.runtime import checked
from controller.runtime.starts import Start, path_from
from controller.runtime.stepped import SteppedMachine
from controller.service.command_handlers import CommandHandlers
from controller.state.modes import TOOL_CHANGE, Fault, Mode, Request
from controller.store.tool_store import Step, placed


def _changes(folder: Path, seed: int, count: int, changer: str) -> Counter[str]:
    print(f"seed {seed}")
    bench, random_ = ChangerBench(folder, changer), random.Random(seed)
    bench.confirm()
    came = Counter(change(bench, random_) for _ in range(count))
    bench.store.close()
    return came


@pytest.mark.parametrize("changer", [CHANGER, BESIDE], ids=["in line", "beside the cut"])
def test_no_tool_is_lost_and_nothing_moves_on_a_guess(tmp_path: Path, changer: str) -> None:
    came = _changes(tmp_path, 18, 12, changer)
    assert came["sound: done"] and any(one.endswith("doubted") for one in came), came


@pytest.mark.slow
@pytest.mark.parametrize("changer", [CHANGER, BESIDE], ids=["in line", "beside the cut"])
@pytest.mark.parametrize("seed", range(20))
def test_a_thousand_changes(tmp_path: Path, seed: int, changer: str) -> None:
    came = _changes(tmp_path, seed, 50, changer)
    assert sum(came.values()) == 50 and not any(one == "sound: held" for one in came), came


def test_a_step_that_does_not_end_is_told_in_its_own_words_and_waits_again(tmp_path: Path) -> None:
    bench = ChangerBench(tmp_path)
    bench.confirm()
    bench.magazine.hang("drawbar_closed", False)
    bench.begin("T2 M6")
    assert bench.go(LONGEST) == "held"
    assert "The drawbar does not close." in bench.alarms[-1][1]
    bench.magazine.repair()
    bench.resume()
    assert bench.go(LONGEST) == "done" and bench.store.spindle == 2


def test_a_switch_that_hangs_on_does_not_pass_for_a_tool_that_moved(tmp_path: Path) -> None:
    bench = ChangerBench(tmp_path)
    bench.confirm()
    bench.begin("T2 M6")
    while (step := bench.store.step) is None or step.name != "Over it":
        bench.go(2)
    bench.magazine.hang("drawbar_closed", True)
    assert bench.go(LONGEST) == "held"
    bench.stop()
    assert bench.changer.doubt is not None and bench.store.places[2] == 2


def test_a_change_that_was_held_goes_on_where_it_stood(tmp_path: Path) -> None:
    bench = ChangerBench(tmp_path)
    bench.confirm()
    bench.begin("T2 M6")
    bench.go(40)
    bench.changer.hold()
    assert bench.go(LONGEST) == "held"
    joints = bench.stepped.joints
    bench.stepped.go(200)
    assert bench.stepped.joints == joints
    bench.resume()
    assert bench.go(LONGEST) == "done" and bench.store.spindle == 2


def shown_while(bench: ChangerBench, act: Callable[[], Any] = lambda: None) -> list[str]:
    """The modes that a status has from now to the run's end or a hold, by ticks and without repeats."""
    modes = list[str]()
    for n in range(LONGEST):
        if n == 10:
            act()
        bench.stepped.go(1)
        now = bench.stepped.board.read()
        assert now is not None
        for looked in (False, True):  # whoever asks may do so before the service has looked, or behind it
            mode = TOOL_CHANGE if bench.changer.change(now) is not None else now.mode.name
            if modes[-1:] != [mode]:
                modes.append(mode)
            if not looked:
                bench.changer.look(now)
        if now.mode is Mode.READY or "HOLD" in modes:
            break
    return modes


def test_a_change_is_a_mode_of_its_own_and_its_stops_are_no_holds(tmp_path: Path) -> None:
    bench = ChangerBench(tmp_path)
    bench.confirm()
    bench.begin("G1 X1 F600\nT2 M6\nG1 X2\nT3 M6\nG1 X1")
    cut, change = "RUNNING", TOOL_CHANGE
    assert shown_while(bench) == [cut, change, cut, change, cut, "READY"]


def test_a_change_says_its_step_in_words(tmp_path: Path) -> None:
    bench, steps = ChangerBench(tmp_path), list[str]()
    bench.confirm()
    bench.begin("T2 M6\nT3 M6")
    for _ in range(LONGEST):
        bench.go(1)
        now = bench.stepped.board.read()
        assert now is not None
        words = bench.changer.change(now)
        if words is not None and steps[-1:] != [text(words)]:
            steps.append(text(words))
        if now.mode is Mode.READY:
            break
    assert steps[0] == "T2 in: step 1 of 6, Magazine free." and steps[5] == "T2 in: step 6 of 6, Away."
    assert steps[6] == "T2 away, T3 in: step 1 of 13, Drawbar closed." and len(steps) == 19, steps


def test_a_change_that_is_held_is_a_hold(tmp_path: Path) -> None:
    """By an operator, or because a step fails: then somebody must do something, and Resume goes on."""
    bench = ChangerBench(tmp_path)
    bench.confirm()
    bench.begin("T2 M6")
    assert shown_while(bench, bench.changer.hold)[-1] == "HOLD"
    bench.resume()
    bench.magazine.hang("drawbar_closed", False)
    assert shown_while(bench)[-1] == "HOLD"


def test_a_worn_tool_is_told_before_anything_moves_and_taken_by_resume(tmp_path: Path) -> None:
    bench = ChangerBench(tmp_path)
    bench.confirm()
    bench.worn = {2}
    joints = bench.stepped.joints
    bench.begin("T2 M6\nT3 M6\nT2 M6")
    assert bench.go(LONGEST) == "held" and bench.stepped.joints == joints and bench.store.step is None
    assert bench.alarms == [("CHANGE_WORN", bench.alarms[0][1])] and "12.5 m" in bench.alarms[0][1]
    bench.resume()
    assert bench.go(3 * LONGEST) == "held" and bench.store.spindle == 3  # once more, before it comes again
    bench.worn.clear()  # it was renewed meanwhile
    bench.resume()
    assert bench.go(LONGEST) == "done" and bench.store.spindle == 2
    assert [name for name, _ in bench.alarms] == ["CHANGE_WORN"] * 2


# -- T beside a cut


CUT = "T2\nG1 X40 F1200\nM6"  # two seconds of cut


def cutting(tmp_path: Path, program: str = CUT) -> ChangerBench:
    """A run that has come to its cut; T2 is named."""
    bench = ChangerBench(tmp_path, BESIDE)
    bench.confirm()
    bench.begin(program)
    bench.changer.beside.name(2)
    return bench


def until(bench: ChangerBench, step: str) -> None:
    for _ in range(LONGEST):
        if (now := bench.store.preparation) is not None and now.name == step:
            return
        bench.go(2)
    raise AssertionError(step)


def test_t_prepares_while_the_cut_goes_on_and_m6_takes_what_stands_ready(tmp_path: Path) -> None:
    bench = cutting(tmp_path)
    until(bench, "Pocket to the arm")
    assert bench.changer.to_json()["preparing"] == {
        "tool": 2,
        "step": 1,
        "steps": 2,
        "name": "Pocket to the arm",
    }
    bench.go(40)
    assert bench.cutting and bench.stepped.joints[0] < 39.0, "the cut is not over"
    assert (
        bench.changer.to_json()["ready"] == 2 and bench.magazine.arm == 2 and bench.store.preparation is None
    )
    assert bench.go(LONGEST) == "done" and bench.store.spindle == 2
    assert bench.changer.to_json()["ready"] is None
    assert [row[1] for row in bench.store.log()].count("preparing") == 2, "M6 has not done it again"


def test_without_t_m6_prepares_at_its_first_stop(tmp_path: Path) -> None:
    bench = ChangerBench(tmp_path, BESIDE)
    bench.confirm()
    bench.begin("T2 M6")
    assert bench.go(LONGEST) == "done" and bench.store.spindle == 2
    bench.begin("T3 M6")
    assert bench.go(LONGEST) == "done" and bench.store.spindle == 3


def test_another_t_begins_with_the_first_step_again(tmp_path: Path) -> None:
    bench = cutting(tmp_path, CUT.replace("M6", "T3 M6"))
    until(bench, "Pocket to the arm")
    bench.changer.beside.name(3)
    assert bench.go(LONGEST) == "done" and bench.store.spindle == 3
    steps = [(row[3], row[4]) for row in reversed(bench.store.log()) if row[1] == "preparing"]
    assert steps == [(2, 0), (2, 1), (3, 0), (3, 1)]


@pytest.mark.parametrize("without_power", [False, True])
def test_what_was_being_prepared_when_all_ended_is_in_doubt_until_somebody_has_looked(
    tmp_path: Path, without_power: bool
) -> None:
    bench = cutting(tmp_path)
    until(bench, "Pocket to the arm")
    bench.die(without_power)
    assert "T2 was being made ready" in text(bench.changer.doubt) and "Pocket to the arm" in text(
        bench.changer.doubt
    )
    assert bench.changer.whereabouts.unsure == {}, "no tool was moved by it"
    nothing_moves(bench)
    bench.confirm()
    assert bench.changer.doubt is None
    bench.begin("T2 M6")
    assert bench.go(LONGEST) == "done" and bench.store.spindle == 2


def test_between_two_steps_and_behind_the_last_nothing_is_in_doubt(tmp_path: Path) -> None:
    bench = cutting(tmp_path)
    until(bench, "Pocket to the arm")
    bench.go(40)
    bench.die(True)
    assert bench.changer.doubt is None and bench.changer.to_json()["ready"] is None


def test_a_pocket_that_does_not_come_is_told_and_the_cut_goes_on_until_m6_waits(tmp_path: Path) -> None:
    bench = cutting(tmp_path)
    bench.magazine.hang("ready", False)
    until(bench, "Pocket to the arm")
    while not bench.alarms:
        assert bench.go(2) == "" and bench.cutting
    assert bench.alarms[0][0] == "CHANGE_PREPARE" and "The pocket does not come" in bench.alarms[0][1]
    assert bench.go(LONGEST) == "" and bench.store.step is None and bench.changer.under_way
    joints = bench.stepped.joints
    bench.go(100)
    assert bench.stepped.joints == joints
    bench.magazine.repair()
    assert bench.go(LONGEST) == "done" and bench.store.spindle == 2


def test_a_run_that_is_stopped_meanwhile_leaves_it_in_doubt(tmp_path: Path) -> None:
    bench = cutting(tmp_path)
    bench.magazine.hang("ready", False)
    until(bench, "Pocket to the arm")
    while not bench.alarms:
        bench.go(2)
    bench.stop()
    bench.go(4)
    assert bench.changer.doubt is not None


def test_in_an_operators_hold_no_step_begins(tmp_path: Path) -> None:
    bench = cutting(tmp_path)
    until(bench, "Arm back")
    bench.stepped.request(Request.HOLD)
    for _ in range(100):
        bench.go(2)
    assert bench.store.preparation is None and bench.magazine.arm == 0
    bench.resume()
    assert bench.go(LONGEST) == "done" and bench.store.spindle == 2


def test_a_step_that_the_tick_refuses_begins_once_it_is_permitted(tmp_path: Path) -> None:
    """As by a door that was opened in the same moment."""
    bench = cutting(tmp_path)
    bench.changer.beside.name(0)
    bench.go(10)
    bench.changer.beside.name(2)
    now = bench.stepped.board.read()
    assert now is not None and now.mode is Mode.RUNNING
    bench.changer.look(now)
    bench.stepped.cycle.modes.interlock = Fault.DOOR_OPEN
    assert bench.store.preparation is not None
    bench.go(4)
    assert [row[1] for row in bench.store.log()].count("prepared") == 1
    assert bench.go(LONGEST) == "done" and bench.store.spindle == 2


@pytest.mark.parametrize("value", [0.0, -1.0, 0.5, 8.0, 2.0**48, 8.0 * 2**24, math.nan, math.inf])
def test_the_tick_switches_nothing_that_is_not_prepared_with(value: float) -> None:
    stepped = SteppedMachine(machine(BESIDE))
    before = stepped.cycle.peripherals._switched
    assert not stepped.cycle.peripherals.by_hand(Request.PREPARE, value, Mode.RUNNING)
    assert stepped.cycle.peripherals._switched == before


def test_t_is_heard_where_the_program_comes_to_it(tmp_path: Path) -> None:
    for changer, named in ((BESIDE, [2]), (CHANGER, [])):
        made = blocks.read(CUT.encode(), machine(changer), "p.ngc").blocks
        assert [one.tool for one in made if isinstance(one, Select)] == named


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('name = "Arm back"\noff = ["swing"]', 'name = "Arm back"\non = ["drawbar"]', "as the step"),
        ('name = "Arm back"\noff = ["swing"]', 'name = "Arm back"\nmove_mm = { Z = 0 }', "move_mm"),
        ('off = ["swing"]\ninput = "ready"\nlevel = "off"', 'off = ["swing"]', "input"),
        (
            'on = ["swing"]\ninput = "ready"',
            'on = ["swing"]\nlevel = "on"\ninput = "ready"',
            "pocket that stood there",
        ),
    ],
)
def test_a_preparation_is_checked_as_it_is_read(old: str, new: str, says: str) -> None:
    assert old in BESIDE
    with pytest.raises(ConfigError, match=says):
        machine_file.read(machine(BESIDE).text.replace(BESIDE, BESIDE.replace(old, new, 1)), "m.toml")


def test_simulated_a_pocket_that_is_prepared_comes(tmp_path: Path) -> None:
    stepped = SteppedMachine(machine(BESIDE))
    stepped.come_up()
    path = checked.path_of(checked.task(b"T2 M6\nT3\nG0 X5\nM6\nM30\n", "p.ngc", machine(BESIDE)))
    assert stepped.run(path).result == "completed"


def test_a_tool_whose_life_ended_in_the_spindle_is_held_at_its_next_m6(tmp_path: Path) -> None:
    bench = ChangerBench(tmp_path)
    bench.confirm()
    bench.moves_between = True
    bench.begin("T2 M6\nG0 X5\nT2 M6\nG0 X6\nT2 M6\nG0 X7")
    while bench.stepped.joints[0] < 12.9 or bench.store.step is not None:
        assert bench.go(2) == ""
    bench.worn = {2}
    assert bench.go(LONGEST) == "held" and bench.stepped.joints[0] == pytest.approx(13.0)
    bench.resume()
    assert bench.go(LONGEST) == "held" and bench.stepped.joints[0] == pytest.approx(14.0)
    bench.worn.clear()
    bench.resume()
    assert bench.go(LONGEST) == "done" and bench.store.spindle == 2 and bench.store.step is None
    assert [name for name, _ in bench.alarms] == ["CHANGE_WORN"] * 2


def test_where_tools_are_must_be_confirmed_once(tmp_path: Path) -> None:
    bench = ChangerBench(tmp_path)
    joints = bench.stepped.joints
    bench.begin("T2 M6")
    bench.go(LONGEST)
    assert bench.stepped.joints == joints and bench.alarms[-1][0] == "CHANGE_REFUSED"


_WRITER = """
import sys
from pathlib import Path
from controller.store.service_store import ServiceStore
from controller.store.tool_store import Step, ToolStore
store, spindle = ToolStore(ServiceStore(Path(sys.argv[1]))), 0
print("begun", flush=True)
while True:
    for tool in (1, 2, 3):
        store.begin(Step(0, tool, 0, "take", tool, 0))
        store.begin(Step(tool, 0, 1, "put away", tool, tool))
        store.end()
"""


def test_a_store_whose_writer_is_killed_knows_every_tool(tmp_path: Path) -> None:
    store = StoredTools(tmp_path)
    store.confirm(placed((1, 2, 3), 0, ()))
    store.close()
    for k in range(3):
        writer = subprocess.Popen([sys.executable, "-c", _WRITER, str(tmp_path)], stdout=subprocess.PIPE)
        assert writer.stdout is not None and writer.stdout.readline()
        time.sleep(0.02 + 0.013 * k)
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        store = StoredTools(tmp_path)
        places, step = store.places, store.step
        assert set(places) == {1, 2, 3}
        for tool, pocket in places.items():
            assert pocket in (0, tool)
            assert pocket == tool or (step is not None and step.carries == tool)
        store.confirm(placed((1, 2, 3), 0, ()))
        store.close()


def test_who_asks_where_the_tools_are_waits_for_no_writer_and_sees_only_what_is_kept(tmp_path: Path) -> None:
    store = StoredTools(tmp_path)
    store.confirm(placed((1, 2, 3), 2, ()))
    asked = list[object]()

    def ask() -> None:
        asked.extend((store.spindle, store.step, dict(store.places)))

    with contextlib.suppress(KeyError), store._whole() as sql:
        sql.execute("DELETE FROM place")
        asking = threading.Thread(target=ask, daemon=True)
        asking.start()
        asking.join(30.0)
        raise KeyError
    assert asked == [2, None, {1: 1, 2: 0, 3: 3}]
    assert store.spindle == 2, "taken back"
    store.begin(Step(2, 0, 0, "put away", 2, 2))
    store.end()
    assert store.spindle == 0 and store.places == {1: 1, 2: 2, 3: 3}
    store.close()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("X = [-10, -12, -14]", "X = [-10, -12]", "one of each pocket"),
        ("Z = 255", "Z = 900", "out of the travel"),
        ('input = "drawbar_open"', 'input = "drawbar_up"', "no bit in inputs"),
        ('on = ["turn"]', 'on = ["turns"]', "no bit in outputs"),
        ('on = ["turn"]', 'on = ["coolant"]', "M7 to M9"),
        ("within_s = 20", "", "within_s"),
        ('fails = "Z does not come up."', "", "fails"),
        ("carries = true", "", "one step that carries"),
        ("pockets = [1, 2, 3]", "pockets = [1, 2, 2]", "in two pockets"),
        ("pockets = [1, 2, 3]", "pockets = [1, 2, 33]", "not in the tool table"),
        ('pocket = ["bit0", "bit1"]', 'pocket = ["bit0"]', "cannot say 3"),
    ],
)
def test_a_changer_is_checked_as_it_is_read(old: str, new: str, says: str) -> None:
    assert old in CHANGER
    text = machine().text.replace(CHANGER, CHANGER.replace(old, new, 1))
    with pytest.raises(ConfigError, match=says):
        machine_file.read(text, "m.toml")


def test_a_tool_without_a_pocket_is_refused_with_its_line() -> None:
    text = machine().text.replace("pockets = [1, 2, 3]", "pockets = [1, 2, 0]")
    with pytest.raises(ProgramError, match=r"p.ngc:2.*T3 has no pocket"):
        blocks.read(b"G21\nT3 M6\n", machine_file.read(text, "m.toml"), "p.ngc")


def test_what_the_spindle_holds_already_is_not_changed() -> None:
    tool, stop, *rest = blocks.read(b"T1 M6\n", machine(), "p.ngc").blocks
    assert isinstance(tool, Action) and isinstance(stop, Action) and not tool.changing
    assert stop.changing == Changing(0, 1, 1, 0, True) and stop.changing.moves_nothing
    assert [one.act for one in rest if isinstance(one, Action)] == [Act.COOLANT]


def test_simulated_the_steps_are_no_stops_of_the_program() -> None:
    stepped = SteppedMachine(machine())
    stepped.come_up()
    path = checked.path_of(checked.task(b"T2 M6\nG0 X5\nM0\nT1 M6\nM30\n", "p.ngc", machine()))
    run = stepped.run(path)
    assert (run.result, run.assumed_resumes) == ("completed", 1)


# -- as the door has it


@pytest.fixture
def desk(tmp_path: Path) -> CommandHandlers:
    return CommandHandlers(served(tmp_path, machine()))


def _ask(desk: CommandHandlers, verb: str, **args: Any) -> Any:
    answer = desk(verb, args)
    return answer.result(10.0) if isinstance(answer, Future) else answer


@pytest.mark.parametrize("verb", ["mdi", "home"])
def test_nothing_is_begun_before_the_tools_are_confirmed(desk: CommandHandlers, verb: str) -> None:
    with pytest.raises(CommandRefused, match="has not been confirmed yet"):
        _ask(desk, verb, text="G0 X1")
    assert any(one["name"] == "CHANGER_IN_DOUBT" for one in _ask(desk, "status")["notices"])


def test_what_is_confirmed_is_told(desk: CommandHandlers) -> None:
    told = _ask(desk, "changer_confirm", spindle=2, away=[3], clear=True)
    assert told["spindle"] == 2 and told["away"] == [3] and told["doubt"] is None
    assert [row["here"] for row in told["pockets"]] == [True, False, False]
    assert _ask(desk, "status")["tool"] == 2
    assert _ask(desk, "changer")["log"][0]["what"] == "confirmed"


@pytest.mark.parametrize(
    ("args", "says"),
    [
        ({"spindle": 2, "clear": False}, "confirm that you have looked"),
        ({"spindle": 77, "clear": True}, "T77 is not in the tool table"),
        ({"spindle": 2, "away": [2], "clear": True}, "cannot be in the spindle and out"),
        ({"spindle": 2, "away": 2, "clear": True}, "cannot be in the spindle and out"),
        ({"clear": True}, "spindle None: must be a whole number from 0 to 99999"),
    ],
)
def test_a_guess_is_not_taken(desk: CommandHandlers, args: dict[str, Any], says: str) -> None:
    with pytest.raises(CommandRefused, match=says):
        _ask(desk, "changer_confirm", **args)
    assert _ask(desk, "changer")["spindle"] is None


def test_a_pocket_that_is_given_away_is_looked_at_anew(desk: CommandHandlers) -> None:
    _ask(desk, "changer_confirm", spindle=0, clear=True)
    told = _ask(desk, "changer_pocket", pocket=1, tool=3)
    assert [row["tool"] for row in told["pockets"]] == [3, 2, None] and told["doubt"] is not None
    with pytest.raises(CommandRefused, match="pocket 9"):
        _ask(desk, "changer_pocket", pocket=9, tool=3)


def test_a_change_is_a_mode_of_the_status_and_its_job_runs(tmp_path: Path) -> None:
    """Whoever asks between two steps, before anybody has looked, is not told of a hold."""
    service = served(tmp_path, machine())
    desk, engine, changer = CommandHandlers(service), engine_of(service), service.changer
    assert changer is not None
    _ask(desk, "changer_confirm", spindle=0, away=[], clear=True)
    _ask(desk, "mdi", text="T2 M6")
    changer.hear([Changing(0, 0, 2, 0, False)])
    engine.now = engine.now._replace(mode=Mode.HOLD, motion_id=FIRST_MARK)
    now = _ask(desk, "status")
    assert (now["mode"], now["job"]["state"]) == (TOOL_CHANGE, "running")
    assert text(now["change"]) == "T2 in: step 1 of 6, Magazine free."
    engine.now = engine.now._replace(interlock=Fault.DOOR_OPEN)
    now = _ask(desk, "status")
    assert (now["mode"], now["job"]["state"], now["change"]) == ("HOLD", "held", None)


TWO = "G21 G90 G94 T1 M6\nG1 X1 F600\nT2 M6\nG1 X2\nG1 X3\nM30\n"
IN_IT = Changing(5, 1, 2, 4, False)  # a step of the second change


def interrupted_in_a_change(tmp_path: Path) -> CommandHandlers:
    """TWO was stopped in its second change, T1 to T2, and the service has seen that."""
    service = served(tmp_path, machine())
    desk, engine, changer = CommandHandlers(service), engine_of(service), service.changer
    assert changer is not None
    _ask(desk, "changer_confirm", spindle=1, away=[], clear=True)
    (service.state / "two.ngc").write_text(TWO)
    _ask(desk, "load", path=str(service.state / "two.ngc"))
    _ask(desk, "start")
    engine.now = engine.now._replace(line=2, motion_id=0, at_rest=False)
    service.watch.look()
    changer.hear([Changing(5, 1, 2, 0, False)])
    engine.now = engine.now._replace(mode=Mode.HOLD, motion_id=FIRST_MARK - 5, line=3, at_rest=True)
    service.watch.look()
    assert changer.tools == (1, 2)
    service.watch.look()
    _ask(desk, "stop")
    service.watch.look()
    service.watch.look()
    return desk


def test_of_a_change_that_was_interrupted_the_offer_says_which_tool_is_where_and_goes_on_after_it(
    tmp_path: Path,
) -> None:
    desk = interrupted_in_a_change(tmp_path)
    file = str(desk.service.state / "two.ngc")
    offer = _ask(desk, "restart")
    assert not offer["offered"] and offer["change"] and offer["line"] == 3
    assert text(offer["says"]) == "two.ngc was interrupted in the tool change of line 3 (T1 away, T2 in)."
    assert "confirm where the tools are" in text(Message(key=offer["key"], values=offer["values"]))
    step = _ask(desk, "status")["next"]
    assert (step["verb"], step["place"]) == ("changer_confirm", "changer")

    _ask(desk, "changer_confirm", spindle=1, away=[], clear=True)
    offer = _ask(desk, "restart")
    why = text(Message(key=offer["key"], values=offer["values"]))
    assert why.startswith("T1 is in the spindle, and two.ngc goes on with T2")
    with pytest.raises(CommandRefused) as error:
        _ask(desk, "load", path=file, restart=True)
    assert error.value.sentence == why, "loading says what the offer says"
    step = _ask(desk, "status")["next"]
    assert (step["verb"], step["args"]) == ("mdi", {"text": "T2 M6"})

    _ask(desk, "changer_confirm", spindle=2, away=[], clear=True)
    offer = _ask(desk, "restart")
    assert offer["offered"] and offer["tool"] == 2
    assert "after that change, with T2, which is in the spindle" in text(offer["says"])
    step = _ask(desk, "status")["next"]
    assert (step["verb"], step["args"]) == ("load", {"restart": True})
    _ask(desk, "load", path=file, restart=True)
    loaded = desk.service.run.loaded
    assert loaded is not None and loaded.program.spot == Spot(3, 0.0, AFTER_CHANGE)
    again = served(tmp_path, machine())
    assert again.journal.last is not None and again.journal.last.change == (1, 2, 3), (
        "after a loss of power, too"
    )


@pytest.mark.parametrize(("in_spindle", "starts"), [(2, True), (1, False)])
@pytest.mark.parametrize(
    ("change", "left"),
    [
        ("T2 M6", [4, 5]),
        ("T2 M6 G1 X1.5", [3, 4, 5]),  # what the line itself cuts after its change is not left out
        ("T2 M6 S900 M3 G1 X1.5", [3, 4, 5]),
        ("T2 M6 S900 M3", [4, 5]),
    ],
)
def test_after_an_interrupted_change_a_start_is_what_was_offered(
    in_spindle: int, starts: bool, change: str, left: list[int]
) -> None:
    """With the tool that had to come it goes on after the change; with another one it is refused."""
    made = machine()
    task = checked.task(TWO.replace("T2 M6", change).encode(), "two.ngc", made)
    spot = Spot(3, 0.0, AFTER_CHANGE)
    joints = tuple(axis.homing.position for axis in made.axes)
    start = Start(joints, 0.0, spot, joints, in_spindle=in_spindle, begin=None)
    if not starts:
        with pytest.raises(ProgramError, match="T1 is in the spindle"):
            list(starts_of(task, start))
        return
    cut = [chain for chain in starts_of(task, start) if isinstance(chain, ContinuousPath)]
    lines = [one.place.line for chain in cut if (chain.first_id or 0) < ENTRY_ID for one in chain.segments]
    assert lines == left


def starts_of(task: Any, start: Start) -> list[Any]:
    return list(path_from(task, None, start).items)
