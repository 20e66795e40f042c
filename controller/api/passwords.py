"""Which passwords are none: too short, or easy to guess.

A rule instead of a list of millions: guesses that are written down everywhere are a common word, a name that
is known here, a path over the keyboard or one letter again and again, with digits and signs around it and a
few letters exchanged for them. What is left of a password without these must be long enough by itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from controller.messages import Message, message

MIN_LENGTH, MAX_LENGTH = 8, 200
MIN_LEFT = 4  # letters beside a common word
ROWS = ("qwertyuiop", "qwertzuiop", "asdfghjkl", "zxcvbnm", "yxcvbnm", "abcdefghijklmnopqrstuvwxyz")
# Of both languages, the longest first where one has another in it.
WORDS = (
    *("administrator", "admin", "iloveyou", "ichliebedich", "password", "passwort", "kennwort", "letmein"),
    *("welcome", "willkommen", "sunshine", "princess", "football", "fussball", "baseball", "dragon"),
    *("monkey", "superman", "batman", "master", "shadow", "secret", "geheim", "hallo", "hello", "schatz"),
    *("login", "computer", "internet", "starwars", "trustno", "whatever", "changeme", "default", "access"),
    *("root", "machine", "maschine", "directrix", "operator", "bediener", "test", "user", "guest", "gast"),
    *("pass", "zaqwsx", "qazwsx", "yaqxsw", "summer", "winter", "spring", "autumn", "sommer", "herbst"),
    *("monday", "montag", "freedom"),
)
EXCHANGED = str.maketrans("013457@$!", "oleastasi")


def check(password: str, names: Iterable[str] = ()) -> Message | None:
    """Why it is none, None where it may be used; ``names``: of the user, and what else is known here."""
    if not MIN_LENGTH <= len(password) <= MAX_LENGTH:
        return message("password.length", count=len(password), shortest=MIN_LENGTH, longest=MAX_LENGTH)
    return message("password.common", least=MIN_LEFT) if _is_common(password.casefold(), names) else None


def _is_common(password: str, names: Iterable[str]) -> bool:
    known = [*WORDS, *(word for one in names if len(word := _letters(one.casefold())) >= 3)]
    return any(len(_left(one, known)) < MIN_LEFT for one in (password, password.translate(EXCHANGED)))


def _left(password: str, known: Iterable[str]) -> str:
    """Letters that are no word of those and no path over the keyboard; what is repeated counts once."""
    letters = _letters(password)
    for word in known:
        letters = letters.replace(word, "")
    for way in (one for row in ROWS for one in (row, row[::-1])):
        for length in range(len(way), 2, -1):
            for at in range(len(way) - length + 1):
                letters = letters.replace(way[at : at + length], "")
    return re.sub(r"(.{1,4}?)\1+", r"\1", letters)


def _letters(text: str) -> str:
    return re.sub(r"[\W\d_]+", "", text)
