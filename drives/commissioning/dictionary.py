"""What a data sheet says of a device's objects (CiA 306-1), and their values as bytes (CiA 301, 7.1.4).

Sections of an EDS or DCF in, variables by index and sub-index out. What a number wanted to say that is none
is unknown, and is left out.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import field

from drives.sheet_text import Sections
from drives.values import dataclass

Value = int | float | str | bytes

# Object types
DOMAIN_OBJECT, VARIABLE, ARRAY, RECORD = 0x2, 0x7, 0x8, 0x9

# Data types: bytes of the integers, layout of the others that have a fixed size.
BOOLEAN = 0x01
REALS = {0x08: "<f", 0x11: "<d"}
VISIBLE_STRING, OCTET_STRING, UNICODE_STRING, DOMAIN = 0x09, 0x0A, 0x0B, 0x0F
SIGNED = {0x02: 1, 0x03: 2, 0x10: 3, 0x04: 4, 0x12: 5, 0x13: 6, 0x14: 7, 0x15: 8}
UNSIGNED = {0x05: 1, 0x06: 2, 0x16: 3, 0x07: 4, 0x18: 5, 0x19: 6, 0x1A: 7, 0x1B: 8}
INTEGERS = {BOOLEAN: 1, **SIGNED, **UNSIGNED}
LAST_PLAIN_TYPE = 0x1B  # above are records and makers' own

NODE = "$NODEID"
SECTION = re.compile(r"([0-9A-F]{4})(?:sub([0-9A-F]+))?", re.IGNORECASE)
RATES = (10, 20, 50, 125, 250, 500, 800, 1000)  # kbit/s
DUMMIES = tuple(f"Dummy{i:04d}" for i in range(1, 8))


class MisfitError(Exception):
    """A value is not of the type that the data sheet gives the object."""


@dataclass(slots=True)
class Variable:
    """One entry; ``group``: the array or record that it is a member of, "" = of none.

    ``default`` and ``value`` (of a DCF) are None where the sheet does not say them; the ``raw`` ones are
    what it says.
    """

    name: str
    index: int
    subindex: int = 0
    group: str = ""
    data_type: int | None = None
    access_type: str = "rw"
    pdo_mappable: bool = False
    min: int | None = None
    max: int | None = None
    default: Value | None = None
    default_raw: str | None = None
    value: Value | None = None
    value_raw: str | None = None

    @property
    def qualname(self) -> str:
        return f"{self.group}.{self.name}" if self.group else self.name

    @property
    def writable(self) -> bool:
        return "w" in self.access_type

    @property
    def readable(self) -> bool:
        return "r" in self.access_type or self.access_type == "const"

    @property
    def is_signed(self) -> bool:
        return self.data_type in SIGNED

    @property
    def size(self) -> int:
        """Bytes; 0 where its type does not say how many."""
        real = REALS.get(self.data_type or 0)
        return struct.calcsize(real) if real else INTEGERS.get(self.data_type or 0, 0)

    def decoded(self, data: bytes) -> Value:
        """What a drive has answered. Raises MisfitError."""
        kind = self.data_type or 0
        if kind == VISIBLE_STRING:
            return data.decode("ascii", errors="ignore").rstrip("\0")
        if kind == UNICODE_STRING:
            return data.decode("utf_16_le", errors="ignore").rstrip("\0")
        if not self.size:
            return data
        if len(data) < self.size:
            raise MisfitError(f"{len(data)} bytes came, its data size is {self.size}")
        if kind in REALS:
            return float(struct.unpack_from(REALS[kind], data)[0])
        number = int.from_bytes(data[: self.size], "little", signed=kind in SIGNED)
        return bool(number) if kind == BOOLEAN else number

    def encoded(self, value: Value) -> bytes:
        """As it goes to the drive. Raises MisfitError."""
        kind = self.data_type or 0
        try:
            if isinstance(value, bytes):
                return value
            if isinstance(value, str):
                return value.encode({VISIBLE_STRING: "ascii", UNICODE_STRING: "utf_16_le"}[kind])
            if kind in REALS:
                return struct.pack(REALS[kind], value)
            return int(value).to_bytes(INTEGERS[kind], "little", signed=kind in SIGNED)
        except (OverflowError, ValueError, KeyError, struct.error) as error:
            raise MisfitError(f"{value!r} is no value of data type {kind:#x}") from error


@dataclass(slots=True)
class Group:
    """An array or a record with its members by sub-index."""

    name: str
    index: int
    is_array: bool
    subindices: dict[int, Variable] = field(default_factory=dict)

    def __getitem__(self, sub: int) -> Variable:
        return self.subindices[sub]


@dataclass(slots=True)
class DeviceInformation:
    """The head of a sheet; ``texts``: what else it says, by its keys."""

    vendor_number: int | None = None
    product_number: int | None = None
    revision_number: int | None = None
    allowed_baudrates: set[int] = field(default_factory=set)  # bit/s
    texts: dict[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class Dictionary:
    """The objects of a device by index, and of which data types an RPDO may map dummies."""

    indices: dict[int, Variable | Group] = field(default_factory=dict)
    device_information: DeviceInformation = field(default_factory=DeviceInformation)
    dummies: set[str] = field(default_factory=set)
    relative: list[Variable] = field(default_factory=list)  # to the node id

    def __getitem__(self, index: int) -> Variable | Group:
        return self.indices[index]

    def find(self, index: int, sub: int) -> Variable | None:
        """The entry, exactly this one."""
        found = self.indices.get(index)
        if isinstance(found, Variable):
            return found if sub == 0 else None
        return None if found is None else found.subindices.get(sub)

    def add(self, made: Variable) -> None:
        """An entry of its own, or a member of a group that is there."""
        parent = self.indices.get(made.index)
        if isinstance(parent, Group):
            made.group = parent.name
            parent.subindices[made.subindex] = made
        else:
            self.indices[made.index] = made

    def of_node(self, node: int) -> None:
        """What is relative to the node id in a dictionary that was read for node 0 is of this one now."""
        for entry in self.relative:
            if isinstance(entry.default, int) and _is_relative(entry.default_raw):
                entry.default += node
            if isinstance(entry.value, int) and _is_relative(entry.value_raw):
                entry.value += node


def variables(dictionary: Dictionary) -> Iterator[Variable]:
    """Every entry of the objects of a device, in order."""
    for index in sorted(dictionary.indices):
        found = dictionary.indices[index]
        if index < 0x1000:  # data types
            continue
        if isinstance(found, Variable):
            yield found
        else:
            yield from (found.subindices[sub] for sub in sorted(found.subindices))


def read(sections: Sections) -> Dictionary:
    """The dictionary for node 0 of sections whose numbers are numbers. Raises ValueError, KeyError."""
    found = Dictionary()
    _read_head(found.device_information, sections.get("DeviceInfo", {}))
    usage = sections.get("DummyUsage", {})
    found.dummies = {dummy for dummy in DUMMIES if usage.get(dummy, "0") not in ("", "0")}
    for section, values in sections.items():
        match = SECTION.fullmatch(section)
        if match is not None:
            _read_object(found, int(match[1], 16), match[2], values)
    return found


def _read_head(head: DeviceInformation, said: Mapping[str, str]) -> None:
    numbers = {key: int(said[key], 0) for key in said if key in HEAD}
    head.vendor_number = numbers.get("VendorNumber")
    head.product_number = numbers.get("ProductNumber")
    head.revision_number = numbers.get("RevisionNumber")
    head.allowed_baudrates = {1000 * rate for rate in RATES if int(said.get(f"BaudRate_{rate}", "0"), 0)}
    head.texts = {key: text for key, text in said.items() if key not in HEAD and "BaudRate" not in key}


HEAD = ("VendorNumber", "ProductNumber", "RevisionNumber")


def _read_object(found: Dictionary, index: int, sub: str | None, values: Mapping[str, str]) -> None:
    if sub is not None:
        if isinstance(found.indices.get(index), Group):
            _add(found, _variable(values, index, int(sub, 16)))
        return
    kind = int(values.get("ObjectType", "0x7"), 0)
    if kind in (VARIABLE, DOMAIN_OBJECT):
        _add(found, _variable(values, index, 0))
    elif kind in (ARRAY, RECORD):
        found.indices[index] = Group(values["ParameterName"], index, kind == ARRAY)


def _add(found: Dictionary, made: Variable) -> None:
    found.add(made)
    if _is_relative(made.default_raw) or _is_relative(made.value_raw):
        found.relative.append(made)


def _is_relative(text: str | None) -> bool:
    return text is not None and "$" in text and NODE in _plain(text)


def _plain(text: str) -> str:
    return text.replace(" ", "").upper()


def _variable(values: Mapping[str, str], index: int, sub: int) -> Variable:
    kind = int(values["DataType"], 0)
    kind = DOMAIN if kind > LAST_PLAIN_TYPE else kind
    default, value = values.get("DefaultValue"), values.get("ParameterValue")
    return Variable(
        values["ParameterName"],
        index,
        sub,
        "",
        kind,
        values["AccessType"].lower(),
        bool(int(values.get("PDOMapping", "0"), 0)),
        _limit(kind, values.get("LowLimit")),
        _limit(kind, values.get("HighLimit")),
        _value(kind, default),
        default,
        _value(kind, value),
        value,
    )


def _limit(kind: int, text: str | None) -> int | None:
    """A limit; that of a signed type may be written as the hexadecimal of its bits."""
    number = None if text is None else _number(text)
    if number is not None and kind in SIGNED and number >= 1 << 8 * SIGNED[kind] - 1:
        return number - (1 << 8 * SIGNED[kind])
    return number


def _number(text: str) -> int | None:
    try:
        return int(text, 0)
    except ValueError:
        return None


def _value(kind: int, text: str | None) -> Value | None:
    """What a word of the sheet stands for; a number that is relative to the node id as that of node 0."""
    if text is None or kind in (VISIBLE_STRING, UNICODE_STRING):
        return text
    try:
        if kind in (OCTET_STRING, DOMAIN):
            return bytes.fromhex(text)
        if kind in REALS:
            return float(text)
    except ValueError:
        return None
    if "$" not in text:
        return _number(text.replace(" ", ""))
    return _number(_plain(text).replace(f"+{NODE}", "").replace(f"{NODE}+", "").replace(NODE, "") or "0")
