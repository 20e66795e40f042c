"""A text that is being written is read by a process, one at a time, and nothing of it is kept."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

import pytest

from controller.api.answers import Refusal
from controller.api.drafts import Drafts
from controller.api.store import Store
from controller.machine import machine_file, setup_data
from controller.messages import text

SUB = b"o<lift> sub\nG0 Z5\no<lift> endsub\n"


@pytest.fixture
def store(tmp_path: Path) -> Store:
    setup_data.note(tmp_path, machine_file.load("trunnion"))
    return Store(tmp_path)


def test_every_line_that_is_refused_is_told_with_its_place(store: Store) -> None:
    found = asyncio.run(Drafts(store).read("a.ngc", "G21 G90\nG1 Q7\nG1 X1 F100\nG1 X1..5\nM30\n"))
    assert [one["line"] for one in found] == [2, 4]
    assert found[1]["column"] == 7 and text(found[1])
    assert store.programs.list() == []


def test_a_sub_of_a_stored_program_is_known(store: Store) -> None:
    calls = "G21\no<lift> call\nM30\n"
    assert asyncio.run(Drafts(store).read("a.ngc", calls))
    with store.uploads.begin("lift.ngc") as upload:
        upload.write(SUB)
        upload.commit()
    assert asyncio.run(Drafts(store).read("a.ngc", calls)) == []


def test_one_is_read_at_a_time(store: Store) -> None:
    async def both() -> list[object]:
        drafts = Drafts(
            store, (sys.executable, "-c", "import sys; sys.stdin.read(); print('{\"refusals\": []}')")
        )
        return await asyncio.gather(*(drafts.read("a", "M2\n") for _ in range(2)), return_exceptions=True)

    first, second = asyncio.run(both())
    assert first == [] and isinstance(second, Refusal) and second.status == 429


def test_a_reader_that_dies_or_was_never_told_of_a_machine_is_a_sentence(
    store: Store, tmp_path: Path
) -> None:
    bare = Store(tmp_path / "bare")
    for drafts in (Drafts(store, (sys.executable, "-c", "")), Drafts(bare)):
        with pytest.raises(Refusal) as refused:
            asyncio.run(drafts.read("a.ngc", "M2\n"))
        assert refused.value.status == 503 and "a.ngc" in str(refused.value)
