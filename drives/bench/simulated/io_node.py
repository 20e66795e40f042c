"""Digital inputs and outputs on the virtual bus: a CANopen ``Device`` after CiA 401.

    6000h  inputs, 8 each        6005h  interrupts on or off        6200h  outputs, 8 each
    6002h  their polarity        6006h  bits whose every change,    6202h  their polarity
                                 6007h  rise, 6008h  fall counts    6208h  bits that may be written
                                                                    6206h, 6207h  what they do after an error
    6411h  analogue outputs, 16 bits each; 6443h, 6444h what they do after an error

An input's change goes out by a TPDO on change (transmission type 255) where its
interrupt is on. When the master falls silent, or takes the node out of operation,
outputs whose error mode (6206h) is 1 take their error value (6207h): by default all off.

``wire`` stands for the machine around the node: a valve opens, a switch closes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from drives.bench.simulated.data_sheet import EDS, key
from drives.bench.simulated.device import Device
from drives.bench.simulated.parameters import Parameters
from drives.text_file import Source

IO_EDS = EDS.with_name("simulated_io.eds")
INPUTS, INPUT_POLARITY, INTERRUPTS, ANY, RISING, FALLING = 0x6000, 0x6002, 0x6005, 0x6006, 0x6007, 0x6008
OUTPUTS, OUTPUT_POLARITY, ERROR_MODE, ERROR_VALUE, FILTER = 0x6200, 0x6202, 0x6206, 0x6207, 0x6208
ANALOGUE, ANALOGUE_ERROR_MODE, ANALOGUE_ERROR_VALUE = 0x6411, 0x6443, 0x6444
SIMULATED_INPUTS_AT = key(0x2004)

Watcher = Callable[[int, float], None]  # called with all outputs (bit n = output n) and the time


class IoNode(Device):
    """One node; attach it to a ``SteppedBus``. Bit n of a word is input or output n, electrically."""

    def __init__(self, node: int, parameters: Parameters = Parameters(), eds: Source = IO_EDS) -> None:  # noqa: B008
        super().__init__(node, parameters, eds)
        self.watchers: list[Watcher] = []
        self.inputs = 0
        self.outputs = 0
        self._shown = 0  # the inputs that the dictionary and with it the TPDOs show
        self._wires: list[tuple[int, int, float, bool]] = []
        dictionary = self.dictionary
        self._banks = range(1, dictionary.get(INPUTS) + 1)
        for bank in self._banks:
            dictionary.readers[key(INPUTS, bank)] = partial(self._byte, bank)
            dictionary.guards[key(INPUTS, bank)] = self._look_at_inputs
            dictionary.writers[key(OUTPUTS, bank)] = partial(self._write, bank)
        dictionary.writers[SIMULATED_INPUTS_AT] = lambda word: self.set_inputs(word, self.now_s)
        dictionary.readers[SIMULATED_INPUTS_AT] = lambda: self.inputs
        self.configure()

    # -- the machine around it

    def set_input(self, number: int, on: bool, now_s: float) -> None:
        """One input changes."""
        word = self.inputs | 1 << number if on else self.inputs & ~(1 << number)
        self.set_inputs(word, now_s)

    def set_inputs(self, word: int, now_s: float) -> None:
        """All inputs, from now on."""
        rose, fell = word & ~self.inputs, self.inputs & ~word
        self.now_s = now_s
        self.inputs = word
        told = (rose | fell) & self._mask(ANY) | rose & self._mask(RISING) | fell & self._mask(FALLING)
        if told and self.dictionary.values[key(INTERRUPTS)]:
            self._look_at_inputs()
            self.process.look(now_s)

    def wire(self, output: int, wired: int, delay_s: float = 0.0, inverted: bool = False) -> None:
        """Input ``wired`` follows an output, so much later: a clamp and its switch, for one."""
        self._wires.append((output, wired, delay_s, inverted))
        self._pull(self._wires[-1], self.now_s)

    def unwire(self, wired: int) -> None:
        """Somebody else shows that input."""
        self._wires = [wire for wire in self._wires if wire[1] != wired]

    def _pull(self, wire: tuple[int, int, float, bool], now_s: float) -> None:
        output, wired, delay_s, inverted = wire
        on = bool(self.outputs >> output & 1) != inverted
        if delay_s > 0.0 and self.link is not None:
            self.alarm(f"wire {wired}", now_s + delay_s, lambda at_s: self.set_input(wired, on, at_s))
        else:
            self.set_input(wired, on, now_s)

    # -- inputs

    def _mask(self, index: int) -> int:
        """A bit per input or output, from the banks of one object."""
        values = self.dictionary.values
        return sum(values.get(key(index, bank), 0) << 8 * (bank - 1) for bank in self._banks)

    def _byte(self, bank: int) -> int:
        return (self._shown ^ self._mask(INPUT_POLARITY)) >> 8 * (bank - 1) & 0xFF

    def _look_at_inputs(self) -> None:
        """From now on the dictionary shows the inputs as they are."""
        self._shown = self.inputs

    def _on_sync(self, frame: bytes, now_s: float) -> None:
        self._look_at_inputs()
        super()._on_sync(frame, now_s)

    # -- outputs

    def configure(self) -> None:
        super().configure()
        self._drive_outputs(self.now_s)

    def _write(self, bank: int, value: int) -> None:
        self.dictionary.values[key(OUTPUTS, bank)] = value
        self._drive_outputs(self.now_s)

    def _drive_outputs(self, now_s: float) -> None:
        """The written outputs reach the terminals, those that the filter lets pass."""
        passing = self._mask(FILTER)
        written = self._mask(OUTPUTS) ^ self._mask(OUTPUT_POLARITY)
        self._set_outputs(self.outputs & ~passing | written & passing, now_s)

    def _set_outputs(self, word: int, now_s: float) -> None:
        before, self.outputs = self.outputs, word
        if word == before:
            return
        for watcher in self.watchers:
            watcher(word, now_s)
        for wire in self._wires:
            if (word ^ before) >> wire[0] & 1:
                self._pull(wire, now_s)

    def _lose_connection(self, now_s: float) -> None:
        """Error modes and values, whatever has been written before."""
        values = self.dictionary.values
        for bank in self._banks:
            mode, safe = values[key(ERROR_MODE, bank)], values[key(ERROR_VALUE, bank)]
            where = key(OUTPUTS, bank)
            values[where] = values[where] & ~mode | safe & mode
        for channel in range(1, values.get(key(ANALOGUE), 0) + 1):
            if values[key(ANALOGUE_ERROR_MODE, channel)]:
                values[key(ANALOGUE, channel)] = values[key(ANALOGUE_ERROR_VALUE, channel)]
        self._drive_outputs(now_s)

    def analogue(self, channel: int) -> int:
        """Counts of an analogue output, from 1."""
        return int(self.dictionary.values[key(ANALOGUE, channel)])

    def _switch_off(self) -> None:
        """Without supply, or while it starts, no output is on."""
        for channel in range(1, self.dictionary.values.get(key(ANALOGUE), 0) + 1):
            self.dictionary.values[key(ANALOGUE, channel)] = 0
        self._set_outputs(0, self.now_s)
