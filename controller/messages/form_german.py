"""German: what is said of surfaces and their form tolerance, as ``form_english``."""

from __future__ import annotations

LANGUAGE = "de"

REFUSALS = {
    "form.within": "Jede Fläche hält ihre Toleranz: höchstens {off} µm Abweichung, {tolerance} µm erlaubt "
    "(Zeile {line}).",
    "form.exceeds": "Die Fläche in Zeile {line} überschreitet ihre Formtoleranz von {tolerance} mm um "
    "{exceeds} mm: sie ist {off} mm {way} bei u = {u}, {height} mm über der Unterkante, in "
    "Bewegung „{motion}“ von Zeile {by_line}",
    "form.exceeding": "{text}.",
    "form.overcut": "zu tief geschnitten",
    "form.undercut": "stehen geblieben",
    "form.would_do": "{sentence}; es hilft: {remedies}",
    "form.do.double": "Anstellung double (P2)",
    "form.do.optimal": "Anstellung optimal (P3)",
    "form.do.radius": "ein Fräser von etwa {radius} mm Radius",
    "form.do.smaller": "ein kleinerer Fräser",
    "form.do.side": "die andere Seite (G41/G42)",
    "form.do.lead": "ein kleineres lead_mm",
    "form.do.joint": "Flächen, die glatt aneinander anschließen",
    "form.do.flute": "ein Werkzeug mit längerer Schneide",
    "form.do.bands": "Bahnen von oben nach unten, keine höher als die Schneide",
    "form.do.apart": "den Satz in Zeile {by_line} wegrücken",
    "form.motion.cut": "Schnitt",
    "form.motion.lead in": "Einlauf",
    "form.motion.lead out": "Auslauf",
    "form.motion.link": "Übergang",
    "form.motion.pivot": "Schwenk",
    "form.motion.plunge": "Eintauchen",
    "form.motion.lift": "Abheben",
    "form.motion.retract": "Abheben",
    "form.motion.position": "Anfahren",
    "form.motion.down": "Absenken",
    "form.motion.return": "Rückweg",
    "form.motion.line": "Gerade",
    "form.motion.arc": "Kreisbogen",
    "form.motion.curve": "Kurve",
    "form.motion.swivel": "Schwenken am Pol",
    "form.motion.turn": "Drehen",
    "form.motion.probe": "Antasten",
    "form.motion.thread": "Gewinde",
    "form.motion.rapid": "Eilgang",
    "form.motion.other": "Bewegung",
}
