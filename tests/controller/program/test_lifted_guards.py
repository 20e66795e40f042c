"""A changer's step that opens what an input guards is no fault; everywhere else the input guards."""

from __future__ import annotations

from support.machines.changer_bench import CHANGER, machine

from controller.machine.model import Machine
from controller.program.output_words import _lifts
from controller.runtime import checked
from controller.runtime.stepped import SteppedMachine
from controller.state.modes import Fault

GUARDED = CHANGER.replace("drawbar_closed", "tool_clamped")  # a step waits for the drawbar's guard itself
# A door that the changer opens and shuts, and a drawbar's guard that no step waits for.
WITH_DOOR = CHANGER.replace("inputs = { ", "inputs = { door = 8, tool_clamped = 9, ").replace(
    "bit1 = 3, ", "bit1 = 3, door_valve = 8, "
)
DOOR_STEP = """[[changer.{sequence}]]
name = "Door {word}"
{switch} = ["door_valve"]
input = "door"
level = "{level}"
within_s = 1
fails = "The door does not move."
"""
OPEN = DOOR_STEP.format(sequence="put_away", word="open", switch="on", level="off")
SHUT = DOOR_STEP.format(sequence="take", word="shut", switch="off", level="on")
WITH_DOOR = WITH_DOOR.replace("[[changer.put_away]]\n", OPEN + "[[changer.put_away]]\n", 1) + SHUT


def lifted(built: Machine, tool_out: int, tool_in: int) -> list[tuple[set[str], set[str]]]:
    """By step the guards that do not count while it waits, and after it."""
    assert built.changer is not None and built.io is not None
    names = {1 << bit: name for name, bit in built.io.inputs}
    rows = _lifts(built.changer, built.io, tool_out, tool_in)
    return [tuple({n for bit, n in names.items() if mask & bit} for mask in row) for row in rows]  # type: ignore[misc]


def test_the_drawbars_guard_is_lifted_from_the_step_that_lets_go_to_the_end_of_the_one_that_grips() -> None:
    built = machine(GUARDED)
    assert built.changer is not None
    steps = [step.name for step in (*built.changer.put_away, *built.changer.take)]
    rows = lifted(built, 1, 2)
    opens, grips = steps.index("Let it go"), steps.index("Grip")
    for k, (during, after) in enumerate(rows):
        assert during == ({"tool_clamped"} if opens <= k <= grips else set()), steps[k]
        assert after == ({"tool_clamped"} if opens <= k < grips else set()), steps[k]


def test_each_guard_is_lifted_by_the_steps_that_move_it_alone() -> None:
    built = machine(WITH_DOOR)
    assert built.changer is not None
    steps = [step.name for step in (*built.changer.put_away, *built.changer.take)]
    rows = lifted(built, 1, 2)
    door = [k for k, (during, _) in enumerate(rows) if "door" in during]
    drawbar = [k for k, (during, _) in enumerate(rows) if "tool_clamped" in during]
    assert door == list(range(steps.index("Door open"), steps.index("Door shut") + 1))
    assert drawbar == list(range(steps.index("Let it go"), steps.index("Grip") + 1))


def test_a_change_goes_through_although_the_guard_goes_off_in_it() -> None:
    built = machine(GUARDED)
    stepped = SteppedMachine(built)
    (node,) = stepped.rig.io.values()
    assert built.io is not None
    guard = built.io.input("tool_clamped")
    assert guard is not None
    seen: set[bool] = set()
    stepped.rig.watchers.append(lambda _: seen.add(bool(node.inputs >> guard & 1)))
    stepped.come_up()
    task = checked.task(b"T2 M6\nG0 X5\nM30\n", "part.ngc", built)
    run = stepped.run(checked.path_of(task))
    assert (run.result, run.fault, seen) == ("completed", Fault.NONE, {False, True})


def test_the_guard_counts_again_once_the_change_is_over() -> None:
    """The tool is lost in the cut."""
    built = machine(GUARDED)
    stepped = SteppedMachine(built)
    stepped.come_up()
    (node,) = stepped.rig.io.values()
    assert built.io is not None
    guard = built.io.input("tool_clamped") or 0
    task = checked.task(b"T2 M6\nG1 X20 F60\nM30\n", "part.ngc", built)

    def lose(_: float) -> None:
        if stepped.cycle.follow.line == 2 and stepped.cycle.follow.feed > 0.0:
            node.unwire(guard)
            node.set_inputs(node.inputs & ~(1 << guard), stepped.rig.now_s)

    stepped.rig.watchers.append(lose)
    assert stepped.run(checked.path_of(task)).fault is Fault.CLAMP
