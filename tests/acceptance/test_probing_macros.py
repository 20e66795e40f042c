"""A set of probing macros as shops with Fanuc-like controls have them, numbered O98xx, on drawn parts.

Written for this test. It asks of the control what such sets ask: system variables of positions, skips,
modal codes and offsets, alarms, jumps, and offsets that are written by their numbers.
"""

from __future__ import annotations

import random

import pytest
from support.machines import probing_machine
from support.suite.seed import SEED

from controller.program import blocks
from controller.program.program import JointLine, ProgramError, Setting
from tests.acceptance.test_probing import told

MACROS = """
O9810 (PROTECTED WAY: X Y Z F)
IF [#9 EQ #0] THEN #9=1500.
IF [#24 EQ #0] THEN #24=#5001
IF [#25 EQ #0] THEN #25=#5002
IF [#26 EQ #0] THEN #26=#5003
#10=#4003
G90
G31 X#24 Y#25 Z#26 F#9
#11=ABS[#5061-#24]+ABS[#5062-#25]+ABS[#5063-#26]
IF [#11 LT 0.02] GOTO 90
#3000=94 (PATH OBSTRUCTED)
N90 G#10
M99
O9811 (A FACE: X Y OR Z WHERE IT IS MEANT, S SETS OFFSET)
IF [#4120 EQ 99] GOTO 5
#3000=92 (NO PROBE)
N5 #10=#4003
#12=#5001
#13=#5002
#14=#5003
#15=#13099
G90
IF [#24 NE #0] GOTO 10
IF [#25 NE #0] GOTO 20
IF [#26 NE #0] GOTO 30
#3000=91 (FORMAT ERROR)
N10 #1=1
#2=#24
#3=1
IF [#2 LT #12] THEN #3=-1
G31 X[#2+#3*8.] F300.
#4=#5061+#3*#15
G0 X#12
GOTO 50
N20 #1=2
#2=#25
#3=1
IF [#2 LT #13] THEN #3=-1
G31 Y[#2+#3*8.] F300.
#4=#5062+#3*#15
G0 Y#13
GOTO 50
N30 #1=3
#2=#26
G31 Z[#2-8.] F300.
#4=#5063
G0 Z#14
N50 #[134+#1]=#4
#140=#4-#2
IF [#19 EQ #0] GOTO 90
IF [[#19 LT 1] OR [#19 GT 6]] THEN #3000=91 (FORMAT ERROR)
#5=5200+#19*20+#1
#[#5]=#[5200+[#4014-53]*20+#1]+#140
N90 G#10
M99
O9814 (A BORE: D, S SETS OFFSET)
IF [#7 EQ #0] THEN #3000=91 (FORMAT ERROR)
#10=#4003
#12=#5001
#13=#5002
#15=#13099
#8=POW[2,0]
G90
WHILE [#8 LE 2] DO1
G31 X[#12+#7] F300.
#1=#5061+#15
G0 X#12
G31 X[#12-#7] F300.
#2=#5061-#15
#12=[#1+#2]/2
G0 X#12
G31 Y[#13+#7] F300.
#3=#5062+#15
G0 Y#13
G31 Y[#13-#7] F300.
#4=#5062-#15
#13=[#3+#4]/2
G0 Y#13
#8=#8+1
END1
#135=#12
#136=#13
#138=[#1-#2+#3-#4]/2
IF [#19 EQ #0] GOTO 90
#5=[#4014-53]*20+5200
#6=#19*20+5200
#[#6+1]=#[#5+1]+#135
#[#6+2]=#[#5+2]+#136
N90 G#10
M99
"""
HEAD = "G21 G90 G54\nT99 M6\nG43 H99\n"
FANUC = {
    "[machine]\n": '[machine]\ndialect = "fanuc"\nwithout_point = "unit"\n',
}


def run(text: str, part: str) -> list[list[float]]:
    whole = f"{HEAD}{text}\nG0 Z60.\nM30\n{MACROS}"
    done = probing_machine.run(whole, probing_machine.up(part, probing_machine.machine(**FANUC)))
    assert done.error == ""
    assert done.run.result == "completed", done.run.fault_text
    return told(done)


@pytest.fixture
def some(request: pytest.FixtureRequest) -> random.Random:
    return random.Random(f"{SEED} {request.node.name}")


def test_the_set_is_read_and_a_check_takes_its_touches_for_made() -> None:
    text = f"{HEAD}G65 P9810 X1. Y2. Z60.\nG65 P9811 Z0. S2\nG65 P9814 D30. S3\nM30\n{MACROS}"
    start = (-80.0, -40.0, 200.0, 0.0, 0.0)
    made = blocks.read(text.encode(), probing_machine.machine(**FANUC), "p.nc", start=start).blocks
    probed = [block for block in made if isinstance(block, JointLine) and block.probe is not None]
    assert len(probed) == 1 + 1 + 8
    keys = [change.key for block in made if isinstance(block, Setting) for change in block.changes]
    assert keys == ["G55", "G56", "G56"]


@pytest.mark.parametrize("call", ["G65 P9811", "G65 P9814", "G65 P9811 Z0. S9"])
def test_a_call_without_what_it_needs_ends_in_its_alarm(call: str) -> None:
    with pytest.raises(ProgramError, match="alarm 91: FORMAT ERROR"):
        text = f"{HEAD}{call}\nM30\n{MACROS}"
        start = (-80.0, -40.0, 200.0, 0.0, 0.0)
        blocks.read(text.encode(), probing_machine.machine(**FANUC), "p.nc", start=start)


@pytest.mark.slow
def test_faces_set_an_offset_to_where_they_are(some: random.Random) -> None:
    x, y, z = (some.uniform(-4.0, 4.0) for _ in range(3))
    part = f'[[solid]]\nkind = "block"\nlow_mm = [{x}, {y}, -20.0]\nhigh_mm = [{x + 50}, {y + 50}, {z}]\n'
    text = (
        "G65 P9810 X-15. Y20. Z20.\nG65 P9810 Z-8.\nG65 P9811 X0. S2\nG65 P9810 Z20.\nG65 P9810 X20. Y-15.\n"
        "G65 P9810 Z-8.\nG65 P9811 Y0. S2\nG65 P9810 Z20.\nG65 P9810 Y20.\nG65 P9811 Z0. S2\n"
        "(DEBUG, #5241 #5242 #5243)\n(DEBUG, #5221 #5222 #5223)"
    )
    found, before = run(text, part)
    assert found == pytest.approx([a + b for a, b in zip(before, (x, y, z), strict=True)], abs=0.003)


@pytest.mark.slow
def test_a_bore_sets_an_offset_to_its_middle(some: random.Random) -> None:
    x, y, radius = some.uniform(-2, 2), some.uniform(-2, 2), some.uniform(9, 14)
    part = '[[solid]]\nkind = "block"\nlow_mm = [-40, -40, -60]\nhigh_mm = [40, 40, 0]\n[[hole]]\n'
    part += f'kind = "cylinder"\ncentre_mm = [{x}, {y}, 30.0]\nradius_mm = {radius}\nheight_mm = 85.0\n'
    text = f"G0 X0. Y0.\nG65 P9810 Z-10.\nG65 P9814 D{2 * radius:.1f} S2\n(DEBUG, #138 #5241 #5242)\n"
    (diameter, *found), before = run(f"{text}(DEBUG, #5221 #5222)", part)
    assert diameter == pytest.approx(2.0 * radius, abs=0.004)
    assert found == pytest.approx([before[0] + x, before[1] + y], abs=0.004)


@pytest.mark.slow
def test_a_way_that_is_not_free_ends_the_program(some: random.Random) -> None:
    part = '[[solid]]\nkind = "block"\nlow_mm = [-20, -20, -20]\nhigh_mm = [20, 20, 5]\n'
    whole = f"{HEAD}G65 P9810 X0. Y0. Z{some.uniform(-5, 3):.2f}\nM30\n{MACROS}"
    done = probing_machine.run(whole, probing_machine.up(part, probing_machine.machine(**FANUC)))
    assert "alarm 94: PATH OBSTRUCTED" in done.error
