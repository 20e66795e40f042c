"""P, Q and R of G40, G41 and G42: how the cutter is placed on surfaces, and what stays on them."""

import pytest
from support.machines.shipped_kinds import machine

from controller.program import blocks
from controller.program.program import ProgramError

SURFACE = "G51 X30. Y0. Z0. I0. J0. K0. H10. R20. D90. F100.\n"


def modal_of(text):
    return blocks.read(("S1000 M3\n" + text).encode(), machine(), "test.ngc").blocks[-1].modal


def test_p_and_q_of_the_side_codes_hold_until_the_next_side_code():
    modal = modal_of("G41 P3 Q0.2\n" + SURFACE)
    assert (modal.placement, modal.allowance_mm) == (3, 0.2)
    modal = modal_of("G20 G42 P2 Q0.1\nG21\n" + SURFACE)
    assert (modal.placement, modal.allowance_mm) == (2, pytest.approx(2.54))
    modal = modal_of("G41 P3 Q0.2\nG42\n" + SURFACE)
    assert (modal.placement, modal.allowance_mm) == (0, 0.0)


def test_a_p_that_another_code_of_the_line_takes_is_that_codes():
    modal = modal_of("G40 G64 P0.01 Q0.5\n" + SURFACE)
    assert (modal.placement, modal.blend_mm) == (0, 0.01)
    assert modal_of("G40 G4 P2\n" + SURFACE).placement == 0


def test_r_is_the_form_tolerance_until_the_next_side_code():
    assert modal_of("G41 P4 R0.02\n" + SURFACE).tolerance_mm == 0.02
    assert modal_of("G20 G42 R0.001\nG21\n" + SURFACE).tolerance_mm == pytest.approx(0.0254)
    assert modal_of("G41 R0.02\nG42\n" + SURFACE).tolerance_mm is None


def test_an_r_that_another_code_of_the_line_takes_is_that_codes():
    assert modal_of("G42 " + SURFACE).tolerance_mm is None
    arc = blocks.read(b"F100\nG40 G2 X10. Y0. R5.\n", machine(), "test.ngc").blocks[-1]
    assert arc.modal.tolerance_mm is None


@pytest.mark.parametrize("words", ("P5", "P0", "P1.5", "Q-0.6", "R0", "R-0.02"))
def test_what_is_no_placement_is_refused(words):
    with pytest.raises(ProgramError):
        modal_of(f"G41 {words}\n" + SURFACE)
