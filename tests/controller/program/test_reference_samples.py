"""LinuxCNC's sample programs beside its own interpreter: the same moves, or a reason that is told."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.oracles import reference_interpreter, reference_samples

README = (Path(__file__).parents[3] / "config/programs/README.md").read_text(encoding="utf-8")

NO_END = "- A program may end without M2, M30 and %; LinuxCNC refuses it"
NO_LATHE = "this control has no lathe axis"
NO_ANGLE = "On a spindle that tells no angle G33"

# What is told of a file here, and where its reason stands in the README ("": the machine lacks it).
APART = {
    **dict.fromkeys(("gridprobe", "smartprobe", "x-trim"), ("asks for a probe", "")),
    **dict.fromkeys(("puma_cube", "puma_seam_weld"), ("moves an axis that this machine does not have", "")),
    **dict.fromkeys(
        ("lathe_g70_71_demo", "lathe_g7x_face_boring", "lathe_g7x_quadrants", "lathe_pawn"),
        (NO_LATHE, NO_LATHE),
    ),
    **dict.fromkeys(
        ("bye", "lathe_std", "g59preview", "in_std", "mm_std"),
        ("theirs: File ended with no percent sign", NO_END),
    ),
    "macros/on_abort": (
        "it holds only subs",
        "A file of which nothing runs, as one of subs alone between %, is refused",
    ),
    "mmount": ("move 5: ", "- Canned cycles begin under G98, not G99"),
    "nestedcall": (
        "CALLSUB behind og20sub is no O-word",
        "structure of a whole text is known before a line runs",
    ),
    "ncfiles/threading": ("no spindle here tells its angle", NO_ANGLE),
}

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(reference_interpreter.program() is None, reason="rs274 is not installed"),
]


@pytest.mark.parametrize("path", reference_samples.samples(), ids=lambda path: "/".join(path.parts[-3:]))
def test_a_sample_program_leads_where_it_leads_in_the_reference(path: Path, tmp_path: Path) -> None:
    found = reference_samples.difference(path, tmp_path)
    told, reason = APART.get(path.stem) or APART.get(f"{path.parent.name}/{path.stem}", ("", ""))
    assert found == "" if not told else told in found
    assert reason in README


def test_a_length_beside_a_change_is_that_of_the_next_line(tmp_path: Path) -> None:
    """The stand-alone interpreter loses it at the change, of which the README tells."""
    on = reference_interpreter.machine()
    for beside, behind in (
        ("T1 M6 G43 H1\n", "T1 M6\nG43 H1\n"),
        ("G43 H1\nT2 M6 G43\n", "T2 M6\nG43\n"),
        ("G43 H1\nT2 M6\n", "T2 M6\nG43 H1\n"),
    ):
        moves = "G0 X5\nG91 Z1\nG90 X1 Z2\nM2\n"
        own = reference_interpreter.ours(beside + moves, on)
        reference = reference_interpreter.reference(behind + moves, tmp_path, on)
        assert not own.refused and not reference.refused
        assert len(own.moves) == len(reference.moves) == 3
        assert all(ours.near(theirs) for ours, theirs in zip(own.moves, reference.moves, strict=True))
