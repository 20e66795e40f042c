"""What the codes of a line make of the modal state before the line moves."""

from __future__ import annotations

from dataclasses import replace

from controller.machine.model import OFFSETS, Machine, Spindle
from controller.messages import Key, message
from controller.program import gears, output_words, planar_words
from controller.program.codes import SURFACES, ParsedLine
from controller.program.modal import (
    BLU_PER_MM,
    FEEDS,
    INCHES,
    TIPS,
    TURNS,
    State,
    dwell_s,
    tool_list,
    turning_refusal,
)
from controller.program.program import (
    Act,
    Action,
    Await,
    Block,
    Dwell,
    Level,
    Modal,
    Remark,
    Select,
    Tip,
)
from controller.program.words import Word

BY_H = ("G43", "G44", "G43.4", "G43.5", "G234")  # codes of lengths that an H alone changes
OLDER_OFFSETS = tuple(f"G{110 + i}" for i in range(20))  # Haas' names of G154 P1 to P20


def apply(
    ask: ParsedLine, motion: str, state: State, machine: Machine, side_letters: str = ""
) -> tuple[State, list[Block]]:
    """The state after all codes of the line but its motion and stop, and their actions in order.

    ``motion`` is the motion the line will make ("" = none); it says how F is counted.
    ``side_letters`` are the words of G40 to G42 on this line.
    """
    waits = state.turn_feed is not None or state.length_number is not None
    if ask.codes.keys() <= {"motion"} and not (ask.has("FST") or ask.switches or ask.gear or waits):
        return state, []
    settings = _Settings(ask, motion, state, machine)
    settings.side_letters = side_letters
    settings.run()
    return settings.state, settings.made


class _Settings:
    """One line being carried out up to its motion; one method per step of RS-274/NGC 3.8."""

    def __init__(self, ask: ParsedLine, motion: str, state: State, machine: Machine) -> None:
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
        self._outputs()
        self._change_gear()
        self._change_tool()
        self._spindle()
        self._turn_feed()
        self._coolant()
        if "overrides" in self.ask.codes:
            self._set_modal(overrides_after(self.ask, self.state.modal, self._machine))
        self._dwell()
        self._side()
        self._length()
        self._plane_offset_path_distance()

    def _set_modal(self, modal: Modal) -> None:
        self.state = self.state._replace(modal=modal)

    def _act(self, word: Word, act: Act) -> None:
        self.made.append(Action(self.ask.place(word), self.state.modal, act))

    def _units(self) -> None:
        if code := self.ask.code("unit"):
            self.state = self.state._replace(mm_per_unit=25.4 if code in INCHES else 1.0)

    def _feed_mode(self) -> None:
        """Between G93, G94 and G95 no feed survives: what F means has changed.

        Nor does it behind the code that is on, as LinuxCNC has it; on controls as Fanuc's it stays.
        """
        code = self.ask.code("feed")
        changes = (code == "G93", code == "G95") != (self.state.inverse, self.state.per_turn)
        if code and (changes or self._machine.dialect == "rs274"):
            inverse, per_turn = code == "G93", code == "G95"
            self.state = self.state._replace(
                inverse=inverse, per_turn=per_turn, turn_feed=None, feed_deg_s=None
            )
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
            raise self.ask.refusal(word, "feed.not_positive")
        if not FEEDS[0] <= per_min <= FEEDS[1]:
            low, high = (f"{feed * (BLU_PER_MM if in_blu else 1.0):.12g}" for feed in FEEDS)
            raise self.ask.refusal(word, "feed.range", low=low, high=high)
        deg_s = per_min / 60.0
        if self.state.per_turn:
            self.state = self.state._replace(turn_feed=(mm_s * 60.0, per_min))
            return
        if (mm_s, deg_s) != (self.state.modal.feed_mm_s, self.state.feed_deg_s):
            modal = replace(self.state.modal, feed_mm_s=mm_s)
            self.state = self.state._replace(modal=modal, feed_deg_s=deg_s)

    def _turn_feed(self) -> None:
        """G95: the feed a second follows the spindle; none where it stands."""
        if self.state.turn_feed is None:
            return
        turns_s = abs(self.state.modal.spindle_rev_min) / 60.0
        mm_s, deg_s = (feed * turns_s if turns_s else None for feed in self.state.turn_feed)
        self.state = self.state._replace(feed_deg_s=deg_s)
        self._set_modal(replace(self.state.modal, feed_mm_s=mm_s))

    def _speed(self) -> None:
        word = self.ask.words.get("S")
        if word is None:
            return
        if word.value > self._spindle_of(word).max_rev_min:
            raise self.ask.refusal(word, "spindle.too_fast", most=self._spindle_of(word).max_rev_min)
        self.state = self.state._replace(speed_rev_min=self.ask.not_negative(word))
        self._turn_on(word)

    def _select_tool(self) -> None:
        """T0 is no tool: M6 empties the spindle."""
        if "T" in self.ask.words:
            self._select(self.ask.words["T"])

    def _select(self, word: Word) -> None:
        if word.value != 0.0:
            self._known_tool(word)
        number = int(word.value)
        comes = self._machine.comes(number)
        if comes != number:
            told = message("note.sister", tool=number, sister=comes)
            self.made.append(Remark(self.ask.place(word), self.state.modal, told))
        if self._machine.changer is not None and self._machine.changer.prepare:
            self.made.append(Select(self.ask.place(word), self.state.modal, comes))
        self.state = self.state._replace(selected=comes)

    def _outputs(self) -> None:
        """M62, M63 and M67 count with the next motion, M64, M65, M68 and the machine's own codes at once."""
        if "output" in self.ask.codes:
            code, word = self.ask.codes["output"]
            ask = self.ask.of(code)
            if code == "M66":
                made, answer = output_words.awaited(ask, word, self.state.modal, self._machine)
                self.made.append(made)
                self.state = self.state._replace(answer=answer)
                return
            self._say(ask, code, word)
            if code in ("M64", "M65", "M68"):
                self._act(word, Act.OUTPUT)
        for word, number, on in self.ask.switches:
            self._switch(number, on)
            self._act(word, Act.OUTPUT)

    def _say(self, ask: ParsedLine, code: str, word: Word) -> None:
        """An output, digital or analogue, is told."""
        if code in ("M67", "M68"):
            modal = self.state.modal
            said = output_words.led(ask, code, word, self._machine)
            self._set_modal(replace(modal, outputs=modal.outputs.led(*said)))
        else:
            self._switch(output_words.number(ask, code, word, self._machine), code in ("M62", "M64"))

    def _switch(self, number: int, on: bool) -> None:
        modal = self.state.modal
        self._set_modal(replace(modal, outputs=modal.outputs.switched(number, on)))

    def _known_tool(self, word: Word) -> float:
        """Length of the tool that a T or H word names."""
        tool = self.state.named(self.ask.whole(word), self._machine)
        if tool is None:
            raise self.ask.refusal(word, "tool.unknown", tools=tool_list(self._machine))
        return tool.length_mm

    def _change_tool(self) -> None:
        """M6 also stops the spindle (RS-274/NGC 3.6.3); M61 only says which tool is there."""
        if self.ask.code("tool change") == "M61":
            self._name_tool()
            return
        if "tool change" not in self.ask.codes:
            return
        word = self.ask.codes["tool change"][1]
        if self.state.selected is None:
            raise self.ask.refusal(word, "tool.none_to_change")
        before, modal = self.state.modal, self.state.with_tool(self.state.selected, self._machine)
        self.state = self.state._replace(modal=replace(modal, spindle_rev_min=0.0), turning=0)
        self._act(word, Act.TOOL)
        self._carry(word, before)
        if self.ask.next_tool is not None:
            self._select(self.ask.next_tool)

    def _carry(self, word: Word, before: Modal) -> None:
        """The steps of a changer; behind them coolant is as it was, and none of their stops is the end."""
        made, marks = output_words.blocks(
            self.ask, word, before, self.state.modal, self._machine, self.state.marks
        )
        self.made += made
        self.state = self.state._replace(marks=marks)
        if made:
            self._act(word, Act.COOLANT)

    def _name_tool(self) -> None:
        if self._machine.changer is not None:
            raise self.ask.refusal(self.ask.codes["tool change"][1], "tool.m61_changer")
        word = self.ask.word("M61", "Q")
        if word is None:
            raise self.ask.refusal(self.ask.codes["tool change"][1], "tool.m61")
        if word.value != 0.0:
            self._known_tool(word)
        tool = int(word.value)
        self._check_turning(self.state.turning, tool, word)
        self._set_modal(self.state.with_tool(tool, self._machine))

    def _spindle(self) -> None:
        if "spindle" not in self.ask.codes:
            return
        code, word = self.ask.codes["spindle"]
        if code == "M19":
            self._orient(word)
            return
        if self._machine.io is not None and self._machine.io.orient is not None:
            self._let_go(len(self._machine.io.digital_out), word)
        self._turn_spindle(next((way for way, name in TURNS.items() if name == code), 0), word)

    def _orient(self, word: Word) -> None:
        """M19: the spindle stops, its drive brings it to the angle, and motion waits until it is there."""
        output, back, most_s = output_words.oriented(self.ask.of("M19"), word, self._machine)
        self._turn_spindle(0, word)
        self._switch(output, True)
        self._act(word, Act.OUTPUT)
        self.made.append(Await(self.ask.place(word), self.state.modal, back, Level.HIGH, most_s))

    def _let_go(self, output: int, word: Word) -> None:
        """M3 to M5 behind M19: the drive is free to turn again before it is told to."""
        if self.state.modal.outputs.on >> output & 1:
            self._switch(output, False)
            self._act(word, Act.OUTPUT)

    def _change_gear(self) -> None:
        """M41 to M44; a spindle that turns does so again in its new gear."""
        if self.ask.gear is None:
            return
        word, gear = self.ask.gear
        self._shift(gear, word)
        self._turn_on(word)

    def _turn_on(self, word: Word) -> None:
        """A spindle that turns does so as the state has it now, where no code of the line says another."""
        if self.state.turning and "spindle" not in self.ask.codes and "tool change" not in self.ask.codes:
            self._turn_spindle(self.state.turning, word)

    def _shift(self, gear: int, word: Word) -> None:
        """At a standstill: outputs, and the input that says that it is in; nothing where it is in already."""
        spindle, io, modal = self._spindle_of(word), self._machine.io, self.state.modal
        if io is None or gear == gears.engaged(spindle, io, modal.outputs):
            return
        if modal.spindle_rev_min:
            self._set_modal(replace(modal, spindle_rev_min=0.0))
            self._act(word, Act.SPINDLE)
        wanted = spindle.gears[gear]
        for name in (*wanted.on, *wanted.off):
            self._switch(io.switched.index(name), name in wanted.on)
        self._act(word, Act.OUTPUT)
        number = io.awaited.index(wanted.input)
        self.made.append(Await(self.ask.place(word), self.state.modal, number, Level.HIGH, wanted.within_s))

    def _gear_of_speed(self, word: Word) -> None:
        """The gear that S needs is in. Raises ProgramError where none has it, or the one that was said."""
        spindle, io, speed = self._spindle_of(word), self._machine.io, self.state.speed_rev_min
        if not spindle.gears or io is None or not speed:
            return
        gear = gears.chosen(spindle, gears.engaged(spindle, io, self.state.modal.outputs), speed)
        if gear is None:
            ranges = ", ".join(gears.shown(one) for one in spindle.gears)
            raise self.ask.refusal(word, "spindle.no_gear", speed=speed, ranges=ranges)
        self._shift(gear, word)

    def _spindle_of(self, word: Word) -> Spindle:
        """What S, M3 and M4 are for. Raises ProgramError where the machine file says nothing of it."""
        if self._machine.spindle is None:
            raise self.ask.refusal(word, "spindle.none")
        return self._machine.spindle

    def _check_turning(self, sense: int, tool: int, word: Word) -> None:
        """The spindle may turn as the state says with this tool in it. Raises ProgramError."""
        why = turning_refusal(self._machine, tool, sense, self.state.speed_rev_min) if sense else None
        if why is not None:
            raise self.ask.refusal(word, str(why["key"]), **why["values"])

    def _turn_spindle(self, turning: int, word: Word) -> None:
        tool = self.state.modal.tool
        if turning:
            self._spindle_of(word)
        if turning < 0 and not self._machine.may_turn_back:
            raise self.ask.refusal(word, "spindle.one_way", code=TURNS[turning])
        self._check_turning(turning, tool, word)
        if turning:
            self._gear_of_speed(word)
        modal = replace(self.state.modal, spindle_rev_min=turning * self.state.speed_rev_min)
        self.state = self.state._replace(modal=modal, turning=turning)
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
        word, given = self.ask.codes["one-line"][1], self.ask.of("G4").words
        times = [given[letter] for letter in "PXU" if letter in given]
        if "U" in given:
            self.ask.lenient.append(("note.dwell_u", given["U"]))
        if not times:
            other = self.ask.words.get("X")
            raise self.ask.refusal(other or word, "dwell.no_time_of_x" if other else "dwell.no_time")
        if len(times) > 1:
            raise self.ask.refusal(times[1], "dwell.two_times", other=times[0].text)
        seconds = dwell_s(self.ask, times[0], self._machine)
        self.made.append(Dwell(self.ask.place(word), self.state.modal, seconds))

    def _side(self) -> None:
        if code := self.ask.code("side"):
            modal = planar_words.on_surfaces(
                self.ask, code, self.side_letters, self.state.mm_per_unit, self.state.modal
            )
            self.state = self.state._replace(modal=modal)
            planar = planar_words.active_offset(self.ask, code, self.side_letters, self.state, self._machine)
            word = self.ask.words.get("D") if planar is not None and "D" in self.side_letters else None
            number = int(word.value) if word is not None and code not in planar_words.WRITTEN else 0
            bare = planar is not None and planar is not modal.planar and word is None
            if bare and self.state.offset_number is None and self._machine.dialect == "fanuc":
                self.ask.lenient.append(("note.side_without_d", self.ask.codes["side"][1]))
            self.state = self.state._replace(
                side=code, modal=replace(modal, planar=planar), radius_tool=number
            )

    def _length(self) -> None:
        """G43 adds the length of the tool in the spindle, or of tool H; H0 is none.

        G43.4 and G43.5 take the same length and make X Y Z places of the tip.
        """
        code = self.ask.code("length")
        if code == "G49":
            self._check_no_length()
            self._set_modal(replace(self.state.modal, length_mm=0.0, tip=Tip.OFF))
            self._set_aside((0.0, 0.0))
            self.state = self.state._replace(length_tool=0, length_code=code)
        if not code and self.state.length_number is not None and self.state.length_code in BY_H:
            code = self.state.length_code  # H alone
        if code not in TIPS:
            return
        modal, said = self.state.modal, self._tool_length_mm(code)
        length = {"G43.2": modal.length_mm + said, "G44": -said}.get(code, said)
        self._set_modal(replace(modal, length_mm=length, tip=TIPS[code]))
        self._set_aside(self._aside(code))
        self.state = self.state._replace(
            length_tool=self._length_tool(code), length_code=code, length_number=None
        )

    def _aside(self, code: str) -> tuple[float, float]:
        """The tool's offset across Z: of G43.1 X Y, and kept by G43.2."""
        if code not in ("G43.1", "G43.2"):
            return 0.0, 0.0
        given, unit = self.ask.of(code).words, self.state.mm_per_unit
        x, y = self.state.origins.aside
        if code == "G43.1":
            x, y = (given[c].value * unit if c in given else q for c, q in (("X", x), ("Y", y)))
        return x, y

    def _set_aside(self, aside: tuple[float, float]) -> None:
        origins = self.state.origins
        if aside != origins.aside:
            self.state = self.state.with_origins(replace(origins, aside=aside), self._machine)

    def _check_no_length(self) -> None:
        """H0 says beside G49 what it says."""
        word = self.ask.word("G49", "H")
        if word is not None and word.value != 0.0:
            raise self.ask.refusal(word, "tool.length_beside_g49")

    def _length_tool(self, code: str) -> int:
        """The tool whose length alone is in force after the code; 0 where it is no tool's."""
        if code in ("G43.1", "G43.2", "G44"):
            return 0
        word = self._length_word(code)
        return self.state.modal.tool if word is None else int(word.value)

    def _length_word(self, code: str) -> Word | None:
        """H, or Z of G43.1; else H of a line before that had no G43."""
        word = self.ask.word(code, "Z" if code == "G43.1" else "H")
        return self.state.length_number if word is None and code != "G43.1" else word

    def _tool_length_mm(self, code: str) -> float:
        """The length that H, or Z of G43.1, names; without one that of the tool in the spindle."""
        word = self._length_word(code)
        if word is None and code == "G43.1" and self.ask.of(code).words.keys() & {"X", "Y"}:
            return self.state.modal.length_mm
        if word is None and code in ("G43.1", "G43.2"):
            takes = Key("tool.takes_z" if code == "G43.1" else "tool.takes_h")
            raise self.ask.refusal(self.ask.codes["length"][1], "tool.no_length", code=code, takes=takes)
        if word is None:
            tool = self.state.tool(self.state.modal.tool, self._machine)
            return tool.length_mm if tool is not None else 0.0
        if code == "G43.1":
            return word.value * self.state.mm_per_unit
        return 0.0 if word.value == 0.0 else self._known_tool(word)

    def _plane_offset_path_distance(self) -> None:
        ask, state = self.ask, self.state
        if ask.codes.keys().isdisjoint(("plane", "offset", "path", "distance", "centre", "return")):
            return
        if code := ask.code("offset"):
            index = self._offset(code)
            if index != state.origins.index:
                state = state.with_origins(replace(state.origins, index=index), self._machine)
        modal = state.modal
        if code := ask.code("path"):
            blend = self._blend() if code == "G64" else (0.0, 0.0)
            exact = code != "G64"
            if (exact, *blend, exact) != (modal.exact, modal.blend_mm, modal.blend_deg, modal.exact_joints):
                modal = replace(modal, exact=exact, blend_mm=blend[0], blend_deg=blend[1], exact_joints=exact)
        absolute = {"G90": True, "G91": False}.get(ask.code("distance"), state.absolute)
        centres = {"G90.1": True, "G91.1": False}.get(ask.code("centre"), state.centres_absolute)
        ends = {"G99": True, "G98": False}.get(ask.code("return"), state.to_clearance)
        if (plane := ask.code("plane")) and plane != modal.plane:
            modal = replace(modal, plane=plane)
        as_before = (state.absolute, state.centres_absolute, state.to_clearance)
        if modal is state.modal and (absolute, centres, ends) == as_before:
            self.state = state  # the same, as those that have seen it know it
            return
        cycle = state.cycle
        if cycle is not None and absolute != state.absolute and self._machine.dialect == "fanuc":
            cycle = cycle.in_mode(absolute)  # its heights stay where they are
        self.state = state._replace(
            modal=modal, absolute=absolute, centres_absolute=centres, to_clearance=ends, cycle=cycle
        )

    def _offset(self, code: str) -> int:
        word = self.ask.codes["offset"][1]
        name = code
        if code == "G54" and (given := self.ask.word(code, "P")) is not None:
            code = "G54.1"
            self.ask.lenient.append(("note.g54_p", given))
        if code in OLDER_OFFSETS:
            name = f"G54.1 P{OLDER_OFFSETS.index(code) + 1}"
        if code in ("G54.1", "G154"):
            name = f"G54.1 P{self._numbered(code, word)}"
        index = OFFSETS.index(name)
        if not self.state.origins.is_set(index, self._machine):
            known = [one for i, one in enumerate(OFFSETS) if self.state.origins.is_set(i, self._machine)]
            raise self.ask.refusal(word, "offset.not_set", name=name, known=" ".join(known))
        return index

    def _numbered(self, code: str, word: Word) -> int:
        """P of G54.1 and G154."""
        number = self.ask.word(self.ask.code("offset"), "P")
        if number is None or not 1 <= self.ask.whole(number) <= 48:
            raise self.ask.refusal(number or word, "offset.number", code=code)
        return int(number.value)

    def _blend(self) -> tuple[float, float]:
        p, q = (self.ask.word("G64", letter) for letter in "PQ")
        blend_mm = self.ask.not_negative(p) * self.state.mm_per_unit if p is not None else 0.0
        return blend_mm, self.ask.not_negative(q) if q is not None else 0.0


# M48 to M53: what the program takes from the operator's hand, and gives back.
#
# M48 and M49 are for the overrides of feeds and of the spindle. The override of rapids, hold and stop stay
# with the operator.

FEED_STOP = "feed_stop"  # the input of M53


def overrides_after(ask: ParsedLine, modal: Modal, machine: Machine) -> Modal:
    """The modal state after the line's code of the group. Raises ProgramError."""
    code, word = ask.codes["overrides"]
    on = code == "M48" if code in ("M48", "M49") else _is_on(ask, code)
    if code == "M52" and on and (machine.spindle is None or machine.spindle.adaptive is None):
        raise ask.refusal(word, "override.adaptive")
    if code == "M53" and on and (machine.io is None or machine.io.input(FEED_STOP) is None):
        raise ask.refusal(word, "override.no_feed_stop", input=FEED_STOP)
    name = {"M51": "", "M52": "adaptive", "M53": "stop"}.get(code, "feed")
    return replace(modal, overrides=modal.overrides._replace(**{name: on})) if name else modal


def _is_on(ask: ParsedLine, code: str) -> bool:
    """P: 0 is off, 1 or nothing on."""
    p = ask.word(code, "P")
    if p is not None and p.value not in (0.0, 1.0):
        raise ask.refusal(p, "override.on_or_off", code=code)
    return p is None or p.value == 1.0
