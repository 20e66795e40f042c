"""Sequences of requests at random against a stepped machine: each is answered once, and there is a way out.

    PYTHONPATH=.:tests python -m support.machines.request_sequences 100000 [SEED]

Whatever an operator, a plan or a wire may ask is asked at any tick, sound or not, one by one and in bursts:
all that ``Request`` has, with a program that is armed from its top or from a place inside of it, ways off
the path and back, inputs that open and close, and a plan that dies and is started anew. What must hold:

* every request is answered by the tick exactly once, within ``ANSWER_TICKS``;
* one that is refused changed nothing and has a sentence of ``state.refusal``; one that is done had none;
* from whatever came of it what an operator is told to do leads to READY, within ``WAY_OUT_TICKS``.
"""

from __future__ import annotations

import math
import random
import sys
import time
from collections.abc import Callable
from typing import Any

from support.machines.asked_machine import FEED_STOP, LOADER, AskedMachine
from support.machines.spindle_machine import DOOR, ESTOP

from controller.ipc.handoff import Jog, Outcome
from controller.plan.restart.program_position import Spot
from controller.runtime.startup import SessionError
from controller.state.modes import ALWAYS, FAULTS, TRANSITIONS, Fault, Mode, Recovery, Request
from controller.tick.mode import Phase
from drives.commission import CommissionError

LENGTH = (1, 12)  # requests in a sequence
GAP = (0, 60)  # ticks between two of them
ANSWER_TICKS = 400  # homing is answered when the clamps of its axes are open
WAY_OUT_TICKS = 12_000  # a minute, most of it homing
BURST = 20  # requests, more than a tick takes
LINES = (4, 7, 11, 13, 17, 99)  # of the program: with a motion, and one that is not there
ASKED = (
    *(Request.START, Request.HOLD, Request.RESUME, Request.JOG, Request.JOG_STOP) * 4,
    *(Request.STOP,) * 2,
    *(Request.OVERRIDE, Request.RAPID_OVERRIDE, Request.SINGLE_BLOCK, Request.OPTIONAL_STOP) * 2,
    *(Request.ENABLE, Request.DISABLE, Request.RESET, Request.HOME) * 2,
    *(Request.ESTOP, Request.PLAN_LOST),
    *(
        Request.ADAPTIVE_FEED,
        Request.SPINDLE_OVERRIDE,
        Request.SPINDLE,
        Request.COOLANT,
        Request.CLAMPS,
        Request.PREPARE,
    ),
)
DIRECTIONS = (
    *((1.0, 0.0, 0.0, 0.0, 0.0), (0.0, -1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0, 0.0)),
    *((0.0, 0.0, 0.0, 1.0, 0.0), (0.6, 0.8, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0)),
    (math.nan, 0.0, 0.0, 0.0, 0.0),
)


class NotSo(AssertionError):
    """What does not hold, with the sequence that shows it."""


class Site(AskedMachine):
    """A machine, of which anything is asked by chance."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__()
        self.rng = rng
        self.told: list[str] = []

    # -- a sequence

    def sequence(self) -> None:
        """Asked, answered, and out of it again. Raises NotSo."""
        self.told.clear()
        self.answers.clear()
        self.taken.clear()
        self.asked.clear()
        if self.rng.random() < 0.5:
            self._say("arm", self.arm)
            if self.rng.random() < 0.7:
                self._make_request(Request.START)
                self.ticks(self.rng.randint(*GAP))
        for _ in range(self.rng.randint(*LENGTH)):
            self._something()
            self.ticks(self.rng.randint(*GAP) if self.rng.random() < 0.7 else 0)
        self._let_go()
        self.ticks(2)
        self._way_out()
        self._judge()

    def _say(self, what: str, act: Callable[[], Any]) -> None:
        self.told.append(f"tick {self.bench.cycle.tick} in {self.mode.name}: {what}")
        act()

    def _something(self) -> None:
        chance, choice = self.rng.random(), self.rng.choice
        if chance < 0.04:
            self._say("arm", self.arm)
        elif chance < 0.06:
            spot = Spot(choice(LINES), choice((0.0, 0.4, 1.0)))
            self._say(f"arm from {spot.line}, {spot.fraction}", lambda: self.arm(spot))
        elif chance < 0.11:
            number, on = choice((DOOR, ESTOP, FEED_STOP, FEED_STOP, LOADER)), choice((False, True))
            self._say(f"input {number} {on}", lambda: self.input(number, on))
        elif chance < 0.12:
            self._say("the plan dies", lambda: setattr(self, "plan_lives", False))
        elif chance < 0.13:
            self._say("another plan", self.plan_anew)
        elif chance < 0.14:
            noise = bytes((choice((0, 7, 99, 200)), *self.rng.randbytes(choice((0, 5, 30)))))
            self._say(f"noise {noise.hex()}", lambda: self.bench._operator.send(noise))
        elif chance < (0.40 if self.mode is Mode.HOLD else 0.16):
            aside = self.bench.planner.aside is not None
            back, by_mm = aside is (self.rng.random() < 0.9), choice((0.5, 4.0, 4.0, 1e4))
            self._say(f"{'return' if back else 'retract'} {by_mm}", lambda: self.leave_path(back, by_mm))
        else:
            for _ in range(BURST if chance > 0.99 else 1):
                fitting = [request for mode, request in TRANSITIONS if mode is self.mode]
                self._make_request(choice(fitting if fitting and self.rng.random() < 0.4 else ASKED))

    def _make_request(self, request: Request) -> None:
        if request is Request.JOG:
            length = self.rng.choice((math.inf, 0.5, 3.0, -1.0, math.nan))
            line = Jog(self.rng.choice(DIRECTIONS), self.rng.choice((1.0, 20.0, 0.0, math.inf)), length)
            self._say(f"JOG {line}", lambda: self.jog(line))
        else:
            value = self._value(request)
            self._say(f"{request.name} {value}", lambda: self.ask(request, value))

    def _value(self, request: Request) -> float:
        if request is Request.HOME:
            return float(self.rng.choice((1, 4, 8, 31, 0, 32, -1, 2.5, math.nan, math.inf)))
        if request is Request.SPINDLE:
            return self.rng.choice((0.0, 600.0, -600.0, 1e5, -1e5, math.nan, math.inf))
        if request is Request.CLAMPS:
            return self.rng.choice((0.0, 8.0, 16.0, 24.0, 1.0, 31.0, 2.5, -8.0, math.nan))
        return self.rng.choice((0.0, 1.0, 1.0, 0.3, 2.0, 5.0, -1.0, math.nan))

    def _let_go(self) -> None:
        """Doors closed, switches as they were: what an operator sees to first."""
        for number in (DOOR, ESTOP, FEED_STOP):
            self.input(number, True)
        for request, value in (
            (Request.OVERRIDE, 1.0),
            (Request.RAPID_OVERRIDE, 1.0),
            (Request.SINGLE_BLOCK, 0.0),
            (Request.OPTIONAL_STOP, 0.0),
            (Request.ADAPTIVE_FEED, 0.0),
        ):
            self.ask(request, value)

    def _way_out(self) -> None:
        """What the operator's manual says for each mode. Raises NotSo."""
        end, numbers = self.bench.cycle.tick + WAY_OUT_TICKS, set(self.asked)
        while self._leaves(numbers):
            if self.bench.cycle.tick > end:
                raise self._not_so(f"no way out of {self.mode.name} in {WAY_OUT_TICKS} ticks")
            self.ticks(1)
        if not self.plan_lives:
            self.plan_anew()
            self.ticks(4)

    def _leaves(self, numbers: set[int]) -> bool:
        """One step of it; False in READY, at rest, everything answered."""
        mode, follow, modes = self.mode, self.bench.cycle.follow, self.bench.cycle.modes
        answered = all(number in self.answers for number in numbers)
        if mode is Mode.READY and not modes.untrusted:
            return not (follow.at_rest and answered)
        if mode in (Mode.RUNNING, Mode.HOLD, Mode.JOG, Mode.HOMING):
            self.ask(Request.STOP)
            self.ticks(3)
        elif mode is Mode.READY:
            self.ask(Request.DISABLE)
            self.ticks(3)
        elif mode is Mode.FAULT:
            self._reset()
        elif mode is Mode.OFF and answered and self._is_off():
            self._up()
        return True

    def _is_off(self) -> bool:
        """Nothing is under way in OFF: no drive comes up or goes down."""
        cycle = self.bench.cycle
        return not (
            cycle.modes.phase is Phase.ENABLING or any(drive.following for drive in cycle.group.drives)
        )

    def _reset(self) -> None:
        modes = self.bench.cycle.modes
        needs = max(FAULTS[modes.fault].recovery, FAULTS[modes.warning].recovery)
        self.ask(Request.RESET)
        self.ticks(3)
        if self.mode is not Mode.FAULT and needs >= Recovery.COMMISSION:
            self.bench.commission_again()

    def _up(self) -> None:
        try:
            self.bench.come_up()
        except (SessionError, CommissionError) as error:
            if self.mode is not Mode.FAULT:
                raise self._not_so(f"it does not come up: {error}") from error

    # -- what must hold

    def _judge(self) -> None:
        for number, asked in self.asked.items():
            came = self.answers.get(number, [])
            if len(came) != 1:
                raise self._not_so(f"request {number} is answered {len(came)} times: {came}")
            if (took := self.answered[number] - asked) > ANSWER_TICKS:
                raise self._not_so(f"request {number} is answered after {took} ticks")
            self._as_it_came(number, *came[0])

    def _as_it_came(self, number: int, came: Outcome, why: Fault) -> None:
        one = self.taken[number]
        if one.request is Request.HOME and one.before is Mode.OFF and one.sound:
            return  # answered later, when other things hold
        refused = bool(one.refusal) or not one.sound
        if (came is Outcome.REFUSED) is not refused:
            raise self._not_so(f"{one} is answered {came.name}")
        if came is Outcome.REFUSED and one.after is not one.before:
            raise self._not_so(f"{one} was refused, and changed the mode")
        if why is not Fault.NONE and one.request in ALWAYS:
            raise self._not_so(f"{one} is refused for {why.name}, though every mode takes it")

    def _not_so(self, what: str) -> NotSo:
        return NotSo("\n".join([what, *self.told]))


def run(count: int, seed: int, told: Callable[[int], None] = lambda _: None) -> None:
    """So many sequences, one after another on one machine. Raises NotSo."""
    site = Site(random.Random(seed))
    for n in range(count):
        try:
            site.sequence()
        except Exception as error:
            raise NotSo(f"seed {seed}, sequence {n}: {error}\n" + "\n".join(site.told)) from error
        told(n + 1)


if __name__ == "__main__":
    wanted, began_s = int(sys.argv[1]), time.time()
    first = int(sys.argv[2]) if len(sys.argv) > 2 else random.randrange(1 << 32)
    print(f"seed {first}", flush=True)
    run(
        wanted,
        first,
        lambda n: print(f"{n} in {time.time() - began_s:.0f} s", flush=True) if not n % 500 else None,
    )
    print(f"{wanted} sequences: every request answered once, a way out of every state")
