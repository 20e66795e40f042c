"""A machine with a tool changer on the stepped clock, its magazine with a truth of its own, and its journal.

The magazine knows nothing of the journal: a drawbar that opens lets the tool go, into the pocket that stands
there or, where none does, to the floor (``dropped``); one that closes grips what is there. Switches hang,
valves stick, and the power goes, as the test says.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from support.machines.stored_tools import StoredTools

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.messages import message, text
from controller.motion.pieces import STANDSTILL
from controller.plan.segment import PathItem, Pause
from controller.runtime import checked, starts
from controller.runtime.starts import Start
from controller.runtime.stepped import SteppedMachine
from controller.service.tool_changer import ToolChanger
from controller.state.modes import Fault, Mode, Request
from controller.store.tool_store import SPINDLE, placed
from drives.bench.simulated.io_node import IoNode

CHANGER = """
[io]
node = 20
inputs = { estop = 0, drawbar_open = 1, drawbar_closed = 2, there = 3 }
outputs = { coolant = 0, drawbar = 1, bit0 = 2, bit1 = 3, turn = 4 }

[changer]
pockets = [1, 2, 3]

[[changer.put_away]]
name = "Drawbar closed"
off = ["drawbar"]
input = "drawbar_closed"
level = "on"
within_s = 1
fails = "The drawbar is not closed."
[[changer.put_away]]
name = "Magazine free"
off = ["turn"]
input = "there"
level = "off"
within_s = 1
fails = "The magazine still stands locked."
[[changer.put_away]]
name = "Z up"
move_mm = { Z = 255 }
within_s = 20
fails = "Z does not come up."
[[changer.put_away]]
name = "Magazine to the pocket"
pocket = ["bit0", "bit1"]
on = ["turn"]
input = "there"
within_s = 1
fails = "The magazine does not come to the pocket."
[[changer.put_away]]
name = "Over the pocket"
move_mm = { X = [-10, -12, -14] }
within_s = 20
fails = "X does not come to the pocket."
[[changer.put_away]]
name = "Let it go"
on = ["drawbar"]
input = "drawbar_open"
within_s = 1
fails = "The drawbar does not open: look at the air."
carries = true
[[changer.put_away]]
name = "Magazine away"
move_mm = { Z = 260 }
off = ["turn"]
input = "there"
level = "fall"
within_s = 1
fails = "The magazine still stands locked."

[[changer.take]]
name = "Magazine free"
off = ["turn"]
input = "there"
level = "off"
within_s = 1
fails = "The magazine still stands locked."
[[changer.take]]
name = "Drawbar open"
on = ["drawbar"]
input = "drawbar_open"
level = "on"
within_s = 1
fails = "The drawbar is not open."
[[changer.take]]
name = "Magazine to the new pocket"
pocket = ["bit0", "bit1"]
on = ["turn"]
input = "there"
within_s = 1
fails = "The magazine does not come to the pocket."
[[changer.take]]
name = "Over it"
move_mm = { X = [-10, -12, -14], Z = 255 }
within_s = 20
fails = "X does not come to the pocket."
[[changer.take]]
name = "Grip"
off = ["drawbar"]
input = "drawbar_closed"
within_s = 1
fails = "The drawbar does not close."
carries = true
[[changer.take]]
name = "Away"
move_mm = { X = 0 }
off = ["turn"]
input = "there"
level = "fall"
within_s = 1
fails = "The magazine still stands locked."
"""

_AWAY, *_TAKE = re.split(r"(?=\[\[changer\.take\]\])", CHANGER)
# The same magazine puts tools away; a second arm brings the pocket of the next one beside the cut.
BESIDE = (
    _AWAY.replace("turn = 4", "turn = 4, arm0 = 5, arm1 = 6, swing = 7").replace(
        "there = 3", "there = 3, ready = 4"
    )
    + _TAKE[1]  # drawbar open
    + """[[changer.take]]
name = "Over the arm"
move_mm = { X = -16, Z = 255 }
within_s = 20
fails = "X does not come to the arm."
"""
    + _TAKE[4]  # grip
    + """[[changer.take]]
name = "Away"
move_mm = { X = 0 }
off = ["swing"]
input = "ready"
level = "fall"
within_s = 1
fails = "The arm does not swing back."

[[changer.prepare]]
name = "Arm back"
off = ["swing"]
input = "ready"
level = "off"
within_s = 1
fails = "The arm is not back."
[[changer.prepare]]
name = "Pocket to the arm"
pocket = ["arm0", "arm1"]
on = ["swing"]
input = "ready"
within_s = 1
fails = "The pocket does not come to the arm."
"""
)
TOOLS = (1, 2, 3)
PLACES_MM = (-10.0, -12.0, -14.0)  # X of the pockets ...
ARM_MM = -16.0  # ... and of the arm
TAKES_S = 0.04  # a valve, a magazine
LOOK_TICKS = 2
LONGEST = 3000  # ticks that a change may take, whatever fails
WORN = {"cut": 60.0, "way": 12.5, "parts": 3}
SWITCHES = ("drawbar_open", "drawbar_closed", "there", "ready")


def machine(changer: str = CHANGER) -> Machine:
    shipped = machine_file.load("trunnion").text
    slow = re.sub(r"^period_s = [^\n]*", "period_s = 0.01", shipped, flags=re.M)
    return machine_file.read(slow + changer, "m.toml")


@dataclass
class Magazine:
    """The truth: where every tool is, whatever anybody believes."""

    machine: Machine
    places: dict[int, int]  # tool: its pocket, 0 = the spindle
    at: int = 0  # the pocket that stands under the spindle, 0 = none
    arm: int = 0  # the pocket that the arm holds out, 0 = none
    dropped: set[int] = field(default_factory=set)
    hangs: dict[str, bool] = field(default_factory=dict)  # switches, and what they show
    stuck: bool = False  # the drawbar's valve: nothing comes of what it is told
    changed: int = 0  # of outputs
    _node: IoNode | None = None
    _before: int = 0

    def __post_init__(self) -> None:
        io = self.machine.io
        assert io is not None
        self._out, self._in = dict(io.outputs), dict(io.inputs)

    def around(self, node: IoNode, x_mm: object) -> None:
        """It stands around this node; ``x_mm()`` tells where the spindle is."""
        self._node, self._x_mm, self._before = node, x_mm, node.outputs
        for name in self.switches:
            node.unwire(self._in[name])
        node.watchers.append(self._switch_outputs)
        self._show(node.now_s)
        self._switch_outputs(node.outputs, node.now_s)

    def _switch_outputs(self, word: int, now_s: float) -> None:
        node, changed, self._before = self._node, word ^ self._before, word
        assert node is not None
        self.changed += 1
        for name, what in (("turn", self._turn), ("drawbar", self._draw), ("swing", self._swing)):
            if name in self._out and changed >> self._out[name] & 1:
                node.alarm(f"magazine {name}", now_s + TAKES_S, what)

    def _on(self, name: str) -> bool:
        assert self._node is not None
        return bool(self._node.outputs >> self._out[name] & 1)

    def _turn(self, now_s: float) -> None:
        self.at = self._on("bit0") + 2 * self._on("bit1") if self._on("turn") else 0
        self._show(now_s)

    def _swing(self, now_s: float) -> None:
        self.arm = self._on("arm0") + 2 * self._on("arm1") if self._on("swing") else 0
        self._show(now_s)

    @property
    def switches(self) -> list[str]:
        return [name for name in SWITCHES if name in self._in]

    def _under(self) -> int:
        """The pocket over which the spindle stands."""
        x_mm: float = self._x_mm()  # type: ignore[operator]
        if self.arm and abs(x_mm - ARM_MM) < 0.01:
            return self.arm
        return self.at if self.at and abs(x_mm - PLACES_MM[self.at - 1]) < 0.01 else 0

    def _draw(self, now_s: float) -> None:
        if not self.stuck:
            self._drawn(self._on("drawbar"))
            self._show(now_s)

    def _drawn(self, opens: bool) -> None:
        """By its valve to open it, by its spring to close it."""
        self.open = opens
        held = next((tool for tool, pocket in self.places.items() if pocket == SPINDLE), 0)
        under = self._under()
        there = next((tool for tool, pocket in self.places.items() if pocket == under), 0) if under else 0
        if self.open and held:
            if under and not there:
                self.places[held] = under
            else:
                self.dropped.add(held)
        elif not self.open and not held and there:
            self.places[there] = SPINDLE

    open: bool = False

    def _show(self, now_s: float) -> None:
        assert self._node is not None
        for name, on in (
            ("drawbar_open", self.open),
            ("drawbar_closed", not self.open),
            ("there", self.at > 0),
            ("ready", self.arm > 0),
        ):
            if name not in self._in:
                continue
            self._node.set_input(self._in[name], self.hangs.get(name, on), now_s)

    def hang(self, name: str, on: bool) -> None:
        """A switch shows this from now on, whatever becomes of it."""
        assert self._node is not None
        self.hangs[name] = on
        self._show(self._node.now_s)

    def repair(self) -> None:
        """All switches and valves do as they should."""
        self.hangs.clear()
        assert self._node is not None
        if self.stuck and self.open is not self._on("drawbar"):
            self._drawn(not self.open)
        self.stuck = False
        self._show(self._node.now_s)

    def without_power(self) -> None:
        """The spring closes the drawbar on what is there; then the magazine goes back by its own."""
        if self.open:
            self._drawn(False)
        self.at = self.arm = 0


class ChangerBench:
    """Changes tools, is killed and asked what it knows."""

    def __init__(self, folder: Path, changer: str = CHANGER) -> None:
        self.machine = machine(changer)
        self.folder = folder
        self.magazine = Magazine(self.machine, {tool: tool for tool in TOOLS})
        self.alarms: list[tuple[str, str]] = []
        self.worn: set[int] = set()
        self.power_up()
        self.restart_service()

    # -- what dies, and comes again

    def power_up(self) -> None:
        """Everything anew but the magazine."""
        self.stepped = SteppedMachine(self.machine)
        node = next(iter(self.stepped.rig.io.values()))
        self.magazine.around(node, lambda: self.stepped.joints[0])
        self.stepped.come_up()

    def restart_service(self) -> None:
        """As after a SIGKILL: nothing is told to anybody, and what is on the disk is all that is known."""
        self.store = StoredTools(self.folder)
        self.changer = ToolChanger(
            self.store,
            lambda: self.machine.changer,  # type: ignore[arg-type, return-value]
            self.stepped,  # type: ignore[arg-type]
            lambda name, what: self.alarms.append((name, text(what))),
            self.machine.period_s,
            lambda tool: message("change_worn", **WORN, number=tool) if tool in self.worn else None,
            self.machine.io,
        )

    def die(self, without_power: bool) -> None:
        """SIGKILL of plan and service; the tick comes to rest by itself, unless its power goes, too."""
        self.store.close()
        if without_power:
            self.magazine.without_power()
            self.power_up()
        else:
            self._come_to_rest()
        self.restart_service()

    def confirm(self) -> None:
        """The operator looks, and says what he sees."""
        spindle = next((tool for tool, pocket in self.magazine.places.items() if pocket == SPINDLE), 0)
        assert self.machine.changer is not None
        self.store.confirm(placed(self.machine.changer.pockets, spindle, ()))

    # -- one change

    _cuts = False  # before M6
    moves_between = False  # the program has motions of its own between changes

    @property
    def cutting(self) -> bool:
        """In the program's first motion, before M6: what switches is a preparation."""
        now = self.stepped.board.read()
        return self._cuts and now is not None and now.motion_id in (STANDSTILL, 0) and self.store.step is None

    def _heard(self, items: Iterable[PathItem]) -> Iterator[PathItem]:
        for item in items:
            if isinstance(item, Pause) and item.changing is not None:
                self.changer.hear((item.changing,))
            yield item

    def begin(self, program: str) -> None:
        stepped, follow = self.stepped, self.stepped.cycle.follow
        spindle = self.store.spindle or 0
        task = checked.task(program.encode(), "MDI", self.machine)
        start = Start(stepped.joints, follow.queue_end_s, in_spindle=spindle, typed=True, unchecked=True)
        self.changer.arm()
        self._cuts = "G1" in program
        stepped.begin(checked.Walk(self._heard(starts.path_from(task, None, start).items)))

    def go(self, ticks: int) -> str:
        """Look on: "done", "held" (a step fails) or "refused"; "" when the ticks are over."""
        stepped = self.stepped
        for _ in range(max(1, ticks // LOOK_TICKS)):
            before, switched = stepped.joints, self.magazine.changed
            stepped.go(LOOK_TICKS)
            now = stepped.board.read()
            assert now is not None
            moved = stepped.joints != before or self.magazine.changed != switched
            self.never_lost()
            if moved and now.mode is Mode.RUNNING and not (self.cutting or self.moves_between):
                self.check_step_is_stored()
            if self.magazine.changed != switched and self.cutting:
                assert self.store.preparation is not None, "it switches what the disk does not know"
            self.changer.look(now)
            if now.mode is Mode.READY:
                self.changer.ended()
                return "done" if self.store.step is None else "refused"
            if now.mode is Mode.HOLD and (now.fault is Fault.INPUT_MISSING or self.changer.to_json()["held"]):
                return "held"
        return ""

    def stop(self) -> None:
        self._come_to_rest()
        self.changer.ended()

    def _come_to_rest(self) -> None:
        self.stepped.planner.drop()
        self.stepped.request(Request.STOP)
        self.stepped.go(LONGEST, lambda: self.stepped.cycle.modes.mode is Mode.READY)
        self.stepped.go(LOOK_TICKS)

    def resume(self) -> None:
        now = self.stepped.board.read()
        assert now is not None
        self.changer.resume(now)
        self.stepped.go(LOOK_TICKS)

    # -- what must hold at any time

    def never_lost(self) -> None:
        """Where a tool really is, the store has it, or says that it may be there."""
        assert not self.magazine.dropped
        if not self.store.known:
            return
        unsure, places = self.changer.whereabouts.unsure, self.store.places
        for tool, real in self.magazine.places.items():
            may = {SPINDLE, unsure[tool]} if tool in unsure else {places.get(tool)}
            assert real in may, (tool, real, self.store.step, places)

    def check_step_is_stored(self) -> None:
        """Nothing moves in a step that is not known to the disk."""
        assert self.store.known
        assert self.store.step is not None


def change(bench: ChangerBench, random_: random.Random) -> str:
    """One change of whatever comes, and after it what an operator does; what became of it."""
    tool = random_.choice([one for one in (0, *TOOLS) if one != (bench.store.spindle or 0)])
    what = random_.choice(("sound", "fails", "fails", "killed", "killed", "without power"))
    beside = bool(bench.machine.changer and bench.machine.changer.prepare)
    bench.begin(f"T{tool}\nG1 X{random_.randrange(1, 30)} F3000\nM6" if beside else f"T{tool} M6")
    bench.changer.beside.name(tool)
    if what == "sound":
        came = bench.go(LONGEST)
    elif what == "fails":
        came = _failing(bench, random_)
    else:
        came = bench.go(random_.randrange(LOOK_TICKS, 220))
        bench.die(what == "without power")
    bench.never_lost()
    if bench.changer.doubt is not None:
        came = "doubted"
        nothing_moves(bench)
        bench.confirm()
    assert bench.changer.doubt is None
    return f"{what}: {came}"


def _failing(bench: ChangerBench, random_: random.Random) -> str:
    bench.go(random_.randrange(LOOK_TICKS, 180))
    fails_somehow(bench, random_)
    came = bench.go(LONGEST)
    if came == "held" and random_.random() < 0.5:
        bench.magazine.repair()
        bench.resume()
        came = bench.go(LONGEST)
    if came == "held":
        bench.stop()
    bench.magazine.repair()
    return came


def nothing_moves(bench: ChangerBench) -> None:
    """A change that is asked for in doubt is refused where it stands."""
    joints, switched = bench.stepped.joints, bench.magazine.changed
    bench.begin("T0 M6" if bench.store.spindle else "T1 M6")
    bench.go(LONGEST)
    assert bench.alarms[-1][0] == "CHANGE_REFUSED"
    assert (bench.stepped.joints, bench.magazine.changed) == (joints, switched)


def fails_somehow(bench: ChangerBench, random_: random.Random) -> None:
    """A switch hangs, on or off, or the drawbar's valve sticks."""
    if random_.random() < 0.2:
        bench.magazine.stuck = True
    else:
        bench.magazine.hang(random_.choice(bench.magazine.switches), random_.random() < 0.5)
