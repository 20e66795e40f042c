"""The rows of the table of codes for what is only noted, and what is refused with what to write instead."""

from __future__ import annotations

from controller.program.code_rows import (
    AXES,
    BROTHER,
    FANUC,
    HAAS,
    HURCO,
    LINUXCNC,
    MAZAK,
    Code,
    Fate,
    noted,
    only,
    refused,
)

_AHEAD = "The feed is always planned as far ahead as the limits ask."
_NEVER = "It is never on here."
_SMOOTH = "G64 P says here how far the path may be left; without it it is exact."
_SPINDLE = "S alone says how fast the spindle turns."
_NO_OUTPUT = "m_codes in [io] has no output for it"

NOT_DONE: tuple[Code, ...] = (
    *noted(
        FANUC,
        ("G5", "P", "high-precision mode", _AHEAD),
        ("G5.1", AXES + "QRP", "look-ahead mode; of Q2 the axes", _AHEAD),
        ("G8", "P", "look-ahead mode", _AHEAD),
        ("G9", "", "exact stop", "Corners are exact but under G64 P."),
        ("G11", "", "end of data setting", "G10 is for its line alone."),
        ("G13.1", "", "polar interpolation off", _NEVER),
        ("G50.1", AXES, "mirror image off", _NEVER),
        ("G62", "", "slower in inside corners", "The feed in corners is planned by the limits of the axes."),
        ("M41", "", "low gear", _SPINDLE),
        ("M42", "", "high gear", _SPINDLE),
        ("M43", "", "third gear", _SPINDLE),
        dialect="fanuc",
    ),
    *noted(
        FANUC,
        ("G15", "", "polar coordinates off", _NEVER),
        ("G23", "", "stored stroke limits off", "The travel of the axes is always watched."),
        (
            "G25",
            "",
            "spindle speed watch off",
            "The spindle is watched wherever the machine file names its drive.",
        ),
        ("G50", "", "scaling off", _NEVER),
        ("G67", "", "modal macro off", _NEVER),
        ("M10", "", "clamp on", f"{_NO_OUTPUT}; clamps of axes close by themselves."),
        ("M11", "", "clamp off", f"{_NO_OUTPUT}; clamps of axes open by themselves."),
    ),
    *noted(HURCO, ("G5.3", "P", "surface finish", _SMOOTH), dialect="fanuc"),
    *noted(
        HAAS,
        ("G103", "P", "limits look-ahead", "The whole program is read and planned ahead."),
        ("G187", "PE", "smoothness", _SMOOTH),
        ("G255", "", "dynamic work offset off", "It is never on here; G43.4 follows the turned part."),
    ),
    *noted(
        HAAS,
        ("G269", "", "tilted plane off", "G268 is never on here; G69 ends G68.2."),
        ("M12", "", "clamp of the fifth axis on", f"{_NO_OUTPUT}; clamps of axes close by themselves."),
        ("M13", "", "clamp of the fifth axis off", f"{_NO_OUTPUT}; clamps of axes open by themselves."),
        ("M31", "", "chip conveyor forward", f"{_NO_OUTPUT}."),
        ("M32", "", "chip conveyor back", f"{_NO_OUTPUT}."),
        ("M33", "", "chip conveyor off", f"{_NO_OUTPUT}."),
        ("M84", "", "air blast off", f"{_NO_OUTPUT}."),
        ("M89", "", "coolant through the spindle off", f"{_NO_OUTPUT}."),
        ("M138", "PE", "varying spindle speed", "The spindle turns as S says."),
        ("M139", "", "varying spindle speed off", "The spindle turns as S says."),
        dialect="fanuc",
    ),
    *noted(BROTHER, ("M298", "L", "high-accuracy mode", _AHEAD), dialect="fanuc"),
    *only("P0", ("G54.2", "P", FANUC, _NEVER), ("G54.4", "P", FANUC, _NEVER)),
    *only("X0", ("G10.9", "X", MAZAK, "Words of X are positions.")),
    Code(
        "M51",
        "overrides",
        "P",
        LINUXCNC,
        "spindle override counts (P1) or not (P0)",
        "The operator keeps it; M49 takes all overrides.",
        Fate.NOTED,
    ),
    # --- what is refused, and what to write instead
    *refused(LINUXCNC, "G7 G8 G76 G44 G87", dialect="rs274"),
    *refused(LINUXCNC, "G5.2", dialect="fanuc"),
    *refused(FANUC, "G53.3 G7 G12.1 G43.3 G45 G46 G47 G48 G51.1 G60 G63 G107 M198", dialect="fanuc"),
    *refused(LINUXCNC, "G17.1 G18.1 G19.1 G88 G96"),
    *refused(FANUC, "G16 G22 G26 G27 G29 G65 G66"),
    *refused(HAAS, "G254"),
    *refused(HAAS, "G12 G13 G150 G253 G268 M83 M88 M97", dialect="fanuc"),
    *refused(BROTHER, "G100", dialect="fanuc"),
)
