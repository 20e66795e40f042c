"""A machine of X, Y, Z and A: judged by the trunnion, whose C stands at zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.machines.stepped_runs import cut, off_the_path, shipped
from support.machines.traced_programs import trace
from support.oracles.trace_limits import BOUNDS, worst

from controller.machine.model import Machine
from controller.program.position import homed
from controller.program.program import ProgramError

# Rulings that lean in Y alone, which A gives.
LEANING = """\
T2 M6
S12000 M3
G52 X10. Y2. Z20. F900.
X20. Y3. Z20.
X30. Y4. Z20.
X40. Y6. Z20.
X10. Y0. Z0.
X20. Y0. Z0.
X30. Y0. Z0.
X40. Y0. Z0.
M30
"""
MOVES = """\
G21 G90 G54
T2 M6
S12000 M3
G0 X0 Y0 Z40 A10
G1 X20 Z30 A-5 F1500
G3 X30 Y10 I0 J10 A0
G43.4 H2
G1 X0 Y5 Z20 A8 F900
G0 Z60
G49
M30
"""


def mill(**changes: object) -> Machine:
    whole = shipped(**changes)
    axes = tuple(axis for axis in whole.axes if axis.name != "C")
    return replace(whole, name="four_axes", axes=axes, kinematics="one_rotary")


@pytest.mark.parametrize("text", [LEANING, MOVES])
def test_it_goes_where_the_trunnion_goes_with_c_at_zero(text: str) -> None:
    done, wanted = cut(text, mill(period_s=0.008)), cut(text, shipped(period_s=0.008))
    assert done.run.fault.name == wanted.run.fault.name == "NONE"
    assert done.joints.shape[1] == 4 and done.joints[:, 3].any()
    assert max(off_the_path(done)) < 1e-6
    for share in worst(done):
        assert share.share < BOUNDS[share.kind], str(share)
    assert done.joints[-1] == pytest.approx(wanted.joints[-1, :4], abs=1e-9)
    if text == LEANING:  # the same tool at the same place of the surface
        ours, theirs = done.trace, wanted.trace
        for u in np.linspace(0.02, 0.98, 25):
            rows = [one.cutting & np.isfinite(one.u) for one in (ours, theirs)]
            for name in ("tool_tip", "tool_axis"):
                values = [
                    [np.interp(u, one.u[here], getattr(one, name)[here, i]) for i in range(3)]
                    for one, here in zip((ours, theirs), rows, strict=True)
                ]
                assert values[0] == pytest.approx(values[1], abs=1e-3)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            LEANING.replace("X20. Y3. Z20.", "X21. Y3. Z20."),
            "no position of the rotary axis gives this tool axis",
        ),
        ("G0 X1 C10\nM30\n", "its axes are X Y Z A"),
        ("G68.2 X0 Y0 Z0 I90 J30 K0\nG53.1\nM30\n", "no position of A gives this tool axis"),
    ],
)
def test_what_one_rotary_cannot_give_is_refused(text: str, sentence: str) -> None:
    with pytest.raises(ProgramError, match=sentence):
        trace(text, mill(), homed(mill()))
