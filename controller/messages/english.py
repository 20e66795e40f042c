"""The texts of the faults and refusals in English."""

from __future__ import annotations

from controller.faults import Fault, Reaction, Recovery, Words

LANGUAGE = "en"
NAME = "English"

FRAMES = {
    "cause": "Cause: {cause}",
    "remedy": "Remedy: {remedy}",
    "trusted": "The position is still trusted.",
    "untrusted": "The position is no longer trusted: home before a program starts.",
    "position": "position",
    "yes": "trusted",
    "no": "lost",
    "stands": "stands within {ms} ms",
    "title": "Faults of {machine}",
    "unread": (
        "The drives have not been commissioned yet with this machine file: their own stops are "
        "as it says, not as they were read."
    ),
    "read": ("The drives' own stops as read on {at}: {stops}."),
}

CLASSES = {
    Reaction.NONE: "",
    Reaction.WARN: "warn",
    Reaction.END_OF_BLOCK: "hold at the end of the block",
    Reaction.HOLD: "hold on the path",
    Reaction.PATH_STOP: "coordinated stop",
    Reaction.LOST_DRIVE: "coordinated stop around the lost drive",
    Reaction.QUICK_STOP: "quick stop",
    Reaction.DISABLE: "quick stop, then off",
}

RECOVERIES = {
    Recovery.NOTHING: "nothing to do",
    Recovery.RESUME: "resume",
    Recovery.RESET: "reset, enable",
    Recovery.HOME: "reset, home, enable",
    Recovery.COMMISSION: "reset, commission, home, enable",
    Recovery.RESTART: "start the controller again",
}

_TELL = "report this with the recording, for the plan should have slowed down."

FAULTS: dict[Fault, Words] = {
    Fault.NONE: Words("No fault.", "None.", "Nothing to do."),
    # --- plan
    Fault.PLANNER_GONE: Words(
        "The planner has ended, or was silent for more than 2 s; the tool goes on to the end of what was "
        "planned and rests there, on the path (planner gone).",
        "The planner's process ended, or the computer gave it no time: no memory left, or too much load.",
        "Reset, enable, retract along the tool axis, load the program again.",
    ),
    Fault.TRAVEL: Words(
        "The next setpoint lies outside the travel of an axis; it was not sent.",
        "Work offset or tool length are not those that the program was checked with.",
        "Check work offset and tool length, then check the program.",
    ),
    Fault.VELOCITY: Words(
        "The next setpoint asks an axis for more than its velocity; it was not sent.",
        "An error of the plan, or a program that was started unchecked.",
        f"Check the program; {_TELL}",
    ),
    Fault.ACCELERATION: Words(
        "The next setpoint asks an axis for more than its acceleration; it was not sent.",
        "An error of the plan, or a program that was started unchecked.",
        f"Check the program; {_TELL}",
    ),
    Fault.BRANCH_LOST: Words(
        "The rotary axes cannot reach the next tool axis; nothing was sent.",
        "The tool axis leaves the cone that the two rotary axes can reach.",
        "Check the program; report this with the recording.",
    ),
    # --- drives
    Fault.FEEDBACK_LOST: Words(
        "A drive did not report its position twice in a row.",
        "A loose plug, a missing or third terminator, a bus that is too full, or a drive without supply.",
        "Check cable, termination and bus load; reset, commission again and home the axis.",
    ),
    Fault.STATE_LOST: Words(
        "A drive left the state Operation Enabled by itself.",
        "Its own supervision switched it off: supply, temperature, load, or its enable input.",
        "Read the drive's error code, remove the cause, reset and home the axis.",
    ),
    Fault.TORQUE_OFF: Words(
        "A drive has lost its torque without an error (safe torque off, or its enable input).",
        "The safety circuit opened, or a wire of safe torque off (STO) or of the enable input is loose.",
        "Close the safety circuit, check where the tool stands, reset and enable.",
    ),
    Fault.FOLLOWING_ERROR: Words(
        "The axis is not where it was told to be: it lags behind its command by more than its window.",
        "A collision, a stiff or braked axis, setpoints that do not reach the drive, a drive that is badly "
        "tuned, or too small a window.",
        "Look for a collision, a stiff axis, a loose bus cable or too small a window; reset and home "
        "the axis.",
    ),
    Fault.SETPOINTS_LOST: Words(
        "A drive tells that its setpoints have stopped coming (EMCY 8250h).",
        "A loose bus cable, a disturbed or overloaded bus, or a drive that filters the identifier.",
        "Check cable, termination and error counters of the bus; reset.",
    ),
    Fault.LIMIT_SWITCH: Words(
        "A drive ran onto a limit switch, so its position is not what it is taken for (EMCY 8612h).",
        "Homed at a wrong place, a travel in the machine file that is too long, or a broken switch wire.",
        "Move the axis off the switch, reset and home it, then check travel and homing position.",
    ),
    Fault.EMCY: Words(
        "A drive sent an emergency message.",
        "The drive's own supervision; its error code says which.",
        "Look up the emergency code of the drive, remove the cause, reset and home the axis.",
    ),
    Fault.DRIVE_WARNING: Words(
        "A drive warns (statusword bit 7); it goes on working.",
        "Temperature, load or supply come near to what the drive allows.",
        "Read the drive's error code and history; look at temperature and load before it trips.",
    ),
    Fault.HEARTBEAT_LOST: Words(
        "A drive's heartbeat stopped, or it does not answer node guarding.",
        "The drive has no supply, its cable is loose, or its firmware hangs.",
        "Check the drive's supply and cable; reset, commission again and home the axis.",
    ),
    Fault.NODE_RESET: Words(
        "A drive started anew; it has forgotten its settings.",
        "A dip of its supply, or another master on the bus that resets nodes.",
        "Check the drive's supply; reset, commission again and home the axis.",
    ),
    Fault.NODE_STOPPED: Words(
        "A drive was taken out of NMT Operational, and hears no setpoints.",
        "Another master or a tool on the bus stops nodes, or the drive left by its own error behaviour.",
        "Find who else sends NMT on the bus; reset, commission again and home the axis.",
    ),
    Fault.NODE_TWICE: Words(
        "Two drives answer under one node id: whose position it is cannot be told.",
        "A drive was exchanged or added with an id that another one has.",
        "Give each drive an id of its own (directrix drives scan); reset, commission again and home "
        "all axes.",
    ),
    Fault.MODE_LOST: Words(
        "A drive left the mode of operation in which setpoints come (6061h).",
        "Somebody wrote its object 6060h: a maker's tool or another master on the bus.",
        "Take the other tool off the bus; reset and commission again.",
    ),
    Fault.ENABLE_TIMEOUT: Words(
        "A drive did not reach Operation Enabled in time.",
        "No power at its motor supply, safe torque off is open, or an error that was not reset.",
        "Check the drive's supply, its enable input and its error code; reset and enable again.",
    ),
    Fault.HOMING_FAILED: Words(
        "A drive reported a homing error or did not finish homing.",
        "The reference switch or index pulse was not found, or the axis stands on the wrong side of it.",
        "Check the reference switch and the homing method; reset and home again.",
    ),
    # --- bus
    Fault.BUS_OFF: Words(
        "The CAN controller went bus-off: nothing that is commanded reaches a drive.",
        "A short circuit, a missing terminator, two bit rates on one bus, or strong interference.",
        "Check wiring, termination and bit rate; reset, commission again and home.",
    ),
    Fault.BUS_ERROR: Words(
        "The CAN bus reported an error (error passive, an overflow, or the hub is gone).",
        "Nobody acknowledges (drives off, cable open), interference, or a bad shield.",
        "Check wiring, termination and bit rate; reset, commission again and home.",
    ),
    Fault.RX_OVERFLOW: Words(
        "Frames were lost because the controller did not take them in time.",
        "The computer was busy elsewhere, or a node floods the bus.",
        "Take load off the computer; look for a node that sends too much; reset.",
    ),
    Fault.SYNC_FOREIGN: Words(
        "Somebody else sends SYNC on the bus: drives would take setpoints at the wrong time.",
        "A drive or another controller is set up as SYNC producer.",
        "Find the second SYNC producer (object 1006h of each node) and switch it off; reset.",
    ),
    Fault.FOREIGN_FRAMES: Words(
        "Somebody else sends under the controller's own identifiers: setpoints or its heartbeat.",
        "Another controller or a tool that replays frames is on the bus.",
        "Take it off the bus; reset.",
    ),
    Fault.SEND_FAILED: Words(
        "A frame could not be sent: the transmit queue is full or the bus is gone.",
        "Nobody acknowledges, the interface is down, or its queue is too short.",
        "Check the bus, its load and txqueuelen; reset, commission again and home.",
    ),
    Fault.SYNC_LOST: Words(
        "The kernel's SYNC did not come back in time.",
        "The bus stands, or the kernel's timer was held up.",
        "Check the bus; set sync to tick in the machine file; start again and home.",
    ),
    # --- tick
    Fault.TOO_MANY_SKIPS: Words(
        "Too many ticks came too late; the tool stopped on the path.",
        "Other programs took the tick's core, or the computer saves power while it waits.",
        "Take load off the computer or use a longer period; reset and go on.",
    ),
    Fault.STOP_OVERDUE: Words(
        "A stop on the path took longer than any stop should; the drives stopped by their own ramps.",
        "An error of the plan.",
        f"Check the program; {_TELL}",
    ),
    Fault.INTERNAL: Words(
        "The tick met an error of its own and stopped the drives.",
        "An error in the controller.",
        "Report this with the recording; start again and home.",
    ),
    Fault.CONTROLLER_GONE: Words(
        "The tick's process is gone; the drives stopped by their own supervision.",
        "Somebody ended it, the computer ran out of memory, or its watchdog ended it.",
        "Find out what ended it, start again and home.",
    ),
    # --- operator, safety, peripherals
    Fault.EMERGENCY_STOP: Words(
        "Emergency stop was requested.",
        "Somebody asked for it, on the page or by a script.",
        "Make the machine safe, reset, enable; the tool has left the path: retract before you start.",
    ),
    Fault.ESTOP_INPUT: Words(
        "The emergency-stop circuit is open.",
        "A button is pressed, a guard is open, or a wire of the circuit is loose.",
        "Make the machine safe, close the circuit, reset, enable; retract before you start.",
    ),
    Fault.POWER_LOST: Words(
        "The drives' power supply is gone.",
        "The main contactor dropped out, a fuse is blown, or the mains failed.",
        "Restore the supply; reset, commission again and home.",
    ),
    Fault.DOOR_OPEN: Words(
        "The door is open.",
        "Somebody opened it, or its switch is loose.",
        "Close the door and resume.",
    ),
    Fault.SPINDLE_NOT_AT_SPEED: Words(
        "The spindle did not reach its speed in time.",
        "A load from the start, a speed above what the drive can do, or too short a spin_up_s.",
        "Check the spindle drive, its load and the S word; resume.",
    ),
    Fault.SPINDLE_LAGS: Words(
        "The spindle does not follow the thread: it lags by more than most_lag_rev, or does not settle.",
        "A dull tap, chips in the hole, a speed or an acceleration above what the drive can do.",
        "The tool stands in the thread, in step with the spindle. Resume, or stop and withdraw it.",
    ),
    Fault.SPINDLE_OVERLOADED: Words(
        "The load of the spindle was at overload_percent or above it for too long.",
        "A dull or broken cutter, a cut that is too heavy, or chips that jam.",
        "Look at the cutter and the cut: retract, change the tool where it is worn; return, then resume.",
    ),
    Fault.LOAD_UNKNOWN: Words(
        "The spindle's drive does not tell its load any more: adaptive feed has gone to min_share.",
        "Frames of the drive that are missing, or a drive that was set up anew.",
        "Nothing has stopped. Check bus and drive; M52 P0, or the switch, ends adaptive feed.",
    ),
    Fault.SPINDLE_LOST: Words(
        "The spindle's drive is silent, in error or not enabled.",
        "Overload, no supply, or a loose cable.",
        "Retract the tool, read the spindle drive's error code, remove the cause, reset.",
    ),
    Fault.CLAMP: Words(
        "A clamp, of an axis or of the tool, is not as it must be.",
        "No air or oil, a valve that sticks, or a switch out of place.",
        "Check air, valve and switch of the clamp; reset.",
    ),
    Fault.COOLANT_LOST: Words(
        "The coolant does not flow.",
        "An empty tank, a blocked filter, a pump that is off, or a loose flow switch.",
        "Fill up or clear the coolant, then resume.",
    ),
    Fault.INPUT_MISSING: Words(
        "The input that M66 or M19 waits for did not come in time.",
        "What it reports has not happened, a loose wire, or too short a Q.",
        "See to what the input reports; resume waits once more, stop ends the program.",
    ),
    Fault.PROBE_OPEN: Words(
        "The probe is open or touches already: it is not to be led towards the part.",
        "The stylus rests on something or hangs, its battery is empty, or its wire is broken.",
        "Free the probe, look at its input, and resume; or stop the program.",
    ),
    Fault.PROBE_FREE: Words(
        "The probe is free already: there is nothing to be led off.",
        "G38.4 or G38.5 without a touch before it.",
        "Stop the program and correct it, or touch the part and resume.",
    ),
    Fault.PROBE_HIT: Words(
        "The probe has touched outside of a probing move.",
        "Something stands in the way of a positioning move, or the stylus is loose.",
        "Reset, jog the probe off by hand, look at its stylus, and correct the program or the work offset.",
    ),
    Fault.PROBE_STUCK: Words(
        "The probe is still touching: nothing is moved with it.",
        "The stylus hangs, the way off the part is wrong, or the input stays on.",
        "Reset, free the probe, jog it off by hand and look at its input.",
    ),
    Fault.PROBE_LATCH: Words(
        "A drive that moved has stored no position of the touch.",
        "The probe's signal does not reach the drive, or its touch probe function is off.",
        "Reset, look at the wire to the drive and at its object 60B8h, and commission it again.",
    ),
    Fault.IO_LOST: Words(
        "The node with door and emergency-stop inputs is silent, restarted or in error.",
        "Its supply dipped, its cable is loose, or its firmware hangs.",
        "Check its supply and cable; reset (it is commissioned again at the next start).",
    ),
}

REFUSALS = {
    "text": "{text}",
    "of_axis": "Axis {axis}: {text}",
    "also": "Also: {text} {remedy}",
    # --- by the machine's mode: "START is refused in OFF: the drives are off; enable them first (...)."
    "refused": "{request} is refused in {mode}: {why}",
    "known": "{now}; {way_out} ({request} is for {modes}).",
    "or": "{one} or {other}",
    "now.OFF": "the drives are off",
    "now.READY": "the machine is ready and no program runs",
    "now.RUNNING": "a program runs",
    "now.HOLD": "a program is held",
    "now.STOPPING": "the machine is coming to rest",
    "now.FAULT": "a fault is not reset",
    "now.HOMING": "axes are looking for their zero",
    "now.JOG": "axes are being jogged",
    "way_out.OFF": "enable them first",
    "way_out.READY": "switch the drives off first",
    "way_out.RUNNING": "stop it, or wait for its end",
    "way_out.HOLD": "resume or stop it first",
    "way_out.STOPPING": "wait until it stands",
    "way_out.FAULT": "remove its cause and reset it first",
    "way_out.HOMING": "wait until they have it, or stop it",
    "way_out.JOG": "end the jog and wait until they stand",
    "nothing_to.HOLD": "there is nothing to hold",
    "nothing_to.RESUME": "there is nothing to resume",
    "nothing_to.STOP": "there is nothing to stop",
    "nothing_to.RESET": "there is nothing to reset",
    "nothing_to.ENABLE": "the drives are on already",
    "not_homed": "{axes} must be homed before a program may start; home first.",
    "some_axes": "some axes",
    "away": "the tool has left the place where the program is held; let it return first.",
    "moves": "the axes still move; wait until they stand.",
    "press_ended": "The jog was stopped; let go of the key and press it again.",
    # --- by what the service does, or has
    "aside": "the tool stands off the path, retracted; let it return first.",
    "other_tools": "other tools were fitted since; stop the program and start the rest of it.",
    "no_fault": "There is no fault to be reset.",
    "running": "{program} is running; stop it, or wait for its end.",
    "not_in_table": "The tool table has no T{number}.",
    "not_loaded": "No program is loaded; load one first.",
    "still_loading": "{program} is still being read and checked; wait until it is loaded, or stop it.",
    "not_ready": "{program} was not loaded, so it cannot start. {why}",
    "no_why": "Why is not known; see the log of directrix serve.",
    "not_held": "{request} is refused in {mode}: hold the program and wait until it stands.",
    "not_retracted": "{request} is refused in {mode}: hold the program, or reset and enable, and wait until "
    "the axes stand.",
    "retract_room": "The tool cannot retract by {mm:g} mm: from here up to {room:.3f} mm along its axis are "
    "inside the travel; ask for more than 0 and no more than that.",
    "ended_short": "{request} ended after {gone:.3f} of {mm:.3f} mm; look why, then ask for the rest.",
    "not_set_here": "{name}: was set neither at the machine nor by a program; see directrix offsets.",
    "not_fitted": "The {what} are not changed while the machine is in {mode}; stop first.",
    "tool_change": "Put T{number}{name} into the spindle, then let the program go on.",
    "tool_out": "Take the tool out of the spindle, then let the program go on.",
    "offsets": "offsets",
    "tools": "tools",
    "under_way": "{request}: {other} is under way; wait for its end, or stop it.",
    "stopped": "It was stopped before it began.",
    "by_now": "The machine is in {mode} by now.",
    "ended_in": "{request} ended in {mode}.",
    "not_all_homed": "{axes} did not become homed; look at the drives.",
    "waited": "Waited {seconds:.0f} s for {what} in vain.",
    "first_tick": "the first tick",
    "answer": "the tick to answer",
    "enabled": "the drives to be enabled",
    "switched_off": "the drives to be switched off",
    "standstill": "standstill",
    "end_of_run": "the run to be told to be over",
    "end_of_fault": "the end of the fault",
    "start_taken": "the start to be taken",
    "end_of_way": "the end of the way off the path or back",
    "plan_silent": "The planner sends no more of the program: the tool comes to rest on the path in "
    "{seconds:.1f} s unless it sends again.",
    "tick_stands": "The tick's process has stood still for {seconds:.1f} s: what is shown is as old as that, "
    "and drives that do not hear it stop by themselves; look what holds it up.",
    "no_tick": "The tick process is not running; ask for a reset.",
    "no_plan": "The planner is gone; it is started anew. Ask again.",
    "not_taken": "The tick does not take the program; enable the drives and ask again.",
    "busy_tick": "The tick does not take requests; is the computer very busy?",
    # --- at the service's door
    "no_object": "A request is one JSON object of at most {most} bytes; correct it.",
    "no_verb_or_args": 'A request has a "verb" (text) and "args" (an object); correct it.',
    "long_request": "{verb}: {bytes} bytes are too many for one request; send a path.",
    "stranger": "This user may not use {path}; add it to the group that owns the socket.",
    "many_peers": "{path} has {most} users, which is all it serves; repeat.",
    "started_anew": "{path}: the machine's service was started anew before it answered; look at the machine: "
    "whether {verb} was done is not known.",
    "silent_door": "{path}: the machine's service is there and gives no answer ({why}); repeat.",
    "no_answer_within": "no answer within {seconds:g} s",
    "own_error": "The service met an error of its own; report this: {error}",
    # --- why the tick does not take a part of the plan
    "queue.NONE": "The last part of the plan was taken.",
    "queue.OLD": "An older part of the plan came again and was left out.",
    "queue.VOID": "A part of the plan came with a stop that makes the queue void, and was left out.",
    "queue.MODE": "The machine takes motion only in READY, RUNNING and HOLD; enable it, and start the "
    "program again.",
    "queue.EPOCH": "A part of the plan was made for a queue that has been given up since; the plan begins "
    "anew from where the tool stands.",
    "queue.STOPPING": "The tool is leaving the plan for a standstill; the plan goes on from there.",
    "queue.EMPTY": "A part of the plan had no motion in it; stop, load the program again, and report this.",
    "queue.LATE": "A part of the plan came too late to replace what runs; the tool goes on to the end of "
    "what is queued. Where this stays so the computer has too little time: take load off it.",
    "queue.GAP": "A part of the plan begins after the end of what is queued; stop, load the program again, "
    "and report this.",
    "queue.UNKNOWN_MOTION": "A part of the plan is of a motion that never came; stop, load the program "
    "again, and report this.",
    "queue.UNREACHABLE": "The axes cannot take the place at which the plan begins; stop, move the axes off "
    "by hand, and start again.",
    "queue.ELSEWHERE": "The plan begins beside the place where the axes stand, so nothing moves; stop, and "
    "start the program again from where they are.",
    "queue.JUMP": "The plan goes on at another place than the queue is at then; stop, load the program "
    "again, and report this.",
    # --- what became of a program
    "given_up": "The {verb} was given up.",
    "service_ended": "The service was ended.",
    "service_gone": "The controller's service is gone; these are its last figures. Find out what ended it, "
    "start it again and home.",
    "stands_before": "The tool stands on the path before that block.",
    "beside": "By the drives' own count the tool came to rest {off_mm:.3f} mm beside the path near line "
    "{line}, its axis turned by {off_deg:.3f} degrees. Retract it by hand along its axis before "
    "anything else.",
    "journal_unread": "{file}: the journal cannot be read ({why}); start at a line instead.",
    "file_damaged": "{file}: cannot be read ({why}); it lies there as {aside} now, and is begun anew. "
    "Check the disk, and home and tools before the next start.",
    "journal_of_other_version": "{file}: is no journal of this version; start the program at a line instead.",
    # --- by what was interrupted
    "interrupted": "{program} was interrupted at line {line} by the end of the controller's service; go on "
    "from there, or load a program.",
    "not_interrupted": "There is no interrupted program to go on with; start one from its beginning or at a "
    "line.",
    "changed": "{program} cannot be gone on with at line {line}: {what} changed since it was interrupted; "
    "undo the change, or start at a line by your own judgement.",
    "and": "{one} and {other}",
    "the_program": "the program",
    "the_machine_file": "the machine file",
    "a_work_offset": "a work offset",
    "lost": "{program} cannot be gone on with at line {line} yet: the machine does not know where its axes "
    "are; home all of them first.",
    "not_stored": "{program} is not in the store as it was when it was interrupted; upload it again, or "
    "start another one.",
    # --- where a program is entered: no refusal, but read before it is started from there
    "at.place": "Line {line}, {percent} % of its block ({what}).",
    "at.tool": "Tool T{tool}, work offset {offset}, G43 length {length} mm.",
    "at.sized_tool": "Tool T{tool} (radius {radius} mm, length {long} mm), work offset {offset}, "
    "G43 length {length} mm.",
    "at.tilted": "Tilted plane, seen from the table at zero: origin {origin}, X along {x}, Z along {z}.",
    "at.spindle": "Spindle {rev_min} 1/min, coolant {coolant}, feed {feed}.",
    "at.outputs": "Outputs {outputs}.",
    "at.entry": "Entry along the tool axis to {joints}.",
    "at.none": "none",
    "at.off": "off",
    "at.mist": "mist",
    "at.flood": "flood",
    "at.mist_and_flood": "mist and flood",
    "at.way.cut": "cut",
    "at.way.line": "line",
    "at.way.arc": "arc",
    "at.way.curve": "curve",
    "at.way.pause": "pause",
    "at.way.swivel": "swivel",
    "at.way.pivot": "pivot",
    "at.way.plunge": "plunge",
    "at.way.lead in": "lead in",
    "at.way.lead out": "lead out",
    "at.way.link": "link",
    # --- by who asks
    "control_held": "{holder} holds control; ask for it to be given back, or take it over by "
    '{{"take_over": true}}.',
    "no_control": "{holder} holds control; take it by POST /api/v1/control and send its token as "
    "X-Control-Token.",
    "nobody": "Nobody",
    "late": "It was asked for at tick {seen}, and now it is tick {now}: at most {most} s may lie between; "
    "press again if it is still wanted.",
    "role": "{name} has the role {has}; this needs {needs}; ask who sets up users.",
    "too_often": "Too many wrong passwords; try again in {seconds:.0f} s.",
    "wrong_password": "Name or password is wrong; try again.",
    # --- by what was sent
    "no_verb": "{verb}: there is no such verb; allowed are {allowed}.",
    "no_axes": "axes {axes}: allowed is a list out of {allowed}, or null for all.",
    "no_alarm": "There is no alarm {number}; ask for the list of alarms.",
    "not_number": "{name} {value!r}: must be a number from {lowest:g} to {highest:g}; correct it.",
    "not_whole": "{name} {value!r}: must be a whole number from 0; correct it.",
    "not_switch": "{name} {value!r}: must be true or false; correct it.",
    "spindle_must_stand": "The spindle must not turn with T{tool} in it (a probe, or may_turn = false): "
    "change the tool first, or write may_turn = true in its table.",
    "no_spindle": "The controller drives no spindle on this machine; switch it at the machine.",
    "no_adaptive": "Adaptive feed is not set up on this machine; write adaptive in [spindle] of its file.",
    "no_output": "{name}: the machine file has no such output; add it under [io] outputs.",
    "no_clamp": "{axis}: no axis with a clamp; allowed are {allowed}.",
    "jog_share": "The jog speed is {share:g}; it is a share from -1 to 1 and not 0.",
    "jog_distance": "The distance to jog is {distance:g}; give mm (degrees of a rotary) other than 0.",
    "jog_frame": "There is no frame {frame!r} to jog in; allowed are {allowed}.",
    "jog_letter": "Frame {frame!r} has no axis {axis!r} to jog; allowed are X, Y and Z.",
    "jog_not_homed": "Frame {frame!r} is not known before {axes} is homed; home it, or jog in the frame "
    "'joint'.",
    "jog_limit": "{axis} will not move: it stands at its soft limit of {limit:g} {unit}; jog it the "
    "other way.",
    "jog_axis": "The machine has no axis {axis!r} to jog; allowed are {allowed}.",
    "no_line": "fraction {fraction:g}: of which line? Give line, too.",
    "no_text": "text: must be a line of program of at most {most} characters.",
    "too_large": "{path}: is larger than {most} MB; split the program.",
    "unreadable": "{path}: cannot be read: {why}; upload the program again.",
    "not_written": "{path}: cannot be written: {why}.",
    "unrecorded": "{program} is not started, for this run is not recorded and cannot be gone on with: {why}. "
    "Free space on the disk, or confirm that it runs unrecorded.",
    "worn": "{program} is not started: the tool in the spindle, T{number}, is worn ({cut:.1f} min of cut, "
    "{parts} parts). Change it and say that it is new, or confirm that it cuts on.",
    "in_thread": "The tool stands in a thread, {depth:.2f} mm deep at a pitch of {pitch:g} mm (line {line}): "
    "withdraw it first, or say that it is out.",
    "probe_cycle": "cycle {found!r}: there is no such probing cycle; allowed are {allowed}.",
    "probe_value": "values {name!r}: {cycle} has no such value; allowed are {allowed}.",
    "probe_choice": "values {name} {found!r}: allowed are {allowed}.",
    "probe_number": "values {name} {found!r}: must be {lowest:g} to {highest:g} {unit}; correct it.",
    "probe_length": "values {name} {found!r}: must be {lowest:g} to {highest:g} {unit} and not 0; "
    "correct it.",
    "no_drawing": "{found!r}: no code of which there is a picture; there are {allowed}.",
    "no_touches": "The probe has touched nothing yet; probe first.",
    "probe_offset": "offset {found!r}: no offset that a cycle sets; allowed are {allowed}.",
    "no_changer": "This machine has no tool changer: its tools are changed by hand; describe one in "
    "[changer].",
    "changer_unknown": "Where the tools of the changer are has not been confirmed yet: look at the "
    "spindle and at "
    "every pocket, then confirm it (directrix changer confirm, or the page).",
    "change_interrupted": "A tool change (T{out} away, T{into} in; 0 is no tool) was interrupted in its step "
    "{step}.",
    "change_carried": "T{tool} was in work: it is in the spindle, in pocket {pocket}, or between them.",
    "change_spindle": "When that step began T{tool} was in the spindle.",
    "change_spindle_empty": "When that step began the spindle was empty.",
    "changer_confirm": "Look at spindle, arm and pockets, jog or move by hand what stands in the way, then "
    "confirm where the tools are; until then nothing moves but by jog.",
    "change_broken": "A tool change was interrupted.",
    "change_under_way": "{request} is refused in {mode}: a tool change is under way; resume it, or stop it.",
    "change_not_kept": "The tool change stops here, for its journal cannot be written: {why}.",
    "change_out_of_step": "The tool change stops here: its steps do not come in their order. Confirm "
    "where the "
    "tools are.",
    "change_other_tool": "The tool change does not begin: T{found} is in the spindle, and it was planned for "
    "T{wanted}; load the program again.",
    "change_not_there": "The tool change does not begin: T{tool} is not in pocket {pocket}; put it there and "
    "confirm it.",
    "change_taken": "The tool change does not begin: pocket {pocket}, to which T{tool} belongs, is not free; "
    "confirm where the tools are.",
    "change_late": "{fails} Step {number} of {steps} of the tool change, {step}, does not end.",
    "change_worn": "T{number} is to come into the spindle, and it is worn ({cut:.1f} min and {way:.1f} m of "
    "cut, {parts} parts): give it a new edge and say so; Resume takes it as it is.",
    "change_sister": "Stop, and a start from this line brings its sister T{sister}.",
    "prepare_late": "{fails} Step {number} of {steps} to make T{tool} ready, {step}, does not end; the cut "
    "goes on.",
    "prepare_late_do": "M6 waits for it: free what hangs, or stop the run and confirm where the tools are.",
    "prepare_interrupted": "T{tool} was being made ready when all ended, in the step {step}: its pocket may "
    "stand anywhere on its way.",
    "change_late_do": "Resume waits once more; Stop ends the change, and then where the tools are is "
    "confirmed.",
    "changer_not_clear": "clear: confirm that you have looked, and that arm and magazine stand clear of the "
    "spindle.",
    "changer_no_tool": "T{tool} is not in the tool table; allowed are {allowed}, and for the spindle 0.",
    "changer_twice": "T{tool} cannot be in the spindle and out of the machine.",
    "pockets": "pockets",
    "not_in_thread": "The tool stands in no thread: there is nothing to withdraw.",
    "thread_unknown": "How the tool stands in its thread could not be read: turn it out by hand, then say "
    "that it is out.",
    "no_sister": "T{tool} has no sister T{value}: another tool of the table, or null for none.",
    "tool_worn": "T{number} is worn ({cut:.1f} min and {way:.1f} m of cut, {parts} parts): change it and "
    "say that it is new.",
    "maintenance_due": "Maintenance is due: {name} (every {every:g} {unit}). Do it, and say that it is done.",
    "no_counter": "counter {counter}: there is none; allowed are {allowed}.",
    "no_item": "maintenance {name}: there is no such job; make one with an interval.",
    "no_item_name": "name: must be a text of 1 to {most} signs that can be seen.",
    "many_items": "There are {most} jobs of maintenance, which is the most; take one out first.",
    "little_room": "{folder} has {free} MB free, and {needed} MB are needed",
    "not_recorded": "{program} runs, but no record of it is kept: {why}. Free space on the disk.",
    "record_ended": "The record of {program} ends before the run: {why}. What came until now is kept; "
    "free space on the disk.",
    "other_sum": "{path}: its sha256 is {found}, not {wanted}; upload the program again.",
}
