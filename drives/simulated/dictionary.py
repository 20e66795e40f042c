"""The object dictionary of a simulated drive, built from its electronic data sheet.

Entries are addressed by one key, index * 256 + sub-index. Values are integers
(or bytes for strings). Live objects have a reader, objects with consequences a
writer; both are given by the drive.
"""

from __future__ import annotations

import configparser
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from pathlib import Path

EDS = Path(__file__).parents[2] / "config" / "eds" / "simulated_drive.eds"

# CiA 301 data types: size in bytes and sign; all else is a string of bytes.
INTEGERS = {
    1: (1, False),
    2: (1, True),
    3: (2, True),
    4: (4, True),
    5: (1, False),
    6: (2, False),
    7: (4, False),
}
READABLE = {"ro", "rw", "rww", "rwr", "const"}
WRITABLE = {"wo", "rw", "rww", "rwr"}


class Code(IntEnum):
    """SDO abort codes (CiA 301, table 22)."""

    TOGGLE = 0x0503_0000
    COMMAND = 0x0504_0001
    WRITE_ONLY = 0x0601_0001
    READ_ONLY = 0x0601_0002
    NO_OBJECT = 0x0602_0000
    NOT_MAPPABLE = 0x0604_0041
    PDO_LENGTH = 0x0604_0042
    TOO_LONG = 0x0607_0012
    TOO_SHORT = 0x0607_0013
    NO_SUB_INDEX = 0x0609_0011
    VALUE = 0x0609_0030
    TOO_HIGH = 0x0609_0031
    TOO_LOW = 0x0609_0032
    DEVICE_STATE = 0x0800_0022


class Abort(Exception):
    """An access that the drive refuses."""

    def __init__(self, code: Code) -> None:
        super().__init__(f"SDO abort {code:#010x} ({code.name})")
        self.code = code


@dataclass(frozen=True, slots=True)
class Variable:
    """One line of the data sheet; ``size`` 0 = string."""

    name: str
    size: int
    signed: bool
    access: str
    default: str
    low: str
    high: str
    mappable: bool


def key(index: int, sub: int = 0) -> int:
    return index << 8 | sub


@lru_cache(maxsize=8)
def load(path: Path = EDS) -> dict[int, Variable]:
    """Read a data sheet: variables by key. Raises OSError or configparser.Error."""
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    with open(path, encoding="latin-1") as file:
        parser.read_file(file)
    variables = {}
    for section in parser.sections():
        index, _, sub = section.partition("sub")
        if len(index) == 4 and set(index) <= set("0123456789ABCDEFabcdef") and "DataType" in parser[section]:
            variables[key(int(index, 16), int(sub or "0", 16))] = _variable(parser[section])
    return variables


def _variable(section: configparser.SectionProxy) -> Variable:
    size, signed = INTEGERS.get(int(section["DataType"], 0), (0, False))
    return Variable(
        name=section["ParameterName"],
        size=size,
        signed=signed,
        access=section.get("AccessType", "ro").lower(),
        default=section.get("DefaultValue", "0"),
        low=section.get("LowLimit", ""),
        high=section.get("HighLimit", ""),
        mappable=section.get("PDOMapping", "0").strip() == "1",
    )


def number(text: str, node: int) -> int:
    """A data sheet's number, possibly relative to the node id ("$NODEID+0x200")."""
    head, _, rest = text.upper().partition("$NODEID")
    return int(head or "0", 0) + (node + int(rest.lstrip("+") or "0", 0) if "$" in text else 0)


class Dictionary:
    """Values of one drive. Raises Abort for every access the standard refuses."""

    def __init__(self, node: int, path: Path = EDS) -> None:
        self.variables = load(path)
        self._node = node
        self._indexes = {k >> 8 for k in self.variables}
        self.values: dict[int, int] = {}
        self.strings: dict[int, bytes] = {}
        self.readers: dict[int, Callable[[], int]] = {}
        self.writers: dict[int, Callable[[int], None]] = {}  # called before the value is stored
        self.reset(0x0000, 0xFFFF)

    def reset(self, first: int, last: int) -> None:
        """Defaults for the indexes first .. last (NMT reset node, reset communication)."""
        for where, variable in self.variables.items():
            if first <= where >> 8 <= last and variable.size:
                self.values[where] = number(variable.default, self._node)
            elif not variable.size:
                self.strings[where] = variable.default.encode()

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

    def read(self, index: int, sub: int) -> bytes:
        """Upload."""
        variable = self._find(index, sub)
        if variable.access not in READABLE:
            raise Abort(Code.WRITE_ONLY)
        if not variable.size:
            return self.strings[key(index, sub)]
        value = self.get(index, sub) & (1 << 8 * variable.size) - 1
        return value.to_bytes(variable.size, "little")

    def write(self, index: int, sub: int, data: bytes) -> None:
        """Download."""
        variable = self._find(index, sub)
        if variable.access not in WRITABLE:
            raise Abort(Code.READ_ONLY)
        if not variable.size:
            self.strings[key(index, sub)] = data
            return
        if len(data) != variable.size:
            raise Abort(Code.TOO_LONG if len(data) > variable.size else Code.TOO_SHORT)
        value = int.from_bytes(data, "little", signed=variable.signed)
        self._check_range(variable, value)
        self.put(key(index, sub), value)

    def _check_range(self, variable: Variable, value: int) -> None:
        if variable.low and value < number(variable.low, self._node):
            raise Abort(Code.TOO_LOW)
        if variable.high and value > number(variable.high, self._node):
            raise Abort(Code.TOO_HIGH)

    def _find(self, index: int, sub: int) -> Variable:
        variable = self.variables.get(key(index, sub))
        if variable is None:
            raise Abort(Code.NO_SUB_INDEX if index in self._indexes else Code.NO_OBJECT)
        return variable
