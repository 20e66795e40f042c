"""A command speaks as it is told, and leaves nothing of that to the next one of the same process."""

from __future__ import annotations

import io

import pytest
from typer.testing import CliRunner

from controller import messages
from controller.__main__ import app
from controller.verify import console
from controller.verify.console import spoken


@pytest.mark.parametrize(("program", "code"), [("G90", 0), ("G1 X1 F100 Q9", 1)])
def test_the_language_of_a_command_ends_with_it(
    program: str, code: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = tmp_path_factory.mktemp("part") / "part.ngc"
    file.write_text(f"{program}\n")
    done = CliRunner().invoke(app, ["explain", str(file), "--language", "de"])
    assert done.exit_code == code and ("streichen" in done.output) is (code == 1)
    assert spoken.get() == messages.DEFAULT


@pytest.mark.parametrize(
    ("answer", "language", "agreed"),
    [
        ("y\n", "en", True),
        ("Yes\n", "en", True),
        ("j\n", "en", False),
        ("\n", "en", False),
        ("ja\n", "de", True),
    ],
)
def test_a_question_is_agreed_to_in_the_words_of_its_language(
    answer: str, language: str, agreed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(answer))
    before = console.spoken.set(language)
    try:
        assert console.agreed("Start?") is agreed
    finally:
        console.spoken.reset(before)
