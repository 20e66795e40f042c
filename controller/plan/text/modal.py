"""The modal state, and what the codes of a line make of it before the line moves.

State is replaced, never edited: a line that is refused leaves the old one as it was.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

from controller.machine import MOST_WEAR_MM, TOOL_AT_POWER_ON, Machine
from controller.plan.text.codes import GROUPS, SURFACES, Ask
from controller.plan.text.program import Act, Action, Block, Dwell, Modal, Side, Tip
from controller.plan.text.words import Word

TIPS = MappingProxyType({"G43": Tip.OFF, "G43.4": Tip.ROTARIES, "G43.5": Tip.VECTORS})
BLU_PER_MM = 100.0  # the paper's basic length unit is 0.01 mm (and 0.01 mm/min)
FEEDS = (1e-4, 1e7)  # units a minute: below, a millimetre takes a week; above, no drive follows
MOST_DWELL_S = 604_800.0


@dataclass(frozen=True, slots=True)
class State:
    """Everything one line leaves to the next."""

    modal: Modal
    motion: str = ""  # G0 to G3, or nothing
    cleared: str = "no motion mode is active at the start of a program"
    mm_per_unit: float = 1.0
    side: str = "G40"
    absolute: bool = True
    selected: int | None = None  # T
    speed_rev_min: float = 0.0  # S
    turning: int = 0  # M3: 1, M4: -1, M5: 0
    feed_deg_s: float | None = None  # the modal F as moves of rotaries alone read it; None as that of lengths
    cuts: bool = False  # a surface came before: the program is one for this control
    inverse: bool = False  # G93: F is one over the minutes that its line takes

    def time(self, ask: Ask, code: str, word: Word) -> float | None:
        """Seconds that a feed motion takes under G93, None under G94; ProgramError for G93 without F."""
        if not self.inverse:
            return None
        if "F" not in ask.words:
            raise ask.refusal(
                word,
                f"{code} under G93 without F: in inverse time each line of G1 to G3 needs its own F, one "
                "over the minutes that it takes; write F, or G94 and the feed per minute",
            )
        return 60.0 / ask.words["F"].value

    def feed(self, ask: Ask, code: str, word: Word) -> float:
        """The modal F for a motion, mm/s; ProgramError where there is none."""
        if self.inverse and code in SURFACES:
            raise ask.refusal(
                word,
                f"{code} takes its feed per minute: inverse time (G93) is for G1 to G3; write G94 before it",
            )
        feed = self.modal.feed_mm_s
        if feed is None:
            raise ask.refusal(
                word, f"{code} has no feed: no F stands here or before it; write F with the feed per minute"
            )
        return feed


def power_on() -> State:
    """T1 in the spindle, G17 G21 G40 G49 G54 G61 G90 G94, spindle and coolant off (DESIGN 1)."""
    return State(Modal(TOOL_AT_POWER_ON, 0, Side.RIGHT, 0.0, True, 0.0, 0.0, None, 0.0, 0))


def apply(
    ask: Ask, motion: str, state: State, machine: Machine, side_letters: str = ""
) -> tuple[State, list[Block]]:
    """The state after all codes of the line but its motion and stop, and their actions in order.

    ``motion`` is the motion the line will make ("" = none); it says how F is counted.
    ``side_letters`` are the words of G40 to G42 on this line.
    """
    settings = _Settings(ask, motion, state, machine)
    settings.side_letters = side_letters
    settings.run()
    return settings.state, settings.made


class _Settings:
    """One line being carried out up to its motion; one method per step of RS-274/NGC 3.8."""

    def __init__(self, ask: Ask, motion: str, state: State, machine: Machine) -> None:
        self.ask = ask
        self.state = state
        self.made: list[Block] = []
        self._motion = motion
        self._machine = machine
        self.side_letters = ""

    def run(self) -> None:
        self._units()
        self._feed_mode()
        self._feed()
        self._speed()
        self._select_tool()
        self._change_tool()
        self._spindle()
        self._coolant()
        self._dwell()
        self._side()
        self._length()
        self._plane_offset_path_distance()

    def _set_modal(self, modal: Modal) -> None:
        self.state = replace(self.state, modal=modal)

    def _act(self, word: Word, act: Act) -> None:
        self.made.append(Action(self.ask.place(word), self.state.modal, act))

    def _units(self) -> None:
        if code := self.ask.code("unit"):
            self.state = replace(self.state, mm_per_unit=25.4 if code == "G20" else 1.0)

    def _feed_mode(self) -> None:
        """Between G93 and G94 no feed survives: what F means has changed."""
        code = self.ask.code("feed")
        if code and (code == "G93") != self.state.inverse:
            self.state = replace(self.state, inverse=code == "G93", feed_deg_s=None)
            self._set_modal(replace(self.state.modal, feed_mm_s=None))

    def _feed(self) -> None:
        word = self.ask.words.get("F")
        if word is None:
            return
        if self.state.inverse and word.value > 0.0:
            return  # counts for this line only
        in_blu = self._motion in SURFACES and not word.point
        per_min = word.value / BLU_PER_MM if in_blu else word.value
        mm_s = per_min * (1.0 if in_blu else self.state.mm_per_unit) / 60.0
        if mm_s <= 0.0:
            raise self.ask.refusal(word, f"{word.text} is no feed: F must be greater than 0; correct it")
        if not FEEDS[0] <= per_min <= FEEDS[1]:
            low, high = (f"{feed * (BLU_PER_MM if in_blu else 1.0):.12g}" for feed in FEEDS)
            raise self.ask.refusal(word, f"{word.text} is no feed: {low} to {high} a minute are; correct it")
        deg_s = per_min / 60.0
        if (mm_s, deg_s) != (self.state.modal.feed_mm_s, self.state.feed_deg_s):
            modal = replace(self.state.modal, feed_mm_s=mm_s)
            self.state = replace(self.state, modal=modal, feed_deg_s=deg_s)

    def _speed(self) -> None:
        word = self.ask.words.get("S")
        if word is None:
            return
        spindle = self._machine.spindle
        if spindle is not None and word.value > spindle.max_rev_min:
            raise self.ask.refusal(
                word,
                f"{word.text} is too fast: this spindle turns at up to {spindle.max_rev_min:g} 1/min; "
                "lower it",
            )
        self.state = replace(self.state, speed_rev_min=self.ask.not_negative(word))
        if self.state.turning and "spindle" not in self.ask.codes and "tool change" not in self.ask.codes:
            self._turn_spindle(self.state.turning, word)

    def _select_tool(self) -> None:
        word = self.ask.words.get("T")
        if word is not None:
            self._known_tool(word)
            self.state = replace(self.state, selected=int(word.value))

    def _known_tool(self, word: Word) -> float:
        """Length of the tool that a T or H word names."""
        tool = self._machine.tool(self.ask.whole(word))
        if tool is None:
            raise self.ask.refusal(
                word,
                f"{word.text} names no tool: the tool table has {tool_list(self._machine)}; use one "
                "of these or add it",
            )
        return tool.length_mm

    def _change_tool(self) -> None:
        """M6 also stops the spindle (RS-274/NGC 3.6.3)."""
        if "tool change" not in self.ask.codes:
            return
        word = self.ask.codes["tool change"][1]
        if self.state.selected is None:
            raise self.ask.refusal(
                word, "M6 has no tool to change to: write T and its number before or beside it"
            )
        modal = replace(self.state.modal, tool=self.state.selected, spindle_rev_min=0.0)
        self.state = replace(self.state, modal=modal, turning=0)
        self._act(word, Act.TOOL)

    def _spindle(self) -> None:
        if "spindle" in self.ask.codes:
            code, word = self.ask.codes["spindle"]
            self._turn_spindle({"M3": 1, "M4": -1, "M5": 0}[code], word)

    def _turn_spindle(self, turning: int, word: Word) -> None:
        modal = replace(self.state.modal, spindle_rev_min=turning * self.state.speed_rev_min)
        self.state = replace(self.state, modal=modal, turning=turning)
        self._act(word, Act.SPINDLE)

    def _coolant(self) -> None:
        if "coolant" in self.ask.codes:
            code, word = self.ask.codes["coolant"]
            coolant = {"M7": self.state.modal.coolant | 1, "M8": self.state.modal.coolant | 2, "M9": 0}[code]
            self._set_modal(replace(self.state.modal, coolant=coolant))
            self._act(word, Act.COOLANT)

    def _dwell(self) -> None:
        if self.ask.code("one-line") != "G4":
            return
        word = self.ask.codes["one-line"][1]
        if "P" not in self.ask.words:
            raise self.ask.refusal(word, "G4 has no time: write P with the seconds to wait, such as G4 P0.5")
        seconds = self.ask.not_negative(self.ask.words["P"])
        if seconds > MOST_DWELL_S:
            found = self.ask.words["P"]
            raise self.ask.refusal(
                found,
                f"{found.text} waits for {seconds / 3600.0:.4g} h: P of G4 is 0 to {MOST_DWELL_S:.0f} "
                "seconds, a week; write M0 to wait for the operator",
            )
        self.made.append(Dwell(self.ask.place(word), self.state.modal, seconds))

    def _side(self) -> None:
        if code := self.ask.code("side"):
            side = Side.LEFT if code == "G41" else Side.RIGHT
            words = self._side_words()
            modal = replace(
                self.state.modal,
                side=side,
                placement=self._placement(words),
                allowance_mm=self._allowance_mm(words),
                tolerance_mm=self._tolerance_mm(words),
            )
            self.state = replace(self.state, side=code, modal=modal)

    def _side_words(self) -> dict[str, Word]:
        """P, Q and R of G40 to G42, where no other code of the line takes them."""
        return {letter: self.ask.words[letter] for letter in self.side_letters if letter in self.ask.words}

    def _placement(self, words: dict[str, Word]) -> int:
        placement = self.ask.whole(words["P"]) if "P" in words else 0
        if "P" in words and placement not in (1, 2, 3, 4):
            raise self.ask.refusal(
                words["P"],
                f"{words['P'].text} is no placement of the cutter: P of {self.ask.code('side')} is 1 "
                "(single), 2 (double), 3 (optimal) or 4 (auto); write one of these, or nothing for the "
                "machine's own",
            )
        return placement

    def _allowance_mm(self, words: dict[str, Word]) -> float:
        """Q of G40 to G42: what stays on the surface, or, negative, a cutter's wear."""
        if (word := words.get("Q")) is None:
            return 0.0
        allowance = word.value * self.state.mm_per_unit
        if allowance < -MOST_WEAR_MM:
            raise self.ask.refusal(
                word,
                f"{word.text} takes {-allowance:g} mm more off than the surface: Q of "
                f"{self.ask.code('side')} is what stays on it, and below 0 the cutter's wear, at most "
                f"{MOST_WEAR_MM:g} mm; correct it",
            )
        return allowance

    def _tolerance_mm(self, words: dict[str, Word]) -> float | None:
        word = words.get("R")
        if word is None:
            return None
        if word.value <= 0.0:
            raise self.ask.refusal(
                word,
                f"{word.text} is no tolerance: R of {self.ask.code('side')} is how far a surface may be off "
                "its form, greater than 0; correct it, or leave it out for the tool's or the machine's own",
            )
        return word.value * self.state.mm_per_unit

    def _length(self) -> None:
        """G43 adds the length of the tool in the spindle, or of tool H; H0 is none.

        G43.4 and G43.5 take the same length and make X Y Z places of the tip.
        """
        code = self.ask.code("length")
        if code == "G49":
            self._set_modal(replace(self.state.modal, length_mm=0.0, tip=Tip.OFF))
        if code not in TIPS:
            return
        word = self.ask.words.get("H")
        if word is None:
            tool = self._machine.tool(self.state.modal.tool)
            length = tool.length_mm if tool is not None else 0.0
        else:
            length = 0.0 if word.value == 0.0 else self._known_tool(word)
        self._set_modal(replace(self.state.modal, length_mm=length, tip=TIPS[code]))

    def _plane_offset_path_distance(self) -> None:
        ask, state = self.ask, self.state
        if ask.codes.keys().isdisjoint(("plane", "offset", "path", "distance")):
            return
        modal = state.modal
        if code := ask.code("offset"):
            modal = replace(modal, offset=self._offset(code))
        if code := ask.code("path"):
            blend = self._blend() if code == "G64" else (0.0, 0.0)
            exact = code == "G61"
            modal = replace(modal, exact=exact, blend_mm=blend[0], blend_deg=blend[1], exact_joints=exact)
        absolute = {"G90": True, "G91": False}.get(ask.code("distance"), state.absolute)
        modal = replace(modal, plane=ask.code("plane") or modal.plane)
        self.state = replace(state, modal=modal, absolute=absolute)

    def _offset(self, code: str) -> int:
        if code in self._machine.unset:
            known = [name for name in GROUPS["offset"] if name not in self._machine.unset]
            raise self.ask.refusal(
                self.ask.codes["offset"][1],
                f"{code} is not set, neither in [offsets] of the machine file nor at the machine; set it, or"
                f" use {' '.join(known)}",
            )
        return GROUPS["offset"].index(code)

    def _blend(self) -> tuple[float, float]:
        p, q = self.ask.words.get("P"), self.ask.words.get("Q")
        blend_mm = self.ask.not_negative(p) * self.state.mm_per_unit if p is not None else 0.0
        return blend_mm, self.ask.not_negative(q) if q is not None else 0.0


def tool_list(machine: Machine) -> str:
    """The tool table in a few words, for sentences."""
    return " ".join(f"T{tool.number}" for tool in machine.tools) or "none"
