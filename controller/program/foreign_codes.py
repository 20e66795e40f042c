"""G and M codes that builders document and that this control does not have: what each is, and what instead.

A number says nothing of a code's purpose, so nothing is advised by what a code looks like: what is in no
row here is refused with the codes of this control. The facts are those of the builders' documents, by way of
lists that are public; the manuals of Haas and Fanuc themselves were not at hand, so a row of theirs is no
authority:

    Haas       lists of G and M codes of mills with its NGC control
    Fanuc      lists of G codes of machining centres (series 16 and 30i)
    Makino     Professional 5 M-code list, No. 0584D-0506
    LinuxCNC   G code reference 2.9 (M100 to M199), kinematics switched by M428 to M430 and M128 to M130
               (commit 135b0ce522)
    Heidenhain user's manuals of the TNC controls (M128, M129)
    Marlin     its G code pages, as programs of printers have them
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from controller.messages import Message, chain, message
from controller.program.code_rows import key_of

HAAS, FANUC, MAKINO, LINUXCNC, MARLIN = "Haas", "Fanuc", "Makino", "LinuxCNC", "Marlin"
HEIDENHAIN = "Heidenhain"


class Use(NamedTuple):
    """What a builder has a code for: keys of ``foreign_use`` and ``foreign_advice``."""

    builder: str
    purpose: str
    advice: str


def _rows(builder: str, *rows: tuple[str, str, str]) -> dict[str, Use]:
    """By code, of rows of codes, purpose and advice."""
    return {code: Use(builder, purpose, advice) for codes, purpose, advice in rows for code in codes.split()}


_TABLES = (
    _rows(
        HAAS,
        ("M16", "tool_change", "m6"),
        ("M17 M18", "pallet", "output"),
        ("M21 M22 M23 M24 M25 M26 M27 M28", "relay_answered", "wait"),
        ("M34 M35", "coolant_nozzle", "output"),
        ("M36", "part_ready", "m0"),
        ("M39", "turret", "m6"),
        ("M46", "jump_pallet", "if"),
        ("M54 M55 M56 M59 M69", "relay", "output"),
        ("M74", "tool_air", "output"),
        ("M75 M78 M79", "skip_checked", "probing"),
        ("M80 M81", "door", "output"),
        ("M82 M86", "clamp_tool", "m6"),
        ("M90 M91", "fixture", "wait"),
        ("M95", "sleep", "m0"),
        ("M96", "jump_input", "wait"),
        ("M104 M105", "probe_arm", "output"),
        ("M109", "asks", "m0"),
        ("M130 M131", "shows", "msg"),
        ("M158 M159", "mist", "output"),
        ("M160 M161 M162 M163", "coolant_pulses", "output"),
        ("G35 G36 G37 G136", "measures", "probing"),
        ("G77", "back_bore", "g87"),
        ("G101", "mirror", "g51_1"),
        ("G141 G143", "vectors", "g43_4"),
        ("G156", "broach", "moves"),
        ("G174 G184", "oblique_tap", "g68_2_tap"),
        ("G266", "rapid_share", "rapid"),
    ),
    _rows(
        FANUC,
        ("G2.2 G3.2", "involute", "moves"),
        ("G2.3 G3.3", "exponential", "moves"),
        ("G2.4 G3.4", "arc_3d", "moves"),
        ("G5.4", "servo", "leave"),
        ("G7.1", "cylinder", "rotary"),
        ("G10.6", "retract", "leave"),
        ("G12.4 G13.4", "grooves", "moves"),
        ("G31.8 G31.9", "skip_many", "probing"),
        ("G37", "measures", "probing"),
        ("G38 G39", "corner_vector", "side"),
        ("G43.8 G43.9", "cutting_point", "g43_4"),
        ("G50.2 G51.2", "polygon", "lathe"),
        ("G72.1 G72.2", "copies", "sub"),
        ("G81.1", "chopping", "moves"),
        ("G84.2 G84.3", "rigid_tap", "m29"),
        ("G160 G161", "infeed", "moves"),
    ),
    _rows(
        MAKINO,
        ("M15", "mirror", "g51_1"),
        ("M21 M22 M23", "mirror", "g51_1"),
        ("M26", "coolant_through", "output"),
        ("M27", "power_off", "leave"),
    ),
    _rows(
        LINUXCNC,
        ("M428 M429 M430", "kinematics", "g43_4_switch"),
        ("M128 M129 M130", "kinematics", "g43_4_switch"),
        (" ".join(f"M{n}" for n in range(100, 200)), "own_file", "own"),
    ),
    _rows(HEIDENHAIN, ("M128 M129", "tip_control", "g43_4")),
    _rows(
        MARLIN,
        ("M104 M105 M106 M107 M109 M117 M140 M190 M220 M221", "printer", "leave"),
    ),
)
# By code, as many as have it; a general row of a builder gives way to a particular one.
USES: Mapping[str, tuple[Use, ...]] = MappingProxyType(
    {
        code: tuple(table[code] for table in _TABLES if code in table)
        for code in dict.fromkeys(code for table in _TABLES for code in table)
    }
)


def known_uses(code: str) -> dict[str, Any] | None:
    """What builders have a code for, and what to write instead, as values of a sentence; None if none has."""
    if code not in USES:
        return None
    uses, advice = list[Message | str](), list[Message | str]()
    for use in USES[code]:
        purpose = key_of("foreign_use", use.purpose, "")
        uses.append(message("foreign_use", builder=use.builder, purpose=purpose))
        one = message(key_of("foreign_advice", use.advice, ""), code=code)
        if one not in advice:
            advice.append(one)
    return {"uses": chain("foreign_use.or", uses), "instead": chain("foreign_advice.or", advice)}
