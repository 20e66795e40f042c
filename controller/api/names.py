"""Names of programs: what one may look like, also with the folders it is in: ``fixtures/left/part.ngc``.

The name is never a path, contents are files under their hashes; but a name goes on to other
computers (a download, a serial line, a page), so what could lead out of its folder or deceive an eye is
refused and not mended: two programs must not become one because a name was cleaned.
"""

from __future__ import annotations

import unicodedata

from controller.api.database import StoreError
from controller.messages import Key

LONGEST = 120  # characters
LONGEST_BYTES = 200  # in UTF-8; file systems end at 255, with room for a suffix
DEEPEST = 8  # folders one in another
NEVER = set('\\:*?"<>|\x00\ufffd')  # the last is what was not UTF-8


def check(name: str) -> str:
    """The name, in Unicode's composed form. Raises StoreError "name"."""
    if problem := _problem(plain := unicodedata.normalize("NFC", name)):
        key, sign = problem
        said = {"problem": Key(f"name.{key}"), "allowed": Key("allowed_name")}
        raise StoreError.of("name", "bad_name", name=shown(name), sign=sign, most=LONGEST, **said)
    return plain


def _problem(name: str) -> tuple[str, str] | None:
    """(which one, the sign that it is about)."""
    if not name:
        return "empty", ""
    parts = name.split("/")
    if len(parts) > DEEPEST + 1:
        return "deep", str(DEEPEST)
    return next((found for part in parts if (found := _problem_of(part, name))), None)


def _problem_of(part: str, name: str) -> tuple[str, str] | None:
    """Of a folder, or of what is in it."""
    if not part:
        return "gap", ""
    if len(name) > LONGEST or len(name.encode("utf-8", "replace")) > LONGEST_BYTES:
        return "long", ""
    if found := [c for c in part if c in NEVER]:
        return "holds", shown(found[0])
    # Control signs, marks that turn the direction of text, halves of pairs, private and unknown signs,
    # and line ends: none of them can be seen.
    if found := [
        c for c in part if unicodedata.category(c)[0] == "C" or unicodedata.category(c) in ("Zl", "Zp")
    ]:
        return "invisible", f"U+{ord(found[0]):04X}"
    if part[0] in ".- " or part[0].isspace():
        return "begins", shown(part[0])
    if part[-1] == "." or part[-1].isspace():
        return "ends", shown(part[-1])
    return None


def folder_of(name: str) -> str:
    """In which it is; "" for the top."""
    return name.rpartition("/")[0]


def leaf_of(name: str) -> str:
    """The name without its folders."""
    return name.rpartition("/")[2]


def shown(name: str) -> str:
    """A name that nobody has checked, fit for a sentence."""
    text = ascii(name)
    return text if len(text) <= 60 else f"{text[:57]}..."
