"""What errors of drives say: texts of the catalogue, in English where nobody asks for another language."""

from __future__ import annotations

import errno
import json
import os
import pickle

from controller import messages
from drives import texts
from drives.bus import BusError
from drives.texts import TextError, message


def test_an_error_is_english_in_words_and_a_text_in_every_language() -> None:
    inner = BusError(message("bus.no_hub", name="can0", channel="/tmp/x", why="No such file"))
    error = pickle.loads(pickle.dumps(TextError(message("drive.of", title="drive X", why=inner))))
    assert str(error) == "drive X: bus can0: no virtual bus at /tmp/x: No such file; start its hub first"
    assert messages.text(messages.of_error(error), "en") == str(error)
    assert messages.text(messages.of_error(error), "de").startswith("drive X: Bus can0: kein virtueller Bus")
    assert json.loads(json.dumps(error.said)) == error.said, "it goes through sockets and files"


def test_what_has_no_text_is_a_sentence_and_no_reason_is_said_so() -> None:
    assert str(TextError("Look at it.")) == "Look at it." == messages.text(TextError("Look at it.").said)
    assert "not known" in str(TextError(message("drive.of", title="X", why=None)))
    assert texts.english({"key": "none.such", "values": {"n": 1}}) == "none.such {'n': 1}"


def test_a_reason_of_the_operating_system_has_its_words_in_every_language() -> None:
    missing = OSError(errno.ENOENT, os.strerror(errno.ENOENT), "x")
    assert message("drive.of", title="X", why=missing)["values"]["why"] == {
        "key": "errno.ENOENT",
        "values": {},
    }
    text = message("drive.of", title="X", why=missing)
    assert texts.english(text) == "X: No such file or directory"
    assert messages.text(text, "de") == "X: Datei oder Ordner nicht vorhanden"
    assert texts.reason(OSError(5, "could not open port")) == "could not open port"
    assert texts.reason(ValueError("wrong")) == "wrong"


def test_the_english_of_an_error_number_is_the_operating_system_s_own() -> None:
    found = [key for key in texts.english_texts() if key.startswith("errno.")]
    assert len(found) > 40
    for key in found:
        assert texts.english_texts()[key] == os.strerror(getattr(errno, key.removeprefix("errno."))), key
