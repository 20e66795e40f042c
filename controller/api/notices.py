"""Notices for whoever is not at the machine: alarms, ends of programs, tool changes asked for.

    watch  ->  what is new  ->  for each way a short queue and a thread that sends

A server that hangs holds up no request, no event, not the other way and not the machine. What is sent is
tried ``TRIES`` times and then given up; what came of the last one, by each way, is kept to be shown.
"""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import queue
import smtplib
import socket
import ssl
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from email.message import EmailMessage
from typing import Any
from urllib.parse import urlsplit

from controller import messages
from controller.api import notice_settings
from controller.api.answers import Refusal
from controller.api.database import StoreError
from controller.api.notice_settings import NoticeSettings
from controller.api.past import Past
from controller.api.service_client import Watch
from controller.api.store import Store
from controller.messages import Key, Message, from_facts, message, plain, reason
from controller.store.history import TYPED, Alarm, History, Run

POLL_S = 1.0
TRIES = 3
PAUSES_S = (5.0, 30.0)  # between them
MAX_WAITING = 100
MAX_NEW = 20  # alarms, or runs, of one look; the rest is in the lists


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of the last notice by one way."""

    at_s: float
    sent: bool
    why: Message | None = None  # it was not


class Notices:
    """``run`` looks for ever what is new, ``send`` puts a notice on every way that is set."""

    def __init__(self, store: Store, watch: Watch, past: Past) -> None:
        self._store, self._watch, self._past = store, watch, past
        self._asked: Any = None  # the tool change that was reported
        self._testing = False
        self.ways = {name: Way(name, self.settings) for name in SENDERS}

    def settings(self) -> NoticeSettings:
        """As they are now. Raises StoreError."""
        return notice_settings.load(self._store.settings)

    @property
    def outcomes(self) -> dict[str, Outcome]:
        """Of the last notice, by way."""
        return {name: way.last for name, way in self.ways.items() if way.last}

    # -- what is new

    async def run(self) -> None:
        """Never ends."""
        while True:
            await self.look()
            await asyncio.sleep(POLL_S)

    async def look(self) -> None:
        """Send what is new; nothing is asked of the machine where nobody wants to know. Raises StoreError."""
        settings = await asyncio.to_thread(self.settings)
        if not settings.is_enabled:
            await asyncio.to_thread(notice_settings.mark_sent, self._store.marks, None)
            return
        for notice in await self._past.ask_if_there(lambda past: self._new_notices(settings, past)) or ():
            self.send(notice)
        if settings.tool_change:
            await self._look_at_tool()

    def _new_notices(self, settings: NoticeSettings, past: History) -> list[Notice]:
        """Notices of alarms and runs that came since the last look, also while this process did not run."""
        alarms, runs = past.alarms(MAX_NEW), past.runs(MAX_NEW)
        newest = (alarms[0].id if alarms else 0, runs[0].id if runs else 0)
        known = notice_settings.mark_sent(self._store.marks, newest) or newest
        told = [of_alarm(one) for one in alarms[::-1] if settings.alarms and one.id > known[0]]
        ends = [one for one in runs[::-1] if one.id > known[1] and one.program != TYPED]
        return [*told, *(of_run(one) for one in ends if settings.program_end)]

    async def _look_at_tool(self) -> None:
        with contextlib.suppress(Refusal):  # a service that is away asks for nothing
            status = await self._watch.status()
            asked = status.get("tool_change") or status.get("spindle_change")
            if asked and asked != self._asked and (words := from_facts(asked)) is not None:
                self.send(Notice("tool_change", time.time(), words, {"tool": asked.get("number")}))
            self._asked = asked

    # -- sending

    def send(self, notice: Notice) -> None:
        """Put it on the way; where too many wait it is lost, and that is shown."""
        for way in self.ways.values():
            way.send(notice)

    async def test(self, settings: NoticeSettings) -> None:
        """One by every way that is set, once, past what waits. Raises Refusal while another one is sent."""
        if self._testing:
            raise Refusal.of(409, "busy", "notice_testing")
        self._testing = True
        try:
            notice = Notice("test", time.time(), message("notice.test"))
            wanted = [self.ways[name] for name in ways(settings)]
            await asyncio.gather(*(asyncio.to_thread(way.deliver, notice, settings) for way in wanted))
        finally:
            self._testing = False

    def end(self) -> None:
        """What is not sent by now is not sent; a server that hangs keeps nobody waiting."""
        for way in self.ways.values():
            way.end()


class Way:
    """One way, with what waits for it."""

    def __init__(self, name: str, settings: Callable[[], NoticeSettings]) -> None:
        self.name, self._settings = name, settings
        self.last: Outcome | None = None
        self._waiting: queue.Queue[Notice | None] = queue.Queue(MAX_WAITING)
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def send(self, notice: Notice) -> None:
        """Put it on the way."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name=self.name, daemon=True)
            self._thread.start()
        try:
            self._waiting.put_nowait(notice)
        except queue.Full:
            self._note(Key("notice.many"))

    def deliver(self, notice: Notice, settings: NoticeSettings) -> Outcome:
        """One try, here and now; it takes as long as its way lets it."""
        try:
            send(self.name, notice, settings)
        except Exception as error:  # whatever the library makes of a bad server
            return self._note(why_not(error))
        return self._note(None)

    def end(self) -> None:
        self._ended.set()
        with contextlib.suppress(queue.Full):
            self._waiting.put_nowait(None)

    def _work(self) -> None:
        while (notice := self._waiting.get()) is not None and not self._ended.is_set():
            with contextlib.suppress(StoreError):  # it is said to whoever asks for it
                settings = self._settings()
                if self.name in ways(settings):
                    self._try(notice, settings)

    def _try(self, notice: Notice, settings: NoticeSettings) -> None:
        for pause_s in (*PAUSES_S[: TRIES - 1], None):
            if self.deliver(notice, settings).sent or pause_s is None or self._ended.wait(pause_s):
                return

    def _note(self, why: Message | str | None) -> Outcome:
        told = None if why is None else message("notice_failed", way=Key(f"way.{self.name}"), why=why)
        self.last = Outcome(time.time(), why is None, told)
        return self.last


def of_alarm(alarm: Alarm) -> Notice:
    facts = {"name": alarm.name, "axis": alarm.axis or None}
    told = from_facts({"key": alarm.key, "values": alarm.values})
    return Notice("alarm", alarm.at_s, told or plain(alarm.sentence), facts)


def of_run(run: Run) -> Notice:
    words = message("notice.end", program=run.program, result=in_words(run.result))
    facts = {"program": run.program, "result": run.result, "run": run.id}
    return Notice("program_end", run.ended_s, words, facts)


def in_words(result: str) -> str:
    """Of a run."""
    key = f"notice.{result}"
    return Key(key) if key in messages.of("en").texts else result


def changed(old: NoticeSettings, new: Mapping[str, Any]) -> NoticeSettings:
    """With what was sent; null stays, but no password goes to another server than it was set for."""
    found = replace(old, **{name: value for name, value in new.items() if value is not None})
    other = found.host != old.host and new.get("password") is None
    return replace(found, password="") if other else found


# The two ways a notice goes: JSON posted to a webhook, and mail.
#
# No way takes longer than ``WHOLE_S``, also where a server drips its answer byte by byte. What went wrong is
# told without the server's own words, which may repeat what they were sent.

SILENT_S = 10.0  # of a server, before it is given up
WHOLE_S = 30.0  # from the first byte to the last


@dataclass(frozen=True, slots=True)
class Notice:
    """What is sent."""

    event: str  # 'alarm', 'program_end', 'tool_change', 'test'
    at_s: float  # seconds since 1970
    said: Message
    facts: Mapping[str, Any] = field(default_factory=dict)

    def text(self, settings: NoticeSettings) -> str:
        """In the language that was chosen, on one line."""
        return " ".join(messages.text(self.said, settings.language).split())


class NotTaken(Exception):
    """A webhook answered with another status than success; ``status`` is it."""

    def __init__(self, status: int) -> None:
        super().__init__(status)
        self.status = status


def ways(settings: NoticeSettings) -> list[str]:
    """Those that are set."""
    return [way for way, there in (("webhook", settings.webhook), ("mail", settings.host)) if there]


def send(way: str, notice: Notice, settings: NoticeSettings) -> None:
    """Raises whatever the library makes of a bad server; ``why`` says it."""
    SENDERS[way](notice, settings)


def _post(notice: Notice, settings: NoticeSettings) -> None:
    """As JSON; ``text`` is what chat servers show. Another place that the server names is not gone to."""
    told = {"event": notice.event, "at_s": notice.at_s, "text": notice.text(settings)}
    told |= {**notice.said, **notice.facts}
    headers = {"Content-Type": "application/json", "User-Agent": "Directrix"}
    url = urlsplit(settings.webhook)
    kind = _Https if url.scheme == "https" else _Http
    with contextlib.closing(kind(url.hostname, url.port, timeout=SILENT_S)) as server:
        path = (url.path or "/") + (f"?{url.query}" if url.query else "")
        server.request("POST", path, json.dumps(told), headers)
        if not 200 <= (status := server.getresponse().status) < 300:
            raise NotTaken(status)


def _mail(notice: Notice, settings: NoticeSettings) -> None:
    mail = EmailMessage()
    mail["Subject"], mail["From"] = f"Directrix: {notice.text(settings)}"[:200], settings.sender
    mail["To"] = ", ".join(settings.receivers)
    mail.set_content(f"{messages.text(notice.said, settings.language)}\n")
    with _server(settings) as server:
        if settings.security == "starttls":
            server.starttls(context=ssl.create_default_context())
        if settings.user:
            server.login(settings.user, settings.password)
        if refused := server.send_message(mail):
            raise smtplib.SMTPRecipientsRefused(refused)


def _server(settings: NoticeSettings) -> smtplib.SMTP:
    if settings.security == "tls":
        trusted = ssl.create_default_context()
        return _SmtpTls(settings.host, settings.port, timeout=SILENT_S, context=trusted)
    return _Smtp(settings.host, settings.port, timeout=SILENT_S)


SENDERS: dict[str, Callable[[Notice, NoticeSettings], None]] = {"webhook": _post, "mail": _mail}


# ---- connections that end in time
#
# The libraries' own time-out is that of one read: a byte every nine seconds keeps them for ever.


class _Bounded:
    sock: socket.socket | None

    def __init__(self, *where: Any, **how: Any) -> None:
        self._end = threading.Timer(WHOLE_S, self._cut)
        self._end.daemon = True
        self._end.start()
        super().__init__(*where, **how)

    def _cut(self) -> None:
        if sock := getattr(self, "sock", None):
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._end.cancel()
        super().close()  # type: ignore[misc]


class _Http(_Bounded, http.client.HTTPConnection):
    pass


class _Https(_Bounded, http.client.HTTPSConnection):
    pass


class _Smtp(_Bounded, smtplib.SMTP):
    pass


class _SmtpTls(_Bounded, smtplib.SMTP_SSL):
    pass


# ---- what went wrong


def why_not(error: Exception) -> Message | str:
    """Without a word of the server's, nor the address that was asked."""
    if isinstance(error, NotTaken):
        return f"HTTP {error.status}"
    if isinstance(error, smtplib.SMTPResponseException):
        return f"SMTP {error.smtp_code}"
    if isinstance(error, smtplib.SMTPRecipientsRefused):
        return f"SMTP {next(iter(error.recipients.values()))[0]}"
    if isinstance(error, ssl.SSLError) and error.reason:
        return error.reason.lower().replace("_", " ")
    key = next((key for kind, key in KINDS.items() if isinstance(error, kind)), None)
    if key:
        return Key(key)
    return reason(error) if getattr(error, "strerror", None) else type(error).__name__


KINDS: dict[type[Exception], str] = {
    TimeoutError: "notice.silent",
    smtplib.SMTPNotSupportedError: "notice.unable",
    smtplib.SMTPServerDisconnected: "notice.cut",
    http.client.HTTPException: "notice.cut",
}
