"""Who may have the page, what comes with it, and how much of it goes over the wire; without a browser."""

from __future__ import annotations

import asyncio
import gzip
import json
import posixpath
import re
from pathlib import Path

import httpx
import pytest
from support.fakes.panels import ROLES, Scene

from controller.api.access import COOKIE
from controller.api.roles import Role
from controller.messages import LANGUAGES
from controller.program.probing_cycles import CYCLES
from controller.state.live_state import SIGNALS
from controller.state.modes import SHOWN_MODES
from controller.web import files, server
from controller.web.vendor import changed
from drives.cia402 import State

ORIGIN = "http://127.0.0.1:8080"
OPEN = ("/login", "/page/main.js", "/page/vendor/preact.js", "/page/texts/de.json", "/page/icon.svg")
MAX_BYTES = 300_000  # before the 3-D view is opened
FIRST = ("index.html", "page.css", "views.css", "vendor/uplot.css", "icon.svg", "main.js")
IMPORT = re.compile(r"""(?:^import|^export)[^;]*?from\s*["'](\./|\.\./)([^"']+)["']""", re.MULTILINE)


async def asked(
    scene: Scene, path: str, headers: dict[str, str] | None = None, peer: str = "127.0.0.1"
) -> httpx.Response:
    transport = httpx.ASGITransport(app=scene.app, client=(peer, 50000))
    async with httpx.AsyncClient(transport=transport, base_url=ORIGIN) as client:
        return await client.get(path, headers=headers or {})


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    """With a user of every role."""
    made = asyncio.run(Scene(tmp_path).with_users())
    server.add_page(made.app)
    return made


@pytest.fixture
def alone(tmp_path: Path) -> Scene:
    """Without users."""
    made = Scene(tmp_path)
    server.add_page(made.app)
    return made


def test_with_users_the_document_is_for_who_is_known_and_others_are_sent_to_the_log_in(scene: Scene) -> None:
    strangers: tuple[dict[str, str], ...] = (
        {},
        {"Authorization": "Bearer dx_wrong"},
        {"Cookie": f"{COOKIE}=wrong"},
    )
    for headers in strangers:
        answer = asyncio.run(asked(scene, "/", headers))
        assert (answer.status_code, answer.headers["location"]) == (303, "/login"), headers
    for role in ROLES:
        cookie, _ = scene.panel.users.begin(role, Role.named(role))
        answer = asyncio.run(asked(scene, "/", {"Cookie": f"{COOKIE}={cookie}"}))
        assert answer.status_code == 200 and "main.js" in answer.text, role


@pytest.mark.parametrize("path", OPEN)
def test_the_log_in_and_what_every_copy_of_the_package_holds_are_open(scene: Scene, path: str) -> None:
    assert asyncio.run(asked(scene, path, peer="192.168.1.7")).status_code == 200


@pytest.mark.parametrize("path", ["/", *OPEN])
def test_without_users_the_page_is_for_this_computer_alone_and_others_leave_a_line(
    alone: Scene, path: str
) -> None:
    async def story() -> list[tuple[str, str]]:
        async with alone.panel.running():
            assert (await asked(alone, path)).status_code == 200
            assert (await asked(alone, path, peer="192.168.1.7")).status_code == 403
            assert (await asked(alone, path, {"Host": "evil.example"})).status_code == 403
        return [(entry.address, entry.detail) for entry in alone.store.audit.list()]

    assert ("192.168.1.7", "local") in asyncio.run(story())


@pytest.mark.parametrize("path", ["/page/none.js", "/page/../server.py", "/page/%2e%2e/server.py", "/page/"])
def test_a_file_that_is_none_of_the_page_is_refused_in_a_sentence(alone: Scene, path: str) -> None:
    answer = asyncio.run(asked(alone, path))
    assert answer.status_code == 404 and answer.json()["error"]["sentence"]


# ---- the policy


@pytest.mark.parametrize("path", ["/", "/login"])
def test_nothing_runs_and_nothing_looks_that_is_no_file_of_this_server(alone: Scene, path: str) -> None:
    answer = asyncio.run(asked(alone, path))
    policy = dict(part.strip().split(" ", 1) for part in answer.headers["content-security-policy"].split(";"))
    assert "unsafe" not in answer.headers["content-security-policy"]
    assert policy["default-src"] == "'none'" and policy["script-src"] == policy["style-src"] == "'self'"
    assert not re.search(r"<script(?![^>]*\bsrc=)|<style|\bstyle=|\son\w+=", answer.text)


# ---- the language and the look of a document


def test_a_document_has_the_language_and_the_theme_that_were_chosen(alone: Scene) -> None:
    for headers, shown in (
        ({"Accept-Language": "de-DE,de;q=0.9"}, 'lang="de" data-theme="dark"'),
        ({"Accept-Language": "de", "Cookie": "directrix_language=en"}, 'lang="en" data-theme="dark"'),
        ({"Accept-Language": "fr", "Cookie": "directrix_theme=light"}, 'lang="en" data-theme="light"'),
        ({"Cookie": 'directrix_language="><script>; directrix_theme=x'}, 'lang="en" data-theme="dark"'),
    ):
        assert shown in asyncio.run(asked(alone, "/", headers)).text, headers


def test_every_text_of_the_page_is_there_in_every_language_with_the_same_places() -> None:
    english, german = server.words("en"), server.words("de")
    assert list(english) == list(german)
    places = re.compile(r"\{\d\}")
    for key, text in english.items():
        assert text.strip() and german[key].strip(), key
        assert sorted(places.findall(text)) == sorted(places.findall(german[key])), key


def test_every_text_that_the_page_asks_for_by_its_name_is_there() -> None:
    known = server.words("en")
    for name in sorted(files.names()):
        if not name.endswith(".js") or name.startswith("vendor/"):
            continue
        source = files.file(name).body.decode()
        own = re.search(r"(?:text|known)\(`(\w+)\.\$\{key\}`", source)
        room = f"{own[1]}." if own else ""
        for key in re.findall(r"""(?<![\w.])word\(["']([a-z_A-Z.]+)["']""", source):
            assert room + key in known, (name, key)


def test_every_name_that_the_machine_may_tell_has_a_word_on_the_page() -> None:
    """No key and no name of the code is shown to who stands before the machine."""
    texts = LANGUAGES["en"].texts
    named = {
        "mode": SHOWN_MODES,
        "sequence": [key.removeprefix("sequence.") for key in texts if key.startswith("sequence.")],
        "what": [key.removeprefix("form.motion.") for key in texts if key.startswith("form.motion.")],
        "scope.signal": SIGNALS,
        "drives.state": [state.name for state in State],
        "probing.cycle": CYCLES,
        "users.role": ROLES,
    }
    known = server.words("en")
    wanted = [f"{room}.{one}" for room, names in named.items() for one in names]
    assert [key for key in wanted if key not in known] == []


# ---- files


def test_a_file_is_packed_and_sent_only_once(alone: Scene) -> None:
    first = asyncio.run(asked(alone, "/page/main.js", {"Accept-Encoding": "gzip"}))
    assert first.headers["content-encoding"] == "gzip"
    assert first.content == (files.STATIC / "main.js").read_bytes()
    tag = {"If-None-Match": first.headers["etag"]}
    assert asyncio.run(asked(alone, "/page/main.js", tag)).status_code == 304


def modules(name: str, found: set[str]) -> set[str]:
    """A module with all that it imports from the first, by their names."""
    if name not in found:
        found.add(name)
        for up, other in IMPORT.findall(files.file(name).body.decode()):
            modules(posixpath.normpath(posixpath.join(posixpath.dirname(name), up, other)), found)
    return found


def test_the_page_is_small_until_the_machine_is_looked_at() -> None:
    first = modules("main.js", set())
    assert {"views/run.js", "api.js"} <= first and not any("uplot" in name for name in first)
    loaded = first.union(*(modules(name, set()) for name in files.names() if name.startswith("views/")))
    assert {"views/setup.js", "vendor/uplot.js"} <= loaded
    assert not any("three" in name or name.startswith("scene/") for name in loaded)
    sizes = [len(files.file(name).packed) for name in loaded | set(FIRST)]
    assert sum(sizes) + len(gzip.compress(json.dumps(server.words("de")).encode())) < MAX_BYTES


def test_a_document_names_all_modules_that_its_script_needs_so_that_none_waits_for_another(
    alone: Scene,
) -> None:
    """At 50 kB/s and 300 ms the first figures are there within 5 s: all of it is asked for at once."""
    for path, script in (("/", "main.js"), ("/login", "login.js")):
        document = asyncio.run(asked(alone, path)).text
        named = re.findall(r'<link rel="modulepreload" href="/page/([^"]+)">', document)
        assert set(named) == modules(script, set()) and len(named) == len(set(named)), path
    first = {*modules("main.js", set()), *FIRST}
    sizes = [len(files.file(name).packed) for name in first]
    assert sum(sizes) + len(gzip.compress(json.dumps(server.words("de")).encode())) < 130_000


def test_what_others_wrote_is_as_the_manifest_says() -> None:
    assert list(changed()) == []


def test_a_file_of_others_that_was_changed_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from controller.web import vendor

    for file in vendor.FOLDER.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "preact.js").write_text("changed")
    (tmp_path / "more.js").write_text("")
    monkeypatch.setattr(vendor, "FOLDER", tmp_path)
    monkeypatch.setattr(vendor, "MANIFEST", tmp_path / "manifest.json")
    told = "\n".join(changed())
    assert "preact.js: is not the file" in told and "more.js: the manifest does not name it" in told
