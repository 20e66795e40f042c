"""English: what is said of surfaces and their form tolerance. No refusals alone: ``form.within`` is none."""

from __future__ import annotations

LANGUAGE = "en"

REFUSALS = {
    "form.within": "Every surface keeps its tolerance: {off} µm off at most, {tolerance} µm allowed "
    "(line {line}).",
    "form.exceeds": "The surface of line {line} exceeds its form tolerance of {tolerance} mm by "
    "{exceeds} mm: it is {off} mm {way} at u = {u}, {height} mm above its lower edge, by the {motion} "
    "of line {by_line}",
    "form.exceeding": "{text}.",
    "form.overcut": "too deep",
    "form.undercut": "short of being cut",
    "form.would_do": "{sentence}; what helps: {remedies}",
    "form.do.double": "placement double (P2)",
    "form.do.optimal": "placement optimal (P3)",
    "form.do.radius": "a cutter of about {radius} mm radius",
    "form.do.smaller": "a smaller cutter",
    "form.do.side": "the other side (G41/G42)",
    "form.do.lead": "a smaller lead_mm",
    "form.do.joint": "surfaces that join smoothly",
    "form.do.flute": "a tool with a longer flute",
    "form.do.bands": "passes from the top down, none higher than the flute",
    "form.do.apart": "moving the block of line {by_line} away",
    "form.motion.cut": "cut",
    "form.motion.lead in": "lead in",
    "form.motion.lead out": "lead out",
    "form.motion.link": "link",
    "form.motion.pivot": "pivot",
    "form.motion.plunge": "plunge",
    "form.motion.lift": "lift",
    "form.motion.retract": "retract",
    "form.motion.position": "position",
    "form.motion.down": "down",
    "form.motion.return": "return",
    "form.motion.line": "line",
    "form.motion.arc": "arc",
    "form.motion.curve": "curve",
    "form.motion.swivel": "swivel",
    "form.motion.turn": "turn",
    "form.motion.probe": "probe",
    "form.motion.thread": "thread",
    "form.motion.rapid": "rapid",
    "form.motion.other": "motion",
}
