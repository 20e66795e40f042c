"""The mill of the fault matrix: spindle, inputs and clamps that fail, in every mode."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

from support.faults.cases import NOTHING, Case, of, only, script
from support.faults.scene import JOG, Scene, with_homing
from support.machines.spindle_machine import IO, SPINDLE, mill

from controller.machine.model import Machine
from controller.runtime.events import Event
from controller.state.modes import FAULTS, Fault, Reaction, Request

INPUTS = {"estop": 0, "door": 1, "clamp_A_closed": 2, "clamp_C_closed": 3, "power": 4, "tool_clamped": 5}
MORE_IO = IO.replace("clamp_C_closed = 3 }", "clamp_C_closed = 3, power = 4, tool_clamped = 5 }")
JOG_START = JOG.partition("Y")[0]

F = Fault


def machine() -> Machine:
    """The mill, with drives that move when they home."""
    return with_homing(mill(SPINDLE, MORE_IO))


class MillScene(Scene):
    """An operator who closes the door again, and resumes what was held for it."""

    def __init__(self, recordings: Path) -> None:
        super().__init__(recordings, of=machine())
        self.goes_on_s = 1.0  # a spindle may sag for half of that

    def run_text(self, text: str) -> None:
        """With the spindle on, and coolant, where something is cut."""
        first, _, rest = text.partition("\n")
        super().run_text(text if text.startswith(JOG_START) else f"{first}\nS6000 M3 M8\n{rest}")

    def input(self, name: str, on: bool) -> None:
        self.rig.io["io"].set_input(INPUTS[name], on, self.rig.now_s)

    def _goes_on(self, waiting: Sequence[Event], asked: bool) -> bool:
        modes = self.cycle.modes
        if FAULTS[modes.fault].reaction is not Reaction.HOLD or self.resumed_s < math.inf:
            return super()._goes_on(waiting, asked)
        after, self.resumed_s = self.after_tick, self.rig.now_s
        self.heal()
        self.after_tick = after
        self.request(Request.RESUME)
        return True

    def heal(self) -> None:
        node = self.rig.io["io"]
        for name in ("estop", "door", "power", "tool_clamped"):
            self.input(name, True)
        for wire in node._wires:
            node._pull(wire, self.rig.now_s)
        super().heal()


def opened(name: str) -> Callable[[Scene], None]:
    """An input goes to 0."""

    def strike(scene: Scene) -> None:
        assert isinstance(scene, MillScene)
        scene.input(name, False)

    return strike


def clamp_says_closed(scene: Scene) -> None:
    """The switch of the clamp of A, open for the cut."""
    scene.rig.io["io"].set_input(INPUTS["clamp_A_closed"], True, scene.rig.now_s)


AT_REST = only(("homing", "idle", "jog"), NOTHING)
CASES: tuple[Case, ...] = (
    Case("emergency-stop input", opened("estop"), of(F.ESTOP_INPUT)),
    Case("power lost", opened("power"), of(F.POWER_LOST)),
    Case("door opened", opened("door"), of(F.DOOR_OPEN), only(("idle",), NOTHING)),
    Case("tool not clamped", opened("tool_clamped"), of(F.CLAMP), only(("idle",), NOTHING)),
    Case("rotary clamp closes", clamp_says_closed, of(F.CLAMP), AT_REST | only(("hold",), NOTHING)),
    Case("spindle drive silent", script("silence spindle for 900 ms"), of(F.SPINDLE_LOST)),
    Case(
        "spindle loses its speed",
        script("falsify tpdo spindle byte 4 xor 10 x 200"),
        of(F.SPINDLE_NOT_AT_SPEED),  # in a rapid too: there it turns and must not
        only(("homing", "idle", "hold"), NOTHING),
    ),
    Case("input node silent", script("silence io for 900 ms"), of(F.IO_LOST)),
)
