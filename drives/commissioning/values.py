"""An object's value as people look for it in manuals: identifiers, mappings and bits in hexadecimal."""

from __future__ import annotations

# Bits with a meaning each: statusword and controlword, error code and register, modes, identity.
BITS = {0x1000, 0x1001, 0x1003, 0x1005, 0x1014, 0x1016, 0x1018, 0x603F, 0x6040, 0x6041, 0x6502}
IDENTIFIERS = (range(0x1400, 0x1600), range(0x1800, 0x1A00), range(0x1200, 0x1300))  # in sub-index 1 (and 2)
MAPPINGS = (range(0x1600, 0x1800), range(0x1A00, 0x1C00))


def shown(value: int) -> str:
    """A number as people look for it in manuals: also in hexadecimal."""
    return f"{value} ({value:#x})" if value > 9 else str(value)


def shown_at(index: int, sub: int, value: int) -> str:
    """A value of an object: identifiers, mappings and words of bits in hexadecimal."""
    identifier = any(index in span for span in IDENTIFIERS) and (sub == 1 or (sub == 2 and index < 0x1300))
    mapping = any(index in span for span in MAPPINGS) and sub > 0
    bits = index in BITS and (sub > 0 or index not in (0x1003, 0x1016, 0x1018))
    return f"{value:#x}" if value >= 0 and (identifier or mapping or bits) else str(value)


def in_words(index: int, sub: int, value: int) -> str:
    """The same in a sentence: other numbers in both forms."""
    hexadecimal = shown_at(index, sub, value)
    return hexadecimal if hexadecimal.startswith("0x") else shown(value)
