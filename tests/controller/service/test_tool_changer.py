"""A tool changer: nothing moves that its journal does not know, and no tool is lost in what it knows."""

from __future__ import annotations

import contextlib
import random
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from collections import Counter
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_engine import served
from support.machines.changer_bench import CHANGER, LONGEST, ChangerBench, change, machine

from controller.ipc.control_socket import CommandRefused
from controller.machine import machine_file
from controller.machine.toml_table import ConfigError
from controller.machine.tool_store import Step, ToolStore, placed
from controller.program import blocks
from controller.program.program import ProgramError
from controller.runtime import checked
from controller.runtime.stepped import SteppedMachine
from controller.service.command_handlers import Desk


def _changes(folder: Path, seed: int, count: int) -> Counter[str]:
    print(f"seed {seed}")
    bench, random_ = ChangerBench(folder), random.Random(seed)
    bench.confirm()
    came = Counter(change(bench, random_) for _ in range(count))
    bench.store.close()
    return came


def test_no_tool_is_lost_and_nothing_moves_on_a_guess(tmp_path: Path) -> None:
    came = _changes(tmp_path, 18, 12)
    assert came["sound: done"] and any(one.endswith("doubted") for one in came), came


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_a_thousand_changes(tmp_path: Path, seed: int) -> None:
    came = _changes(tmp_path, seed, 50)
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


def test_where_tools_are_must_be_confirmed_once(tmp_path: Path) -> None:
    bench = ChangerBench(tmp_path)
    joints = bench.stepped.joints
    bench.begin("T2 M6")
    bench.go(LONGEST)
    assert bench.stepped.joints == joints and bench.alarms[-1][0] == "CHANGE_REFUSED"


_WRITER = """
import sys
from pathlib import Path
from controller.machine.tool_store import Step, ToolStore
store, spindle = ToolStore(Path(sys.argv[1])), 0
print("begun", flush=True)
while True:
    for tool in (1, 2, 3):
        store.begin(Step(0, tool, 0, "take", tool, 0))
        store.begin(Step(tool, 0, 1, "put away", tool, tool))
        store.end()
"""


def test_a_store_whose_writer_is_killed_knows_every_tool(tmp_path: Path) -> None:
    file = tmp_path / "tools.db"
    store = ToolStore(file)
    store.confirm(placed((1, 2, 3), 0, ()))
    store.close()
    for k in range(3):
        writer = subprocess.Popen([sys.executable, "-c", _WRITER, str(file)], stdout=subprocess.PIPE)
        assert writer.stdout is not None and writer.stdout.readline()
        time.sleep(0.02 + 0.013 * k)
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        store = ToolStore(file)
        places, step = store.places, store.step
        assert set(places) == {1, 2, 3}
        for tool, pocket in places.items():
            assert pocket in (0, tool)
            assert pocket == tool or (step is not None and step.carries == tool)
        store.confirm(placed((1, 2, 3), 0, ()))
        store.close()


def test_who_asks_where_the_tools_are_waits_for_no_writer_and_sees_only_what_is_kept(tmp_path: Path) -> None:
    store = ToolStore(tmp_path / "tools.db")
    store.confirm(placed((1, 2, 3), 2, ()))
    asked = list[object]()

    def ask() -> None:
        asked.extend((store.spindle, store.step, dict(store.places)))

    with contextlib.suppress(sqlite3.IntegrityError), store._whole():
        store._db.execute("DELETE FROM place")
        asking = threading.Thread(target=ask, daemon=True)
        asking.start()
        asking.join(30.0)
        raise sqlite3.IntegrityError
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
    made = blocks.read(b"T1 M6\n", machine(), "p.ngc").blocks
    assert len(made) == 1


def test_simulated_the_steps_are_no_stops_of_the_program() -> None:
    stepped = SteppedMachine(machine())
    stepped.come_up()
    path = checked.path_of(checked.task(b"T2 M6\nG0 X5\nM0\nT1 M6\nM30\n", "p.ngc", machine()))
    run = stepped.run(path)
    assert (run.result, run.assumed_resumes) == ("completed", 1)


# -- as the door has it


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(served(tmp_path, machine()))


def _ask(desk: Desk, verb: str, **args: Any) -> Any:
    answer = desk(verb, args)
    return answer.result(10.0) if isinstance(answer, Future) else answer


@pytest.mark.parametrize("verb", ["mdi", "home"])
def test_nothing_is_begun_before_the_tools_are_confirmed(desk: Desk, verb: str) -> None:
    with pytest.raises(CommandRefused, match="has not been confirmed yet"):
        _ask(desk, verb, text="G0 X1")
    assert any(one["name"] == "CHANGER_IN_DOUBT" for one in _ask(desk, "status")["notices"])


def test_what_is_confirmed_is_told(desk: Desk) -> None:
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
        ({"clear": True}, "not in the tool table"),
    ],
)
def test_a_guess_is_not_taken(desk: Desk, args: dict[str, Any], says: str) -> None:
    with pytest.raises(CommandRefused, match=says):
        _ask(desk, "changer_confirm", **args)
    assert _ask(desk, "changer")["spindle"] is None


def test_a_pocket_that_is_given_away_is_looked_at_anew(desk: Desk) -> None:
    _ask(desk, "changer_confirm", spindle=0, clear=True)
    told = _ask(desk, "changer_pocket", pocket=1, tool=3)
    assert [row["tool"] for row in told["pockets"]] == [3, 2, None] and told["doubt"] is not None
    with pytest.raises(CommandRefused, match="pocket 9"):
        _ask(desk, "changer_pocket", pocket=9, tool=3)
