"""Programs lie in folders by their names; a folder moves whole or not at all, and no name leads elsewhere."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from support.fakes.hostile_requests import SOUND_NAMES
from support.fakes.panels import Scene, sentence, take_control

NAMES = ("top.ngc", "a/one.ngc", "a/two.ngc", "a/b/three.ngc", "ab/four.ngc")


def keep(scene: Scene, name: str, text: str = "") -> None:
    with scene.store.uploads.begin(name) as upload:
        upload.write((text or f"({name})\nM2\n").encode())
        upload.commit()


def listed(scene: Scene) -> list[str]:
    return [program.name for program in scene.store.programs.list()]


def asked(folder: Path, story: Callable[[Scene, Any], Awaitable[None]]) -> None:
    async def told() -> None:
        scene = Scene(folder)
        scene.door.mode = "READY"
        for name in NAMES:
            keep(scene, name)
        async with scene.client() as client:
            await take_control(client)
            await story(scene, client)

    asyncio.run(told())


def test_the_text_around_a_place_is_that_of_the_program_or_of_a_file_that_it_calls(tmp_path: Path) -> None:
    async def story(scene: Scene, client: Any) -> None:
        keep(scene, "a/5.ngc", "o5 sub\nG1 X1O\no5 endsub\n")
        keep(scene, "a/calls.ngc", "G21\nG0 X2\no5 call\nM2\n")
        path, at = "/api/v1/programs/a%2Fcalls.ngc/around", {"line": 2, "column": 6}
        for file, line in (("", "G0 X2"), ("a/calls.ngc", "G0 X2"), ("a/5.ngc", "G1 X1O")):
            lines = (await client.get(path, params={**at, "file": file})).json()["lines"]
            assert lines[-2].endswith(line) and lines[-1].index("^") == 8 + 5
        keep(scene, "a/other.ngc")
        for file in ("a/other.ngc", "none.ngc", "../secret"):
            assert (await client.get(path, params={**at, "file": file})).status_code == 404

    asked(tmp_path, story)


@pytest.mark.parametrize("name", SOUND_NAMES)
def test_every_route_of_a_program_finds_it_by_its_name(tmp_path: Path, name: str) -> None:
    async def story(scene: Scene, client: Any) -> None:
        keep(scene, name)
        keep(scene, "x", "(the text of x is another one)")
        path = f"/api/v1/programs/{quote(name, safe='')}"
        assert (await client.get(path)).json()["name"] == name
        assert (await client.get(f"{path}/text")).text == f"({name})\nM2\n"
        assert (await client.get(f"{path}/around?line=1")).json()["lines"][0].endswith(f"({name})")
        assert (await client.get(f"/api/files/local/{quote(name, safe='')}")).json()["path"] == name
        assert (await client.post("/api/v1/job", json={"program": name})).status_code == 200
        assert scene.door.job is not None and scene.door.job["name"] == name
        scene.door.job = None
        assert (await client.patch(path, json={"name": "n/new.ngc"})).json()["name"] == "n/new.ngc"
        assert (await client.delete("/api/v1/programs/n%2fnew.ngc")).status_code == 204
        assert name not in listed(scene) and "n/new.ngc" not in listed(scene)

    asked(tmp_path, story)


def test_what_is_downloaded_is_called_as_it_is_without_its_folders(tmp_path: Path) -> None:
    async def story(_: Scene, client: Any) -> None:
        answer = await client.get("/api/v1/programs/a%2Fb%2Fthree.ngc/text")
        assert answer.headers["Content-Disposition"] == 'attachment; filename="three.ngc"'

    asked(tmp_path, story)


def test_an_upload_goes_into_the_folder_that_it_names(tmp_path: Path) -> None:
    async def story(scene: Scene, client: Any) -> None:
        sent = {"data": {"name": "new/part.ngc"}, "files": {"file": ("part.ngc", b"M2\n")}}
        answer = await client.post("/api/v1/programs", **sent)
        assert answer.status_code == 201 and answer.headers["Location"].endswith("/new%2Fpart.ngc")
        assert (await client.get(answer.headers["Location"])).json()["name"] == "new/part.ngc"
        assert sorted(p.suffix for p in scene.store.programs.folder.glob("*")) == ["", *[".ngc"] * 6]

    asked(tmp_path, story)


def test_a_folder_is_moved_with_all_within_and_nothing_else(tmp_path: Path) -> None:
    async def story(scene: Scene, client: Any) -> None:
        await client.post("/api/v1/queue", json={"program": "a/b/three.ngc"})
        answer = await client.patch("/api/v1/folders/a", json={"name": "a/b"})
        moved = ["a/b/b/three.ngc", "a/b/one.ngc", "a/b/two.ngc"]
        assert [one["name"] for one in answer.json()["programs"]] == moved
        assert listed(scene) == [*moved, "ab/four.ngc", "top.ngc"]
        assert (await client.get("/api/v1/queue")).json()["entries"][0]["program"] == "a/b/b/three.ngc"
        assert (await client.patch("/api/v1/folders/a%2Fb", json={"name": "a"})).status_code == 200
        assert listed(scene) == sorted(NAMES)

    asked(tmp_path, story)


@pytest.mark.parametrize(
    ("folder", "to", "status", "why"),
    [
        ("a", "ab", 409, "one.ngc"),
        ("a", "../c", 422, "begins with '.'"),
        ("a", "c" * 118, 422, "too long"),
        ("a", "1/2/3/4/5/6/7/8", 422, "deeper"),
        ("nobody", "c", 404, "nobody"),
        ("a%2F..", "c", 404, "a/.."),
        ("", "c", 404, ""),
    ],
)
def test_a_folder_that_cannot_be_moved_stays_as_it_was(
    tmp_path: Path, folder: str, to: str, status: int, why: str
) -> None:
    async def story(scene: Scene, client: Any) -> None:
        keep(scene, "ab/one.ngc")
        before = listed(scene)
        answer = await client.patch(f"/api/v1/folders/{folder}", json={"name": to})
        assert answer.status_code == status and why in sentence(answer)
        assert listed(scene) == before

    asked(tmp_path, story)


def test_a_folder_with_the_loaded_program_stays(tmp_path: Path) -> None:
    async def story(scene: Scene, client: Any) -> None:
        await client.post("/api/v1/job", json={"program": "a/b/three.ngc"})
        answer = await client.patch("/api/v1/folders/a", json={"name": "c"})
        assert answer.status_code == 409 and "a/b/three.ngc" in sentence(answer)
        assert listed(scene) == sorted(NAMES)

    asked(tmp_path, story)


def test_a_sub_is_found_beside_its_caller_then_at_the_top_and_nowhere_else(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    for name in ("sub.ngc", "a/sub.ngc", "b/other.ngc"):
        keep(scene, name, f"o<{Path(name).stem}> sub\n({name})\no<{Path(name).stem}> endsub\nM2\n")
    calls = "o<sub> call\no<other> call\nM2\n"
    for name, found in (
        ("a/main.ngc", {"a/sub.ngc"}),
        ("main.ngc", {"sub.ngc"}),
        ("c/main.ngc", {"sub.ngc"}),
    ):
        keep(scene, name, calls)
        programs = scene.store.programs
        assert set(programs.called(programs.get(name))) == found, name
