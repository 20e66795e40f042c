"""German: what the reader of programs refuses."""

from __future__ import annotations

LANGUAGE = "de"

REFUSALS = {
    # --- program
    "program.refused": "{place}: {sentence}",
    "program.within": "{sentence} ({calls})",
    "program.called": "gerufen von {written} in Zeile {line} von {file}",
    "program.more_calls": "und {more} Aufrufe mehr",
    "program.listed": "{one}, {other}",
    "program.count": "{about} {count}",
    "program.count_other": "andere {count}",
    "program.summed": "{count} Ablehnungen: {each}.",
    "program.of_several": "{sentence} ({summed})",
    # --- arc
    "arc.turning_axis": "{motion} unter {code} gibt es hier nicht: Bögen der Werkzeugspitze bei "
    "drehender Achse haben keine vereinbarte Bedeutung; den Bogen als G1-Sätze schreiben (unter G64 P "
    "werden sie eine glatte Bahn), oder G49 davor",
    "arc.no_turns": "{word} ist kein Bogen: P zählt die Umläufe, ab 1; berichtigen",
    "arc.too_many_turns": "{word} sind zu viele Umläufe: P zählt 1 bis {most}; mehr Bögen schreiben",
    "arc.off_the_plane": "{word} liegt nicht in der Ebene: unter {plane} hat ein Mittelpunkt {allowed}; "
    "das Wort oder die Ebene berichtigen",
    "arc.centre_or_radius": "{motion} hat {found}: unter {plane} gehört dazu entweder {allowed} oder R; "
    "eines davon schreiben",
    "arc.half_a_centre": "{lacks} fehlt: unter G90.1 ist der Mittelpunkt eine Position und hat beide Wörter",
    "arc.no_radius": "{word} ergibt keinen Bogen: mit R ist der Radius nicht 0, und ein Endpunkt {axes} "
    "steht daneben; ergänzen, oder den Mittelpunkt angeben",
    "arc.centre_is_start": "der Mittelpunkt dieses Bogens ist sein Anfang; I J K sind der Weg vom Anfang "
    "zum Mittelpunkt",
    "arc.two_radii": "dieser Bogen beginnt {start:.4f} mm von seinem Mittelpunkt und endet {end:.4f} mm "
    "davon; der Unterschied darf {allowed:.4f} mm sein; I J K oder den Endpunkt berichtigen",
    "arc.full_with_radius": "ein Bogen mit R braucht einen anderen Endpunkt als seinen Anfang; ein "
    "Vollkreis nimmt I J K",
    "arc.out_of_reach": "R {radius:.4f} mm reicht nicht zu einem Ende in {away:.4f} mm Entfernung; R ist "
    "mindestens die Hälfte davon; R oder den Endpunkt berichtigen",
    "arc.both": "Mittelpunkt und R",
    "arc.neither": "weder Mittelpunkt noch R",
    # --- word
    "word.no_place": "{code} hat keinen Ort: dazu gehören Achswörter, etwa {code} X10 Y0; sie daneben "
    "schreiben, oder {code} weglassen",
    "word.two_owners": "{owners} in einem Satz nehmen beide {letter}: wozu {word} gehört, ist nicht "
    "klar; zwei Sätze schreiben",
    "word.no_motion": "{word} hat keine Bewegung: {cleared}; G0 bis G3, G51, G52 oder G6.2 dazu "
    "schreiben, oder die Zeile streichen",
    "word.exponent": "{word}: E gibt es nur neben M67 und M68, und Zahlen haben keinen Exponenten; die "
    "Zahl ausschreiben",
    "word.rotary_with_vectors": "{word} ist eine Drehachsstellung unter G43.5, wo I J K längs der "
    "Werkzeugachse sagen, wie das Werkzeug steht; I J K schreiben, oder G43.4 für Drehachswörter",
    "word.vector": "kein Code in diesem Satz nimmt {word}: {motion} hat Werkzeugvektoren I J K nur unter "
    "G43.5, und Bögen mit I J K sind G2 und G3; G43.5 schreiben oder das Wort streichen",
    "word.no_owner": "kein Code in diesem Satz nimmt {word}: {letter} gehört zu {takers}; den Code "
    "ergänzen oder das Wort streichen",
    "word.no_owner_here": "kein Code in diesem Satz nimmt {word}: {here}; {letter} gehört zu {takers}; den "
    "Code ergänzen oder das Wort streichen",
    "word.takes": "{code} nimmt {letters}",
    "word.takes_none": "{code} nimmt keine Worte von Achsen",
    "word.g53_alone": "G53 (Maschinenposition) hat keine Bewegung: dazu gehören Achswörter unter G0 oder "
    "G1; G0 und die Achsen ergänzen, oder G53 streichen",
    "word.two_take_axes": "{code} und {other} in einem Satz nehmen beide die Achswörter; zwei Sätze "
    "schreiben",
    "word.not_a_count": "{word} ist keine Anzahl: {letter} ist eine ganze Zahl ab 0; berichtigen",
    "word.negative": "{word} ist negativ: {letter} ist hier 0 oder mehr; berichtigen",
    "word.no_such_axis": "{word} bewegt eine Achse, die diese Maschine nicht hat: ihre Achsen sind "
    "{axes}; eine davon verwenden, oder die Maschine wählen, für die das Programm geschrieben ist",
    "word.number_inside": "{word} steht mitten im Satz: N ist das erste Wort; versetzen oder streichen",
    "word.twice": "{before} und {word} stehen in einem Satz: jeder Buchstabe außer G und M darf einmal "
    "stehen; einen streichen",
    "word.no_point": "{word} hat keinen Dezimalpunkt: an Steuerungen dieses Dialekts kann das {whole:g} "
    "oder {thousandth:g} heißen; einen Punkt schreiben, oder in der Maschinendatei sagen, was gilt: "
    '[machine] without_point = "unit" oder "thousandth"',
    "word.no_number": "{word} ist keine Satznummer: N nimmt eine Zahl ab 0; berichtigen oder weglassen",
    "word.too_large": "{letter} hat den Wert {value:g}: kein Wort darf jenseits von +-{most:.0f} liegen; "
    "berichtigen",
    # --- code
    "code.not_done": "{code} ({meaning}) gibt es hier nicht: {instead}",
    "code.two_of_a_group": "{before} und {code} sind beide von der Gruppe {group}: ein Satz nimmt einen "
    "von {allowed}; einen streichen oder zwei Sätze schreiben",
    "code.unknown": "{word} ist hier nicht bekannt: die Codes dieser Steuerung sind {known}; mit ihnen "
    "schreiben, was gemeint ist, oder es streichen",
    "code.unknown_m": "{word} ist hier nicht bekannt: die Codes dieser Steuerung sind {known}; mit ihnen "
    "schreiben, was gemeint ist, es streichen, oder in m_codes von [io] einen Ausgang dafür eintragen",
    "code.none": "keinem Code dieser Steuerung",
    "code.other_dialect": '{word} ist ein Code nur von dialect = "{dialect}": das in [machine] oder mit '
    "--dialect setzen, wenn das Programm dafür geschrieben ist, oder einen anderen Code verwenden",
    # --- boring
    "boring.plane": "{code} steht unter {plane}: es geht nur in G17; G17 schreiben, oder die Bewegungen "
    "selbst",
    "boring.no_shift": "{code} hat kein Q, um das die Schneide von der Wand geführt wird, bevor das "
    "Werkzeug die Bohrung verlässt; es schreiben",
    "boring.shift_of_nothing": "{code} weicht um nichts aus: die Schneide würde die Wand zerkratzen; Q "
    "über 0 schreiben, oder G86",
    "boring.negative": "{word} ist negativ: Q ist, wie weit das Werkzeug ausweicht; berichtigen",
    "boring.no_direction": "{word} sagt, wie weit, und die Maschinendatei nicht, wohin die Schneide von "
    "der Wand geht: shift in orient unter [io] eintragen, etwa X+, oder I und J statt Q schreiben",
    "boring.off_the_plane": "{word} geht längs {shift} der Maschine, was hier nicht in der Ebene der "
    "Bohrung liegt; I und J statt Q schreiben",
    "boring.heights": "G87 schneidet aufwärts von R auf {below:.4g} mm bis Z auf {end:.4g} mm und "
    "beginnt über beiden auf {level:.4g} mm: R liegt am tiefsten; berichtigen",
    # --- beside
    "beside.nothing_moves": "unter dem {code} aus Zeile {line} bewegen mehr als {most} Sätze nichts in "
    "der Ebene",
    "beside.no_plane_of_machine": "unter dem {code} aus Zeile {line} haben Werkzeugspitzensteuerung und "
    "Maschinenpositionen (G53) keine solche Ebene",
    "beside.short_lead_in": "unter dem {code} aus Zeile {line} ist die erste Bewegung {length:.6g} mm "
    "lang in der Ebene und darf nicht kürzer sein als der Fräserradius von {radius:.6g} mm; weiter "
    "weg beginnen",
    "beside.arc_first": "unter dem {code} aus Zeile {line} ist die erste Bewegung ein Bogen, der nicht "
    "dorthin führt; mit einer Geraden beginnen",
    "beside.inside_an_arc": "unter dem {code} aus Zeile {line} läuft sie innen in einem Bogen mit Radius "
    "{arc:.4f} mm, in den ein Fräser mit Radius {radius:.4f} mm nicht passt; einen kleineren Fräser oder "
    "einen größeren Radius nehmen",
    "beside.vanishes": "unter dem {code} aus Zeile {line} verschwindet diese Bewegung hinter dem Fräser "
    "mit Radius {radius:.4f} mm: von ihrer Ecke mit Zeile {there} bleibt nichts; einen kleineren Fräser "
    "nehmen, oder die Bewegung verlängern",
    "beside.corner": "unter dem {code} aus Zeile {line} kommt ein Fräser mit Radius {radius:.4f} mm "
    "nicht in die Ecke der Zeilen {here} und {there}; einen kleineren Fräser nehmen, oder die Kontur ändern",
    "beside.no_plane": "unter dem {code} aus Zeile {line} hat Werkzeugspitzensteuerung keine solche Ebene",
    "beside.is_on": "{word} steht unter dem {code} aus Zeile {line}, das bis G40 gilt; davor G40 mit "
    "einer Bewegung von der Kontur weg schreiben",
    "beside.two_meanings": "{word} und {other} stehen neben {code}: mit D gilt es für Geraden und Bögen, "
    "mit P, Q und R für Flächen; eines von beiden schreiben",
    "beside.no_diameter": "{code} hat kein D: D und den Fräserdurchmesser schreiben",
    "beside.edge": "{word} ist die Schneidenlage eines Drehmeißels: ein Fräser hier ist rund; L weglassen",
    "beside.no_tool": "{word} nennt kein Werkzeug: D ist die Nummer in der Werkzeugtabelle, in der "
    "{known} stehen; eines davon verwenden oder es eintragen, oder G41.1 oder G42.1 mit D als Durchmesser "
    "schreiben",
    "beside.for_surfaces": "{motion} läuft unter {side}, das hier für Flächen gilt: P, Q oder R steht "
    "daneben, oder eine Fläche kam danach; G40 schreiben, und G41 oder G42 mit D für Geraden und Bögen",
    "beside.tip_control": "{motion} läuft unter {side} und Werkzeugspitzensteuerung: Geraden und Bögen "
    "haben ihren Fräser nur in einer Ebene aus X Y Z daneben; G49 davor schreiben, oder G40",
    "beside.for_lines": "{motion} ist eine Fläche, und das {code} aus Zeile {line} gilt für Geraden und "
    "Bögen: D steht daneben, oder eine Gerade kam zuerst; G40 davor schreiben, und G41 oder G42 ohne D",
    "beside.changed": "{word} steht unter dem {code} aus Zeile {line}: Werkzeug, Länge, Ebene und "
    "Koordinaten bleiben bis G40, wie sie sind; davor G40 mit einer Bewegung von der Kontur weg schreiben",
    "beside.unknown": "wo die Achsen stehen, ist hier nicht bekannt: hinter einer Fläche oder einem "
    "Werkzeugvektor wählt es die Bahn, und von dort kann der Fräser nicht neben eine Kontur geführt "
    "werden; G0 mit Positionen von X Y Z davor schreiben",
    "beside.gouge": "unter dem {code} aus Zeile {line} schneidet der Fräser mit Radius {radius:.4f} mm "
    "in das, was Zeile {there} stehen lässt: zwischen beiden ist die Kontur schmaler als der Fräser; einen "
    "kleineren nehmen",
    "beside.gouge_told": "der Fräser mit Radius {radius:.4f} mm schneidet in das, was Zeile {there} "
    "stehen lässt: zwischen beiden ist die Kontur schmaler als der Fräser; einen kleineren nehmen",
    "beside.late": "{code} in Zeile {line} hat kein D, und mehr als {most} Zeilen stehen zwischen ihm "
    "und der ersten Geraden oder dem ersten Bogen; D daneben schreiben",
    "beside.owed": "{code} in Zeile {line} gilt für {plane}, und der Fräser steht noch neben einer "
    "Kontur in {owed}; ihn hinter G40 zuerst in jener Ebene bewegen",
    "beside.arc_behind": "die erste Bewegung nach G40 ist ein Bogen: sie führt von neben der Kontur an "
    "ihr eigenes Ende und muss eine Gerade sein; G0 oder G1 davor schreiben",
    # --- cycle
    "cycle.not_along_the_tool": "{code} ginge längs {axis} der geschwenkten Ebene, {off:.4g} Grad neben "
    "dem Werkzeug: ein Zyklus geht auf {most:g} Grad genau längs des Werkzeugs; G53.1 davor schreiben",
    "cycle.no_height": "{code} hat kein {lacks}, {what}: der erste Satz eines Zyklus sagt es; es schreiben",
    "cycle.pecks_of_a_tap": "{word} bohrt das Gewinde mit Spanbruch, wofür die Spindel ihren Winkel "
    "melden muss: position in [spindle] der Maschinendatei eintragen, oder Q weglassen",
    "cycle.no_peck": "{word} ist keine Tiefe eines Spans: Q ist größer als 0; berichtigen",
    "cycle.no_dwell": "{code} hat kein P, die Sekunden, die es am Grund verweilt; es schreiben, oder G81 "
    "oder G85",
    "cycle.upside_down": "{code} hat seine Rückzugsebene R auf {clearance:.4g} mm, unter seinem Grund "
    "auf {bottom:.4g} mm: R liegt über dem Grund; eines von beiden berichtigen",
    "cycle.repeats": "{word}: ein Zyklus wird {least}- bis {most}-mal wiederholt; berichtigen",
    "cycle.too_many_pecks": "{code} würde in {pecks:.0f} Spänen bohren: höchstens {most}; Q erhöhen",
    "cycle.tip_control": "{code} steht unter Werkzeugspitzensteuerung (G43.4, G43.5); G49 davor "
    "schreiben, oder die Bewegungen selbst",
    "cycle.inverse": "{code} steht unter G93, wo F eine Zeit ist; G94 und den Vorschub je Minute davor "
    "schreiben",
    "cycle.beside": "{code} steht unter {side}; G40 davor schreiben",
    "cycle.tap_right": "{code} braucht eine Spindel, die rechts dreht; S und M3 davor schreiben",
    "cycle.tap_left": "{code} braucht eine Spindel, die links dreht; S und M4 davor schreiben",
    "cycle.standing": "{code} kommt bei stehender Spindel; S und M3 oder M4 davor schreiben",
    "cycle.g87_to_clearance": "{code} steht unter G99, und sein R liegt unter dem Werkstück: es endet, "
    "wo es begann; G98 davor schreiben",
    "cycle.bottom": "den Grund",
    "cycle.clearance": "die Höhe, bis zu der im Eilgang gefahren wird",
    "cycle.no_q": "{code} hat kein Q: Q ist die Tiefe eines Spans, größer als 0; es schreiben",
    "cycle.bad_q": "{code} hat {word}: Q ist die Tiefe eines Spans, größer als 0; es berichtigen",
    # --- value
    "value.not_finite": "{what} hat keinen endlichen Wert: er ist zu groß oder verlässt den Bereich "
    "einer Funktion; berichtigen",
    "value.no_bits": "{what} geht an Steuerungen dieses Dialekts Bit für Bit, und {value:g} ist keine ganze "
    "Zahl bis 31 Bit; erst vergleichen, etwa [#1 GT 0] {what} [#2 GT 0], oder runden",
    "value.two_comparisons": "{what} vergleicht, was schon verglichen ist: an Steuerungen dieses Dialekts "
    "binden AND, OR und XOR vor EQ, NE, GT, GE, LT, LE; Klammern schreiben: [[#1 EQ 1] AND [#2 EQ 2]]",
    "value.no_bracket": "[ fehlt: der Wert einer Funktion oder Bedingung steht in Klammern, etwa sin[30]",
    "value.open_bracket": "diese [ ist nicht geschlossen: ein Ausdruck reicht von [ bis ] in einer "
    "Zeile; die ] ergänzen",
    "value.no_parameter": "#{value:g} ist kein Parameter: sie sind von {first} bis {last} nummeriert; "
    "einen davon verwenden",
    "value.no_ini": "#<_ini[...]> liest eine INI-Datei, und hier gibt es keine; den Wert schreiben, oder "
    "einen Parameter darauf setzen",
    "value.no_name": "#< öffnet den Namen eines Parameters, der mit > in seiner Zeile endet, etwa #<tiefe>",
    "value.too_deep": "Klammern sind tiefer als {most} verschachtelt: mit Parametern #1, #2, ... aufteilen",
    "value.atan": "atan nimmt zwei Werte: atan[y]/[x] schreiben",
    "value.exists": "EXISTS fragt nach einem Parameter: EXISTS[#<name>] schreiben",
    "value.exists_open": "EXISTS nimmt einen Parameter und eine ]: EXISTS[#<name>] schreiben",
    "value.o_for_zero": "O hinter {before}: ist das eine Null? Eine Zahl hat nur Ziffern; 0 schreiben",
    "value.alone": "{written} steht allein: ein Parameter wird mit {written}=wert gesetzt oder hinter "
    "einem Buchstaben verwendet, etwa X{written}; ergänzen, was fehlt",
    "value.o_behind": "hinter {what} steht der Buchstabe O: ist das eine Null? Die Ziffer 0 schreiben",
    "value.no_number": "{what} hat keine Zahl: dazu gehört eine Zahl wie 12.5, ein Parameter #1, ein "
    "Ausdruck [1+2] oder eine Funktion sin[30]; die Zahl schreiben oder das Wort streichen",
    "value.expression": "der Ausdruck",
    "value.label": "die Marke",
    "value.unset": "#<{name}> hat noch keinen Wert: ihn in einer früheren Zeile mit #<{name}>=wert setzen",
    "value.vacant": "#{number} hat noch keinen Wert, und an Steuerungen dieses Dialekts ist das nicht 0: ihn "
    "in einer früheren Zeile mit #{number}=wert setzen",
    "value.nothing": "#0 hat nie einen Wert: es wird nur verglichen, etwa IF [#1 EQ #0]; einen anderen "
    "Parameter nehmen",
    "value.of_the_machine": "#{number} kann nicht gesetzt werden: Parameter {first} bis {last} sind "
    "Positionen, Nullpunktverschiebungen und Werkzeuge der Maschine und nur zu lesen; eine andere Nummer "
    "verwenden, und G10, G92 und G28.1, um Nullpunkte, Werkzeuge und Referenzpunkte zu setzen",
    "value.given": "#<{name}> gibt die Steuerung vor und ist nur zu lesen; einen anderen Namen verwenden",
    "value.system": "#{number} ist an Steuerungen dieses Dialekts eine Systemvariable, und hier nicht: "
    "Parameter eines Programms sind #1 bis #999; (MSG, ...) und M0 für #3000 und #3006 schreiben, #5420 an "
    "für Positionen, G10, um Nullpunkte zu setzen",
    "value.at_run": "#5399 ist, was M66 findet, wenn das Programm läuft, und das ganze Programm wird "
    "vorher gelesen: M66 mit L1 bis L4 und Q schreiben, das wartet und das Programm anhält, wenn nichts "
    "kommt",
    "value.no_probe": "{name} ist von dem, was antastet, und T{tool} in der Spindel ist kein Taster: "
    "{known}; den Taster mit T und M6 einwechseln, oder das Werkzeug über dem Werkzeugtaster messen",
    "value.no_setter": "{name} ist von einem Werkzeugtaster, und die Maschinendatei hat keinen: [setter] mit "
    "point_mm und radius_mm hinzufügen",
    "value.not_above": "{name} ist die Fläche des Werkzeugtasters, und das Werkzeug steht nicht darüber: es "
    "ist {off:.3f} mm neben ihrer Mitte und darf {most:g}, die Rundachsen auf 0 (hier höchstens "
    "{turned:.3f} Grad); nach X{x:g} Y{y:g} der Maschine fahren (G53), die Rundachsen auf 0",
    "value.not_known": "{name} ist die Position von {axis}, die hier nicht bekannt ist: gelesen wird vor "
    "der Maschine her, und bekannt ist, wohin die Bewegungen des Programms führen, nicht, wo eine Fläche "
    "das Werkzeug lässt; die Achse vorher mit G0 oder G1 bewegen",
    "value.by_zero": "{what} teilt durch null: was dahinter steht, ist 0; berichtigen",
    # --- flow
    "flow.too_many_passes": "{mark}: das Programm hat {most}-mal Schleifen durchlaufen und "
    "Unterprogramme gerufen, was das Meiste ist (program_passes in [machine]); die Schleife beenden, oder "
    "den Wert erhöhen",
    "flow.too_many_arguments": "{mark} hat {count} Argumente: ein Unterprogramm nimmt bis zu {most}, als "
    "#1 bis #30",
    "flow.no_label": "o mit dem Wert {value:g} ruft nichts: eine berechnete Marke ist eine ganze Zahl "
    "und steht nur mit call, etwa o[#1+100] call",
    "flow.no_block": "{mark} führt zu N{number:g}, und keine Zeile dieses Programms oder seines "
    "Unterprogramms hat diese Nummer; sie ergänzen, oder die Nummer berichtigen",
    "flow.called_by_m98": "O{label} endet mit M99: ein solches Unterprogramm wird mit M98 P{label} gerufen",
    "flow.no_sub": "es gibt kein Unterprogramm {label}: weder o{label} sub in diesem Programm noch eine "
    "Datei dieses Namens damit im Ordner der Programme; ergänzen, oder den Namen berichtigen",
    "flow.too_deep": "{mark} ruft tiefer als {most} Unterprogramme ineinander (call_levels in "
    "[machine]): die Rekursion beenden, oder den Wert erhöhen",
    "flow.m98_alone": "M98 ruft kein Unterprogramm: P und seine Nummer daneben schreiben, etwa M98 P1000",
    "macro.alone": "{word} ruft kein Makro: P und seine Nummer daneben schreiben, etwa {word} P9010 X10.",
    "macro.before": "{word} steht vor {code}, dessen Zeile sein Aufruf ist: hinter {code} schreiben, falls "
    "es ein Argument ist, sonst in eine eigene Zeile",
    "macro.no_argument": "{letter} ist kein Argument von {code}: das sind die Buchstaben außer G L N O P",
    "macro.too_many_sets": "mehr als {most} Sätze I J K: für {word} ist kein Parameter übrig; weniger "
    "angeben",
    "macro.modal_twice": "G66 aus Zeile {line} ist noch an: vor dem nächsten G67 schreiben",
    "flow.called_by_o": "o{label} sub endet mit endsub: es wird mit o{label} call gerufen, nicht mit M98",
    "flow.no_number": "es gibt kein O{label}: weder in diesem Programm, hinter seinem M30, noch als "
    "Datei dieses Namens im Ordner der Programme; ergänzen, oder P berichtigen",
    "flow.m99_outside": "M99 im Programm selbst würde es für immer wiederholen: es beendet "
    "Unterprogramme, die M98 ruft; das Programm mit M30 beenden",
    "flow.m99_in_o": "M99 beendet Unterprogramme, die M98 ruft; dieses endet mit endsub oder return",
    "flow.runs_into": "{what} läuft in {mark}, womit ein Unterprogramm für M98 beginnt: {end} davor "
    "schreiben",
    "flow.no_count": "{word} ist keine Anzahl: P und L eines Aufrufs sind ganze Zahlen ab 0; berichtigen",
    "flow.surplus": "{behind} steht hinter {mark}: sonst steht nichts in einer Zeile mit einem O-Wort; "
    "es in eine eigene Zeile schreiben",
    "flow.no_o_word": "{behind} hinter o{label} ist kein O-Wort: das sind sub endsub call return if "
    "elseif else endif while endwhile do repeat endrepeat break continue; berichtigen",
    "flow.no_end": "{mark} hat kein Ende: {what} schreiben, wo es endet",
    "flow.deleted": "/ vor {mark} würde einen Teil einer Struktur wegnehmen: es vor jedes O-Wort dieser "
    "Struktur schreiben, oder vor keines; vor sub und endsub keines",
    "flow.else_if": "IF hinter {mark} fragt nichts: der Zweig käme immer daran; o{label} elseif schreiben",
    "flow.return_outside": "{mark} steht außerhalb jedes Unterprogramms: es beendet das, in dem es steht",
    "flow.sub_in_sub": "{mark} steht innerhalb von {other} aus Zeile {line}: Unterprogramme stehen "
    "nebeneinander; jenes vorher beenden",
    "flow.label_used": "die Marke von {mark} ist in Zeile {line} vergeben ({other}): in einem Programm, "
    "und in jedem seiner Unterprogramme, hat jede Struktur ihre eigene Marke; eine andere wählen",
    "flow.belongs_nowhere": "{mark} gehört zu keinem o{label} {keyword}: {here}; zuerst beenden, was "
    "zuletzt begann",
    "flow.after_else": "{mark} kommt hinter dem else von o{label}: else ist das letzte",
    "flow.no_loop": "{mark} steht in keiner Schleife o{label}: es nimmt die Marke eines while, do oder "
    "repeat darum; die Marke berichtigen",
    "flow.no_sub_of_these": "es gibt kein Unterprogramm {label}: weder o{label} sub in diesem Programm "
    "noch eine Datei dieses Namens damit im Ordner der Programme (daraus werden {called} gerufen); "
    "ergänzen, oder den Namen berichtigen",
    "flow.no_number_of_these": "es gibt kein O{label}: weder in diesem Programm, hinter seinem M30, noch "
    "als Datei dieses Namens im Ordner der Programme (daraus werden {called} gerufen); ergänzen, oder P "
    "berichtigen",
    "flow.program": "das Programm",
    "flow.text_ends": "der Text endet in Unterprogramm {sub}: M99 an sein Ende schreiben",
    "flow.o_alone": "hinter O steht weder Nummer noch <name>: ein O-Wort ist eine Marke und was sie tut, "
    "etwa o100 sub; berichtigen",
    "flow.open": "{other} aus Zeile {line} ist hier offen",
    "flow.nothing": "hier ist nichts offen",
    # --- line
    "line.turns_in_plane": "{word} steht neben X Y Z in einer geschwenkten Ebene: diese sind Orte am "
    "Werkstück, und das Werkzeug verließe beim Drehen den geraden Weg zwischen ihnen; Drehachswörter in "
    "einen eigenen Satz schreiben, oder G43.4 davor",
    "line.half_a_vector": "{found} ist kein ganzer Werkzeugvektor: unter G43.5 stehen I J K zusammen, "
    "von der Spitze zur Spindel im Werkstücksystem, oder keines davon; alle drei schreiben",
    "line.vector_relative": "{found} ist eine Richtung und kein Weg: Werkzeugvektoren brauchen G90; G90 "
    "davor schreiben",
    "line.no_length": "{found} hat keine Länge: ein Werkzeugvektor zeigt von der Spitze zur Spindel und "
    "darf beliebig lang sein, ab {least:g}; I J K berichtigen",
    # --- feed
    "feed.inverse_without": "{code} unter G93 ohne F: zeitreziprok braucht jeder Satz von G1 bis G3 sein "
    "eigenes F, eins durch die Minuten, die er dauert; F schreiben, oder G94 und den Vorschub je Minute",
    "feed.per_minute_only": "{code} nimmt seinen Vorschub je Minute: zeitreziprok (G93) gilt für G1 bis "
    "G3; G94 davor schreiben",
    "feed.standing": "{code} hat einen Vorschub je Umdrehung (G95), und die Spindel steht: S und M3 "
    "schreiben, oder G94 davor",
    "feed.none": "{code} hat keinen Vorschub: weder hier noch davor steht ein F; F mit dem Vorschub je "
    "Minute schreiben",
    "feed.not_positive": "{word} ist kein Vorschub: F muss größer als 0 sein; berichtigen",
    "feed.range": "{word} ist kein Vorschub: {low} bis {high} je Minute sind einer; berichtigen",
    # --- spindle
    "spindle.too_fast": "{word} ist zu schnell: diese Spindel dreht bis {most:g} 1/min; verringern",
    "spindle.angle": "{word} ist nicht, wo diese Spindel hält: ihr Antrieb bringt sie nur auf {angle:g} "
    "Grad (orient in [io]); R{angle:g} schreiben, oder R weglassen",
    "spindle.direction": "{word} wählt eine Drehrichtung: der Spindelantrieb nimmt seine eigene; P0 "
    "schreiben, oder P weglassen",
    "spindle.no_time": "{word} ist keine Zeit: Q sind die Sekunden, die es dauern darf, über 0 und "
    "höchstens eine Woche; berichtigen",
    "spindle.no_orient": "{code} hat nichts zu stellen: die Maschinendatei hat kein orient in [io], den "
    "Ausgang, der die Spindel auf ihren Winkel bringt, und den Eingang, der es meldet; sie dort eintragen, "
    "oder {instead} schreiben",
    "spindle.bore": "G85, G86 oder G89",
    "spindle.from_below": "die Bewegungen eines Fräsers von unten",
    # --- tool
    "tool.unknown": "{word} nennt kein Werkzeug: in der Werkzeugtabelle stehen {tools}; eines davon "
    "verwenden oder es eintragen",
    "spindle.must_stand": "{code}: mit T{tool} darf die Spindel nicht drehen (ein Taster, oder may_turn = "
    "false): vorher das Werkzeug wechseln oder may_turn = true in seine Tabelle schreiben",
    "tool.none_to_change": "M6 hat kein Werkzeug zum Wechseln: T und seine Nummer davor oder daneben "
    "schreiben",
    "tool.no_pocket": "T{tool} hat keinen Platz im Werkzeugwechsler: ihm einen geben oder ein Werkzeug "
    "mit Platz schreiben: {known}",
    "tool.under_side": "M6 unter G41 oder G42: Das Werkzeug neben der Bahn geht; davor G40 schreiben",
    "tool.m61_changer": "M61 sagt, welches Werkzeug in der Spindel ist, und hier weiß es das Journal des "
    "Wechslers: es an der Maschine bestätigen (directrix changer) oder das Werkzeug mit M6 wechseln",
    "tool.restart_other": "T{found} ist in der Spindel, und hier geht das Programm mit T{wanted} weiter: "
    "zuerst wechseln (T{wanted} M6 von Hand), dann von hier neu starten",
    "tool.restart_inside": "das ist mitten in einem Werkzeugwechsel: mit der Zeile dahinter beginnen",
    "tool.m61": "M61 sagt nicht, welches Werkzeug in der Spindel ist: Q und seine Nummer schreiben, etwa "
    "M61 Q2",
    "tool.length_beside_g49": "{word} steht neben G49, das die Werkzeuglänge aufhebt; H0 schreiben, oder "
    "G43 dazu",
    "tool.no_length": "{code} nimmt {takes}; es schreiben",
    "tool.unknown_here": "{word} nennt kein Werkzeug: in der Werkzeugtabelle stehen {tools}; eines davon "
    "verwenden",
    "tool.no_radius": "{word} lässt kein Werkzeug übrig: sein Radius muss größer als 0 sein; berichtigen",
    "tool.no_wear": "{word} ist kein Verschleiß: das sind {least:g} bis {most:g} mm, und höchstens der "
    "halbe Radius; was weiter verschlissen ist, ist ein anderes Werkzeug: berichtigen, oder Länge und "
    "Radius setzen",
    "tool.takes_z": "Z, die Länge",
    "tool.takes_h": "H, die Nummer eines Werkzeugs",
    "tool.none": "keine",
    "tool.change_beside": "M6 unter G41 oder G42: das Werkzeug, das neben der Bahn ist, geht; G40 davor "
    "schreiben",
    # --- dwell
    "dwell.no_time": "G4 hat keine Zeit: P mit den Sekunden schreiben, die gewartet wird, etwa G4 P0.5",
    "dwell.no_time_of_x": "{word} ist hier keine Zeit von G4: es nimmt P mit den Sekunden, etwa G4 P0.5; P "
    'schreiben, oder dialect = "fanuc" in [machine] setzen, wenn das Programm für eine solche Steuerung ist',
    "dwell.two_times": "{word}: G4 nimmt eine Zeit, P oder X, und hat schon {other}; eines streichen",
    "dwell.too_long": "{word} wartet {hours:.4g} h: {letter} von G4 ist 0 bis {most:.0f} Sekunden, eine "
    "Woche; M0 schreiben, um auf den Bediener zu warten",
    # --- offset
    "offset.not_set": "{name} ist nicht gesetzt, weder unter [offsets] der Maschinendatei noch an der "
    "Maschine; setzen, oder {known} verwenden",
    "offset.number": "{code} nimmt P1 bis P48, die Nummer einer Nullpunktverschiebung; eine davon schreiben",
    "offset.g92_empty": "G92 nennt keine Position: die Achsen schreiben, und was ihre Positionen heißen "
    "sollen",
    "offset.g92_turned": "G92 steht unter G68: die Verschiebung würde mitgedreht; G69 davor schreiben",
    "offset.r_of_l20": "{word} gehört nicht zu G10 L20: R dreht eine Nullpunktverschiebung mit L2; "
    "berichtigen",
    "offset.tilted": "{code} nimmt, wo das Werkzeug steht, und das wird hier in einer geschwenkten Ebene "
    "gesagt und nicht in der Nullpunktverschiebung; G69 davor schreiben",
    "offset.sets_nothing_fanuc": "{word} setzt hier nichts: G10 nimmt L2 P1 bis P6, L20 P1 bis P48 "
    "und L120 P1 bis P9 (Nullpunktverschiebungen), L10 bis L13 P und das Werkzeug mit R, L121 mit Z und R; "
    "eines davon schreiben",
    "offset.sets_nothing": "{word} setzt hier nichts: G10 nimmt L2 und L20 P0 bis P9, L120 P1 bis P9 "
    "(Nullpunktverschiebungen), L1, L121, L10 und L11 P und das Werkzeug mit Z und R; eines davon schreiben",
    # --- surface
    "surface.not_nurbs": "{found}: G6.2 schneidet eine Regelfläche zwischen zwei NURBS-Kurven; es steht "
    "allein mit P und Q, den Ordnungen der oberen und der unteren Kurve, und F, wenn keins modal gilt; "
    "dann kommt, erst für die obere und dann für die untere Kurve, eine Zeile K X Y Z (und R) je "
    "Kontrollpunkt und so viele Zeilen mit K allein wie die Ordnung; genau diese schreiben",
    "surface.nurbs_upside_down": "die obere Kurve dieses G6.2, die erste, liegt unter der unteren, "
    "sodass das Werkzeug kopfstünde; die beiden Kurven tauschen",
    "surface.no_cone": "{found}: G51 schneidet hier einen Kegel und braucht X Y Z I J K H R D und, wenn "
    "keins modal gilt, F; ein G51 mit P ist an anderen Steuerungen Skalieren und geht hier nicht; genau "
    "diese Wörter schreiben",
    "surface.not_ruled": "{found}: G52 braucht 8 Punkte X Y Z, vier der oberen und vier der unteren "
    "Kurve, den ersten neben G52 (mit F) und je einen in den sieben Zeilen danach; alle 8 Punkte schreiben "
    "und nichts dazwischen; ein G52, das Koordinaten verschiebt, hat kein F neben sich und eine Zeile mit "
    "anderen Wörtern hinter sich",
    "surface.or_shift": "{found} ohne F kann eine lokale Verschiebung sein, mit Bewegungen von {motion} "
    "ab Zeile {line}: solange ein G0 bis G3 gilt, ist G52 nur mit F daneben eine Regelfläche, und die "
    "anderen sieben Punkte sind die nächsten Zeilen, nur mit X Y Z; so schreiben, oder, für eine "
    'Verschiebung, G0 oder G1 in die nächste Zeile; unter dialect = "fanuc" verschiebt ein G52 ohne F immer',
    "surface.bad_cone": "{word} ergibt keinen Kegel von G51: {allowed}; berichtigen",
    "surface.upside_down": "die ersten vier Punkte dieses G52, die obere Kurve, liegen unter den letzten "
    "vier, sodass das Werkzeug kopfstünde; die beiden Kurven tauschen",
    "surface.relative": "{code} steht unter G91: seine X Y Z I J K sind absolute Positionen; G90 davor "
    "schreiben",
    "surface.no_tool": "{code} braucht Radius und Länge von Werkzeug T{tool} in der Spindel, aber in der "
    "Werkzeugtabelle stehen {tools}: dort eintragen oder das Werkzeug wechseln",
    "surface.spindle_off": "{code} würde mit stehender Spindel schneiden: S und M3 oder M4 davor schreiben",
    "surface.found": "gefunden: {found}",
    "surface.missing": "{letters} fehlt",
    "surface.ends_after": "das Programm endet nach {count} der 8 Punkte",
    "surface.point": "Punkt {number} des G52 aus Zeile {line}",
    "surface.found_for": "gefunden: {found}, wo {due} stehen muss",
    "surface.missing_in": "es fehlt {letters} von {due}",
    "surface.cone_height": "{word} ergibt keinen Kegel von G51: die Höhe H muss größer als 0 sein; "
    "berichtigen",
    "surface.cone_radius": "{word} ergibt keinen Kegel von G51: der obere Radius R muss 0 (eine Spitze) "
    "oder mehr sein; berichtigen",
    "surface.cone_sweep": "{word} ergibt keinen Kegel von G51: der überstrichene Winkel D darf nicht 0 "
    "sein (positiv ist gegen den Uhrzeigersinn); berichtigen",
    "surface.cone_level": "{word} ergibt keinen Kegel von G51: Anfang Z und Mittelpunkt K müssen auf "
    "einer Höhe liegen; berichtigen",
    "surface.cone_bottom": "{word} ergibt keinen Kegel von G51: der Anfang X Y muss um den unteren "
    "Radius neben dem Mittelpunkt I J liegen; berichtigen",
    "surface.cone_turns": "{word} ergibt keinen Kegel von G51: D überstreicht höchstens {most:.0f} Grad "
    "in jeder Richtung; berichtigen",
    "surface.upper": "oberen",
    "surface.lower": "unteren",
    "surface.order": "{word} ist keine Ordnung der {curve} Kurve: sie ist der Grad + 1, von {least} "
    "(Geraden) bis {most}, und 4 für eine kubische; berichtigen",
    "surface.no_spline": "mit der {curve} Kurve des G6.2 aus Zeile {number} geht es nicht: {bad}; "
    "berichtigen",
    "surface.control_point": "Kontrollpunkt {number} der {curve} Kurve",
    "surface.alone_for": "gefunden: {found} allein, wo {due} stehen muss",
    "surface.too_many": "mehr als {most} Punkte der {curve} Kurve: ein G6.2 nimmt nicht mehr; die Fläche "
    "teilen",
    "surface.knot": "Knoten {count} der {order}, die auf die Punkte der {curve} Kurve folgen",
    "surface.of_nurbs": "{due} des G6.2 aus Zeile {line}",
    "surface.ends_for": "das Programm endet, wo {due} stehen muss",
    # --- position
    "position.unknown": "{what} muss wissen, wo die Achsen stehen, und das wählt hinter einer Fläche "
    "oder einem Werkzeugvektor die Bahn; G0 mit Positionen von X Y Z und den Drehachsen davor schreiben",
    "position.centre": "ein Mittelpunkt unter G90.1",
    "position.polar": "ein Satz mit @ oder ^",
    "position.cycle": "ein Bohrzyklus",
    "position.g68": "G68 ohne seinen Mittelpunkt",
    # --- plane
    "plane.g68_no_angle": "G68 sagt nicht, um wie viel: R und den Winkel in Grad schreiben",
    "plane.not_whole": "{code} P{p} ab Zeile {line} ist nicht vollständig: davon steht vor dieser Zeile "
    "nur {given}; seine weiteren Zeilen dorthin schreiben, nichts dazwischen",
    "plane.no_row": "{code} P{p} hat keine Zeile Q{q}: seine Zeilen sind {known}; eine davon schreiben",
    "plane.row_twice": "{code} P{p} Q{q} steht hier zum zweiten Mal: jede Zeile einmal; eine streichen",
    "plane.letter": "{word} gehört nicht zu {code} P{p}{row}: dazu gehören {letters}; das Wort streichen",
    "plane.origin": "G68.3 hat einen Ursprung ohne {missing}: X Y Z schreiben, oder keines davon für die "
    "Werkzeugspitze",
    "plane.g53_3_relative": "G53.3 nimmt Positionen in der Ebene, und G91 gilt: G90 davor schreiben",
    "plane.none_defined": "{code} dreht das Werkzeug zu einer geschwenkten Ebene, und keine ist "
    "definiert: G68.2 oder G68.3 davor schreiben",
    "plane.no_solution_chosen": "{code} P{p} wählt nichts: P0 ist die nächste Stellung der Drehachsen, "
    "P1 und P2 die positive und die negative der ersten Drehachse; eines davon schreiben",
    "plane.order": "{code} P{p} hat Q{order}: Q ist die Reihenfolge der Achsen, 1 für X, 2 für Y, 3 für "
    "Z, eine von {allowed}; berichtigen",
    "plane.points_on_a_line": "{code} P{p} hat drei Punkte auf einer Geraden oder an einem Ort: jeder "
    "liegt mindestens {least:g} mm neben der Geraden durch die anderen, denn weniger ergibt keine Ebene; "
    "berichtigen",
    "plane.no_length": "{code} P{p} hat einen Vektor längs {axis} ohne Länge: I J K sind seine Richtung; "
    "sie schreiben",
    "plane.not_square": "{code} P{p} hat X und Z der Ebene {off:.4g} Grad auseinander: es sind {low:.4g} "
    "bis {high:.4g} Grad, und X gibt nach, bis es 90 sind; eines davon berichtigen",
    "plane.projected": "{code} P{p} hat projizierte Achsen {apart:g} Grad auseinander, die keine Ebene "
    "ergeben: es sind {low:g} bis {high:g} Grad; I und J berichtigen, oder Eulerwinkel (P0) schreiben",
    "plane.none_rs274": "{code} geht von einer geschwenkten Ebene aus, und keine gilt: G68.2 und G53.1 "
    "davor schreiben",
    "plane.none": "{code} geht von einer geschwenkten Ebene aus, und keine gilt: G68.2 davor schreiben",
    "plane.turned": "{code} steht unter G68, das mitgedreht würde: G69 davor schreiben",
    "plane.waiting": "{code} würde eine Ebene ersetzen, zu der kein G53.1 das Werkzeug gedreht hat: "
    "G53.1 oder G69 davor schreiben",
    "plane.in_a_plane": "{code} steht in einer geschwenkten Ebene: G69 davor schreiben, oder G68.4 für "
    "eine Ebene, die von ihr ausgeht",
    "plane.no_definition": "P{p} ist keine Definition von {code}: unter fanuc sind P0 Eulerwinkel, P1 "
    "Drehungen um X Y Z, P2 drei Punkte, P3 zwei Vektoren, P4 projizierte Winkel; eine davon schreiben",
    "plane.no_definition_rs274": "P{p} ist keine Definition von {code}: unter rs274 sind P0 Eulerwinkel, "
    "P1 Drehungen um X Y Z, P2 drei Punkte, P3 zwei Vektoren; eine davon schreiben",
    "plane.no_rotary": "{code} kann das Werkzeug nicht längs Z dieser Ebene drehen ({i:.6g} {j:.6g} "
    "{k:.6g} auf dem Tisch): es steht längs Z, und keine Achse dieser Maschine dreht es; das Werkstück "
    "schräg spannen, oder eine andere Ebene wählen",
    "plane.no_axis": "{code} kann das Werkzeug nicht längs Z dieser Ebene drehen ({i:.6g} {j:.6g} "
    "{k:.6g} auf dem Tisch): keine Stellung von {names} ergibt diese Werkzeugachse, welchen Verfahrweg sie "
    "auch hätten; das Werkstück schräg spannen, oder eine andere Ebene wählen",
    "plane.p_leaves_none": "{code} kann das Werkzeug nicht längs Z dieser Ebene drehen ({i:.6g} {j:.6g} "
    "{k:.6g} auf dem Tisch): P{p} lässt nichts übrig von {shown}, und der Verfahrweg ist {travel}; P "
    "weglassen",
    "plane.beyond_travel": "{code} kann das Werkzeug nicht längs Z dieser Ebene drehen ({i:.6g} {j:.6g} "
    "{k:.6g} auf dem Tisch): nötig ist {shown}, und der Verfahrweg ist {travel}; das Werkstück schräg "
    "spannen, oder eine andere Ebene wählen",
    "plane.travel": "{axis} {low:.6g} bis {high:.6g}",
    # --- output
    "output.no_level": "auf L{level} wartet M66 nicht: L1 ist eine steigende Flanke, L2 eine fallende, "
    "L3 ein, L4 aus; eines davon verwenden",
    "output.no_time": "M66 L{level} hat keine Zeit: Q mit den Sekunden schreiben, die es dauern darf, "
    "über 0 und höchstens {most:.0f}",
    "output.no_analogue": "{code} hat nichts zu stellen: die Maschinendatei hat kein analogue_out in "
    "[io]; dort eintragen",
    "output.which_analogue": "{found} nennt keinen analogen Ausgang: E und seine Nummer schreiben; es "
    "gibt {known}",
    "output.range": "{name} nimmt Q von {low:g} bis {high:g}; Q und seinen Wert schreiben",
    "output.none": "{code} hat nichts zu stellen: die Maschinendatei hat kein {table} in [io]; dort "
    "eintragen",
    "output.which": "{code} sagt nicht, welcher: P und seine Nummer schreiben; es gibt {known}",
    "output.unknown": "{word} nennt nichts: {table} in [io] der Maschinendatei hat {known}; eines davon "
    "verwenden",
    # --- override
    "override.adaptive": "M52 lässt die Last der Spindel den Vorschub führen, und die Maschinendatei hat "
    "kein adaptive in [spindle]; dort eintragen, wenn der Antrieb seine Last meldet, oder M52 P0 schreiben",
    "override.on_or_off": "{word} ist weder ein noch aus: {code} nimmt P1 oder P0; eines davon schreiben",
    "override.no_feed_stop": "M53 hat nichts zu überwachen: die Maschinendatei hat kein {input} unter "
    "den Eingängen in [io]; dort eintragen, oder M53 weglassen",
    # --- polar
    "polar.no_direction": "{word} ist ein Schritt unter G91 vom Ursprung aus, wo es keine Richtung gibt: "
    "X und Y schreiben, oder G90",
    "polar.dialect": '{word} ist ein Wort von dialect = "rs274"; X und Y schreiben',
    "polar.beside_xy": "{word} steht neben X oder Y, an deren Stelle es ist; das eine oder das andere "
    "schreiben",
    "polar.beside_code": "{word} steht neben {code}: es beendet Geraden, Bögen und Zyklen; X und Y schreiben",
    # --- reference
    "reference.number": "{word} ist kein Referenzpunkt dieser Maschine: sie hat G28 und G30 (P2); einen "
    "davon verwenden",
    "reference.mixed": "{word} ist ein Weg neben Positionen: nur Wege U V W schreiben, oder nur "
    "Positionen X Y Z",
    # --- saved
    "saved.two": "{first} und {word} sichern den modalen Zustand oder geben ihn zurück: ein Satz nimmt "
    "eines von M70 bis M73; zwei Sätze schreiben",
    "saved.none": "M72 hat nichts zurückzugeben: M70 oder M73 sichert den Zustand vorher, im selben "
    "Unterprogramm",
    # --- side
    "side.placement": "{word} ist keine Lage des Fräsers: P von {code} ist 1 (single), 2 (double), 3 "
    "(optimal) oder 4 (auto); eines davon schreiben, oder nichts für die der Maschine",
    "side.allowance": "{word} nimmt {off:g} mm mehr weg als die Fläche: Q von {code} ist, was darauf "
    "stehen bleibt, und unter 0 der Verschleiß des Fräsers, höchstens {most:g} mm; berichtigen",
    "side.tolerance": "{word} ist keine Toleranz: R von {code} ist, wie weit eine Fläche von ihrer Form "
    "abweichen darf, größer als 0; berichtigen, oder für die des Werkzeugs oder der Maschine weglassen",
    # --- curve
    "curve.half": "{lacks} fehlt: {first} und {second} zusammen sind {what}; ergänzen",
    "curve.no_end": "{word} nennt kein Ende: X und Y, oder eines davon, daneben schreiben",
    "curve.too_many": "ein NURBS hat höchstens {most} Punkte; zwei schreiben",
    "curve.too_few": "der NURBS aus Zeile {line} hat mit seinem Anfang {count} Kontrollpunkte: Ordnung "
    "L{order} braucht {order} oder mehr; Punkte ergänzen, oder L senken",
    "curve.unended": "das Programm endet in diesem NURBS: G5.3 hinter seinen letzten Punkt schreiben",
    "curve.surplus": "{word} steht im NURBS aus Zeile {line}: zwischen G5.2 und G5.3 stehen nur "
    "Kontrollpunkte, X Y und P je Zeile, und L; es vor G5.2 oder hinter G5.3 schreiben",
    "curve.half_a_point": "{lacks} fehlt: jeder Kontrollpunkt eines NURBS hat X, Y und sein Gewicht P (1 "
    "ist das gewöhnliche); ergänzen",
    "curve.no_weight": "{word} ist kein Gewicht: P eines NURBS ist größer als 0; berichtigen",
    "curve.no_order": "{word} ist keine Ordnung: sie ist der Grad der Kurve + 1, eine ganze Zahl von "
    "{least} bis {most}; berichtigen",
    "curve.end_with_words": "{word} gehört nicht zu G5.3: es nimmt keine Wörter; streichen",
    "curve.other_axis": "{word} gehört nicht zu {motion}: auf einer Kurve bewegen sich nur X und Y; es "
    "nimmt {takes}; streichen",
    "curve.letter": "{word} gehört nicht zu {motion}: es nimmt {takes}; streichen",
    "curve.end_alone": "{motion} beendet einen NURBS, und keiner hat begonnen: G5.2 und seine Punkte "
    "davor schreiben",
    "curve.plane": "{motion} ist eine Kurve in X und Y, und {plane} gilt: G17 davor schreiben",
    "curve.beside": "{motion} läuft unter {side}: Kurven haben keinen Fräser neben sich; G40 davor schreiben",
    "curve.tip_control": "{motion} gibt es unter Werkzeugspitzensteuerung nicht: G49 davor schreiben, "
    "oder die Kurve als G1-Sätze",
    "curve.to_end": "der Weg vom Ende zum zweiten Kontrollpunkt",
    "curve.to_first": "der Weg vom Anfang zum ersten Kontrollpunkt (ein G5 gleich hinter einem anderen "
    "kommt ohne aus)",
    "curve.to_control": "der Weg vom Anfang zum Kontrollpunkt",
    # --- thread
    "thread.nowhere": "{code} führt nirgendwohin: es ist schon auf dieser Höhe; berichtigen",
    "thread.no_pitch": "{code} hat kein K, die Steigung: den Weg einer Umdrehung; es schreiben, etwa K1.25",
    "thread.pitch": "{word} ergibt eine Steigung von {pitch:.6g} mm: möglich sind {low:g} bis {high:g} "
    "mm; berichtigen",
    "thread.faster": "{word} ist, um wie viel schneller es zurückkommt: über 0, bis {most:.4g}; berichtigen",
    "thread.no_angle": "{code}: hier meldet keine Spindel ihren Winkel: position in [spindle] der "
    "Maschinendatei eintragen, oder das Gewinde fräsen",
    "thread.no_height": "{code} steht ohne {height}, wohin es führt; es schreiben",
    "thread.no_speed": "{code} steht ohne Drehzahl; S davor schreiben",
    "thread.tip_control": "{code} steht unter Werkzeugspitzensteuerung (G43.4, G43.5); G49 davor schreiben",
    "thread.beside_others": "{code} steht neben {other}: ein Gewinde geht nur längs {height}; dafür "
    "einen eigenen Satz schreiben",
    # --- text
    "cycle.tool_off": "T{tool} liegt {off_mm} mm neben seiner Länge in der Tabelle: Es ist ein anderes "
    "Werkzeug oder abgebrochen; das richtige einsetzen oder dieses vermessen",
    "text.abort": "hier beendet sich das Programm selbst: {text!r}",
    "text.percent": "% bezeichnet Anfang und Ende eines Programms und steht allein in seiner Zeile",
    "text.stray": "{found!r} kann hier nicht stehen: eine Zeile besteht aus Wörtern wie X12.5 (ein "
    "Buchstabe und seine Zahl, mit Dezimalpunkt, nicht mit Komma), Parametersetzungen und Kommentaren; "
    "berichtigen oder streichen",
    "text.corner": "eine Fase oder ein Radius einer Ecke (,C oder ,R) wird hier nicht gemacht; die Ecke "
    "als eigene Gerade oder eigenen Bogen schreiben",
    "text.o_inside": "O steht mitten in der Zeile: ein O-Wort (o100 call) steht allein in seiner Zeile; "
    "zwei Zeilen schreiben",
    "text.only_comments": "die Datei enthält nur Leerzeilen und Kommentare: ein Programm braucht "
    "wenigstens ein Wort; das ganze Programm senden",
    "text.only_subs": "in dieser Datei läuft nichts: sie enthält nur Unterprogramme, und keine Zeile ruft "
    "eines; das Programm starten, das {label} ruft",
    "text.empty": "die Datei ist leer: ein Programm braucht wenigstens ein Wort; das ganze Programm senden",
    "text.control_character": "Steuerzeichen 0x{byte:02X} ist kein Programmtext: ein Programm ist reiner "
    "ASCII- oder UTF-8-Text; die Datei noch einmal als reinen Text speichern oder senden",
    "text.unreadable": "Byte 0x{byte:02X} ist kein lesbarer Text: ein Programm ist reiner ASCII- oder "
    "UTF-8-Text; die Datei noch einmal als reinen Text speichern oder senden",
    "text.parenthesis": "diese Klammer hat kein Gegenstück: ein Kommentar reicht von ( bis zur nächsten "
    ") in einer Zeile, ohne weitere ( darin; sie schließen, oder den Kommentar hinter ein ; schreiben",
    # --- probe
    "probe.none": "{code} verlangt einen Taster, und T{tool} ist an dieser Maschine keiner: {known}; ihn "
    "mit T und M6 in die Spindel nehmen, oder [probe] (für Werkzeuge [setter]) in der Maschinendatei "
    "ergänzen",
    "probe.is_tool": "ihr Taster ist T{number}",
    "probe.is_none": "sie hat keinen",
    "probe.turns": "{word} würde das Werkstück beim Antasten drehen: unter {code} stehen die Drehachsen; "
    "streichen",
    "probe.no_way": "{code} hat keinen Weg: dazu gehört X, Y oder Z; schreiben, wohin es höchstens "
    "führen darf",
    "probe.beside": "{code} neben einer Kontur (G41, G42) hat keine Bedeutung; G40 davor schreiben",
    "probe.inverse": "{code} nimmt seinen Vorschub je Minute, denn niemand weiß, wie weit es geht; G94 "
    "davor schreiben",
    "probe.spindle": "{code}: ein Taster darf nicht drehen, und die Spindel dreht; M5 davor schreiben",
    "probe.not_touched": "{code}: der Taster ist am Ende seines Wegs und hat nicht berührt; ihn weiter "
    "führen, oder vorher näher ans Werkstück, oder G38.3 schreiben, das auch ohne weitergeht",
    "probe.not_free": "{code}: der Taster ist am Ende seines Wegs und nicht frei; ihn weiter führen, "
    "oder nach dem Taststift sehen",
    # --- cleared
    "cleared.none": "am Anfang eines Programms gilt keine Bewegungsart",
    "cleared.G51": "es ist überzählig hinter dem ganzen Kegel von G51 in Zeile {line}, der die "
    "Bewegungsart aufhebt",
    "cleared.G52": "es ist ein überzähliger Punkt, denn G52 braucht 8 Punkte X Y Z, das G52 aus Zeile "
    "{line} hat sie und hebt die Bewegungsart auf",
    "cleared.G6.2": "es ist überzählig hinter den zwei ganzen Kurven von G6.2 in Zeile {line}, das die "
    "Bewegungsart aufhebt",
    "cleared.G80": "G80 in Zeile {line} hat die Bewegungsart aufgehoben",
    "cleared.probe": "jede Antastbewegung nennt ihren Code, und die aus Zeile {line} ist getan",
    "cleared.thread": "jedes Gewinde nennt seinen Code, und das aus Zeile {line} ist ganz",
    "cleared.curve": "jede Kurve nennt ihren Code, und die aus Zeile {line} ist ganz",
    # --- foreign
    "foreign.macro": "{line} ist eine Makrozeile wie an Fanuc-Steuerungen; o100 if [...], o100 while "
    "[...] und ihre Enden schreiben",
    "foreign.macro_print": "{line} ist eine Makrozeile wie an Fanuc-Steuerungen; (PRINT, ...) schreiben, "
    "um dem Bediener etwas zu sagen",
    "foreign.okuma_head": "{line} ist der Kopf eines Programms für Okuma; das Teil für Fanuc ausgeben "
    '(dialect = "fanuc"), oder ihn streichen und Nullpunkte und Längen wie Fanuc schreiben (G54, G43)',
    "foreign.okuma_call": "{line} ist der Aufruf eines Unterprogramms von Okuma; M98 und P mit seiner "
    "Nummer schreiben",
    "foreign.okuma_modal": "{line} ist ein modaler Aufruf von Okuma; M98 und P mit seiner Nummer in jede "
    "Zeile schreiben",
    "foreign.okuma_end": "{line} ist das Ende eines Unterprogramms von Okuma; M99 schreiben",
    "foreign.okuma_variable": "{line} ist eine Variable von Okuma; einen Parameter schreiben, etwa "
    "#101=5, und G10 für Nullpunkte",
    "foreign.program": "{line} ist aus einem Programm für {control}, wo Wörter anderes bedeuten: nichts "
    'davon wird gelesen; das Teil für Fanuc (dialect = "fanuc") oder LinuxCNC (dialect = "rs274") '
    "ausgeben, Werkzeugspitzensteuerung als G43.4, geschwenkte Ebenen als G68.2",
    # --- meaning
    "meaning.G54.2.fanuc": "Nullpunkt, der dem Tisch folgt",
    "meaning.G54.4.fanuc": "Aufspannfehler des Werkstücks",
    "meaning.G10.9.fanuc": "Durchmesser (X1) oder Radien (X0)",
    "meaning.G7.rs274": "Durchmesserangabe von Drehmaschinen",
    "meaning.G8.rs274": "Radiusangabe von Drehmaschinen",
    "meaning.G70.rs274": "Schlichten auf Drehmaschinen",
    "meaning.G71.rs274": "Schruppen auf Drehmaschinen längs",
    "meaning.G71.1.rs274": "Schruppen auf Drehmaschinen längs",
    "meaning.G71.2.rs274": "Schruppen auf Drehmaschinen längs",
    "meaning.G72.rs274": "Schruppen auf Drehmaschinen plan",
    "meaning.G72.1.rs274": "Schruppen auf Drehmaschinen plan",
    "meaning.G72.2.rs274": "Schruppen auf Drehmaschinen plan",
    "meaning.G76.rs274": "Gewindedrehen",
    "meaning.G44.rs274": "Länge von Z abgezogen",
    "meaning.G87.rs274": "Rückwärtssenken",
    "meaning.G5.2.fanuc": "NURBS",
    "meaning.G53.3.fanuc": "Werkzeug längs Z der geschwenkten Ebene, mit einer Bewegung",
    "meaning.G7.fanuc": "gedachte Achse",
    "meaning.G12.1.fanuc": "Polarkoordinateninterpolation",
    "meaning.G43.3.fanuc": "Nutatorkopf",
    "meaning.G45.fanuc": "Werkzeugkorrektur einmal dazu",
    "meaning.G46.fanuc": "Werkzeugkorrektur einmal weg",
    "meaning.G47.fanuc": "Werkzeugkorrektur zweimal dazu",
    "meaning.G48.fanuc": "Werkzeugkorrektur zweimal weg",
    "meaning.G51.1.fanuc": "Spiegeln",
    "meaning.G60.fanuc": "Anfahren von einer Seite",
    "meaning.G63.fanuc": "Gewindebohrbetrieb",
    "meaning.G107.fanuc": "Zylinderinterpolation",
    "meaning.M198.fanuc": "Aufruf einer Datei",
    "meaning.G17.1": "Ebene UV",
    "meaning.G18.1": "Ebene WU",
    "meaning.G19.1": "Ebene VW",
    "meaning.G88": "Ausdrehen mit Rückzug von Hand",
    "meaning.G96": "konstante Schnittgeschwindigkeit",
    "meaning.G16": "Polarkoordinaten",
    "meaning.G22": "gespeicherte Hubgrenzen",
    "meaning.G26": "Überwachung der Spindeldrehzahl",
    "meaning.G27": "Prüfen des Referenzpunkts",
    "meaning.G29": "Rückkehr vom Referenzpunkt",
    "meaning.G65.rs274": "Makroaufruf",
    "meaning.G66.rs274": "modaler Makroaufruf",
    "meaning.G12.fanuc": "Kreistasche im Uhrzeigersinn",
    "meaning.G13.fanuc": "Kreistasche gegen den Uhrzeigersinn",
    "meaning.G150.fanuc": "Tasche",
    "meaning.G253.fanuc": "Spindel längs Z der geschwenkten Ebene",
    "meaning.G268.fanuc": "geschwenkte Ebene",
    "meaning.M83.fanuc": "Blasluft",
    "meaning.M88.fanuc": "Kühlmittel durch die Spindel",
    "meaning.M97.fanuc": "Aufruf einer Zeile",
    "meaning.G100.fanuc": "Werkzeugwechsel mit Bewegungen",
    # --- instead
    "instead.G54.2.fanuc": "G43.4 schreiben, das dem gedrehten Werkstück folgt",
    "instead.G54.4.fanuc": "G10 L2 mit dem Ort schreiben, und R für seine Drehung",
    "instead.G10.9.fanuc": "Radien schreiben",
    "instead.G7.rs274": "diese Steuerung hat keine Drehmaschinenachse; Radien schreiben",
    "instead.G8.rs274": "diese Steuerung hat keine Drehmaschinenachse; weglassen",
    "instead.G70.rs274": "diese Steuerung hat keine Drehmaschinenachse; für Zoll G20 schreiben",
    "instead.G71.rs274": "diese Steuerung hat keine Drehmaschinenachse; für Millimeter G21 schreiben",
    "instead.G71.1.rs274": "diese Steuerung hat keine Drehmaschinenachse; für eine Fräsmaschine ausgeben",
    "instead.G71.2.rs274": "diese Steuerung hat keine Drehmaschinenachse; für eine Fräsmaschine ausgeben",
    "instead.G72.rs274": "diese Steuerung hat keine Drehmaschinenachse; für eine Fräsmaschine ausgeben",
    "instead.G72.1.rs274": "diese Steuerung hat keine Drehmaschinenachse; für eine Fräsmaschine ausgeben",
    "instead.G72.2.rs274": "diese Steuerung hat keine Drehmaschinenachse; für eine Fräsmaschine ausgeben",
    "instead.G76.rs274": "das Gewinde mit G2 oder G3 und Z fräsen",
    "instead.G44.rs274": "G43 oder G43.1 mit der Länge schreiben",
    "instead.G87.rs274": 'M19 und die Bewegungen selbst schreiben, oder G87 unter dialect = "fanuc"',
    "instead.G5.2.fanuc": "als G1-Sätze unter G64 P schreiben, oder eine Fläche als G6.2",
    "instead.G53.3.fanuc": "G53.1 schreiben, und G0 in den nächsten Satz",
    "instead.G7.fanuc": "die Bewegungen selbst schreiben",
    "instead.G12.1.fanuc": "X und Y schreiben",
    "instead.G43.3.fanuc": "G43.4 schreiben",
    "instead.G45.fanuc": "G41 oder G42 mit D schreiben",
    "instead.G46.fanuc": "G41 oder G42 mit D schreiben",
    "instead.G47.fanuc": "G41 oder G42 mit D schreiben",
    "instead.G48.fanuc": "G41 oder G42 mit D schreiben",
    "instead.G51.1.fanuc": "die gespiegelten Bewegungen schreiben",
    "instead.G60.fanuc": "davor G0 auf einen Ort schreiben",
    "instead.G63.fanuc": "M49 vor den Schnitt schreiben und M48 dahinter",
    "instead.G107.fanuc": "Wörter der Drehachse schreiben",
    "instead.M198.fanuc": "M98 P schreiben, das auch nach der Datei sucht",
    "instead.G17.1": "diese Steuerung hat keine Achsen U V W; G17 schreiben",
    "instead.G18.1": "diese Steuerung hat keine Achsen U V W; G18 schreiben",
    "instead.G19.1": "diese Steuerung hat keine Achsen U V W; G19 schreiben",
    "instead.G88": "G86 schreiben, oder M0 am Grund",
    "instead.G96": "diese Steuerung hat keine Drehmaschinenachse; G97 und S schreiben",
    "instead.G16": "X und Y schreiben",
    "instead.G22": "der Verfahrweg der Achsen in der Maschinendatei wird immer überwacht",
    "instead.G26": "weglassen",
    "instead.G27": "G28 schreiben",
    "instead.G29": "G0 und die Position schreiben",
    "instead.G65.rs274": "O-Wörter schreiben, etwa o<bohren> call [10] [2], oder dialect fanuc in "
    "[machine] nehmen",
    "instead.G66.rs274": "das Unterprogramm hinter jeder Zeile mit O-Wörtern rufen, oder dialect fanuc in "
    "[machine] nehmen",
    "instead.G12.fanuc": "die Bögen schreiben",
    "instead.G13.fanuc": "die Bögen schreiben",
    "instead.G150.fanuc": "die Bewegungen selbst schreiben",
    "instead.G253.fanuc": "G53.1 schreiben",
    "instead.G268.fanuc": "G68.2 schreiben",
    "instead.M83.fanuc": "in m_codes von [io] einen Ausgang dafür eintragen, oder M7 schreiben",
    "instead.M88.fanuc": "in m_codes von [io] einen Ausgang dafür eintragen, oder M8 schreiben",
    "instead.M97.fanuc": "M98 und P mit der Nummer eines Unterprogramms hinter M30 schreiben",
    "instead.G100.fanuc": "T, M6 und die Bewegungen schreiben",
    # --- spline
    "spline.order": "die Ordnung ist {order}: sie ist {least} bis {most} (Grad + 1)",
    "spline.few_points": "{count} Kontrollpunkte sind zu wenig: Ordnung {order} braucht {order} oder mehr",
    "spline.count_of_knots": "{count} Punkte der Ordnung {order} brauchen {needed} Knoten, gefunden {found}",
    "spline.count_of_weights": "{count} Punkte brauchen {count} Gewichte, gefunden {found}",
    "spline.weight": "das Gewicht ist {weight:g}: jedes Gewicht ist größer als 0",
    "spline.falling": "die Knoten fallen von {a:g} auf {b:g}: sie dürfen nur steigen oder bleiben",
    "spline.near": "die Knoten {a!r} und {b!r} liegen zu nah, um zwei zu sein: sie gleich schreiben oder "
    "weiter auseinander",
    "spline.all_alike": "alle Knoten sind {knot:g}: der letzte muss größer sein als der erste",
    "spline.first_knot": "der erste Knoten {knot:g} steht {times}-mal: Ordnung {order} braucht ihn "
    "{order}-mal, damit die Kurve auf einem Kontrollpunkt beginnt und endet",
    "spline.last_knot": "der letzte Knoten {knot:g} steht {times}-mal: Ordnung {order} braucht ihn "
    "{order}-mal, damit die Kurve auf einem Kontrollpunkt beginnt und endet",
    "spline.inner_knot": "der innere Knoten {knot:g} steht {times}-mal: Ordnung {order} nimmt ihn "
    "höchstens {most}-mal, sonst reißt die Kurve",
    # --- group
    "group.call": "Aufruf",
    "group.centre": "Mittelpunkt",
    "group.coolant": "Kühlmittel",
    "group.distance": "Maßangabe",
    "group.feed": "Vorschub",
    "group.length": "Werkzeuglänge",
    "group.motion": "Bewegung",
    "group.offset": "Nullpunktverschiebung",
    "group.one_line": "satzweise wirksam",
    "group.output": "Ausgang",
    "group.overrides": "Korrekturschalter",
    "group.path": "Bahnsteuerung",
    "group.plane": "Ebene",
    "group.return": "Rückzug",
    "group.rigid": "starres Gewindebohren",
    "group.rotation": "Drehung",
    "group.side": "Werkzeugradiuskorrektur",
    "group.speed": "Drehzahl",
    "group.spindle": "Spindel",
    "group.state": "modaler Zustand",
    "group.stop": "Halt",
    "group.tool_change": "Werkzeugwechsel",
    "group.unit": "Maßeinheit",
}
