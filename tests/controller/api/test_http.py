"""The panel's routes against a machine that only keeps its mode."""

from __future__ import annotations

import asyncio
import hashlib
import re
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_socket import FakeDoor
from support.fakes.panels import Scene, sentence, take_control

from controller import messages
from controller.api import http
from controller.api.service_client import FRESH_S, SocketServiceClient
from controller.program.codes import CYCLES
from controller.service.jogging import Presses
from controller.service.socket_server import Server

PROGRAM = b"G21\nG0 X0\nM2\n"
SHA = hashlib.sha256(PROGRAM).hexdigest()


def part(name: str = "part.ngc", text: bytes = PROGRAM) -> dict[str, Any]:
    return {"files": {"file": (name, text)}}


def test_a_program_is_uploaded_loaded_run_held_resumed_and_stopped_by_requests_alone(tmp_path: Path) -> None:
    async def story() -> list[str]:
        scene = Scene(tmp_path)
        async with scene.client() as client:
            made = await client.post("/api/v1/programs", **part(), data={"sha256": SHA})
            assert made.status_code == 201, made.text
            assert made.json()["sha256"] == SHA
            await take_control(client)
            steps: list[tuple[str, str, Any]] = [
                ("POST", "/job", {"program": "part.ngc"}),
                ("POST", "/machine/home", {}),
                ("POST", "/machine/enable", None),
                ("POST", "/cycle/start", None),
                ("POST", "/cycle/hold", None),
                ("PUT", "/overrides/feed", {"share": 0.5}),
                ("POST", "/cycle/resume", None),
                ("POST", "/cycle/stop", None),
            ]
            for method, path, body in steps:
                answer = await client.request(method, "/api/v1" + path, json=body)
                assert answer.status_code == 200, (path, answer.text)
            now = (await client.get("/api/v1/status")).json()
            assert now["job"]["name"] == "part.ngc"
            assert now["control"] == "local"
            return scene.door.moved

    verbs = ["load", "home", "enable", "start", "hold", "override", "resume", "stop"]
    assert asyncio.run(story()) == verbs


def test_where_a_changers_tools_are_is_confirmed_by_a_request(tmp_path: Path) -> None:
    async def story() -> list[tuple[str, dict[str, Any]]]:
        scene = Scene(tmp_path)
        async with scene.client() as client:
            await take_control(client)
            for body in ({"spindle": 7, "away": [3, 1], "clear": True}, {"spindle": 0, "clear": True}):
                answer = await client.post("/api/v1/changer/confirm", json=body)
                assert answer.status_code == 200, answer.text
            answer = await client.put("/api/v1/changer/pockets/2", json={"tool": 7})
            assert answer.status_code == 200, answer.text
            return scene.door.asked

    assert asyncio.run(story()) == [
        ("changer_confirm", {"spindle": 7, "away": [3, 1], "clear": True}),
        ("changer_confirm", {"spindle": 0, "away": [], "clear": True}),
        ("changer_pocket", {"pocket": 2, "tool": 7}),
    ]


def test_a_probing_cycle_is_listed_drawn_and_run_by_requests(tmp_path: Path) -> None:
    async def story() -> list[tuple[str, dict[str, Any]]]:
        scene = Scene(tmp_path)
        async with scene.client() as client:
            told = (await client.get("/api/v1/probing")).json()
            assert told["offsets"][:2] == ["none", "G54"]
            for cycle in told["cycles"]:
                drawn = await client.get(f"/api/v1/probing/{cycle['name']}.svg")
                assert drawn.status_code == 200 and drawn.headers["content-type"] == "image/svg+xml"
                assert letters_of(cycle) == set(re.findall(r">([A-Za-z])</text>", drawn.text))
            assert (await client.get("/api/v1/probing/touch.svg")).status_code == 404
            await take_control(client)
            scene.door.mode = "READY"
            body = {"cycle": "web", "values": {"axis": "Y", "half": 12.5}, "offset": "G55"}
            answer = await client.post("/api/v1/probing", json=body)
            assert answer.status_code == 200, answer.text
            for wrong in ({"cycle": 3}, {"cycle": "web", "values": {"half": None}}, {"values": {}}):
                assert (await client.post("/api/v1/probing", json=wrong)).status_code == 422
            return scene.door.asked

    values = {"axis": "Y", "half": 12.5}
    assert asyncio.run(story()) == [("probe", {"cycle": "web", "values": values, "offset": "G55"})]


def test_every_canned_cycle_is_drawn(tmp_path: Path) -> None:
    async def story() -> None:
        async with Scene(tmp_path).client() as client:
            told = (await client.get("/api/v1/cycles")).json()["cycles"]
            assert {*CYCLES} <= set(told)
            for code in told:
                drawn = await client.get(f"/api/v1/cycles/{code}.svg")
                assert drawn.status_code == 200 and drawn.text.startswith("<svg")
            answer = await client.get("/api/v1/cycles/G88.svg")
            assert answer.status_code == 404 and "there are G33.1, G73" in sentence(answer)

    asyncio.run(story())


def letters_of(cycle: dict[str, Any]) -> set[str]:
    """The letters that the texts of its values have, as "Down (d)"; the same in every language."""
    pages = [messages.of(language).page for language in messages.LANGUAGES]
    keys = [f"probing.value.{value['name']}" for value in cycle["values"]]
    found = [{letter for key in keys for letter in re.findall(r"\((.)\)", page[key])} for page in pages]
    assert all(one == found[0] for one in found)
    return found[0]


def test_a_refusal_of_the_machine_names_mode_request_and_reason(tmp_path: Path) -> None:
    async def story() -> None:
        async with Scene(tmp_path).client() as client:
            await take_control(client)
            answer = await client.post("/api/v1/cycle/start")
            assert answer.status_code == 409
            assert answer.json()["error"] == {
                "code": "refused",
                "key": "text",
                "values": {"text": "start is refused in OFF."},
                "sentence": "start is refused in OFF.",
                "mode": "OFF",
                "request": "START",
            }

    asyncio.run(story())


OFFER = {
    "offered": True,
    "sentence": None,
    "name": "part.ngc",
    "sha256": SHA,
    "line": 2,
    "fraction": 0.5,
    "exact": True,
}


def test_what_was_interrupted_is_offered_by_the_name_of_its_content_and_gone_on_with_only_when_asked(
    tmp_path: Path,
) -> None:
    async def story() -> None:
        scene = Scene(tmp_path)
        async with scene.client() as client:

            async def offer() -> dict[str, Any]:
                answer = await client.get("/api/v1/restart")
                assert answer.status_code == 200, answer.text
                return dict(answer.json())

            assert (await offer())["offered"] is False
            scene.door.restart = OFFER
            found = await offer()
            assert (found["offered"], found["program"]) == (False, None) and "upload it again" in found[
                "sentence"
            ]
            await client.post("/api/v1/programs", **part())
            assert (await offer())["program"] == "part.ngc"
            await client.patch("/api/v1/programs/part.ngc", json={"name": "other.ngc"})
            found = await offer()
            assert (found["offered"], found["program"], found["line"]) == (True, "other.ngc", 2)
            await take_control(client)
            job = {"program": "other.ngc", "restart": True}
            assert (await client.post("/api/v1/job", json={**job, "line": 1})).status_code == 409
            assert (await client.post("/api/v1/job", json=job)).status_code == 200
            assert [args["restart"] for verb, args in scene.door.asked if verb == "load"] == [True]
            scene.door.restart = {**OFFER, "offered": False, "sentence": "Home all axes first."}
            found = await offer()
            assert (found["offered"], found["sentence"]) == (False, "Home all axes first.")

    asyncio.run(story())


def test_the_loaded_program_is_neither_overwritten_nor_renamed_nor_deleted(tmp_path: Path) -> None:
    async def story() -> None:
        async with Scene(tmp_path).client() as client:
            await client.post("/api/v1/programs", **part())
            await take_control(client)
            await client.post("/api/v1/job", json={"program": "part.ngc"})
            for answer in (
                await client.post("/api/v1/programs", **part(text=b"M30\n")),
                await client.patch("/api/v1/programs/part.ngc", json={"name": "other.ngc"}),
                await client.delete("/api/v1/programs/part.ngc"),
                await client.post("/api/files/local", **part(text=b"M30\n")),
            ):
                assert answer.status_code == 409, answer.text
                assert "loaded or running" in sentence(answer)
            assert (await client.get("/api/v1/programs/part.ngc/text")).content == PROGRAM
            await client.delete("/api/v1/job")
            assert (await client.delete("/api/v1/programs/part.ngc")).status_code == 204
            assert (await client.get("/api/v1/programs/part.ngc")).status_code == 404

    asyncio.run(story())


@pytest.mark.parametrize(
    ("name", "data", "why"),
    [
        ("../../etc/passwd", {}, "begins with '.'"),
        ("..", {}, "begins with '.'"),
        ("part.ngc", {"sha256": "0" * 64}, "announced"),
        ("part.ngc", {"sha256": "nonsense"}, "64 hexadecimal"),
    ],
)
def test_a_hostile_upload_is_refused_with_a_sentence_and_keeps_nothing(
    tmp_path: Path, name: str, data: dict[str, str], why: str
) -> None:
    async def story() -> None:
        scene = Scene(tmp_path)
        async with scene.client() as client:
            answer = await client.post("/api/v1/programs", **part(name), data=data)
            assert 400 <= answer.status_code < 500
            assert why in sentence(answer)
        assert not scene.store.programs.list()
        assert not list(scene.store.programs.incoming.iterdir())

    asyncio.run(story())


def test_what_does_not_fit_the_description_is_refused_with_a_sentence(tmp_path: Path) -> None:
    async def story() -> None:
        async with Scene(tmp_path).client() as client:
            await take_control(client)
            for body in ({"share": "1"}, {"share": 7}, {}, {"share": 1, "more": 2}, [], 3):
                answer = await client.put("/api/v1/overrides/feed", json=body)
                assert answer.status_code == 422
                assert sentence(answer).startswith("body")
            for content in (b"{", b"\xff", b"[" * 5000):
                answer = await client.put(
                    "/api/v1/overrides/feed", content=content, headers={"Content-Type": "application/json"}
                )
                assert answer.status_code == 422
            answer = await client.post("/api/v1/mdi", content=b" " * 200_000)
            assert answer.status_code == 413

    asyncio.run(story())


def test_an_unknown_path_or_method_gets_the_same_form_of_answer(tmp_path: Path) -> None:
    async def story() -> None:
        async with Scene(tmp_path).client() as client:
            missing = await client.get("/api/v1/nothing")
            assert (missing.status_code, missing.json()["error"]["code"]) == (404, "http")
            wrong = await client.put("/api/v1/programs/a")
            assert wrong.status_code == 405
            assert wrong.headers["Allow"] == "DELETE, GET, PATCH"

    asyncio.run(story())


def test_without_the_service_looking_and_uploading_go_on_and_moving_is_told_to_be_impossible(
    tmp_path: Path,
) -> None:
    async def story() -> None:
        scene = Scene(tmp_path)
        scene.door.there = False
        async with scene.client() as client:
            assert (await client.post("/api/v1/programs", **part())).status_code == 201
            assert len((await client.get("/api/v1/programs")).json()["programs"]) == 1
            assert (await client.get("/api/v1/runs")).status_code == 503
            await take_control(client)
            answer = await client.post("/api/v1/cycle/hold")
            assert answer.status_code == 503
            assert "start it with" in sentence(answer)

    asyncio.run(story())


def test_a_jog_that_comes_after_the_stop_of_its_press_moves_nothing(tmp_path: Path) -> None:
    async def story() -> list[str]:
        scene = Scene(tmp_path)
        scene.door.mode = "READY"
        async with scene.client() as client:
            await take_control(client)
            move = {"frame": "joint", "axis": "X", "speed": 0.5, "press": "a1"}
            assert (await client.post("/api/v1/jog", json=move)).status_code == 200
            assert (await client.post("/api/v1/jog/stop", json={"press": "a1"})).status_code == 200
            late = await client.post("/api/v1/jog", json=move)
            assert late.status_code == 409
            assert "press it again" in sentence(late)
        return scene.door.moved

    assert asyncio.run(story()) == ["jog", "jog_stop"]


@pytest.mark.parametrize("press", ["a1", ""])
@pytest.mark.parametrize("path", ["jog/stop", "cycle/stop", "cycle/hold", "machine/estop"])
def test_a_stop_from_another_page_ends_a_held_jog_until_a_new_press(
    path: str, press: str, tmp_path: Path
) -> None:
    """Whoever holds the key asks again 70 ms later, and knows of nothing."""

    async def story() -> list[int]:
        scene = Scene(tmp_path)
        scene.door.mode, scene.door.presses = "READY", Presses(lambda: 0.0)  # at once, however slow this is
        async with scene.client() as holder, scene.client() as other:
            await take_control(holder)
            move = {"frame": "joint", "axis": "X", "speed": 0.5}
            told = []
            for name in (press, press, "a2"):
                told.append((await holder.post("/api/v1/jog", json={**move, "press": name})).status_code)
                if len(told) == 1:
                    await other.post(f"/api/v1/{path}", json={} if path == "jog/stop" else None)
                    scene.door.mode = "READY"
            return told

    assert asyncio.run(story()) == [200, 409, 200]


@pytest.mark.parametrize(
    ("path", "seen", "status"),
    [
        *(("jog", tick, status) for tick, status in ((500, 200), (300, 200), (299, 409), (501, 409))),
        *(("cycle/single_block", tick, status) for tick, status in ((1, 200), (-1, 200), (501, 409))),
    ],
)
def test_what_was_under_way_for_long_moves_nothing(path: str, seen: int, status: int, tmp_path: Path) -> None:
    """The machine is at tick 500, of 2 ms; a tick that has not been yet was of another run."""
    bodies = {"jog": {"frame": "joint", "axis": "X", "speed": 0.5}, "cycle/single_block": {"on": True}}

    async def story() -> list[str]:
        scene = Scene(tmp_path)
        scene.door.mode = "READY"
        async with scene.client() as client:
            await take_control(client)
            method = "POST" if path == "jog" else "PUT"
            headers = {"X-Seen-Tick": str(seen)}
            answer = await client.request(method, f"/api/v1/{path}", json=bodies[path], headers=headers)
            assert answer.status_code == status, answer.text
            if status == 409:
                sentence = answer.json()["error"]["sentence"]
                assert ("started anew" if seen > 500 else "0.4 s old") in sentence, "in words of an operator"
        return scene.door.moved

    assert len(asyncio.run(story())) == (status == 200)


def test_octoprints_senders_upload_and_nothing_starts(tmp_path: Path) -> None:
    async def story() -> None:
        scene = Scene(tmp_path)
        async with scene.client() as client:
            assert (await client.get("/api/version")).json()["text"].startswith("OctoPrint")
            answer = await client.post("/api/files/local", **part(), data={"print": "true", "select": "true"})
            assert answer.status_code == 201
            assert answer.json()["effectivePrint"] is False
            assert answer.headers["Location"].endswith("/api/v1/programs/part.ngc")
            assert answer.json()["files"]["local"]["name"] == "part.ngc"
        assert not scene.door.moved

    asyncio.run(story())


def test_the_real_socket_carries_questions_answers_and_refusals(tmp_path: Path) -> None:
    machine = FakeDoor()
    server = Server(tmp_path / "control.sock", machine.answer)
    scene = Scene(tmp_path / "state", door=SocketServiceClient(tmp_path / "control.sock"))  # type: ignore[arg-type]

    async def story() -> None:
        async with scene.client() as client:
            await take_control(client)
            now = await asyncio.gather(*(client.get("/api/v1/status") for _ in range(50)))
            assert {answer.json()["mode"] for answer in now} == {"OFF"}
            assert (await client.post("/api/v1/machine/enable")).status_code == 200
            assert (await client.post("/api/v1/cycle/resume")).json()["error"]["mode"] == "READY"
            server.close()
            assert (await client.post("/api/v1/cycle/hold")).status_code == 503

    asyncio.run(story())


def test_many_who_ask_for_the_status_at_once_are_one_question_to_the_machine(tmp_path: Path) -> None:
    class Counting(FakeDoor):
        asked_status = 0

        async def ask(self, verb: str, **args: Any) -> dict[str, Any]:
            self.asked_status += verb == "status"
            await asyncio.sleep(0)
            return await super().ask(verb, **args)

    async def story() -> int:
        door = Counting()
        async with Scene(tmp_path, door).client() as client:
            await asyncio.gather(*(client.get("/api/v1/status") for _ in range(40)))
        return door.asked_status

    assert asyncio.run(story()) < 40


def test_an_application_with_a_route_that_has_no_guard_is_not_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from types import SimpleNamespace

    from fastapi import APIRouter

    open_door = APIRouter()
    open_door.add_api_route("/open", lambda: "come in")
    monkeypatch.setattr(http, "PARTS", (*http.PARTS, ("", SimpleNamespace(router=open_door))))
    with pytest.raises(RuntimeError, match="/open: has no guard"):
        Scene(tmp_path)


@pytest.mark.parametrize(
    ("sent", "data", "status", "words"),
    [
        (part("a//b.ngc"), {}, 422, "has an empty folder"),
        (part("-x"), {}, 422, "begins with"),
        (part(), {"sha256": "0" * 64}, 422, "announced was"),
        (part(), {"sha256": "xyz"}, 422, "is no checksum"),
        (part(), {"size": "999"}, 422, "of 999 bytes came"),
        (part(text=b""), {}, 422, "has no bytes"),
    ],
)
def test_what_was_sent_wrong_is_an_answer_about_what_was_sent(
    tmp_path: Path, sent: dict[str, Any], data: dict[str, str], status: int, words: str
) -> None:
    async def story() -> None:
        async with Scene(tmp_path).client() as client:
            for path in ("/api/v1/programs", "/api/files/local"):
                answer = await client.post(path, **sent, data=data)
                assert (answer.status_code, words in sentence(answer)) == (status, True), answer.text

    asyncio.run(story())


def test_every_kind_of_refusal_of_the_store_has_its_status() -> None:
    """A kind without one would be an error of ours (500) to whoever asks."""
    codes = set()
    for file in Path(http.__file__).parent.rglob("*.py"):
        codes |= set(re.findall(r'StoreError(?:\.of)?\(\s*"([a-z0-9]+)"', file.read_text("utf-8")))
    assert codes <= set(http.STORE_STATUSES) and len(codes) > 8


def test_a_program_that_takes_long_to_read_is_a_job_to_wait_for(tmp_path: Path) -> None:
    async def story() -> None:
        scene = Scene(tmp_path)
        async with scene.client() as client:
            await client.post("/api/v1/programs", **part())
            await take_control(client)
            assert (await client.get("/api/v1/job")).status_code == 404
            scene.door.results["load"] = {"done": False}
            asked = await client.post("/api/v1/job", json={"program": "part.ngc"})
            assert (asked.status_code, asked.headers["location"]) == (202, "/api/v1/job")
            assert int(asked.headers["retry-after"]) >= 1
            scene.door.job = {"name": "part.ngc", "sha256": SHA, "state": "loading"}
            await asyncio.sleep(2.0 * FRESH_S)
            assert (await client.get(asked.headers["location"])).json()["state"] == "loading"
            scene.door.job = {**scene.door.job, "state": "refused", "sentence": "line 2: no such code."}
            await asyncio.sleep(2.0 * FRESH_S)
            found = (await client.get(asked.headers["location"])).json()
            assert (found["state"], found["sentence"]) == ("refused", "line 2: no such code.")
            scene.door.results["load"] = {"done": True}
            again = await client.post("/api/v1/job", json={"program": "part.ngc"})
            assert again.status_code == 200 and again.json()["result"]["done"] is True
            described = (await client.get("/openapi.json")).json()["paths"]["/api/v1/job"]
            assert {"200", "202"} <= set(described["post"]["responses"]) and "get" in described
            assert "Location" in described["post"]["responses"]["202"]["headers"]

    asyncio.run(story())
