"""English: what the path of a program, its surfaces and a way back into it are refused for, and what a
check notes of them."""

from __future__ import annotations

LANGUAGE = "en"

REFUSALS = {
    "path.nothing": "The program has no block that does anything; nothing to run.",
    "path.no_law": "no motion was found from here on that keeps all axes within their limits: somewhere "
    "they would have to turn all but at once; smooth the surfaces there, split the block, or tilt the part",
    "path.too_long": "{what} {hours:.4g} h at the least, at its feeds and with its dwells, and passes here "
    "the {allowed:g} h that longest_program_h in [machine] allows; write a higher F or a shorter "
    "dwell{more}",
    "path.whole_takes": "the program takes",
    "path.so_far_takes": "up to here the program takes",
    "path.allow_longer": ", or raise longest_program_h up to {most:g}",
    "stored.unread": "{file}: cannot be read ({why}); the program is checked again.",
    "stored.of_another": "{file}: is not a stored check of this program; it is checked again.",
    "stored.not_kept": "{folder}: the check could not be stored ({why}); a start checks again.",
    # --- what a check notes
    "note.says": "Says here: {text}",
    "note.exact": "G64 without P blends only corners of lines that are rounding (within {mm:g} mm or "
    "{degrees:g} degrees, joint_tolerance_mm and _deg in [machine]); everything else is exact.",
    "note.runs_on": "Lines run through from here on where their corners are rounding (within {mm:g} mm or "
    "{degrees:g} degrees, joint_tolerance_mm and _deg in [machine]), and are left by {mm:g} mm at most; "
    "other corners are exact. G61 keeps all exact, G64 P allows more.",
    "note.swivel": "Stops at the pole between two blocks and turns the rotary axis under the standing tool.",
    "note.spindle_not_driven": "No spindle is driven: S and M3 do nothing here. Give [spindle] "
    "a bus and a node, or switch it by hand.",
    "note.spindle_off": "Feeds with a spindle that was never started: no M3 or M4 with S stands before "
    "this line.",
    "note.stops_for": "Stops until {tool} is in the spindle.",
    "note.no_tool": "no tool",
    "note.flute": "The flute of T{tool} is {flute:.3f} mm long and cuts up to {flank:.3f} mm above the lower "
    "edge, the longest ruling is {longest:.3f} mm; above the flute nothing is cut.",
    "note.plunge": "T{tool} does not cut over its centre, and this line leads it down its axis: whether it "
    "meets stock is not judged but beside surfaces.",
    "note.optimal": "P3 (optimal) finds nothing better here than {as_good}, which is taken.",
    "note.single": "P1 (single)",
    "note.double": "P2 (double)",
    "note.left_out": "{count} motions beside surfaces were not held against them.",
    "note.no_surface": "The program cuts no surface (G51, G52, G6.2): there is nothing to hold it against.",
    "note.not_cut": "The trace does not come to this surface, which is not judged: it begins behind it "
    "or ends before it.",
    # --- travel
    "travel.beyond": "{axis} would reach {value:.3f} {unit}{where}, {by:.3f} {unit} beyond its travel of "
    "{low:.3f} to {high:.3f} {unit}; {advice}",
    "travel.at": " at u = {u:.4f} (part X {x:.3f} Y {y:.3f} Z {z:.3f} mm)",
    "travel.in": " in the {motion}",
    "travel.in_entry": " in the {motion} of the way back into the program",
    "travel.move": "move the part (work offset) or the block",
    "travel.unwind": "unwind first: write G0 {axis}{at:.3f} before this block, so that it starts with "
    "{axis} at {at:.3f} deg",
    "travel.turns": "it turns {axis} through {turned:.3f} deg, more than its travel holds in any turn; "
    "{then}",
    "travel.split": "split the block at u = {u:.4f} or before and unwind between the parts: write G0 "
    "{axis}{start:.3f} there, so that the second begins with {axis} at {start:.3f} deg",
    # --- where the rotary axes do not get
    "reach.lost": "{reason}{where}; tilt the part or split the block there",
    "reach.on_line": "{reason} on this line; tilt the part, split the line or go round with the axis",
    "reach.tilt": "{reason}; tilt the part or the tool",
    "reach.none": "no position of the rotary axes gives this tool axis",
    "reach.none_of_one": "no position of the rotary axis gives this tool axis",
    "reach.stands": "the tool of this machine stands along Z and cannot lean to this tool axis",
    "reach.limit": "the tool axis comes to the limit of what the rotary axes reach, where they would have "
    "to turn at once",
    "reach.jump": "the rotary axes would have to jump",
    "reach.turned_over": "the tool axis turns over, to the opposite direction",
    # --- lines, curves, probing
    "curve.to_and_fro": "this curve turns back on the spot, as its control points lead to and fro on one "
    "way; move them apart, or write its parts as curves of their own",
    "probing.no_way": "{code} has no way: it ends where the tool stands; lead it on, to where it may touch "
    "at most",
    "probing.too_fast": "{code} at F{feed:.0f} mm/min goes {found:.2f} mm on, and the probe bears {most:g} "
    "mm behind a touch (overtravel_mm); write F{fastest} or less",
    "probing.no_replay": "{code} probes here, and the record of a run does not hold what it touched: only "
    "what comes before this line can be made again",
    # --- surfaces
    "cut.no_tool": "T{tool} is not in the tool table, which has {known}; add it or take one",
    "cut.defect": "{code}: {defect}{advice}",
    "cut.no_radius": "Q of {allowance:.3f} mm leaves nothing of T{tool} with its radius of {radius:.3f} "
    "mm; give a smaller correction",
    "cut.no_tolerance": "the cutter is to be placed automatically (auto, P4), and there is no form "
    "tolerance to be kept; write R beside P, or tolerance_mm for the tool or in [machine]",
    "cut.not_travelled": "{code}: the lower directrix cannot be travelled: {why}",
    "cut.no_length": "the curve has no length, so there is nothing to travel along",
    "cut.endless_bend": "the curve bends without end, so its length has no fit",
    "cut.try_free": "; try P3 (optimal) or P4 (auto)",
    "cut.write_free": "; write {words} ({kind} would be {own:.3f} mm off, optimal {best:.3f} mm)",
    "cut.p3": "P3 (optimal)",
    "cut.p3_or_p4": "P3 (optimal) or P4 (auto)",
    "cut.none_found": ", and with T{tool} none was found that is less than {best:.3f} mm off{allowed}; "
    "take a thinner cutter or let both curves run more alike",
    "cut.form_tolerance": " (the form tolerance is {most:g} mm)",
    "defect.coincident": "the upper and the lower directrix coincide, so there is no ruling to hold the "
    "cutter along; give two different curves",
    "defect.zero_ruling_inside": "the ruling at u = {u:.4f} has no length, so the tool axis is undefined "
    "there; keep the directrices apart",
    "defect.zero_ruling_end": "the ruling at u = {u:.4f}, an end of the block, has no length, so the tool "
    "axis is undefined there; keep the directrices apart at their ends too",
    "defect.crossing": "the directrices cross near u = {u:.4f}; a ruled surface needs two curves that stay "
    "apart",
    "defect.standstill": "the lower directrix stands still at u = {u:.4f} (C1' = 0), where the cutter has "
    "no direction of travel; split the block there or move its control points apart",
    "defect.twist": "the normal of the surface turns by {turn_deg:.1f} degrees along the ruling at u = "
    "{u:.4f}, which only an axis that leaves the ruling can follow",
    "defect.fold": "the surface folds at u = {u:.4f}, v = {v:.3f}: it has no normal there, so no cutter "
    "can stand beside it; make the directrices run the same way",
    # --- gouges, and what the form of a surface is refused for
    "gouge.refused": '{what}; {advice}, or set gouge = "warn" to cut it anyway{more}',
    "gouge.told": "Gouge: {what}; {advice}.",
    "gouge.overcut_told": "Overcut: {what}; {advice}.",
    "gouge.more": " ({more} more with --gouge warn)",
    "gouge.one": "line {line}: {what}; {advice}{more}.",
    "gouge.others": " ({more} more)",
    "gouge.on_line": "Gouge, line {line}: {what}; {advice}.",
    "gouge.overcut_on_line": "Overcut, line {line}: {what}; {advice}.",
    "gouge.no_room": "{code}: the cutter T{tool} of radius {radius:.3f} mm does not fit into the hollow of "
    "radius {hollow:.3f} mm at u = {u:.4f} on its {side} side",
    "gouge.left": "left",
    "gouge.right": "right",
    "gouge.fit_hollow": "take a cutter of at most {hollow:.3f} mm or the other side",
    "gouge.lead": "the {lead} of {length:.3f} mm would cut {reached:.3f} mm into the surface",
    "gouge.shorter_lead": "set a smaller lead_mm, take a smaller cutter or the other side (G41/G42)",
    "gouge.at": "at X {x:.3f} Y {y:.3f} Z {z:.3f} mm",
    "gouge.at_uv": "at u = {u:.4f}, v = {v:.3f} (part X {x:.3f} Y {y:.3f} Z {z:.3f} mm)",
    "gouge.motion": "the {motion} of line {line}",
    "gouge.of_line": " of line {line}",
    "gouge.hollow": "the cutter T{tool} does not fit into the hollow of radius {bound:.3f} mm and cuts "
    "{depth:.3f} mm too deep {at}",
    "gouge.overcut": "the twist of the surface costs {depth:.3f} mm of overcut, more than the {bound:g} mm "
    "of max_overcut_mm, {at}",
    "gouge.end": "at the end of the surface the flank reaches over it, which in {motion} costs {depth:.3f} "
    "mm of overcut {at}, beside {bound:.3f} mm of the cut itself",
    "gouge.own_cut": "the cut comes back to its own surface and cuts {depth:.3f} mm too deep {at}",
    "gouge.other_motion": "{motion} cuts {depth:.3f} mm too deep into the surface{whose} {at}",
    "gouge.holder": "in {motion} the holder of T{tool} is {depth:.3f} mm deep in the surface{whose} {at}",
    "gouge.uncut": "{motion} leaves {depth:.3f} mm of the surface{whose} uncut above the flute of T{tool}, "
    "{at}",
    "gouge.shank": "in {motion} the shank of T{tool}, which does not cut, is {depth:.3f} mm deep in the "
    "surface{whose} {at}",
    "gouge.stock": "in {motion} the {body} of T{tool}, which does not cut, is at stock of the surface{whose} "
    "that no cut has taken before, {depth:.3f} mm from what is cut, {at}",
    "gouge.plunge": "in {motion} T{tool}, which does not cut over its centre, plunges along stock of the "
    "surface{whose} that no cut has taken before, {depth:.3f} mm from what is cut, {at}",
    "gouge.table": "in {motion} the {body} of T{tool} is {depth:.3f} mm deep in the machine's table, table "
    "frame {at}",
    "gouge.body.cutter": "cutter",
    "gouge.body.shank": "shank",
    "gouge.body.holder": "holder",
    "gouge.do.side": "take a smaller cutter or the other side (G41/G42)",
    "gouge.do.side_or_lead": "take a smaller cutter or the other side (G41/G42), or set a smaller lead_mm",
    "gouge.do.placement": "take a smaller cutter or another placement of it",
    "gouge.do.apart": "take a smaller cutter, the other side (G41/G42), or move that block away",
    "gouge.do.flute": "take a tool with a longer flute, or cut from the top down in passes no higher than it",
    "gouge.do.shank": "take a tool with a longer flute or a slimmer neck (holder), or cut from the top down "
    "in passes no higher than the flute",
    "gouge.do.holder": "take a longer tool or a slimmer holder",
    "gouge.do.plunge": "plunge beside the surface (lead_mm above 0, or a block further off), or take a tool "
    "that cuts over its centre",
    "gouge.do.table": "raise the work (work offset), or take a longer tool or a slimmer holder",
    "form.told": "Form: {sentence}.",
    "form.refused": '{sentence}; or set gouge = "warn" to cut it anyway{more}',
    # --- how a cut begins, and how it follows another
    "lead.rests": "The {lead} is straight, and the cut rests at that ruling: one that joins it at its feed "
    "would cut into the part, leave an axis' travel, or has no direction there.",
    "join.block": "the block of line {line}",
    "join.own_part": "its own part before u = {u:.4f}",
    "join.differs": "Departs from {name} and approaches again: {what}.",
    "join.other_tool": "another tool",
    "join.other_offset": "another work offset",
    "join.other_side": "another side",
    "join.agrees": "Joins {name}: the poses agree and the cut runs through.{slowed}",
    "join.slowed_at_kink": "{crease} The poses change at another rate from there on: the contact slows down "
    "to about {feed:.0f} mm/min ({axis} {limit}); G64 P blends it.",
    "join.elsewhere": "Departs from {name} and approaches again: it ends elsewhere or on another ruling "
    "({gap:.6f} mm and {tilt:.4f} degrees apart; {allowed}).",
    "join.tolerance": "the joint tolerance is {mm:g} mm and {degrees:g} degrees",
    "join.blended": "Joins {name} within the joint tolerance: normals {degrees:.4f} degrees, gap {gap:.6f} "
    "mm; the blend over {reach:.2f} mm on either side deviates by {um:.3f} um at most.{slowed}",
    "join.slowed": "{crease} Within {mm:g} mm the contact slows down to about {feed:.0f} mm/min there "
    "({axis} {limit}); let the surfaces run on alike, or allow more (G64 P, joint_tolerance_mm).",
    "join.slowed_between_short_cuts": "{crease} These cuts are too short for a longer one: the contact slows "
    "down to about {feed:.0f} mm/min there ({axis} {limit}); let the surfaces run on alike, or make one of "
    "them.",
    "join.slowed_at_pole": " Beside the pole the tool axis is not led over: the contact slows down to about "
    "{feed:.0f} mm/min there ({axis} {limit}); let the surfaces turn on alike, or tilt the work.",
    "join.crease": " Along the ruling the normals differ by up to {along:.3f} degrees.",
    "join.turns_back": "Departs from {name} and approaches again: it turns straight back.",
    "join.concave": "{where} in a concave corner of {degrees:.4f} degrees; a cutter of radius {radius:.3f} "
    "mm would cut {overcut:.6f} mm into one of the two; {allowed}; blend the corner with a surface of a "
    "larger radius, cut on the other side, or allow more (joint_tolerance_mm in [machine], or G64 P)",
    "join.parts_meet": "the two parts of this block meet at u = {u:.4f}",
    "join.blocks_meet": "this block meets the one of line {line}",
    "join.pivots": "Pivots by {degrees:.4f} degrees{tilts} about the ruling it shares with {name}{reaches}"
    "{hollow}.{crease}",
    "join.hollow": "; it is a concave corner, which costs either surface up to {um:.3f} um of overcut",
    "join.tilts": " and tilts by {tilt:.4f} degrees, as the cutter is placed,",
    "join.reaches": "; on its way the cutter reaches {depth:.4f} mm into them",
    "limit.velocity": "velocity",
    "limit.acceleration": "acceleration",
    "limit.jerk": "jerk",
    "row.runs_on": "Runs on from {name} of line {line} within the joint tolerance: the blend over "
    "{reach:.2f} mm on either side deviates by {um:.3f} um at most.",
    "row.the_line": "the line",
    "row.the_block": "the block",
    "row.departs": "Does not run on from the block of line {line}, which ends with a departure and a rest: "
    "{why}.",
    "row.unreached": "the axes do not get there from the end of that cut without turning otherwise",
    "row.short": "one of the two is too short to be led over into the other: there is {room:.3f} mm of way "
    "for it",
    "row.turns": "the way of the tool turns there by {turn:.2f} degrees, and nothing that leads it over "
    "stays within {mm:g} mm and {degrees:g} degrees (G64 P Q)",
    "row.deeper": "beside that line the flank would get {deeper:.3f} mm deeper into the surfaces than the "
    "cuts do, and {mm:g} mm is allowed (G64 P)",
    # --- a start inside of the program, a dry run, and off the path and back
    "restart.no_motion": "the program has no motion at or behind this line; choose an earlier one",
    "restart.no_motion_of_it": "this line moves nothing in this program, which has subs or loops: it "
    "begins where a line runs for the first time; choose a line with a motion",
    "restart.which_time": "the program has subs or loops, and with another tool it is not known which time "
    "this line was running; start at a line, which begins the first time that it runs",
    "restart.probed": "the program probes on line {line} before it comes here, and what it found then is "
    "not known any more: start at the top, or at or before that line",
    "restart.no_fraction": "a fraction of {fraction:g} is none of a block; 0 to 1 are",
    "restart.moves_nothing": "this line moves nothing, so there is no fraction of it; start at its "
    "beginning (fraction 0) or at a line with a motion",
    "restart.only_rapid": "only a rapid is left of the program there; choose an earlier place",
    "restart.dry_run": "a dry run {offset:g} mm off the part along the tool axis is not possible: 0 to "
    "10000 mm are, for a negative offset would lead into the part; give another one",
    "aside.no_retract": "The tool cannot retract: it leaves the path out of a program that is held, and not "
    "on its way back. Hold the program, or let the tool return first.",
    "aside.no_return": "The tool cannot return: it has not left the path by a retract, or is on its way. "
    "Retract it first, or wait until it stands.",
    "aside.not_held": "The tool cannot {what} in mode {mode}: that needs HOLD and a standstill; hold the "
    "program and wait until it stands.",
    "aside.retract": "retract",
    "aside.return": "return",
    "aside.room": "The tool cannot retract by {by:g} mm along its axis here: above 0 and up to {room:.3f} "
    "mm are inside the travel; ask for less.",
    "aside.longer": "The new tool is {longer:.3f} mm longer and the tool stands only {off:.3f} mm off the "
    "part: retract by more than the difference before the change.",
    "aside.stands": "The tool T{tool} that is in the spindle now would stand {depth:.3f} mm in the "
    "surface of line {line}, where the one before it had room: put that one back and retract above the "
    "part first, or jog this one off it.",
    "aside.low": "The tool is thicker than before the change, and stands {low:.3f} mm lower than the "
    "highest that the program has cut up to there: put the one before it back and retract by so much more "
    "first, or jog this one off the part and up.",
    "aside.hits": "With the tool T{tool} the way would lead into the surface of line {line}: retract "
    "above the part first, or fit a thinner tool.",
    "aside.no_lead": "No lead onto line {line} stays off the surfaces of the program at this place: fit a "
    "thinner tool, set a smaller lead_mm, or stop and start at an earlier line.",
    "aside.thicker": "The tool is {by:.3f} mm thicker than before the change, and line {line} is not "
    "compensated for its radius, so it would cut as much deeper: fit one of at most {radius:.3f} mm, or "
    "program G41 or G42 with D.",
    "aside.probing": "A probing move is under way, and a retract would be taken for it; resume, or stop "
    "the program.",
}
