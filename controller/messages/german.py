"""Die Texte der Störungen und Ablehnungen auf Deutsch: the texts of the faults and refusals in German."""

from __future__ import annotations

from controller.faults import Fault, Reaction, Recovery, Words

LANGUAGE = "de"
NAME = "Deutsch"

FRAMES = {
    "cause": "Ursache: {cause}",
    "remedy": "Abhilfe: {remedy}",
    "trusted": "Die Position gilt noch.",
    "untrusted": "Die Position gilt nicht mehr: vor dem nächsten Programm referenzieren.",
    "position": "Position",
    "yes": "gilt",
    "no": "verloren",
    "stands": "steht in {ms} ms",
    "title": "Störungen von {machine}",
    "unread": (
        "Mit dieser Maschinendatei wurden die Antriebe noch nicht in Betrieb genommen: Ihre "
        "eigenen Halte stehen hier, wie die Datei sie nennt, nicht wie gelesen."
    ),
    "read": ("Die eigenen Halte der Antriebe, gelesen am {at}: {stops}."),
}

CLASSES = {
    Reaction.NONE: "",
    Reaction.WARN: "Warnung",
    Reaction.END_OF_BLOCK: "Halt am Satzende",
    Reaction.HOLD: "Halt auf der Bahn",
    Reaction.PATH_STOP: "Stopp auf der Bahn",
    Reaction.LOST_DRIVE: "Stopp auf der Bahn ohne den verlorenen Antrieb",
    Reaction.QUICK_STOP: "Schnellhalt",
    Reaction.DISABLE: "Schnellhalt, dann aus",
}

RECOVERIES = {
    Recovery.NOTHING: "nichts zu tun",
    Recovery.RESUME: "fortsetzen",
    Recovery.RESET: "zurücksetzen, freigeben",
    Recovery.HOME: "zurücksetzen, referenzieren, freigeben",
    Recovery.COMMISSION: "zurücksetzen, in Betrieb nehmen, referenzieren, freigeben",
    Recovery.RESTART: "Steuerung neu starten",
}

_TELL = "mit der Aufzeichnung melden, denn die Planung hätte langsamer fahren müssen."

FAULTS: dict[Fault, Words] = {
    Fault.NONE: Words("Keine Störung.", "Keine.", "Nichts zu tun."),
    # --- plan
    Fault.PLANNER_GONE: Words(
        "Die Planung ist beendet oder schwieg länger als 2 s; das Werkzeug fährt bis zum Ende des Geplanten "
        "und ruht dort auf der Bahn.",
        "Der Prozess der Planung endete oder bekam keine Rechenzeit: kein Speicher mehr, zu viel Last.",
        "Zurücksetzen, einschalten, längs der Werkzeugachse freifahren, das Programm neu laden.",
    ),
    Fault.TRAVEL: Words(
        "Der nächste Sollwert liegt außerhalb des Verfahrwegs einer Achse; er wurde nicht gesendet.",
        "Nullpunkt oder Werkzeuglänge sind nicht die, mit denen das Programm geprüft wurde.",
        "Nullpunkt und Werkzeuglänge prüfen, dann das Programm prüfen.",
    ),
    Fault.VELOCITY: Words(
        "Der nächste Sollwert verlangt von einer Achse mehr als ihre Geschwindigkeit; er wurde nicht "
        "gesendet.",
        "Ein Fehler der Planung, oder ein Programm, das ungeprüft gestartet wurde.",
        f"Das Programm prüfen; {_TELL}",
    ),
    Fault.ACCELERATION: Words(
        "Der nächste Sollwert verlangt von einer Achse mehr als ihre Beschleunigung; er wurde nicht "
        "gesendet.",
        "Ein Fehler der Planung, oder ein Programm, das ungeprüft gestartet wurde.",
        f"Das Programm prüfen; {_TELL}",
    ),
    Fault.BRANCH_LOST: Words(
        "Die Drehachsen erreichen die nächste Werkzeugachse nicht; es wurde nichts gesendet.",
        "Die Werkzeugachse verlässt den Kegel, den die beiden Drehachsen erreichen.",
        "Das Programm prüfen; mit der Aufzeichnung melden.",
    ),
    # --- drives
    Fault.FEEDBACK_LOST: Words(
        "Ein Antrieb hat seine Position zweimal nacheinander nicht gemeldet.",
        "Ein loser Stecker, ein fehlender oder dritter Abschlusswiderstand, ein zu voller Bus, oder ein "
        "Antrieb ohne Versorgung.",
        "Kabel, Abschluss und Buslast prüfen; zurücksetzen, neu in Betrieb nehmen und die Achse "
        "referenzieren.",
    ),
    Fault.STATE_LOST: Words(
        "Ein Antrieb hat den Zustand Operation Enabled von selbst verlassen.",
        "Seine eigene Überwachung hat abgeschaltet: Versorgung, Temperatur, Last oder Freigabeeingang.",
        "Fehlercode des Antriebs lesen, Ursache beseitigen, zurücksetzen und die Achse referenzieren.",
    ),
    Fault.TORQUE_OFF: Words(
        "Ein Antrieb hat ohne Fehler sein Drehmoment verloren (STO oder Freigabeeingang).",
        "Der Sicherheitskreis ging auf, oder eine Ader von STO oder Freigabe ist lose.",
        "Sicherheitskreis schließen, nachsehen, wo das Werkzeug steht, zurücksetzen und freigeben.",
    ),
    Fault.FOLLOWING_ERROR: Words(
        "Die Achse ist nicht, wo sie sein soll: Ihr Schleppfehler ist größer als ihr Fenster.",
        "Eine Kollision, eine schwergängige oder gebremste Achse, Sollwerte, die den Antrieb nicht "
        "erreichen, ein schlecht eingestellter Antrieb, oder ein zu kleines Fenster.",
        "Nach Kollision, schwergängiger Achse, losem Buskabel oder zu kleinem Fenster suchen; zurücksetzen "
        "und die Achse referenzieren.",
    ),
    Fault.SETPOINTS_LOST: Words(
        "Ein Antrieb meldet, dass seine Sollwerte ausbleiben (EMCY 8250h).",
        "Ein loses Buskabel, ein gestörter oder überlasteter Bus, oder ein Antrieb, der die Kennung filtert.",
        "Kabel, Abschluss und Fehlerzähler des Busses prüfen; zurücksetzen.",
    ),
    Fault.LIMIT_SWITCH: Words(
        "Ein Antrieb lief auf einen Endschalter; seine Position ist also eine andere als angenommen "
        "(EMCY 8612h).",
        "Am falschen Ort referenziert, ein zu langer Verfahrweg in der Maschinendatei, oder eine "
        "gebrochene Ader des Schalters.",
        "Die Achse vom Schalter fahren, zurücksetzen und referenzieren, dann Verfahrweg und Referenzpunkt "
        "prüfen.",
    ),
    Fault.EMCY: Words(
        "Ein Antrieb hat eine Notfallmeldung (EMCY) gesendet.",
        "Die eigene Überwachung des Antriebs; sein Fehlercode sagt, welche.",
        "Den Fehlercode des Antriebs nachschlagen, Ursache beseitigen, zurücksetzen und die Achse "
        "referenzieren.",
    ),
    Fault.DRIVE_WARNING: Words(
        "Ein Antrieb warnt (Statuswort Bit 7); er arbeitet weiter.",
        "Temperatur, Last oder Versorgung nähern sich dem, was der Antrieb erlaubt.",
        "Fehlercode und Verlauf des Antriebs lesen; Temperatur und Last ansehen, bevor er abschaltet.",
    ),
    Fault.HEARTBEAT_LOST: Words(
        "Der Heartbeat eines Antriebs blieb aus, oder er antwortet nicht auf Node Guarding.",
        "Der Antrieb hat keine Versorgung, sein Kabel ist lose, oder seine Firmware hängt.",
        "Versorgung und Kabel des Antriebs prüfen; zurücksetzen, neu in Betrieb nehmen und die Achse "
        "referenzieren.",
    ),
    Fault.NODE_RESET: Words(
        "Ein Antrieb startete neu; seine Einstellungen sind weg.",
        "Ein Einbruch seiner Versorgung, oder ein anderer Master am Bus, der Knoten zurücksetzt.",
        "Versorgung des Antriebs prüfen; zurücksetzen, neu in Betrieb nehmen und die Achse referenzieren.",
    ),
    Fault.NODE_STOPPED: Words(
        "Ein Antrieb wurde aus NMT Operational genommen und hört keine Sollwerte.",
        "Ein anderer Master oder ein Werkzeug am Bus hält Knoten an, oder der Antrieb selbst nach einem "
        "Fehler.",
        "Suchen, wer noch NMT sendet; zurücksetzen, neu in Betrieb nehmen und die Achse referenzieren.",
    ),
    Fault.NODE_TWICE: Words(
        "Zwei Antriebe antworten unter einer Knotennummer: Wessen Position es ist, ist nicht zu sagen.",
        "Ein Antrieb wurde getauscht oder ergänzt, dessen Nummer schon ein anderer hat.",
        "Jedem Antrieb eine eigene Nummer geben (directrix drives scan); zurücksetzen, neu in Betrieb nehmen "
        "und alle Achsen referenzieren.",
    ),
    Fault.MODE_LOST: Words(
        "Ein Antrieb verließ die Betriebsart, in der Sollwerte kommen (6061h).",
        "Jemand schrieb sein Objekt 6060h: ein Werkzeug des Herstellers oder ein anderer Master am Bus.",
        "Das andere Werkzeug vom Bus nehmen; zurücksetzen und neu in Betrieb nehmen.",
    ),
    Fault.ENABLE_TIMEOUT: Words(
        "Ein Antrieb hat Operation Enabled nicht rechtzeitig erreicht.",
        "Keine Motorversorgung, STO ist offen, oder ein Fehler steht noch an.",
        "Versorgung, Freigabeeingang und Fehlercode des Antriebs prüfen; zurücksetzen und erneut freigeben.",
    ),
    Fault.HOMING_FAILED: Words(
        "Ein Antrieb meldete einen Fehler der Referenzfahrt oder beendete sie nicht.",
        "Referenzschalter oder Nullimpuls wurden nicht gefunden, oder die Achse steht auf der falschen "
        "Seite.",
        "Referenzschalter und Referenzierart prüfen; zurücksetzen und erneut referenzieren.",
    ),
    # --- bus
    Fault.BUS_OFF: Words(
        "Der CAN-Controller ist im Zustand Bus-Off: kein Befehl erreicht einen Antrieb.",
        "Ein Kurzschluss, ein fehlender Abschluss, zwei Bitraten an einem Bus, oder starke Störungen.",
        "Verdrahtung, Abschluss und Bitrate prüfen; zurücksetzen, neu in Betrieb nehmen und referenzieren.",
    ),
    Fault.BUS_ERROR: Words(
        "Der CAN-Bus meldete einen Fehler (Error Passive, ein Überlauf, oder der Verteiler ist weg).",
        "Niemand bestätigt (Antriebe aus, Kabel offen), Störungen, oder ein schlechter Schirm.",
        "Verdrahtung, Abschluss und Bitrate prüfen; zurücksetzen, neu in Betrieb nehmen und referenzieren.",
    ),
    Fault.RX_OVERFLOW: Words(
        "Telegramme gingen verloren, weil die Steuerung sie nicht rechtzeitig abholte.",
        "Der Rechner war anderweitig beschäftigt, oder ein Knoten flutet den Bus.",
        "Den Rechner entlasten; nach einem Knoten suchen, der zu viel sendet; zurücksetzen.",
    ),
    Fault.SYNC_FOREIGN: Words(
        "Jemand anderes sendet SYNC auf dem Bus: Antriebe nähmen Sollwerte zur falschen Zeit.",
        "Ein Antrieb oder eine andere Steuerung ist als SYNC-Erzeuger eingestellt.",
        "Den zweiten SYNC-Erzeuger suchen (Objekt 1006h jedes Knotens) und abschalten; zurücksetzen.",
    ),
    Fault.FOREIGN_FRAMES: Words(
        "Jemand anderes sendet unter Kennungen der Steuerung: Sollwerte oder ihren Heartbeat.",
        "Eine andere Steuerung, oder ein Werkzeug, das Telegramme abspielt, ist am Bus.",
        "Es vom Bus nehmen; zurücksetzen.",
    ),
    Fault.SEND_FAILED: Words(
        "Ein Telegramm ließ sich nicht senden: die Sendewarteschlange ist voll, oder der Bus ist weg.",
        "Niemand bestätigt, die Schnittstelle ist abgeschaltet, oder ihre Warteschlange ist zu kurz.",
        "Bus, Buslast und txqueuelen prüfen; zurücksetzen, neu in Betrieb nehmen und referenzieren.",
    ),
    Fault.SYNC_LOST: Words(
        "Das SYNC des Kernels kam nicht rechtzeitig zurück.",
        "Der Bus steht, oder die Uhr des Kernels wurde aufgehalten.",
        "Den Bus prüfen; in der Maschinendatei sync auf tick setzen; neu starten und referenzieren.",
    ),
    # --- tick
    Fault.TOO_MANY_SKIPS: Words(
        "Zu viele Takte kamen zu spät; das Werkzeug hielt auf der Bahn.",
        "Andere Programme belegten den Rechenkern, oder der Rechner spart in den Pausen Strom.",
        "Den Rechner entlasten oder eine längere Periode wählen; zurücksetzen und weitermachen.",
    ),
    Fault.STOP_OVERDUE: Words(
        "Ein Stopp auf der Bahn dauerte länger als jeder Stopp dürfte; die Antriebe hielten mit eigener "
        "Rampe.",
        "Ein Fehler der Planung.",
        f"Das Programm prüfen; {_TELL}",
    ),
    Fault.INTERNAL: Words(
        "Im Takt trat ein eigener Fehler auf; die Antriebe wurden angehalten.",
        "Ein Fehler in der Steuerung.",
        "Mit der Aufzeichnung melden; neu starten und referenzieren.",
    ),
    Fault.CONTROLLER_GONE: Words(
        "Der Prozess des Takts ist weg; die Antriebe hielten durch ihre eigene Überwachung.",
        "Jemand hat ihn beendet, der Speicher ging aus, oder sein Wächter hat ihn beendet.",
        "Herausfinden, was ihn beendete, neu starten und referenzieren.",
    ),
    # --- operator, safety, peripherals
    Fault.EMERGENCY_STOP: Words(
        "Ein Nothalt wurde angefordert.",
        "Jemand hat ihn verlangt, auf der Seite oder durch ein Skript.",
        "Die Maschine sichern, zurücksetzen, freigeben; das Werkzeug hat die Bahn verlassen: vor dem Start "
        "freifahren.",
    ),
    Fault.ESTOP_INPUT: Words(
        "Der Not-Halt-Kreis ist offen.",
        "Ein Taster ist gedrückt, eine Schutztür offen, oder eine Ader des Kreises lose.",
        "Die Maschine sichern, den Kreis schließen, zurücksetzen, freigeben; vor dem Start freifahren.",
    ),
    Fault.POWER_LOST: Words(
        "Die Leistungsversorgung der Antriebe ist weg.",
        "Das Hauptschütz fiel ab, eine Sicherung hat ausgelöst, oder das Netz fiel aus.",
        "Versorgung wiederherstellen; zurücksetzen, neu in Betrieb nehmen und referenzieren.",
    ),
    Fault.DOOR_OPEN: Words(
        "Die Tür ist offen.",
        "Jemand hat sie geöffnet, oder ihr Schalter ist lose.",
        "Die Tür schließen und fortsetzen.",
    ),
    Fault.SPINDLE_NOT_AT_SPEED: Words(
        "Die Spindel hat ihre Drehzahl nicht rechtzeitig erreicht.",
        "Last von Anfang an, eine Drehzahl über der möglichen, oder ein zu kurzes spin_up_s.",
        "Spindelantrieb, seine Last und das S-Wort prüfen; fortsetzen.",
    ),
    Fault.SPINDLE_LAGS: Words(
        "Die Spindel folgt dem Gewinde nicht: Sie hängt um mehr als most_lag_rev nach oder schwingt.",
        "Ein stumpfer Bohrer, Späne im Loch, eine Drehzahl oder Beschleunigung über der möglichen.",
        "Das Werkzeug steht im Gewinde, im Gleichlauf mit der Spindel. Fortsetzen oder herausdrehen.",
    ),
    Fault.SPINDLE_OVERLOADED: Words(
        "Die Last der Spindel lag zu lange bei overload_percent oder darüber.",
        "Ein stumpfer oder gebrochener Fräser, ein zu schwerer Schnitt oder ein Spänestau.",
        "Fräser und Schnitt ansehen: zurückziehen, ein stumpfes Werkzeug wechseln; zurück, dann fortsetzen.",
    ),
    Fault.LOAD_UNKNOWN: Words(
        "Der Spindelantrieb meldet seine Last nicht mehr: Adaptiver Vorschub ist auf min_share gegangen.",
        "Telegramme des Antriebs fehlen, oder er wurde neu eingerichtet.",
        "Nichts wurde angehalten. Bus und Antrieb prüfen; M52 P0 oder der Schalter beendet ihn.",
    ),
    Fault.SPINDLE_LOST: Words(
        "Der Spindelantrieb schweigt, hat einen Fehler oder ist nicht freigegeben.",
        "Überlast, keine Versorgung, oder ein loses Kabel.",
        "Werkzeug freifahren, Fehlercode des Spindelantriebs lesen, Ursache beseitigen, zurücksetzen.",
    ),
    Fault.CLAMP: Words(
        "Eine Klemmung, einer Achse oder des Werkzeugs, ist nicht so, wie sie sein muss.",
        "Keine Luft oder kein Öl, ein klemmendes Ventil, oder ein verstellter Schalter.",
        "Luft, Ventil und Schalter der Klemmung prüfen; zurücksetzen.",
    ),
    Fault.COOLANT_LOST: Words(
        "Das Kühlmittel fließt nicht.",
        "Ein leerer Tank, ein verstopfter Filter, eine Pumpe, die steht, oder ein loser Strömungswächter.",
        "Kühlmittel auffüllen oder frei machen, dann fortsetzen.",
    ),
    Fault.INPUT_MISSING: Words(
        "Der Eingang, auf den M66 oder M19 wartet, kam nicht rechtzeitig.",
        "Was er meldet, ist nicht geschehen, eine Ader ist lose, oder Q ist zu kurz.",
        "Nach dem sehen, was der Eingang meldet; Fortsetzen wartet noch einmal, Stopp beendet das Programm.",
    ),
    Fault.PROBE_OPEN: Words(
        "Der Taster ist offen oder berührt schon: Er wird nicht zum Werkstück geführt.",
        "Der Taststift liegt an oder klemmt, die Batterie ist leer oder die Leitung gebrochen.",
        "Den Taster freimachen, seinen Eingang ansehen und fortsetzen; oder das Programm abbrechen.",
    ),
    Fault.PROBE_FREE: Words(
        "Der Taster ist schon frei: Es gibt nichts, wovon er wegzuführen wäre.",
        "G38.4 oder G38.5 ohne eine Berührung davor.",
        "Das Programm abbrechen und berichtigen, oder das Werkstück berühren und fortsetzen.",
    ),
    Fault.PROBE_HIT: Words(
        "Der Taster hat außerhalb einer Tastbewegung berührt.",
        "Etwas steht einer Positionierbewegung im Weg, oder der Taststift ist lose.",
        "Zurücksetzen, den Taster freifahren, den Stift ansehen, Programm oder Nullpunkt berichtigen.",
    ),
    Fault.PROBE_STUCK: Words(
        "Der Taster berührt noch immer: Mit ihm wird nichts bewegt.",
        "Der Taststift klemmt, der Weg vom Werkstück ist falsch, oder der Eingang bleibt an.",
        "Zurücksetzen, den Taster freimachen, von Hand freifahren und seinen Eingang ansehen.",
    ),
    Fault.PROBE_LATCH: Words(
        "Ein Antrieb, der sich bewegt hat, hat keine Position der Berührung gespeichert.",
        "Das Signal des Tasters kommt am Antrieb nicht an, oder dessen Messtasterfunktion ist aus.",
        "Zurücksetzen, Leitung und Objekt 60B8h ansehen und neu in Betrieb nehmen.",
    ),
    Fault.IO_LOST: Words(
        "Der Knoten mit den Eingängen für Tür und Not-Halt schweigt, startete neu oder hat einen Fehler.",
        "Seine Versorgung brach ein, sein Kabel ist lose, oder seine Firmware hängt.",
        "Versorgung und Kabel prüfen; zurücksetzen (beim nächsten Start wird er neu in Betrieb genommen).",
    ),
}

REFUSALS = {
    "text": "{text}",
    "of_axis": "Achse {axis}: {text}",
    "also": "Außerdem: {text} {remedy}",
    # --- by the machine's mode
    "refused": "{request} ist in {mode} abgelehnt: {why}",
    "known": "{now}; {way_out} ({request} gilt in {modes}).",
    "or": "{one} oder {other}",
    "now.OFF": "die Antriebe sind aus",
    "now.READY": "die Maschine ist bereit, und kein Programm läuft",
    "now.RUNNING": "ein Programm läuft",
    "now.HOLD": "ein Programm ist angehalten",
    "now.STOPPING": "die Maschine kommt zum Stillstand",
    "now.FAULT": "eine Störung ist nicht zurückgesetzt",
    "now.HOMING": "Achsen suchen ihren Nullpunkt",
    "now.JOG": "Achsen werden von Hand verfahren",
    "way_out.OFF": "zuerst freigeben",
    "way_out.READY": "zuerst die Antriebe ausschalten",
    "way_out.RUNNING": "stoppen oder das Ende abwarten",
    "way_out.HOLD": "zuerst fortsetzen oder stoppen",
    "way_out.STOPPING": "warten, bis sie steht",
    "way_out.FAULT": "zuerst ihre Ursache beseitigen und zurücksetzen",
    "way_out.HOMING": "warten, bis sie ihn haben, oder stoppen",
    "way_out.JOG": "das Verfahren beenden und warten, bis sie stehen",
    "nothing_to.HOLD": "es gibt nichts anzuhalten",
    "nothing_to.RESUME": "es gibt nichts fortzusetzen",
    "nothing_to.STOP": "es gibt nichts zu stoppen",
    "nothing_to.RESET": "es gibt nichts zurückzusetzen",
    "nothing_to.ENABLE": "die Antriebe sind schon an",
    "not_homed": "{axes}: vor dem Start eines Programms zu referenzieren; zuerst referenzieren.",
    "some_axes": "einige Achsen",
    "away": "das Werkzeug hat die Stelle verlassen, an der das Programm angehalten ist; zuerst zurückfahren.",
    "moves": "die Achsen bewegen sich noch; warten, bis sie stehen.",
    "press_ended": "Das Tippen wurde gestoppt; Taste loslassen und neu drücken.",
    # --- by what the service does, or has
    "aside": "das Werkzeug steht abgehoben neben der Bahn; zuerst zurückfahren.",
    "other_tools": "seither wurden andere Werkzeuge eingesetzt; das Programm stoppen und den Rest starten.",
    "no_fault": "Es gibt keine Störung zurückzusetzen.",
    "running": "{program} läuft; stoppen oder das Ende abwarten.",
    "not_in_table": "In der Werkzeugtabelle gibt es kein T{number}.",
    "not_loaded": "Kein Programm ist geladen; zuerst eines laden.",
    "still_loading": "{program} wird noch gelesen und geprüft; warten, bis es geladen ist, oder stoppen.",
    "not_ready": "{program} wurde nicht geladen und kann nicht starten. {why}",
    "no_why": "Der Grund ist nicht bekannt; siehe das Protokoll von directrix serve.",
    "not_held": "{request} ist in {mode} abgelehnt: das Programm anhalten und warten, bis es steht.",
    "not_retracted": "{request} ist in {mode} abgelehnt: das Programm anhalten, oder zurücksetzen und "
    "einschalten, und warten, bis die Achsen stehen.",
    "retract_room": "Um {mm:g} mm kann das Werkzeug nicht abheben: von hier liegen längs seiner Achse "
    "{room:.3f} mm im Verfahrweg; mehr als 0 und höchstens so viel verlangen.",
    "ended_short": "{request} endete nach {gone:.3f} von {mm:.3f} mm; die Ursache suchen, dann den Rest "
    "verlangen.",
    "not_set_here": "{name}: weder an der Maschine noch von einem Programm gesetzt; siehe directrix offsets.",
    "not_fitted": "Die {what} werden in {mode} nicht geändert; zuerst stoppen.",
    "tool_change": "T{number}{name} in die Spindel einsetzen, dann das Programm fortsetzen.",
    "tool_out": "Das Werkzeug aus der Spindel nehmen, dann das Programm fortsetzen.",
    "offsets": "Nullpunkte",
    "tools": "Werkzeuge",
    "under_way": "{request}: {other} ist im Gang; das Ende abwarten oder stoppen.",
    "stopped": "Es wurde gestoppt, bevor es begann.",
    "by_now": "Die Maschine ist inzwischen in {mode}.",
    "ended_in": "{request} endete in {mode}.",
    "not_all_homed": "{axes}: nicht referenziert; die Antriebe ansehen.",
    "waited": "{seconds:.0f} s vergeblich gewartet: {what}.",
    "first_tick": "auf den ersten Takt",
    "answer": "auf die Antwort des Takts",
    "enabled": "auf die Freigabe der Antriebe",
    "switched_off": "auf das Ausschalten der Antriebe",
    "standstill": "auf den Stillstand",
    "end_of_run": "darauf, dass der Lauf als beendet gilt",
    "end_of_fault": "auf das Ende der Störung",
    "start_taken": "darauf, dass der Start angenommen wird",
    "end_of_way": "auf das Ende des Weges von der Bahn oder zurück",
    "plan_silent": "Der Planer schickt nichts mehr vom Programm: das Werkzeug kommt in {seconds:.1f} s "
    "auf der Bahn zur Ruhe, wenn er nicht wieder schickt.",
    "tick_stands": "Der Prozess des Takts steht seit {seconds:.1f} s still: so alt ist, was gezeigt wird, "
    "und Antriebe, die ihn nicht hören, halten von selbst; nachsehen, was ihn aufhält.",
    "no_tick": "Der Prozess des Takts läuft nicht; Zurücksetzen anfordern.",
    "no_plan": "Die Planung ist weg und wird neu gestartet; noch einmal anfordern.",
    "not_taken": "Der Takt nimmt das Programm nicht an; die Antriebe freigeben und erneut anfragen.",
    "busy_tick": "Der Takt nimmt keine Anforderungen an; ist der Rechner überlastet?",
    # --- at the service's door
    "no_object": "Eine Anfrage ist ein JSON-Objekt von höchstens {most} Bytes; verbessern.",
    "no_verb_or_args": 'Eine Anfrage hat ein "verb" (Text) und "args" (ein Objekt); verbessern.',
    "long_request": "{verb}: {bytes} Bytes sind zu viel für eine Anfrage; einen Pfad schicken.",
    "stranger": "Dieser Benutzer darf {path} nicht benutzen; in die Gruppe aufnehmen, der der Socket gehört.",
    "many_peers": "{path} hat {most} Benutzer, mehr bedient er nicht; noch einmal versuchen.",
    "started_anew": "{path}: Der Dienst der Maschine wurde neu gestartet, bevor er antwortete; nach der "
    "Maschine sehen: Ob {verb} ausgeführt wurde, ist nicht bekannt.",
    "silent_door": "{path}: Der Dienst der Maschine ist da und gibt keine Antwort ({why}); noch einmal "
    "versuchen.",
    "no_answer_within": "keine Antwort binnen {seconds:g} s",
    "own_error": "Der Dienst traf auf einen eigenen Fehler; das bitte melden: {error}",
    # --- weshalb der Takt einen Teil des Plans nicht annimmt
    "queue.NONE": "Der letzte Teil des Plans wurde angenommen.",
    "queue.OLD": "Ein älterer Teil des Plans kam noch einmal und wurde ausgelassen.",
    "queue.VOID": "Ein Teil des Plans kam mit einem Halt, der die Warteschlange ungültig macht, und wurde "
    "ausgelassen.",
    "queue.MODE": "Die Maschine nimmt Bewegung nur in READY, RUNNING und HOLD an; einschalten und das "
    "Programm neu starten.",
    "queue.EPOCH": "Ein Teil des Plans war für eine Warteschlange, die inzwischen aufgegeben ist; der Plan "
    "beginnt neu, wo das Werkzeug steht.",
    "queue.STOPPING": "Das Werkzeug verlässt den Plan zum Stillstand; von dort geht der Plan weiter.",
    "queue.EMPTY": "Ein Teil des Plans enthielt keine Bewegung; anhalten, das Programm neu laden und dies "
    "melden.",
    "queue.LATE": "Ein Teil des Plans kam zu spät, um zu ersetzen, was läuft; das Werkzeug fährt bis zum "
    "Ende dessen, was ansteht. Bleibt das so, hat der Rechner zu wenig Zeit: ihn entlasten.",
    "queue.GAP": "Ein Teil des Plans beginnt nach dem Ende dessen, was ansteht; anhalten, das Programm neu "
    "laden und dies melden.",
    "queue.UNKNOWN_MOTION": "Ein Teil des Plans gehört zu einer Bewegung, die nie kam; anhalten, das "
    "Programm neu laden und dies melden.",
    "queue.UNREACHABLE": "Die Achsen können den Ort nicht einnehmen, an dem der Plan beginnt; anhalten, die "
    "Achsen von Hand wegfahren und neu starten.",
    "queue.ELSEWHERE": "Der Plan beginnt neben dem Ort, an dem die Achsen stehen, deshalb bewegt sich "
    "nichts; anhalten und das Programm von dort neu starten.",
    "queue.JUMP": "Der Plan geht an einem anderen Ort weiter, als die Warteschlange dann ist; anhalten, das "
    "Programm neu laden und dies melden.",
    # --- what became of a program
    "given_up": "{verb} wurde aufgegeben.",
    "service_ended": "Der Dienst wurde beendet.",
    "service_gone": "Der Dienst der Steuerung ist weg; dies sind seine letzten Werte. Herausfinden, was ihn "
    "beendete, ihn neu starten und referenzieren.",
    "stands_before": "Das Werkzeug steht auf der Bahn vor diesem Satz.",
    "beside": "Nach der Zählung der Antriebe kam das Werkzeug {off_mm:.3f} mm neben der Bahn bei Zeile "
    "{line} zur Ruhe, seine Achse um {off_deg:.3f} Grad gedreht. Es zuerst von Hand entlang seiner Achse "
    "zurückziehen.",
    "journal_unread": "{file}: Das Journal ist nicht lesbar ({why}); stattdessen an einer Zeile starten.",
    "file_damaged": "{file}: nicht lesbar ({why}); sie liegt dort jetzt als {aside}, und wird neu begonnen. "
    "Die Platte prüfen, und vor dem nächsten Start Referenz und Werkzeuge.",
    "journal_of_other_version": "{file}: ist kein Journal dieser Version; das Programm stattdessen an einer "
    "Zeile starten.",
    # --- by what was interrupted
    "interrupted": "{program} wurde bei Zeile {line} durch das Ende des Dienstes der Steuerung unterbrochen; "
    "dort fortsetzen oder ein Programm laden.",
    "not_interrupted": "Kein Programm ist unterbrochen; eines von vorn oder ab einer Zeile starten.",
    "changed": "{program} kann ab Zeile {line} nicht fortgesetzt werden: seit der Unterbrechung geändert: "
    "{what}; die Änderung rückgängig machen oder nach eigenem Urteil ab einer Zeile starten.",
    "and": "{one} und {other}",
    "the_program": "das Programm",
    "the_machine_file": "die Maschinendatei",
    "a_work_offset": "ein Nullpunkt",
    "lost": "{program} kann ab Zeile {line} noch nicht fortgesetzt werden: die Maschine weiß nicht, wo ihre "
    "Achsen sind; zuerst alle referenzieren.",
    "not_stored": "{program} liegt nicht mehr so vor, wie es unterbrochen wurde; noch einmal hochladen oder "
    "ein anderes starten.",
    # --- where a program is entered: no refusal, but read before it is started from there
    "at.place": "Zeile {line}, {percent} % des Satzes ({what}).",
    "at.tool": "Werkzeug T{tool}, Nullpunkt {offset}, Länge nach G43 {length} mm.",
    "at.sized_tool": "Werkzeug T{tool} (Radius {radius} mm, Länge {long} mm), Nullpunkt {offset}, "
    "Länge nach G43 {length} mm.",
    "at.tilted": "Geschwenkte Ebene, gesehen vom Tisch in Null: Ursprung {origin}, X längs {x}, Z längs {z}.",
    "at.spindle": "Spindel {rev_min} 1/min, Kühlmittel {coolant}, Vorschub {feed}.",
    "at.outputs": "Ausgänge {outputs}.",
    "at.entry": "Einfahrt entlang der Werkzeugachse nach {joints}.",
    "at.none": "keiner",
    "at.off": "aus",
    "at.mist": "Nebel",
    "at.flood": "Schwall",
    "at.mist_and_flood": "Nebel und Schwall",
    "at.way.cut": "Schnitt",
    "at.way.line": "Gerade",
    "at.way.arc": "Bogen",
    "at.way.curve": "Kurve",
    "at.way.pause": "Pause",
    "at.way.swivel": "Schwenken",
    "at.way.pivot": "Schwenken am Stoß",
    "at.way.plunge": "Eintauchen",
    "at.way.lead in": "Einlauf",
    "at.way.lead out": "Auslauf",
    "at.way.link": "Übergang",
    # --- by who asks
    "control_held": "{holder} hat die Bedienung; um Rückgabe bitten oder sie übernehmen durch "
    '{{"take_over": true}}.',
    "no_control": "{holder} hat die Bedienung; sie durch POST /api/v1/control nehmen und als "
    "X-Control-Token mitsenden.",
    "nobody": "Niemand",
    "late": "Verlangt wurde es bei Takt {seen}, jetzt ist Takt {now}: höchstens {most} s dürfen dazwischen "
    "liegen; erneut drücken, falls noch gewünscht.",
    "role": "{name} hat die Rolle {has}; nötig ist {needs}; wer Benutzer einrichtet, kann helfen.",
    "too_often": "Zu viele falsche Passwörter; in {seconds:.0f} s noch einmal versuchen.",
    "wrong_password": "Name oder Passwort ist falsch; noch einmal versuchen.",
    # --- by what was sent
    "no_verb": "{verb}: gibt es nicht; erlaubt sind {allowed}.",
    "no_axes": "axes {axes}: erlaubt ist eine Liste aus {allowed}, oder null für alle.",
    "no_alarm": "Die Meldung {number} gibt es nicht; die Liste der Meldungen abfragen.",
    "not_number": "{name} {value!r}: muss eine Zahl von {lowest:g} bis {highest:g} sein; berichtigen.",
    "not_whole": "{name} {value!r}: muss eine ganze Zahl ab 0 sein; berichtigen.",
    "not_switch": "{name} {value!r}: muss true oder false sein; berichtigen.",
    "spindle_must_stand": "Mit T{tool} darf die Spindel nicht drehen (ein Taster, oder may_turn = false): "
    "zuerst das Werkzeug wechseln oder may_turn = true in seine Tabelle schreiben.",
    "no_spindle": "Die Steuerung treibt an dieser Maschine keine Spindel an; sie an der Maschine schalten.",
    "no_adaptive": "Adaptiver Vorschub ist an dieser Maschine nicht eingerichtet; adaptive in [spindle] "
    "ihrer Datei eintragen.",
    "no_output": "{name}: einen solchen Ausgang hat die Maschinendatei nicht; unter [io] outputs eintragen.",
    "no_clamp": "{axis}: keine Achse mit Klemmung; möglich sind {allowed}.",
    "jog_share": "Die Geschwindigkeit ist {share:g}; sie ist ein Anteil von -1 bis 1 und nicht 0.",
    "jog_distance": "Der Weg ist {distance:g}; mm (bei Rundachsen Grad) ungleich 0 angeben.",
    "jog_frame": "In {frame!r} kann nicht verfahren werden; erlaubt sind {allowed}.",
    "jog_letter": "{frame!r} hat keine Achse {axis!r}; erlaubt sind X, Y und Z.",
    "jog_not_homed": "{frame!r} ist erst bekannt, wenn {axes} referenziert ist; referenzieren oder in "
    "'joint' verfahren.",
    "jog_limit": "{axis} bewegt sich nicht: die Achse steht an ihrer Softwaregrenze von {limit:g} {unit}; in "
    "die andere Richtung verfahren.",
    "jog_axis": "Die Maschine hat keine Achse {axis!r}; erlaubt sind {allowed}.",
    "no_line": "fraction {fraction:g}: von welcher Zeile? Auch line angeben.",
    "no_text": "text: muss eine Programmzeile von höchstens {most} Zeichen sein.",
    "too_large": "{path}: ist größer als {most} MB; das Programm teilen.",
    "unreadable": "{path}: nicht lesbar ({why}); das Programm noch einmal hochladen.",
    "not_written": "{path}: nicht zu schreiben ({why}).",
    "unrecorded": "{program} ist nicht gestartet, denn dieser Lauf wird nicht aufgezeichnet und kann nicht "
    "fortgesetzt werden: {why}. Platz auf dem Datenträger schaffen oder den Lauf ohne Aufzeichnung "
    "bestätigen.",
    "worn": "{program} ist nicht gestartet: Das Werkzeug in der Spindel, T{number}, ist verschlissen "
    "({cut:.1f} min im Schnitt, {parts} Teile). Es wechseln und als neu melden oder bestätigen, dass es "
    "weiter schneidet.",
    "in_thread": "Das Werkzeug steht in einem Gewinde, {depth:.2f} mm tief bei {pitch:g} mm Steigung "
    "(Zeile {line}): zuerst herausdrehen, oder melden, dass es draußen ist.",
    "probe_cycle": "cycle {found!r}: einen solchen Messzyklus gibt es nicht; erlaubt sind {allowed}.",
    "probe_value": "values {name!r}: {cycle} hat keinen solchen Wert; erlaubt sind {allowed}.",
    "probe_choice": "values {name} {found!r}: erlaubt sind {allowed}.",
    "probe_number": "values {name} {found!r}: muss {lowest:g} bis {highest:g} {unit} sein; ändern.",
    "probe_length": "values {name} {found!r}: muss {lowest:g} bis {highest:g} {unit} und nicht 0 sein; "
    "ändern.",
    "no_drawing": "{found!r}: kein Code, von dem es ein Bild gibt; es gibt {allowed}.",
    "no_touches": "Der Taster hat noch nichts berührt; zuerst antasten.",
    "probe_offset": "offset {found!r}: kein Nullpunkt, den ein Zyklus setzt; erlaubt sind {allowed}.",
    "no_changer": "Diese Maschine hat keinen Werkzeugwechsler: Ihre Werkzeuge werden von Hand gewechselt; "
    "einen in [changer] beschreiben.",
    "changer_unknown": "Wo die Werkzeuge des Wechslers sind, ist noch nicht bestätigt: Spindel und "
    "alle Plätze "
    "ansehen und es bestätigen (directrix changer confirm, oder auf der Seite).",
    "change_interrupted": "Ein Werkzeugwechsel (T{out} weg, T{into} hinein; 0 ist kein Werkzeug) wurde im "
    "Schritt {step} unterbrochen.",
    "change_carried": "T{tool} war in Arbeit: Es ist in der Spindel, auf Platz {pocket} oder dazwischen.",
    "change_spindle": "Zu Beginn dieses Schritts war T{tool} in der Spindel.",
    "change_spindle_empty": "Zu Beginn dieses Schritts war die Spindel leer.",
    "changer_confirm": "Spindel, Arm und Plätze ansehen, was im Weg steht, mit Tippen oder von Hand "
    "bewegen und "
    "dann bestätigen, wo die Werkzeuge sind; bis dahin bewegt sich nichts außer durch Tippen.",
    "change_broken": "Ein Werkzeugwechsel wurde unterbrochen.",
    "change_under_way": "{request} wird in {mode} abgelehnt: Ein Werkzeugwechsel läuft; ihn fortsetzen oder "
    "stoppen.",
    "change_not_kept": "Der Werkzeugwechsel hält hier an, denn sein Journal lässt sich nicht "
    "schreiben: {why}.",
    "change_out_of_step": "Der Werkzeugwechsel hält hier an: Seine Schritte kommen nicht in ihrer "
    "Reihenfolge. "
    "Bestätigen, wo die Werkzeuge sind.",
    "change_other_tool": "Der Werkzeugwechsel beginnt nicht: T{found} ist in der Spindel, geplant war er für "
    "T{wanted}; das Programm neu laden.",
    "change_not_there": "Der Werkzeugwechsel beginnt nicht: T{tool} ist nicht auf Platz {pocket}; es "
    "einsetzen "
    "und bestätigen.",
    "change_taken": "Der Werkzeugwechsel beginnt nicht: Platz {pocket}, auf den T{tool} gehört, ist "
    "nicht frei; "
    "bestätigen, wo die Werkzeuge sind.",
    "change_late": "{fails} Schritt {number} von {steps} des Werkzeugwechsels, {step}, endet nicht.",
    "change_worn": "T{number} soll in die Spindel und ist verschlissen ({cut:.1f} min und {way:.1f} m im "
    "Schnitt, {parts} Teile): ihm eine neue Schneide geben und es melden; Fortsetzen nimmt es, wie es ist.",
    "change_sister": "Stopp, und ein Start ab dieser Zeile bringt sein Schwesterwerkzeug T{sister}.",
    "prepare_late": "{fails} Schritt {number} von {steps} zum Bereitstellen von T{tool}, {step}, endet "
    "nicht; der Schnitt geht weiter.",
    "prepare_late_do": "M6 wartet darauf: was klemmt, lösen, oder den Lauf stoppen und bestätigen, wo die "
    "Werkzeuge sind.",
    "prepare_interrupted": "T{tool} wurde bereitgestellt, als alles endete, im Schritt {step}: Sein Platz "
    "kann überall auf dem Weg stehen.",
    "change_late_do": "Fortsetzen wartet noch einmal; Stopp beendet den Wechsel, dann wird bestätigt, wo die "
    "Werkzeuge sind.",
    "changer_not_clear": "clear: bestätigen, dass Sie nachgesehen haben und Arm und Magazin die "
    "Spindel nicht "
    "berühren.",
    "changer_no_tool": "T{tool} steht nicht in der Werkzeugtabelle; erlaubt sind {allowed}, für die Spindel "
    "auch 0.",
    "changer_twice": "T{tool} kann nicht in der Spindel und außerhalb der Maschine sein.",
    "pockets": "Plätze",
    "not_in_thread": "Das Werkzeug steht in keinem Gewinde: Es gibt nichts herauszudrehen.",
    "thread_unknown": "Wie das Werkzeug im Gewinde steht, war nicht zu lesen: von Hand herausdrehen, dann "
    "melden, dass es draußen ist.",
    "no_sister": "T{tool} hat keine Schwester T{value}: ein anderes Werkzeug der Tabelle, oder null für "
    "keine.",
    "tool_worn": "T{number} ist verschlissen ({cut:.1f} min und {way:.1f} m im Schnitt, {parts} Teile): "
    "wechseln und als neu melden.",
    "maintenance_due": "Wartung ist fällig: {name} (alle {every:g} {unit}). Ausführen und "
    "als erledigt melden.",
    "no_counter": "Zähler {counter}: gibt es nicht; erlaubt sind {allowed}.",
    "no_item": "Wartung {name}: gibt es nicht; eine mit Intervall anlegen.",
    "no_item_name": "name: muss ein Text aus 1 bis {most} sichtbaren Zeichen sein.",
    "many_items": "Es gibt {most} Wartungen, mehr gehen nicht; erst eine herausnehmen.",
    "little_room": "{folder} hat {free} MB frei, und {needed} MB sind nötig",
    "not_recorded": "{program} läuft, wird aber nicht aufgezeichnet: {why}. "
    "Platz auf dem Datenträger schaffen.",
    "record_ended": "Die Aufzeichnung von {program} endet vor dem Lauf: {why}. Was bis jetzt kam, ist "
    "erhalten; Platz auf dem Datenträger schaffen.",
    "other_sum": "{path}: sha256 ist {found}, nicht {wanted}; das Programm noch einmal hochladen.",
}
