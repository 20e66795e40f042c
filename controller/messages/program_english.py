"""English: what the reader of programs refuses."""

from __future__ import annotations

LANGUAGE = "en"

REFUSALS = {
    # --- program
    "program.refused": "{place}: {sentence}",
    "program.within": "{sentence} ({calls})",
    "program.called": "called by {written} on line {line} of {file}",
    "program.more_calls": "{more} calls more",
    "program.listed": "{one}, {other}",
    "program.count": "{about} {count}",
    "program.count_other": "other {count}",
    "program.summed": "{count} refusals: {each}.",
    "program.of_several": "{sentence} ({summed})",
    # --- arc
    "arc.turning_axis": "{motion} under {code} is not done: arcs of the tool tip with a turning axis "
    "have no agreed meaning; write the arc as G1 lines (with G64 P they become one smooth path), or G49 "
    "before it",
    "arc.no_turns": "{word} is no arc: P counts the turns, from 1 up; correct it",
    "arc.too_many_turns": "{word} is too many turns: P counts 1 to {most} of them; write more arcs",
    "arc.off_the_plane": "{word} is not in the plane: under {plane} a centre has {allowed}; correct the "
    "word or the plane",
    "arc.centre_or_radius": "{motion} has {found}: under {plane} it takes either {allowed} or R; write "
    "one of them",
    "arc.half_a_centre": "{lacks} is missing: under G90.1 a centre is a position and has both words",
    "arc.no_radius": "{word} gives no arc: with R the radius is not 0 and an end point {axes} stands "
    "beside it; add it, or give the centre",
    "arc.centre_is_start": "the centre of this arc is its start; I J K are the way from start to centre",
    "arc.two_radii": "this arc begins {start:.4f} mm from its centre and ends {end:.4f} mm from it; they "
    "may differ by {allowed:.4f} mm; correct I J K or the end point",
    "arc.full_with_radius": "an arc with R needs an end point other than its start; a full circle takes "
    "I J K",
    "arc.out_of_reach": "R {radius:.4f} mm cannot reach an end {away:.4f} mm away; R is at least half of "
    "that; correct R or the end point",
    "arc.both": "both a centre and R",
    "arc.neither": "neither a centre nor R",
    # --- word
    "word.no_place": "{code} has no place: it takes words of axes, as {code} X10 Y0; write them beside "
    "it, or leave it out",
    "word.two_owners": "{owners} on one line both take {letter}: which of them {word} belongs to is not "
    "clear; write two lines",
    "word.no_motion": "{word} has no motion: {cleared}; write G0 to G3, G51, G52 or G6.2 with it, or "
    "remove the line",
    "word.exponent": "{word}: E is a word beside M67 and M68 alone, and numbers have no exponents; write "
    "the number out",
    "word.rotary_with_vectors": "{word} is a rotary position under G43.5, where I J K along the tool "
    "axis say how the tool stands; write I J K, or G43.4 for rotary words",
    "word.vector": "no code on this line takes {word}: {motion} has tool vectors I J K under G43.5 only, "
    "and arcs with I J K are G2 and G3; write G43.5 or remove the word",
    "word.no_owner": "no code on this line takes {word}: {letter} belongs to {takers}; add the code or "
    "remove the word",
    "word.no_owner_here": "no code on this line takes {word}: {here}; {letter} belongs to {takers}; add the "
    "code or remove the word",
    "word.takes": "{code} takes {letters}",
    "word.takes_none": "{code} takes no words of axes",
    "word.g53_alone": "G53 (machine position) has no move: it goes with axis words under G0 or G1; add "
    "G0 and the axes, or remove G53",
    "word.two_take_axes": "{code} and {other} on one line both take the axis words; write two lines",
    "word.not_a_count": "{word} is not a count: {letter} takes a whole number from 0 up; correct it",
    "word.negative": "{word} is negative: {letter} is 0 or more here; correct it",
    "word.no_such_axis": "{word} moves an axis that this machine does not have: its axes are {axes}; use "
    "one of these, or choose the machine that the program was written for",
    "word.number_inside": "{word} stands inside the line: N is the first word; move or remove it",
    "word.twice": "{before} and {word} stand on one line: each letter but G and M may stand once; remove one",
    "word.no_point": "{word} has no decimal point: on controls of this dialect it may mean {whole:g} or "
    '{thousandth:g}; write a point, or say in the machine file which, [machine] without_point = "unit" or '
    '"thousandth"',
    "word.no_number": "{word} is no line number: N takes a number from 0 up; correct it or leave it out",
    "word.too_large": "{letter} has the value {value:g}: no word may be beyond +-{most:.0f}; correct it",
    # --- code
    "code.not_done": "{code} ({meaning}) is not done here: {instead}",
    "code.two_of_a_group": "{before} and {code} are both {group} codes: one line takes one of {allowed}; "
    "remove one or write two lines",
    "code.unknown": "{word} is not known here: the codes of this control are {known}; write what is meant "
    "with these, or remove it",
    "code.unknown_m": "{word} is not known here: the codes of this control are {known}; write what is meant "
    "with these, remove it, or name an output for it in m_codes of [io]",
    "code.none": "no code of this control",
    "code.other_dialect": '{word} is a code of dialect = "{dialect}" alone: set that in [machine], or '
    "with --dialect, if the program is written for it, or use another code",
    # --- boring
    "boring.plane": "{code} stands under {plane}: it is done in G17 alone; write G17, or the moves "
    "themselves",
    "boring.no_shift": "{code} has no Q, how far the tip is led off the wall before the tool leaves the "
    "hole; write it",
    "boring.shift_of_nothing": "{code} goes aside by nothing: the tip would scratch the wall; write Q "
    "above 0, or G86",
    "boring.negative": "{word} is negative: Q is how far the tool goes aside; correct it",
    "boring.no_direction": "{word} says how far, and the machine file not which way leads the tip off "
    "the wall: write shift in orient of [io], such as X+, or I and J in place of Q",
    "boring.off_the_plane": "{word} goes along {shift} of the machine, which is not in the plane of the "
    "hole here; write I and J in place of Q",
    "boring.heights": "G87 cuts upwards from R at {below:.4g} mm to Z at {end:.4g} mm, beginning above "
    "both at {level:.4g} mm: R is the lowest; correct them",
    # --- beside
    "beside.nothing_moves": "under the {code} of line {line} more than {most} lines move nothing in the "
    "plane",
    "beside.no_plane_of_machine": "under the {code} of line {line} tool-centre control and machine "
    "positions (G53) have no such plane",
    "beside.short_lead_in": "under the {code} of line {line} the first move is {length:.6g} mm long in "
    "the plane, and must not be shorter than the cutter's radius, {radius:.6g} mm; begin farther away",
    "beside.arc_first": "under the {code} of line {line} the first move is an arc, which does not lead "
    "there; begin with a line",
    "beside.inside_an_arc": "under the {code} of line {line} it runs inside of an arc of radius "
    "{arc:.4f} mm, where a cutter of radius {radius:.4f} mm does not go; take a smaller cutter or a larger "
    "radius",
    "beside.vanishes": "under the {code} of line {line} this move vanishes behind the cutter, of radius "
    "{radius:.4f} mm: of its corner with line {there} nothing of it is left; take a smaller cutter, or "
    "make the move longer",
    "beside.corner": "under the {code} of line {line} the corner of lines {here} and {there} cannot be "
    "reached by a cutter of radius {radius:.4f} mm; take a smaller cutter, or change the contour",
    "beside.no_plane": "under the {code} of line {line} tool-centre control has no such plane",
    "beside.is_on": "{word} stands under the {code} of line {line}, which is on until G40; write G40 "
    "with a move away from the contour before it",
    "beside.two_meanings": "{word} and {other} stand beside {code}: with D it is for lines and arcs, "
    "with P, Q and R for surfaces; write one of the two",
    "beside.no_diameter": "{code} has no D: write D and the cutter's diameter",
    "beside.edge": "{word} is the edge of a turning tool: a cutter here is round; leave L out",
    "beside.no_tool": "{word} names no tool: D is the number in the tool table, which has {known}; use "
    "one of these or add it, or write G41.1 or G42.1 with D as the diameter",
    "beside.for_surfaces": "{motion} runs under {side}, which is for surfaces here: P, Q or R stand "
    "beside it, or a surface came after it; write G40, and G41 or G42 with D for lines and arcs",
    "beside.tip_control": "{motion} runs under {side} and tool-centre control: lines and arcs have their "
    "cutter beside them in a plane of X Y Z only; write G49 before it, or G40",
    "beside.for_lines": "{motion} is a surface, and the {code} of line {line} is for lines and arcs: D "
    "stands beside it, or a line came first; write G40 before it, and G41 or G42 without D",
    "beside.changed": "{word} stands under the {code} of line {line}: tool, length, plane and "
    "coordinates stay as they are until G40; write G40 with a move away from the contour before it",
    "beside.unknown": "where the axes stand is not known here: the path chooses it behind a surface or a "
    "tool vector, and the cutter cannot be led beside a contour from there; write G0 with positions of X Y "
    "Z before it",
    "beside.gouge": "under the {code} of line {line} the cutter, of radius {radius:.4f} mm, cuts into "
    "what line {there} leaves standing: between the two the contour is narrower than the cutter; take a "
    "smaller one",
    "beside.gouge_told": "the cutter, of radius {radius:.4f} mm, cuts into what line {there} leaves "
    "standing: between the two the contour is narrower than the cutter; take a smaller one",
    "beside.late": "{code} on line {line} has no D, and more than {most} lines stand between it and the "
    "first line or arc; write D beside it",
    "beside.owed": "{code} on line {line} is for {plane}, and the cutter still stands beside a contour "
    "in {owed}; move it in that plane behind G40 first",
    "beside.arc_behind": "the first move after G40 is an arc: it leads from beside the contour to its "
    "own end, and must be a line; write G0 or G1 before it",
    # --- cycle
    "cycle.not_along_the_tool": "{code} would go along {axis} of the tilted plane, {off:.4g} degrees off "
    "the tool: a cycle goes along the tool, within {most:g} degrees; write G53.1 before it",
    "cycle.no_height": "{code} has no {lacks}, {what}: the first line of a cycle says it; write it",
    "cycle.pecks_of_a_tap": "{word} taps in pecks, which needs a spindle that tells its angle: write "
    "position in [spindle] of the machine file, or leave Q out",
    "cycle.no_peck": "{word} is no depth of a peck: Q is greater than 0; correct it",
    "cycle.no_dwell": "{code} has no P, the seconds it waits at the bottom; write it, or G81 or G85",
    "cycle.upside_down": "{code} has its clearance R at {clearance:.4g} mm, below its bottom at "
    "{bottom:.4g} mm: R is above the bottom; correct one of the two",
    "cycle.repeats": "{word} repeats a cycle {least} to {most} times; correct it",
    "cycle.too_many_pecks": "{code} would peck {pecks:.0f} times: {most} are the most; raise Q",
    "cycle.tip_control": "{code} stands under tool-centre control (G43.4, G43.5); write G49 before it, "
    "or the moves themselves",
    "cycle.inverse": "{code} stands under G93, where F is a time; write G94 and the feed per minute "
    "before it",
    "cycle.beside": "{code} stands under {side}; write G40 before it",
    "cycle.tap_right": "{code} stands while the spindle does not turn clockwise; write S and M3 before it",
    "cycle.tap_left": "{code} stands while the spindle does not turn counter-clockwise; write S and M4 "
    "before it",
    "cycle.standing": "{code} stands while the spindle stands; write S and M3 or M4 before it",
    "cycle.g87_to_clearance": "{code} stands under G99, and its R is below the part: it ends where it "
    "began; write G98 before it",
    "cycle.bottom": "the bottom",
    "cycle.clearance": "the height down to which rapids go",
    "cycle.no_q": "{code} has no Q: Q is the depth of each peck, greater than 0; write it",
    "cycle.bad_q": "{code} has {word}: Q is the depth of each peck, greater than 0; write it",
    # --- value
    "value.not_finite": "{what} has no finite value: it is too large, or leaves the range of a function; "
    "correct it",
    "value.no_bits": "{what} goes bit by bit on controls of this dialect, and {value:g} is no whole number "
    "of up to 31 bits; compare first, as [#1 GT 0] {what} [#2 GT 0], or round it",
    "value.two_comparisons": "{what} compares what is compared already: on controls of this dialect AND, OR "
    "and XOR bind before EQ, NE, GT, GE, LT and LE; write brackets, as [[#1 EQ 1] AND [#2 EQ 2]]",
    "value.no_bracket": "[ is missing: the value of a function or a condition stands in brackets, as sin[30]",
    "value.open_bracket": "this [ is not closed: an expression runs from [ to ] on one line; add the ]",
    "value.no_parameter": "#{value:g} is no parameter: they are numbered {first} to {last}; use one of these",
    "value.no_ini": "#<_ini[...]> reads an INI file, and there is none here; write the value, or set a "
    "parameter to it",
    "value.no_name": "#< opens the name of a parameter, which ends with > on its line, as #<depth>",
    "value.too_deep": "brackets are nested deeper than {most}: split it with parameters #1, #2, ...",
    "value.atan": "atan takes two values: write atan[y]/[x]",
    "value.exists": "EXISTS asks for a parameter: write EXISTS[#<name>]",
    "value.exists_open": "EXISTS takes one parameter and a ]: write EXISTS[#<name>]",
    "value.o_for_zero": "O after {before}: is it a zero? A number has digits only; write 0",
    "value.alone": "{written} stands alone: a parameter is set with {written}=value or used after a "
    "letter, as X{written}; add what is missing",
    "value.o_behind": "{what} is followed by the letter O: is it a zero? Write the digit 0",
    "value.no_number": "{what} has no number: it takes a number such as 12.5, a parameter #1, an "
    "expression [1+2] or a function sin[30]; write the number or take the word out",
    "value.expression": "the expression",
    "value.label": "the label",
    "value.unset": "#<{name}> has no value yet: set it on an earlier line with #<{name}>=value",
    "value.vacant": "#{number} has no value yet, and on controls of this dialect that is not 0: set it on an "
    "earlier line with #{number}=value",
    "value.nothing": "#0 is what never has a value: it is only compared, as IF [#1 EQ #0]; take another "
    "parameter",
    "value.of_the_machine": "#{number} cannot be set: parameters {first} to {last} are positions, "
    "offsets and tools of the machine and can only be read; use another number, and G10, G92 and G28.1 to "
    "set offsets, tools and reference points",
    "value.given": "#<{name}> is given by the control and can only be read; use another name",
    "value.system": "#{number} is a system variable on controls of this dialect, and not here: "
    "parameters of a program are #1 to #999; write (MSG, ...) and M0 for #3000 and #3006, #5420 on for "
    "positions, G10 to set offsets",
    "value.at_run": "#5399 is what M66 finds when the program runs, and the whole program is read "
    "before: write M66 with L1 to L4 and Q, which waits, and holds the program where nothing comes",
    "value.no_probe": "{name} is of what touches, and T{tool} in the spindle is no probe: {known}; take the "
    "probe in with T and M6, or measure the tool above the tool setter",
    "value.no_setter": "{name} is of a tool setter, and the machine file has none: add [setter] with point_mm"
    " and radius_mm",
    "value.not_above": "{name} is the face of the tool setter, and the tool does not stand above it: it is "
    "{off:.3f} mm beside its middle and may be {most:g}, with the rotaries at 0 (here {turned:.3f} degrees "
    "at most); move to X{x:g} Y{y:g} of the machine (G53), the rotaries to 0",
    "value.not_known": "{name} is the position of {axis}, which is not known here: the reader is ahead "
    "of the machine and knows where the program's own moves lead, not where a surface leaves the tool; "
    "move the axis with G0 or G1 before",
    "value.by_zero": "{what} divides by zero: what stands behind it is 0; correct it",
    # --- flow
    "flow.too_many_passes": "{mark}: the program has gone round loops and called subs {most} times, "
    "which is the most (program_passes in [machine]); end the loop, or raise it",
    "flow.too_many_arguments": "{mark} has {count} arguments: a sub takes up to {most}, as #1 to #30",
    "flow.no_label": "o with the value {value:g} calls nothing: a computed label is a whole number and "
    "goes with call only, as o[#1+100] call",
    "flow.no_block": "{mark} leads to N{number:g}, and no line of this program, or of its sub, has that "
    "number; add it, or correct the number",
    "flow.called_by_m98": "O{label} ends with M99: such a sub is called with M98 P{label}",
    "flow.no_sub": "there is no sub {label}: neither o{label} sub in this program nor a file of that "
    "name with it in the folder of programs; add it, or correct the name",
    "flow.too_deep": "{mark} calls deeper than {most} subs in each other (call_levels in [machine]): end "
    "the recursion, or raise it",
    "flow.m98_alone": "M98 calls no sub: write P and its number beside it, as M98 P1000",
    "macro.alone": "{word} calls no macro: write P and its number beside it, as {word} P9010 X10.",
    "macro.before": "{word} stands before {code}, whose line is its call: write it behind {code} if it is an "
    "argument, else on a line of its own",
    "macro.no_argument": "{letter} is no argument of {code}: those are the letters but G L N O P",
    "macro.too_many_sets": "more than {most} sets of I J K: no parameter is left for {word}; give fewer",
    "macro.modal_twice": "G66 of line {line} is still on: write G67 before the next one",
    "flow.called_by_o": "o{label} sub ends with endsub: it is called with o{label} call, not M98",
    "flow.no_number": "there is no O{label}: neither in this program, behind its M30, nor as a file of "
    "that name in the folder of programs; add it, or correct P",
    "flow.m99_outside": "M99 in the program itself would begin it again for ever: it ends subs that M98 "
    "calls; end the program with M30",
    "flow.m99_in_o": "M99 ends subs that M98 calls; this one ends with endsub or return",
    "flow.runs_into": "{what} runs into {mark}, which begins a sub for M98: write {end} before it",
    "flow.no_count": "{word} is no count: P and L of a call are whole numbers from 0 up; correct it",
    "flow.surplus": "{behind} stands behind {mark}: nothing else goes on a line with an O-word; write it "
    "on a line of its own",
    "flow.no_o_word": "{behind} behind o{label} is no O-word: sub endsub call return if elseif else "
    "endif while endwhile do repeat endrepeat break continue are; correct it",
    "flow.no_end": "{mark} has no end: write {what} where it ends",
    "flow.deleted": "/ before {mark} would take away a part of a structure: write it before every O-word of "
    "this structure, or before none; before sub and endsub, none",
    "flow.else_if": "IF behind {mark} asks nothing: the branch would always be taken; write o{label} elseif",
    "flow.return_outside": "{mark} stands outside of every sub: it ends the sub that it stands in",
    "flow.sub_in_sub": "{mark} stands inside of {other} on line {line}: subs stand beside each other; "
    "end that one before",
    "flow.label_used": "the label of {mark} was used on line {line} ({other}): in a program, and in each "
    "sub of it, every structure has a label of its own; choose another",
    "flow.belongs_nowhere": "{mark} belongs to no o{label} {keyword}: {here} here; end what was begun "
    "last first",
    "flow.after_else": "{mark} comes after the else of o{label}: else is last",
    "flow.no_loop": "{mark} stands in no loop o{label}: it takes the label of a while, do or repeat "
    "around it; correct the label",
    "flow.no_sub_of_these": "there is no sub {label}: neither o{label} sub in this program nor a file of "
    "that name with it in the folder of programs (of it {called} are called); add it, or correct the name",
    "flow.no_number_of_these": "there is no O{label}: neither in this program, behind its M30, nor as a "
    "file of that name in the folder of programs (of it {called} are called); add it, or correct P",
    "flow.program": "the program",
    "flow.text_ends": "the text ends inside of sub {sub}: write M99 at its end",
    "flow.o_alone": "O is followed by no number and no <name>: an O-word is a label and what it does, as "
    "o100 sub; correct it",
    "flow.open": "{other} of line {line} is open",
    "flow.nothing": "nothing is open",
    # --- line
    "line.turns_in_plane": "{word} stands beside X Y Z in a tilted plane: these are places on the part, "
    "and the tool would leave the straight way between them while it turns; write rotary words on a line "
    "of their own, or G43.4 before it",
    "line.half_a_vector": "{found} is not a whole tool vector: under G43.5 I J K stand together, from "
    "the tip to the spindle in the part frame, or none of them; write all three",
    "line.vector_relative": "{found} is a direction and no distance: tool vectors need G90; write G90 "
    "before it",
    "line.no_length": "{found} has no length: a tool vector points from the tip to the spindle and may "
    "have any length from {least:g} up; correct I J K",
    # --- feed
    "feed.inverse_without": "{code} under G93 without F: in inverse time each line of G1 to G3 needs its "
    "own F, one over the minutes that it takes; write F, or G94 and the feed per minute",
    "feed.per_minute_only": "{code} takes its feed per minute: inverse time (G93) is for G1 to G3; write "
    "G94 before it",
    "feed.standing": "{code} has a feed per turn (G95) and the spindle stands: write S and M3, or G94 "
    "before it",
    "feed.none": "{code} has no feed: no F stands here or before it; write F with the feed per minute",
    "feed.not_positive": "{word} is no feed: F must be greater than 0; correct it",
    "feed.range": "{word} is no feed: {low} to {high} a minute are; correct it",
    # --- spindle
    "spindle.too_fast": "{word} is too fast: this spindle turns at up to {most:g} 1/min; lower it",
    "spindle.angle": "{word} is not where this spindle stops: its drive brings it to {angle:g} degrees "
    "alone (orient in [io]); write R{angle:g}, or leave R out",
    "spindle.direction": "{word} chooses a direction: the spindle's drive takes its own; write P0, or "
    "leave P out",
    "spindle.no_time": "{word} is no time: Q is the seconds that it may take, above 0 and at most a "
    "week; correct it",
    "spindle.no_orient": "{code} has nothing to work on: the machine file has no orient in [io], the "
    "output that brings the spindle to its angle and the input that says so; name them there, or write "
    "{instead}",
    "spindle.bore": "G85, G86 or G89",
    "spindle.from_below": "the moves of a cutter from below",
    # --- tool
    "tool.unknown": "{word} names no tool: the tool table has {tools}; use one of these or add it",
    "spindle.must_stand": "{code}: the spindle must not turn with T{tool} in it (a probe, or may_turn = "
    "false): change the tool before, or write may_turn = true in its table",
    "tool.none_to_change": "M6 has no tool to change to: write T and its number before or beside it",
    "tool.no_pocket": "T{tool} has no pocket in the tool changer: give it one, or write a tool that has "
    "one: {known}",
    "tool.under_side": "M6 under G41 or G42: the tool beside the path goes; write G40 before it",
    "tool.m61_changer": "M61 says which tool is in the spindle, and here the tool changer's journal "
    "knows: confirm it at the machine (directrix changer), or change the tool with M6",
    "tool.restart_other": "T{found} is in the spindle, and here the program goes on with T{wanted}: "
    "change it first (T{wanted} M6 by hand), then start from here again",
    "tool.restart_inside": "it is in the middle of a tool change: start from the line behind it",
    "tool.m61": "M61 does not say which tool is in the spindle: write Q and its number, such as M61 Q2",
    "tool.length_beside_g49": "{word} stands beside G49, which ends the tool's length; write H0, or G43 "
    "with it",
    "tool.no_length": "{code} takes {takes}; write it",
    "tool.unknown_here": "{word} names no tool: the tool table has {tools}; use one of these",
    "tool.no_radius": "{word} leaves no tool: its radius must be greater than 0; correct it",
    "tool.no_wear": "{word} is no wear: {least:g} to {most:g} mm are, and half of the radius at most; "
    "what is worn more is another tool, so correct it, or set length and radius",
    "tool.takes_z": "Z, the length",
    "tool.takes_h": "H, the number of a tool",
    "tool.none": "none",
    "tool.change_beside": "M6 under G41 or G42: the tool that is beside the path goes; write G40 before",
    # --- dwell
    "dwell.no_time": "G4 has no time: write P with the seconds to wait, such as G4 P0.5",
    "dwell.no_time_of_x": "{word} is no time of G4 here: it takes P with the seconds to wait, such as G4 "
    'P0.5; write P, or set dialect = "fanuc" in [machine] if the program is written for such a control',
    "dwell.two_times": "{word}: G4 takes one time, P or X, and has {other} already; remove one",
    "dwell.too_long": "{word} waits for {hours:.4g} h: {letter} of G4 is 0 to {most:.0f} seconds, a "
    "week; write M0 to wait for the operator",
    # --- offset
    "offset.not_set": "{name} is not set, neither in [offsets] of the machine file nor at the machine; "
    "set it, or use {known}",
    "offset.number": "{code} takes P1 to P48, the number of a work offset; write one of these",
    "offset.g92_empty": "G92 says no position: write the axes and what their positions are to read",
    "offset.g92_turned": "G92 stands under G68: the shift would be turned with it; write G69 before it",
    "offset.r_of_l20": "{word} is not taken by G10 L20: R turns an offset with L2; correct it",
    "offset.tilted": "{code} takes where the tool stands, which is told in a tilted plane here and not "
    "in the work offset; write G69 before it",
    "offset.sets_nothing_fanuc": "{word} sets nothing here: G10 takes L2 P1 to P6, L20 P1 to P48 "
    "and L120 P1 to P9 (work offsets), L10 to L13 P and the tool with R, L121 with Z and R; write one of "
    "these",
    "offset.sets_nothing": "{word} sets nothing here: G10 takes L2 and L20 P0 to P9, L120 P1 to P9 (work "
    "offsets), L1, L121, L10 and L11 P and the tool with Z and R; write one of these",
    # --- surface
    "surface.not_nurbs": "{found}: G6.2 cuts a ruled surface between two NURBS curves; it stands alone "
    "with P and Q, the orders of the upper and the lower curve, and F unless one is modal; then, first for "
    "the upper and then for the lower curve, come a line of K X Y Z (and R) for each control point and as "
    "many lines of K alone as the order; write exactly these",
    "surface.nurbs_upside_down": "the upper curve of this G6.2, the first one, lies below the lower one, "
    "so the tool would stand upside down; exchange the two curves",
    "surface.no_cone": "{found}: G51 cuts a cone here and needs X Y Z I J K H R D and, unless one is "
    "modal, F; a G51 with P is scaling on other controls and is not done here; write exactly these words",
    "surface.not_ruled": "{found}: G52 needs 8 points of X Y Z, four of the upper and four of the lower "
    "curve, the first beside G52 (with F) and one on each of the seven lines after it; write all 8 points "
    "and nothing between; a G52 that shifts coordinates has no F beside it and a line with other words "
    "after it",
    "surface.or_shift": "{found} without F may be a local shift, with moves of {motion} from line {line} "
    "on: while a G0 to G3 is active, G52 is a ruled surface only with F beside it, and the other seven "
    "points are the next lines, of X Y Z alone; write it so, or, for a shift, G0 or G1 on the next line; "
    'under dialect = "fanuc" a G52 without F always shifts',
    "surface.bad_cone": "{word} makes no cone of G51: {allowed}; correct it",
    "surface.upside_down": "the first four points of this G52, the upper curve, lie below the last four, "
    "so the tool would stand upside down; exchange the two curves",
    "surface.relative": "{code} stands under G91: its X Y Z I J K are absolute positions; write G90 "
    "before it",
    "surface.no_tool": "{code} needs radius and length of tool T{tool} in the spindle, but the tool "
    "table has {tools}: add it there or change the tool",
    "surface.spindle_off": "{code} would cut with the spindle off: write S and M3 or M4 before it",
    "surface.found": "found {found}",
    "surface.missing": "{letters} missing",
    "surface.ends_after": "the program ends after {count} of the 8 points",
    "surface.point": "point {number} of the G52 on line {line}",
    "surface.found_for": "found {found} where {due} is due",
    "surface.missing_in": "{letters} missing in {due}",
    "surface.cone_height": "{word} makes no cone of G51: the height H must be greater than 0; correct it",
    "surface.cone_radius": "{word} makes no cone of G51: the upper radius R must be 0 (a tip) or more; "
    "correct it",
    "surface.cone_sweep": "{word} makes no cone of G51: the swept angle D must not be 0 (positive is "
    "counter-clockwise); correct it",
    "surface.cone_level": "{word} makes no cone of G51: start Z and centre K must be on one level; "
    "correct it",
    "surface.cone_bottom": "{word} makes no cone of G51: the start X Y must be off the centre I J by the "
    "bottom radius; correct it",
    "surface.cone_turns": "{word} makes no cone of G51: D sweeps at most {most:.0f} degrees either way; "
    "correct it",
    "surface.upper": "upper",
    "surface.lower": "lower",
    "surface.order": "{word} is no order of the {curve} curve: it is the degree + 1, from {least} "
    "(straight lines) to {most}, and 4 for a cubic; correct it",
    "surface.no_spline": "the {curve} curve of the G6.2 on line {number} cannot be: {bad}; correct it",
    "surface.control_point": "control point {number} of the {curve} curve",
    "surface.alone_for": "found {found} alone where {due} is due",
    "surface.too_many": "the {curve} curve has more than {most} points: one G6.2 takes no more; split "
    "the surface",
    "surface.knot": "knot {count} of the {order} that follow the points of the {curve} curve",
    "surface.of_nurbs": "{due} of the G6.2 on line {line}",
    "surface.ends_for": "the program ends where {due} is due",
    # --- position
    "position.unknown": "{what} has to know where the axes stand, and after a surface or a tool vector "
    "that is the path's choice; write G0 with positions of X Y Z and of the rotary axes before it",
    "position.centre": "a centre under G90.1",
    "position.polar": "a line with @ or ^",
    "position.cycle": "a canned cycle",
    "position.g68": "G68 without its centre",
    # --- plane
    "plane.g68_no_angle": "G68 does not say by how much: write R and the angle in degrees",
    "plane.not_whole": "{code} P{p} from line {line} on is not whole: only {given} of it stands before "
    "this line; write its other lines there, nothing between them",
    "plane.no_row": "{code} P{p} has no line Q{q}: its lines are {known}; write one of these",
    "plane.row_twice": "{code} P{p} Q{q} stands here for the second time: each line once; remove one",
    "plane.letter": "{word} is not taken by {code} P{p}{row}: that has {letters}; remove the word",
    "plane.origin": "G68.3 has an origin without {missing}: write X Y Z, or none of them for the tool tip",
    "plane.g53_3_relative": "G53.3 takes positions in the plane, and G91 is active: write G90 before it",
    "plane.none_defined": "{code} turns the tool to a tilted plane and none is defined: write G68.2 or "
    "G68.3 before it",
    "plane.no_solution_chosen": "{code} P{p} chooses nothing: P0 is the nearest position of the rotary "
    "axes, P1 and P2 the positive and the negative one of the primary axis; write one of these",
    "plane.order": "{code} P{p} has Q{order}: Q is the order of the axes, 1 for X, 2 for Y, 3 for Z, one "
    "of {allowed}; correct it",
    "plane.points_on_a_line": "{code} P{p} has three points on one line or in one place: each is at "
    "least {least:g} mm off the line through the others, as no plane is told by less; correct them",
    "plane.no_length": "{code} P{p} has a vector along {axis} without length: I J K are its direction; "
    "write them",
    "plane.not_square": "{code} P{p} has X and Z of the plane {off:.4g} degrees apart: they are "
    "{low:.4g} to {high:.4g} degrees apart, and X gives way to make it 90; correct one of them",
    "plane.projected": "{code} P{p} has projected axes {apart:g} degrees apart, which tell no plane: "
    "they are {low:g} to {high:g} apart; correct I and J, or write Euler angles (P0)",
    "plane.none_rs274": "{code} is seen from a tilted plane, and none is active: write G68.2 and G53.1 "
    "before it",
    "plane.none": "{code} is seen from a tilted plane, and none is active: write G68.2 before it",
    "plane.turned": "{code} stands under G68, which would be turned with it: write G69 before it",
    "plane.waiting": "{code} would replace a plane that no G53.1 has turned the tool to: write G53.1 or "
    "G69 before it",
    "plane.in_a_plane": "{code} stands in a tilted plane: write G69 before it, or G68.4 for a plane seen "
    "from it",
    "plane.no_definition": "P{p} is no definition of {code}: under fanuc P0 are Euler angles, P1 turns "
    "about X Y Z, P2 three points, P3 two vectors, P4 projected angles; write one of these",
    "plane.no_definition_rs274": "P{p} is no definition of {code}: under rs274 P0 are Euler angles, P1 "
    "turns about X Y Z, P2 three points, P3 two vectors; write one of these",
    "plane.no_rotary": "{code} cannot turn the tool along Z of this plane ({i:.6g} {j:.6g} {k:.6g} on "
    "the table): it stands along Z, and no axis of this machine turns it; tilt the part, or choose another "
    "plane",
    "plane.no_axis": "{code} cannot turn the tool along Z of this plane ({i:.6g} {j:.6g} {k:.6g} on the "
    "table): no position of {names} gives this tool axis, whatever their travel; tilt the part, or choose "
    "another plane",
    "plane.p_leaves_none": "{code} cannot turn the tool along Z of this plane ({i:.6g} {j:.6g} {k:.6g} "
    "on the table): P{p} leaves none of {shown}, and the travel is {travel}; leave out P",
    "plane.beyond_travel": "{code} cannot turn the tool along Z of this plane ({i:.6g} {j:.6g} {k:.6g} "
    "on the table): it needs {shown}, and the travel is {travel}; tilt the part, or choose another plane",
    "plane.travel": "{axis} {low:.6g} to {high:.6g}",
    # --- output
    "output.no_level": "L{level} is nothing that M66 waits for: L1 is a rise, L2 a fall, L3 on, L4 off; "
    "use one of these",
    "output.no_time": "M66 L{level} has no time: write Q with the seconds that it may take, above 0 and "
    "at most {most:.0f}",
    "output.no_analogue": "{code} has nothing to work on: the machine file has no analogue_out in [io]; "
    "name it there",
    "output.which_analogue": "{found} names no analogue output: write E and its number; there are {known}",
    "output.range": "{name} takes Q from {low:g} to {high:g}; write Q and its value",
    "output.none": "{code} has nothing to work on: the machine file has no {table} in [io]; name it there",
    "output.which": "{code} does not say which one: write P and its number; there are {known}",
    "output.unknown": "{word} names nothing: {table} in [io] of the machine file has {known}; use one of "
    "these",
    # --- override
    "override.adaptive": "M52 lets the load of the spindle lead the feed, and the machine file has no "
    "adaptive in [spindle]; write it there where the drive tells its load, or M52 P0",
    "override.on_or_off": "{word} is neither on nor off: {code} takes P1 or P0; write one of these",
    "override.no_feed_stop": "M53 has nothing to work on: the machine file has no {input} among inputs "
    "in [io]; name it there, or leave M53 out",
    # --- polar
    "polar.no_direction": "{word} is a step under G91 from the origin, where no direction is: write X "
    "and Y, or G90",
    "polar.dialect": '{word} is a word of dialect = "rs274"; write X and Y',
    "polar.beside_xy": "{word} stands beside X or Y, in whose place it is; write one or the other",
    "polar.beside_code": "{word} stands beside {code}: it ends lines, arcs and cycles; write X and Y",
    # --- reference
    "reference.number": "{word} is no reference point of this machine: it has G28 and G30 (P2); use one "
    "of them",
    "reference.mixed": "{word} is a distance beside positions: write distances U V W alone, or positions "
    "X Y Z alone",
    # --- saved
    "saved.two": "{first} and {word} keep the modal state or give it back: one line takes one of M70 to "
    "M73; write two lines",
    "saved.none": "M72 has nothing to give back: M70 or M73 keeps the state before, in the same sub",
    # --- side
    "side.placement": "{word} is no placement of the cutter: P of {code} is 1 (single), 2 (double), 3 "
    "(optimal) or 4 (auto); write one of these, or nothing for the machine's own",
    "side.allowance": "{word} takes {off:g} mm more off than the surface: Q of {code} is what stays on "
    "it, and below 0 the cutter's wear, at most {most:g} mm; correct it",
    "side.tolerance": "{word} is no tolerance: R of {code} is how far a surface may be off its form, "
    "greater than 0; correct it, or leave it out for the tool's or the machine's own",
    # --- curve
    "curve.half": "{lacks} missing: {first} and {second} together are {what}; add it",
    "curve.no_end": "{word} says no end: write X and Y, or one of them, beside it",
    "curve.too_many": "a NURBS has at most {most} points; write two",
    "curve.too_few": "the NURBS of line {line} has {count} control points with its start: order L{order} "
    "takes {order} or more; add points, or lower L",
    "curve.unended": "the program ends in this NURBS: write G5.3 behind its last point",
    "curve.surplus": "found {word} in the NURBS of line {line}: between G5.2 and G5.3 stand control "
    "points alone, X Y and P on a line each, and L; write it before G5.2 or behind G5.3",
    "curve.half_a_point": "{lacks} missing: each control point of a NURBS has X, Y and its weight P (1 "
    "is the plain one); add it",
    "curve.no_weight": "{word} is no weight: P of a NURBS is greater than 0; correct it",
    "curve.no_order": "{word} is no order: it is the degree of the curve + 1, a whole number from "
    "{least} to {most}; correct it",
    "curve.end_with_words": "{word} is not for G5.3: it takes no words; remove it",
    "curve.other_axis": "{word} is not for {motion}: only X and Y move on a curve; it takes {takes}; "
    "remove it",
    "curve.letter": "{word} is not for {motion}: it takes {takes}; remove it",
    "curve.end_alone": "{motion} ends a NURBS, and none has begun: write G5.2 and its points before it",
    "curve.plane": "{motion} is a curve in X and Y, and {plane} is active: write G17 before it",
    "curve.beside": "{motion} runs under {side}: curves have no cutter beside them; write G40 before it",
    "curve.tip_control": "{motion} is not done under tool-centre control: write G49 before it, or the "
    "curve as G1 lines",
    "curve.to_end": "the way from the end to the second control point",
    "curve.to_first": "the way from the start to the first control point (a G5 right behind another may "
    "do without)",
    "curve.to_control": "the way from the start to the control point",
    # --- thread
    "thread.nowhere": "{code} goes nowhere: it is at this height already; correct it",
    "thread.no_pitch": "{code} has no K, the pitch: the way of a turn; write it, such as K1.25",
    "thread.pitch": "{word} makes a pitch of {pitch:.6g} mm: {low:g} to {high:g} mm are; correct it",
    "thread.faster": "{word} is how much faster it comes back: above 0, up to {most:.4g}; correct it",
    "thread.no_angle": "{code}: no spindle here tells its angle: write position in [spindle] of the "
    "machine file, or mill the thread",
    "thread.no_height": "{code} stands without {height}, where it leads; write it",
    "thread.no_speed": "{code} stands without a speed; write S before it",
    "thread.tip_control": "{code} stands under tool-centre control (G43.4, G43.5); write G49 before it",
    "thread.beside_others": "{code} stands beside {other}: a thread goes along {height} alone; write a "
    "line of its own for that",
    # --- text
    "cycle.tool_off": "T{tool} is {off_mm} mm off its length in the table: it is another tool, or broken; "
    "put the right one in, or measure this one",
    "text.abort": "the program ends itself here: {text!r}",
    "text.percent": "% marks the start and end of a program and stands alone on its line",
    "text.stray": "{found!r} cannot stand here: a line is made of words such as X12.5 (a letter and its "
    "number, with a decimal point, not a comma), parameter settings and comments; correct or remove it",
    "text.corner": "a chamfer or a radius of a corner (,C or ,R) is not done here; write the corner as a "
    "line or an arc of its own",
    "text.o_inside": "O stands inside the line: an O-word (o100 call) stands alone on its line; write "
    "two lines",
    "text.only_comments": "the file holds only blank lines and comments: a program needs at least one "
    "word; send the whole program",
    "text.only_subs": "nothing runs in this file: it holds only subs, and no line calls one; start the "
    "program that calls {label}",
    "text.empty": "the file holds nothing: a program needs at least one word; send the whole program",
    "text.control_character": "control character 0x{byte:02X} is not program text: a program is plain "
    "ASCII or UTF-8 text; save or send the file again as plain text",
    "text.unreadable": "byte 0x{byte:02X} is not readable text: a program is plain ASCII or UTF-8 text; "
    "save or send the file again as plain text",
    "text.parenthesis": "this parenthesis has no partner: a comment runs from ( to the next ) on one "
    "line, without another ( inside; close it, or write the comment after a ;",
    # --- probe
    "probe.none": "{code} asks for a probe, and T{tool} is none on this machine: {known}; put it into "
    "the spindle with T and M6, or add [probe] (for tools [setter]) to the machine file",
    "probe.is_tool": "its probe is T{number}",
    "probe.is_none": "it has none",
    "probe.turns": "{word} would turn the part while it is probed: rotaries stand under {code}; remove it",
    "probe.no_way": "{code} has no way: it goes with X, Y or Z; write where it may lead at most",
    "probe.beside": "{code} beside a contour (G41, G42) has no meaning; write G40 before it",
    "probe.inverse": "{code} takes its feed per minute, for nobody knows how far it goes; write G94 "
    "before it",
    "probe.spindle": "{code}: a probe must not turn, and the spindle does; write M5 before it",
    "probe.not_touched": "{code}: the probe has come to the end of its way and has not touched; lead it "
    "further, or nearer to the part before, or write G38.3, which goes on without",
    "probe.not_free": "{code}: the probe has come to the end of its way and is not free; lead it "
    "further, or look at the stylus",
    # --- cleared
    "cleared.none": "no motion mode is active at the start of a program",
    "cleared.G51": "it is surplus after the whole cone of G51 on line {line}, which clears the motion mode",
    "cleared.G52": "it is a surplus point, as G52 needs 8 points of X Y Z, the G52 of line {line} has "
    "them and clears the motion mode",
    "cleared.G6.2": "it is surplus after the two whole curves of G6.2 on line {line}, which clears the "
    "motion mode",
    "cleared.G80": "G80 on line {line} cleared the motion mode",
    "cleared.probe": "each probing move names its code, and that of line {line} is done",
    "cleared.thread": "each thread names its code, and that of line {line} is whole",
    "cleared.curve": "each curve names its code, and that of line {line} is whole",
    # --- foreign
    "foreign.macro": "{line} is a line of macros as Fanuc's; write o100 if [...], o100 while [...] and "
    "their ends",
    "foreign.macro_print": "{line} is a line of macros as Fanuc's; write (PRINT, ...) to tell the "
    "operator something",
    "foreign.okuma_head": "{line} is the head of a program for Okuma; post the part for Fanuc (dialect = "
    '"fanuc"), or take it out and say offsets and lengths as Fanuc (G54, G43)',
    "foreign.okuma_call": "{line} is Okuma's call of a sub; write M98 and P with its number",
    "foreign.okuma_modal": "{line} is Okuma's modal call; write M98 and P with its number on every line",
    "foreign.okuma_end": "{line} is the end of a sub of Okuma's; write M99",
    "foreign.okuma_variable": "{line} is a variable of Okuma's; write a parameter, as #101=5, and G10 "
    "for offsets",
    "foreign.program": "{line} is of a program for {control}, where words have other meanings: none of "
    'it is read; post the part for Fanuc (dialect = "fanuc") or LinuxCNC (dialect = "rs274"), tool-centre '
    "control as G43.4, tilted planes as G68.2",
    # --- meaning
    "meaning.G54.2.fanuc": "offset that follows the table",
    "meaning.G54.4.fanuc": "error of the part's setting",
    "meaning.G10.9.fanuc": "diameters (X1) or radii (X0)",
    "meaning.G7.rs274": "diameter mode of lathes",
    "meaning.G8.rs274": "radius mode of lathes",
    "meaning.G70.rs274": "finishing of lathes",
    "meaning.G71.rs274": "roughing of lathes along Z",
    "meaning.G71.1.rs274": "roughing of lathes along Z",
    "meaning.G71.2.rs274": "roughing of lathes along Z",
    "meaning.G72.rs274": "roughing of lathes along X",
    "meaning.G72.1.rs274": "roughing of lathes along X",
    "meaning.G72.2.rs274": "roughing of lathes along X",
    "meaning.G76.rs274": "threading",
    "meaning.G44.rs274": "length taken off Z",
    "meaning.G87.rs274": "back boring",
    "meaning.G5.2.fanuc": "NURBS",
    "meaning.G53.3.fanuc": "tool along the tilted plane's Z with a move",
    "meaning.G7.fanuc": "imaginary axis",
    "meaning.G12.1.fanuc": "polar interpolation",
    "meaning.G43.3.fanuc": "nutating head",
    "meaning.G45.fanuc": "tool offset added once",
    "meaning.G46.fanuc": "tool offset taken off once",
    "meaning.G47.fanuc": "tool offset added twice",
    "meaning.G48.fanuc": "tool offset taken off twice",
    "meaning.G51.1.fanuc": "mirror image",
    "meaning.G60.fanuc": "approach from one side",
    "meaning.G63.fanuc": "tapping mode",
    "meaning.G107.fanuc": "cylindrical interpolation",
    "meaning.M198.fanuc": "call of a file",
    "meaning.G17.1": "plane UV",
    "meaning.G18.1": "plane WU",
    "meaning.G19.1": "plane VW",
    "meaning.G88": "boring with retraction by hand",
    "meaning.G96": "constant surface speed",
    "meaning.G16": "polar coordinates",
    "meaning.G22": "stored stroke limits",
    "meaning.G26": "spindle speed watch",
    "meaning.G27": "reference point check",
    "meaning.G29": "return from the reference point",
    "meaning.G65.rs274": "macro call",
    "meaning.G66.rs274": "modal macro",
    "meaning.G12.fanuc": "circular pocket, clockwise",
    "meaning.G13.fanuc": "circular pocket, counter-clockwise",
    "meaning.G150.fanuc": "pocket",
    "meaning.G253.fanuc": "spindle along the tilted plane's Z",
    "meaning.G268.fanuc": "tilted plane",
    "meaning.M83.fanuc": "air blast",
    "meaning.M88.fanuc": "coolant through the spindle",
    "meaning.M97.fanuc": "call of a line",
    "meaning.G100.fanuc": "tool change with moves",
    # --- instead
    "instead.G54.2.fanuc": "write G43.4, which follows the turned part",
    "instead.G54.4.fanuc": "write G10 L2 with the place, and R its turn",
    "instead.G10.9.fanuc": "write radii",
    "instead.G7.rs274": "this control has no lathe axis; write radii",
    "instead.G8.rs274": "this control has no lathe axis; leave it out",
    "instead.G70.rs274": "this control has no lathe axis; for inches write G20",
    "instead.G71.rs274": "this control has no lathe axis; for millimetres write G21",
    "instead.G71.1.rs274": "this control has no lathe axis; post the part for a mill",
    "instead.G71.2.rs274": "this control has no lathe axis; post the part for a mill",
    "instead.G72.rs274": "this control has no lathe axis; post the part for a mill",
    "instead.G72.1.rs274": "this control has no lathe axis; post the part for a mill",
    "instead.G72.2.rs274": "this control has no lathe axis; post the part for a mill",
    "instead.G76.rs274": "mill the thread with G2 or G3 and Z",
    "instead.G44.rs274": "write G43 or G43.1 with the length",
    "instead.G87.rs274": 'write M19 and the moves themselves, or G87 under dialect = "fanuc"',
    "instead.G5.2.fanuc": "write it as G1 lines under G64 P, or a surface as G6.2",
    "instead.G53.3.fanuc": "write G53.1, and G0 on the next line",
    "instead.G7.fanuc": "write the moves themselves",
    "instead.G12.1.fanuc": "write X and Y",
    "instead.G43.3.fanuc": "write G43.4",
    "instead.G45.fanuc": "write G41 or G42 with D",
    "instead.G46.fanuc": "write G41 or G42 with D",
    "instead.G47.fanuc": "write G41 or G42 with D",
    "instead.G48.fanuc": "write G41 or G42 with D",
    "instead.G51.1.fanuc": "write the mirrored moves",
    "instead.G60.fanuc": "write G0 to a place before it",
    "instead.G63.fanuc": "write M49 before the cut and M48 behind it",
    "instead.G107.fanuc": "write words of the rotary axis",
    "instead.M198.fanuc": "write M98 P, which looks for the file, too",
    "instead.G17.1": "this control has no axes U V W; write G17",
    "instead.G18.1": "this control has no axes U V W; write G18",
    "instead.G19.1": "this control has no axes U V W; write G19",
    "instead.G88": "write G86, or M0 at the bottom",
    "instead.G96": "this control has no lathe axis; write G97 and S",
    "instead.G16": "write X and Y",
    "instead.G22": "the travel of the axes in the machine file is always watched",
    "instead.G26": "leave it out",
    "instead.G27": "write G28",
    "instead.G29": "write G0 and the position",
    "instead.G65.rs274": "write O-words, as o<bore> call [10] [2], or take dialect fanuc in [machine]",
    "instead.G66.rs274": "call the sub behind every line with O-words, or take dialect fanuc in [machine]",
    "instead.G12.fanuc": "write the arcs",
    "instead.G13.fanuc": "write the arcs",
    "instead.G150.fanuc": "write the moves themselves",
    "instead.G253.fanuc": "write G53.1",
    "instead.G268.fanuc": "write G68.2",
    "instead.M83.fanuc": "name an output for it in m_codes of [io], or write M7",
    "instead.M88.fanuc": "name an output for it in m_codes of [io], or write M8",
    "instead.M97.fanuc": "write M98 and P with the number of a sub behind M30",
    "instead.G100.fanuc": "write T, M6 and the moves",
    # --- spline
    "spline.order": "the order is {order}: it is {least} to {most} (degree + 1)",
    "spline.few_points": "{count} control points are too few: order {order} takes {order} or more",
    "spline.count_of_knots": "{count} points of order {order} take {needed} knots, found {found}",
    "spline.count_of_weights": "{count} points take {count} weights, found {found}",
    "spline.weight": "the weight is {weight:g}: every weight is greater than 0",
    "spline.falling": "the knots fall from {a:g} to {b:g}: they may only rise or stay",
    "spline.near": "the knots {a!r} and {b!r} are too near to be two: write them alike or further apart",
    "spline.all_alike": "all knots are {knot:g}: the last must be greater than the first",
    "spline.first_knot": "the first knot {knot:g} stands {times} times: order {order} takes it {order} "
    "times, so that the curve begins and ends on a control point",
    "spline.last_knot": "the last knot {knot:g} stands {times} times: order {order} takes it {order} "
    "times, so that the curve begins and ends on a control point",
    "spline.inner_knot": "the inner knot {knot:g} stands {times} times: order {order} takes it {most} "
    "times at most, or the curve is torn",
    # --- group
    "group.call": "call",
    "group.centre": "centre",
    "group.coolant": "coolant",
    "group.distance": "distance",
    "group.feed": "feed",
    "group.length": "length",
    "group.motion": "motion",
    "group.offset": "offset",
    "group.one_line": "one-line",
    "group.output": "output",
    "group.overrides": "overrides",
    "group.path": "path",
    "group.plane": "plane",
    "group.return": "return",
    "group.rigid": "rigid",
    "group.rotation": "rotation",
    "group.side": "side",
    "group.speed": "speed",
    "group.spindle": "spindle",
    "group.state": "state",
    "group.stop": "stop",
    "group.tool_change": "tool change",
    "group.unit": "unit",
}
