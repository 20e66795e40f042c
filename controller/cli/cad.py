"""``directrix import``: the ruled faces of a STEP file, or of a CAM system's lines, as a part program."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from controller.cli import new_files
from controller.geometry.vectors import Frame, Vector, add, rotate
from controller.machine import machine_file
from controller.machine.model import Machine, Tool
from controller.messages import message
from controller.program import blocks
from controller.verify.console import Refused, answered, bar, refusals, say

if TYPE_CHECKING:  # OpenCASCADE takes its time to load, and is an extra
    from controller.cad.deviation import Deviation
    from controller.cad.kernel import Face, Part
    from controller.cad.program import Written
    from controller.cad.strip import How, Strip
    from controller.cli.cad_tables import SeenFace
    from controller.geometry.arrays import Array


AXES: dict[str, Vector] = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
GROUPS = ("all", "blades")  # of faces, that --faces names
CL_SUFFIXES = (".cl", ".cls", ".clf", ".apt", ".aptsource", ".ncl")  # files of a CAM system's lines
PROGRAM_SUFFIXES = (".ngc", ".nc", ".tap", ".cnc", ".txt", ".mpf", ".h")
MICRON_MM = 1e-3  # a written surface is at least so near to its face


def import_(
    file: Path,
    only_list: Annotated[bool, typer.Option("--list")] = False,
    plot: Path | None = None,
    faces: str = "",
    out: Path | None = None,
    overwrite: bool = False,
    machine: str = "trunnion",
    tool: int = 0,
    feed: float = 300.0,
    spindle: float = 8000.0,
    direction: Literal["climb", "conventional"] = "climb",
    placement: Literal["single", "double", "optimal", "machine"] = "double",
    other_side: str = "",
    tolerance: float = 0.001,
    whole: bool = False,
    prolong: float = 0.0,
    other_rulings: str = "",
    move: str = "",
    turn: str = "",
    verify: bool = False,
    as_json: bool = False,
) -> None:
    """Find the ruled faces of a STEP file or CAM lines (--list), and write a program that cuts some."""
    with refusals(as_json):
        if only_list == bool(faces):
            raise Refused(say("cli.import.either"))
        for name, value in (("--feed", feed), ("--spindle", spindle), ("--tolerance", tolerance)):
            if not 0.0 < value < math.inf:
                raise Refused(say("cli.not_above_0", name=name, value=value))
        if not 0.0 <= prolong < math.inf:
            raise Refused(say("cli.not_below_0", name="--prolong", value=prolong))
        if plot is not None and not only_list:
            raise Refused(say("cli.import.plot", plot=plot))
        plot = None if plot is None else new_files.target(plot, overwrite, "--plot")
        made, placed = machine_file.load(machine), _placed(move, turn)
        target = None if only_list else new_files.target(out or _beside(file), overwrite, "--out")
        if (suffix := file.suffix.lower()) in (*CL_SUFFIXES, *PROGRAM_SUFFIXES):
            of_faces = {"--whole": whole, "--prolong": prolong, "--other-side": other_side, "--move": move}
            of_faces |= {"--other-rulings": other_rulings, "--turn": turn, "--plot": plot}
            of_faces["--placement"] = placement in ("optimal", "machine")  # the lines are those of P1
            if given := next((name for name, word in of_faces.items() if word), ""):
                raise Refused(say("cli.import.path.of_cad", name=given, file=file))
            _check_there(file)
            from controller.cli import cad_path

            wish = cad_path.Wish(faces, tool, feed, spindle, direction == "conventional", tolerance)
            done = cad_path.import_rows(file, suffix in PROGRAM_SUFFIXES, target, made, wish, as_json)
            if done is not None and target is not None:
                _tell(file, target, *done, made if verify else None, as_json)
            return
        part = _part(file, placed)
        from controller.cad import program
        from controller.cad.strip import How
        from controller.cli import cad_tables

        others = _numbers("--other-rulings", other_rulings, part)
        how = How(tolerance, whole, prolong, _thickest_mm(made, tool))
        every = faces in ("", *GROUPS)
        numbers = [] if every else _numbers("--faces", faces, part)
        seen = _seen(part, how, numbers, others, as_json)
        if every:
            seen = _in_roles(part, seen, made)
        if plot is not None:
            new_files.save(plot, cad_tables.picture_of(seen, made))
        if target is None:
            cad_tables.faces(file, part, seen, as_json)
            return
        turned = _numbers("--other-side", other_side, part)
        strips = [
            strip
            for one in seen
            if numbers or (one.strips and (faces == "all" or one.role == "blade"))
            for strip in _cuttable(one, file, one.face.number in turned)
        ]
        if not strips:
            raise Refused(
                say("cli.import.no_blade" if faces == "blades" else "cli.import.no_face", file=file)
            )
        cutter = _tool(made, tool, strips)
        way = "" if placement == "machine" else placement
        wanted = program.Wanted(feed, spindle, direction == "conventional", way)
        notes = [f"{file.name}, by directrix import", _note(part, move, turn)]
        written = program.write(notes, strips, cutter, wanted)
        found = _deviations(written, str(target), made)
        _near_enough(found, written, tolerance)
        new_files.save(target, written.text)
        rows = cad_tables.off_faces(written, found)
        if not as_json:
            cad_tables.written(target, cutter, rows)
        _tell(file, target, cutter, rows, made if verify else None, as_json)


def _tell(
    file: Path, target: Path, cutter: Tool, rows: list[dict[str, Any]], machine: Machine | None, as_json: bool
) -> None:
    """What was written; with a machine also what comes of it there. Raises Refused where that is wrong."""
    facts = {"file": str(file), "program": str(target), "tool": cutter.number, "faces": rows}
    if machine is not None:
        from controller.cli import cad_verdict

        figures, wrong = cad_verdict.verdict(target, machine, as_json)
        facts |= figures
        if wrong:
            raise Refused(wrong, **facts)
    answered(as_json, **facts)


# ---- what is asked for ---------------------------------------------------------------


def _numbers(name: str, text: str, part: Part) -> list[int]:
    """Numbers of faces, each once."""
    words = [word for word in re.split(r"[,\s]+", text.strip()) if word]
    for word in words:
        if not word.isascii() or not word.isdigit() or not 1 <= int(word) <= len(part.faces):
            count = len(part.faces)
            raise Refused(say("cli.import.face_number", name=name, text=text, word=word, count=count))
    return list(dict.fromkeys(map(int, words)))


def _placed(move: str, turn: str) -> Frame:
    """Where the file's frame is in the part frame."""
    frame = Frame()
    for word in [word for word in turn.replace(" ", "").upper().split(",") if word]:
        angle = _float(word[1:]) if word[0] in AXES else None
        if angle is None:
            raise Refused(say("cli.import.turn", turn=turn, word=word))
        frame = _turned(frame, AXES[word[0]], math.radians(angle))
    if not move:
        return frame
    values = [_float(word) for word in move.split(",")]
    if len(values) != 3 or None in values:
        raise Refused(say("cli.import.move", move=move))
    x, y, z = (value or 0.0 for value in values)
    return frame._replace(origin=add(frame.origin, (x, y, z)))


def _turned(frame: Frame, axis: Vector, angle_rad: float) -> Frame:
    origin, x, y, z = (rotate(axis, angle_rad, vector) for vector in frame)
    return Frame(origin, x, y, z)


def _float(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


# ---- the faces -----------------------------------------------------------------------


def _beside(file: Path) -> Path:
    """The program that is written where --out says none."""
    return file.with_suffix(".ngc") if file.suffix != ".ngc" else file.with_stem(f"{file.stem}_ruled")


def _check_there(file: Path) -> None:
    if not file.is_file():
        raise Refused(say("cli.import.folder" if file.is_dir() else "cli.import.no_file", file=file))


def _part(file: Path, placed: Frame) -> Part:
    _check_there(file)
    try:
        from controller.cad import kernel
    except ModuleNotFoundError as error:
        raise Refused(say("cli.import.no_kernel", why=error)) from error
    except ImportError as error:
        raise Refused(say("cli.import.no_library", why=error)) from error
    try:
        with kernel.failures():
            return kernel.read(file, placed)
    except kernel.Failure as error:
        raise Refused(say("cli.import.unreadable", file=file, why=error)) from error


def _seen(part: Part, how: How, numbers: Sequence[int], others: Sequence[int], quiet: bool) -> list[SeenFace]:
    """The faces with these numbers in this order; without numbers all of them.

    ``others``: numbers of those that are cut along the other of their two families of rulings.
    """
    faces = [part.faces[n - 1] for n in numbers] or part.faces
    from controller.cad import picture

    fine_mm, found = picture.fine([points for points in map(_edge_points, part.faces) if len(points)]), []
    with bar(say("cli.import.looking"), quiet) as progress:
        for i, face in enumerate(faces):
            found.append(_look(face, replace(how, other=face.number in others), fine_mm))
            progress((i + 1) / len(faces))
    return found


def _in_roles(part: Part, seen: Sequence[SeenFace], machine: Machine) -> list[SeenFace]:
    """All faces of a part with what they are on it, and the tools that cut them."""
    from controller.cad.program import tools_for
    from controller.cad.roles import roles

    found = roles(part.faces, {one.face.number: one.strips for one in seen}, part.meetings())
    return [
        replace(
            one,
            role=found[one.face.number],
            tools=tuple(tools_for(one.strips, machine)) if one.strips else (),
        )
        for one in seen
    ]


def _edge_points(face: Face) -> Array:
    """Some points of its edges, (N, 3) mm; none where the kernel refuses it."""
    import numpy as np

    from controller.cad.kernel import Failure, failures

    try:
        with failures():
            return face.edge_points(5)
    except Failure:
        return np.zeros((0, 3))


def _look(face: Face, how: How, fine_mm: float) -> SeenFace:
    import numpy as np

    from controller.cad.curve import NoFit
    from controller.cad.kernel import Failure, failures
    from controller.cad.strip import NotRuled, strips
    from controller.cli.cad_tables import SeenFace

    shape = np.zeros((0, 3, 3))
    try:
        with failures():
            shape = face.triangles(fine_mm)
            made = strips(face, how)
    except NotRuled as error:
        return SeenFace(face, (), error.said, error.off_ruled_mm, shape)
    except Failure as error:
        return SeenFace(face, (), message("cli.import.not_evaluated", why=error), math.inf, shape)
    except (NoFit, ArithmeticError, ValueError) as error:  # degenerate numbers in the file
        return SeenFace(face, (), message("cli.import.no_curves", why=error), math.inf, shape)
    return SeenFace(face, tuple(made), None, made[0].off_ruled_mm, shape)


def _cuttable(one: SeenFace, file: Path, other_side: bool) -> list[Strip]:
    """The strips of a face; raises Refused where it has none."""
    if not one.strips:
        face = {"number": one.face.number, "kind": one.face.kind}
        raise Refused(say("cli.import.not_cut", file=file, why=one.reason, **face))
    return [replace(strip, right=strip.right is not other_side) for strip in one.strips]


def _thickest_mm(machine: Machine, number: int) -> float:
    """The radius of the tool that is asked for, or of the thickest."""
    return max((one.radius_mm for one in machine.tools if number in (0, one.number)), default=0.0)


def _tool(machine: Machine, number: int, strips: Sequence[Strip]) -> Tool:
    from controller.cad.program import fitting

    if not number:
        return fitting(strips, machine)
    found = machine.tool(number)
    if found is None:
        known = ", ".join(f"T{tool.number}" for tool in machine.tools)
        raise Refused(say("cli.import.no_tool", number=number, known=known))
    return found


# ---- the program ---------------------------------------------------------------------


def _note(part: Part, move: str, turn: str) -> str:
    placed = [f"{name} {text}" for name, text in (("turned", turn), ("moved", move)) if text]
    return "; ".join([f"in mm, the file's unit is {part.unit}", *placed])


def _deviations(written: Written, name: str, machine: Machine) -> list[Deviation]:
    """Of each face in cut order, from the program's own text."""
    from controller.cad.deviation import deviation, surfaces
    from controller.cad.kernel import Failure, failures

    read, found = surfaces(blocks.stream(written.text.encode(), machine, name)), []
    for one, surface in zip(written.strips, read, strict=True):
        try:
            with failures():
                found.append(deviation(one, surface))
        except Failure as error:
            raise Refused(say("cli.import.not_compared", number=one.face.number, why=error)) from error
    return found


def _near_enough(found: Sequence[Deviation], written: Written, tolerance_mm: float) -> None:
    allowed = max(MICRON_MM, 1.5 * tolerance_mm)
    for one, strip in zip(found, written.strips, strict=True):
        if not one.largest_mm <= allowed:
            um = {"off": 1e3 * one.largest_mm, "allowed": 1e3 * allowed}
            raise Refused(say("cli.import.too_far", number=strip.face.number, **um))
