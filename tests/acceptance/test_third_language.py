"""A third language is one file: with it alone nothing that an operator reads is English any more.

The file is made here, every English text of it between ⟦ and ⟧. What an operator can be told is then
walked through: the socket of the service, REST and its events, the page's texts and documents, and the
command line. A service without processes stands behind all of them.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi.testclient import TestClient
from support.fakes.fake_engine import CHECKED, FakeEngine, engine_of, served
from support.fakes.panels import Scene
from typer.testing import CliRunner

from controller import messages
from controller.__main__ import app
from controller.api.service_client import SocketServiceClient
from controller.cli import remote, status_view
from controller.faults import Fault
from controller.ipc.control_socket import Client, CommandRefused
from controller.machine import drive_profiles, machine_file
from controller.messages import LANGUAGES, Key, message, plain, with_sentences
from controller.service.command_handlers import CommandHandlers
from controller.service.service import Service
from controller.service.socket_server import Server
from controller.state.modes import Mode
from controller.verify import console
from controller.web import server
from controller.web.server import add_page

XX = {"Accept-Language": "xx"}
PROGRAM = b"G21\nG1 X1 F100\nM2\n"
# Words that follow each other in small letters: a phrase, and no name or code.
PROSE = re.compile(r"[A-Za-z]*[a-z]{2,},? [a-z]{2,}")
VALUE = re.compile(r"\{\w+\}")  # a text that has no word of its own: what it holds must be one itself
NAMES = {"values", "key", "name", "program", "by"}  # of JSON: what stands there is no text
ASK = CliRunner()


def source() -> str:
    """The one file."""
    english = json.loads((messages.FOLDER / "en.json").read_text(encoding="utf-8"))
    texts = {
        key: f"⟦{text}⟧" if text and not VALUE.fullmatch(text) else text for key, text in english.items()
    }
    return json.dumps({**texts, "language": "⟦X⟧"})


@pytest.fixture(autouse=True)
def third(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The file is in the folder of the others, and nothing else is done for it."""
    folder = tmp_path / "messages"
    shutil.copytree(messages.FOLDER, folder)
    (folder / "xx.json").write_text(source(), encoding="utf-8")
    monkeypatch.setitem(LANGUAGES, "xx", messages.languages(folder)["xx"])
    yield
    for late in (console.show, console.tell):  # made as wide as these tests want it
        late.__dict__.pop("console", None)


def outside(text: str) -> str:
    """What is left of a text without all that stands between brackets."""
    depth, left = 0, []
    for sign in text:
        depth += sign == "⟦"
        left.append("" if depth else sign)
        depth -= sign == "⟧"
    return "".join(left)


def english_in(tree: Any, where: str = "") -> list[str]:
    """Phrases outside of brackets, with their place; keys, values and names are none of them."""
    if isinstance(tree, Mapping):
        rows = [(f"{where}.{key}", one) for key, one in tree.items() if key not in NAMES]
    elif isinstance(tree, list):
        rows = [(f"{where}[{i}]", one) for i, one in enumerate(tree)]
    else:
        return [f"{where}: {tree}"] if isinstance(tree, str) and PROSE.search(outside(tree)) else []
    return [found for place, one in rows for found in english_in(one, place)]


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    made = served(tmp_path / "machine")
    yield made
    made.close()


@pytest.fixture
def engine(service: Service) -> FakeEngine:
    return engine_of(service)


@pytest.fixture
def socket(service: Service, tmp_path: Path) -> Iterator[Path]:
    """Where the service listens."""
    path = tmp_path / "control.sock"
    server = Server(path, CommandHandlers(service))
    yield path
    server.close()
    Client(path).close()


@pytest.fixture
def scene(socket: Path, tmp_path: Path) -> Scene:
    """A panel before that service, with a program, an alarm of each age and a run that failed."""
    scene = Scene(tmp_path / "store", SocketServiceClient(socket))  # type: ignore[arg-type]
    add_page(scene.app)
    with scene.store.uploads.begin("part.ngc") as upload:
        upload.write(PROGRAM)
        upload.commit()
    scene.history.alarm("PROGRAM", message("stands_before"), cause=message("cause.EMCY"))
    scene.history.run("part.ngc", "fault", **message("service_ended"))
    return scene


def in_trouble(service: Service, engine: FakeEngine) -> None:
    """A status in which everything is told that can be told at once."""
    row = message("at.spindle", rev_min="0", coolant=Key("at.off"), feed=Key("at.none"))
    engine.answers["check"] = lambda **_: {**CHECKED, "restart": [row]}
    more = {"interlock": Fault.DOOR_OPEN, "warning": Fault.DRIVE_WARNING, "fault_axis": 1, "fault_off": 0.5}
    engine.now = engine.now._replace(mode=Mode.FAULT, fault=Fault.FOLLOWING_ERROR, **more)
    service.watch.look()


LOOKS = ("status", "restart", "alarms", "drives")
# Asked in the modes named, each is refused, or done in words.
ASKED: tuple[tuple[str, dict[str, Any]], ...] = (
    *((verb, {}) for verb in ("start", "hold", "resume", "stop", "enable", "home", "reset", "return", "x")),
    *(("retract", {"mm": mm}) for mm in (5.0, 5000.0, "x")),
    *(("override", {"share": share}) for share in (9.0, "x")),
    *(("jog_step", {"frame": frame, "axis": axis, "distance": 1.0}) for frame, axis in ("xX", ("part", "C"))),
    *(("jog_step", {"frame": "joint", "axis": "Q", "distance": d}) for d in (0.0, 1.0)),
    *(("load", {"path": path}) for path in ("/nowhere", "/proc/self/mem")),
    *((verb, {"name": "G54"}) for verb in ("forget", "set_offset")),
    ("home", {"axes": ["Q"]}),
    ("mdi", {"text": ""}),
    ("acknowledge", {"id": 99}),
    ("single_block", {"on": "x"}),
    ("set_tool", {"number": "x"}),
)


def test_through_the_socket_go_keys_and_no_sentence_at_all(
    socket: Path, service: Service, engine: FakeEngine
) -> None:
    client, said_by = Client(socket), set()
    for mode in (Mode.READY, Mode.OFF, Mode.FAULT, Mode.RUNNING):
        engine.now = engine.now._replace(mode=mode, fault=Fault.NONE)
        for verb, args in ASKED:
            with contextlib.suppress(CommandRefused):
                try:
                    client.ask(verb, **args)
                except CommandRefused as error:
                    assert not english_in(error.to_dict()), verb
                    assert not english_in(with_sentences(error.to_dict(), "xx")), verb
                    said_by.add(error.said["key"])
                    raise
    assert len(said_by - {"text"}) > 12, said_by
    in_trouble(service, engine)
    for verb in LOOKS:
        answer = client.ask(verb)
        assert not english_in(answer), verb
        assert '"sentence"' not in json.dumps(answer), verb
    client.close()


def rest(scene: Scene, story: Callable[[httpx.AsyncClient], Any]) -> None:
    async def asked() -> None:
        async with scene.client() as client:
            client.headers.update(XX)
            await story(client)

    asyncio.run(asked())


def test_rest_answers_in_the_language_asked_for(scene: Scene, service: Service, engine: FakeEngine) -> None:
    paths = ("status", "restart", "alarms", "runs", "runs/1", "programs", "programs/part.ngc", "drives")
    asked = (
        *(("POST", f"cycle/{verb}", None) for verb in ("start", "resume", "return")),
        *(("POST", path, {}) for path in ("job", "nothing", "mdi")),
        ("POST", "job", {"program": "none.ngc"}),
        ("PATCH", "programs/part.ngc", {"name": "a/../b"}),
        ("GET", "runs/99", None),
        ("GET", "ticks?names=feed&source=recording:x", None),
        ("PUT", "machine/enable", None),
        ("PUT", "overrides/feed", {"share": 9}),
    )

    async def story(client: httpx.AsyncClient) -> None:
        for held in (False, True):
            for method, path, body in asked:
                answer = await client.request(method, f"/api/v1/{path}", json=body)
                error = answer.json()["error"]
                assert answer.status_code >= 400 and answer.headers["Content-Language"] == "xx", path
                assert error["key"] and error["values"] is not None and "⟦" in error["sentence"], error
                assert not english_in(error), (path, error)
            if not held:
                token = (await client.post("/api/v1/control", json={"take_over": True})).json()["token"]
                client.headers["X-Control-Token"] = token
        in_trouble(service, engine)
        for path in paths:
            answer = await client.get(f"/api/v1/{path}")
            assert answer.status_code == 200 and not english_in(answer.json()), path
        assert "⟦" in (await client.get("/api/v1/status")).json()["fault"]["sentence"]
        report = (await client.get("/api/v1/runs/1/report")).text
        assert 'lang="xx"' in report
        words = re.sub(r"<style>.*?</style>|<[^>]*>", " ", report, flags=re.S)
        assert not PROSE.search(outside(words)), outside(words)

    rest(scene, story)


def test_metrics_say_what_they_are_in_it(scene: Scene, service: Service, engine: FakeEngine) -> None:
    in_trouble(service, engine)

    async def story(client: httpx.AsyncClient) -> None:
        told = [one for one in (await client.get("/metrics")).text.split("\n") if one.startswith("# HELP ")]
        assert len(told) > 25 and not [one for one in told if not re.fullmatch(r"# HELP \w+ ⟦.*⟧", one)]

    rest(scene, story)


def test_events_come_in_the_language_asked_for(scene: Scene, service: Service, engine: FakeEngine) -> None:
    in_trouble(service, engine)
    with (
        TestClient(scene.app, base_url=remote.URL, client=("127.0.0.1", 40000)) as client,
        client.websocket_connect("ws://127.0.0.1:8080/api/v1/events?topics=status", headers=XX) as heard,
    ):
        event = json.loads(heard.receive_text())
    assert event["data"]["fault"]["sentence"].startswith("⟦") and not english_in(event)


def test_the_page_has_all_its_texts_in_it_and_offers_it(scene: Scene) -> None:
    async def story(client: httpx.AsyncClient) -> None:
        found = (await client.get("/page/texts/xx.json")).json()
        assert found["language.xx"] == "⟦X⟧" and set(found) == set(server.words("en"))
        assert not [key for key, text in found.items() if key[:9] != "language." and text[0] != "⟦"]
        for headers in (XX, {"Accept-Language": "de", "Cookie": "directrix_language=xx"}):
            assert '<html lang="xx"' in (await client.get("/", headers=headers)).text

    rest(scene, story)


def test_no_text_stands_in_the_pages_own_files() -> None:
    """What is between tags, or in an attribute that is read, comes from the catalogue."""
    folder = Path(server.__file__).parent / "static"
    for file in (*folder.glob("*.js"), *folder.glob("*/*.js"), *folder.glob("*.html")):
        if "vendor" in file.parts:
            continue
        code = re.sub(r"^\s*//.*$|/\*.*?\*/", "", file.read_text(encoding="utf-8"), flags=re.M | re.S)
        found = re.findall(r"[a-z\"}]>\s*([A-Za-z][a-z]+ [a-z]+[^<>`{}();=]*)<", code)
        found += re.findall(r"(?:title|aria-label|alt|placeholder)=\"([A-Za-z][^\"]*)\"", code)
        assert not found, (file.name, found)


# ---- the command line


@pytest.fixture
def line(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., str]]:
    """Runs a verb; what it printed."""
    with TestClient(scene.app, base_url=remote.URL, client=("127.0.0.1", 40000)) as http:

        @contextlib.contextmanager
        def client(url: str, headers: Mapping[str, str]) -> Iterator[TestClient]:
            yield http

        monkeypatch.setattr(remote, "client", client)
        monkeypatch.setenv("COLUMNS", "300")

        def run(*words: str) -> str:
            ran = ASK.invoke(app, [*words, "--language", "xx"], input="n\n")
            assert ran.exit_code in (0, 1), (words, ran.output, ran.exception)
            return ran.stdout + ran.stderr

        yield run


VERBS = (
    *(("hold",), ("stop",), ("resume",), ("reset",), ("enable",), ("return",), ("home", "Q"), ("estop",)),
    *(("start",), ("start", "none.ngc"), ("start", "--line", "3"), ("start", "--restart")),
    *(("override", "80"), ("override", "50", "--rapid"), ("override", "900"), ("mdi", " "), ("retract", "5")),
    *(("jog", "X"), ("jog", "X", "--speed", "1", "--seconds", "-1"), ("jog", "Q", "1"), ("disable",)),
    *(("alarms",), ("alarms", "--acknowledge", "1"), ("alarms",), ("alarms", "--acknowledge", "99")),
    *(("runs",), ("status",), ("upload", "/nowhere.ngc"), ("status", "--url", "x"), ("faults", "trunnion")),
)


def test_the_command_line_speaks_it(
    line: Callable[..., str], scene: Scene, service: Service, engine: FakeEngine
) -> None:
    for words in VERBS:
        printed = line(*words)
        assert "⟦" in printed and not PROSE.search(outside(printed)), (words, printed)
    in_trouble(service, engine)
    printed = line("status")
    assert not PROSE.search(outside(printed)), printed
    assert set(status_view.COLUMNS) <= set(re.findall(r"⟦([a-z_]+)⟧", printed.replace("to go", "to_go")))


# Verbs that ask no panel, and are refused before they begin: what they say is theirs.
ALONE = (
    *(("check", "none.ngc"), ("check", "."), ("verify", "none.ngc"), ("post", "none.ngc", "--chord", "0")),
    *(
        ("import", "none.step"),
        ("import", "none.step", "--list"),
        ("import", "x", "--list", "--tolerance", "0"),
    ),
    *(("replay", "none"), ("replay", "7"), ("backup", "check", "none.zip"), ("backup", "rollback")),
    *(("users", "add", "a b"), ("users", "list"), ("tokens", "add", "x", "--days", "0"), ("tokens", "list")),
    *(("drives", "scan"), ("drives", "scan", "--bus", "x"), ("drives", "simulate", "--nodes", "x")),
    *(("drives", "simulate", "--nodes", ""), ("dnc", "send", "none", "--port", "/dev/none", "--baud", "1")),
    *(("panel", "--host", "192.0.2.1"), ("service", "self-test", "--seconds", "0"), ("drives", "stop")),
    # What typer refuses.
    *(("status", "--nonsense"), ("status", "x"), ("jog",), ("runs", "--most", "0"), ("start", "--line", "x")),
    *(("users", "add", "a", "--role", "x"), ("drives", "dump"), ("alarms", "--json=3")),
)
# Of drives: what their data sheets say against them.
SHEET = machine_file.SHIPPED / "eds" / "simulated_drive.eds"
OF_DRIVES = (
    ("drives", "check", "--eds", str(SHEET), "--profile", "elmo_gold"),
    ("drives", "check", "--eds", str(SHEET), "--profile", "generic", "--period-ms", "1.23"),
    *(("drives", "check", "--eds", str(SHEET), "--profile", name) for name in drive_profiles.shipped()),
    ("drives", "check", "--eds", "none.eds", "--profile", "generic"),
    ("bus", "trunnion"),
    ("paper",),
)


@pytest.mark.parametrize("words", (*ALONE, *OF_DRIVES), ids=" ".join)
def test_verbs_that_ask_no_panel_speak_it(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))
    monkeypatch.setenv("COLUMNS", "300")
    ran = ASK.invoke(app, [*words, "--language", "xx"], input="n\n")
    printed = re.sub(r"(?m)^(⟦Usage⟧: ).*", r"\1", ran.stdout + ran.stderr)  # commands are no words
    assert ran.exit_code in (0, 1, 2), (words, printed, ran.exception)
    assert "⟦" in printed and not PROSE.search(outside(printed)), printed


def test_a_machine_file_is_refused_in_it(line: Callable[..., str], tmp_path: Path) -> None:
    shipped = (machine_file.SHIPPED / "trunnion.toml").read_text()
    for k, (was, wrong) in enumerate((("period_s", "periods_s"), ('kind = "', 'kind = "x'), ("", "[["))):
        (tmp_path / f"m{k}.toml").write_text(shipped.replace(was, wrong, 1))
        printed = line("bus", str(tmp_path / f"m{k}.toml"))
        assert "⟦" in printed and not PROSE.search(outside(printed)), printed
    printed = line("bus", str(tmp_path / "none.toml"))
    assert "⟦" in printed and not PROSE.search(outside(printed)), printed


def test_a_sentence_of_the_programs_reader_is_the_value_of_a_text_of_its_own() -> None:
    """Its hundreds of refusals have no keys yet: they come through whole, in whatever language."""
    sentence = "part.ngc:3:1: G99 is no code; correct it."
    assert messages.text(plain(sentence), "xx") == sentence
