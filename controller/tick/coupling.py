"""The path tied to the spindle's angle, along a thread: the axes go where the spindle has turned to.

A thread's law s(t) is the plan's, as of any motion. Here it leads the *spindle*, and the axes follow
what the spindle makes of it:

    wanted     turns(s), so many revolutions from the thread's beginning
    lag        e = wanted - actual, of the same SYNC: a setpoint of tick k is reached at SYNC k + 2, the
               angle that tick k reads was sampled at SYNC k - 1, so it answers the place of tick k - 3;
               with a pump all are so many ticks later as a setpoint waits (``stock.DELAY``)
    spindle    turns at d/dt wanted + gain e, and as much faster as it slips and lags, which is measured
    axes       at s - e / (turns per mm), with e as it will be when they are there; and as much further on
               as their drives lag, which is measured

Where a pump has a stock of periods, what is led beside the law (``Correction``) is foreseen for all of them:
each tick adds the farthest one, and the others stay as they are. So a tick that is late changes nothing, for
in time it would have added the same. Only where the spindle is not where it was foreseen to be, by more than
``FORESEEN_MM`` of the axes' way, they are all made anew, from the next period that can be changed.

So a spindle that lags, slips, stalls or is braked takes the axes along, as fast as their limits let it;
a hold or a stop on the path slows the law down, and both come to rest on the thread. At rest e is worked
off by the spindle alone, down to ``SETTLED_REV``; only then the clock goes past the end of the motion.

Nothing here allocates what stays, or raises.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple, Protocol

from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.motion.motions import ThreadMove
from controller.tick.changes import Changes
from drives.pump.lead import Correction
from drives.pump.plan_memory import Stop

# Of an alpha-beta filter over e and its rate: critically damped, some three ticks.
ALPHA = 0.4
BETA = ALPHA * ALPHA / (2.0 - ALPHA)
REMEMBERS = 0.998  # of the sums by which the spindle's answer is learnt, from tick to tick
SURE_SPEED, SURE_ACCELERATION = 10.0, 200.0  # (rev/s)^2, (rev/s^2)^2: below them little is believed
MAX_SLIP, MAX_LAG_S = 0.2, 0.1
EVEN = 0.1  # rev/s^2: an even speed
DRIFTS_REV_S = 1.0  # faster than this, what is not explained is taken for a share of the speed
SETTLED_REV = 0.002  # of e at rest, and ...
SETTLED_COUNTS = 2.0  # ... not below what the encoder can tell
SETTLED_TICKS = 4  # in a row
EVEN_S = 0.25  # of one speed beside a thread: then what a spindle lags has come to its end
LATE_S = 3.0  # not settled by then: it is lost as one that lags
CLOSING_REV_S = 0.1  # a lag beyond the window that shrinks by so much is on its way back
BEYOND_TIMEOUT_S = 0.2  # for one that does neither
ANSWERS_IN = 3  # ticks, from a speed that the spindle is told to its answer
TEACHES_REV = 0.2  # a spindle that is further off is hindered, and teaches nothing
DEAF_SYNCS = 5  # without a position: the thread is left to nobody's guess
FASTER = 1.2  # than the law asks for: what the loop may add to catch up, and in any case ...
MIN_REV_S = 1.0  # ... so much
LEARNS_S = 1e-5  # of the axes' lag, in a tick: what is learnt on the thread comes without a jerk
STILL = 1e-9  # of s between two ticks: the law stands
STILL_MM = 1e-3  # of the axes at rest: what the encoder's last count does moves no axis
FORESEEN_MM = 2e-3  # of the axes' way: so far off, or by ``SETTLED_COUNTS``, what was foreseen holds


class Recorded(NamedTuple):
    """A tick on a thread, of a run that is made again."""

    led_mm: float = 0.0
    settled: bool = False


class Turning(Protocol):
    """What is needed of ``drives.cyclic.spindle``."""

    turns: float
    unheard: int
    even_syncs: int
    load: float

    @property
    def commanded_rev_s(self) -> float: ...
    def lead(self, rev_s: float, by_plan: bool, /) -> None: ...


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

    Each is learnt where the other does not hide it, and forgotten only by what is learnt anew: the slip also
    beside a thread, for a short one has no even speed.
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


class Law(NamedTuple):
    """What the law of a thread asks for in one tick."""

    move: ThreadMove
    s: float  # mm along it, and ...
    v: float
    a: float
    wanted_rev: float
    rev_s: float  # of the spindle, and ...
    rev_s2: float

    @classmethod
    def of(
        cls, move: ThreadMove, place: tuple[float, float, float], past: Sequence[float], period_s: float
    ) -> Law:
        """At ``place`` (s, v, a), after what was wanted in the two ticks before, the newest first."""
        s, v, a = place
        before, earlier, *_ = past
        wanted = move.begin_rev + move.rev_per_mm * s
        acceleration = (wanted - 2.0 * before + earlier) / period_s**2
        if -EVEN < acceleration < EVEN:
            acceleration = 0.0
        return cls(move, s, v, a, wanted, (wanted - before) / period_s, acceleration)

    def stop(self, stop: Stop, by: Correction) -> Stop:
        """A stop of it, with how axes and spindle answer along it."""
        slip = by.slip + (by.drift_rev_s / self.rev_s if abs(self.rev_s) > DRIFTS_REV_S else 0.0)
        slip = max(-MAX_SLIP, min(MAX_SLIP, slip))
        return stop._replace(axis_lag_s=by.axis_s, spindle_slip=slip, spindle_lag_s=by.lag_s)


class Past(NamedTuple):
    """The ticks before this one, the newest first, as far back as the one before that which was answered."""

    wanted: tuple[float, ...]  # rev
    turned: tuple[float, ...]  # ``Correction.turned_rev``
    led: tuple[Led, ...]

    def with_newest(self, wanted: float, turned: float, led: Led) -> Past:
        return Past((wanted, *self.wanted[:-1]), (turned, *self.turned[:-1]), (led, *self.led[:-1]))


_CHANGES: Final = Changes(
    *("releasing", "move", "s", "_zero", "lag_rev", "_rate", "rev_s", "_past", "now", "_stock"),
    *("_settled", "_late", "_turned", "led_mm", "ahead_mm"),
)
Tie = tuple[Any, ...]  # these, of one tick


class Coupling:
    """The tie.

    Read: ``active``, ``rev_s`` (the spindle is led at), ``lag_rev`` (e), ``off_mm`` (of the axes),
    ``depth_rev`` and ``pitch_mm`` of the thread that the tool is in, 0 where it is in none; ``s`` (the law's
    place), ``led_mm`` (from there to that of the axes), ``ahead_mm`` (of that: since their drives lag),
    ``now`` (what leads beside the law), ``settled`` (both stand where the thread's motion ends).

    ``committed``: so many ticks, this one and those after it, have been sent as they were foreseen.
    """

    def __init__(
        self,
        machine: Machine,
        spindle: Turning | None,
        drives: Sequence[Any] = (),
        delay: int = 0,
        periods: int = 0,
    ) -> None:
        """``delay``: ticks for which a setpoint waits before it goes out; ``periods`` of the stock."""
        told = machine.spindle.position if machine.spindle is not None else None
        self._period_s = machine.period_s
        self._spindle = spindle if told is not None else None
        self._drives = drives
        self._linear = machine.linear()
        self._gain = told.gain_per_s if told is not None else 0.0
        self._most_lag = told.most_lag_rev if told is not None else math.inf
        counts = abs(told.counts_per_rev) if told is not None else 1.0
        self._least_rev = SETTLED_COUNTS / counts  # that the encoder can tell
        self._near = max(SETTLED_REV, self._least_rev)
        self._most_late = round(LATE_S / machine.period_s)
        self.active = self.releasing = self.settled = False
        self.move: ThreadMove | None = None
        self.rev_s = self.lag_rev = self.off_mm = 0.0
        self.depth_rev = self.pitch_mm = self.led_mm = self.ahead_mm = 0.0
        self.again: Recorded | None = None  # of a run that is made again
        self.committed = 0
        self._most_even = round(EVEN_S / machine.period_s)
        self._untaught = 0  # ticks for which what the spindle answers is to what nobody has told it
        self.s = self._zero = self._rate = 0.0  # ``_rate``: of e, rev/s, if nothing were added
        self._delay, self._periods = delay, periods
        self._answers_in = ANSWERS_IN + delay
        self._past = self._still(0.0)
        self.now = Correction()
        self._axis_s = 0.0  # by which the axes' drives lag, as measured now
        self._stock: tuple[Correction, ...] = ()  # of the ticks to come
        self._turned = 0.0  # revolutions, as heard last
        self.reply = Reply()
        self._settled = self._late = self._beyond = 0  # ticks
        self._most_beyond = round(BEYOND_TIMEOUT_S / machine.period_s)

    # -- what others ask

    def look(self) -> None:
        """Before a tick: whether it has settled; where the axes leave the thread, nothing is off any more."""
        if self.again is not None:
            self.settled = self.again.settled
            return
        if not self.active and self._spindle is not None:
            self._listen(self._spindle)
        here = self._settled >= SETTLED_TICKS and not self.committed
        off = self.releasing and any([c.off_rev or c.step_rev for c in (self.now, *self._stock)])
        self.settled = self.active and here and not off

    @property
    def lags(self) -> bool:
        """Whether the spindle is so far behind, or so slow to settle, that it is not where it was told."""
        return self.active and (self._beyond > self._most_beyond or self._late > self._most_late)

    @property
    def deaf(self) -> bool:
        return self.active and self._spindle is not None and self._spindle.unheard > DEAF_SYNCS

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
        self.rev_s = self.lag_rev = self.off_mm = self._rate = 0.0
        self.led_mm = self.ahead_mm = 0.0
        self.now, self._stock = Correction(), ()

    def go_on(self, committed: int, again: Recorded | None) -> None:
        """So many ticks, from the next one on, have gone out as foreseen; ``again``: as a run had them."""
        self.committed, self.again = committed, again

    def stood(self) -> None:
        """The axes have stood meanwhile."""
        self.now = self.now._replace(step_rev=0.0, drift_rev_s=0.0)
        self._stock = (self.now._replace(added_rev_s=0.0),) * len(self._stock)

    @property
    def foreseen(self) -> tuple[Correction, ...]:
        """The corrections of the last tick and of those to come, as a plan goes by them."""
        return (self.now, *self._stock)

    def go_by(self, foreseen: tuple[Correction, ...], ticks: int) -> None:
        """The ticks to come are those of a plan that was made ``ticks`` before the last one."""
        if not self.active or self.move is None:
            return
        chain, bend = list(foreseen), self.bend_rev(self.move)
        while len(chain) <= ticks + self._periods:
            chain.append(chain[-1].prolonged(bend, self._period_s))
        self._stock = tuple(chain[ticks + 1 : ticks + 1 + self._periods])

    def save(self) -> Tie | None:
        """None where there is no tie."""
        return _CHANGES.of(self) if self.active else None

    def restore(self, saved: Tie | None) -> None:
        if saved is None:
            self.end()
            return
        self.active = True
        _CHANGES.put(self, saved)

    def lead(self) -> None:
        """Tells the spindle how fast to turn until the next tick; with a pump, the plan does."""
        if self.active and self._spindle is not None:
            self._spindle.lead(self.rev_s, self._periods > 0)

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
        stands = move is self.move and -STILL < s - self.s < STILL
        self.move, self.s = move, s
        law = Law.of(move, (s, v, a), self._past.wanted, self._period_s)
        self.lag_rev += self._rate * self._period_s - self._added_rev
        self._measure(spindle)
        self._watch()
        self._settle(stands)
        self._shift(law, stands)
        self._lead(law)
        self.depth_rev, self.pitch_mm = wanted - self.lag_rev if wanted else 0.0, 1.0 / move.rev_per_mm
        self.ahead_mm = self.now.ahead_mm(v, a)
        if self.again is not None:
            self._lead_again(move, self.again)
        self.off_mm = self.now.off_rev / move.rev_per_mm
        self.led_mm = self.ahead_mm - self.off_mm if self.again is None else self.again.led_mm
        return s + self.led_mm

    def stay(self, joints: Joints, kinematics: Kinematics) -> Joints:
        """One tick at rest on the thread: the axes follow what the spindle still turns."""
        move = self.move
        if move is None:
            return joints
        found = move.joints(self.follow(move, self.s, 0.0, 0.0), (0.0, 0.0), kinematics)
        return joints if found is None else found

    def _begin(self, move: ThreadMove, wanted: float, turns: float) -> None:
        self.active, self.releasing, self.move = True, False, move
        self._zero = turns - wanted
        self._past = self._still(wanted)
        self.lag_rev = self._rate = 0.0
        self._settled = self._late = self._beyond = 0
        self._turned, reply = turns, self.reply
        self.now = Correction(slip=reply.slip, lag_s=reply.lag_s, axis_s=self._axes_lag_s(move))
        self._stock = (self.now,) * self._periods

    def _still(self, wanted: float) -> Past:
        """The spindle has stood."""
        ticks = self._answers_in + 1
        return Past((wanted,) * ticks, (0.0,) * ticks, (Led(0.0, 0.0),) * ticks)

    def _axes_lag_s(self, move: ThreadMove) -> float:
        drives, x, y, z = self._drives, *move.direction
        if not drives:
            return 0.0
        along_x, along_y, along_z = (drives[i].following_error.lag_s for i in self._linear)
        return float(x * x * along_x + y * y * along_y + z * z * along_z)

    @property
    def _added_rev(self) -> float:
        """By how much what was added has changed e in the tick that is answered now."""
        after, before = self._past.turned[-2:]
        return after - before

    def _hear(self, spindle: Turning) -> tuple[float, bool]:
        """How fast it has turned (rev/s), and whether that is its answer to one SYNC."""
        turns, unheard = spindle.turns, spindle.unheard
        turned, self._turned = (turns - self._turned) / self._period_s, turns
        self._untaught = max(0, self._untaught - 1, 2 * (unheard < 1))  # two answers at once, and then none
        return turned, unheard <= 1 and not self._untaught

    def _listen(self, spindle: Turning) -> None:
        """One tick beside a thread."""
        turned, sure = self._hear(spindle)
        speed = spindle.commanded_rev_s
        if sure and speed != 0.0 and spindle.even_syncs > self._most_even:
            self.reply.learn(speed, 0.0, speed - turned)

    def _measure(self, spindle: Turning) -> None:
        """Filters e; where no position has come it goes on as it did."""
        T, turns, unheard, past = self._period_s, spindle.turns, spindle.unheard, self._past
        turned, sure = self._hear(spindle)
        speed, acceleration = past.led[self._answers_in - 1]
        if sure and speed != 0.0 and -TEACHES_REV < self.lag_rev < TEACHES_REV:
            self.reply.learn(speed, acceleration, speed - turned)
        if unheard <= 1:
            # A late tick may have heard the answer to its own SYNC already.
            told = past.wanted[self._answers_in - (1 if unheard > 0 else 2)]
            off = told - (turns - self._zero) - self.lag_rev
            self.lag_rev += ALPHA * off
            self._rate += BETA / T * off

    def _watch(self) -> None:
        """Beyond the window: at once if it falls back further, after a while if it does not catch up."""
        lag = self.lag_rev
        if -self._most_lag <= lag <= self._most_lag:
            self._beyond = 0
            return
        rate = self._rate - self._added_rev / self._period_s
        away = rate if lag > 0.0 else -rate
        if away > CLOSING_REV_S:
            self._beyond = self._most_beyond + 1
        elif away > -CLOSING_REV_S:
            self._beyond += 1

    def _settle(self, stands: bool) -> None:
        """Whether the spindle has come to where the law stands."""
        if not stands:
            self._settled = self._late = 0
        elif abs(self.lag_rev) <= self._near:
            self._settled += 1
            self._late = 0
        else:
            self._settled = 0
            self._late += 1

    def _shift(self, law: Law, stands: bool) -> None:
        """One tick on: what was foreseen for it is its own, and the farthest is foreseen."""
        move, bend = law.move, self.bend_rev(law.move)
        self._axis_s = self._axes_lag_s(move)
        chain, last, first = list(self._stock), self._periods, self.committed
        chain.append((chain[-1] if chain else self.now).prolonged(bend, self._period_s))
        if first <= last:
            n = last
            before = chain[first - 1] if first else self.now
            off_rev = self._target_offset_rev(before, chain[first].added_rev_s, first, move, stands)
            foreseen = max(FORESEEN_MM * abs(move.rev_per_mm), self._least_rev)
            if abs(off_rev - chain[first].off_rev) > (0.0 if self._leaves else foreseen):
                n = first
            for i in range(n, last + 1):
                before = chain[i - 1] if i else self.now
                chain[i] = self._next(before, i, law, stands)
        self.now, *stock = chain
        self._stock = tuple(stock)

    def bend_rev(self, move: ThreadMove) -> float:
        """By how much a step of the axes' correction may differ from the one before it (rev)."""
        return move.give_mm_s2 * self._period_s**2 * abs(move.rev_per_mm)

    @property
    def _leaves(self) -> bool:
        return self.releasing and self._settled >= SETTLED_TICKS

    def _lag_in(self, before: Correction, ticks: int) -> float:
        """What e will be in so many ticks, after ``before``, if nothing is added in the last of them."""
        pending = before.turned_rev - self._past.turned[self._answers_in - 1]
        return self.lag_rev + self._rate * (self._answers_in + ticks) * self._period_s - pending

    def _target_offset_rev(
        self, before: Correction, added: float, ticks: int, move: ThreadMove, stands: bool
    ) -> float:
        """How far the axes are to be behind then, if so much is ``added`` (rev/s)."""
        if self._leaves:
            return 0.0
        meanwhile = before.axis_s * (self._rate - added)
        off_rev = self._lag_in(before, ticks) - self._period_s * added + meanwhile
        still = stands and abs(off_rev - before.off_rev) < STILL_MM * abs(move.rev_per_mm)
        return before.off_rev if still else off_rev

    def _next(self, before: Correction, ticks: int, law: Law, stands: bool) -> Correction:
        """The correction in so many ticks, after ``before``."""
        move, T, reply = law.move, self._period_s, self.reply
        axis_s = max(before.axis_s - LEARNS_S, min(before.axis_s + LEARNS_S, self._axis_s))
        most = (FASTER - 1.0) * abs(law.rev_s) + MIN_REV_S
        added = max(-most, min(most, self._gain * self._lag_in(before, ticks)))
        give, off_rev = T * abs(move.rev_per_mm), self._target_offset_rev(before, added, ticks, move, stands)
        off = before.approach(off_rev, self.bend_rev(move), move.give_mm_s * give)
        turned, drift = before.turned_rev + T * added, max(-most, min(most, self._rate))
        return Correction(*off, added, turned, drift, reply.slip, reply.lag_s, axis_s)

    def _lead(self, law: Law) -> None:
        """How fast the spindle is to turn."""
        self.rev_s = self.now.rev_s(law.rev_s, law.rev_s2)
        self._past = self._past.with_newest(law.wanted_rev, self.now.turned_rev, Led(self.rev_s, law.rev_s2))

    def _lead_again(self, move: ThreadMove, again: Recorded) -> None:
        """In a run that is made again the axes are as far off as they were."""
        off_rev = (self.ahead_mm - again.led_mm) * move.rev_per_mm
        self.now = self.now._replace(off_rev=off_rev, step_rev=off_rev - self.now.off_rev)
        self.stood()
