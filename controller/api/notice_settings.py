"""Where notices go and of what: kept among the settings of the store, checked when they are set.

What lets others in, the webhook's address (most hold a key) and the mail's password, is told to nobody
again, stands in no log, and goes into no back-up.
"""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal
from urllib.parse import urlsplit

from controller import messages
from controller.api.database import StoreError
from controller.api.records import Facts, Values

PREFIX = "notices."
PASSWORD = f"{PREFIX}password"
SECRETS = (f"{PREFIX}webhook", PASSWORD)
TOLD = "notices.told"  # the mark: the newest alarm and run that were
_HOST = re.compile(r"[A-Za-z0-9_]([A-Za-z0-9_.-]{0,251}[A-Za-z0-9])?|[0-9a-fA-F:]{2,39}")
_ADDRESS = re.compile(r"[^\s@<>,;:\"()\[\]\\]{1,64}@[A-Za-z0-9.-]{1,255}", re.ASCII)
_URL = re.compile(r"[!-~]{1,2000}")  # nothing but visible ASCII


@dataclass(frozen=True, slots=True)
class NoticeSettings:
    """Everything off until it is set."""

    alarms: bool = True
    program_end: bool = True
    tool_change: bool = True
    language: str = messages.DEFAULT
    webhook: str = ""  # URL to which JSON is posted
    host: str = ""  # of the mail server
    port: int = 587
    security: Literal["starttls", "tls", "none"] = "starttls"
    user: str = ""  # "" = the server asks for no log-in
    password: str = ""
    sender: str = ""
    to: str = ""  # addresses, by commas

    @property
    def is_enabled(self) -> bool:
        """Whether anything is sent at all."""
        return bool(self.webhook or self.host)

    @property
    def receivers(self) -> list[str]:
        return [one.strip() for one in self.to.split(",") if one.strip()]

    @property
    def webhook_shown(self) -> str:
        """Scheme and host alone: what follows is the key."""
        found = urlsplit(self.webhook)
        return f"{found.scheme}://{found.hostname}" if self.webhook else ""

    def check(self) -> None:
        """Raises StoreError with code "form"."""
        if self.webhook and not _is_url(self.webhook):
            raise StoreError.of("form", "notice_url")
        if self.host and not _HOST.fullmatch(self.host):
            raise StoreError.of("form", "notice_host", host=self.host)
        if self.host:
            self._check_mail()

    def _check_mail(self) -> None:
        for address in (self.sender, *(self.receivers or [""])):
            if not _ADDRESS.fullmatch(address):
                raise StoreError.of("form", "notice_address", address=address)
        if self.user and self.security == "none":
            raise StoreError.of("form", "notice_plain")


OFF = NoticeSettings()
CHOICES = {"security": ("starttls", "tls", "none"), "language": tuple(messages.LANGUAGES)}


def _is_url(text: str) -> bool:
    try:
        found = urlsplit(text)
        port = found.port
    except ValueError:
        return False
    whole = bool(_URL.fullmatch(text) and found.hostname and _HOST.fullmatch(found.hostname))
    return whole and found.scheme in ("http", "https") and port != 0 and "@" not in found.netloc


def load(values: Values) -> NoticeSettings:
    """As they were set last; all off where they are not sound (a back-up is anybody's). Raises StoreError."""
    return _of(values.all())


def _of(kept: Facts) -> NoticeSettings:
    known = {f.name: kept[PREFIX + f.name] for f in fields(NoticeSettings) if PREFIX + f.name in kept}
    sound = all(type(value) is type(getattr(OFF, name)) for name, value in known.items())
    sound = sound and all(known.get(name, of[0]) in of for name, of in CHOICES.items())
    found = NoticeSettings(**known) if sound else OFF
    try:
        found.check()
    except StoreError:
        return OFF
    return found if 1 <= found.port <= 65535 else OFF


def keep(values: Values, settings: NoticeSettings, by: str) -> None:
    """Raises StoreError, also where they are wrong."""
    settings.check()
    told: dict[str, Any] = asdict(settings)
    values.put({PREFIX + name: value for name, value in told.items()}, by)


def mark_sent(marks: Values, newest: tuple[int, int] | None) -> tuple[int, int] | None:
    """Store the numbers of the newest alarm and run (None: nothing is sent); those stored before."""
    kept = marks.get(TOLD)
    before = tuple(kept) if isinstance(kept, list) else None
    if newest is None and before is not None:
        marks.remove(TOLD)
    elif newest is not None and newest != before:
        marks.set(TOLD, newest, "notices")
    return before


def without_secrets(kept: Facts) -> Facts:
    """What a back-up holds: whoever carries it away need not be who may send in this shop's name."""
    return {name: value for name, value in kept.items() if name not in SECRETS}


def restored(kept: Facts, saved: Facts) -> Facts:
    """Of a back-up, with what it does not hold as it is here; no password goes to another server."""
    stays = {name: kept[name] for name in SECRETS if name in kept}
    if _of(saved).host != _of(kept).host:
        stays.pop(PASSWORD, None)
    return {**without_secrets(saved), **stays}
