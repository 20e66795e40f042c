"""Spindle, coolant, clamps and safety inputs: what the program wants of them, and what they forbid.

Told by hand (``by_hand``), spindle, coolant and clamps stay so in READY and in a jog from there, until a
program starts or the door opens; the coolant of a program may be told by hand, too, until the program
says otherwise. A line typed by hand is such a hand: it begins with what is on, outputs included, and
leaves it on (``StaysOn``). An override turns the spindle at a share of what is wanted; motion does not
wait for that.

The program speaks at rest, by a piece that ``sets``; from then on motion waits until all
of them are as told. What an operator's hand can reach is off outside of a program:

```
   mode          spindle, coolant                    clamps
   OFF           off; of outputs all but those held  closed as soon as the axes stand
   READY         likewise, or as told by hand        likewise, or as told by hand
   HOMING        off                                 open for the axes that home
   JOG           as before                           open for the axes that move, too
   RUNNING, HOLD as the program says; off while the  as the program says
                 door is open and the axes stand
   FAULT         as before until the axes stand      as before until the axes stand
                 or have been given up, then off
```
Inputs read 1 where all is well (circuit and door closed, supply there), so a broken wire stops
the machine; but one does not count while a step of the tool changer has open what it guards, from the
step that opens it to the end of that which closes it (``Piece.lifts``). Opening a clamp lets an axis go
that its drive must hold; closing one on an axis that moves would break it, and is done only when its own
feedback stands.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Protocol

from controller.ipc.handoff import ANALOGUE, Awaited, Piece
from controller.ipc.inverter_slot import InverterSlot
from controller.machine.model import BESIDE, Axis, Changer, Clamp, Io, Machine
from controller.state.modes import Fault, Mode, Request, StaysOn
from controller.tick.coupling import Coupling
from controller.tick.inverter import InverterSpindle, ModbusInverter, NodeInverter
from controller.tick.mode import Modes
from drives.settings import MasterSettings

STANDING_SHARE = 1e-3  # of an axis' largest velocity: slower is standing ...
STANDING_S = 0.05  # ... for so long
SPEED_LOST_S = 0.5  # a spindle that has been at speed may sag for so long in the cut
IN_POSITION_S = 1.0  # the axes come to where motion has led them, before spindle, coolant and clamps act
FLOW_S = 2.0  # until coolant flows
FRESH_TICKS = 4  # what a drive says within these is of the order before
MIST, FLOOD = 1, 2

# Inputs that forbid motion while they are 0, the hardest first.
_INTERLOCKS = (
    ("estop", Fault.ESTOP_INPUT),
    ("power", Fault.POWER_LOST),
    ("tool_clamped", Fault.CLAMP),
    ("door", Fault.DOOR_OPEN),
)
_STAYS_BEFORE, _STAYS_AFTER = int(StaysOn.BEFORE), int(StaysOn.AFTER)
_MOVING = (Mode.RUNNING, Mode.HOMING, Mode.JOG)
_PROGRAM = (Mode.RUNNING, Mode.HOLD, Mode.STOPPING, Mode.FAULT, Mode.JOG)
# Looked up every tick, and an enum's members are slow to look up.
_OFF: Final = Mode.OFF
_READY: Final = Mode.READY
_RUNNING: Final = Mode.RUNNING
_HOMING: Final = Mode.HOMING
_JOG: Final = Mode.JOG
_FAULT: Final = Mode.FAULT
_NONE: Final = Fault.NONE
_DOOR_OPEN: Final = Fault.DOOR_OPEN


class SpindleDrive(Protocol):
    """What is needed of ``drives.cyclic.spindle``."""

    @property
    def at_speed(self) -> bool: ...
    @property
    def rev_min(self) -> float: ...
    def want_speed(self, rev_min: float, /) -> None: ...


class IoNode(Protocol):
    """What is needed of ``drives.cyclic.io_node``: words, bit n is input or output n."""

    @property
    def inputs(self) -> int: ...
    def fresh(self, now_s: float, consumer_s: float, /) -> bool: ...
    def write(self, outputs: int, /) -> None: ...
    def write_analogue(self, channel: int, counts: int, /) -> None: ...
    def write_speed(self, counts: int, /) -> None: ...
    @property
    def measured(self) -> int: ...
    @property
    def measurements(self) -> int: ...


class Clamped:
    """One clamped axis: what its clamp is told, and whether it has done so."""

    def __init__(self, index: int, axis: Axis, clamp: Clamp, io: Io, period_s: float) -> None:
        report = io.input(clamp.input)
        self.index = index
        self.bit = 1 << index
        self.is_open = False  # as told
        self._output = 1 << (io.output(clamp.output) or 0)
        self._closed = 0 if report is None else 1 << report
        self._most = round(clamp.open_s / period_s)
        self._told = 0  # ticks since it was told
        self._still = 0  # ticks in which the axis stood
        self._still_ticks = round(STANDING_S / period_s)
        self._step = STANDING_SHARE * axis.limits.velocity * period_s
        self._at = 0.0

    def turn(self, wanted: bool, actual: float, ticks: int) -> int:
        """Tells the clamp; its output's bit, 0 where it is to be closed."""
        moved = abs(actual - self._at)
        self._at = actual
        self._still = self._still + ticks if moved <= self._step * ticks else 0
        self._told += ticks
        if wanted is not self.is_open and (wanted or self._still >= self._still_ticks):
            self.is_open = wanted
            self._told = 0
        return self._output if self.is_open else 0

    def is_done(self, inputs: int) -> bool:
        """Whether it is as told; without an input, when its time is over."""
        if not self._closed:
            return self._told >= self._most
        return bool(inputs & self._closed) is not self.is_open and self._told >= FRESH_TICKS

    def is_late(self, inputs: int) -> bool:
        return self._told > self._most and not self.is_done(inputs)


class Peripherals:
    """All of them together.

    Read: ``present`` (there is anything to ``watch``), ``waiting`` (motion must stand), ``feed_stopped``
    (it must where the program lets the input feed_stop count), ``rev_min`` and ``coolant`` (as told now),
    ``inputs`` and ``outputs`` (words by the machine file, 1 = on), ``analogue`` (values of the analogue
    outputs by their number, 0 for those that are not there).
    """

    def __init__(
        self,
        machine: Machine,
        spindle: SpindleDrive | None = None,
        nodes: Sequence[IoNode] = (),
        coupling: Coupling | None = None,
        slot: InverterSlot | None = None,
    ) -> None:
        """``slot``: of an inverter on a serial line; None: nobody answers in it."""
        period_s, io = machine.period_s, machine.io
        self._inverter = _inverter(machine, nodes, slot)
        self._spindle: SpindleDrive | None = spindle if self._inverter is None else self._inverter
        self._coupling = Coupling(machine, None) if coupling is None else coupling
        self._barred = False  # the door is open, the axes stand: no thread turns the spindle either
        self._node = nodes[0] if nodes and io is not None else None
        self._consumer_s = MasterSettings(period_s=period_s).consumer_s
        self._answers = self._spindle is not None or self._node is not None  # there is something to wait for
        self.present = self._answers or machine.spindle is not None
        self._flip_inputs, self._flip_outputs = _flips(io)
        self._interlocks = _interlocks(io)
        has_ends = any(axis.limit_inputs is not None for axis in machine.axes)
        self._guards_motion = bool(self._interlocks) or has_ends  # the inputs must be known
        self._flow, self._mist, self._flood = _masks(io)
        self._feed_stop = _mask(io.inputs, ["feed_stop"]) if io is not None else 0
        self._clamps = _clamps(machine, io) if self._node is not None else ()
        kinds = MIST * bool(self._mist) | FLOOD * bool(self._flood)
        self._coolants = tuple(kind for kind in range(4) if kind & ~kinds == 0)
        every = sum(clamp.bit for clamp in self._clamps)
        self._clamp_masks = tuple(mask for mask in range(every + 1) if mask & ~every == 0)
        spin_up_s = machine.spindle.spin_up_s if machine.spindle is not None else 0.0
        self._spin_up_ticks = round(spin_up_s / period_s)
        self._sag_ticks = round(SPEED_LOST_S / period_s)
        self._flow_ticks = round(FLOW_S / period_s)
        self._switches, self._held = _switches(io)
        self._beside = _beside(machine.changer, io)
        self._switched = self._lines = 0  # outputs of programs: as numbered there, and their bits of the node
        self._analogue = io.analogue_out if io is not None and self._node is not None else ()
        self._gears = _gears(machine)
        self._max_rev_min = machine.spindle.max_rev_min if self._spindle and machine.spindle else 0.0
        self._limit = math.inf  # rev/min, of the tool: the override leads no further
        self._wanted = (0.0, 0, 0)  # rev/min, coolant, open clamps: what the program says, or the hand
        self._by_hand = False  # without a program
        self._handed_over = False  # what the last program has left on, to the hand
        self._programmed = 0.0  # rev/min, before the override
        self._homing = 0  # clamps to be open for an axis that homes, or is jogged
        self._was_running = self._was_homing = self._was_fault = False
        self._told: Piece | None = None  # what the program says, until the axes are in position
        self._arriving = 0  # ticks since
        self._awaited: Awaited | None = None  # an input that the program waits for ...
        self._was_other = False  # ... and whether it has been seen to be otherwise
        self._most_arriving = round(IN_POSITION_S / period_s)
        self._waited = self._sagged = self._dry = 0  # ticks
        self._lifted = self._lifted_after = 0  # guards that do not count while a step waits, and then
        self.waiting = False
        self.feed_stopped = False
        self.rev_min = 0.0
        self.coolant = 0
        self.inputs = 0
        self.outputs = 0
        self.analogue, self._levels = [0.0] * ANALOGUE, [0.0] * ANALOGUE
        self._leave_analogue()

    @property
    def at_speed(self) -> bool:
        """Whether the spindle turns as told; true without a spindle of ours."""
        if self._gears and self.rev_min and not self._turns()[0]:
            return False  # no gear is in
        return self._spindle is None or self._coupling.active or self._spindle.at_speed

    @property
    def actual_rev_min(self) -> float:
        if self._spindle is None:
            return self.rev_min
        turns, _ = self._turns()
        return self._spindle.rev_min / turns if turns else 0.0

    def _turns(self) -> tuple[float, float]:
        """In one turn of the spindle, of what turns it, and its largest speed in this gear; 0: none is in."""
        if not self._gears:
            return 1.0, math.inf
        switched = self._switched
        return next(
            ((t, most) for on, off, t, most in self._gears if switched & (on | off) == on), (0.0, 0.0)
        )

    # -- what comes from outside

    def tell(self, piece: Piece) -> None:
        """The program has come to a piece that ``sets``."""
        if self._answers:
            self._told, self._arriving = piece, 0
            self._wait()
        else:  # a spindle that the operator switches, at the stop that asks him
            self._wanted = (piece.spindle_rev_min, piece.coolant, piece.open_clamps)

    def by_hand(self, request: Request, value: float, mode: Mode) -> bool:
        """What an operator's hand wants of spindle, coolant or clamps; False for what is not there.

        Or a changer that is prepared, of an output of its own.
        """
        if request is Request.PREPARE:
            return self._prepare(value)
        new = mode is Mode.READY and not self._by_hand
        rev_min, coolant, is_open = (0.0, 0, 0) if new else self._wanted
        if request is Request.SPINDLE and abs(value) <= min(self._max_rev_min, self._turns()[1]):
            rev_min, self._limit = value, abs(value)
        elif request is Request.COOLANT and value in self._coolants:
            coolant = int(value)
        elif request is Request.CLAMPS and value in self._clamp_masks:
            is_open = int(value)
        else:
            return False
        self._wanted, self._by_hand = (rev_min, coolant, is_open), mode is Mode.READY
        return True

    def _prepare(self, value: float) -> bool:
        """All outputs of a step beside the cut at once, or none."""
        if not (0.0 < value < BESIDE * BESIDE) or value != int(value):
            return False
        off, on = divmod(int(value), BESIDE)
        if (on | off) >> len(self._beside):
            return False
        switched = self._switched
        for i, bit in enumerate(self._beside):
            switched = switched | bit if on >> i & 1 else switched & ~bit if off >> i & 1 else switched
        self._switch_to(switched)
        return True

    def switch(self, outputs: tuple[int, int, Sequence[tuple[int, float]]]) -> None:
        """Outputs of the program, on and off from now on, and analogue ones: at their place in the path."""
        on, off, levels = outputs
        self._switch_to(self._switched & ~off | on)
        for number, value in levels:
            self._levels[number] = value

    def _lead(self, node: IoNode) -> None:
        """Each analogue output to what is wanted of it."""
        for number, out in enumerate(self._analogue):
            value = self._levels[number]
            if value != self.analogue[number]:
                self.analogue[number] = value
                node.write_analogue(out.channel, out.counts(value))

    def _leave_analogue(self) -> None:
        """All of them to rest."""
        for number, out in enumerate(self._analogue):
            self._levels[number] = out.idle

    def lead_spindle(self) -> None:
        """Along a thread the path leads it, tick by tick."""
        coupling = self._coupling
        if coupling.active and not self._barred:
            coupling.lead()
            self.rev_min = self._programmed = 60.0 * coupling.rev_s

    def _switch_to(self, switched: int) -> None:
        if switched == self._switched:
            return
        self._switched, self._lines = switched, 0
        for i, line in enumerate(self._switches):
            if switched >> i & 1:
                self._lines |= line

    def opens_for(self, axes: int) -> bool:
        """Opens the clamps of axes (bit mask) that home or are jogged next; True when they are open."""
        if not self._clamps:
            return True
        self._homing = axes
        mine = [clamp for clamp in self._clamps if clamp.bit & axes]
        return all(clamp.is_open and clamp.is_done(self.inputs) for clamp in mine)

    def late_to_open(self) -> int:
        """Index of an axis whose clamp has not opened in time for that, or -1."""
        for clamp in self._clamps:
            if clamp.bit & self._homing and clamp.is_open and clamp.is_late(self.inputs):
                return clamp.index
        return -1

    def _wait(self) -> None:
        self.waiting, self._waited = self._answers, 0

    def coolant_off(self) -> None:
        """The tick is about to end by an error of its own: a spindle by an inverter stops, clamps stay."""
        if self._inverter is not None:
            self._inverter.stop()
        if self._node is not None:
            spindle = self._inverter.own_outputs if self._inverter is not None else 0
            self._node.write((self.outputs & ~(self._mist | self._flood | spindle)) ^ self._flip_outputs)

    # -- every tick

    def watch(
        self,
        now_s: float,
        modes: Modes,
        actual: Sequence[float],
        standing: bool,
        ticks: int,
        spindle_override: float = 1.0,
    ) -> None:
        """Reads the inputs, judges them, and tells spindle, coolant and clamps what is due.

        ``standing``: the commanded joints stand; ``actual``: mm, rad; ``spindle_override``: share.
        """
        open_door = self._read(now_s, modes)
        if self._told is not None:
            self._arrive(self._told, modes, ticks)
        self._tell_all(modes, actual, standing, open_door, ticks, spindle_override)
        running = modes.running
        if running and not self._was_running:
            self._wait()
        self._was_running = running
        if running and self._answers:
            self._judge(modes, ticks)

    def _read(self, now_s: float, modes: Modes) -> bool:
        """The inputs, and what they forbid; True if the door is open."""
        if self._node is None:
            return False
        if not self._node.fresh(now_s, self._consumer_s):
            modes.forbid(Fault.IO_LOST if self._guards_motion else Fault.NONE)
            return False
        self.inputs = inputs = self._node.inputs ^ self._flip_inputs
        guards = inputs | self._lifted
        self.feed_stopped = self._feed_stop & guards != self._feed_stop
        found = _NONE
        for mask, fault in self._interlocks:
            if not guards & mask:
                found = fault
                break
        modes.forbid(found)
        if found is not _NONE:
            self._forbid(found, modes)
        return found is _DOOR_OPEN

    def _forbid(self, found: Fault, modes: Modes) -> None:
        if found in (Fault.ESTOP_INPUT, Fault.POWER_LOST):
            if modes.mode is not Mode.FAULT or modes.fault is not found:
                modes.fail(found, -1)
        elif modes.mode in _MOVING or (modes.mode is Mode.HOLD and self.rev_min):
            modes.fail(found, -1)

    def _tell_all(
        self,
        modes: Modes,
        actual: Sequence[float],
        standing: bool,
        open_door: bool,
        ticks: int,
        share: float,
    ) -> None:
        mode = modes.mode
        self._hand_over(modes)
        given_up = mode is _FAULT and (standing or not modes.on_path)
        by_hand = self._by_hand and mode in (_READY, _JOG) and not open_door
        if given_up or (not by_hand and (self._by_hand or mode not in _PROGRAM)):
            self._wanted, self.waiting, self._awaited, self._by_hand = (0.0, 0, 0), False, None, False
            self._lifted = self._lifted_after = 0
            self._coupling.end()
            self._switch_to(self._switched & self._held)
            self._leave_analogue()
        if mode is _HOMING or mode is _JOG:
            self._was_homing = True
        elif self._was_homing or mode is not _OFF:
            self._homing, self._was_homing = 0, False
        rev_min, coolant, is_open = self._wanted
        self._barred = open_door and standing
        if self._barred:
            rev_min, coolant = 0.0, 0
        self.coolant = coolant
        if self._barred or not self._coupling.active:
            self._turn(rev_min, modes, share)
        if self._inverter is not None:
            self._drive_inverter(self._inverter, modes, ticks)
        if self._node is not None:
            self._put_out(is_open | self._homing, actual, ticks)

    def _hand_over(self, modes: Modes) -> None:
        """What the hand has switched on becomes the program's, and what that leaves on is the hand's."""
        if modes.mode is _RUNNING:
            self._by_hand = self._by_hand and not modes.stays_on & _STAYS_BEFORE
            self._handed_over = False
        elif modes.ended and modes.mode is _READY and not self._handed_over:
            self._handed_over = True
            if modes.stays_on & _STAYS_AFTER:
                rev_min, coolant, _ = self._wanted
                self._wanted, self._by_hand = (rev_min, coolant, 0), True
                self.waiting, self._awaited, self._lifted, self._lifted_after = False, None, 0, 0
                self._coupling.end()

    def _turn(self, rev_min: float, modes: Modes, share: float) -> None:
        if rev_min != self._programmed and not self.waiting and modes.running:
            self._wait()
        self._programmed = rev_min
        rev_min = self._overridden(rev_min, share)
        if rev_min != self.rev_min:
            self._sagged = -self._spin_up_ticks  # it has that long to come to it
        self.rev_min = rev_min
        if self._spindle is not None:
            self._spindle.want_speed(rev_min * self._turns()[0] if self._gears else rev_min)

    def _drive_inverter(self, inverter: InverterSpindle, modes: Modes, ticks: int) -> None:
        """What it is told; a fault of its own stops the path, and is reset with the machine's."""
        if self._was_fault and modes.mode is not Mode.FAULT:
            inverter.reset()
        self._was_fault = modes.mode is Mode.FAULT
        inverter.step(self.inputs, ticks)
        if inverter.failed and not self._was_fault:
            modes.fail(Fault.SPINDLE_LOST, -1)

    def _overridden(self, rev_min: float, share: float) -> float:
        """What the spindle is told; one that is switched by hand turns as the program says."""
        if share == 1.0 or self._max_rev_min == 0.0:
            return rev_min
        most = min(self._max_rev_min, self._limit, max(self._turns()[1], abs(rev_min)))
        return max(-most, min(most, rev_min * share))

    def _arrive(self, told: Piece, modes: Modes, ticks: int) -> None:
        """What the program says counts where motion has led the axes, not on the way there."""
        if modes.mode not in _PROGRAM or modes.mode is Mode.FAULT:
            self._told = None
            return
        late = modes.not_in_position()
        self._arriving += ticks
        if late < 0:
            self._wanted = (told.spindle_rev_min, told.coolant, told.open_clamps)
            self._limit = told.max_rev_min
            self._coupling.end()
            self.switch(told.outputs)
            self._awaited, self._was_other = told.awaits, False
            if told.lifts is not None:
                self._lifted, self._lifted_after = told.lifts
            self._told = None
            self._wait()
        elif self._arriving > self._most_arriving:
            self._told = None
            modes.fail(Fault.FOLLOWING_ERROR, late)

    def _put_out(self, is_open: int, actual: Sequence[float], ticks: int) -> None:
        assert self._node is not None
        outputs = (self._mist if self.coolant & MIST else 0) | (self._flood if self.coolant & FLOOD else 0)
        outputs |= self._lines
        for clamp in self._clamps:
            outputs |= clamp.turn(bool(clamp.bit & is_open), actual[clamp.index], ticks)
        if self._inverter is not None:
            outputs |= self._inverter.outputs
            self._inverter.put_out(self._node)
        self.outputs = outputs
        self._node.write(outputs ^ self._flip_outputs)
        self._lead(self._node)

    # -- judgement, while the program runs

    def _judge(self, modes: Modes, ticks: int) -> None:
        for clamp in self._clamps:
            if clamp.is_late(self.inputs):
                modes.fail(Fault.CLAMP, clamp.index)
                return
        if self.waiting:
            if self._told is None:
                self._await(modes, ticks)
        elif self._coupling.lags or self._coupling.deaf:
            modes.fail(Fault.SPINDLE_LAGS if self._coupling.lags else Fault.SPINDLE_LOST, -1)
        elif self.at_speed:
            self._sagged = 0
        else:
            self._sagged += ticks
            if self._sagged > self._sag_ticks:
                self._sagged = 0
                modes.fail(Fault.SPINDLE_NOT_AT_SPEED, -1)
        self._look_for_flow(modes, ticks)

    def _await(self, modes: Modes, ticks: int) -> None:
        self._waited += ticks
        spindle_done = self._spindle is None or (self._waited >= FRESH_TICKS and self.at_speed)
        if not spindle_done:
            if self._waited > self._spin_up_ticks:
                modes.fail(Fault.SPINDLE_NOT_AT_SPEED, -1)
            return
        wanted = self._wanted[2]
        for clamp in self._clamps:
            if clamp.is_open is not bool(clamp.bit & wanted) or not clamp.is_done(self.inputs):
                return
        if self._awaited is not None and not self._has_come(self._awaited):
            if self._waited > self._awaited.ticks:
                modes.fail(Fault.INPUT_MISSING, -1)
            return
        self.waiting, self._awaited, self._lifted = False, None, self._lifted_after

    def _has_come(self, awaited: Awaited) -> bool:
        if bool(self.inputs & awaited.mask) is not awaited.on:
            self._was_other = True
            return False
        return self._was_other or not awaited.edge

    def _look_for_flow(self, modes: Modes, ticks: int) -> None:
        if not self._flow or not self.coolant or self.inputs & self._flow:
            self._dry = 0
            return
        self._dry += ticks
        if self._dry > self._flow_ticks:
            self._dry = 0
            modes.fail(Fault.COOLANT_LOST, -1)


def _flips(io: Io | None) -> tuple[int, int]:
    """Bits of inputs and outputs whose wire is 0 when they are on."""
    if io is None:
        return 0, 0
    return _mask(io.inputs, io.inverted), _mask(io.outputs, io.inverted)


def _mask(bits: Sequence[tuple[str, int]], names: Sequence[str]) -> int:
    return sum(1 << bit for name, bit in bits if name in names)


def _interlocks(io: Io | None) -> tuple[tuple[int, Fault], ...]:
    if io is None:
        return ()
    rows = ((io.input(name), fault) for name, fault in _INTERLOCKS)
    return tuple((1 << bit, fault) for bit, fault in rows if bit is not None)


def _masks(io: Io | None) -> tuple[int, int, int]:
    """Input that shows the coolant's flow, outputs of mist and of flood; 0 = there is none."""
    if io is None:
        return 0, 0, 0
    return _mask(io.inputs, ["coolant_flow"]), _mask(io.outputs, ["mist"]), _mask(io.outputs, ["coolant"])


def _inverter(machine: Machine, nodes: Sequence[IoNode], slot: InverterSlot | None) -> InverterSpindle | None:
    """What turns the spindle, where that is no drive of its own."""
    spindle, io = machine.spindle, machine.io
    if spindle is None:
        return None
    if spindle.modbus is not None:
        return ModbusInverter(spindle, spindle.modbus, slot or InverterSlot(), machine.period_s)
    if spindle.inverter is None or io is None or not nodes:
        return None
    return NodeInverter(spindle, spindle.inverter, io, machine.period_s, nodes[0])


def _switches(io: Io | None) -> tuple[tuple[int, ...], int]:
    """Of each output of programs its bit of the node; and which of them stay as they are."""
    if io is None:
        return (), 0
    lines = tuple(_mask(io.outputs, [name]) for name in io.switched)
    held = (*io.held, *io.changer_out, *io.gear_out)  # a changer that was stopped midway stays as it is
    return lines, sum(1 << i for i, name in enumerate(io.switched) if name in held)


def _gears(machine: Machine) -> tuple[tuple[int, int, float, float], ...]:
    """Of each gear its outputs on and off, as programs number them, its turns, and its largest speed."""
    spindle, io = machine.spindle, machine.io
    if spindle is None or io is None:
        return ()
    rows = ((*io.switched_masks(one.on, one.off), one.turns, one.high_rev_min) for one in spindle.gears)
    return tuple(rows)


def _beside(changer: Changer | None, io: Io | None) -> tuple[int, ...]:
    """Of what a changer prepares with, among the outputs of programs."""
    names = changer.beside if changer is not None and io is not None else ()
    return tuple(1 << io.switched.index(name) for name in names) if io is not None else ()


def _clamps(machine: Machine, io: Io | None) -> tuple[Clamped, ...]:
    if io is None:
        return ()
    return tuple(
        Clamped(i, axis, axis.clamp, io, machine.period_s)
        for i, axis in enumerate(machine.axes)
        if axis.clamp is not None
    )
