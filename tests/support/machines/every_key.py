"""Machine files with every key that there is, and the same with one wrong value.

``TEXT`` has all that one file may have; ``BY_INVERTER`` and ``BY_MODBUS`` turn the spindle in other ways.
"""

from __future__ import annotations

import re
from pathlib import Path

EVERY = Path(__file__).parents[2] / "controller" / "machine" / "every_key.toml"
TEXT = EVERY.read_text()
_BEFORE, _, _REST = TEXT.partition("[spindle]\n")
_FEEDBACK = (
    "channel = 1, index = 0x6401, bits = 16, tpdo = 2, zero_counts = 0, full_counts = 300, pulses_per_rev = 0"
)
_LINES = _REST[_REST.index("[io]") :].replace(
    "outputs = {", "outputs = { spindle_run = 30, fork = 29, lever = 28,", 1
)
_LINES = _LINES.replace("inputs = {", "inputs = { shifted = 30,", 1)
BY_INVERTER = f"""{_BEFORE}[spindle]
max_rev_min = 12000
by = "inverter"

[spindle.inverter]
channel = 4
index = 0x6411
bits = 16
feedback = {{ {_FEEDBACK} }}
full_rev_min = 12000.0
zero_counts = 0
full_counts = 30000
signed = false
settle_s = 0.5

[[spindle.gear]]
low_rev_min = 100.0
high_rev_min = 9000.0
turns = 1.0
on = ["fork"]
off = ["lever"]
input = "shifted"
within_s = 5.0
code = "M42"

{_LINES}"""
VALUE = re.compile(r"(?P<key>[A-Za-z_]\w*) = (?P<value>\{.*\}|\[.*\]|[^,}\n]+)")


BY_MODBUS = f"""{_BEFORE}[spindle]
max_rev_min = 12000
by = "modbus"

[spindle.modbus]
port = "/dev/ttyUSB0"
profile = "delta_c2000"
station = 2
baud = 19200
frame = "8E1"
rev_min_per_hz = 60.0
silent_s = 1.5

{_REST[_REST.index("[io]") :]}"""


def values_of_every_key() -> list[tuple[int, str, str]]:
    """(line, key, the text with a wrong value in its place), of every value in the files."""
    known = frozenset(TEXT.splitlines())
    return [*_values(TEXT, frozenset()), *_values(BY_INVERTER, known), *_values(BY_MODBUS, known)]


def _values(text: str, known: frozenset[str]) -> list[tuple[int, str, str]]:
    """Those on lines that are not ``known``."""
    lines, found = text.splitlines(), []
    for number, line in enumerate(lines, 1):
        if line in known:
            continue
        for one in VALUE.finditer(line) if not line.startswith("#") else ():
            ends = [(one.start("value"), one.end("value"))]
            inside = [
                (m.start("value") + ends[0][0] + 1, m.end("value") + ends[0][0] + 1)
                for m in VALUE.finditer(one["value"][1:])
            ]
            for begin, end in [*ends, *inside]:
                name = line[:begin].rstrip(" =").split(" ")[-1]
                wrong = f"{line[:begin]}[[]]{line[end:]}"
                found.append((number, name, "\n".join([*lines[: number - 1], wrong, *lines[number:]])))
    return found
