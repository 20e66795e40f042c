"""Notices for whoever is not at the machine: alarms, ends of programs, tool changes asked for.

    watch  ->  what is new  ->  a short queue  ->  one thread  ->  webhook, mail

A thread of its own sends: a server that hangs holds up no request, no event and not the machine. What is
sent is tried ``TRIES`` times and then given up; what came of the last one, by each way, is kept to be shown.
What went wrong is told without the server's own words, which may repeat what they were sent.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import queue
import smtplib
import ssl
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from email.message import EmailMessage
from typing import Any

from controller import catalogue
from controller.catalogue import Key
from controller.panel import notice_settings
from controller.panel.answers import Refusal
from controller.panel.link import Watch
from controller.panel.notice_settings import NoticeSettings
from controller.panel.store import Alarm, Run, Store

LOOK_S = 1.0
SILENT_S = 10.0  # of a server, before it is given up
TRIES = 3
PAUSES_S = (5.0, 30.0)  # between them
MOST_WAITING = 100
MOST_NEW = 20  # alarms, or runs, of one look; the rest is in the lists
TYPED = "MDI"  # a line typed by hand is no program


@dataclass(frozen=True, slots=True)
class Notice:
    """What is sent."""

    event: str  # 'alarm', 'program_end', 'tool_change', 'test'
    at_s: float  # seconds since 1970
    sentence: str
    sentence_de: str
    facts: Mapping[str, Any] = field(default_factory=dict)

    def text(self, settings: NoticeSettings) -> str:
        """In the language that was chosen, on one line."""
        return " ".join((self.sentence_de if settings.language == "de" else self.sentence).split())


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of the last notice by one way."""

    at_s: float
    sent: bool
    sentence: str = ""  # why not
    sentence_de: str = ""


class Notices:
    """``run`` looks for ever what is new, ``send`` puts a notice on the way."""

    def __init__(self, store: Store, watch: Watch) -> None:
        self._store, self._watch = store, watch
        self._waiting: queue.Queue[Notice | None] = queue.Queue(MOST_WAITING)
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self._known: tuple[int, int] | None = None  # numbers of the newest alarm and run; None: not looked
        self._asked: Any = None  # the tool change that was told
        self.outcomes: dict[str, Outcome] = {}  # by way: 'webhook', 'mail'

    # -- what is new

    async def run(self) -> None:
        """Never ends."""
        while True:
            await self.look()
            await asyncio.sleep(LOOK_S)

    async def look(self) -> None:
        """Send what is new; nothing is asked of the machine where nobody wants to know. Raises StoreError."""
        settings = await asyncio.to_thread(notice_settings.load, self._store.settings)
        if not settings.wanted:
            self._known = self._asked = None
            return
        for notice in await asyncio.to_thread(self._kept, settings):
            self.send(notice)
        if settings.tool_change:
            await self._look_at_tool()

    def _kept(self, settings: NoticeSettings) -> list[Notice]:
        """What came into the lists since the last look; at the first one nothing is new."""
        alarms, runs = self._store.alarms.list(MOST_NEW), self._store.runs.list(MOST_NEW)
        newest = (alarms[0].id if alarms else 0, runs[0].id if runs else 0)
        known, self._known = self._known or newest, newest
        told = [of_alarm(one) for one in alarms[::-1] if settings.alarms and one.id > known[0]]
        ends = [one for one in runs[::-1] if one.id > known[1] and one.program != TYPED]
        return [*told, *(of_run(one) for one in ends if settings.program_end)]

    async def _look_at_tool(self) -> None:
        with contextlib.suppress(Refusal):  # a service that is away asks for nothing
            asked = (await self._watch.status()).get("tool_change")
            if asked and asked != self._asked:
                words = str(asked.get("sentence", "")), str(asked.get("sentence_de", ""))
                self.send(Notice("tool_change", time.time(), *words, {"tool": asked.get("number")}))
            self._asked = asked

    # -- sending

    def send(self, notice: Notice) -> None:
        """Put it on the way; where too many wait it is lost, and that is shown."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name="notices", daemon=True)
            self._thread.start()
        try:
            self._waiting.put_nowait(notice)
        except queue.Full:
            self._note("webhook", Key("notice.many"))
            self._note("mail", Key("notice.many"))

    def end(self) -> None:
        """What is not sent by now is not sent; a server that hangs keeps nobody waiting."""
        self._ended.set()
        with contextlib.suppress(queue.Full):
            self._waiting.put_nowait(None)

    def _work(self) -> None:
        while not self._ended.is_set() and (notice := self._waiting.get()) is not None:
            with contextlib.suppress(Exception):  # of the store: it is told to whoever asks for it
                settings = notice_settings.load(self._store.settings)
                for way in ways(settings):
                    self._try(way, notice, settings)

    def _try(self, way: str, notice: Notice, settings: NoticeSettings) -> None:
        for pause_s in (*PAUSES_S[: TRIES - 1], None):
            if self.deliver(way, notice, settings).sent or pause_s is None or self._ended.wait(pause_s):
                return

    def deliver(self, way: str, notice: Notice, settings: NoticeSettings) -> Outcome:
        """One try, here and now; it takes as long as the server lets it, some ``SILENT_S`` at most."""
        try:
            SENDERS[way](notice, settings)
        except Exception as error:  # whatever the library makes of a bad server
            return self._note(way, _why(error))
        return self._note(way, None)

    def _note(self, way: str, why: str | None) -> Outcome:
        words = (
            ("", "") if why is None else catalogue.in_both("notice_failed", way=Key(f"way.{way}"), why=why)
        )
        self.outcomes[way] = Outcome(time.time(), why is None, *words)
        return self.outcomes[way]


def ways(settings: NoticeSettings) -> list[str]:
    """Those that are set."""
    return [way for way, there in (("webhook", settings.webhook), ("mail", settings.host)) if there]


def of_alarm(alarm: Alarm) -> Notice:
    german = str(alarm.facts.get("sentence_de") or alarm.sentence)
    return Notice(
        "alarm", alarm.at_s, alarm.sentence, german, {"name": alarm.name, "axis": alarm.axis or None}
    )


def of_run(run: Run) -> Notice:
    words = catalogue.in_both("notice.end", program=run.program, result=_result(run))
    facts = {"program": run.program, "result": run.result, "run": run.id}
    return Notice("program_end", run.ended_s or run.began_s, *words, facts)


def _result(run: Run) -> str:
    key = f"notice.{run.result}"
    return Key(key) if key in catalogue.of("en").refusals else run.result


def test() -> Notice:
    """To see whether it comes through."""
    return Notice("test", time.time(), *catalogue.in_both("notice.test"))


# ---- the two ways


class _Straight(urllib.request.HTTPRedirectHandler):
    """No other address than the one that was checked."""

    def redirect_request(self, *_: Any) -> None:
        return None


def _post(notice: Notice, settings: NoticeSettings) -> None:
    """As JSON; ``text`` is what chat servers show."""
    told = {"event": notice.event, "at_s": notice.at_s, "text": notice.text(settings)}
    told |= {"sentence": notice.sentence, "sentence_de": notice.sentence_de, **notice.facts}
    headers = {"Content-Type": "application/json", "User-Agent": "Directrix"}
    asked = urllib.request.Request(settings.webhook, json.dumps(told).encode(), headers, method="POST")
    with urllib.request.build_opener(_Straight).open(asked, timeout=SILENT_S):
        pass  # whatever it says beside its status


def _mail(notice: Notice, settings: NoticeSettings) -> None:
    mail = EmailMessage()
    mail["Subject"], mail["From"] = f"Directrix: {notice.text(settings)}"[:200], settings.sender
    mail["To"] = ", ".join(settings.receivers)
    mail.set_content(f"{notice.sentence}\n\n{notice.sentence_de}\n")
    trusted = ssl.create_default_context()
    with _server(settings, trusted) as server:
        if settings.security == "starttls":
            server.starttls(context=trusted)
        if settings.user:
            server.login(settings.user, settings.password)
        server.send_message(mail)


def _server(settings: NoticeSettings, trusted: ssl.SSLContext) -> smtplib.SMTP:
    if settings.security == "tls":
        return smtplib.SMTP_SSL(settings.host, settings.port, timeout=SILENT_S, context=trusted)
    return smtplib.SMTP(settings.host, settings.port, timeout=SILENT_S)


SENDERS: dict[str, Callable[[Notice, NoticeSettings], None]] = {"webhook": _post, "mail": _mail}


def _why(error: Exception) -> str:
    """Without a word of the server's, nor the address that was asked."""
    if isinstance(error, urllib.error.HTTPError):
        return f"HTTP {error.code}"
    if isinstance(error, smtplib.SMTPResponseException):
        return f"SMTP {error.smtp_code}"
    if isinstance(error, urllib.error.URLError) and isinstance(error.reason, Exception):
        return _why(error.reason)
    if isinstance(error, TimeoutError):
        return Key("notice.silent")
    if isinstance(error, ssl.SSLError):
        return str(error.reason or "TLS")
    return getattr(error, "strerror", None) or type(error).__name__


def changed(old: NoticeSettings, new: Mapping[str, Any]) -> NoticeSettings:
    """With what was sent; null stays, but no password goes to another server than it was set for."""
    found = replace(old, **{name: value for name, value in new.items() if value is not None})
    other = found.host != old.host and new.get("password") is None
    return replace(found, password="") if other else found
