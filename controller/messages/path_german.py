"""German: why a path, its surfaces or a way back into it are refused, and what a check notes of them."""

from __future__ import annotations

LANGUAGE = "de"

REFUSALS = {
    "path.nothing": "Das Programm hat keinen Satz, der etwas tut; es gibt nichts abzuarbeiten.",
    "path.no_law": "von hier an wurde keine Bewegung gefunden, die alle Achsen in ihren Grenzen hält: "
    "irgendwo müssten sie fast auf der Stelle drehen; die Flächen dort glätten, den Satz teilen oder das "
    "Werkstück kippen",
    "path.too_long": "{what} mindestens {hours:.4g} h, mit seinen Vorschüben und Verweilzeiten, und "
    "überschreitet hier die {allowed:g} h, die longest_program_h in [machine] erlaubt; ein größeres F oder "
    "eine kürzere Verweilzeit schreiben{more}",
    "path.whole_takes": "das Programm dauert",
    "path.so_far_takes": "bis hierher dauert das Programm",
    "path.allow_longer": ", oder longest_program_h erhöhen, bis {most:g}",
    "stored.unread": "{file}: lässt sich nicht lesen ({why}); das Programm wird neu geprüft.",
    "stored.of_another": "{file}: ist keine gespeicherte Prüfung dieses Programms; es wird neu geprüft.",
    "stored.not_kept": "{folder}: die Prüfung ließ sich nicht speichern ({why}); ein Start prüft neu.",
    # --- what a check notes
    "note.says": "Meldet hier: {text}",
    "note.exact": "G64 ohne P verrundet nur Ecken von Geraden, die Rundung sind (innerhalb von {mm:g} mm "
    "oder {degrees:g} Grad, joint_tolerance_mm und _deg in [machine]); alles andere wird genau gefahren.",
    "note.runs_on": "Geraden laufen ab hier durch, wo ihre Ecken Rundung sind (innerhalb von {mm:g} mm oder "
    "{degrees:g} Grad, joint_tolerance_mm und _deg in [machine]), und werden um höchstens {mm:g} mm "
    "verlassen; andere Ecken sind genau. G61 fährt alle genau, G64 P erlaubt mehr.",
    "note.swivel": "Hält am Pol zwischen zwei Sätzen und dreht die Rundachse unter dem stehenden Werkzeug.",
    "note.spindle_not_driven": "Keine Spindel wird angetrieben: S und M3 tun hier nichts. [spindle] "
    "einen Bus und einen Knoten geben, oder sie von Hand schalten.",
    "note.spindle_off": "Vorschub mit stehender Spindel: vor dieser Zeile steht kein M3 oder M4 mit S.",
    "note.stops_for": "Hält, bis {tool} in der Spindel ist.",
    "note.no_tool": "kein Werkzeug",
    "note.flute": "Die Schneide von T{tool} ist {flute:.3f} mm lang und schneidet bis {flank:.3f} mm über "
    "der unteren Kante, die längste Erzeugende hat {longest:.3f} mm; über der Schneide wird nicht "
    "geschnitten.",
    "note.plunge": "T{tool} schneidet nicht über die Mitte, und diese Zeile führt es in seiner Achse nach "
    "unten: ob es auf Rohmaterial trifft, wird nur neben Flächen geprüft.",
    "note.optimal": "P3 (optimal) findet hier nichts Besseres als {as_good}, das genommen wird.",
    "note.single": "P1 (single)",
    "note.double": "P2 (double)",
    "note.left_out": "{count} Bewegungen neben den Flächen wurden nicht gegen sie geprüft.",
    "note.no_surface": "Das Programm schneidet keine Fläche (G51, G52, G6.2): es gibt nichts, woran es zu "
    "messen wäre.",
    "note.not_cut": "Die Aufzeichnung kommt nicht zu dieser Fläche, sie wird nicht beurteilt: sie beginnt "
    "dahinter oder endet davor.",
    # --- travel
    "travel.beyond": "{axis} käme{where} auf {value:.3f} {unit}, {by:.3f} {unit} außerhalb des Verfahrwegs "
    "von {low:.3f} bis {high:.3f} {unit}; {advice}",
    "travel.at": " bei u = {u:.4f} (Werkstück X {x:.3f} Y {y:.3f} Z {z:.3f} mm)",
    "travel.in": " in der Bewegung „{motion}“",
    "travel.in_entry": " in der Bewegung „{motion}“ des Wegs zurück ins Programm",
    "travel.move": "das Werkstück (Nullpunkt) oder den Satz verschieben",
    "travel.unwind": "erst zurückdrehen: G0 {axis}{at:.3f} vor diesen Satz schreiben, damit er mit {axis} "
    "auf {at:.3f} deg beginnt",
    "travel.turns": "der Satz dreht {axis} um {turned:.3f} deg, mehr als in irgendeiner Umdrehung in den "
    "Verfahrweg passt; {then}",
    "travel.split": "den Satz bei u = {u:.4f} oder davor teilen und dazwischen zurückdrehen: dort G0 "
    "{axis}{start:.3f} schreiben, damit der zweite Teil mit {axis} auf {start:.3f} deg beginnt",
    # --- where the rotary axes do not get
    "reach.lost": "{reason}{where}; das Werkstück kippen oder den Satz dort teilen",
    "reach.on_line": "{reason}, in dieser Zeile; das Werkstück kippen, die Zeile teilen oder mit der Achse "
    "außen herum gehen",
    "reach.tilt": "{reason}; das Werkstück oder das Werkzeug anders neigen",
    "reach.none": "keine Stellung der Rundachsen ergibt diese Werkzeugachse",
    "reach.none_of_one": "keine Stellung der Rundachse ergibt diese Werkzeugachse",
    "reach.stands": "das Werkzeug dieser Maschine steht längs Z und lässt sich nicht zu dieser "
    "Werkzeugachse neigen",
    "reach.limit": "die Werkzeugachse kommt an die Grenze dessen, was die Rundachsen erreichen; dort "
    "müssten sie auf der Stelle drehen",
    "reach.jump": "die Rundachsen müssten springen",
    "reach.turned_over": "die Werkzeugachse kippt in die Gegenrichtung um",
    # --- lines, curves, probing
    "curve.to_and_fro": "diese Kurve kehrt auf der Stelle um, denn ihre Kontrollpunkte führen auf einer "
    "Linie hin und her; sie auseinanderrücken, oder die Teile als eigene Kurven schreiben",
    "probing.no_way": "{code} hat keinen Weg: es endet dort, wo das Werkzeug steht; weiter führen, bis "
    "dahin, wo es spätestens berühren darf",
    "probing.too_fast": "{code} mit F{feed:.0f} mm/min läuft {found:.2f} mm nach, und der Taster verträgt "
    "{most:g} mm hinter der Berührung (overtravel_mm); F{fastest} oder weniger schreiben",
    "probing.no_replay": "{code} tastet hier an, und die Aufzeichnung eines Laufs enthält nicht, was "
    "berührt wurde: nur was vor dieser Zeile kommt, lässt sich noch einmal machen",
    # --- surfaces
    "cut.no_tool": "T{tool} steht nicht in der Werkzeugtabelle, die {known} hat; es eintragen oder eines "
    "davon nehmen",
    "cut.defect": "{code}: {defect}{advice}",
    "cut.no_radius": "Q von {allowance:.3f} mm lässt von T{tool} mit seinem Radius von {radius:.3f} mm "
    "nichts übrig; eine kleinere Korrektur angeben",
    "cut.no_tolerance": "der Fräser soll von selbst angestellt werden (auto, P4), und es gibt keine "
    "Formtoleranz, die zu halten wäre; R neben P schreiben, oder tolerance_mm beim Werkzeug oder in "
    "[machine]",
    "cut.not_travelled": "{code}: die untere Leitkurve lässt sich nicht abfahren: {why}",
    "cut.no_length": "die Kurve hat keine Länge, an der entlang zu fahren wäre",
    "cut.endless_bend": "die Kurve krümmt sich ohne Ende, ihre Länge lässt sich nicht bestimmen",
    "cut.try_free": "; P3 (optimal) oder P4 (auto) versuchen",
    "cut.write_free": "; {words} schreiben ({kind} wäre {own:.3f} mm daneben, optimal {best:.3f} mm)",
    "cut.p3": "P3 (optimal)",
    "cut.p3_or_p4": "P3 (optimal) oder P4 (auto)",
    "cut.none_found": ", und mit T{tool} wurde keine Anstellung gefunden, die weniger als {best:.3f} mm "
    "daneben ist{allowed}; einen dünneren Fräser nehmen oder beide Kurven ähnlicher führen",
    "cut.form_tolerance": " (die Formtoleranz ist {most:g} mm)",
    "defect.coincident": "obere und untere Leitkurve fallen zusammen, es gibt keine Erzeugende, an der der "
    "Fräser stehen könnte; zwei verschiedene Kurven angeben",
    "defect.zero_ruling_inside": "die Erzeugende bei u = {u:.4f} hat keine Länge, die Werkzeugachse ist "
    "dort unbestimmt; die Leitkurven auseinanderhalten",
    "defect.zero_ruling_end": "die Erzeugende bei u = {u:.4f}, an einem Ende des Satzes, hat keine Länge, "
    "die Werkzeugachse ist dort unbestimmt; die Leitkurven auch an den Enden auseinanderhalten",
    "defect.crossing": "die Leitkurven kreuzen sich bei etwa u = {u:.4f}; eine Regelfläche braucht zwei "
    "Kurven, die auseinanderbleiben",
    "defect.standstill": "die untere Leitkurve steht bei u = {u:.4f} still (C1' = 0), der Fräser hat dort "
    "keine Fahrtrichtung; den Satz dort teilen oder die Kontrollpunkte auseinanderrücken",
    "defect.twist": "die Flächennormale dreht sich längs der Erzeugenden bei u = {u:.4f} um {turn_deg:.1f} "
    "Grad; dem folgt nur eine Achse, die die Erzeugende verlässt",
    "defect.fold": "die Fläche faltet sich bei u = {u:.4f}, v = {v:.3f}: sie hat dort keine Normale, neben "
    "der ein Fräser stehen könnte; die Leitkurven in gleicher Richtung führen",
    # --- gouges, and what the form of a surface is refused for
    "gouge.refused": '{what}; {advice}, oder gouge = "warn" setzen, um es trotzdem zu schneiden{more}',
    "gouge.told": "Kollision: {what}; {advice}.",
    "gouge.overcut_told": "Zu tief: {what}; {advice}.",
    "gouge.more": " ({more} weitere mit --gouge warn)",
    "gouge.one": "Zeile {line}: {what}; {advice}{more}.",
    "gouge.others": " ({more} weitere)",
    "gouge.on_line": "Kollision, Zeile {line}: {what}; {advice}.",
    "gouge.overcut_on_line": "Zu tief, Zeile {line}: {what}; {advice}.",
    "gouge.no_room": "{code}: der Fräser T{tool} mit Radius {radius:.3f} mm passt nicht in die Höhlung mit "
    "Radius {hollow:.3f} mm bei u = {u:.4f}, auf seiner {side} Seite",
    "gouge.left": "linken",
    "gouge.right": "rechten",
    "gouge.fit_hollow": "einen Fräser von höchstens {hollow:.3f} mm oder die andere Seite nehmen",
    "gouge.lead": "die Bewegung „{lead}“ von {length:.3f} mm würde {reached:.3f} mm in die Fläche schneiden",
    "gouge.shorter_lead": "lead_mm kleiner setzen, einen kleineren Fräser oder die andere Seite (G41/G42) "
    "nehmen",
    "gouge.at": "bei X {x:.3f} Y {y:.3f} Z {z:.3f} mm",
    "gouge.at_uv": "bei u = {u:.4f}, v = {v:.3f} (Werkstück X {x:.3f} Y {y:.3f} Z {z:.3f} mm)",
    "gouge.motion": "der Bewegung „{motion}“ von Zeile {line}",
    "gouge.of_line": " von Zeile {line}",
    "gouge.hollow": "der Fräser T{tool} passt nicht in die Höhlung mit Radius {bound:.3f} mm und schneidet "
    "{depth:.3f} mm zu tief {at}",
    "gouge.overcut": "die Verwindung der Fläche kostet {depth:.3f} mm zu tiefen Schnitt, mehr als die "
    "{bound:g} mm von max_overcut_mm, {at}",
    "gouge.end": "am Ende der Fläche reicht die Schneide über sie hinaus; das kostet in {motion} "
    "{depth:.3f} mm zu tiefen Schnitt {at}, neben {bound:.3f} mm des Schnitts selbst",
    "gouge.own_cut": "der Schnitt kommt auf seine eigene Fläche zurück und schneidet {depth:.3f} mm zu "
    "tief {at}",
    "gouge.other_motion": "in {motion} wird die Fläche{whose} {depth:.3f} mm zu tief geschnitten {at}",
    "gouge.holder": "in {motion} steckt der Halter von T{tool} {depth:.3f} mm tief in der Fläche{whose} {at}",
    "gouge.uncut": "in {motion} bleiben über der Schneide von T{tool} {depth:.3f} mm der Fläche{whose} "
    "stehen, {at}",
    "gouge.shank": "in {motion} steckt der Schaft von T{tool}, der nicht schneidet, {depth:.3f} mm tief "
    "in der Fläche{whose} {at}",
    "gouge.stock": "in {motion} liegt T{tool} ({body}), wo es nicht schneidet, an Rohmaterial der "
    "Fläche{whose}, das zuvor kein Schnitt genommen hat, {depth:.3f} mm vom Geschnittenen entfernt, {at}",
    "gouge.plunge": "in {motion} taucht T{tool}, das nicht über die Mitte schneidet, an Rohmaterial der "
    "Fläche{whose} ein, das zuvor kein Schnitt genommen hat, {depth:.3f} mm vom Geschnittenen entfernt, {at}",
    "gouge.table": "in {motion} steckt T{tool} ({body}) {depth:.3f} mm tief im Maschinentisch, im "
    "Tischsystem {at}",
    "gouge.body.cutter": "Schneide",
    "gouge.body.shank": "Schaft",
    "gouge.body.holder": "Halter",
    "gouge.do.side": "einen kleineren Fräser oder die andere Seite (G41/G42) nehmen",
    "gouge.do.side_or_lead": "einen kleineren Fräser oder die andere Seite (G41/G42) nehmen, oder lead_mm "
    "kleiner setzen",
    "gouge.do.placement": "einen kleineren Fräser oder eine andere Anstellung nehmen",
    "gouge.do.apart": "einen kleineren Fräser oder die andere Seite (G41/G42) nehmen, oder jenen Satz "
    "wegrücken",
    "gouge.do.flute": "ein Werkzeug mit längerer Schneide nehmen, oder von oben nach unten in Bahnen "
    "schneiden, die nicht höher als sie sind",
    "gouge.do.shank": "ein Werkzeug mit längerer Schneide oder schlankerem Hals (holder) nehmen, oder von "
    "oben nach unten in Bahnen schneiden, die nicht höher als die Schneide sind",
    "gouge.do.holder": "ein längeres Werkzeug oder einen schlankeren Halter nehmen",
    "gouge.do.plunge": "neben der Fläche eintauchen (lead_mm über 0, oder ein Satz weiter weg), oder ein "
    "Werkzeug nehmen, das über die Mitte schneidet",
    "gouge.do.table": "das Werkstück anheben (Nullpunkt), oder ein längeres Werkzeug oder einen "
    "schlankeren Halter nehmen",
    "form.told": "Form: {sentence}.",
    "form.refused": '{sentence}; oder gouge = "warn" setzen, um es trotzdem zu schneiden{more}',
    # --- how a cut begins, and how it follows another
    "lead.rests": "„{lead}“ ist gerade, und der Schnitt ruht an dieser Erzeugenden: eine Bewegung, die mit "
    "dem Vorschub anschließt, würde ins Werkstück schneiden, den Verfahrweg einer Achse verlassen, oder "
    "hat dort keine Richtung.",
    "join.block": "Satz in Zeile {line}",
    "join.own_part": "eigenem Teil vor u = {u:.4f}",
    "join.differs": "Fährt von {name} weg und neu an: {what}.",
    "join.other_tool": "anderes Werkzeug",
    "join.other_offset": "anderer Nullpunkt",
    "join.other_side": "andere Seite",
    "join.agrees": "Schließt an {name} an: die Stellungen stimmen überein, der Schnitt läuft durch.{slowed}",
    "join.slowed_at_kink": "{crease} Von dort an ändern sich die Stellungen anders: der Berührpunkt wird auf "
    "etwa {feed:.0f} mm/min langsamer ({axis}: {limit}); G64 P überblendet es.",
    "join.elsewhere": "Fährt von {name} weg und neu an: jener endet anderswo oder an einer anderen "
    "Erzeugenden ({gap:.6f} mm und {tilt:.4f} Grad auseinander; {allowed}).",
    "join.tolerance": "die Toleranz am Übergang ist {mm:g} mm und {degrees:g} Grad",
    "join.blended": "Schließt an {name} an, innerhalb der Toleranz am Übergang: Normalen {degrees:.4f} "
    "Grad, Lücke {gap:.6f} mm; die Überblendung über {reach:.2f} mm auf jeder Seite weicht um höchstens "
    "{um:.3f} um ab.{slowed}",
    "join.slowed": "{crease} Innerhalb von {mm:g} mm wird der Berührpunkt dort auf etwa {feed:.0f} mm/min "
    "langsamer ({axis}: {limit}); die Flächen ähnlicher weiterführen oder mehr erlauben (G64 P, "
    "joint_tolerance_mm).",
    "join.slowed_between_short_cuts": "{crease} Für eine längere sind diese Schnitte zu kurz: der "
    "Berührpunkt wird dort auf etwa {feed:.0f} mm/min langsamer ({axis}: {limit}); die Flächen ähnlicher "
    "weiterführen oder eine daraus machen.",
    "join.slowed_at_pole": " Neben dem Pol wird die Werkzeugachse nicht übergeleitet: der Berührpunkt wird "
    "dort auf etwa {feed:.0f} mm/min langsamer ({axis}: {limit}); die Flächen ähnlicher weiterdrehen oder "
    "das Werkstück neigen.",
    "join.crease": " Längs der Erzeugenden unterscheiden sich die Normalen um bis zu {along:.3f} Grad.",
    "join.turns_back": "Fährt von {name} weg und neu an: hier geht es geradewegs zurück.",
    "join.concave": "{where} in einer Innenecke von {degrees:.4f} Grad; ein Fräser mit Radius {radius:.3f} "
    "mm würde {overcut:.6f} mm in eine der beiden Flächen schneiden; {allowed}; die Ecke mit einer Fläche "
    "von größerem Radius ausrunden, auf der anderen Seite fräsen oder mehr erlauben (joint_tolerance_mm "
    "in [machine], oder G64 P)",
    "join.parts_meet": "die beiden Teile dieses Satzes treffen sich bei u = {u:.4f}",
    "join.blocks_meet": "dieser Satz trifft den in Zeile {line}",
    "join.pivots": "Schwenkt um {degrees:.4f} Grad{tilts} um die gemeinsame Erzeugende mit {name}{reaches}"
    "{hollow}.{crease}",
    "join.hollow": "; es ist eine Innenecke, die in jede der beiden Flächen bis zu {um:.3f} um zu tief "
    "einschneidet",
    "join.tilts": " und neigt sich um {tilt:.4f} Grad, wie der Fräser angestellt ist,",
    "join.reaches": "; auf dem Weg reicht der Fräser {depth:.4f} mm in die Flächen",
    "limit.velocity": "Geschwindigkeit",
    "limit.acceleration": "Beschleunigung",
    "limit.jerk": "Ruck",
    "row.runs_on": "Läuft {name} Zeile {line} her durch, innerhalb der Toleranz am Übergang: die "
    "Überblendung über {reach:.2f} mm auf jeder Seite weicht um höchstens {um:.3f} um ab.",
    "row.the_line": "von der Geraden in",
    "row.the_block": "vom Satz in",
    "row.departs": "Läuft vom Satz in Zeile {line} her nicht durch; jener endet mit Wegfahrt und Halt: "
    "{why}.",
    "row.unreached": "die Achsen kommen vom Ende jenes Schnitts nicht dorthin, ohne anders zu drehen",
    "row.short": "eines von beiden ist zu kurz, um ins andere überzuleiten: es gibt dafür {room:.3f} mm Weg",
    "row.turns": "der Weg des Werkzeugs knickt dort um {turn:.2f} Grad, und nichts, das überleitet, bleibt "
    "innerhalb von {mm:g} mm und {degrees:g} Grad (G64 P Q)",
    "row.deeper": "neben jener Geraden käme die Schneide {deeper:.3f} mm tiefer in die Flächen als die "
    "Schnitte, und {mm:g} mm sind erlaubt (G64 P)",
    # --- a start inside of the program, a dry run, and off the path and back
    "restart.no_motion": "in dieser Zeile und dahinter hat das Programm keine Bewegung; eine frühere wählen",
    "restart.no_motion_of_it": "diese Zeile bewegt nichts in diesem Programm, das Unterprogramme oder "
    "Schleifen hat: es beginnt dort, wo eine Zeile zum ersten Mal läuft; eine Zeile mit Bewegung wählen",
    "restart.which_time": "das Programm hat Unterprogramme oder Schleifen, und mit einem anderen Werkzeug "
    "ist nicht bekannt, beim wievielten Mal diese Zeile lief; an einer Zeile beginnen, das heißt bei ihrem "
    "ersten Mal",
    "restart.probed": "das Programm tastet in Zeile {line} an, bevor es hierher kommt, und was es damals "
    "fand, ist nicht mehr bekannt: von oben beginnen, oder an oder vor jener Zeile",
    "restart.no_fraction": "ein Anteil von {fraction:g} ist keiner eines Satzes; 0 bis 1 sind es",
    "restart.moves_nothing": "diese Zeile bewegt nichts, also gibt es keinen Anteil davon; an ihrem Anfang "
    "(Anteil 0) oder an einer Zeile mit Bewegung beginnen",
    "restart.only_rapid": "dort ist vom Programm nur ein Eilgang übrig; eine frühere Stelle wählen",
    "restart.dry_run": "ein Probelauf {offset:g} mm über dem Werkstück, längs der Werkzeugachse, geht "
    "nicht: 0 bis 10000 mm gehen, ein negativer Abstand führte ins Werkstück; einen anderen angeben",
    "aside.no_retract": "Das Werkzeug kann nicht abheben: es verlässt die Bahn nur aus einem angehaltenen "
    "Programm, und nicht auf dem Rückweg. Das Programm anhalten, oder das Werkzeug erst zurückfahren lassen.",
    "aside.no_return": "Das Werkzeug kann nicht zurückfahren: es hat die Bahn nicht durch Abheben "
    "verlassen, oder es ist unterwegs. Erst abheben, oder warten, bis es steht.",
    "aside.not_held": "Das Werkzeug kann in der Betriebsart {mode} nicht {what}: dafür braucht es HOLD und "
    "Stillstand; das Programm anhalten und warten, bis es steht.",
    "aside.retract": "abheben",
    "aside.return": "zurückfahren",
    "aside.room": "Das Werkzeug kann hier nicht um {by:g} mm längs seiner Achse abheben: über 0 und bis "
    "{room:.3f} mm liegen im Verfahrweg; weniger verlangen.",
    "aside.longer": "Das neue Werkzeug ist {longer:.3f} mm länger, und das Werkzeug steht nur {off:.3f} mm "
    "über dem Werkstück: vor dem Wechsel um mehr als den Unterschied abheben.",
    "aside.stands": "Das Werkzeug T{tool}, das jetzt in der Spindel ist, stünde {depth:.3f} mm in der "
    "Fläche der Zeile {line}, wo das vorige Platz hatte: jenes wieder einsetzen und erst über das "
    "Werkstück abheben, oder dieses davon wegfahren.",
    "aside.low": "Das Werkzeug ist dicker als vor dem Wechsel und steht {low:.3f} mm tiefer als das "
    "Höchste, das das Programm bis dahin geschnitten hat: das vorige wieder einsetzen und erst um so viel "
    "weiter abheben, oder dieses vom Werkstück weg nach oben fahren.",
    "aside.hits": "Mit dem Werkzeug T{tool} führte der Weg in die Fläche der Zeile {line}: erst über das "
    "Werkstück abheben, oder ein dünneres Werkzeug einsetzen.",
    "aside.no_lead": "Kein Anfahrweg auf Zeile {line} bleibt an dieser Stelle von den Flächen des "
    "Programms weg: ein dünneres Werkzeug einsetzen, lead_mm kleiner setzen, oder abbrechen und an einer "
    "früheren Zeile beginnen.",
    "aside.thicker": "Das Werkzeug ist {by:.3f} mm dicker als vor dem Wechsel, und Zeile {line} ist nicht "
    "um seinen Radius korrigiert, sie schnitte also um so viel tiefer: eines von höchstens {radius:.3f} "
    "mm einsetzen, oder G41 oder G42 mit D programmieren.",
    "aside.probing": "Ein Antasten ist im Gange, und ein Abheben würde dafür gehalten; fortsetzen, oder "
    "das Programm abbrechen.",
}
