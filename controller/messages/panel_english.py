"""The refusals of the panel in English: of store, uploads, access, and of what views ask for."""

from __future__ import annotations

LANGUAGE = "en"

REFUSALS = {
    # --- names of what is meant
    "what.run": "run",
    "what.alarm": "alarm",
    "what.user": "user",
    "what.token": "token",
    "what.program": "program",
    "what.recording": "recording",
    "what.file": "file",
    # --- by what is kept
    "missing": "{what} {name}: there is no such {what}; see the list of {what}s.",
    "exists": "{what} {name}: there is one of this name; remove it first, or take another name.",
    "in_use": "{program}: this program is loaded or running and stays as it is; wait for its end or "
    "unload it, or use another name.",
    "record_gone": "run {number}: its record is gone; choose another run.",
    "no_ticks": "{file}: cannot be read as ticks; choose another recording.",
    "no_page_file": "{name}: the page has no such file; load the page anew.",
    "no_picture": "{program}: it has no picture before its check has passed; wait for it.",
    "picture_gone": "{program}: its picture is gone; upload it again.",
    "no_machine": "No machine has run on this state folder yet; start directrix serve.",
    "store_unusable": "{file}: cannot be used ({why}); check path, permission and space.",
    "store_unread": "{file}: could not be read ({why}); check the disk, or restore a back-up.",
    "store_unwritten": "{file}: could not be written ({why}); check space and permission, then repeat.",
    # --- by a program's name
    "bad_name": "program name {name}: {problem}; allowed: {allowed}; rename it.",
    "allowed_name": 'up to {most} letters, digits, spaces and signs without \\ : * ? " < > | , '
    "with folders before it by /, none beginning with a dot, a minus sign or a space nor ending with a dot "
    "or a space",
    "name.empty": "is empty",
    "name.deep": "lies deeper than {sign} folders",
    "name.gap": "has an empty folder, or an empty name in one",
    "name.long": "is too long",
    "name.holds": "holds {sign}",
    "name.invisible": "holds the invisible sign {sign}",
    "name.begins": "begins with {sign}",
    "name.ends": "ends with {sign}",
    "could_not_check": "{program}: could not be checked: {why}",
    "check_not_started": "{program}: the check could not be started ({why}).",
    "check_without_result": "{program}: the check ended without a result; ask for it again.",
    # --- by an upload
    "draft_busy": "Another text is being read; ask again in a moment.",
    "draft_unread": "{name}: the text could not be read; start directrix serve on this state folder once, "
    "or keep the program and have it checked.",
    "upload_many": "{name}: {most} uploads are under way; wait for one of them to end.",
    "upload_large": "upload: has {size} bytes; allowed are {most}; split the program, or raise the limit "
    "of the panel.",
    "upload_beyond": "upload: is larger than the {most} bytes allowed; split it.",
    "upload_more": "{name}: has more than the {most} bytes that were announced or are allowed; nothing of "
    "it was kept, send it again with its true size.",
    "upload_fewer": "{name}: {came} of {size} bytes came; nothing was kept, repeat.",
    "upload_empty": "{name}: has no bytes; nothing was kept, send the program.",
    "upload_room": "upload: the disk has {left} MB left, of which {kept} MB stay free; delete programs or "
    "recordings, then repeat.",
    "upload_sum": "{name}: what came has sha256 {found}, announced was {wanted}; nothing was kept, send "
    "it again.",
    "upload_slow": "upload: came too slowly; allowed is a pause of {pause:g} s and {pace:g} bytes/s on "
    "average; nothing was kept, send it again.",
    "upload_cut": "upload: was cut off before its end; nothing was kept, send it again.",
    "upload_failed": "{name}: could not be written ({why}); nothing was kept, {remedy}, then repeat.",
    "remedy.full": "delete programs or recordings",
    "remedy.folder": "check the state folder",
    "bad_sum": "sha256 {found}: is no checksum; allowed are 64 hexadecimal digits.",
    # --- by what is asked of the machine
    "no_service": "The machine's service does not answer; start it with directrix serve.",
    "silent_service": "The machine's service is there and gives no answer; look at the machine, then "
    "repeat, or see its log.",
    "no_reason": "The controller's service refused without a reason; see its log.",
    "not_operational": "The machine is not operational: {state}; switch it on at its own page.",
    "no_restart": "A program is not begun anew from a pause; cancel it, then start it.",
    "other_version": "The service's rows are of another version; install service and panel alike.",
    "restart_line": "A restart is where the program was interrupted; give no line with it.",
    "no_reading": "X, Y and Z are all null; give what at least one of them is to read.",
    "no_tip": "Where the tip is, is not known now; start the service's tick first.",
    "tip_not_homed": "{axes} not homed: the position means nothing yet; home first.",
    "no_tool": "Tool {number} is not in the tool table; enter it there first.",
    "many_signals": "{found} signals: at most {most} are shown; ask for fewer.",
    "no_signal": "{name}: there is no such signal; allowed: {allowed}.",
    "many_listeners": "{most} listeners are there; close some of them.",
    # --- by who asks, and from where
    "unknown_token": "This token is not known; make one by POST /api/v1/tokens.",
    "token_expired": "The token {name} has expired; make another one.",
    "not_logged_in": "Nobody is logged in; POST /api/v1/session with name and password, or send a token.",
    "no_csrf": "X-CSRF-Token is missing or wrong; GET /api/v1/session tells this session's.",
    "by_proxy": "The request came through a proxy ({header}), and without users only this computer is "
    "answered; add a user with: directrix users add NAME.",
    "not_local": "The request is not of this computer, and without users only this computer is answered; "
    "add a user with: directrix users add NAME.",
    "foreign_page": "The request comes from a page of {site}; use this server's.",
    "another_site": "another site",
    "users_lost": "{file}: there were users, and the store has lost them: nobody is answered before somebody "
    "adds one again (sudo directrix users add NAME --state {folder}), or restores a copy of the store.",
    "users_lost_some": "There were {were} users, and the store has {are}: look for a copy of it.",
    "store_lost": "{file}: a bad bit has cost the last changes of the store; what is left of them is in "
    "{aside}. Programs without a name are in the folder recovered. Check disk, users and settings.",
    "no_users": "There are no users, so nobody has to log in.",
    "first_user": "There are no users yet; add the first one at the command line: directrix users add NAME.",
    "last_set_up": "user {name}: is the last one who sets up; add another one first.",
    # --- by the form of a request
    "form": "{where}: {what} (found {found}); /openapi.json says what is allowed.",
    "form.other": "{message}",
    "form.missing": "is missing",
    "form.number": "must be a number",
    "form.whole": "must be a whole number",
    "form.least": "must be at least {limit}",
    "form.most": "must be at most {limit}",
    "form.above": "must be more than {limit}",
    "form.below": "must be less than {limit}",
    "form.short": "must have at least {limit} characters",
    "form.long": "must have at most {limit} characters",
    "body_large": "At most {most} bytes are taken here; send less.",
    "no_topic": "{name} is no topic; allowed: {allowed}.",
    # --- by the status alone
    "http.401": "Not logged in, or the log-in ended.",
    "http.403": "The role does not allow it, or the request did not come from this server's own page.",
    "http.404": "There is no such thing.",
    "http.405": "The path does not know this method; Allow says which.",
    "http.408": "The sender fell silent before the end of what it announced; send it again.",
    "http.409": "Not now: mode of the machine, control token, or a name that is taken.",
    "http.413": "Too large.",
    "http.422": "What was sent is not what the schema says.",
    "http.429": "Too often; Retry-After says when again (s).",
    "http.503": "The controller's service does not answer, or the store cannot be used.",
    "http.507": "The disk is full.",
    "request_silent": "The sender fell silent before the end of its request; send all of it again.",
    "request_cut": "What was sent was cut off before its end; send it again.",
    # --- by the queue
    "what.folder": "folder",
    "what.entry": "entry of the queue",
    "queue_full": "The queue has {most} entries, which is the most; take some out first.",
    "queue_empty": "Nothing in the queue is left to run; add a program, or raise a count.",
    "queue_done": "The queue is done.",
    "queue_stopped": "The queue does not go on by itself: hold, stop, emergency stop or drives off was "
    "pressed; "
    "start what is next by hand.",
    "queue_control": "The queue does not go on by itself: whoever chose it holds control no more, or is not "
    "heard of; take control and start what is next by hand.",
    "queue_run": "The queue does not go on by itself: {program} ended ({result}); see to it, then start it "
    "again by hand.",
    "queue_other": "The queue does not go on by itself: the machine is not ready with {program} as it was; "
    "start what is next by hand.",
    # --- by notices
    "notice_url": "webhook: this is no address that can be posted to; allowed is http:// or https:// with a "
    "host, without a user or spaces; set another one.",
    "notice_host": "mail server {host}: is no host; allowed is a name such as mail.example.org "
    "or an address, "
    "without a port; set another one.",
    "notice_address": "mail address {address}: is none; a sender and at least one receiver are needed, as "
    "name@example.org, several by commas; set others.",
    "notice_plain": "A password is not sent unencrypted: choose STARTTLS or TLS, or leave the user empty.",
    "notice_none": "Neither a webhook nor a mail server is set; set one, then try it.",
    "notice_failed": "The notice by {way} was not sent ({why}); check the settings and the "
    "network, then try it.",
    "way.webhook": "webhook",
    "way.mail": "mail",
    "notice.many": "too many are waiting",
    "notice.silent": "the server is silent",
    "notice.unable": "the server has no such encryption or log-in",
    "notice.cut": "the connection ended before the answer",
    "notice_testing": "A test is being sent already; wait for what comes of it.",
    "notice.end": "Program {program} has ended: {result}.",
    "notice.completed": "completed",
    "notice.stopped": "stopped",
    "notice.refused": "refused",
    "notice.fault": "fault",
    "notice.interrupted": "interrupted",
    "notice.lost": "lost",
    "notice.test": "This is a test: notices of the machine come through.",
}
