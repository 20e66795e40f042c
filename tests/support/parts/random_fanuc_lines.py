"""Lines of controls as Fanuc's and Haas', as an operator types them one after the other."""

from __future__ import annotations

import random
from collections.abc import Callable

from controller.program.modal import State

OFFSETS = ("G54", "G55", "G59", "G110", "G154 P3", "G54.1 P2")
AXES = "XYZ"
PLANES = {  # definitions of tilted planes, a line each
    "P0": ("G68.2 P0 X{} Y{} Z{} I{} J{} K{}",),
    "P2": ("G68.2 P2 Q1 X{} Y{} Z{}", "G68.2 P2 Q2 X{} Y0. Z{}", "G68.2 P2 Q3 X0. Y{} Z{}"),
    "P3": ("G68.2 P3 Q1 X{} Y{} Z0. I1. J0. K0.", "G68.2 P3 Q2 I0. J{0} K{0}"),
}


class FanucLines:
    """Of one run, in mm: most of them sound in the state that is in force."""

    def __init__(self, rng: random.Random, rotaries: str) -> None:
        self._rng, self._rotaries = rng, rotaries
        self._owed: list[str] = []  # lines of a tilted plane that is half defined

    def line(self, state: State) -> str:
        """The next one."""
        if self._owed and self._rng.random() < 0.9:
            return self._owed.pop(0)
        if state.begun is not None and not self._owed:
            return "G69"
        self._owed.clear()
        return self._rng.choice(self._kinds(state))()

    def _kinds(self, state: State) -> tuple[Callable[[], str], ...]:
        one, n, rng = self._rng.choice, self._number, self._rng
        return (
            lambda: one(["G90", "G91", "G98", "G99", "G17", "G40", "G49", "G80"]),
            lambda: f"{one(['G90', 'G91'])} {one(['G0', 'G1'])} {self._places()} F500.",
            lambda: f"G0 {self._places()}",
            lambda: f"G1 {self._places()} F{rng.randrange(100, 900)}.",
            lambda: self._places(),
            lambda: self._places(),
            lambda: f"G0 {self._turns()}",
            lambda: f"G0 {self._places()} {self._turns()}",
            lambda: one(OFFSETS),
            lambda: one(["G15", "G16"]) if state.polar is None else f"G0 X{n()} Y{n()}",
            lambda: f"{one(['G16', 'G15'])} G0 X{n()} Y{n()}",
            lambda: f"{one(['G90', 'G91'])} Y{n()}",
            lambda: f"G51.1 {self._places()}",
            lambda: one(["G50.1", "G50.1 X0.", "G15", "G69", "G255", "G49", "G50.1"]),
            lambda: f"G68 X{n()} Y{n()} R{n()}",
            self._plane,
            self._plane,
            self._plane,
            lambda: one(["G254", "G254", "G255", "G54.2 P1", "G54.2 P0"]),
            lambda: f"G10 L21 P1 {self._places()}",
            lambda: f"G52 {self._places()}",
            lambda: one(["G52 X0. Y0. Z0.", f"G92 {self._places()}", "G92.1"]),
            lambda: f"G10 {one(['L2', 'L20'])} P{rng.randrange(1, 4)} {self._places()}",
            lambda: f"G10 {one(['L10', 'L11'])} P{rng.randrange(1, 4)} R{abs(rng.uniform(20.0, 90.0)):.3f}",
            lambda: one(["G43 H2", "G43 H3", "G43", "H2", "H3", "G49", f"G43 H2 G0 Z{n()}", "D2"]),
            lambda: one(["G43.4 H2", "G49", "G43.5 H2"]),
            lambda: one(["T2 M6", "T1 M6", "T3", "M6"]),
            lambda: f"{one(['G12', 'G13'])} I{rng.uniform(8.0, 20.0):.3f} D{rng.randrange(1, 4)} F300.",
            lambda: f"G13 I9. K{rng.uniform(10.0, 20.0):.2f} Q2. Z{n()} F300.",
            lambda: f"{one(['G81', 'G82', 'G83'])} {self._places('XY')} Z{n(-9.0, -20.0)} R{n(9.0)} Q3..",
            lambda: f"{one(['G2', 'G3'])} X{n()} Y{n()} R{rng.uniform(50.0, 90.0):.3f} F300.",
            lambda: f"{one(['G2', 'G3'])} I{n()} J{n()} F300.",
            lambda: f"G1 X{n()} {one([',R2.', ',C1.'])} F300.",
            lambda: one([f"#100={n()}", f"#1={n()}", f"#501={n()}", "#2=#5041", "#3=[#100+#1]"]),
            lambda: one(["G0 X#100", "G0 Y#1 Z#501", "G0 X[#5041+1.]", "G1 Y[#5002-2.] F200.", "G0 X#3"]),
            lambda: one([f"S{rng.randrange(100, 5000)} M3", "M5", "M4 S900", "M8", "M9", "M3 S1200 M8"]),
            lambda: f"G53 G0 {self._places()}",
            lambda: one(["G28 Z0.", "G91 G28 Z0.", "G90 G28 X5.", "G30 Z0."]),
            lambda: one(["G61", "G64", "G95 F0.2", "G94 F400.", "G4 P0.1", "G97 S500"]),
            lambda: one(["M97 P10", "M98 P1", "M99", "G65 P9", "G68.3 X0. Y0. Z0.", "G53.1"]),
        )

    def _plane(self) -> str:
        rows = self._rng.choice(list(PLANES.values()))
        first, *self._owed = [row.format(*(self._number() for _ in range(6))) for row in rows]
        return first

    def _number(self, most: float = 30.0, least: float | None = None) -> str:
        return f"{self._rng.uniform(-most if least is None else least, most):.4f}"

    def _places(self, letters: str = AXES) -> str:
        chosen = [x for x in letters if self._rng.random() < 0.6] or [self._rng.choice(letters)]
        return " ".join(f"{letter}{self._number()}" for letter in chosen)

    def _turns(self) -> str:
        chosen = [x for x in self._rotaries if self._rng.random() < 0.7] or [self._rotaries[0]]
        return " ".join(f"{letter}{self._number(60.0)}" for letter in chosen)
