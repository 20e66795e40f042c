"""The object dictionary of a simulated drive, built from its electronic data sheet.

Entries are addressed by one key, index * 256 + sub-index. Values are integers
(or bytes for strings). Live objects have a reader, objects with consequences a
writer; both are given by the drive.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from enum import IntEnum

from drives.bench.simulated.data_sheet import (
    EDS,
    READABLE,
    WRITABLE,
    Variable,
    defaults,
    dummies,
    key,
    load,
    number,
)
from drives.profile import Override
from drives.text_file import Source

__all__ = ["EDS", "Abort", "Code", "Dictionary", "Variable", "key"]


class Code(IntEnum):
    """SDO abort codes (CiA 301, 7.2.4.3.17, table 22): all of them, as a real drive may give any."""

    TOGGLE = 0x0503_0000
    TIMEOUT = 0x0504_0000
    COMMAND = 0x0504_0001
    BLOCK_SIZE = 0x0504_0002
    SEQUENCE = 0x0504_0003
    CRC = 0x0504_0004
    MEMORY = 0x0504_0005
    ACCESS = 0x0601_0000  # unsupported access to an object
    WRITE_ONLY = 0x0601_0001
    READ_ONLY = 0x0601_0002
    NO_OBJECT = 0x0602_0000
    NOT_MAPPABLE = 0x0604_0041
    PDO_LENGTH = 0x0604_0042
    INCOMPATIBLE = 0x0604_0043  # parameters that exclude each other
    INTERNAL = 0x0604_0047
    HARDWARE = 0x0606_0000
    LENGTH = 0x0607_0010
    TOO_LONG = 0x0607_0012
    TOO_SHORT = 0x0607_0013
    NO_SUB_INDEX = 0x0609_0011
    VALUE = 0x0609_0030
    TOO_HIGH = 0x0609_0031
    TOO_LOW = 0x0609_0032
    MAX_BELOW_MIN = 0x0609_0036
    NO_RESOURCE = 0x060A_0023
    GENERAL = 0x0800_0000
    NOT_STORED = 0x0800_0020
    LOCAL_CONTROL = 0x0800_0021
    DEVICE_STATE = 0x0800_0022
    NO_DICTIONARY = 0x0800_0023
    NO_DATA = 0x0800_0024


class Abort(Exception):
    """An access that the drive refuses."""

    def __init__(self, code: Code) -> None:
        super().__init__(f"SDO abort {code:#010x} ({code.name})")
        self.code = code


MEMORY_BYTES = 65536  # the longest string or domain the drive can hold
PROFILE_AT = 0x2000 << 8  # from here on the application's objects


def _better(variable: Variable, known: Override) -> Variable:
    return replace(
        variable,
        low=variable.low if known.low is None else str(known.low),
        high=variable.high if known.high is None else str(known.high),
        access=known.access or variable.access,
        mappable=variable.mappable if known.mappable is None else known.mappable,
    )


class Dictionary:
    """Values of one drive. Raises Abort for every access the standard refuses.

    With another drive's data sheet the bus sees that one's objects only; what the
    simulation needs besides keeps the values of its own sheet.
    """

    def __init__(self, node: int, path: Source = EDS) -> None:
        self.path = path
        self.variables = load(path)
        self.dummies = dummies(path)
        self.node = node
        self._indexes = {k >> 8 for k in self.variables}
        self.values: dict[int, int] = {}
        self.changes = 0  # how often something was written, for who looks every period
        self.strings: dict[int, bytes] = {}
        self.readers: dict[int, Callable[[], int]] = {}
        self.writers: dict[int, Callable[[int], None]] = {}  # called before the value is stored
        self.guards: dict[int, Callable[[], None]] = {}  # called before a read; may refuse it
        self.factory: dict[int, int] = {}  # defaults of this very device, over those of its sheet
        self.refusals: dict[int, Code] = {}  # injected: every access to this key fails so
        self.missing = False  # injected: the drive could not build its dictionary
        self.local_control = False  # a panel or tool at the drive has it: no writing from the bus
        self.reset(0x0000, 0xFFFF)

    def reset(self, first: int, last: int) -> None:
        """Defaults for the indexes first .. last (NMT reset node, reset communication)."""
        self.changes += 1
        low, high = key(first), key(last, 0xFF)
        numbers = defaults(self.path, self.node)
        for source in (numbers, self.factory):
            self.values.update({where: value for where, value in source.items() if low <= where <= high})
        for where, variable in self.variables.items():
            if low <= where <= high and not variable.size:
                self.strings[where] = variable.default.encode()

    def leave_out(self, indexes: Collection[int]) -> None:
        """The bus does not see these objects any more; the device keeps their values to itself."""
        self.variables = {where: v for where, v in self.variables.items() if where >> 8 not in indexes}
        self._indexes -= set(indexes)

    def believe(self, known: Collection[Override]) -> None:
        """The device does what its sheet is wrong about; what the sheet lacks stays away."""
        for one in known:
            where = key(one.index, one.sub)
            if where in self.variables:
                self.variables = {**self.variables, where: _better(self.variables[where], one)}
            if one.default is not None:
                self.factory[where] = self.values[where] = one.default

    def has(self, index: int, sub: int = 0) -> bool:
        return key(index, sub) in self.variables

    def get(self, index: int, sub: int = 0) -> int:
        """A value as the drive itself sees it: no access check."""
        where = index << 8 | sub
        reader = self.readers.get(where)
        return self.values[where] if reader is None else reader()

    def put(self, where: int, value: int) -> None:
        """Write by key as a PDO does: consequences yes, access check no."""
        writer = self.writers.get(where)
        if writer is not None:
            writer(value)
        self.values[where] = value
        self.changes += 1

    def read(self, index: int, sub: int) -> bytes:
        """Upload."""
        variable = self._find(index, sub)
        if variable.access not in READABLE:
            raise Abort(Code.WRITE_ONLY)
        where = key(index, sub)
        if where in self.guards:
            self.guards[where]()
        if not variable.size:
            return self.strings[where]
        value = self.get(index, sub) & (1 << 8 * variable.size) - 1
        return value.to_bytes(variable.size, "little")

    def write(self, index: int, sub: int, data: bytes) -> None:
        """Download."""
        variable = self.writable(index, sub)
        if not variable.size:
            if len(data) > MEMORY_BYTES:
                raise Abort(Code.MEMORY)
            self.strings[key(index, sub)] = data
            return
        if len(data) != variable.size:
            raise Abort(Code.TOO_LONG if len(data) > variable.size else Code.TOO_SHORT)
        value = int.from_bytes(data, "little", signed=variable.signed)
        self._check_range(variable, value)
        self.put(key(index, sub), value)

    def writable(self, index: int, sub: int) -> Variable:
        """The variable of a download that may begin. Raises Abort."""
        variable = self._find(index, sub)
        if variable.access not in WRITABLE:
            raise Abort(Code.READ_ONLY)
        if self.local_control and key(index, sub) >= PROFILE_AT:
            raise Abort(Code.LOCAL_CONTROL)
        return variable

    def _check_range(self, variable: Variable, value: int) -> None:
        if variable.low and value < number(variable.low, self.node):
            raise Abort(Code.TOO_LOW)
        if variable.high and value > number(variable.high, self.node):
            raise Abort(Code.TOO_HIGH)

    def _find(self, index: int, sub: int) -> Variable:
        if self.missing:
            raise Abort(Code.NO_DICTIONARY)
        variable = self.variables.get(key(index, sub))
        if variable is None:
            raise Abort(Code.NO_SUB_INDEX if index in self._indexes else Code.NO_OBJECT)
        if self.refusals and key(index, sub) in self.refusals:
            raise Abort(self.refusals[key(index, sub)])
        return variable
