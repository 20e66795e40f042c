"""A drive's electronic data sheet (CiA 306-1) as variables by dictionary key.

The key of an entry is index * 256 + sub-index.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from drives import sheet_text
from drives.text_file import Source, text_of

EDS = Path(__file__).parents[3] / "config" / "eds" / "simulated_drive.eds"

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
def _sections(path: Source) -> sheet_text.Sections:
    """The sheet that is being read; keys in small letters, for CiA 306-1 does not care for case."""
    found = sheet_text.sections(text_of(path))
    return {
        section: {name.lower(): value for name, value in values.items()} for section, values in found.items()
    }


@lru_cache(maxsize=8)
def load(path: Source = EDS) -> dict[int, Variable]:
    """Read a data sheet: variables by key. Raises OSError, or ValueError for what is none."""
    sections = _sections(path)
    variables = {}
    for section, values in sections.items():
        index, _, sub = section.partition("sub")
        if len(index) == 4 and set(index) <= HEXADECIMAL and "datatype" in values:
            variables[key(int(index, 16), int(sub or "0", 16))] = _variable(values)
    about = sections.get("DeviceInfo", {})
    for sub_index, name in IDENTITY.items():
        _identify(variables, key(0x1018, sub_index), about.get(name.lower(), ""))
    return variables


def _identify(variables: dict[int, Variable], where: int, said: str) -> None:
    """A sheet may say who the drive is in its head only."""
    variable = variables.get(where)
    if variable is not None and not variable.default and said:
        variables[where] = replace(variable, default=said)


@lru_cache(maxsize=8)
def dummies(path: Source = EDS) -> frozenset[int]:
    """Data types that an RPDO may map to skip bits (CiA 306-1, DummyUsage)."""
    usage = _sections(path).get("DummyUsage", {})
    return frozenset(int(name[-4:], 16) for name, used in usage.items() if used == "1")


def _variable(values: dict[str, str]) -> Variable:
    size, signed = INTEGERS.get(int(values["datatype"], 0), (0, False))
    return Variable(
        name=values["parametername"],
        size=size,
        signed=signed,
        access=values.get("accesstype", "ro").lower(),
        default=values.get("parametervalue", "") or values.get("defaultvalue", ""),  # the former in a DCF
        low=values.get("lowlimit", ""),
        high=values.get("highlimit", ""),
        mappable=values.get("pdomapping", "") in ("1", "0x1", "0x01"),
    )


@lru_cache(maxsize=64)
def defaults(path: Source, node: int) -> dict[int, int]:
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
