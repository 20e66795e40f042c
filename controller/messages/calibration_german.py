"""German: what measurements are refused for, and what ``directrix calibrate`` says."""

from __future__ import annotations

LANGUAGE = "de"

REFUSALS = {
    "calibration.no_column": "{file}, Zeile 1: Die Spalte {column} fehlt; eine solche Tabelle hat {needed}; "
    "sie ergänzen.",
    "calibration.how_many": "{file}: hat {count} Zeilen; erlaubt sind 1 bis {most}; neu messen.",
    "calibration.no_number": "{file}, Zeile {line}, Spalte {column}: {found!r} ist keine Zahl; eine "
    "schreiben, etwa 12.345.",
    "calibration.no_unit": "{file}, Zeile {line}: i j k hat die Länge {length:.3g}; es ist der Weg der "
    "Kugel als Einheitsvektor im Maschinensystem; berichtigen.",
    "calibration.no_rotary": "{machine} hat keine Drehachse; es gibt keine Drehmitte, die eine Kugel zeigen "
    "könnte.",
    "calibration.too_few": "{touches} Antastungen in {positions} Stellungen der Drehachsen; nötig sind "
    "mindestens 3 Stellungen mit je mindestens 4 Antastungen; mehr antasten.",
    "calibration.none_in_reach": "{machine}: In keiner Stellung der Drehachsen kommt der Taster im "
    "Verfahrweg an die Kugel; sie anderswohin setzen, oder angeben, wohin ihr Stift zeigt.",
    "calibration.too_large": "{axis} würde um {moved_mm:.3f} mm verschoben und um {turned_deg:.4f} Grad "
    "gedreht; erlaubt sind {most_mm:g} mm und {most_deg:g} Grad: zuerst Radius, Tasterlänge und Achsnamen "
    "prüfen, oder mit --max-mm und --max-deg mehr erlauben.",
    "calibration.shipped": "{machine}: ist kein Pfad einer Maschinendatei; was mitgeliefert ist, bleibt, "
    "wie es ist; sie kopieren und den Pfad der Kopie angeben.",
    "calibration.no_vector": "{option} {found}: sind nicht drei Zahlen; sie als 1.0,2.5,-3 schreiben.",
    # --- what a command says
    "calibration.written": "{file} ist geschrieben; wie sie vorher war, steht in {kept}.",
    "calibration.not_written": "Nichts ist geschrieben; mit --write geschieht es.",
    "calibration.rotaries": "{touches} Antastungen in {positions} Stellungen, Streuung {scatter_um:.2f} um; "
    "Kugel mit Radius {radius_mm:.4f} mm bei X {x:.4f} Y {y:.4f} Z {z:.4f} mm.",
    "calibration.dispersion": "Die Kugel schien um bis zu {before:.1f} um zu wandern ({before_rms:.1f} um "
    "rms); mit dem Gefundenen sind es {after:.1f} um ({after_rms:.1f} um rms). Bewertung der Stellungen: "
    "{valuation:.1f} von 100.",
    "calibration.correlated": "{one} und {other} sind kaum zu trennen (Korrelation {value:.3f}).",
    "calibration.unseen": "Über {names} sagen diese Stellungen nichts: Es bleibt, wie es war.",
    "calibration.doubtful": "Antastungen {rows} weichen stärker ab, als die Streuung erklärt; sie ansehen "
    "oder neu messen.",
    "calibration.add": "Diese Stellungen würden am meisten sagen: {places}.",
    "calibration.would_leave": "{axis}: Drehmitte auf {um:.2f} um, Richtung auf {deg:.5f} Grad.",
    "calibration.head_axis": "Achse",
    "calibration.head_point": "Punkt (mm)",
    "calibration.head_direction": "Richtung",
    "calibration.head_moved": "verschoben (um)",
    "calibration.head_turned": "gedreht (Grad)",
    "calibration.head_bound": "Schranke (um, Grad)",
}
