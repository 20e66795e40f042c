"""Names of programs: what one may look like.

The name is never a path, contents are files under their hashes; but a name goes on to other
computers (a download, a serial line, a page), so what could be a path or deceive an eye is
refused and not mended: two programs must not become one because a name was cleaned.
"""

from __future__ import annotations

import unicodedata

from controller.panel.database import StoreError

LONGEST = 120  # characters
LONGEST_BYTES = 200  # in UTF-8; file systems end at 255, with room for a suffix
NEVER = set('/\\:*?"<>|\x00\ufffd')  # the last stands for what was not UTF-8
ALLOWED = (
    f'up to {LONGEST} letters, digits, spaces and signs without / \\ : * ? " < > | , '
    f"not beginning with a dot, a minus sign or a space and not ending with a dot or a space"
)


def check(name: str) -> str:
    """The name, in Unicode's composed form. Raises StoreError "name"."""
    if problem := _problem(plain := unicodedata.normalize("NFC", name)):
        raise StoreError("name", f"program name {shown(name)}: {problem}; allowed: {ALLOWED}; rename it.")
    return plain


def _problem(name: str) -> str:
    if not name:
        return "is empty"
    if len(name) > LONGEST or len(name.encode("utf-8", "replace")) > LONGEST_BYTES:
        return "is too long"
    if found := [c for c in name if c in NEVER]:
        return f"holds {shown(found[0])}"
    # Control signs, marks that turn the direction of text, halves of pairs, private and unknown signs,
    # and line ends: none of them can be seen.
    if found := [
        c for c in name if unicodedata.category(c)[0] == "C" or unicodedata.category(c) in ("Zl", "Zp")
    ]:
        return f"holds the invisible sign U+{ord(found[0]):04X}"
    if name[0] in ".- " or name[0].isspace():
        return f"begins with {shown(name[0])}"
    if name[-1] == "." or name[-1].isspace():
        return f"ends with {shown(name[-1])}"
    return ""


def shown(name: str) -> str:
    """A name that nobody has checked, fit for a sentence."""
    text = ascii(name)
    return text if len(text) <= 60 else f"{text[:57]}..."
