// The machine as a picture: part, path, tool, rotaries. One object of the scene that moves itself by the
// machine's events, so that nothing of it passes through the page's server side twenty times a second.
//
//   root ── limits box, machine's frame         machine frame, rotaries at zero
//     ├─ tables ─ table ─┬─ offset's frame, surfaces, path, trail     turn with the table rotaries
//     │                  └─ tool                                       at the tip that the status tells
//     └─ gauge ─ heads                                                 go with X Y Z, turn with the head rotaries
//
// The line that a rotary turns about lies in the body that carries the rotary.
// In the view of the part the root turns back what the table turned, so the part stands still.
import { THREE } from "nicegui-scene";

const RAPID = 0;
const TRAIL = 4000; // points
const SHANK_MM = 35;
const AXIS_MM = 120; // half a rotary's line
const AGAIN_S = 3;
const css = (name) => getComputedStyle(document.body).getPropertyValue(name).trim() || "#888888";
const vector = (v) => new THREE.Vector3(...(v ?? [0, 0, 0]));
const UP = new THREE.Vector3(0, 0, 1);

export default class MachinePicture {
  create_mesh(scene, facts) {
    this.scene = scene; // id of the element
    this.facts = facts;
    this.root = new THREE.Group();
    this.table = new THREE.Group();
    this.gauge = new THREE.Group();
    this.axis_marks = [];
    this.frame = "part";
    this.job = ""; // name and sum of the program whose path is shown
    this.tag = ""; // of the picture that is shown
    this.trail_count = 0;
    this.root.matrixAutoUpdate = false;
    this.build();
    const dx = window.dx;
    dx.on("status", (status) => this.status(status));
    dx.on("painted", () => this.theme());
    const early = setInterval(() => this.theme() && clearInterval(early), 50); // also where no figures come
    dx.on("view", (name) => name === "scene" && this.came());
    dx.on("programs", () => this.ask());
    setInterval(() => this.ask(), 1000 * AGAIN_S);
    window.dxScene = this;
    setTimeout(() => window.dxScene.look("iso"), 300);
    return this.root;
  }

  // ---- what does not change

  build() {
    const axes = this.facts.axes ?? [];
    this.tables = this.chain(axes, "table", this.root, this.table);
    this.heads = this.chain(axes, "head", this.gauge, new THREE.Group());
    this.root.add(this.gauge);
    this.limits(axes);
    this.plate();
    this.offset = new THREE.AxesHelper(20);
    this.table.add(this.offset);
    this.home = new THREE.AxesHelper(60);
    this.root.add(this.home);
    this.part = new THREE.Group();
    this.table.add(this.part);
    this.make_tool();
    this.make_trail();
    this.place_offset();
    this.theme();
  }

  // Rotaries one upon the other, and what the last of them carries.
  chain(axes, kind, base, carried) {
    let inner = base;
    const found = axes.filter((one) => one.kind === kind && one.direction).map((axis) => {
      const [direction, point] = [vector(axis.direction), vector(axis.point_mm)];
      const way = direction.clone().multiplyScalar(AXIS_MM);
      this.axis_marks.push(this.line([point.clone().sub(way), point.clone().add(way)], css("--dim"), inner, true));
      const group = new THREE.Group();
      group.matrixAutoUpdate = false;
      inner.add(group);
      inner = group;
      return { name: axis.name, group, direction, point, sense: kind === "table" && axis.sense === "iso" ? -1 : 1 };
    });
    inner.add(carried);
    return found;
  }

  line(points, colour, parent, dashed = false) {
    const geometry = new THREE.BufferGeometry().setFromPoints(points);
    const Material = dashed ? THREE.LineDashedMaterial : THREE.LineBasicMaterial;
    const made = new THREE.Line(geometry, new Material({ color: colour, dashSize: 6, gapSize: 4, transparent: true }));
    if (dashed) made.computeLineDistances();
    parent.add(made);
    return made;
  }

  limits(axes) {
    const travel = ["X", "Y", "Z"].map((name) => axes.find((axis) => axis.name === name)?.travel ?? [0, 0]);
    const size = travel.map(([low, high]) => Math.max(1e-3, high - low));
    const middle = travel.map(([low, high]) => (low + high) / 2);
    const edges = new THREE.EdgesGeometry(new THREE.BoxGeometry(...size));
    this.box = new THREE.LineSegments(edges, new THREE.LineBasicMaterial({ transparent: true, opacity: 0.5 }));
    this.box.position.set(...middle);
    this.root.add(this.box);
  }

  // What carries the work: a disc across the last table rotary, a square where there is none.
  plate() {
    const last = this.tables[this.tables.length - 1];
    const geometry = last ? new THREE.CylinderGeometry(60, 60, 2, 64) : new THREE.BoxGeometry(150, 2, 150);
    this.disc = new THREE.Mesh(geometry, new THREE.MeshPhongMaterial({ transparent: true, opacity: 0.25, depthWrite: false }));
    this.disc.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), last ? last.direction : UP);
    if (last) this.disc.position.copy(last.point);
    this.disc.position.addScaledVector(last ? last.direction : UP, -1);
    this.table.add(this.disc);
  }

  // The frame of the work offset that is active.
  place_offset(name = "G54") {
    const offset = this.facts.offsets?.[name];
    const key = JSON.stringify(offset ?? null);
    if (!offset || key === this.offset_key) return;
    this.offset_key = key;
    this.offset.position.set(...offset.origin_mm);
    const axes = offset.axes ?? [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    this.offset.quaternion.setFromRotationMatrix(new THREE.Matrix4().makeBasis(...axes.map(vector)));
    this.changed = true;
  }

  make_tool() {
    this.tool = new THREE.Group();
    this.cutter = new THREE.MeshPhongMaterial({ transparent: true, opacity: 0.9, side: THREE.DoubleSide });
    this.shank = new THREE.MeshPhongMaterial({ transparent: true, opacity: 0.5, side: THREE.DoubleSide });
    this.table.add(this.tool);
    this.take_tool(undefined);
  }

  // The cutter in the spindle, as the tool table has it; one that is not known is not drawn.
  take_tool(number) {
    const tools = Object.values(this.facts.tools ?? {});
    const tool = number === undefined ? tools[0] : tools.find((one) => one.number === number);
    const key = JSON.stringify(tool ?? null);
    if (key === this.tool_key) return;
    this.tool_key = key;
    for (const part of [...this.tool.children]) {
      this.tool.remove(part);
      part.geometry.dispose();
    }
    if (!tool) return;
    const length = Math.max(tool.length_mm, tool.flute_mm);
    const flank = tool.radius_mm + tool.flute_mm * Math.tan(tool.taper_rad ?? 0);
    this.turned(cutter_profile(tool), this.cutter);
    this.turned([[flank, tool.flute_mm], [flank, length + 5]], this.shank);
    const holder = tool.holder?.length ? tool.holder : null;
    for (const [from, to, radius] of holder ?? []) this.turned([[0, from], [radius, from], [radius, to], [0, to]], this.shank);
    if (!holder) this.turned([[0, length + 5], [2.5 * flank + 4, length + 5], [3 * flank + 8, length + SHANK_MM]], this.shank);
  }

  // A body turned about the tool's axis, of [radius, height] points.
  turned(profile, material) {
    const geometry = new THREE.LatheGeometry(profile.map(([r, z]) => new THREE.Vector2(r, z)), 48);
    geometry.rotateX(Math.PI / 2); // three.js turns about Y; the tool's axis is Z
    this.tool.add(new THREE.Mesh(geometry, material));
  }

  make_trail() {
    this.trail_geometry = new THREE.BufferGeometry();
    this.trail_geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * TRAIL), 3));
    this.trail_geometry.setDrawRange(0, 0);
    this.trail = new THREE.Line(this.trail_geometry, new THREE.LineBasicMaterial());
    this.trail.frustumCulled = false;
    this.table.add(this.trail);
  }

  theme() {
    const key = document.body.className;
    if (key === this.themed) return true;
    const renderer = window.getElement?.(this.scene)?.renderer;
    if (!renderer) return false; // not mounted yet
    this.spare(renderer);
    this.themed = key;
    renderer.setClearColor(css("--bg"));
    this.box.material.color.set(css("--dim"));
    for (const mark of this.axis_marks) mark.material.color.set(css("--dim"));
    this.disc.material.color.set(css("--dim"));
    this.cutter.color.set(css("--hold"));
    this.shank.color.set(css("--dim"));
    this.trail.material.color.set(css("--hold"));
    this.paint();
    return true;
  }

  // The scene draws for ever, also where nobody looks and nothing has changed: a page that is left open
  // would keep a processor busy.
  spare(renderer) {
    if (this.drawn !== undefined) return;
    this.drawn = 0; // pictures
    const draw = renderer.render.bind(renderer);
    const [view, size] = [new THREE.Matrix4(), new THREE.Vector2()];
    const now = new THREE.Vector2();
    renderer.render = (scene, camera) => {
      if (!window.dx.shown("scene") || document.hidden) return;
      camera.updateMatrixWorld();
      renderer.getSize(now);
      if (!this.changed && view.equals(camera.matrixWorld) && size.equals(now)) return;
      this.changed = false;
      view.copy(camera.matrixWorld);
      size.copy(now);
      this.drawn += 1;
      draw(scene, camera);
    };
  }

  // ---- the program's path

  // Which path is to be seen. A line typed by hand has none: what is loaded stays.
  follow(job) {
    if (job?.name === "MDI") return;
    const key = job ? `${job.name} ${job.sha256}` : "";
    if (key === this.job) return;
    [this.job, this.name] = [key, job?.name ?? ""];
    this.clear_path();
    window.dx.write(document.getElementById("scene-said"), "");
    this.ask();
  }

  // The path by the program's last check, where that is another one than is shown: it may be checked
  // anew, with another offset or tool.
  async ask() {
    const [dx, job] = [window.dx, this.job];
    if (!job || this.asking === job || !dx.shown("scene") || document.hidden) return;
    this.asking = job;
    const known = this.tag ? { "If-None-Match": this.tag } : {};
    try {
      const answer = await fetch(`/api/v1/programs/${encodeURIComponent(this.name)}/picture`, { headers: { ...dx.headers(), ...known } });
      const said = answer.status === 304 ? null : await answer.json();
      if (said && job === this.job) this.show(answer, said); // else another one was loaded meanwhile
    } catch (error) {
      // the panel is away; it is asked again
    } finally {
      if (this.asking === job) this.asking = "";
    }
  }

  show(answer, said) {
    const refused = answer.ok ? "" : window.dx.sentence(said.error);
    window.dx.write(document.getElementById("scene-said"), refused);
    if (answer.ok || answer.status === 404) this.clear_path(); // else it was only not answered now
    if (!answer.ok) return;
    this.tag = answer.headers.get("etag") ?? "";
    this.fitted();
    this.shape = said;
    this.surfaces();
    this.lines();
    this.paint();
    this.look("iso");
  }

  clear_path() {
    for (const child of [...this.part.children]) {
      this.part.remove(child);
      child.geometry?.dispose();
      child.material?.dispose();
    }
    this.shape = null;
    this.tag = "";
    this.done = this.ahead = this.mesh = this.ruled = null;
    this.changed = true;
  }

  surfaces() {
    const { rulings, surfaces } = this.shape;
    if (!rulings.length) return;
    const points = new Float32Array(rulings.flat());
    const position = new THREE.BufferAttribute(points, 3);
    const faces = [];
    let first = 0;
    for (const count of surfaces) {
      for (let i = first; i + 1 < first + count; i += 1) {
        const [a, b, c, d] = [2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 3];
        faces.push(a, b, c, b, d, c);
      }
      first += count;
    }
    const skin = new THREE.BufferGeometry();
    skin.setAttribute("position", position);
    skin.setIndex(faces);
    skin.computeVertexNormals();
    const material = new THREE.MeshPhongMaterial({ side: THREE.DoubleSide, transparent: true, opacity: 0.45, depthWrite: false });
    this.mesh = new THREE.Mesh(skin, material);
    const wires = new THREE.BufferGeometry();
    wires.setAttribute("position", position); // upper and lower end in turn: pairs are the rulings
    this.ruled = new THREE.LineSegments(wires, new THREE.LineBasicMaterial({ transparent: true, opacity: 0.5 }));
    this.part.add(this.mesh, this.ruled);
  }

  // Two lines over the same points: what is done, and what is to do.
  lines() {
    const { tips } = this.shape;
    const position = new THREE.BufferAttribute(new Float32Array(tips.flat()), 3);
    const make = (colours) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", position);
      if (colours) geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * tips.length), 3));
      const made = new THREE.Line(geometry, new THREE.LineBasicMaterial({ vertexColors: colours }));
      made.frustumCulled = false;
      this.part.add(made);
      return made;
    };
    this.ahead = make(true);
    this.done = make(false);
    this.reached(0);
  }

  paint() {
    this.changed = true;
    if (!this.shape) return;
    this.done.material.color.set(css("--go"));
    this.mesh?.material.color.set(css("--accent"));
    this.ruled?.material.color.set(css("--accent"));
    const colours = this.ahead.geometry.getAttribute("color");
    const kinds = [css("--dim"), css("--info"), css("--text")].map((one) => new THREE.Color(one));
    this.shape.kinds.forEach((kind, i) => colours.setXYZ(i, kinds[kind].r, kinds[kind].g, kinds[kind].b));
    colours.needsUpdate = true;
  }

  reached(i) {
    this.at = i;
    const n = this.shape.tips.length;
    this.done.geometry.setDrawRange(0, i + 1);
    this.ahead.geometry.setDrawRange(i, n - i);
  }

  // The point of the path that the tool has passed last: of its motion, the nearest.
  progress(job, tip) {
    const { motions, tips } = this.shape;
    if (job.block === null || job.block === undefined || !tip) return this.reached(job.state === "completed" ? tips.length - 1 : 0);
    let first = lower(motions, job.block);
    const end = lower(motions, job.block + 1);
    // Where the motion lost its own points by thinning, its neighbours stand for it.
    first = Math.max(0, first - 1);
    let best = first;
    let least = Infinity;
    for (let i = first; i < Math.min(tips.length, end + 1); i += 1) {
      const away = (tips[i][0] - tip[0]) ** 2 + (tips[i][1] - tip[1]) ** 2 + (tips[i][2] - tip[2]) ** 2;
      if (away < least) [best, least] = [i, away];
    }
    this.reached(best);
  }

  // ---- what moves

  // On the screen again: anything may have been changed since.
  came() {
    this.changed = true;
    setTimeout(() => window.dispatchEvent(new Event("resize")), 50);
    this.ask();
    this.fitted();
  }

  // Tools and offsets as they are now.
  async fitted() {
    for (const what of ["tools", "offsets"]) {
      const said = await window.dx.call("GET", what, null, true);
      if (said.ok) this.facts[what] = said.body[what];
    }
  }

  status(status) {
    const job = status.job;
    if (!window.dx.shown("scene")) return;
    this.follow(job);
    this.place_offset(status.work_offset);
    this.turn(status.joints ?? {});
    this.take_tool(status.tool);
    this.hold_tool(status.on_table);
    if (this.shape && job && job.name !== "MDI") this.progress(job, status.on_table?.tip);
    const turned = [...this.tables, ...this.heads].map(({ name }) => status.joints?.[name]?.actual);
    const key = JSON.stringify([status.on_table, turned, this.at, this.tool_key]);
    if (key !== this.posed) this.changed = true;
    this.posed = key;
  }

  turn(joints) {
    const where = (name) => joints[name]?.actual ?? joints[name]?.machine ?? 0;
    for (const { name, group, direction, point, sense } of [...this.tables, ...this.heads]) {
      const turned = new THREE.Matrix4().makeRotationAxis(direction, (sense * where(name) * Math.PI) / 180);
      const { x, y, z } = point;
      group.matrix.makeTranslation(x, y, z).multiply(turned).multiply(new THREE.Matrix4().makeTranslation(-x, -y, -z));
    }
    this.gauge.position.set(where("X"), where("Y"), where("Z"));
    const back = new THREE.Matrix4();
    if (this.frame === "part") for (const { group } of this.tables) back.multiply(group.matrix);
    this.root.matrix.copy(back.invert());
    this.root.matrixWorldNeedsUpdate = true;
  }

  hold_tool(pose) {
    this.tool.visible = Boolean(pose);
    if (!pose) return;
    this.tool.position.set(...pose.tip);
    this.tool.quaternion.setFromUnitVectors(UP, vector(pose.axis).normalize());
    this.leave(pose.tip);
  }

  leave([x, y, z]) {
    const points = this.trail_geometry.getAttribute("position");
    const n = this.trail_count;
    if (n && Math.hypot(points.getX(n - 1) - x, points.getY(n - 1) - y, points.getZ(n - 1) - z) < 0.02) return;
    if (n === TRAIL) {
      // The older half goes: copying every point at every status would cost more.
      points.array.copyWithin(0, (3 * TRAIL) / 2);
      this.trail_count = TRAIL / 2;
    }
    points.setXYZ(this.trail_count, x, y, z);
    this.trail_count += 1;
    points.needsUpdate = true;
    this.trail_geometry.setDrawRange(0, this.trail_count);
  }

  // ---- what is pressed

  clear() {
    this.changed = true;
    this.trail_count = 0;
    this.trail_geometry.setDrawRange(0, 0);
  }

  see(frame) {
    this.changed = true;
    this.frame = frame;
    if (window.dx.status) this.turn(window.dx.status.joints ?? {});
  }

  // Looks at the part from a side; at the machine where there is none.
  look(from) {
    const scene = window.getElement?.(this.scene);
    if (!scene?.move_camera) return;
    const ways = { iso: [-0.9, -1.2, 0.9], top: [0, -0.001, 1], front: [0, -1, 0.001], side: [1, 0, 0.001], machine: [-0.9, -1.2, 0.9] };
    this.root.updateMatrixWorld(true);
    const box = new THREE.Box3();
    if (from === "machine" || !this.shape) box.setFromObject(from === "machine" ? this.box : this.disc);
    else this.bound(box);
    const ball = box.getBoundingSphere(new THREE.Sphere());
    const way = vector(ways[from] ?? ways.iso).normalize();
    const far = Math.max(20, ball.radius) * (from === "machine" ? 2.1 : 2.6);
    const { x, y, z } = ball.center;
    scene.move_camera(x + far * way.x, y + far * way.y, z + far * way.z, x, y, z, 0, 0, 1, 0.3);
  }

  // The part is what is fed: rapids lead far away.
  bound(box) {
    const point = new THREE.Vector3();
    const world = this.part.matrixWorld;
    this.shape.tips.forEach((tip, i) => {
      if (this.shape.kinds[i] !== RAPID) box.expandByPoint(point.set(...tip).applyMatrix4(world));
    });
    for (const r of this.shape.rulings) {
      box.expandByPoint(point.set(r[0], r[1], r[2]).applyMatrix4(world));
      box.expandByPoint(point.set(r[3], r[4], r[5]).applyMatrix4(world));
    }
    if (box.isEmpty()) box.setFromObject(this.disc);
  }
}

// Half a section of a cutter from its tip up: end face, corner, flank. A ball end is all corner.
function cutter_profile({ radius_mm: r, flute_mm: flute, corner_mm: corner = 0, taper_rad: taper = 0 }) {
  const points = [[0, 0], [r - corner, 0]];
  const steps = corner > 0 ? 12 : 0;
  for (let i = 1; i <= steps; i += 1) {
    const angle = ((Math.PI / 2 - taper) * i) / steps;
    points.push([r - corner + corner * Math.sin(angle), corner * (1 - Math.cos(angle))]);
  }
  const [last, height] = points[points.length - 1];
  return [...points, [last + Math.max(0, flute - height) * Math.tan(taper), Math.max(flute, height)]];
}

// The first index whose number is not below the wanted one.
function lower(numbers, wanted) {
  let low = 0;
  let high = numbers.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (numbers[middle] < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
}

document.addEventListener("click", (event) => {
  const press = event.target.closest?.("[data-scene]")?.dataset.scene;
  const picture = window.dxScene;
  if (!press || !picture) return;
  const [what, value] = press.split(" ");
  if (what === "look") picture.look(value);
  if (what === "clear") picture.clear();
  if (what === "frame") {
    picture.see(value);
    for (const one of document.querySelectorAll('[data-scene^="frame"]')) one.setAttribute("aria-pressed", String(one.dataset.scene === press));
    picture.look(value === "machine" ? "machine" : "iso");
  }
});
