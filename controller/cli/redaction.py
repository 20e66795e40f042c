"""What lets others in, taken out of what goes to others: of texts that may hold it anywhere.

What this shop has set (webhook, mail, password, hashes of passwords and tokens) is looked for as it is, and
what looks like a key (tokens of ours, Bearer, a password in an address or behind an option, a private key) by
its form. A crash report has a command line, a log what a library says of an address, a program whatever its
writer put there.
"""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Iterable
from urllib.parse import quote, urlsplit

from controller.api import notice_settings
from controller.api.store import Store
from controller.api.users import TOKEN_MARK

INSTEAD = b"[taken out]"
SHORTEST = 4  # characters; what is shorter stands in half of all words
_FORMS = re.compile(
    rb"(?P<token>\b" + re.escape(TOKEN_MARK.encode()) + rb"[\w-]{16,})"
    rb"|(?P<scheme>(?i:bearer|authorization:\s*\w+)\s+)[\w.~+/=-]{8,}"
    rb"|(?P<address>[a-z][a-z0-9+.-]{0,20}://[^\s/:@\"']*:)[^\s/@\"']+(?=@)"
    rb"|(?P<named>(?i:password|passwd|secret|token|api[_-]?key)[\\\"']{0,3}\s*[=:]\s*[\\\"']{0,3})[^\s\\\"',;}]{4,}"
    rb"|(?P<option>--(?:password|token)[ =])\S+"
    rb"|(?P<hash>\$argon2[^\s\"']+)"
    rb"|(?P<key>-----BEGIN [A-Z ]*PRIVATE KEY-----.*?(?:-----END [A-Z ]*PRIVATE KEY-----|\Z))",
    re.DOTALL,
)
_SET = ("webhook", "password", "user", "sender", "to")  # of the notices
_STAYS = ("scheme", "address", "named", "option")  # what stands before a secret


def of_shop(store: Store) -> list[bytes]:
    """What a shop has set that lets others in, or says who they are; the longest first. Raises StoreError."""
    settings = store.settings.all()
    set_here = [settings.get(notice_settings.PREFIX + name) for name in _SET]
    words = [
        one.strip() for value in set_here if isinstance(value, str) for one in (value, *value.split(","))
    ]
    words += [way for one in words if "://" in one and len(way := _way(one)) > 1]
    words += [*(user.password for user in store.users.all()), *store.users.by_hash()]
    forms = {form for word in words for form in (word, json.dumps(word)[1:-1], quote(word, safe=""))}
    return sorted((one.encode() for one in forms if len(one) >= SHORTEST), key=len, reverse=True)


def _way(address: str) -> str:
    """What follows the name of a server: most webhooks have their key there."""
    with contextlib.suppress(ValueError):
        found = urlsplit(address)
        return found.path + (f"?{found.query}" if found.query else "")
    return ""


def redacted(data: bytes, secrets: Iterable[bytes]) -> bytes:
    """The text without them."""
    for one in secrets:
        data = data.replace(one, INSTEAD)
    return _FORMS.sub(_instead, data)


def _instead(found: re.Match[bytes]) -> bytes:
    return next((found[name] for name in _STAYS if found[name]), b"") + INSTEAD
