"""A profile drafted from a sheet commissions drives with that sheet, or the draft says why none does."""

from __future__ import annotations

import os
import random
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from drives import commission, pdo
from drives.bench.simulated import rig
from drives.commissioning import draft, possible, sheet
from drives.profile import CyclicMode, Override, Supervision
from drives.settings import BusSettings, MasterSettings, NodeSettings
from drives.text_file import TextFile
from drives.texts import english

EDS = Path(__file__).parents[2] / "config" / "eds" / "simulated_drive.eds"
MASTER = MasterSettings(period_s=0.004)
BUS = BusSettings("can", "virtual", "", 1_000_000)
# What one family or another really lacks, and what none can lack.
LACKED = ("1016", "100C", "100D", "6007", "605A", "607C", "6099", "609A", "60B1", "60C5", "6502", "60F4")
NEEDED = ("6064", "6041", "6065", "60C2")


def without(*indexes: str) -> str:
    """The simulated drive's sheet without these objects."""
    text = EDS.read_text(encoding="latin-1")
    for index in indexes:
        text = re.sub(rf"(?i)\[{index}(sub\w+)?\]\n(?:[^\[\n].*\n|\n)*", "", text)
    return text


def drafted(text: str) -> draft.Draft:
    return draft.draft("mine", sheet.read(text, "mine.eds"), MASTER)


def node_of(found: draft.Draft, text: str) -> NodeSettings:
    profile = found.profile
    return NodeSettings(
        "X",
        "can",
        1,
        TextFile("mine.eds", text),
        counts_min=-1000,
        counts_max=5000,
        following_error_counts=900,
        homing_method=profile.homing_methods[-1],
        homing_fast_counts_s=500,
        period_s=MASTER.period_s,
        profile=profile,
        unsupervised=profile.supervision is Supervision.NONE,
        feed_forward=profile.takes_feed_forward,
    )


def commissioned(node: NodeSettings) -> None:
    """By the simulated drive of that sheet. Raises CommissionError."""
    made = rig([node], [BUS])
    network = commission.Network(made.port(pdo.SERVICE_FILTERS), commission.stepped_pump(made))
    commission.commission(network, [node], MASTER, bit_rate=BUS.bit_rate)


def test_a_drive_that_can_everything_has_the_general_profile() -> None:
    found = drafted(without())
    profile = found.profile
    assert found.problems == () and profile.mode is CyclicMode.CSP and profile.takes_feed_forward
    assert profile.supervision is Supervision.HEARTBEAT and profile.optional == ()
    assert (profile.quick_stop_code, profile.abort_code, profile.home_offset) == (2, 3, 0x607C)


@pytest.mark.parametrize(
    ("lacks", "key", "value"),
    [
        (("1016",), "supervision", Supervision.GUARDING),
        (("1016", "100C", "100D"), "supervision", Supervision.NONE),
        (("6007",), "abort_code", None),
        (("605A",), "quick_stop_code", None),
        (("607C",), "home_offset", None),
        (("60B1",), "takes_feed_forward", False),
        (("6099", "609A"), "optional", (0x6099, 0x609A)),
        (("1400", "1600"), "rpdo", 2),
        (("1800", "1A00"), "tpdo", 2),
    ],
)
def test_what_a_drive_lacks_is_in_its_profile_and_said(
    lacks: tuple[str, ...], key: str, value: object
) -> None:
    text = without(*lacks)
    found = drafted(text)
    assert found.problems == () and getattr(found.profile, key) == value
    assert all(english(note) for note in found.notes.values())
    commissioned(node_of(found, text))


@pytest.mark.parametrize("index", NEEDED)
def test_what_no_profile_mends_is_a_problem_that_names_the_object(index: str) -> None:
    assert any(f"{index}h" in english(problem) for problem in drafted(without(index)).problems)


@pytest.mark.parametrize(
    "number", [*range(6), *(pytest.param(n, marks=pytest.mark.slow) for n in range(6, 150))]
)
def test_draft_check_and_commissioning_judge_alike(number: int) -> None:
    draw = random.Random(number)
    lacks = draw.sample(LACKED, draw.randrange(5)) + draw.sample(NEEDED, draw.random() < 0.2)
    text = without(*lacks)
    found = drafted(text)
    node = node_of(found, text)
    checked = possible.problems(node, MASTER, sheet.read(text, "mine.eds"))
    assert bool(checked) == bool(found.problems), (lacks, [*map(english, checked)])
    try:
        commissioned(node)
    except commission.CommissionError as error:
        assert checked, (lacks, error)
    else:
        assert not checked, (lacks, [*map(english, checked)])


def test_units_by_the_defaults_are_judged_as_commissioning_does() -> None:
    """60A9h in rev/min, and nothing that says what a revolution is: refused by both, or by neither."""
    head, _, rest = without("608F", "6092").partition("[60A9]\n")
    text = head + "[60A9]\n" + rest.replace("DefaultValue=0\n", "DefaultValue=0x00B44700\n", 1)
    node = node_of(drafted(text), text)
    mended = Override(0x60A9, 0, "set so by its maker's tool", default=0)
    for one, allowed in ((node, False), (replace(node, velocity_unit_counts_s=60.0), True)):
        problems, _ = commission.on_paper(one, MASTER)
        assert bool(problems) is not allowed, problems
        if allowed:
            commissioned(one)
        else:
            with pytest.raises(commission.CommissionError, match="60A9h"):
                commissioned(one)
    assert not commission.on_paper(replace(node, overrides=(mended,)), MASTER)[0]


def makers() -> list[str]:
    folder = os.environ.get("DIRECTRIX_EDS", "")
    return sorted(str(one) for one in Path(folder).glob("*.[ed][dc][sf]")) if folder else []


# Words of 60A8h, 60A9h, 60AAh and ratios of factors as makers have them, and some that nobody has.
WORDS: dict[int, tuple[int, ...]] = {
    0x60A8: (0, 0x00B50000, 0xFA010000, 0xFD010000, 0xFD410000, 0x00B40000),
    0x60A9: (0, 0x00B44700, 0x00B50300, 0xFD010300, 0x00410300, 0x00775500, 0x00B45500),
    0x60AA: (0, 0x00B50300, 0x00C00300, 0x00B44700),
    0x607E: (0, 0x80, 0xC0),
    0x6080: (0, 0xBB8, 0x1E8480),
}
MACHINES: tuple[dict[str, Any], ...] = (
    {},
    {"counts_per_si": 1e6},
    {"counts_per_si": 1e5},
    {"counts_per_si": 57_295.779513, "rotary": True},
    {"velocity_unit_counts_s": 1.0},
    {"velocity_unit_counts_s": 68.2666667},
)


# What commissioning asks of how a drive stops, and how fast its motor may turn, is asked on paper, too.
MOVING: tuple[dict[str, Any], ...] = tuple(
    {"velocity_counts_s": speed, "acceleration_counts_s2": 10.0 * speed, **more}
    for speed in (2e3, 2e5, 4e7)
    for more in ({}, {"velocity_unit_counts_s": 68.2666667}, {"feed_forward": True})
)


@pytest.mark.parametrize("eds", [str(EDS), *makers()])
@pytest.mark.parametrize("seed", range(6))
def test_three_verdicts_never_differ(eds: str, seed: int) -> None:
    """A sheet's alone, a machine's by the sheet, commissioning's: what nobody refuses, what every machine
    is refused for, and, by name, what the one machine is refused for and another not.
    """
    draw = random.Random(seed)
    text = Path(eds).read_text(encoding="latin-1")
    for index, words in WORDS.items():
        held = re.compile(rf"(?i)(\[{index:04X}\]\n(?:[^\[\n].*\n)*?DefaultValue=).*")
        text = held.sub(rf"\g<1>{draw.choice(words):#x}", text)
    found = draft.draft("mine", sheet.read(text, "mine.eds"), MASTER)
    node = replace(node_of(found, text), homing_fast_counts_s=0, feed_forward=False)
    verdict = possible.of_profile(found.profile, sheet.of(node), MASTER, BUS.bit_rate)
    refused = []
    for said in (*MACHINES, *MOVING):
        one = replace(node, **said)
        refused.append(bool(commission.on_paper(one, MASTER, BUS.bit_rate)[0]))
        try:
            commissioned(one)
            assert not refused[-1], said
        except commission.CommissionError as error:
            assert refused[-1], (said, str(error))
    del refused[len(MACHINES) :]  # of no sheet alone
    assert all(refused) or not verdict.problems, [*map(english, verdict.problems)]
    if not verdict.problems:
        wordless = [
            one for one, said in zip(refused, MACHINES, strict=True) if "velocity_unit_counts_s" not in said
        ]
        assert any(wordless) <= bool(verdict.undecided), "a unit of its own may be a mistake of the file"
        assert not all(refused), [*map(english, verdict.undecided)]


@pytest.mark.parametrize("eds", makers() or [pytest.param("", marks=pytest.mark.skip("DIRECTRIX_EDS"))])
def test_a_makers_sheet_gives_a_profile_that_runs_or_says_why_not(eds: str) -> None:
    text = Path(eds).read_text(encoding="latin-1")
    found = draft.draft("mine", sheet.load(eds, 1), MASTER)
    node = node_of(found, text)
    if [*possible.default_problems(node, sheet.read(text, "mine.eds"))]:
        node = replace(node, velocity_unit_counts_s=1.0)  # as the sentence has it
    if not found.problems:
        commissioned(node)
