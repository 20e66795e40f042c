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
    "calibration.one_target": "{file}: hat nur eine Zielposition; eine Achse wird an mindestens zweien "
    "gemessen; neu messen.",
    "calibration.uneven_runs": "{file}: Die Zielposition {target:g} wurde in einer Richtung {found} Mal "
    "angefahren, andere {most} Mal; jede braucht gleich viele; neu messen oder Zeilen entfernen.",
    "calibration.no_axis": "--axis {axis}: gibt es nicht; erlaubt sind {names}; eine davon wählen.",
    "calibration.no_plane": "--axes {axes}: sind nicht zwei von X, Y und Z; sie als XY schreiben.",
    "calibration.no_circle": "In der Aufzeichnung fahren {axes} in keiner Programmzeile einen vollen Kreis; "
    "einen mit G2 und einen mit G3 fahren.",
    "calibration.no_stand": "In der Aufzeichnung steht die Spitze in keiner Programmzeile, während eine "
    "Drehachse um mehr als {degrees:g} Grad dreht; eine mit G43.4 fahren und die Werkzeuglänge mit --length "
    "angeben.",
    "calibration.no_feature": "{file}: Merkmal {feature!r} gibt es nicht; erlaubt sind {kinds}, N eine "
    "Programmzeile, die eine Fläche schneidet ({lines}); berichtigen.",
    "calibration.too_few_free": "{touches} Antastungen reichen nicht, um {free} zu bestimmen; mehr Stellen "
    "abseits der Kanten antasten, oder mit --free weniger freigeben.",
    "calibration.blind": "Über {name} sagen diese Antastungen nichts; Stellen antasten, die es tun, oder es "
    "aus --free {free} nehmen.",
    "calibration.no_dofs": "--free {free}: erlaubt sind einige von X Y Z A B C, jedes einmal: "
    "Verschiebungen längs und Drehungen um die Achsen des Teils; sie als XYC schreiben.",
    "calibration.no_offset": "--offset {offset}: ist keine Nullpunktverschiebung; erlaubt sind G54 bis "
    "G59.3 und G54.1 P1 bis P48; eine davon wählen.",
    "calibration.no_line": "--line {line}: schneidet keine Fläche; erlaubt sind {lines}; eine davon wählen.",
    "calibration.no_measurement": "{found!r}: diese Messung gibt es nicht; erlaubt sind {allowed}.",
    "calibration.no_value": "Werte {name!r}: {measurement} hat keinen solchen Wert; erlaubt sind {allowed}.",
    "calibration.value_choice": "Werte {name} {found!r}: erlaubt ist {allowed}; etwas davon angeben.",
    "calibration.value_number": "Werte {name} {found!r}: muss eine Zahl von {lowest:g} bis {highest:g} "
    "{unit} sein; berichtigen.",
    "calibration.value_whole": "Werte {name} {found!r}: muss eine ganze Zahl von {lowest:g} bis "
    "{highest:g} sein; berichtigen.",
    "calibration.no_recording": "Das wird gemessen, während die Maschine sich bewegt: ticks angeben, now "
    "oder die einer Aufzeichnung.",
    "calibration.bad_recording": "{why} Eine Aufzeichnung der Maschine angeben, wie sie ist.",
    "calibration.no_table": "Das wird mit einer Tabelle gemessen: eine als CSV angeben.",
    "calibration.no_program": "Das gilt den Flächen eines Programms: den Namen eines im Speicher angeben.",
    "calibration.busy": "Eine andere Messung wird ausgewertet; danach noch einmal fragen.",
    "calibration.unread": "Die Messung war in {seconds:g} s nicht auszuwerten, oder ihr Prozess endete; "
    "mit weniger fragen.",
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
    "calibration.iso_reversal": "Umkehrspanne B",
    "calibration.iso_repeatability": "Wiederholpräzision R",
    "calibration.iso_systematic": "systematische Abweichung E",
    "calibration.iso_mean_deviation": "mittlere Abweichung M",
    "calibration.iso_accuracy": "Genauigkeit A",
    "calibration.circle_counter_clockwise": "Gegen den Uhrzeigersinn, Radius {radius_mm:.3f} mm (Zeile "
    "{line}): G {G_um:.2f} um, F {F_min_um:.2f} bis {F_max_um:.2f} um.",
    "calibration.circle_clockwise": "Im Uhrzeigersinn, Radius {radius_mm:.3f} mm (Zeile {line}): G "
    "{G_um:.2f} um, F {F_min_um:.2f} bis {F_max_um:.2f} um.",
    "calibration.circle_both": "Beide Richtungen: G(b) {G_bidirectional_um:.2f} um, Hysterese H {H_um:.2f} "
    "um.",
    "calibration.tip": "Zeile {line}: Die Spitze bewegte sich um {x_um:.2f} um in X, {y_um:.2f} um in Y, "
    "{z_um:.2f} um in Z und war höchstens {largest_um:.2f} um entfernt.",
    "calibration.part": "{offset}: Ursprung X {x:.4f} Y {y:.4f} Z {z:.4f} mm, gedreht um {a:.5f}, {b:.5f}, "
    "{c:.5f} Grad um X, Y, Z.",
    "calibration.part_fits": "Die Antastungen wichen um {before:.1f} um rms ab, mit dieser Verschiebung um "
    "{after:.1f} um rms.",
    "calibration.thermal": "Das Werkzeug ist um X {x:.4f} Y {y:.4f} Z {z:.4f} mm zu weit; die Berührungen "
    "weichen dann um {rms:.1f} um eff. ab.",
    "calibration.inspected": "Abweichungen {least:.1f} bis {most:.1f} um, {rms:.1f} um rms; über 0 ist zu "
    "viel Material da.",
    "calibration.head_touch": "Antastung",
    "calibration.head_feature": "Merkmal",
    "calibration.head_u": "u",
    "calibration.head_v": "v",
    "calibration.head_deviation": "Abweichung (um)",
    "calibration.head_predicted": "geplant (um)",
    "calibration.head_axis": "Achse",
    "calibration.head_point": "Punkt (mm)",
    "calibration.head_direction": "Richtung",
    "calibration.head_moved": "verschoben (um)",
    "calibration.head_turned": "gedreht (Grad)",
    "calibration.head_bound": "Schranke (um, Grad)",
}
