"""The path tied to the spindle's angle, along a thread: the axes go where the spindle has turned to.

A thread's law s(t) is the plan's, as of any motion. Here it leads the *spindle*, and the axes follow
what the spindle makes of it:

    wanted     turns(s), so many revolutions from the thread's beginning
    lag        e = wanted - actual, of the same SYNC: a setpoint of tick k is reached at SYNC k + 2, the
               angle that tick k reads was sampled at SYNC k - 1, so it answers the place of tick k - 3;
               with a pump both are so many ticks later as a setpoint waits (``stock.DELAY``)
    spindle    turns at d/dt wanted + gain e, and as much faster as it slips and lags, which is measured
    axes       at s - e / (turns per mm), with e as it will be when they are there; and as much further on
               as their drives lag, which is measured

So a spindle that lags, slips, stalls or is braked takes the axes along, as fast as their limits let it;
a hold or a stop on the path slows the law down, and both come to rest on the thread. At rest e is worked
off by the spindle alone, down to ``SETTLED_REV``; only then the clock goes past the end of the motion.

Nothing here allocates what stays, or raises.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.motion.motions import ThreadMove

# Of an alpha-beta filter over e and its rate: critically damped, some three ticks.
ALPHA = 0.4
BETA = ALPHA * ALPHA / (2.0 - ALPHA)
REMEMBERS = 0.998  # of the sums by which the spindle's answer is learnt, from tick to tick
SURE_SPEED, SURE_ACCELERATION = 10.0, 200.0  # (rev/s)^2, (rev/s^2)^2: below them little is believed
MAX_SLIP, MAX_LAG_S = 0.2, 0.1
EVEN = 0.1  # rev/s^2: an even speed
SETTLED_REV = 0.002  # of e at rest, and ...
SETTLED_COUNTS = 2.0  # ... not below what the encoder can tell
SETTLED_TICKS = 4  # in a row
LATE_S = 3.0  # not settled by then: it is lost as one that lags
CLOSING_REV_S = 0.1  # a lag beyond the window that shrinks by so much is on its way back
PATIENCE_S = 0.2  # for one that does neither
ANSWERS_IN = 3  # ticks, from a speed that the spindle is told to its answer
TEACHES_REV = 0.2  # a spindle that is further off is hindered, and teaches nothing
DEAF_SYNCS = 5  # without a position: the thread is left to nobody's guess
FASTER = 1.2  # than the law asks for: what the loop may add to catch up, and in any case ...
LEAST_REV_S = 1.0  # ... so much
LEARNS_S = 1e-5  # of the axes' lag, in a tick: what is learnt on the thread comes without a jerk
STILL = 1e-9  # of s between two ticks: the law stands
STILL_MM = 1e-3  # of the axes at rest: what the encoder's last count does moves no axis


class Recorded(NamedTuple):
    """A tick on a thread, of a run that is made again."""

    led_mm: float = 0.0
    settled: bool = False


class Turning(Protocol):
    """What is needed of ``drives.cyclic.spindle``."""

    turns: float
    unheard: int
    load: float

    def lead(self, rev_s: float, /) -> None: ...


class Slope:
    """Of the best line through 0, the older points forgotten little by little."""

    __slots__ = ("_xx", "_xy")

    def __init__(self, sure: float) -> None:
        """``sure``: squares of x that must come together before much is believed."""
        self._xy, self._xx = 0.0, sure

    def learn(self, x: float, y: float) -> float:
        """The slope, once another point has come."""
        self._xy = REMEMBERS * self._xy + x * y
        self._xx = REMEMBERS * self._xx + x * x
        return self._xy / self._xx


class Reply:
    """How the spindle answers: told - actual = ``slip`` speed + ``lag_s`` acceleration, the best of late.

    Each is learnt where the other does not hide it, and forgotten only by what is learnt anew.
    """

    def __init__(self) -> None:
        self.slip = self.lag_s = 0.0
        self._speeds, self._accelerations = Slope(SURE_SPEED), Slope(SURE_ACCELERATION)

    def learn(self, speed: float, acceleration: float, less: float) -> None:
        """One tick: told ``speed`` (rev/s), its ``acceleration``, and ``less`` came of it by so much."""
        if acceleration == 0.0 and abs(less) < 1.5 * MAX_SLIP * abs(speed):  # else it is stuck, or starts
            self.slip = max(-MAX_SLIP, min(MAX_SLIP, self._speeds.learn(speed, less)))
        less -= self.slip * speed
        if acceleration != 0.0 and abs(less) < 1.5 * MAX_LAG_S * abs(acceleration):
            self.lag_s = max(0.0, min(MAX_LAG_S, self._accelerations.learn(acceleration, less)))


class Led(NamedTuple):
    """How the spindle was led in one tick."""

    speed: float  # rev/s
    acceleration: float  # rev/s^2


class LedTicks(NamedTuple):
    """Of the three ticks before: the oldest is the one that the spindle has answered."""

    last: Led
    before: Led
    answered: Led


STILL_LED = LedTicks(Led(0.0, 0.0), Led(0.0, 0.0), Led(0.0, 0.0))


class Turns(NamedTuple):
    """Revolutions wanted, of the tick whose setpoint goes out now and the three before."""

    now: float
    before: float
    earlier: float
    answered: float


class Tie(NamedTuple):
    """What a tick changes of the tie, so that it can be taken back; ``releasing`` ... as in ``Coupling``."""

    releasing: bool
    move: ThreadMove | None
    s: float
    zero: float
    lag_rev: float
    rate: float
    off_mm: float
    step_mm: float
    rev_s: float
    wanted: Turns
    on_the_way: tuple[float, ...]
    settled: int
    late: int
    led: LedTicks
    turned: float
    led_mm: float
    led_step_mm: float
    axis_s: float


class Coupling:
    """The tie.

    Read: ``active``, ``rev_s`` (the spindle is led at), ``lag_rev`` (e), ``off_mm`` (of the axes),
    ``depth_rev`` and ``pitch_mm`` of the thread that the tool is in, 0 where it is in none; ``led_mm`` (from
    the law's place to that of the axes), ``settled`` (both stand where the thread's motion ends).

    ``unseen``: in a period without a tick nobody looks at the spindle, nor tells it anything, and the law
    leads the axes alone; so it is in a look ahead.
    """

    def __init__(
        self, machine: Machine, spindle: Turning | None, drives: Sequence[Any] = (), delay: int = 0
    ) -> None:
        """``delay``: ticks for which a setpoint waits before it goes out."""
        told = machine.spindle.position if machine.spindle is not None else None
        self._period_s = machine.period_s
        self._spindle = spindle if told is not None else None
        self._drives = drives
        self._linear = machine.linear()
        self._gain = told.gain_per_s if told is not None else 0.0
        self._most_lag = told.most_lag_rev if told is not None else math.inf
        counts = abs(told.counts_per_rev) if told is not None else 1.0
        self._near = max(SETTLED_REV, SETTLED_COUNTS / counts)
        self._most_late = round(LATE_S / machine.period_s)
        self.active = self.releasing = self.settled = False
        self.move: ThreadMove | None = None
        self.rev_s = self.lag_rev = self.off_mm = 0.0
        self.depth_rev = self.pitch_mm = self.led_mm = 0.0
        self.again: Recorded | None = None  # of a run that is made again
        self.unseen = False
        self._led_step_mm = 0.0  # of ``led_mm``, in the last period
        self._untaught = 0  # periods for which what the spindle answers is to what nobody has told it
        self._s = self._zero = self._rate = self._step_mm = self._axis_s = 0.0
        self._delay = delay
        self._wanted = Turns(0.0, 0.0, 0.0, 0.0)
        self._on_the_way: tuple[float, ...] = (0.0,) * delay  # wanted in the ticks whose setpoints wait
        self._led_before = STILL_LED
        self._turned = 0.0  # revolutions, as heard last
        self.reply = Reply()
        self._settled = self._late = self._beyond = 0  # ticks
        self._most_beyond = round(PATIENCE_S / machine.period_s)

    def unseen_twin(self, machine: Machine) -> Coupling:
        """For a look ahead."""
        made = Coupling(machine, self._spindle, self._drives, self._delay)
        made.unseen = True
        return made

    # -- what others ask

    def look(self) -> None:
        """Before a tick: whether it has settled; where the axes leave the thread, nothing is off any more."""
        if self.again is not None:
            self.settled = self.again.settled
            return
        off = self.releasing and not self.off_mm == self._step_mm == 0.0
        self.settled = self.active and self._settled >= SETTLED_TICKS and not (off or self.unseen)

    @property
    def lags(self) -> bool:
        """Whether the spindle is so far behind, or so slow to settle, that it is not where it was told."""
        return self.active and (self._beyond > self._most_beyond or self._late > self._most_late)

    @property
    def deaf(self) -> bool:
        return self.active and self._spindle is not None and self._spindle.unheard > DEAF_SYNCS

    @property
    def dies_away(self) -> bool:
        """Whether the axes still go on beside the law by what has led them last."""
        return self.active and self._led_step_mm != 0.0

    @property
    def turns(self) -> float:
        """Revolutions that the spindle has made, where it tells them."""
        return 0.0 if self._spindle is None else self._spindle.turns

    @property
    def load(self) -> float:
        """Share of the spindle's rated torque, where it tells it."""
        return 0.0 if self._spindle is None else self._spindle.load

    def end(self) -> None:
        """The spindle is its own again; where the tool is in a thread stays known."""
        self.active = self.releasing = False
        self.move = None
        self.rev_s = self.lag_rev = self.off_mm = self._rate = self._step_mm = 0.0
        self.led_mm = self._led_step_mm = 0.0

    def stood(self) -> None:
        """The axes have stood meanwhile."""
        self._step_mm = self._led_step_mm = 0.0

    def save(self) -> Tie | None:
        """None where there is no tie."""
        if not self.active:
            return None
        return Tie(
            self.releasing,
            self.move,
            self._s,
            self._zero,
            self.lag_rev,
            self._rate,
            self.off_mm,
            self._step_mm,
            self.rev_s,
            self._wanted,
            self._on_the_way,
            self._settled,
            self._late,
            self._led_before,
            self._turned,
            self.led_mm,
            self._led_step_mm,
            self._axis_s,
        )

    def restore(self, saved: Tie | None) -> None:
        if saved is None:
            self.end()
            return
        self.active, self.releasing, self.move = True, saved.releasing, saved.move
        self._s, self._zero = saved.s, saved.zero
        self._wanted, self._on_the_way = saved.wanted, saved.on_the_way
        self.lag_rev, self._rate = saved.lag_rev, saved.rate
        self.off_mm, self._step_mm, self.led_mm = saved.off_mm, saved.step_mm, saved.led_mm
        self.rev_s, self._led_before, self._turned = saved.rev_s, saved.led, saved.turned
        self._settled, self._late = saved.settled, saved.late
        self._led_step_mm, self._axis_s = saved.led_step_mm, saved.axis_s

    def lead(self) -> None:
        """Tells the spindle how fast to turn until the next tick."""
        if self.active and self._spindle is not None:
            self._spindle.lead(self.rev_s)

    def place(self, move: ThreadMove, s: float) -> float:
        """Where along ``move`` the axes are now, when the law is at ``s``: for a queue that goes on here."""
        return s + self.led_mm if self.active else s

    # -- every tick

    def follow(self, move: ThreadMove, s: float, v: float, a: float) -> float:
        """One tick: the law is at ``s`` (mm), ``v``, ``a`` of it; where along ``move`` the axes are to go."""
        spindle = self._spindle
        if spindle is None:
            return s
        wanted = move.begin_rev + move.rev_per_mm * s
        if not self.active:
            self._begin(move, wanted, spindle.turns)
        if self.move is not None and move is not self.move:  # the same angle is so much of the other way
            turned = self.move.rev_per_mm / move.rev_per_mm
            self.off_mm, self._step_mm = turned * self.off_mm, turned * self._step_mm
            self.led_mm, self._led_step_mm = turned * self.led_mm, turned * self._led_step_mm
        stands = move is self.move and -STILL < s - self._s < STILL
        self.move, self._s = move, s
        *on_the_way, now = wanted, *self._on_the_way
        before, earlier, answered = self._wanted.now, self._wanted.before, self._wanted.earlier
        self._on_the_way, self._wanted = tuple(on_the_way), Turns(now, before, earlier, answered)
        if self.unseen:
            self._untaught = ANSWERS_IN
            self._led_before = LedTicks(Led(self.rev_s, 0.0), self._led_before.last, self._led_before.before)
        else:
            # A late tick has heard the answer to its own SYNC already.
            told = answered if spindle.unheard > 0 else earlier
            self._measure(told - (spindle.turns - self._zero), spindle.turns, spindle.unheard)
            self._watch()
            self._lead(now - before, now - 2.0 * before + earlier, stands)
        self.depth_rev, self.pitch_mm = wanted - self.lag_rev if wanted else 0.0, 1.0 / move.rev_per_mm
        if self.again is not None:
            self.led_mm = self.again.led_mm
        else:
            led_mm = self._led_alone(move, v, a) if self.unseen else self._led(move, v, a, stands)
            self._led_step_mm, self.led_mm = led_mm - self.led_mm, led_mm
        return s + self.led_mm

    def stay(self, joints: Joints, kinematics: Kinematics) -> Joints:
        """One tick at rest on the thread: the axes follow what the spindle still turns."""
        move = self.move
        if move is None:
            return joints
        found = move.joints(self.follow(move, self._s, 0.0, 0.0), (0.0, 0.0), kinematics)
        return joints if found is None else found

    def _begin(self, move: ThreadMove, wanted: float, turns: float) -> None:
        self.active, self.releasing, self.move = True, False, move
        self._zero = turns - wanted
        self._wanted, self._on_the_way = Turns(wanted, wanted, wanted, wanted), (wanted,) * self._delay
        self.lag_rev = self._rate = self.off_mm = self._step_mm = 0.0
        self._settled = self._late = self._beyond = 0
        self._led_before, self._turned = STILL_LED, turns
        self._axis_s = self._axes_lag_s(move)

    def _axes_lag_s(self, move: ThreadMove) -> float:
        drives, x, y, z = self._drives, *move.direction
        if not drives:
            return 0.0
        along_x, along_y, along_z = (drives[i].following_error.lag_s for i in self._linear)
        return float(x * x * along_x + y * y * along_y + z * z * along_z)

    def _measure(self, lag: float, turns: float, unheard: int) -> None:
        """Filters e; where no position has come it goes on as it did."""
        T = self._period_s
        turned, self._turned = (turns - self._turned) / T, turns
        speed, acceleration = self._led_before.answered
        self._untaught = max(0, self._untaught - 1, 2 * (unheard < 1))  # two answers at once, and then none
        sure = unheard <= 1 and not self._untaught
        if sure and speed != 0.0 and -TEACHES_REV < self.lag_rev < TEACHES_REV:
            self.reply.learn(speed, acceleration, speed - turned)
        self.lag_rev += self._rate * T
        if unheard <= 1:
            off = lag - self.lag_rev
            self.lag_rev += ALPHA * off
            self._rate += BETA / T * off

    def _watch(self) -> None:
        """Beyond the window: at once if it falls back further, after a while if it does not catch up."""
        lag = self.lag_rev
        if -self._most_lag <= lag <= self._most_lag:
            self._beyond = 0
            return
        away = self._rate if lag > 0.0 else -self._rate
        if away > CLOSING_REV_S:
            self._beyond = self._most_beyond + 1
        elif away > -CLOSING_REV_S:
            self._beyond += 1

    def _lead(self, turned: float, bent: float, stands: bool) -> None:
        """How fast the spindle is to turn, and whether it has come to where the law stands."""
        T, reply = self._period_s, self.reply
        asked, acceleration = turned / T, bent / (T * T)
        if -EVEN < acceleration < EVEN:
            acceleration = 0.0
        most = (FASTER - 1.0) * abs(asked) + LEAST_REV_S
        added = max(-most, min(most, self._gain * self.lag_rev))
        self.rev_s = asked * (1.0 + reply.slip) + reply.lag_s * acceleration + added
        led = self._led_before
        self._led_before = LedTicks(Led(self.rev_s, acceleration), led.last, led.before)
        if not stands:
            self._settled = self._late = 0
        elif abs(self.lag_rev) <= self._near:
            self._settled += 1
            self._late = 0
        else:
            self._settled = 0
            self._late += 1

    def _led(self, move: ThreadMove, v: float, a: float, stands: bool) -> float:
        """How far from the law's place the axes are to go (mm)."""
        T, measured_s = self._period_s, self._axes_lag_s(move)
        self._axis_s = axis_s = max(self._axis_s - LEARNS_S, min(self._axis_s + LEARNS_S, measured_s))
        ahead_s = (3 + self._delay) * T + axis_s
        off = (self.lag_rev + self._rate * ahead_s) / move.rev_per_mm
        if self.releasing and self._settled >= SETTLED_TICKS:
            off = 0.0
        elif stands and abs(off - self.off_mm) < STILL_MM:
            off = self.off_mm
        self._approach(off, move.give_mm_s2 * T * T, move.give_mm_s * T)
        return axis_s * (v + 0.5 * axis_s * a) - self.off_mm

    def _led_alone(self, move: ThreadMove, v: float, a: float) -> float:
        """Likewise with no look at the spindle: what it went by per period dies away."""
        step, bend = self._led_step_mm, move.give_mm_s2 * self._period_s**2
        led_mm = self.led_mm + math.copysign(max(0.0, abs(step) - bend), step)
        off = self._axis_s * (v + 0.5 * self._axis_s * a) - led_mm  # from where the next look goes on
        self.off_mm, self._step_mm = off, off - self.off_mm
        return led_mm

    def _approach(self, off: float, bend: float, most: float) -> None:
        """``off_mm`` one tick nearer to ``off``: no step bends by more than ``bend``, and it can stop."""
        gap = off - self.off_mm
        if -bend <= gap - self._step_mm <= bend and -most <= gap <= most:
            step = gap
        else:
            # n steps of bend, 2 bend .. n bend stop within n (n + 1) / 2 bend.
            far = 0.5 * (math.sqrt(1.0 + 8.0 * abs(gap) / bend) - 1.0) * bend
            step = math.copysign(min(far, most), gap)
        self._step_mm = max(self._step_mm - bend, min(self._step_mm + bend, step))
        self.off_mm = off if step == gap == self._step_mm else self.off_mm + self._step_mm
