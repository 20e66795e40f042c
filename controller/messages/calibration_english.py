"""English: what measurements are refused for, and what ``directrix calibrate`` says."""

from __future__ import annotations

LANGUAGE = "en"

REFUSALS = {
    "calibration.no_column": "{file}, line 1: the column {column} is missing; a table of this kind has "
    "{needed}; add it.",
    "calibration.how_many": "{file}: has {count} rows; allowed are 1 to {most}; measure again.",
    "calibration.no_number": "{file}, line {line}, column {column}: {found!r} is no number; write one, as "
    "12.345.",
    "calibration.no_unit": "{file}, line {line}: i j k has the length {length:.3g}; it is the way of the "
    "ball as a unit vector of the machine frame; correct it.",
    "calibration.no_rotary": "{machine} has no rotary axis; there is no centre that a sphere could tell.",
    "calibration.too_few": "{touches} touches at {positions} positions of the rotaries; needed are 3 "
    "positions and more, with 4 touches and more at each; probe more of them.",
    "calibration.none_in_reach": "{machine}: no position of the rotaries lets the probe come to the sphere "
    "within travel; put the sphere elsewhere, or give the way that its stem points.",
    "calibration.too_large": "{axis} would move by {moved_mm:.3f} mm and turn by {turned_deg:.4f} degrees; "
    "allowed are {most_mm:g} mm and {most_deg:g} degrees: look at the radius, the probe's length and the "
    "axes' names first, or allow more with --max-mm and --max-deg.",
    "calibration.shipped": "{machine}: is no path of a machine file; what is shipped stays as it is; copy "
    "it and give the path of the copy.",
    "calibration.no_vector": "{option} {found}: are not three numbers; write them as 1.0,2.5,-3.",
    "calibration.one_target": "{file}: has one target only; an axis is measured at two and more; measure it "
    "again.",
    "calibration.uneven_runs": "{file}: target {target:g} was approached {found} times in one sense, others "
    "{most} times; every target needs as many; measure it again or take rows out.",
    "calibration.no_axis": "--axis {axis}: there is none of that name; allowed are {names}; choose one of "
    "these.",
    "calibration.no_plane": "--axes {axes}: are not two of X, Y and Z; write them as XY.",
    "calibration.no_circle": "In the recording {axes} go no full circle on a line of the program; cut one "
    "with G2 and one with G3.",
    "calibration.no_stand": "In the recording the tip stands on no line of the program while a rotary turns "
    "by more than {degrees:g} degrees; run one with G43.4, and give the tool's --length.",
    "calibration.no_feature": "{file}: feature {feature!r} is none; allowed are {kinds}, with N a line of "
    "the program that cuts a surface ({lines}); correct it.",
    "calibration.too_few_free": "{touches} touches are not enough to find {free}; touch more places off the "
    "edges, or let fewer be free with --free.",
    "calibration.blind": "These touches tell nothing of {name}; touch places that do, or take it out of "
    "--free {free}.",
    "calibration.no_dofs": "--free {free}: allowed are some of X Y Z A B C, each once: moves along and "
    "turns about the axes of the part; write them as XYC.",
    "calibration.no_offset": "--offset {offset}: is no work offset; allowed are G54 to G59.3 and G54.1 P1 "
    "to P48; choose one of these.",
    "calibration.no_line": "--line {line}: cuts no surface; allowed are {lines}; choose one of these.",
    "calibration.no_measurement": "{found!r}: there is no such measurement; allowed are {allowed}.",
    "calibration.no_value": "values {name!r}: {measurement} has no such value; allowed are {allowed}.",
    "calibration.value_choice": "values {name} {found!r}: allowed is {allowed}; give one.",
    "calibration.value_number": "values {name} {found!r}: must be a number from {lowest:g} to {highest:g} "
    "{unit}; correct it.",
    "calibration.value_whole": "values {name} {found!r}: must be a whole number from {lowest:g} to "
    "{highest:g}; correct it.",
    "calibration.no_recording": "This is measured while the machine moves: give ticks, now or of a "
    "recording.",
    "calibration.bad_recording": "{why} Give a recording of the machine as it is.",
    "calibration.no_table": "This is measured by a table: give one as CSV.",
    "calibration.no_program": "This is about the surfaces of a program: give the name of one in the store.",
    "calibration.busy": "Another measurement is being evaluated; ask again when it is done.",
    "calibration.unread": "The measurement could not be evaluated within {seconds:g} s, or its process "
    "ended; ask with less.",
    # --- what a command says
    "calibration.written": "{file} is written; as it was before it is {kept}.",
    "calibration.not_written": "Nothing is written; --write does it.",
    "calibration.rotaries": "{touches} touches at {positions} positions, scatter {scatter_um:.2f} um; "
    "sphere of radius {radius_mm:.4f} mm at X {x:.4f} Y {y:.4f} Z {z:.4f} mm.",
    "calibration.dispersion": "The sphere seemed to move by up to {before:.1f} um ({before_rms:.1f} um "
    "rms); with what was found it is {after:.1f} um ({after_rms:.1f} um rms). Valuation of the positions: "
    "{valuation:.1f} of 100.",
    "calibration.correlated": "{one} and {other} are hardly told apart (correlation {value:.3f}).",
    "calibration.unseen": "Of {names} these positions say nothing: it stays as it was.",
    "calibration.doubtful": "Touches {rows} are off by more than scatter explains; look at them, or measure "
    "again.",
    "calibration.add": "These positions would tell most: {places}.",
    "calibration.would_leave": "{axis}: centre within {um:.2f} um, direction within {deg:.5f} degrees.",
    "calibration.iso_reversal": "reversal B",
    "calibration.iso_repeatability": "repeatability R",
    "calibration.iso_systematic": "systematic deviation E",
    "calibration.iso_mean_deviation": "mean deviation M",
    "calibration.iso_accuracy": "accuracy A",
    "calibration.circle_counter_clockwise": "Counter-clockwise, radius {radius_mm:.3f} mm (line {line}): G "
    "{G_um:.2f} um, F {F_min_um:.2f} to {F_max_um:.2f} um.",
    "calibration.circle_clockwise": "Clockwise, radius {radius_mm:.3f} mm (line {line}): G {G_um:.2f} um, F "
    "{F_min_um:.2f} to {F_max_um:.2f} um.",
    "calibration.circle_both": "Both senses: G(b) {G_bidirectional_um:.2f} um, hysteresis H {H_um:.2f} um.",
    "calibration.tip": "Line {line}: the tip moved by {x_um:.2f} um along X, {y_um:.2f} um along Y, "
    "{z_um:.2f} um along Z, and was {largest_um:.2f} um off at most.",
    "calibration.part": "{offset}: origin X {x:.4f} Y {y:.4f} Z {z:.4f} mm, turned by {a:.5f}, {b:.5f}, "
    "{c:.5f} degrees about X, Y, Z.",
    "calibration.part_fits": "The touches deviated by {before:.1f} um rms, and do so by {after:.1f} um rms "
    "in this offset.",
    "calibration.thermal": "The tool is too far by X {x:.4f} Y {y:.4f} Z {z:.4f} mm; the touches deviate "
    "by {rms:.1f} um rms then.",
    "calibration.inspected": "Deviations {least:.1f} to {most:.1f} um, {rms:.1f} um rms; above 0 there is "
    "too much material.",
    "calibration.head_touch": "touch",
    "calibration.head_feature": "feature",
    "calibration.head_u": "u",
    "calibration.head_v": "v",
    "calibration.head_deviation": "off (um)",
    "calibration.head_predicted": "planned (um)",
    "calibration.head_axis": "axis",
    "calibration.head_point": "point (mm)",
    "calibration.head_direction": "direction",
    "calibration.head_moved": "moved (um)",
    "calibration.head_turned": "turned (deg)",
    "calibration.head_bound": "bound (um, deg)",
}
