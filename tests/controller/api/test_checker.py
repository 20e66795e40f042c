"""Checks after an upload: in a process of their own, with progress, and never in the way."""

from __future__ import annotations

import asyncio
import json
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from controller.api.answers import Refusal
from controller.api.checker import Checker, Drafts
from controller.api.store import Program, ProgramCheck, Store
from controller.cli import check_worker
from controller.machine import machine_file, setup_data
from controller.messages import text, with_sentences
from controller.runtime import checked
from controller.store import service_store
from controller.store.set_up_store import FITTING

SOUND = b"O1\nG1 X10 F100\nG1 X20 Y5\nM2\n"
WRONG = b"G1 X10 F100\nG1 X9999\nM2\n"
FAKE = """
import json, sys
job = json.loads(sys.stdin.read())
text = open(job["program"]).read()
print(json.dumps({"progress": 0.5}), flush=True)
if "wait" in text:
    import time; time.sleep(60)
if "die" not in text:
    print(json.dumps({"state": "passed", "result": {"name": job["name"]}}), flush=True)
"""


def kept(store: Store, name: str, text: bytes) -> Program:
    with store.uploads.begin(name) as upload:
        upload.write(text)
        return upload.commit()


def awaited(checker: Checker, program: Program, *states: str) -> ProgramCheck:
    for _ in range(60_000):
        found = checker.of(program)
        if found and found.state in states:
            return found
        time.sleep(0.01)
    raise AssertionError(f"{found} never became {states}")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    setup_data.note(tmp_path, machine_file.load("trunnion"))
    return Store(tmp_path)


def fake(store: Store) -> Checker:
    return Checker(store, (sys.executable, "-c", FAKE))


def test_a_program_is_checked_by_a_process_and_the_check_is_what_a_start_finds(store: Store) -> None:
    program, checker = kept(store, "a", SOUND), Checker(store)
    checker.ask(program)
    found = awaited(checker, program, "passed", "refused", "failed")
    checker.close()
    assert found.state == "passed", found.result
    assert found.result["blocks"] == 3 and found.result["duration_s"] > 5.0
    assert found.result["takes_s"] == found.result["duration_s"] + found.result["waits_s"]
    task = checked.task(SOUND, "a", machine_file.load("trunnion"))
    there, warning = checked.find(task, store.folder / "checks")
    assert there and not warning and there.duration_s == found.result["duration_s"]


def test_the_end_of_a_check_is_told_with_the_programs_name(store: Store) -> None:
    program, checker, told = kept(store, "a", SOUND), fake(store), list[str]()
    checker.tell = told.append
    checker.ask(program)
    awaited(checker, program, "passed")
    checker.close()
    assert told == ["a"]


def test_a_wrong_program_is_refused_with_its_line(store: Store) -> None:
    program = kept(store, "b", WRONG)
    said: list[float] = []
    job = {"name": "b", "program": store.programs.path(program.sha256), "lines": 3, "state": store.folder}
    state, result = check_worker.check(job, said.append)
    assert (state, result["line"]) == ("refused", 2) and "X" in text(result)


def test_a_program_that_calls_a_cycle_that_ships_is_checked_and_the_next_one_too(store: Store) -> None:
    """No file of the store has the cycle: it comes along."""
    setup_data.note(store.folder, machine_file.load("machining_centre"))
    head = b"T99 M6\nG21 G90 G54 G43 H99\nG0 X0 Y0 Z30\n"
    calls = kept(store, "bore.ngc", head + b"o<probe_bore> call [20] [0]\nM30\n")
    behind = kept(store, "behind.ngc", b"G21\nG0 X1\nM30\n")
    assert set(store.programs.called(calls)) >= {"probe_bore.ngc", "probe_touch.ngc"}
    assert store.programs.text_of(calls, "probe_bore.ngc").read_bytes().startswith(b"; Centre")
    checker = Checker(store)
    try:
        for program in (calls, behind):
            checker.ask(program)
            assert awaited(checker, program, "passed", "refused", "failed").state == "passed"
    finally:
        checker.close()


def test_a_mistake_in_a_called_file_is_told_with_its_name(store: Store) -> None:
    kept(store, "5.ngc", b"o5 sub\nG1 X1O\no5 endsub\n")
    program = kept(store, "calls", b"G21\nG0 X1\no5 call\nM2\n")
    job = {"name": "calls", "program": store.programs.path(program.sha256), "lines": 4, "state": store.folder}
    state, result = check_worker.check({**job, "files": store.programs.called(program)}, lambda _: None)
    assert (state, result["file"], result["line"], result["column"]) == ("refused", "5.ngc", 2, 6)


def test_what_a_check_notes_is_told_in_the_readers_language(store: Store) -> None:
    program = kept(store, "a", b"G21 G64\nG1 X1 F500\nM2\n")
    job = {"name": "a", "program": store.programs.path(program.sha256), "lines": 3, "state": store.folder}
    (note,) = check_worker.check(job, lambda _: None)[1]["notes"]
    (english,), (german,) = (with_sentences([note], language) for language in ("en", "de"))
    assert english["line"] == 2 and english["sentence"].startswith("G64 without P blends")
    assert german["sentence"].startswith("G64 ohne P verrundet nur")


def test_a_check_belongs_to_the_tools_and_offsets_it_was_made_with(store: Store) -> None:
    program, checker = kept(store, "a", SOUND), fake(store)
    checker.ask(program)
    awaited(checker, program, "passed")
    service_store.put(store.folder, FITTING, {"offsets": {"G54": [1.0, 2.0, 3.0]}})
    assert checker.of(program) is None
    checker.ask(program)
    awaited(checker, program, "passed")
    checker.close()


def test_a_worker_that_dies_is_a_failed_check_and_the_next_one_is_made(store: Store) -> None:
    checker = fake(store)
    first, second = kept(store, "a", b"die\n"), kept(store, "b", b"M2\n")
    checker.ask(first)
    checker.ask(second)
    assert "without a result" in text(awaited(checker, first, "failed").result)
    assert awaited(checker, second, "passed").result == {"name": "b"}
    checker.close()


MORE = """
import json, sys
job = json.loads(sys.stdin.read())
print(json.dumps({"state": "passed", "result": {"blocks": 3}, "more": True}), flush=True)
if "die" not in open(job["program"]).read():
    result = {"blocks": 3, "verified": {"overcut_mm": 0.1}}
    print(json.dumps({"state": "passed", "result": result}), flush=True)
"""


def test_a_check_has_passed_before_its_surfaces_are_looked_at_and_stays_so(store: Store) -> None:
    checker = Checker(store, (sys.executable, "-c", MORE))
    for words, verified in ((b"M2\n", True), (b"die\n", False)):
        program = kept(store, "a", words)
        checker.ask(program)
        assert "blocks" in awaited(checker, program, "passed").result
        other = kept(store, "b", b"M2 " + words)  # waited for: then the first one is done with
        checker.ask(other)
        awaited(checker, other, "passed")
        found = checker.of(program)
        assert found and found.state == "passed" and ("verified" in found.result) == verified
    checker.close()


def test_the_surfaces_of_a_checked_program_are_told_with_maps(store: Store) -> None:
    program = kept(store, "a", machine_file.shipped_program("example1_ready").read_bytes())
    seen: list[check_worker.Seen] = []
    job = {"name": "a", "program": store.programs.path(program.sha256), "lines": 9, "state": store.folder}
    assert check_worker.check(job, lambda _: None, seen.append)[0] == "passed"
    verified = json.loads(json.dumps(check_worker.verified(*seen[0])))
    (cone,) = verified["surfaces"]
    assert verified["overcut_mm"] < 1e-4 and verified["left_out"] == 0
    assert len(cone["map_um"]) == 9 and {len(row) for row in cone["map_um"]} == {33}
    assert all(abs(t) < 0.1 for row in cone["map_um"] for t in row)
    # The paper's Example 1: a whole turn of radius 15 mm.
    assert cone["along_mm"] == pytest.approx([94.2478 * k / 4.0 for k in range(5)], abs=0.01)
    part = machine_file.load("trunnion").part()
    for ends in cone["rulings_mm"]:  # upper and lower end, seen from the table
        (x, y, z), low = part.from_parent(tuple(ends[:3])), part.from_parent(tuple(ends[3:]))
        assert (np.hypot(x, y), z) == pytest.approx((10.0, 10.0), abs=2e-3)
        assert (np.hypot(*low[:2]), low[2]) == pytest.approx((15.0, 0.0), abs=2e-3)


def test_a_panel_that_ends_during_a_check_leaves_it_to_the_next(store: Store) -> None:
    program, checker = kept(store, "a", b"wait\n"), fake(store)
    checker.ask(program)
    assert awaited(checker, program, "running").progress == 0.5
    checker.close()
    assert [check.state for check in store.checks.interrupted()] == ["running"]
    again = Checker(store, (sys.executable, "-c", FAKE.replace("wait", "never")))
    again.look()
    awaited(again, program, "passed")
    again.close()


def test_a_program_that_came_by_another_way_is_found_and_checked(store: Store) -> None:
    program, checker = kept(store, "a", SOUND), fake(store)
    checker.look()
    awaited(checker, program, "passed")
    checker.close()


def test_looking_again_and_again_asks_once(store: Store, tmp_path: Path) -> None:
    count = tmp_path / "count"
    counting = f"open({str(count)!r}, 'a').write('x')\n{FAKE}"
    checker = Checker(store, (sys.executable, "-c", counting))
    programs = [kept(store, name, f"M2 ; {name}\n".encode()) for name in "abc"]
    for _ in range(20):
        checker.look()
        checker.ask(programs[0])
    for program in programs:
        awaited(checker, program, "passed")
        checker.look()
    checker.close()
    assert count.read_text() == "xxx"


def test_a_check_that_ends_while_it_is_asked_for_again_is_made_once(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    program, checker = kept(store, "a", b"M2\n"), fake(store)
    get, asked_again, made = store.checks.get, threading.Event(), list[str]()

    def checked_now(program: Program, _: str) -> tuple[str, dict[str, object]]:
        made.append(program.name)
        asked_again.wait(60.0)
        return "passed", {}

    def overtaken(sha256: str, machine: str) -> ProgramCheck | None:
        """Where the check may end meanwhile, what this tells is old when it is heard."""
        found = get(sha256, machine)
        asked_again.set()
        until_s = time.monotonic() + 0.2
        while checker._pending and time.monotonic() < until_s:
            time.sleep(0.001)
        return found

    monkeypatch.setattr(checker, "_checked", checked_now)
    checker.ask(program)
    with monkeypatch.context() as patched:
        patched.setattr(store.checks, "get", overtaken)
        checker.ask(program)
    awaited(checker, program, "passed")
    checker.close()
    assert made == ["a"]


def test_without_a_machine_nothing_is_checked(tmp_path: Path) -> None:
    store = Store(tmp_path)
    program, checker = kept(store, "a", SOUND), fake(store)
    checker.ask(program)
    checker.look()
    assert checker.of(program) is None
    checker.close()
    assert json.loads(json.dumps(store.checks.interrupted())) == []


# A text that is being written is read by a process, one at a time, and nothing of it is kept.

SUB = b"o<lift> sub\nG0 Z5\no<lift> endsub\n"


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


def test_what_is_refused_in_a_called_file_is_told_at_the_line_that_calls_it(store: Store) -> None:
    with store.uploads.begin("lift.ngc") as upload:
        upload.write(SUB.replace(b"Z5", b"Z5 QQ"))
        upload.commit()
    (found,) = asyncio.run(Drafts(store).read("a.ngc", "G21\nG90\no<lift> call\nM30\n"))
    assert found["line"] == 3 and text(found).startswith("lift.ngc:2:")


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
