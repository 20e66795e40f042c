"""Names of programs: what one may look like.

The name is never a path, contents are files under their hashes; but a name goes on to other
computers (a download, a serial line, a page), so what could be a path or deceive an eye is
refused and not mended: two programs must not become one because a name was cleaned.
"""

from __future__ import annotations

import unicodedata

from controller.catalogue import Key
from controller.panel.database import StoreError

LONGEST = 120  # characters
LONGEST_BYTES = 200  # in UTF-8; file systems end at 255, with room for a suffix
NEVER = set('/\\:*?"<>|\x00\ufffd')  # the last stands for what was not UTF-8


def check(name: str) -> str:
    """The name, in Unicode's composed form. Raises StoreError "name"."""
    if problem := _problem(plain := unicodedata.normalize("NFC", name)):
        key, sign = problem
        said = {"problem": Key(f"name.{key}"), "allowed": Key("allowed_name")}
        raise StoreError.told("name", "bad_name", name=shown(name), sign=sign, most=LONGEST, **said)
    return plain


def _problem(name: str) -> tuple[str, str] | None:
    """(which one, the sign that it is about)."""
    if not name:
        return "empty", ""
    if len(name) > LONGEST or len(name.encode("utf-8", "replace")) > LONGEST_BYTES:
        return "long", ""
    if found := [c for c in name if c in NEVER]:
        return "holds", shown(found[0])
    # Control signs, marks that turn the direction of text, halves of pairs, private and unknown signs,
    # and line ends: none of them can be seen.
    if found := [
        c for c in name if unicodedata.category(c)[0] == "C" or unicodedata.category(c) in ("Zl", "Zp")
    ]:
        return "invisible", f"U+{ord(found[0]):04X}"
    if name[0] in ".- " or name[0].isspace():
        return "begins", shown(name[0])
    if name[-1] == "." or name[-1].isspace():
        return "ends", shown(name[-1])
    return None


def shown(name: str) -> str:
    """A name that nobody has checked, fit for a sentence."""
    text = ascii(name)
    return text if len(text) <= 60 else f"{text[:57]}..."
