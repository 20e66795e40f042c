"""German: what the reader of programs refuses."""

from __future__ import annotations

LANGUAGE = "de"

REFUSALS = {
    "program.refused": "{place}: {sentence}",
    "program.within": "{sentence} ({calls})",
    "program.called": "gerufen von {written} in Zeile {line} von {file}",
    "program.more_calls": "und {more} Aufrufe mehr",
    "program.listed": "{one}, {other}",
    "program.count": "{about} {count}",
    "program.count_other": "andere {count}",
    "program.summed": "{count} Ablehnungen: {each}.",
    "program.of_several": "{sentence} ({summed})",
}
