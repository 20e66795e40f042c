"""A CiA 301 conformance test, recorded on another device, replayed against a simulated drive.

Every request that concerns an object this drive has too must get the class of answer
that the log has: success, the same abort code, or silence; and what the requests set
going (heartbeats, process data, SYNC, emergencies, boot-up) must come, or not come.
A case is "same", "differs" with the reason why that is right, or "not applicable".
`pytest -s` prints the list.

The drive starts with the other device's default mapping (two PDOs each way, sent on
change), by a data sheet of its own, so that the requests mean the same. The other
device's process objects are replaced by ones of equal size and direction.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from support.drives.lone_drive import Lone
from support.oracles.conformance_log import (
    ANSWER,
    NODE,
    REQUEST,
    Case,
    Step,
    index_of,
    kind,
    read_log,
    read_table,
    write_table,
)

from drives.bench.simulated.data_sheet import EDS, key

TABLE = Path(__file__).parent / "data" / "cia301_conformance.txt"
LOG = "DIRECTRIX_CONFORMANCE_LOG"
TIMEOUT_S = 6.0  # bus time until an expected frame must have come

# The other device's objects and ours of equal size and direction.
INSTEAD = {0x6200: 0x6060, 0x6411: 0x6040, 0x6000: 0x6061, 0x6401: 0x6041, 0x2110: 0x60FF, 0x1200: 0x6064}
MAPPINGS = range(0x1600, 0x1A04)
STATES = ("9.2 State 02", "9.3 State 03", "9.4 State 04")

# Case -> start of the request (or the kind of frame) -> why another answer is right.
ON_REQUEST = "TPDOs on request (252, 253) are optional; the other device refuses them, this one has them"
UNWATCHED = (
    "setting 1006h to 0 ends the watching of SYNC, so a missed one is taken back at once, not with the next"
)
NEWLY_WATCHED = (
    "SYNC is watched here from the first one after 1006h was set; the other device expects it at once"
)
PAUSE = "the log does not hold the tool's pauses: the SYNC of the other device's own 100 ms falls elsewhere"
PHASE = "with a type of 10 every tenth SYNC counts from the start here; the other device starts in mid-count"
SEQUENCE = "a wrong sequence number has an abort code of its own, 05040003h, which the tool accepts as well"
DIFFERS: dict[str, dict[str, str]] = {
    "2.27 SDO 27": {"a28014": SEQUENCE},
    "6.3 Synchronization 03": {"tpdo": PHASE, "emcy0000": NEWLY_WATCHED},
    "6.4 Synchronization 04": {"emcy0000": UNWATCHED},
    "6.6 Synchronization 06": {"emcy0000": UNWATCHED},
    "6.7 Synchronization 07": {"emcy0000": UNWATCHED},
    "6.8 Synchronization 08": {"emcy": NEWLY_WATCHED},
    "prepare 97": {"sync": PAUSE},
    "prepare 135": {"sync": PAUSE},
    "9.1 State 01": {"2f011802fd": ON_REQUEST},
    **{title: dict.fromkeys([f"2f0{n}1802fd" for n in range(4)], ON_REQUEST) for title in STATES},
}


ONLY_THERE = "all requests are for objects that only the other device has"
SKIPPED_THERE = "the tool left it out there: the log holds no request of it"


@dataclass
class Result:
    """How one case went."""

    title: str
    same: int = 0
    left_out: int = 0
    different: list[tuple[str, str]] = field(default_factory=list)  # what, in words

    @property
    def unexplained(self) -> list[str]:
        reasons = DIFFERS.get(self.title, {})
        return [text for what, text in self.different if not any(what.startswith(start) for start in reasons)]

    @property
    def verdict(self) -> str:
        if self.different:
            return "differs"
        return "same" if self.same else "not applicable"

    @property
    def reasons(self) -> str:
        if self.verdict == "not applicable":
            return ONLY_THERE if self.left_out else SKIPPED_THERE
        return "; ".join(dict.fromkeys(DIFFERS.get(self.title, {}).values())) if self.different else ""

    def line(self) -> str:
        counts = f"{self.same} same, {len(self.different)} different, {self.left_out} not applicable"
        return f"{self.title:<34}{self.verdict:<16}{counts}  {self.reasons}".rstrip()


def like_the_other_device(folder: Path) -> Path:
    """A data sheet with its default mapping."""
    text = EDS.read_text(encoding="latin-1")
    defaults: dict[str, object] = {"1401sub1": "$NODEID+0x300"}
    for mapping, entry, count in (
        ("1600", 0x6060_0008, 2),
        ("1601", 0x6040_0010, 4),
        ("1A00", 0x6061_0008, 2),
        ("1A01", 0x6041_0010, 4),
    ):
        defaults |= {f"{mapping}sub{n}": f"{entry:#x}" for n in range(1, count + 1)} | {
            f"{mapping}sub0": count
        }
    for n in range(4):
        off = 0x4000_0000 if n < 2 else 0xC000_0000
        defaults |= {f"180{n}sub1": f"$NODEID+{off + 0x180 + 0x100 * n:#x}", f"180{n}sub2": 255}
    for mapping in ("1602", "1603", "1A02", "1A03"):
        defaults[f"{mapping}sub0"] = 0
    for section, value in defaults.items():
        pattern = rf"(\[{section}\]\n(?:[^\[].*\n)*?DefaultValue=).*"
        text, found = re.subn(pattern, rf"\g<1>{value}", text)
        assert found == 1, section
    made = folder / "like_the_other.eds"
    made.write_text(text, encoding="latin-1")
    return made


class Replay:
    """The log's requests, case by case, to one drive that lives through all of them."""

    def __init__(self, eds: Path) -> None:
        self.lone = Lone(node=NODE, eds=eds)
        self._foreign = False

    def run(self, case: Case) -> Result:
        result = Result(case.title, left_out=case.others)
        heard: list[set[str]] = []
        steps = []
        for step in case.steps:
            if step.can_id == REQUEST and self._is_foreign(step):
                result.left_out += 1
                continue
            answer, kinds = self._play(step)
            steps.append(step)
            heard.append(kinds)
            if step.can_id == REQUEST and answer != step.answer:
                what = step.data.hex()
                result.different.append((what, f"{what}: log {step.answer}, here {answer}"))
            else:
                result.same += 1
        result.different += list(_missing_and_surplus([step.kinds for step in steps], heard))
        return result

    def _is_foreign(self, step: Step) -> bool:
        """Whether it concerns an object that only the other device has."""
        index = index_of(step)
        if index is not None:
            ours = key(index, step.data[3]) in self.lone.drive.dictionary.variables
            unknown_to_both = step.answer in ("06020000", "06090011") or step.data[0] >> 5 == 7
            self._foreign = not ours and not unknown_to_both
        return self._foreign

    def _play(self, step: Step) -> tuple[str, set[str]]:
        """Class of the SDO answer and kinds of all other frames."""
        lone = self.lone
        before = len(lone.heard)
        lone.put(step.can_id, self._translated(step), _pause_s(step))
        deadline_s = lone.bus.now_s + TIMEOUT_S
        while _may_wait(step) and lone.bus.now_s < deadline_s and not step.kinds <= self._kinds(before):
            lone.wait(0.01)
        answers = [data for can_id, data in lone.heard[before:] if can_id == ANSWER]
        return _class(answers), self._kinds(before)

    def _kinds(self, before: int) -> set[str]:
        frames = [frame for frame in self.lone.heard[before:] if frame[0] != ANSWER]
        return {kind(can_id, data, NODE) for can_id, data in frames}

    def _translated(self, step: Step) -> bytes:
        """Our objects in mapping entries; our number of segments in the answer to a block."""
        data = step.data
        if step.can_id != REQUEST:
            return data
        if data[0] == 0xA2 and data[1] < 0x80:
            segment = [frame for can_id, frame in self.lone.heard if can_id == ANSWER][-1]
            return bytes([0xA2, segment[0] & 0x7F]) + data[2:]
        entry = int.from_bytes(data[4:], "little")
        mapped = data[0] == 0x23 and data[3] and int.from_bytes(data[1:3], "little") in MAPPINGS
        if mapped and entry >> 16 in INSTEAD:
            return data[:4] + (INSTEAD[entry >> 16] << 16 | entry & 0xFF).to_bytes(4, "little")
        return data


def _pause_s(step: Step) -> float:
    """The tool's pace, which the log does not hold: its SYNCs and heartbeats are periodic."""
    if step.can_id == 0x80:
        return 0.1
    if step.can_id & 0x780 == 0x700:
        # Watched for 1 s: first the tool is in time, then it is not.
        return 1.09 if step.kinds & {"beat7f", "emcy8130"} else 0.91
    return 0.03 if step.can_id == 0 else 0.006


def _may_wait(step: Step) -> bool:
    """SYNC and heartbeat keep the tool's pace."""
    return step.can_id != 0x80 and step.can_id & 0x780 != 0x700


def _class(answers: list[bytes]) -> str:
    if not answers:
        return "-"
    return answers[0][7:3:-1].hex() if answers[0][0] == 0x80 else "ok"


def _missing_and_surplus(expected: list[set[str]], heard: list[set[str]]) -> Iterator[tuple[str, str]]:
    """Frames that are not answers may stand one request earlier or later in the log."""
    for k in range(len(expected)):
        near = slice(max(0, k - 1), k + 2)
        for what in sorted(expected[k] - set().union(*heard[near])):
            yield what, f"{what} at request {k}: in the log, not here"
        for what in sorted(heard[k] - set().union(*expected[near])):
            yield what, f"{what} at request {k}: here, not in the log"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> list[Result]:
    replay = Replay(like_the_other_device(tmp_path_factory.mktemp("eds")))
    return [replay.run(case) for case in read_table(TABLE)]


def test_every_request_of_the_conformance_test_gets_the_same_class_of_answer(results: list[Result]) -> None:
    print()
    for result in results:
        print(result.line())
    cases = [result for result in results if not result.title.startswith("prepare")]
    print(
        Counter(result.verdict for result in cases), sum(result.same for result in results), "requests same"
    )
    assert len(cases) == 127
    assert [f"{result.title}: {text}" for result in results for text in result.unexplained] == []


def test_every_explanation_is_needed(results: list[Result]) -> None:
    found = {result.title: [what for what, _ in result.different] for result in results}
    for title, reasons in DIFFERS.items():
        for start in reasons:
            assert any(what.startswith(start) for what in found[title]), (title, start)


def test_the_table_is_what_the_log_says() -> None:
    log = os.environ.get(LOG)
    if log is None:
        pytest.skip(f"{LOG} does not name the log; the table made from it is used")
    assert TABLE.read_text(encoding="ascii").endswith("\n" + write_table(read_log(Path(log))))
