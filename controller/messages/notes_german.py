"""German: what a check notes of the words of a program, as ``notes_english``."""

from __future__ import annotations

LANGUAGE = "de"

REFUSALS = {
    # --- what a check notes of words, and what makes doubtful that they mean what they say
    "note.needs_nothing": "{code} ({meaning}) braucht hier nichts. {told}",
    "note.floating": "{code} bohrt das Gewinde mit Ausgleichsfutter: der Vorschub ist nicht an die Spindel "
    "gebunden, die unten umkehrt.",
    "note.reads_input": "M66 ohne L, oder mit L0, liest einen Eingang nach #5399, den hier kein Programm "
    "ansehen kann; L3 oder L4 und Q schreiben, um auf ihn zu warten.",
    "note.no_shift": "G52 mit Nullen hebt eine Verschiebung der Koordinaten auf; hier gilt keine.",
    "note.sister": "T{tool} ist verschlissen: Statt seiner kommt seine Schwester T{sister}.",
    "note.shift": "G52 ohne F verschiebt von hier an die Koordinaten aller Nullpunkte.",
    "note.shift_of_plane": "G52 ohne F verschiebt von hier an die Koordinaten dieser geschwenkten Ebene.",
    "note.not_square": "{code} P{p}: X und Z der Ebene stehen {off:.4g} Grad auseinander; Z bleibt, X gibt "
    "nach, damit es 90 werden.",
    "note.windows": "Byte 0x{byte:02X} ist kein UTF-8, die Datei wird als Windows-1252 gelesen; das "
    "betrifft nur Kommentare.",
    "doubt.mixed": "{code} mischt Wörter mit und ohne Dezimalpunkt: {word} sind {mm:g} mm, denn ohne "
    "Dezimalpunkt zählt es in 0.01 mm, {pointed} nicht; den Punkt überall schreiben, oder nirgends.",
    "doubt.small": "{code} schneidet {contact:.2g} mm mit {feed:.4g} mm/min: {word} sind {mm:g} mm, denn "
    "ohne Dezimalpunkt zählt es in 0.01 mm; Dezimalpunkte schreiben, wenn Millimeter gemeint sind.",
    # --- why a code needs no action here
    "told.ahead": "Der Vorschub wird immer so weit vorausgeplant, wie die Grenzen es verlangen.",
    "told.exact": "Ecken sind genau, außer unter G64 P.",
    "told.own_line": "G10 gilt nur für seine eigene Zeile.",
    "told.never": "Hier ist es nie eingeschaltet.",
    "told.corners": "Der Vorschub in Ecken wird nach den Grenzen der Achsen geplant.",
    "told.speed": "Wie schnell die Spindel dreht, sagt S allein.",
    "told.travel": "Der Verfahrweg der Achsen wird immer überwacht.",
    "told.watched": "Die Spindel wird überwacht, wo die Maschinendatei ihren Antrieb nennt.",
    "told.closes": "m_codes in [io] hat keinen Ausgang dafür; Klemmungen der Achsen schließen von selbst.",
    "told.opens": "m_codes in [io] hat keinen Ausgang dafür; Klemmungen der Achsen öffnen von selbst.",
    "told.path": "Wie weit die Bahn verlassen werden darf, sagt hier G64 P; ohne das ist sie genau.",
    "told.whole": "Das ganze Programm wird im Voraus gelesen und geplant.",
    "told.follows": "Hier ist es nie eingeschaltet; dem gedrehten Werkstück folgt G43.4.",
    "told.untilts": "G268 ist hier nie eingeschaltet; G69 beendet G68.2.",
    "told.no_output": "m_codes in [io] hat keinen Ausgang dafür.",
    "told.turns": "Die Spindel dreht, wie S sagt.",
    "told.positions": "Wörter mit X sind Positionen.",
    "told.kept": "Sie bleibt beim Bediener; M49 nimmt alle Beeinflussungen weg.",
    # --- what such a code would do
    "meaning.G5.fanuc": "Hochpräzisionsbetrieb",
    "meaning.G5.1.fanuc": "Vorausschau; bei Q2 die Achsen",
    "meaning.G8.fanuc": "Vorausschau",
    "meaning.G9.fanuc": "Genauhalt",
    "meaning.G11.fanuc": "Ende der Dateneingabe",
    "meaning.G13.1.fanuc": "Polarkoordinateninterpolation aus",
    "meaning.G50.1.fanuc": "Spiegeln aus",
    "meaning.G62.fanuc": "langsamer in Innenecken",
    "meaning.M41.fanuc": "kleiner Gang",
    "meaning.M42.fanuc": "großer Gang",
    "meaning.M43.fanuc": "dritter Gang",
    "meaning.G15": "Polarkoordinaten aus",
    "meaning.G23": "gespeicherte Verfahrgrenzen aus",
    "meaning.G25": "Drehzahlüberwachung der Spindel aus",
    "meaning.G50": "Skalieren aus",
    "meaning.G67.rs274": "modales Makro aus",
    "meaning.M10": "Klemmung ein",
    "meaning.M11": "Klemmung aus",
    "meaning.G5.3.fanuc": "Oberflächengüte",
    "meaning.G103": "begrenzt die Vorausschau",
    "meaning.G187": "Glättung",
    "meaning.G255": "mitgeführter Nullpunkt aus",
    "meaning.G269.fanuc": "geschwenkte Ebene aus",
    "meaning.M12.fanuc": "Klemmung der fünften Achse ein",
    "meaning.M13.fanuc": "Klemmung der fünften Achse aus",
    "meaning.M31.fanuc": "Späneförderer vorwärts",
    "meaning.M32.fanuc": "Späneförderer rückwärts",
    "meaning.M33.fanuc": "Späneförderer aus",
    "meaning.M84.fanuc": "Blasluft aus",
    "meaning.M89.fanuc": "Kühlmittel durch die Spindel aus",
    "meaning.M138.fanuc": "schwankende Drehzahl",
    "meaning.M139.fanuc": "schwankende Drehzahl aus",
    "meaning.M298.fanuc": "Betrieb mit hoher Genauigkeit",
    "meaning.M51": "Drehzahlbeeinflussung gilt (P1) oder nicht (P0)",
}
