"""The refusals of the panel in German: of store, uploads, access, and of what views ask for."""

from __future__ import annotations

LANGUAGE = "de"

REFUSALS = {
    # --- names of what is meant
    "what.run": "Lauf",
    "what.alarm": "Meldung",
    "what.user": "Benutzer",
    "what.token": "Token",
    "what.program": "Programm",
    "what.recording": "Aufzeichnung",
    "what.file": "Datei",
    # --- by what is kept
    "missing": "{what} {name}: gibt es nicht; die Liste zeigt, was es gibt.",
    "exists": "{what} {name}: diesen Namen gibt es schon; zuerst entfernen oder einen anderen Namen nehmen.",
    "in_use": "{program}: dieses Programm ist geladen oder läuft und bleibt, wie es ist; das Ende "
    "abwarten, es entladen oder einen anderen Namen nehmen.",
    "record_gone": "Lauf {number}: seine Aufzeichnung ist nicht mehr da; einen anderen Lauf wählen.",
    "no_ticks": "{file}: nicht als Takte lesbar; eine andere Aufzeichnung wählen.",
    "no_page_file": "{name}: diese Datei hat die Seite nicht; die Seite neu laden.",
    "no_picture": "{program}: hat erst ein Bild, wenn die Prüfung bestanden ist; sie abwarten.",
    "picture_gone": "{program}: sein Bild ist nicht mehr da; noch einmal hochladen.",
    "no_machine": "Mit diesem Datenordner lief noch keine Maschine; directrix serve starten.",
    "store_unusable": "{file}: nicht benutzbar ({why}); Pfad, Rechte und Platz prüfen.",
    "store_unread": "{file}: nicht lesbar ({why}); den Datenträger prüfen oder eine Sicherung einspielen.",
    "store_unwritten": "{file}: nicht zu schreiben ({why}); Platz und Rechte prüfen, dann wiederholen.",
    # --- by a program's name
    "bad_name": "Programmname {name}: {problem}; erlaubt: {allowed}; umbenennen.",
    "allowed_name": 'bis zu {most} Buchstaben, Ziffern, Leerzeichen und Zeichen ohne \\ : * ? " < > | , '
    "davor Ordner mit /, keiner mit Punkt, Minus oder Leerzeichen am Anfang oder mit Punkt oder Leerzeichen "
    "am Ende",
    "name.empty": "ist leer",
    "name.deep": "liegt tiefer als {sign} Ordner",
    "name.gap": "hat einen leeren Ordner oder darin einen leeren Namen",
    "name.long": "ist zu lang",
    "name.holds": "enthält {sign}",
    "name.invisible": "enthält das unsichtbare Zeichen {sign}",
    "name.begins": "beginnt mit {sign}",
    "name.ends": "endet mit {sign}",
    "could_not_check": "{program}: konnte nicht geprüft werden: {why}",
    "check_not_started": "{program}: Die Prüfung konnte nicht gestartet werden ({why}).",
    "check_without_result": "{program}: Die Prüfung endete ohne Ergebnis; sie noch einmal verlangen.",
    # --- by an upload
    "draft_busy": "Ein anderer Text wird gerade gelesen; gleich wieder fragen.",
    "draft_unread": "{name}: Der Text konnte nicht gelesen werden; directrix serve einmal mit diesem Ordner "
    "starten, oder das Programm speichern und prüfen lassen.",
    "upload_many": "{name}: {most} Dateien werden gerade hochgeladen; warten, bis eine fertig ist.",
    "upload_large": "Datei: hat {size} Bytes; erlaubt sind {most}; das Programm teilen oder die Grenze "
    "des Panels anheben.",
    "upload_beyond": "Datei: ist größer als die erlaubten {most} Bytes; teilen.",
    "upload_more": "{name}: hat mehr als die {most} Bytes, die angekündigt oder erlaubt sind; nichts "
    "wurde behalten, mit der wahren Größe noch einmal senden.",
    "upload_fewer": "{name}: {came} von {size} Bytes kamen an; nichts wurde behalten, wiederholen.",
    "upload_empty": "{name}: ist leer; nichts wurde behalten, das Programm senden.",
    "upload_room": "Datei: der Datenträger hat noch {left} MB, von denen {kept} MB frei bleiben; "
    "Programme oder Aufzeichnungen löschen, dann wiederholen.",
    "upload_sum": "{name}: was ankam, hat sha256 {found}, angekündigt war {wanted}; nichts wurde "
    "behalten, noch einmal senden.",
    "upload_slow": "Datei: kam zu langsam; erlaubt sind eine Pause von {pause:g} s und im Mittel {pace:g} "
    "Bytes/s; nichts wurde behalten, noch einmal senden.",
    "upload_cut": "Datei: wurde vor ihrem Ende abgeschnitten; nichts wurde behalten, noch einmal senden.",
    "upload_failed": "{name}: nicht zu schreiben ({why}); nichts wurde behalten, {remedy}, dann wiederholen.",
    "remedy.full": "Programme oder Aufzeichnungen löschen",
    "remedy.folder": "den Datenordner prüfen",
    "bad_sum": "sha256 {found}: ist keine Prüfsumme; erlaubt sind 64 hexadezimale Ziffern.",
    # --- by what is asked of the machine
    "no_service": "Der Dienst der Maschine antwortet nicht; ihn mit directrix serve starten.",
    "silent_service": "Der Dienst der Maschine ist da und gibt keine Antwort; nach der Maschine sehen, dann "
    "wiederholen, oder siehe sein Protokoll.",
    "no_reason": "Der Dienst der Steuerung lehnte ohne Grund ab; siehe sein Protokoll.",
    "not_operational": "Die Maschine ist nicht betriebsbereit: {state}; sie an ihrer eigenen "
    "Seite einschalten.",
    "no_restart": "Aus einer Pause wird ein Programm nicht von vorn begonnen; abbrechen, dann starten.",
    "other_version": "Die Takte des Dienstes sind von einer anderen Version; Dienst und Panel gleich "
    "installieren.",
    "restart_line": "Fortgesetzt wird, wo das Programm unterbrochen wurde; keine Zeile dazu angeben.",
    "no_reading": "X, Y und Z sind alle leer; für mindestens eines angeben, was es anzeigen soll.",
    "no_tip": "Wo die Werkzeugspitze ist, ist jetzt nicht bekannt; zuerst den Takt des Dienstes starten.",
    "tip_not_homed": "{axes} nicht referenziert: die Position bedeutet noch nichts; zuerst referenzieren.",
    "no_tool": "Werkzeug {number} ist nicht in der Werkzeugtabelle; zuerst dort eintragen.",
    "many_signals": "{found} Signale: höchstens {most} werden gezeigt; weniger wählen.",
    "no_signal": "{name}: dieses Signal gibt es nicht; erlaubt: {allowed}.",
    "many_listeners": "{most} Zuhörer sind schon da; einige davon schließen.",
    # --- by who asks, and from where
    "unknown_token": "Dieses Token ist nicht bekannt; eines durch POST /api/v1/tokens anlegen.",
    "token_expired": "Das Token {name} ist abgelaufen; ein neues anlegen.",
    "not_logged_in": "Niemand ist angemeldet; POST /api/v1/session mit Name und Passwort, oder ein Token "
    "senden.",
    "no_csrf": "X-CSRF-Token fehlt oder ist falsch; GET /api/v1/session nennt das dieser Anmeldung.",
    "by_proxy": "Die Anfrage kam über einen Proxy ({header}), und ohne Benutzer wird nur diesem Rechner "
    "geantwortet; einen Benutzer anlegen mit: directrix users add NAME.",
    "not_local": "Die Anfrage ist nicht von diesem Rechner, und ohne Benutzer wird nur ihm geantwortet; "
    "einen Benutzer anlegen mit: directrix users add NAME.",
    "foreign_page": "Die Anfrage kommt von einer Seite von {site}; die dieses Servers benutzen.",
    "another_site": "einem anderen Server",
    "users_lost": "{file}: es gab Benutzer, und die Ablage hat sie verloren: niemandem wird geantwortet, bis "
    "wieder einer angelegt (sudo directrix users add NAME --state {folder}) oder eine Kopie der Ablage "
    "zurückgespielt ist.",
    "users_lost_some": "Es gab {were} Benutzer, und die Ablage hat {are}: nach einer Kopie suchen.",
    "store_lost": "{file}: ein falsches Bit hat die letzten Änderungen der Ablage gekostet; was davon übrig "
    "ist, liegt in {aside}. Programme ohne Namen sind im Ordner recovered. Platte, Benutzer und "
    "Einstellungen prüfen.",
    "no_users": "Es gibt keine Benutzer, also muss sich niemand anmelden.",
    "first_user": "Es gibt noch keine Benutzer; den ersten an der Befehlszeile anlegen: directrix users "
    "add NAME.",
    "last_set_up": "Benutzer {name}: ist der letzte, der einrichten darf; zuerst einen anderen anlegen.",
    # --- by the form of a request
    "form": "{where}: {what} (gefunden: {found}); /openapi.json sagt, was erlaubt ist.",
    "form.other": "passt nicht ({message})",
    "form.missing": "fehlt",
    "form.number": "muss eine Zahl sein",
    "form.whole": "muss eine ganze Zahl sein",
    "form.least": "muss mindestens {limit} sein",
    "form.most": "darf höchstens {limit} sein",
    "form.above": "muss größer als {limit} sein",
    "form.below": "muss kleiner als {limit} sein",
    "form.short": "muss mindestens {limit} Zeichen haben",
    "form.long": "darf höchstens {limit} Zeichen haben",
    "body_large": "Hier werden höchstens {most} Bytes genommen; weniger schicken.",
    "no_topic": "{name} ist kein Thema; erlaubt: {allowed}.",
    # --- by the status alone
    "http.401": "Nicht angemeldet, oder die Anmeldung ist beendet.",
    "http.403": "Die Rolle erlaubt es nicht, oder die Anfrage kam nicht von der Seite dieses Servers.",
    "http.404": "Das gibt es nicht.",
    "http.405": "Der Pfad kennt diese Methode nicht; Allow sagt, welche er kennt.",
    "http.408": "Der Absender verstummte vor dem Ende dessen, was er ankündigte; noch einmal schicken.",
    "http.409": "Nicht jetzt: Zustand der Maschine, Bedienung, oder ein Name, der vergeben ist.",
    "http.413": "Zu groß.",
    "http.422": "Was geschickt wurde, ist nicht, was das Schema sagt.",
    "http.429": "Zu oft; Retry-After sagt, wann wieder (s).",
    "http.503": "Der Dienst der Steuerung antwortet nicht, oder die Ablage ist nicht benutzbar.",
    "http.507": "Die Platte ist voll.",
    "request_silent": "Der Sender verstummte vor dem Ende seiner Anfrage; sie ganz noch einmal senden.",
    "request_cut": "Was gesendet wurde, brach vor dem Ende ab; noch einmal senden.",
    # --- by the queue
    "what.folder": "Ordner",
    "what.entry": "Eintrag der Warteschlange",
    "queue_full": "Die Warteschlange hat {most} Einträge, mehr gehen nicht; erst einige herausnehmen.",
    "queue_empty": "In der Warteschlange steht nichts mehr an; ein Programm anfügen oder eine Anzahl "
    "erhöhen.",
    "queue_done": "Die Warteschlange ist fertig.",
    "queue_stopped": "Die Warteschlange geht nicht von selbst weiter: Halt, Stopp, Not-Halt oder Antriebe "
    "aus "
    "wurde gedrückt; das nächste Programm von Hand starten.",
    "queue_control": "Die Warteschlange geht nicht von selbst weiter: Wer das wählte, hat das Steuerrecht "
    "nicht "
    "mehr oder ist nicht zu hören; das Steuerrecht nehmen und das nächste Programm von Hand starten.",
    "queue_run": "Die Warteschlange geht nicht von selbst weiter: {program} ist zu Ende ({result}); "
    "nachsehen, dann von Hand neu starten.",
    "queue_other": "Die Warteschlange geht nicht von selbst weiter: Die Maschine ist nicht mehr mit "
    "{program} "
    "bereit; das nächste Programm von Hand starten.",
    # --- by notices
    "notice_url": "Webhook: Das ist keine Adresse, an die gesendet werden kann; erlaubt ist http:// oder "
    "https:// mit einem Rechner, ohne Benutzer und Leerzeichen; eine andere eintragen.",
    "notice_host": "Mailserver {host}: ist kein Rechner; erlaubt ist ein Name wie mail.example.org oder eine "
    "Adresse, ohne Port; einen anderen eintragen.",
    "notice_address": "Mailadresse {address}: ist keine; nötig sind ein Absender und "
    "mindestens ein Empfänger, als "
    "name@example.org, mehrere mit Komma; andere eintragen.",
    "notice_plain": "Ein Passwort wird nicht unverschlüsselt gesendet: STARTTLS oder TLS wählen oder den "
    "Benutzer leer lassen.",
    "notice_none": "Weder ein Webhook noch ein Mailserver ist eingetragen; einen eintragen, dann probieren.",
    "notice_failed": "Die Nachricht per {way} wurde nicht gesendet ({why}); Einstellungen und "
    "Netz prüfen, dann "
    "probieren.",
    "way.webhook": "Webhook",
    "way.mail": "Mail",
    "notice.many": "es warten zu viele",
    "notice.silent": "der Server schweigt",
    "notice.unable": "der Server kann diese Verschlüsselung oder Anmeldung nicht",
    "notice.cut": "die Verbindung endete vor der Antwort",
    "notice_testing": "Eine Probe wird schon gesendet; abwarten, was daraus wird.",
    "notice.end": "Das Programm {program} ist zu Ende: {result}.",
    "notice.completed": "fertig",
    "notice.stopped": "gestoppt",
    "notice.refused": "abgelehnt",
    "notice.fault": "Störung",
    "notice.interrupted": "unterbrochen",
    "notice.lost": "verloren",
    "notice.test": "Das ist ein Versuch: Nachrichten der Maschine kommen an.",
}
