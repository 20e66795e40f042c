"""An inverter on a serial line, by Modbus RTU (pymodbus) and the register map of its profile."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable
from typing import Any

from controller.ipc.inverter_slot import Commanded, Reported
from controller.machine import inverter_profiles
from controller.machine.inverter_profiles import NONE, Frequency, InverterProfile, Order, State
from controller.machine.spindle import Modbus

PAUSE_S = 0.012  # between messages: some inverters begin a new one after 10 ms of silence (Delta, MS300)
ANSWER_TIMEOUT_S = 0.2  # for one answer; a longer silence is tried once more, then it is a failure
MAX_SPAN = 16  # registers or coils that are read at once (WJ200: 16 registers)


class LineError(Exception):
    """No answer, or one that refuses."""


class InverterLine:
    """One inverter. What it was told is told anew after every failure: it may have been without power."""

    def __init__(self, modbus: Modbus, client: Any) -> None:
        """``client``: of pymodbus. Raises ConfigError where the profile is not there."""
        self._profile: InverterProfile = inverter_profiles.load(modbus.profile)
        self._per_hz, self._station, self._client = modbus.rev_min_per_hz, modbus.station, client
        profile = self._profile
        states = (profile.running, profile.fault)
        words = range(profile.actual.words)
        numbers = {one.register for one in states if one.register != NONE}
        numbers |= {profile.actual.register + n for n in words}
        self._registers = _spans(numbers)
        self._coils = _spans({one.coil for one in states if one.coil != NONE})
        self._told: float | None = None  # rev/min
        self._resets: int | None = None

    def exchange(self, wanted: Commanded) -> Reported:
        """Tell it what has changed, and ask how it is. Raises LineError."""
        try:
            if self._resets not in (None, wanted.resets):
                self._order(self._profile.reset)
                self._told = None
            self._resets = wanted.resets
            if wanted.rev_min != self._told:
                self._turn(wanted.rev_min)
                self._told = wanted.rev_min
            return self._ask(wanted.order)
        except LineError:
            self._told = None
            raise

    def _turn(self, rev_min: float) -> None:
        profile = self._profile
        if rev_min == 0.0:
            self._order(profile.stop)
            return
        self._write(profile.set_point, abs(rev_min) / self._per_hz)
        self._order(profile.forward if rev_min > 0.0 else profile.reverse)

    def _ask(self, order: int) -> Reported:
        first, profile = self._profile.first, self._profile
        registers: dict[int, int] = {}
        coils: dict[int, bool] = {}
        for low, count in self._registers:
            read = self._call(self._client.read_holding_registers, low - first, count=count).registers
            registers.update(zip(range(low, low + count), read, strict=False))
        for low, count in self._coils:
            bits = self._call(self._client.read_coils, low - first, count=count).bits
            coils.update(zip(range(low, low + count), bits, strict=False))
        try:
            counts = 0
            for n in range(profile.actual.words):
                counts = counts << 16 | registers[profile.actual.register + n]
            running, fault = (_is_so(one, registers, coils) for one in (profile.running, profile.fault))
        except KeyError as short:
            raise LineError(f"the answer lacks {short}") from short
        return Reported(counts / profile.actual.per_hz * self._per_hz, order, running, fault)

    def _order(self, orders: Iterable[Order]) -> None:
        for one in orders:
            if one.coil == NONE:
                self._call(self._client.write_register, one.register - self._profile.first, one.value)
            else:
                self._call(self._client.write_coil, one.coil - self._profile.first, one.value == 1)

    def _write(self, to: Frequency, hz: float) -> None:
        counts, address = round(hz * to.per_hz), to.register - self._profile.first
        if to.words == 1:
            self._call(self._client.write_register, address, counts)
        else:
            self._call(self._client.write_registers, address, [counts >> 16, counts & inverter_profiles.WORD])

    def _call(self, function: Callable[..., Any], address: int, *values: Any, **more: Any) -> Any:
        from pymodbus.exceptions import ModbusException

        try:
            answer = function(address, *values, device_id=self._station, **more)
        except (ModbusException, OSError) as error:  # pyserial's are OSErrors
            self._client.close()  # the adapter may have been unplugged: the next call opens it
            raise LineError(str(error)) from error
        if answer.isError():
            raise LineError(str(answer))
        time.sleep(PAUSE_S)
        return answer


def _is_so(state: State, registers: dict[int, int], coils: dict[int, bool]) -> bool:
    if state.coil != NONE:
        return bool(coils[state.coil])
    bits = registers[state.register] & state.mask
    return bool(bits) if state.value == NONE else bits == state.value


def _spans(numbers: Iterable[int]) -> list[tuple[int, int]]:
    """(first, count) of what is read at once."""
    found: list[tuple[int, int]] = []
    for number in sorted(numbers):
        if found and number - found[-1][0] < MAX_SPAN:
            found[-1] = (found[-1][0], number - found[-1][0] + 1)
        else:
            found.append((number, 1))
    return found


def opened(modbus: Modbus) -> InverterLine:
    """The line of a machine file; the port is opened with the first message, and again after each failure."""
    from pymodbus.client import ModbusSerialClient

    logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)  # each silence would be a line
    client = ModbusSerialClient(
        modbus.port,
        baudrate=modbus.baud,
        bytesize=int(modbus.frame[0]),
        parity=modbus.frame[1],
        stopbits=int(modbus.frame[2]),
        timeout=ANSWER_TIMEOUT_S,
        retries=1,
    )
    return InverterLine(modbus, client)
