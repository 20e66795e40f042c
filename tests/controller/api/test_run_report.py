"""A run as a page to be printed."""

from __future__ import annotations

from controller.api.run_report import Facts, page
from controller.messages import message
from controller.store.history import Alarm, Run

ERRORS = {"X": 0.0123, "C": 0.0313}
FACTS = {"duration_s": 67.742, "planned_s": 67.7, "ticks": 33850, "skips": 0, "following_error": ERRORS}
RUN = Run(7, "a<b>.ngc", "0" * 64, 1000.0, 1068.0, "completed", FACTS)
CHECK = {
    "duration_s": 67.7,
    "blocks": 6,
    "verified": {"overcut_mm": 0.0021},
    "joints": [{"name": "X", "velocity_share": 0.42, "acceleration_share": 0.3, "jerk_share": 0.9}],
}
ALARM = Alarm(3, 1010.0, "FEED_LOW", "X", None, None, "It was slow.", {}, None, None)


def test_it_tells_what_the_store_has_of_the_run_its_check_and_its_alarms() -> None:
    told = page(Facts(RUN, CHECK, [ALARM], ["run.json"]), "en")
    for words in ("67.742", "33850", "0.0313", "0.0021", "42 %", "It was slow.", "run.json", "0" * 64):
        assert words in told, words


def test_it_tells_whether_the_surfaces_kept_their_tolerance_in_its_language() -> None:
    check = {**CHECK, "verdict": {"within": False, **message("form.overcut")}}
    for language, sentence in (("en", "too deep"), ("de", "zu tief geschnitten")):
        assert sentence in page(Facts(RUN, check, [], []), language)  # type: ignore[arg-type]


def test_a_name_is_text_and_never_markup() -> None:
    told = page(Facts(RUN, {}, [], []), "en")
    assert "a&lt;b&gt;.ngc" in told
    assert "<b>" not in told


def test_it_speaks_german_and_leaves_out_what_is_not_known() -> None:
    told = page(Facts(Run(1, "p", "0" * 64, 0.0, 1.0, "lost", {}), {}, [], []), "de")
    assert "Größter Schleppfehler" in told
    assert "Prüfung des Programms" not in told
