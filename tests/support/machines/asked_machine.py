"""A stepped machine of which anything is asked at any tick; what it answers to each request is kept."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from support.machines.spindle_machine import SPINDLE, mill

from controller.ipc.handoff import Jog, Outcome, Snapshot, send_jog
from controller.machine import machine_file
from controller.messages import Message
from controller.plan.planner import Planner
from controller.plan.restart.program_position import Spot
from controller.plan.restart.reentry import NotPossible
from controller.program.program import ProgramError
from controller.runtime import checked, starts
from controller.runtime.starts import Start
from controller.runtime.stepped import SteppedMachine
from controller.state import modes as state
from controller.state.modes import ALL_AXES, Fault, Mode, Request
from controller.tick.mode import Phase

PERIOD_S = 0.005
PLAN_TURN = 2  # ticks
TOLD_TICKS = 20  # in which the tick has a way off the path, or back
IO = """
[io]
bus = "can1"
node = 11
outputs = { coolant = 0, mist = 1, clamp_A = 2, clamp_C = 3 }
digital_in = ["loader"]

[io.inputs]
estop = 0
door = 1
clamp_A_closed = 2
clamp_C_closed = 3
feed_stop = 4
loader = 5
"""
FEED_STOP, LOADER = 4, 5
CLAMPS = (0, 8, 16, 24)  # of A, C and both, as bits of the axes
TEXT = """G21 G90 G54 T2 M6
S3000 M3
G0 X5. Y0. Z120.
G1 X15. F2000.
M0
M49
G1 X-5. A4.
M48
G4 P0.1
M1
G1 X-2.
M53
G1 X-4.
M66 P0 L3 Q0.3
T1 M6
S3000 M3
G1 X0. A0.
M5
M30
"""


@dataclass(slots=True)
class Taken:
    """One request as the tick took it."""

    request: Request
    before: Mode
    after: Mode
    refusal: Message | None  # that it must have
    sound: bool  # its value is one


@dataclass
class AskedMachine:
    """It lives as its plan does (``plan_lives``), and notes what is ``asked``, ``taken`` and answered."""

    bench: SteppedMachine = field(init=False)
    answers: dict[int, list[tuple[Outcome, Fault]]] = field(default_factory=dict)
    answered: dict[int, int] = field(default_factory=dict)  # number -> tick
    taken: dict[int, Taken] = field(default_factory=dict)
    asked: dict[int, int] = field(default_factory=dict)  # number -> tick
    plan_lives: bool = True

    def __post_init__(self) -> None:
        self.machine = machine_file.with_period(mill(SPINDLE, IO), PERIOD_S)
        self.bench = SteppedMachine(self.machine)
        self.bench.come_up()
        task = checked.task(TEXT.encode(), "part.ngc", self.machine)
        self.task, self.choices = task, checked.chosen_for(task)
        self._listen()

    # -- what the tick says and does

    def _listen(self) -> None:
        cycle = self.bench.cycle
        give, request = cycle.answers.give, cycle._request

        def given(number: int, came: Outcome, why: int = 0) -> None:
            self.answers.setdefault(number, []).append((came, Fault(why)))
            self.answered[number] = cycle.tick
            give(number, came, why)

        def requested(asked: Request, value: float) -> None:
            number, before = cycle._requests.number, cycle.modes.mode
            jog = cycle._requests.jog
            known = self._refusal(asked), self._is_sound(asked, value, jog, before)
            request(asked, value)
            self.taken[number] = Taken(asked, before, cycle.modes.mode, *known)

        cycle.answers.give = given  # type: ignore[method-assign]
        cycle._request = requested  # type: ignore[method-assign]

    def _refusal(self, request: Request) -> Message | None:
        cycle = self.bench.cycle
        modes, follow = cycle.modes, cycle.follow
        standing = follow.at_rest and not (request is Request.JOG and follow.stopping)
        if request is Request.RESET and modes.phase is Phase.QUICK_STOPPED:
            standing = True
        return state.refusal(
            modes.mode,
            request,
            standing=standing,
            homed=ALL_AXES & ~modes.untrusted,
            untrusted=modes.untrusted,
            interlock=modes.interlock,
            away=cycle.jogging.away,
            axes=[axis.name for axis in self.machine.axes],
        )

    def _is_sound(self, request: Request, value: float, jog: Jog | None, mode: Mode) -> bool:
        if request in (Request.OVERRIDE, Request.RAPID_OVERRIDE):
            return 0.0 <= value <= 2.0
        if request in (Request.SINGLE_BLOCK, Request.OPTIONAL_STOP, Request.ADAPTIVE_FEED):
            return value in (0.0, 1.0)
        if request is Request.SPINDLE_OVERRIDE:
            return 0.5 <= value <= 1.5
        if request is Request.SPINDLE:
            return self.machine.spindle is not None and abs(value) <= self.machine.spindle.max_rev_min
        if request in (Request.COOLANT, Request.START):
            return value in range(4)
        if request is Request.CLAMPS:
            return value in CLAMPS
        if request is Request.PREPARE:
            return False  # there is no changer that prepares
        if request is Request.HOME:
            return value in range(1, ALL_AXES + 1)
        if request is Request.JOG and jog is not None:
            return self.bench.cycle.jogging._is_possible(jog, mode)
        return True

    # -- what is done

    def ticks(self, count: int) -> None:
        for _ in range(count):
            if self.plan_lives and self.bench.cycle.tick % PLAN_TURN == 0:
                self.bench._plan()
            self.bench.tick()

    def ask(self, request: Request, value: float = 0.0) -> int:
        number = self.bench.request(request, value)
        self.asked[number] = self.bench.cycle.tick
        return number

    def jog(self, line: Jog) -> int:
        number = next(self.bench._numbers)
        send_jog(self.bench._operator, line, number)
        self.asked[number] = self.bench.cycle.tick
        return number

    def arm(self, spot: Spot | None = None) -> None:
        """As the service does it: in READY, from where the axes stand, to the top or to ``spot``."""
        bench, follow = self.bench, self.bench.cycle.follow
        if not (self.mode is Mode.READY and follow.at_rest and self.plan_lives):
            return
        if spot is None:
            walk = checked.path_of(replace(self.task, start=bench.joints), self.choices, in_spindle=2)
            items = walk.items
        else:
            start = Start(bench.joints, follow.tau, spot, in_spindle=2)
            try:
                items = starts.rest(self.task, self.choices, start).entered(start.joints, start.in_spindle)
            except ProgramError:
                return
        bench.planner.load(items, follow.queue_end_s, follow.epoch)
        self.ticks(4)

    def leave_path(self, back: bool, by_mm: float) -> None:
        """A way off the path, or back: planned, and gone when the tick has it."""
        planner = self.bench.planner
        try:
            if back:
                planner.go_back(self.now)
            else:
                planner.retract(self.now, by_mm)
        except NotPossible:
            return
        for _ in range(TOLD_TICKS):
            if planner.is_path_accepted(self.now):
                break
            self.ticks(1)
        self.ask(Request.RESUME)

    def plan_anew(self) -> None:
        """Another process of the plan, which knows of no program and counts on."""
        bench, now = self.bench, self.now
        bench.planner = Planner(self.machine, bench.kinematics, bench.outbox.send)
        bench.planner.go_on_from(max(now.accepted, now.rejected))
        self.plan_lives = True

    def input(self, number: int, on: bool) -> None:
        self.bench.rig.io["io"].set_input(number, on, self.bench.rig.now_s)

    @property
    def now(self) -> Snapshot:
        found = self.bench.board.read()
        assert found is not None
        return found

    @property
    def mode(self) -> Mode:
        return self.bench.cycle.modes.mode
