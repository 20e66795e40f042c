"""The machine in three dimensions: path, tool, rotaries, frames, views; every shipped machine's chain."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest
from support.live import browser
from support.live.browser import Site

from controller.machine import machine_file, setup_data
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.plan.report import picture as pictures
from controller.service import status

pytestmark = pytest.mark.slow

NAME = "example2_ready.ngc"
JOINTS = (12.0, -7.0, 180.0, math.radians(25.0), math.radians(-40.0))
MACHINES = ("trunnion", "table_head", "head_head", "oblique45", "xyzac_linuxcnc")


@pytest.fixture(scope="module")
def looker(chromium: Any, stepped: Site) -> Iterator[Any]:
    """One page for all tests, small: it is drawn without a graphics card."""
    with browser.looker(chromium, stepped, 640, 480, "scene") as made:
        yield made


@pytest.fixture(autouse=True)
def picture(looker: Any, stepped: Site) -> None:
    """The view on the screen, with the path of Example 2."""
    stepped.tell()
    looker.evaluate("dx.show('scene')")
    looker.wait_for_function("() => window.dxScene && dxScene.shape && dxScene.tool_key")


# ---- the program


def test_the_picture_has_the_path_done_and_to_do_and_the_surfaces(looker: Any) -> None:
    looker.wait_for_function("() => dxScene.path?.at > 0")
    drawn = looker.evaluate(
        "[dxScene.shape.surfaces.length, dxScene.path.done.geometry.drawRange.count,"
        " dxScene.path.ahead.geometry.drawRange.count, dxScene.shape.tips.length, dxScene.path.at]"
    )
    surfaces, done, ahead, points, at = drawn
    assert surfaces == 2
    assert (done, ahead) == (at + 1, points - at)


def test_a_program_that_was_checked_anew_is_drawn_anew_though_its_name_is_the_same(
    looker: Any, stepped: Site
) -> None:
    """With another offset or tool; the same for another text under the same name."""
    folder = stepped.folder / "panel" / "pictures"
    (kept,) = [file for file in folder.glob("*.npz") if file.stem != "moved"]
    shape = pictures.load(kept)
    pictures.Shape(shape.tips + 5.0, *(getattr(shape, name) for name in shape.__slots__[1:])).save(
        folder / "moved.npz"
    )
    first = looker.evaluate("dxScene.shape.tips[0][0]")
    (stepped.folder / "picture").write_text("moved")
    looker.evaluate("dxScene.ask()")
    looker.wait_for_function("(x) => dxScene.shape?.tips[0][0] === x", arg=round(first + 5.0, 3))
    (stepped.folder / "picture").unlink()
    looker.evaluate("dxScene.job = 'the same name, another sum'")
    looker.wait_for_function("(x) => dxScene.shape?.tips[0][0] === x", arg=first)


def test_what_was_drawn_is_not_sent_again(looker: Any) -> None:
    shape = looker.evaluate_handle("dxScene.shape")
    with looker.expect_response("**/picture") as waiting:
        looker.evaluate("dxScene.ask()")
    assert waiting.value.status == 304
    assert looker.evaluate("(shape) => dxScene.shape === shape", shape)


def test_a_line_typed_by_hand_leaves_the_loaded_program_in_the_picture(looker: Any, stepped: Site) -> None:
    asked: list[str] = []
    looker.on("request", lambda request: asked.append(request.url))
    stepped.tell(job={"name": "MDI", "sha256": "0" * 64, "state": "running", "block": 0})
    looker.wait_for_function("() => dx.status.job.name === 'MDI'")
    looker.wait_for_timeout(200)
    assert looker.evaluate("dxScene.shape !== null")
    assert looker.inner_text("#scene-said") == ""
    assert not [url for url in asked if url.endswith("/MDI/picture")]


def test_why_there_is_no_picture_is_said_as_long_as_that_program_is_loaded(
    looker: Any, stepped: Site
) -> None:
    stepped.tell(job={"name": "gone.ngc", "sha256": "0" * 64, "state": "loaded"})
    looker.wait_for_function("() => document.querySelector('#scene-said').textContent.includes('gone.ngc')")
    assert looker.evaluate("dxScene.shape === null")
    stepped.tell(job=None)
    looker.wait_for_function("() => document.querySelector('#scene-said').textContent === ''")


def test_without_a_program_nothing_of_one_is_drawn(looker: Any, stepped: Site) -> None:
    stepped.tell(job=None)
    looker.wait_for_function("() => dxScene.shape === null && !dxScene.part.children.length")


LEGEND = """() => {
  const key = (name) => document.querySelector(`.key .${name}`);
  const shown = (name) => getComputedStyle(key(name)).getPropertyValue("--colour");
  const { path, materials, trail, box, disc } = dxScene;
  const drawn = (material) => `#${material.color.getHexString()}`;
  const colours = path.ahead.geometry.getAttribute("color");
  const of_kind = (kind) => {
    const i = path.shape.kinds.indexOf(kind);
    const rgb = [colours.getX(i), colours.getY(i), colours.getZ(i)];
    return `#${materials.cutter.color.clone().setRGB(...rgb).getHexString()}`;
  };
  const all = {
    ...{ rapid: of_kind(0), feed: of_kind(1), along: of_kind(2), done: drawn(path.done.material) },
    ...{ trail: drawn(trail.material), surface: drawn(path.mesh.material), tool: drawn(materials.cutter) },
    ...{ holder: drawn(materials.holder), table: drawn(disc.material), travel: drawn(box.material) },
  };
  return Object.entries(all).map(([name, colour]) => [name, shown(name), colour]);
}"""
WAYS = ("rapid", "feed", "along", "done", "trail")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_legend_has_everything_in_the_colour_in_which_it_is_drawn(theme: str, looker: Any) -> None:
    if looker.evaluate("document.documentElement.dataset.theme") != theme:
        looker.click("#dx-theme")
    told = looker.evaluate(LEGEND)
    assert len(told) == looker.locator(".key:not(#scene-scale)").count()
    assert [name for name, shown, drawn in told if shown != drawn] == []
    colours = {name: drawn for name, _, drawn in told}
    assert len({colours[name] for name in (*WAYS, "surface")}) == len(WAYS) + 1, "told apart"


# ---- what moves


def test_the_tool_in_the_spindle_is_drawn_where_the_status_tells(looker: Any) -> None:
    """T4 of the shipped table has a radius of 0.5 mm."""
    looker.wait_for_function("() => JSON.parse(dxScene.tool_key).number === 4")
    assert looker.evaluate("JSON.parse(dxScene.tool_key).radius_mm") == 0.5
    apart = looker.evaluate(
        "() => { dxScene.status(dx.status); const at = dxScene.tool.position.toArray();"
        " return Math.hypot(...dx.status.on_table.tip.map((v, i) => v - at[i])) }"
    )
    assert apart < 1e-6


# A picture of its own beside the one on the screen: where the tool is by the tables' chain, and where the
# spindle's nose with the tool on it is by the heads' chain.
CHAINS = """([facts, status]) => {
  const one = new dxScene.constructor(facts);
  one.frame = "machine";
  one.turn(status.joints);
  one.set_tool(status.on_table);
  one.root.updateMatrixWorld(true);
  const point = (group, at) => group.localToWorld(one.tool.position.clone().set(...at)).toArray();
  const lines = one.axis_marks.map((mark) => {
    const at = mark.geometry.getAttribute("position");
    return [0, 1].map((i) => point(mark, [at.getX(i), at.getY(i), at.getZ(i)]));
  });
  const nose = one.heads.at(-1)?.group ?? one.gauge;
  const L = status.on_table.length_mm;
  return { tip: point(one.tool, [0, 0, 0]), top: point(one.tool, [0, 0, L]), end: point(nose, [0, 0, -L]),
           nose: point(nose, [0, 0, 0]), lines };
}"""


def shown(machine: Machine, joints: tuple[float, ...], length_mm: float) -> dict[str, Any]:
    """A status as far as the picture needs it."""
    pose = kinematics_of(machine).forward(tuple(joints), length_mm)
    values = zip(machine.axes, machine.shown(joints), strict=True)
    on_table = {"tip": list(pose.tip), "axis": list(pose.axis), "length_mm": length_mm}
    return {"joints": {axis.name: {"actual": value} for axis, value in values}, "on_table": on_table}


@pytest.mark.parametrize("name", MACHINES)
def test_tables_and_heads_stand_as_the_kinematics_says(name: str, looker: Any) -> None:
    """The tool hangs on the table's side and on the head's side of the chain: both must meet."""
    machine = machine_file.load(name)
    facts = status.facts(
        machine, {"offsets": setup_data.offsets_of(machine), "tools": setup_data.tools_of(machine)}
    )
    found = looker.evaluate(CHAINS, [facts, shown(machine, JOINTS, 80.0)])
    assert found["end"] == pytest.approx(found["tip"], abs=1e-4)
    assert found["nose"] == pytest.approx(found["top"], abs=1e-4)


def test_the_line_of_a_rotary_tilts_with_the_rotary_that_carries_it(looker: Any) -> None:
    machine = machine_file.load("trunnion")
    _, c = found = looker.evaluate(CHAINS, [status.facts(machine, {}), shown(machine, JOINTS, 0.0)])["lines"]
    along = [end - begin for begin, end in zip(*c, strict=True)]
    tilt = math.atan2(-along[1], along[2])
    assert (along[0], tilt) == pytest.approx((0.0, JOINTS[3]), abs=1e-4)
    assert len(found) == 2


TURNED = """() => {
  dxScene.status(dx.status);
  const off = ({ name, group }) => {
    const { elements: m } = group.matrix;
    const turned = Math.acos(Math.max(-1, Math.min(1, (m[0] + m[5] + m[10] - 1) / 2)));
    return turned * 180 / Math.PI - Math.abs((dx.status.joints[name].actual + 540) % 360 - 180);
  };
  return dxScene.tables.map(off);
}"""


def test_the_table_is_turned_as_far_as_the_rotaries_are(looker: Any) -> None:
    assert looker.evaluate(TURNED) == pytest.approx([0.0, 0.0], abs=0.01)


# ---- frames, box, views


def test_the_frame_of_the_active_offset_stands_at_its_origin_and_is_turned_as_it_is(
    looker: Any, stepped: Site
) -> None:
    offsets = looker.evaluate("dx.facts.offsets")
    turned = {"origin_mm": [1.0, 2.0, 3.0], "axes": [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]}
    assert looker.evaluate("dxScene.offset.position.toArray()") == offsets["G54"]["origin_mm"]
    looker.evaluate("(one) => { dxScene.facts.offsets.G55 = one }", turned)
    stepped.tell(work_offset="G55")
    looker.wait_for_function("() => dxScene.offset.position.x === 1")
    x = looker.evaluate(
        "dxScene.home.position.clone().set(1, 0, 0).applyQuaternion(dxScene.offset.quaternion).toArray()"
    )
    assert x == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)


BOX = """() => {
  const { geometry, position } = dxScene.box;
  geometry.computeBoundingBox();
  return ["min", "max"].map((end) => geometry.boundingBox[end].clone().add(position).toArray());
}"""


def test_the_box_has_the_travel_of_the_linear_axes(looker: Any) -> None:
    low, high = looker.evaluate(BOX)
    axes = machine_file.load("shop").axes[:3]
    assert low == pytest.approx([axis.travel_min for axis in axes])
    assert high == pytest.approx([axis.travel_max for axis in axes])


# Of the way from the camera to what it looks at: the coordinate that leads, and its sign.
VIEWS = (("top", 2, 1), ("front", 1, -1), ("side", 0, 1))


@pytest.mark.parametrize(("view", "place", "sign"), VIEWS)
def test_a_view_looks_from_its_side(view: str, place: int, sign: int, looker: Any) -> None:
    looker.click(f"[data-scene='look {view}']")
    looker.wait_for_function(
        "([place, sign]) => { const { camera, controls } = dxScene.stage;"
        " const way = camera.position.clone().sub(controls.target).normalize().toArray();"
        " return sign * way[place] > 0.99 }",
        arg=[place, sign],
    )


def test_the_machine_may_stand_instead_of_the_part(looker: Any) -> None:
    looker.click("[data-scene='frame machine']")
    looker.wait_for_function("() => dxScene.frame === 'machine'")
    assert looker.evaluate("dxScene.root.matrix.elements[0]") == 1.0
    looker.click("[data-scene='frame part']")
    still = looker.evaluate(
        "() => { dxScene.status(dx.status); dxScene.root.updateMatrixWorld(true);"
        " return dxScene.table.matrixWorld.elements }"
    )
    assert still == pytest.approx([float(i % 5 == 0) for i in range(16)], abs=1e-6), "the part stands"


def test_the_trail_is_cleared(looker: Any) -> None:
    looker.wait_for_function("() => dxScene.trail_count > 3")
    before = looker.evaluate("dxScene.trail_count")
    looker.click("[data-scene='clear']")
    assert looker.evaluate("dxScene.trail_count") < before


def test_what_nobody_looks_at_is_not_drawn(looker: Any) -> None:
    """The scene would draw for ever as long as the page is open."""
    looker.wait_for_function("() => dxScene.stage.drawn > 0")
    looker.evaluate("dx.show('runs')")
    before = looker.evaluate("dxScene.stage.drawn")
    looker.wait_for_timeout(500)
    assert looker.evaluate("dxScene.stage.drawn") == before
    looker.evaluate("dx.show('scene')")
    looker.wait_for_function("(before) => dxScene.stage.drawn > before", arg=before)


# ---- along the planned program, before anything moves

SCRUB = """(share) => { const slider = document.getElementById("scene-scrub");
  slider.value = share;
  slider.dispatchEvent(new Event("input"));
  const axis = new dxScene.tool.position.constructor(0, 0, 1).applyQuaternion(dxScene.tool.quaternion);
  const shown = document.getElementById("scene-line").innerText;
  return [dxScene.tool.position.toArray(), axis.toArray(), shown]; }"""


def test_the_slider_puts_the_tool_at_its_pose_of_the_planned_path(looker: Any, stepped: Site) -> None:
    """On a surface its axis lies along the ruling there; the line is that of the point."""
    stepped.tell(mode="READY")
    looker.wait_for_function("() => dx.status.mode === 'READY' && dxScene.path")
    looker.wait_for_selector("#scene-scrub")
    shape = looker.evaluate("dxScene.path.shape")
    rulings = [(one[:3], one[3:]) for one in shape["rulings"]]
    seen = set()
    for k in range(1, 160):
        tip, axis, shown = looker.evaluate(SCRUB, k / 160.0)
        near = min(range(len(shape["tips"])), key=lambda i: math.dist(shape["tips"][i], tip))
        if shape["kinds"][near] == pictures.SURFACE and math.dist(shape["tips"][near], tip) < 2.0:
            upper, lower = min(rulings, key=lambda ends: math.dist(ends[1], tip))
            length = math.dist(upper, lower)
            cosine = sum((a - b) / length * c for a, b, c in zip(upper, lower, axis, strict=True))
            assert cosine > math.cos(math.radians(4.0)), (k, shape["lines"][near])
            seen.add(shape["lines"][near])
        assert shown.startswith("planned, line "), shown
    assert seen == {10, 19}


def test_what_is_planned_is_played_and_gives_way_to_a_machine_that_moves(looker: Any, stepped: Site) -> None:
    stepped.tell(mode="READY")
    looker.wait_for_function("() => dx.status.mode === 'READY'")
    looker.click("[data-scene='speed 1']")  # a minute: a busy computer presses pause before its end
    looker.click("[data-scene=play]")
    looker.wait_for_function("() => dxScene.shown_share > 0.002")
    looker.click("[data-scene=pause]")
    looker.wait_for_selector("[data-scene=play]")  # it is in its place: nothing moves any more
    share = looker.evaluate("dxScene.shown_share")
    looker.wait_for_timeout(200)
    assert looker.evaluate("dxScene.shown_share") == share < 1.0
    looker.click("[data-scene='speed 20']")
    looker.click("[data-scene=play]")
    looker.wait_for_function("() => dxScene.shown_share === 1")
    looker.wait_for_selector("[data-scene=play]")
    stepped.tell()
    looker.wait_for_function("() => dx.status.mode === 'RUNNING' && dxScene.shown_share === null")
    looker.wait_for_selector("#scene-line:text-is('machine, now')")


COVERED = """() => {
  const covered = (control) => {
    control.scrollIntoView({ block: "nearest" });
    const { x, y, width, height } = control.getBoundingClientRect();
    return !control.contains(document.elementFromPoint(x + width / 2, y + height / 2));
  };
  const controls = [...document.querySelectorAll("section.view[data-shown] :is(button, input)")];
  return [controls.length, controls.filter(covered).map((one) => one.dataset.scene ?? one.id)];
}"""
FILLS = """() => {
  const canvas = document.querySelector("section.view[data-shown] canvas"), place = canvas?.parentNode;
  const { width, height } = place?.parentNode.getBoundingClientRect() ?? {};
  const fills = canvas?.clientWidth === place?.clientWidth && canvas?.clientHeight === place?.clientHeight;
  return fills && (!width || (place.clientWidth <= width && place.clientHeight <= height));
}"""


@pytest.mark.parametrize("size", [(640, 480), (1024, 768), (1280, 720), (1920, 1080)])
def test_the_picture_fills_its_place_in_each_view_and_covers_no_control_of_its_own(
    looker: Any, size: tuple[int, int]
) -> None:
    looker.set_viewport_size({"width": size[0], "height": size[1]})
    try:
        for view in ("run", "jog", "scene"):
            looker.evaluate(f"dx.show('{view}')")
            looker.wait_for_function(FILLS)
        count, covered = looker.evaluate(COVERED)
        assert count > 10 and covered == []
    finally:
        looker.set_viewport_size({"width": 640, "height": 480})


# ---- the surfaces as cut

CUT = """async () => {
  const maps = await import("/page/maps.js");
  const { mixed, scale_um } = maps;
  const said = await dx.call("GET", "programs/example2_ready.ngc/check");
  const { surfaces } = said.body.result.verified;
  const full_um = scale_um(surfaces);
  const [worst, found] = [[], dxScene.cut.group.children];
  found.forEach(({ geometry }, s) => {
    const { map_um, rulings_mm } = surfaces[s];
    const [at, colour] = [geometry.getAttribute("position"), geometry.getAttribute("color")];
    map_um.forEach((row, r) => row.forEach((um, k) => {
      const i = k * map_um.length + r, v = r / (map_um.length - 1);
      const place = [0, 1, 2].map((j) => (1 - v) * rulings_mm[k][j] + v * rulings_mm[k][j + 3]);
      const shown = new THREE.Color(colour.getX(i), colour.getY(i), colour.getZ(i)).convertLinearToSRGB();
      worst.push(Math.max(...place.map((p, j) => Math.abs(p - at.getComponent(i, j)))));
      const rgb = [shown.r, shown.g, shown.b];
      worst.push(Math.max(...mixed(um, full_um).map((p, j) => Math.abs(p / 255 - rgb[j]))));
    }));
  });
  return [found.length, Math.max(...worst), dxScene.cut.group.visible, dxScene.path.mesh.visible];
}""".replace(
    "async () => {", 'async () => { const THREE = await import("/page/vendor/three.module.min.js");', 1
)


def test_the_map_lies_on_the_surface_with_the_colours_of_the_one_beside_the_program(
    looker: Any, stepped: Site
) -> None:
    looker.wait_for_selector("[data-scene=cut]:not([aria-disabled])")
    looker.dispatch_event("[data-scene=cut]", "click")  # the page is too small for all of its buttons
    looker.wait_for_selector(".scene-scale >> text=+219 µm")
    assert looker.evaluate(CUT) == [2, pytest.approx(0.0, abs=0.003), True, False]
    assert looker.get_attribute("[data-scene=cut]", "aria-pressed") == "true"
    looker.dispatch_event("[data-scene=cut]", "click")
    looker.wait_for_selector(".scene-scale", state="detached")
    assert looker.evaluate(CUT)[2:] == [False, True]


def test_without_a_map_it_is_said_why(page: Any, site: Site) -> None:
    page.evaluate("dx.show('scene')")
    page.wait_for_selector("[data-scene=cut][aria-disabled=true][title*='no map of cut surfaces']")
