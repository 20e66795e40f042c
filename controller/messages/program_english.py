"""English: what the reader of programs refuses."""

from __future__ import annotations

LANGUAGE = "en"

REFUSALS = {
    "program.refused": "{place}: {sentence}",
    "program.within": "{sentence} ({calls})",
    "program.called": "called by {written} on line {line} of {file}",
    "program.more_calls": "{more} calls more",
    "program.listed": "{one}, {other}",
    "program.count": "{about} {count}",
    "program.count_other": "other {count}",
    "program.summed": "{count} refusals: {each}.",
    "program.of_several": "{sentence} ({summed})",
}
