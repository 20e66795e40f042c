"""A drive's electronic data sheet (CiA 306-1) as variables by dictionary key.

The key of an entry is index * 256 + sub-index.
"""

from __future__ import annotations

import configparser
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

EDS = Path(__file__).parents[2] / "config" / "eds" / "simulated_drive.eds"

# CiA 301 data types: size in bytes and sign; all else is a string of bytes.
INTEGERS = {
    0x01: (1, False),
    0x02: (1, True),
    0x03: (2, True),
    0x04: (4, True),
    0x05: (1, False),
    0x06: (2, False),
    0x07: (4, False),
    0x15: (8, True),
    0x1B: (8, False),
}
READABLE = {"ro", "rw", "rww", "rwr", "const"}
WRITABLE = {"wo", "rw", "rww", "rwr"}
IDENTITY = {1: "VendorNumber", 2: "ProductNumber", 3: "RevisionNumber"}  # 1018h by sub-index
HEXADECIMAL = frozenset("0123456789ABCDEFabcdef")


@dataclass(frozen=True, slots=True)
class Variable:
    """One line of the data sheet; ``size`` 0 = string, ``default`` "" = not said."""

    name: str
    size: int
    signed: bool
    access: str
    default: str
    low: str
    high: str
    mappable: bool

    @property
    def to_tpdo(self) -> bool:
        """Whether a TPDO may hold it: an input of the process (CiA 306-1, "rww" is an output)."""
        return self.mappable and self.access in ("ro", "rw", "rwr")

    @property
    def to_rpdo(self) -> bool:
        return self.mappable and self.access in ("wo", "rw", "rww")


def key(index: int, sub: int = 0) -> int:
    return index << 8 | sub


@lru_cache(maxsize=1)
def _parsed(path: Path) -> configparser.ConfigParser:
    """The sections of the sheet that is being read."""
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    with open(path, encoding="latin-1") as file:
        parser.read_file(file)
    return parser


@lru_cache(maxsize=8)
def load(path: Path = EDS) -> dict[int, Variable]:
    """Read a data sheet: variables by key. Raises OSError or configparser.Error."""
    parser = _parsed(path)
    variables = {}
    for section in parser.sections():
        index, _, sub = section.partition("sub")
        if len(index) == 4 and set(index) <= HEXADECIMAL and "DataType" in parser[section]:
            variables[key(int(index, 16), int(sub or "0", 16))] = _variable(parser[section])
    if "DeviceInfo" in parser:
        for sub_index, name in IDENTITY.items():
            _identify(variables, key(0x1018, sub_index), parser["DeviceInfo"].get(name, ""))
    return variables


def _identify(variables: dict[int, Variable], where: int, said: str) -> None:
    """A sheet may say who the drive is in its head only."""
    variable = variables.get(where)
    if variable is not None and not variable.default and said:
        variables[where] = replace(variable, default=said)


@lru_cache(maxsize=8)
def dummies(path: Path = EDS) -> frozenset[int]:
    """Data types that an RPDO may map to skip bits (CiA 306-1, DummyUsage)."""
    parser = _parsed(path)
    if "DummyUsage" not in parser:
        return frozenset()
    return frozenset(int(name[-4:], 16) for name, used in parser["DummyUsage"].items() if used.strip() == "1")


def _variable(section: configparser.SectionProxy) -> Variable:
    size, signed = INTEGERS.get(int(section["DataType"], 0), (0, False))
    default = section.get("ParameterValue", "") or section.get("DefaultValue", "")  # the former in a DCF
    return Variable(
        name=section["ParameterName"],
        size=size,
        signed=signed,
        access=section.get("AccessType", "ro").lower(),
        default=default.strip(),
        low=section.get("LowLimit", ""),
        high=section.get("HighLimit", ""),
        mappable=section.get("PDOMapping", "").strip() in ("1", "0x1", "0x01"),
    )


@lru_cache(maxsize=64)
def defaults(path: Path, node: int) -> dict[int, int]:
    """Numbers as after power-on, by key; not to be changed.

    What another drive's sheet leaves open has the value of the simulated drive's own.
    """
    own = {} if path == EDS else defaults(EDS, node)
    numbers = {where: v.default for where, v in load(path).items() if v.size}
    return own | {where: number(text, node) if text else own.get(where, 0) for where, text in numbers.items()}


def number(text: str, node: int) -> int:
    """A data sheet's number, possibly relative to the node id ("$NODEID+0x200")."""
    parts = text.upper().replace(" ", "").split("+")
    return sum(node if part == "$NODEID" else int(part, 0) for part in parts)
