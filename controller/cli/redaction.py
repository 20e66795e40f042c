"""What lets others in, taken out of what goes to others: of texts that may hold it anywhere.

What this shop has set (webhook, mail, password, hashes of passwords and tokens) is looked for as it is, and
what looks like a key (tokens of ours, Bearer, a password in an address or after an option, a private key) by
its form. A crash report has a command line, a log what a library says of an address, a program whatever its
writer put there.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
from collections.abc import Collection, Iterable
from urllib.parse import quote, urlsplit

import numpy as np

from controller import npz
from controller.api import notice_settings
from controller.api.store import Store
from controller.api.users import TOKEN_MARK
from controller.service import runs
from controller.state import record_files

INSTEAD = b"[taken out]"
SHORTEST = 4  # characters; what is shorter is in half of all words
_FORMS = re.compile(
    rb"(?P<token>\b" + re.escape(TOKEN_MARK.encode()) + rb"[\w-]{16,})"
    rb"|(?P<scheme>(?i:bearer|authorization:\s*\w+)\s+)[\w.~+/=-]{8,}"
    rb"|(?P<cookie>(?i:cookie)[\\\"']{0,3}\s*[=:,]\s*[\\\"']{0,3})[\w.-]+=[^\r\n\\\"']+"
    rb"|(?P<address>[a-z][a-z0-9+.-]{0,20}://[^\s/:@\"']*:)[^\s/@\"']+(?=@)"
    rb"|(?P<query>[?&](?:key|sig|auth|code|hook)=)[\w.~%+/-]{8,}"
    rb"|(?P<hook>https?://[^\s/\"']+/(?:[^\s/\"']+/)*(?:web)?(?:hooks?|services)/)[\w.~%+/-]{8,}"
    rb"|(?P<named>(?i:passwor[dt]|(?<![a-z])pass|passwd|passphrase|passcode|pwd|kennwort|credentials?|secret|token"
    rb"|(?:api|access|secret|private|auth|signing)[_-]?(?:access[_-]?)?key)[\\\"']{0,3}\s*[=:]\s*)"
    rb"(?:(?P<quote>\\{0,9}[\"'])(?!(?P=quote))[^\r\n]{1,200}?(?P=quote)|[^\s\\\"',;}]{4,})"
    rb"|(?P<option>--(?:password|pass|token|secret|api-key)[\s=\"',]+)[^\s\"',]+"
    rb"|(?P<known>\b(?:gh[pousr]_|github_pat_|glpat-|xox[abprs]-|sk-|AKIA|AIza|eyJ[\w-]{8,}\.)[\w.-]{12,})"
    rb"|(?P<hash>\$argon2[^\s\"']+)"
    rb"|(?P<key>-----BEGIN [A-Z ]*PRIVATE KEY-----.*?(?:-----END [A-Z ]*PRIVATE KEY-----|\Z))",
    re.DOTALL,
)
_SET = ("webhook", "password", "user", "sender", "to")  # of the notices
_STAYS = ("scheme", "cookie", "address", "query", "hook", "named", "option")  # what is before a secret


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


def of_names(names: Iterable[str]) -> list[bytes]:
    """Names of programs that have something of that form, and what their records are called by."""
    keys = {name for name in names if redacted(name.encode(), ()) != name.encode()}
    return [form.encode() for name in keys for form in (name, json.dumps(name)[1:-1], runs.plain(name))]


def of_part(name: str, data: bytes, secrets: Collection[bytes]) -> bytes:
    """A file without them, of arrays in their texts: a recording has the machine file's.

    Raises ValueError for a recording that cannot be read; another damaged file of arrays is as it is.
    """
    if not name.endswith(".npz"):
        return redacted(data, secrets)
    try:
        npz.check(io.BytesIO(data))
        with np.load(io.BytesIO(data), allow_pickle=False) as packed:
            arrays = dict(packed)
    except ValueError:
        if name.endswith(record_files.TRACE):
            raise
        return data
    texts = {one: array for one, array in arrays.items() if array.dtype.kind == "U"}
    clean = {one: _texts(array, secrets) for one, array in texts.items()}
    if all(np.array_equal(texts[one], clean[one]) for one in texts):
        return data
    out = io.BytesIO()
    np.savez_compressed(out, **arrays | clean)
    return out.getvalue()


def _texts(array: np.ndarray, secrets: Collection[bytes]) -> np.ndarray:
    return np.array([redacted(one.encode(), secrets).decode() for one in array.flat]).reshape(array.shape)


def redacted(data: bytes, secrets: Iterable[bytes]) -> bytes:
    """The text without them."""
    for one in secrets:
        data = data.replace(one, INSTEAD)
    return _FORMS.sub(_instead, data)


def _instead(found: re.Match[bytes]) -> bytes:
    quote = found["quote"] or b""
    return next((found[name] for name in _STAYS if found[name]), b"") + quote + INSTEAD + quote
