"""A headless browser for tests, and the page of a panel in it."""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from support.fakes import forked_sites
from support.live.ports import free_port

ROOT = Path(__file__).resolve().parents[3]
PATH = os.pathsep.join((str(ROOT), str(ROOT / "tests")))
WHOLE = ("chromium", "chromium-browser", "google-chrome")
# The shell alone takes half the processor time for a page; it knows of no window that comes before another.
NAMES = ("chromium-headless-shell", *WHOLE)
HANGS_S = 90.0  # no test is meant to come near
REQUIRED = os.environ.get("DIRECTRIX_BROWSER") == "required"  # where one was installed, no test is skipped
VIEWS = ("run", "scene", "programs", "jog", "setup", "drives", "scope", "alarms", "runs")  # in their order
FIGURES_OF_RUN = r"""() => {
  const texts = (where) => [...document.querySelectorAll(where)].map((one) => one.textContent);
  return {
    axes: texts(".dro tbody tr").map((row) => row.match(/[0-9]+\.[0-9]{3}/)?.[0]),
    place: texts(".program-head .strong"),
    times: texts(".times .time .strong").slice(0, 3),
    share: Number(getComputedStyle(document.querySelector(".program-bar")).getPropertyValue("--share")),
    line: texts(".listing .now").join(),
    stale: Boolean(document.querySelector(".line.stale").offsetParent),
    alarm: document.querySelector(".line.alarm").innerText,
  };
}"""
OPTIONS = ("--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu")


def needed(module: str, reason: str) -> Any:
    """A module of the page's tests; without it they are skipped, or fail where a browser is required."""
    return importlib.import_module(module) if REQUIRED else pytest.importorskip(module, reason=reason)


@contextlib.contextmanager
def browser(names: tuple[str, ...] = NAMES) -> Iterator[Any]:
    """Chromium; the test is skipped where there is none, or fails where one is required.

    ``names``: of its program, the first that is there; ``WHOLE`` where a page loses the focus to another.
    """
    sync = needed("playwright.sync_api", "needs playwright: pip install '.[test]'")
    path = next((found for name in names if (found := shutil.which(name))), None)
    with sync.sync_playwright() as playwright:
        try:
            made = playwright.chromium.launch(executable_path=path, args=list(OPTIONS))
        except sync.Error as error:
            if REQUIRED:
                raise
            pytest.skip(f"no browser: install Debian's chromium ({str(error).splitlines()[0]})")
        try:
            yield made
        finally:
            made.close()


class Site:
    """A panel as a process of its own, and where its page is."""

    def __init__(self, folder: Path, command: tuple[str, ...], port: int) -> None:
        self.folder, self._command, self.port = folder, command, port
        self.url = f"http://127.0.0.1:{port}/"
        self.log = folder / "panel.log"
        self.start()

    def start(self) -> None:
        """Start it, and wait until it answers."""
        self.process = self._begun()
        self._until_it_answers()

    def _begun(self) -> subprocess.Popen[bytes] | forked_sites.Forked:
        with open(self.log, "ab") as log:
            return subprocess.Popen(
                [sys.executable, *self._command],
                cwd=ROOT,
                env={**os.environ, "PYTHONPATH": PATH},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )

    def _until_it_answers(self) -> None:
        give_up_s = time.monotonic() + HANGS_S
        while True:
            with contextlib.suppress(OSError), urllib.request.urlopen(f"{self.url}api/v1/control"):
                return
            assert self.process.poll() is None, self.log.read_text()
            assert time.monotonic() < give_up_s, self.log.read_text()
            time.sleep(0.1)

    def end(self, number: int = signal.SIGKILL) -> None:
        self.process.send_signal(number)
        self.process.wait(HANGS_S)

    def ask(self, path: str) -> Any:
        """What a route tells."""
        with urllib.request.urlopen(f"{self.url}api/v1/{path}") as answer:
            return json.load(answer)

    def tell(self, **values: Any) -> None:
        """Have the fake machine tell these in place of its own, until others are; none: as it is."""
        part, whole = self.folder / "told.part", self.folder / "told.json"
        part.write_text(json.dumps(values))
        part.replace(whole)  # never seen half written

    def commands(self, *verbs: str) -> list[tuple[float, str, dict[str, Any]]]:
        """The commands that the fake machine got: (seconds since 1970, verb, arguments)."""
        lines = (self.folder / "asked.jsonl").read_text().splitlines()
        found = [tuple(json.loads(line)) for line in lines]
        return [one for one in found if not verbs or one[1] in verbs]


class FakeSite(Site):
    """A panel before a fake machine: a script of ``support.fakes``."""

    def _begun(self) -> forked_sites.Forked:
        (script,) = self._command
        return forked_sites.server(PATH).begin(script, self.folder, self.port, self.log)


@contextlib.contextmanager
def fake_site(folder: Path, script: str = "page_server") -> Iterator[Site]:
    """A panel before a fake machine, or with ``stepped_site`` before one on the stepped clock."""
    site = FakeSite(folder, (script,), free_port())
    try:
        yield site
    finally:
        site.end()


def opened(context: Any, site: Site, view: str = "run") -> Any:
    """The page in a browser's context, with its figures there; an error of its scripts fails the test."""
    page = context.new_page()
    page.set_default_timeout(HANGS_S * 1000)
    page.errors = []
    page.on("pageerror", lambda error: page.errors.append(str(error)))
    page.goto(f"{site.url}#{view}")
    page.wait_for_selector("section.view[data-shown] .card")
    page.wait_for_function("() => !dx.stale && dx.all_views")
    return page


def until(done: Callable[[], Any], what: str) -> Any:
    """The first true value; the time-out is for hangs only."""
    give_up_s = time.monotonic() + HANGS_S
    while not (found := done()):
        assert time.monotonic() < give_up_s, f"waited for {what} in vain"
        time.sleep(0.02)
    return found


def take_control(page: Any) -> None:
    page.click("#dx-control")
    page.wait_for_selector("body[data-control=mine]")


def yes(page: Any) -> None:
    """Answer a question of the page with yes."""
    page.click(".dx-ask button[data-kind=go]")


FILL = """async () => {
  const form = new FormData();
  form.append("name", "fixtures/queued.ngc");
  form.append("file", new File(["G21\\nM2\\n"], "queued.ngc"));
  const sent = {method: "POST", body: form, headers: dx.headers()};
  const there = (await dx.call("GET", "queue", null, true)).body.entries.length;
  if (!there && (await fetch("/api/v1/programs", sent)).ok)
    for (const count of [3, 1]) await dx.call("POST", "queue", {program: "fixtures/queued.ngc", count});
}"""


def fill(page: Any) -> None:
    """A folder with a program, and a queue with two entries, so that they are seen."""
    page.evaluate(FILL)


@contextlib.contextmanager
def looker(chromium: Any, site: Site, width: int, height: int, view: str = "run") -> Iterator[Any]:
    """A page without control, for it only looks; its scripts must not have failed."""
    context = chromium.new_context(viewport={"width": width, "height": height}, locale="en-GB")
    made = opened(context, site, view)
    yield made
    errors = made.errors
    context.close()
    assert not errors, errors
