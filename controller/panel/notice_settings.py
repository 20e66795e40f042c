"""Where notices go and of what: kept among the settings of the store, checked when they are set.

What lets others in, the webhook's address (most hold a key) and the mail's password, is told to nobody
again, stands in no log, and goes into no back-up.
"""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal
from urllib.parse import urlsplit

from controller.panel.database import StoreError
from controller.panel.records import Values

PREFIX = "notices."
SECRETS = (f"{PREFIX}webhook", f"{PREFIX}password")
_HOST = re.compile(r"[A-Za-z0-9_]([A-Za-z0-9_.-]{0,251}[A-Za-z0-9])?|[0-9a-fA-F:]{2,39}")
_ADDRESS = re.compile(r"[^\s@<>,;:\"()\[\]\\]{1,64}@[A-Za-z0-9.-]{1,255}", re.ASCII)
_URL = re.compile(r"[!-~]{1,2000}")  # nothing but visible ASCII


@dataclass(frozen=True, slots=True)
class NoticeSettings:
    """Everything off until it is set."""

    alarms: bool = True
    program_end: bool = True
    tool_change: bool = True
    language: Literal["en", "de"] = "en"
    webhook: str = ""  # URL to which JSON is posted
    host: str = ""  # of the mail server
    port: int = 587
    security: Literal["starttls", "tls", "none"] = "starttls"
    user: str = ""  # "" = the server asks for no log-in
    password: str = ""
    sender: str = ""
    to: str = ""  # addresses, by commas

    @property
    def wanted(self) -> bool:
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
            raise StoreError.told("form", "notice_url")
        if self.host and not _HOST.fullmatch(self.host):
            raise StoreError.told("form", "notice_host", host=self.host)
        if self.host:
            self._check_mail()

    def _check_mail(self) -> None:
        for address in (self.sender, *(self.receivers or [""])):
            if not _ADDRESS.fullmatch(address):
                raise StoreError.told("form", "notice_address", address=address)
        if self.user and self.security == "none":
            raise StoreError.told("form", "notice_plain")


def _is_url(text: str) -> bool:
    try:
        found = urlsplit(text)
        port = found.port
    except ValueError:
        return False
    whole = bool(_URL.fullmatch(text) and found.hostname and _HOST.fullmatch(found.hostname))
    return whole and found.scheme in ("http", "https") and port != 0 and "@" not in found.netloc


def load(values: Values) -> NoticeSettings:
    """As they were set last. Raises StoreError."""
    kept = values.all()
    return NoticeSettings(
        **{f.name: kept[PREFIX + f.name] for f in fields(NoticeSettings) if PREFIX + f.name in kept}
    )


def keep(values: Values, settings: NoticeSettings, by: str) -> None:
    """Raises StoreError, also where they are wrong."""
    settings.check()
    told: dict[str, Any] = asdict(settings)
    values.put({PREFIX + name: value for name, value in told.items()}, by)
