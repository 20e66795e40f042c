"""The rows of the table of codes for what is only noted, and what is refused with what to write instead."""

from __future__ import annotations

from dataclasses import replace

from controller.program.code_rows import (
    AXES,
    BROTHER,
    FANUC,
    HAAS,
    HURCO,
    LINUXCNC,
    MAZAK,
    Code,
    noted,
    only,
    refused,
)

NOT_DONE: tuple[Code, ...] = (
    *noted(
        FANUC,
        ("G5", "P", "ahead"),
        ("G5.1", AXES + "QRP", "ahead"),
        ("G8", "P", "ahead"),
        ("G9", "", "exact"),
        ("G11", "", "own_line"),
        ("G13.1", "", "never"),
        ("G50.1", AXES, "never"),
        ("G62", "", "corners"),
        ("M41", "", "speed"),
        ("M42", "", "speed"),
        ("M43", "", "speed"),
        dialect="fanuc",
    ),
    *noted(
        FANUC,
        ("G15", "", "never"),
        ("G23", "", "travel"),
        ("G25", "", "watched"),
        ("G50", "", "never"),
        ("G67", "", "never"),
        ("M10", "", "closes"),
        ("M11", "", "opens"),
    ),
    *noted(HURCO, ("G5.3", "P", "path"), dialect="fanuc"),
    *noted(
        HAAS,
        ("G103", "P", "whole"),
        ("G187", "PE", "path"),
        ("G255", "", "follows"),
    ),
    *noted(
        HAAS,
        ("G269", "", "untilts"),
        ("M12", "", "closes"),
        ("M13", "", "opens"),
        ("M31", "", "no_output"),
        ("M32", "", "no_output"),
        ("M33", "", "no_output"),
        ("M84", "", "no_output"),
        ("M89", "", "no_output"),
        ("M138", "PE", "turns"),
        ("M139", "", "turns"),
        dialect="fanuc",
    ),
    *noted(BROTHER, ("M298", "L", "ahead"), dialect="fanuc"),
    *only("P0", ("G54.2", "P", FANUC, "never"), ("G54.4", "P", FANUC, "never")),
    *only("X0", ("G10.9", "X", MAZAK, "positions")),
    *(replace(row, group="overrides") for row in noted(LINUXCNC, ("M51", "P", "kept"))),
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
