"""What is done between cuts comes out the same by page, REST, command line and program.

``serve --simulate`` of the machining centre with a part to be probed, its panel, and the page in a browser.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from support.live import browser, shop
from support.live.shop import ROOT, Shop, Values

from controller.runtime.bench.touching import STOCK
from controller.service.jobs import UNDER_WAY

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]
ABOVE_THE_BORE = "G21 G90 G54 G43 H99\nG0 X0 Y0\nG0 Z30\nG1 Z-8 F2000\n"
ON_THE_BENCH = (0.35, -0.2)  # where the bore is, of the place where G54 thinks it
NARROW = STOCK.replace("radius_mm = 12.0", "radius_mm = 4.0")  # a ball of 3 is soon at its wall
LIKE_MM = 0.004  # scatter of the probe, and half a tick of a slow computer's bench


class Ways:
    """One machine, and whoever asks."""

    def __init__(self, running: Shop, page: Any) -> None:
        self.shop, self.page = running, page

    def rest(self, method: str, path: str, body: Any = None) -> Any:
        self.shop.take_control()
        return self.shop.do(method, path, **({} if body is None else {"json": body}))

    def command(self, *words: str) -> Any:
        line = [sys.executable, "-m", "controller", *words, "--url", self.shop.url, "--json"]
        takes = [] if words[0] == "probe" and "--touches" in words else ["--take-over"]
        told = subprocess.run(
            [*line, *takes],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            timeout=shop.HANGS_S,
        )
        assert told.returncode == 0, (words, told.stdout, told.stderr)
        self.at_rest()
        return json.loads(told.stdout)

    def mdi(self, text: str) -> None:
        self.rest("POST", "/mdi", {"text": text})
        self.at_rest()

    def program(self, name: str, text: str) -> None:
        self.shop.take_control()
        self.shop.upload(name, text.encode())
        self.shop.do("POST", "/job", json={"program": name})
        self.shop.do("POST", "/cycle/start")
        self.shop.until(lambda now: now["mode"] == "READY" and now["job"]["state"] == "completed", name)

    def part_of_the_page(self, name: str, there: str) -> Any:
        self.page_has_control()
        self.page.evaluate("dx.show('setup')")
        self.page.click(f"[data-setup={name}]")
        self.page.wait_for_selector(there)
        return self.page

    def page_has_control(self) -> None:
        """From whoever had it."""
        self.page.evaluate(
            "dx.call('POST', 'control', {take_over: true}).then((s) => { dx.token = s.body.token; })"
        )
        self.page.wait_for_selector("body[data-control=mine]")

    def at_work(self) -> None:
        self.shop.until(
            lambda now: (now["sequence"] or {}).get("state") != "running" and now["mode"] != "READY", "work"
        )

    def at_rest(self) -> None:
        """What was run is filed, too: what it has set comes a moment after its last tick."""

        def rests(now: Values) -> bool:
            under_way = (now["job"] or {}).get("state") in UNDER_WAY
            busy = (now["sequence"] or {}).get("state") == "running"
            return now["mode"] == "READY" and not under_way and not busy

        self.shop.until(rests, "rest")

    def origin(self, name: str) -> list[float]:
        found: list[float] = self.shop.do("GET", "/offsets")["offsets"][name]["origin_mm"]
        return found

    def tool(self, number: int) -> Any:
        return self.shop.do("GET", "/tools")["tools"][str(number)]


@pytest.fixture(scope="module")
def ways(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ways]:
    """Homed, the probe in the spindle."""
    with (
        browser.browser() as chromium,
        shop.opened(tmp_path_factory.mktemp("centre"), machine="machining_centre", part=NARROW) as running,
    ):
        running.up()
        running.do("POST", "/changer/confirm", json={"spindle": 99, "clear": True})
        running.do("POST", "/machine/home", json={})
        running.do("POST", "/machine/enable")
        running.until(lambda now: now["mode"] == "READY", "READY")
        context = chromium.new_context(viewport={"width": 1280, "height": 720}, locale="en-GB")
        page = context.new_page()
        page.set_default_timeout(shop.HANGS_S * 1000)
        page.goto(f"{running.url}/#setup")
        page.wait_for_function("() => window.dx?.all_views && !dx.stale")
        yield Ways(running, page)
        context.close()


def by_page(ways: Ways) -> None:
    page = ways.part_of_the_page("probing", "[name=most]")
    page.select_option("[name=cycle]", "bore")
    page.select_option("[name=offset]", "G55")
    page.click("#probing-run:not([aria-disabled])")
    browser.yes(page)
    ways.at_work()
    ways.at_rest()


def by_rest(ways: Ways) -> None:
    ways.rest("POST", "/probing", {"cycle": "bore", "values": {"most": 20.0}, "offset": "G56"})
    ways.at_work()  # which is answered when it begins: what is told of the machine may be of before


BORE: dict[str, tuple[str, Callable[[Ways], Any]]] = {
    "page": ("G55", by_page),
    "REST": ("G56", by_rest),
    "command line": ("G57", lambda ways: ways.command("probe", "bore", "most=20", "--offset", "G57")),
    "MDI": ("G58", lambda ways: ways.mdi("G21 G90 G54 G43 H99\no<probe_bore> call [20] [5]")),
    "program": (
        "G59",
        lambda ways: ways.program("bore.ngc", f"T99 M6\n{ABOVE_THE_BORE}o<probe_bore> call [20] [6]\nM30\n"),
    ),
}


def test_a_bore_gives_the_same_offset_by_every_way(ways: Ways, tmp_path: Path) -> None:
    found = {}
    for way, (offset, probe) in BORE.items():
        if way != "program":
            ways.mdi(ABOVE_THE_BORE)
        probe(ways)
        ways.at_rest()
        found[way] = ways.origin(offset)[:2]
    there = [known + off for known, off in zip(ways.origin("G54"), ON_THE_BENCH, strict=False)]
    assert all(one == pytest.approx(there, abs=LIKE_MM) for one in found.values()), (there, found)
    results = ways.shop.do("GET", "/probing/found")["found"]
    assert [one["cycle"] for one in results].count("bore") == len(BORE)
    table = tmp_path / "touches.csv"
    ways.command("probe", "--touches", str(table))
    assert table.read_text() == ways.shop.http.get("/probing/touches.csv").text
    assert len(table.read_text().splitlines()) > 12 * len(BORE)


def wear_by_page(ways: Ways, value: str) -> None:
    page = ways.part_of_the_page("tools", "#setup-tools tr[data-row='2']")
    page.fill("#setup-tools tr[data-row='2'] [data-field=wear_length_mm]", value)
    page.click("#setup-tools tr[data-row='2'] button >> text=Save")
    page.wait_for_selector("#dx-said:has-text('T2 is saved.')")


def test_a_tool_is_the_same_by_whatever_way_it_was_measured(ways: Ways) -> None:
    """Its length as it is led: by page and command line as wear, by REST and program as length."""
    row = ways.tool(2)
    values = {key: row[key] for key in ("name", "radius_mm", "flute_mm")}

    def led() -> float:
        now = ways.tool(2)
        return float(now["length_mm"] + now["wear_length_mm"])

    wear_by_page(ways, "-0,05")
    assert led() == pytest.approx(row["length_mm"] - 0.05, abs=1e-9)
    ways.command("tools", "--set", "2", "wear_length_mm=-0.06")
    assert led() == pytest.approx(row["length_mm"] - 0.06, abs=1e-9)
    length_mm = row["length_mm"] - 0.07
    ways.rest("PUT", "/tools/2", {**values, "length_mm": length_mm, "wear_length_mm": 0.0})
    assert led() == pytest.approx(length_mm, abs=1e-9)
    ways.program("length.ngc", f"G21 G10 L1 P2 Z{row['length_mm'] - 0.08:.6f}\nM30\n")
    assert led() == pytest.approx(row["length_mm"] - 0.08, abs=1e-6)


def test_an_offset_is_the_same_by_whatever_way_it_was_set(ways: Ways) -> None:
    values = {"origin_mm": [1.0, 2.0, 3.0], "turned_deg": [0.0, 0.0, 30.0]}
    ways.rest("PUT", "/offsets/G59.1", values)
    ways.command("offsets", "G59.2", "--origin", "1,2,3", "--turned", "0,0,30")
    ways.program("offset.ngc", "G21 G10 L2 P9 X1 Y2 Z3 R30\nM30\n")
    page = ways.part_of_the_page("offsets", "#setup-offsets tr[data-row=G58]")
    for field, typed in (("X", "1"), ("Y", "2"), ("Z", "3"), ("rX", "0"), ("rY", "0"), ("rZ", "30")):
        page.fill(f"#setup-offsets tr[data-row=G58] [data-field={field}]", typed)
    page.click("#setup-offsets tr[data-row=G58] button >> text=Save")
    page.wait_for_selector("#dx-said:has-text('G58 is saved.')")
    rows = ways.shop.do("GET", "/offsets")["offsets"]
    for name in ("G58", "G59.1", "G59.2", "G59.3"):
        assert rows[name]["origin_mm"] == pytest.approx([1.0, 2.0, 3.0], abs=1e-9), name
        assert rows[name]["turned_deg"] == pytest.approx([0.0, 0.0, 30.0], abs=1e-9), name


def test_the_spindle_and_coolant_turn_on_by_every_way(ways: Ways) -> None:
    def turns(rev_min: float) -> None:
        ways.shop.until(lambda now: now["spindle"]["rev_min"] == rev_min, f"{rev_min} 1/min")

    ways.mdi("T2 M6")  # with the probe in it, nobody turns it
    ways.rest("PUT", "/machine/spindle", {"rev_min": 700.0})
    turns(700.0)
    ways.command("spindle", "-800")
    turns(-800.0)
    ways.page_has_control()
    ways.page.evaluate("dx.show('jog')")
    ways.page.fill("#run-spindle", "900")
    ways.page.click("[data-hand=right]")
    browser.yes(ways.page)
    turns(900.0)
    ways.mdi("M5")
    turns(0.0)
    ways.command("coolant", "--flood")
    ways.shop.until(lambda now: now["coolant"]["flood"], "flood")
    ways.rest("PUT", "/machine/coolant", {"mist": False, "flood": False})
    ways.shop.until(lambda now: not now["coolant"]["flood"], "off")
