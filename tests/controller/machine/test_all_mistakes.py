"""All mistakes of a machine file come in one answer: each once, by line, and none that another one causes."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest
from support.machines.every_key import TEXT, values_of_every_key
from support.machines.spindle_machine import text
from typer.testing import CliRunner

from controller import messages
from controller.__main__ import app
from controller.machine import machine_file, setup_data
from controller.machine.toml_table import ConfigError

TRUNNION = (machine_file.SHIPPED / "trunnion.toml").read_text()
TOOLS = (machine_file.SHIPPED / "tools.toml").read_text()


def mistakes(content: str) -> tuple[ConfigError, ...]:
    try:
        machine_file.read(content, "m.toml", machine_file.SHIPPED)
    except ConfigError as error:
        return error.mistakes
    return ()


def changed(content: str, *pairs: tuple[str, str]) -> str:
    for old, new in pairs:
        assert old in content, old
        content = content.replace(old, new, 1)
    return content


def test_six_mistakes_are_one_answer_in_the_order_of_their_lines() -> None:
    wrong = changed(
        f"{TRUNNION}\n{TOOLS}",
        ("gouge =", "gauge ="),
        ("velocity_mm_s = 200.0", "velocity_mm_s = 0"),
        ("travel_mm = [-300.0, 300.0]\n", ""),
        ("node = 2", "node = 200"),
        ("sense = ", "sens = "),
        ("radius_mm = 3.000", 'radius_mm = "3"'),
    )
    with pytest.raises(ConfigError) as refused:
        machine_file.read(wrong, "m.toml")
    found = refused.value.mistakes
    assert [one.place[-1] for one in found] == [
        *("gauge", "travel_mm", "velocity_mm_s", "node", "sens", "radius_mm")
    ]
    assert [one.line for one in found] == sorted(one.line for one in found)
    assert all(str(one) in str(refused.value) for one in found)
    german = messages.text(refused.value.said, "de")
    assert german.count("erlaubt: ") == 6 and "did you mean" not in german


def test_a_table_of_another_table_is_said_where_it_belongs() -> None:
    """``[inputs]`` at the top level, where ``[io]`` has them, and a key of an axis."""
    wrong = f"{TRUNNION}\n{TOOLS}\n[inputs]\ndoor = 3\n[homing]\nmethod = 24\n"
    with pytest.raises(ConfigError) as refused:
        machine_file.read(wrong, "m.toml")
    told = {one.place[-1]: str(one) for one in refused.value.mistakes}
    assert told["inputs"].endswith("write it in [io].") and told["homing"].endswith("write it in [[axis]].")


# What is wrong, and the keys that are refused: what needs them is not told of.
CAUSES = [
    (('kind = "linear"', 'kind = "liner"'), ["kind"]),
    (('[[bus]]\nname = "can0"', '[[bus]]\nname = "can9"'), ["bus"]),
    (("node = 10", "nodex = 10"), ["node"]),
    (("node = 10", ""), ["node"]),
    (("clamp = { output", "clmp = { output"), ["clmp"]),
    (("outputs = {", "outputs = 3 # {"), ["outputs"]),
    (("estop = 0", "estop = 64"), ["estop"]),
    (("counts_per_rev = 4096", "counts_per_rev = true"), ["counts_per_rev"]),
    (("direction = [1, 0, 0]", "direction = [0, 0, 0]"), ["direction"]),
    (("[machine]", "[machin]"), ["machine"]),
    (("node = 1\n", "node = 1\nload_encoder = { tpdo = 3, node = 2, most_off_mm = 1 }\n"), ["node"]),
    (
        ("node = 1\n", "node = 1\nfeedback_every = 2\nload_encoder = { tpdo = 3, most_off_mm = 1 }\n"),
        ["feedback_every"],
    ),
    (("travel_mm = [-300.0, 300.0]", "travel_mm = [300.0, -300.0]"), ["travel_mm"]),
    (("number = 1\n", ""), ["number"]),
    (('kind = "linear"', 'kind = "table"'), ["kind"]),
    (('kind = "table"', 'kind = "linear"'), ["kind"]),
    (('name = "Y"', 'name = "X"'), ["name"]),
]


@pytest.mark.parametrize(("change", "keys"), CAUSES)
def test_a_mistake_is_told_alone(change: tuple[str, str], keys: list[str]) -> None:
    assert [one.place[-1] for one in mistakes(changed(text(), change))] == keys


def test_a_misspelt_head_is_told_alone() -> None:
    for old, new in (("[[bus]]", "[[buss]]"), ("[offsets]", "[ofsets]")):
        (one,) = mistakes(changed(f"{TRUNNION}\n{TOOLS}", (old, new)))
        assert one.line and one.place == (new.strip("[]"),)


@pytest.mark.parametrize("seed", range(4))
def test_of_many_mistakes_none_is_lost_and_none_is_invented(seed: int) -> None:
    """What hangs on others comes when they are mended: every one is told, once, in at most three rounds."""
    by_line: dict[int, list[tuple[str, str]]] = {}
    drawn, lines = random.Random(seed), TEXT.splitlines()
    for line, name, wrong_text in values_of_every_key():
        others = [
            n for n, (a, b) in enumerate(zip(lines, wrong_text.splitlines(), strict=False), 1) if a != b
        ]
        if others == [line]:  # else it is of a table that another way of the same takes instead
            by_line.setdefault(line, []).append((name, wrong_text))
    wrong = {line: drawn.choice(by_line[line]) for line in sorted(drawn.sample(sorted(by_line), 20))}
    for _ in range(3):
        new = [wrong[n][1].splitlines()[n - 1] if n in wrong else line for n, line in enumerate(lines, 1)]
        told = [(one.line, one.place[-1]) for one in mistakes("\n".join(new))]
        assert len(set(told)) == len(told) and told == sorted(told, key=lambda one: one[0])
        for line, name in told:
            assert wrong.pop(line)[0] == name
    assert not wrong


def test_the_tools_mistakes_are_told_under_the_name_of_their_file(tmp_path: Path) -> None:
    (tmp_path / "zmill.toml").write_text(changed(TRUNNION, ("gouge =", "gauge =")))
    (tmp_path / "tools.toml").write_text(TOOLS.replace("flute_mm =", "flut_mm =", 2) + "[other]\n")
    with pytest.raises(ConfigError) as refused:
        machine_file.load(tmp_path / "zmill.toml")
    told = [str(one).partition(": ")[0].partition(":")[0] for one in refused.value.mistakes]
    assert told == ["zmill.toml", "tools.toml", "tools.toml", "tools.toml"]


def test_a_tool_table_that_is_not_there_hides_no_other_mistake(tmp_path: Path) -> None:
    wrong = ('gouge = "refuse"', 'gouge = "refused"'), ('file = "tools.toml"', 'file = "no_tools.toml"')
    (tmp_path / "m.toml").write_text(changed(TRUNNION, *wrong, ("node = 2", "node = 200")))
    with pytest.raises(ConfigError) as refused:
        machine_file.load(tmp_path / "m.toml")
    assert [one.place[-1] for one in refused.value.mistakes] == ["gouge", "file", "node"]


def test_nodes_that_are_given_twice_are_told_beside_one_that_is_none() -> None:
    nodes = ("node = 4\n", "node = 400\n"), ("node = 2\n", "node = 1\n"), ("node = 11", "node = 5")
    wrong = changed(text().replace('bus = "can1"', 'bus = "can0"'), *nodes)
    assert [(one.place[0], one.place[-1]) for one in mistakes(wrong)] == [
        *(("axis#1", "node"), ("axis#4", "node"), ("io", "node"))
    ]


def test_the_command_line_makes_no_picture_of_a_line_number(tmp_path: Path) -> None:
    """:100: is a sign of its own to rich."""
    lines = TRUNNION.splitlines()
    at = next(number for number, line in enumerate(lines) if line == "node = 4")
    lines[at:at] = [""] * (99 - at)
    (tmp_path / "m.toml").write_text("\n".join(lines).replace("node = 4", "node = 400"))
    shown = CliRunner().invoke(app, ["check", "--machine", str(tmp_path / "m.toml")])
    assert "m.toml:100: [[axis]] A: node = 400" in " ".join(shown.output.split()), shown.output


def test_a_byte_order_mark_and_a_table_in_single_brackets_are_told_as_what_they_are() -> None:
    (one,) = mistakes(f"\ufeff{TRUNNION}")
    assert "byte order mark" in str(one) and one.line == 1
    (one,) = mistakes(changed(TRUNNION, ("[[axis]]", "[axis]")))
    head = TRUNNION.splitlines().index("[[axis]]") + 1
    assert f"line {head} has this table in single brackets" in str(one)


def test_of_a_tool_that_is_set_at_the_machine_they_are_told_too() -> None:
    values = {"radius_mm": -1, "length_mm": "long", "flute_mm": 9.0, "colour": "red"}
    with pytest.raises(ConfigError) as refused:
        setup_data.with_tool(machine_file.load("trunnion"), 2, values)
    sentence = messages.text(refused.value.said, "de")
    assert len(refused.value.mistakes) == 3 and all(name in sentence for name in values if name != "flute_mm")


@pytest.mark.parametrize("words", [("check", "--machine"), ("bus",), ("simulate", "none.ngc", "--machine")])
def test_the_command_line_shows_them_all(tmp_path: Path, words: tuple[str, ...]) -> None:
    file = tmp_path / "m.toml"
    file.write_text(changed(TRUNNION, ("gouge =", "gauge ="), ("node = 2", "node = 200")))
    if "none.ngc" in words:
        words = (words[0], str(machine_file.shipped_program("example1")), *words[2:])
    shown = CliRunner().invoke(app, [*words, str(file)])
    sentences = shown.output.replace("\n", "")
    assert shown.exit_code == 1 and "m.toml:15: " in sentences and "m.toml:65: " in sentences
    as_json = json.loads(CliRunner().invoke(app, [*words, str(file), "--json"]).output.splitlines()[-1])
    assert [one["sentence"].partition(": ")[0] for one in as_json["mistakes"]] == ["m.toml:15", "m.toml:65"]


NO_TOML = [
    # a line, the column where the reader stops, and what is told
    ("gauge", 6, "no = after the key"),
    ("gauge = refuse", 9, "there is no value"),
    ("gauge = ", 9, "there is no value"),
    ('gauge = "refuse', 16, "quotes are not closed"),
    ("gauge = 1 2", 11, "something stands after the value"),
    ("name = 1", 1, "this key stands there already"),
    ("a = { b = 1, b = 2 }", 19, "this key stands there already"),
    ("[machine]", 9, "this table stands there already"),
    ("[machin", 8, "brackets of the table's name are not closed"),
    ("= 3", 1, "no line begins so"),
    ('a = "\\q"', 8, "begins no sign here"),
    ("a = [1 2]", 8, "the list is not closed"),
    ("a = { b = 1", 12, "the table is not closed on its line"),
    ('a = "\x01"', 6, "a sign stands there that cannot be printed"),
]


@pytest.mark.parametrize(("line", "column", "what"), NO_TOML)
def test_what_is_no_toml_has_its_line_its_column_and_what_to_do(line: str, column: int, what: str) -> None:
    content = changed(f"{TRUNNION}\n{TOOLS}", ("gouge =", f"{line}\ngouge ="))
    (one,) = mistakes(content)
    told = str(one)
    assert told.startswith(f"m.toml:15:{column}: ") and what in told and "; allowed: " in told, told
    assert messages.text(one.said, "de").count(";") >= 2


def test_what_is_no_toml_at_the_end_of_the_file_has_its_line() -> None:
    (one,) = mistakes('[machine]\nname = "a"\nname = "b"')
    assert str(one).startswith('m.toml:3:1: name = "b": is not TOML: this key stands there already')
