"""English: what a check notes of the words of a program."""

from __future__ import annotations

LANGUAGE = "en"

REFUSALS = {
    # --- what a check notes of words, and what makes doubtful that they mean what they say
    "note.needs_nothing": "{code} ({meaning}) needs no action here. {told}",
    "note.floating": "{code} is tapped with a floating holder: the feed is not tied to the spindle, which "
    "turns back at the bottom.",
    "note.reads_input": "M66 without L, or with L0, reads an input for #5399, which no program can look at "
    "here; write L3 or L4 and Q to wait for it.",
    "note.no_shift": "G52 with zeros cancels a shift of coordinates; none is in force here.",
    "note.sister": "T{tool} is worn: its sister T{sister} comes in its place.",
    "note.shift": "G52 without F shifts the coordinates of all work offsets from here on.",
    "note.shift_of_plane": "G52 without F shifts the coordinates of this tilted plane from here on.",
    "note.not_square": "{code} P{p} has X and Z of the plane {off:.4g} degrees apart: Z stays, X gives way "
    "to make it 90.",
    "note.windows": "byte 0x{byte:02X} is not UTF-8, so the file is read as Windows-1252; it matters in "
    "comments only.",
    "doubt.mixed": "{code} mixes words with and without a decimal point: {word} is {mm:g} mm, for without "
    "a decimal point it counts 0.01 mm, {pointed} does not; write a point in all of them, or in none.",
    "doubt.small": "{code} cuts {contact:.2g} mm at {feed:.4g} mm/min: {word} is {mm:g} mm, for without a "
    "decimal point it counts 0.01 mm; write decimal points if millimetres are meant.",
    # --- why a code needs no action here
    "told.ahead": "The feed is always planned as far ahead as the limits ask.",
    "told.exact": "Corners are exact but under G64 P.",
    "told.own_line": "G10 is for its line alone.",
    "told.never": "It is never on here.",
    "told.corners": "The feed in corners is planned by the limits of the axes.",
    "told.speed": "S alone says how fast the spindle turns.",
    "told.travel": "The travel of the axes is always watched.",
    "told.watched": "The spindle is watched wherever the machine file names its drive.",
    "told.closes": "m_codes in [io] has no output for it; clamps of axes close by themselves.",
    "told.opens": "m_codes in [io] has no output for it; clamps of axes open by themselves.",
    "told.path": "G64 P says here how far the path may be left; without it it is exact.",
    "told.whole": "The whole program is read and planned ahead.",
    "told.follows": "It is never on here; G43.4 follows the turned part.",
    "told.untilts": "G268 is never on here; G69 ends G68.2.",
    "told.no_output": "m_codes in [io] has no output for it.",
    "told.turns": "The spindle turns as S says.",
    "told.positions": "Words of X are positions.",
    "told.kept": "The operator keeps it; M49 takes all overrides.",
    # --- what such a code would do
    "meaning.G5.fanuc": "high-precision mode",
    "meaning.G5.1.fanuc": "look-ahead mode; of Q2 the axes",
    "meaning.G8.fanuc": "look-ahead mode",
    "meaning.G9.fanuc": "exact stop",
    "meaning.G11.fanuc": "end of data setting",
    "meaning.G13.1.fanuc": "polar interpolation off",
    "meaning.G50.1.fanuc": "mirror image off",
    "meaning.G62.fanuc": "slower in inside corners",
    "meaning.M41.fanuc": "low gear",
    "meaning.M42.fanuc": "high gear",
    "meaning.M43.fanuc": "third gear",
    "meaning.G15": "polar coordinates off",
    "meaning.G23": "stored stroke limits off",
    "meaning.G25": "spindle speed watch off",
    "meaning.G50": "scaling off",
    "meaning.G67.rs274": "modal macro off",
    "meaning.M10": "clamp on",
    "meaning.M11": "clamp off",
    "meaning.G5.3.fanuc": "surface finish",
    "meaning.G103": "limits look-ahead",
    "meaning.G187": "smoothness",
    "meaning.G255": "dynamic work offset off",
    "meaning.G269.fanuc": "tilted plane off",
    "meaning.M12.fanuc": "clamp of the fifth axis on",
    "meaning.M13.fanuc": "clamp of the fifth axis off",
    "meaning.M31.fanuc": "chip conveyor forward",
    "meaning.M32.fanuc": "chip conveyor back",
    "meaning.M33.fanuc": "chip conveyor off",
    "meaning.M84.fanuc": "air blast off",
    "meaning.M89.fanuc": "coolant through the spindle off",
    "meaning.M138.fanuc": "varying spindle speed",
    "meaning.M139.fanuc": "varying spindle speed off",
    "meaning.M298.fanuc": "high-accuracy mode",
    "meaning.M51": "spindle override counts (P1) or not (P0)",
}
