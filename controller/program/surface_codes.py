"""Whether the text of a program may cut a surface: a long one of lines alone is not read for that."""

from __future__ import annotations

import re

_CODES = re.compile(rb"[gG][ \t]*0*(?:5[12]|6\.2)")


def may_cut(text: bytes) -> bool:
    """Whether G51, G52 or G6.2 is in it, in a comment at least."""
    return _CODES.search(text) is not None
