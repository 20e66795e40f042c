"""The two ways a notice goes: JSON posted to a webhook, and mail.

No way takes longer than ``WHOLE_S``, also where a server drips its answer byte by byte. What went wrong is
told without the server's own words, which may repeat what they were sent.
"""

from __future__ import annotations

import contextlib
import http.client
import json
import smtplib
import socket
import ssl
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from email.message import EmailMessage
from typing import Any
from urllib.parse import urlsplit

from controller import messages
from controller.api.notice_settings import NoticeSettings
from controller.messages import Key, Said

SILENT_S = 10.0  # of a server, before it is given up
WHOLE_S = 30.0  # from the first byte to the last


@dataclass(frozen=True, slots=True)
class Notice:
    """What is sent."""

    event: str  # 'alarm', 'program_end', 'tool_change', 'test'
    at_s: float  # seconds since 1970
    said: Said
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


def why(error: Exception) -> str:
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
    return Key(key) if key else getattr(error, "strerror", None) or type(error).__name__


KINDS: dict[type[Exception], str] = {
    TimeoutError: "notice.silent",
    smtplib.SMTPNotSupportedError: "notice.unable",
    smtplib.SMTPServerDisconnected: "notice.cut",
    http.client.HTTPException: "notice.cut",
}
