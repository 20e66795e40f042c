// The machine as a picture: part, path, tool, rotaries, moved by the machine's events.
//
//   root ── limits box, machine's frame         machine frame, rotaries at zero
//     ├─ tables ─ table ─┬─ offset's frame, surfaces, path, trail     turn with the table rotaries
//     │                  └─ tool                                       at the tip that the status tells
//     └─ gauge ─ heads                                                 go with X Y Z, turn with the head rotaries
//
// The line that a rotary turns about lies in the body that carries the rotary.
// In the view of the part the root turns back what the table turned, so the part stands still.
import { API, call, headers } from "../api.js";
import { dx } from "../store.js";
import { sentence } from "../texts.js";
import * as THREE from "../vendor/three.module.min.js";
import { UP, frame, limits, line, plate, tool_bodies, vector } from "./bodies.js";
import { Cut } from "./cut.js";
import { Path } from "./path.js";
import { Stage, css, looked_at } from "./stage.js";

const TRAIL = 4000; // points
const AXIS_MM = 120; // half a rotary's line
const AGAIN_S = 3;

const MOVES = ["RUNNING", "HOMING", "JOG", "STOPPING"]; // then the machine is shown, whatever is looked at

export class MachinePicture {
  frame = "part";
  name = ""; // of the program
  job = ""; // name and sum of the program whose path is shown
  tag = ""; // of the picture that is shown
  path = null;
  cut = null; // its surfaces as cut, once they have been looked at
  cut_shown = false;
  stage = null;
  trail_count = 0;

  shown_share = null; // of the planned path, where that is looked at and not the machine

  constructor(facts) {
    this.facts = { axes: facts.axes ?? [], offsets: facts.offsets, tools: facts.tools };
    this.root = new THREE.Group();
    this.root.matrixAutoUpdate = false;
    this.table = new THREE.Group();
    this.gauge = new THREE.Group();
    this.axis_marks = [];
    this.tables = this.chain("table", this.root, this.table);
    this.heads = this.chain("head", this.gauge, new THREE.Group());
    this.box = limits(this.facts.axes);
    this.home = frame(60);
    this.root.add(this.gauge, this.box, this.home);
    this.disc = plate(this.tables.at(-1));
    this.offset = frame(20);
    this.part = new THREE.Group();
    this.tool = new THREE.Group();
    this.make_trail();
    this.table.add(this.disc, this.offset, this.part, this.tool, this.trail);
    this.materials = {
      cutter: new THREE.MeshPhongMaterial({ transparent: true, opacity: 0.9, side: THREE.DoubleSide }),
      shank: new THREE.MeshPhongMaterial({ transparent: true, opacity: 0.5, side: THREE.DoubleSide }),
      holder: new THREE.MeshPhongMaterial({ transparent: true, opacity: 0.22, side: THREE.DoubleSide, depthWrite: false }), // the cut shows through
    };
    this.take_tool(undefined);
    this.place_offset();
  }

  // On the screen; ``said`` is told why there is no path.
  show_in(place, said) {
    this.said = said;
    this.stage = new Stage(this.root, place);
    dx.on("status", (status) => this.status(status));
    dx.on("theme", () => this.paint());
    dx.on("view", () => looked_at() && this.came());
    dx.on("programs", () => this.ask());
    setInterval(() => this.ask(), 1000 * AGAIN_S);
    this.paint();
    this.look("iso");
    this.came();
    if (dx.status) this.status(dx.status);
  }

  get shape() {
    return this.path?.shape ?? null;
  }

  touch() {
    this.stage?.touch();
  }

  // ---- what does not change

  // Rotaries one upon the other, and what the last of them carries.
  chain(kind, base, carried) {
    let inner = base;
    const found = this.facts.axes.filter((one) => one.kind === kind && one.direction).map((axis) => {
      const [direction, point] = [vector(axis.direction), vector(axis.point_mm)];
      const way = direction.clone().multiplyScalar(AXIS_MM);
      this.axis_marks.push(line([point.clone().sub(way), point.clone().add(way)], inner, true));
      const group = new THREE.Group();
      group.matrixAutoUpdate = false;
      inner.add(group);
      inner = group;
      return { name: axis.name, group, direction, point, sense: kind === "table" && axis.sense === "iso" ? -1 : 1 };
    });
    inner.add(carried);
    return found;
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
    this.touch();
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
    if (tool) this.tool.add(...tool_bodies(tool, this.materials));
    this.touch();
  }

  make_trail() {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * TRAIL), 3));
    geometry.setDrawRange(0, 0);
    this.trail = new THREE.Line(geometry, new THREE.LineBasicMaterial());
    this.trail.frustumCulled = false;
  }

  paint() {
    this.stage.renderer.setClearColor(css("--bg"));
    const { cutter, shank, holder } = this.materials;
    const dim = [this.box.material, this.disc.material, shank, holder, ...this.axis_marks.map((mark) => mark.material)];
    for (const material of dim) material.color.set(css("--dim"));
    for (const material of [cutter, this.trail.material]) material.color.set(css("--hold"));
    this.path?.paint();
    this.touch();
  }

  // ---- the program's path

  // Which path is to be seen. A line typed by hand has none: what is loaded stays.
  follow(job) {
    if (job?.name === "MDI") return;
    const key = job ? `${job.name} ${job.sha256}` : "";
    if (key === this.job) return;
    [this.job, this.name] = [key, job?.name ?? ""];
    this.clear_path();
    this.said("");
    this.ask();
  }

  // The path by the program's last check, where that is another one than is shown: it may be checked
  // anew, with another offset or tool.
  async ask() {
    const { job } = this;
    if (!job || this.asking === job || !looked_at() || document.hidden) return;
    this.asking = job;
    const known = this.tag ? { "If-None-Match": this.tag } : {};
    try {
      const answer = await fetch(`${API}programs/${encodeURIComponent(this.name)}/picture`, { headers: { ...headers(), ...known } });
      const said = answer.status === 304 ? null : await answer.json();
      if (said && job === this.job) this.show(answer, said); // else another one was loaded meanwhile
      else if (this.path && !this.cut) this.ask_cut();
    } catch {
      // the panel is away; it is asked again
    } finally {
      if (this.asking === job) this.asking = "";
    }
  }

  show(answer, said) {
    this.said(answer.ok ? "" : sentence(said.error));
    if (answer.ok || answer.status === 404) this.clear_path(); // else it was only not answered now
    if (!answer.ok) return;
    this.tag = answer.headers.get("etag") ?? "";
    this.fitted();
    this.path = new Path(said, this.part);
    this.look("iso");
    this.ask_cut();
  }

  // The surfaces as cut come some time behind the check.
  async ask_cut() {
    const { tag } = this;
    const said = await call("GET", `programs/${encodeURIComponent(this.name)}/check`, null, true);
    const drawn = (said.body.result?.verified?.surfaces ?? []).filter((one) => one.rulings_mm);
    if (!drawn.length || tag !== this.tag || this.cut || !this.path) return;
    this.cut = new Cut(drawn, 1000 * (said.body.verdict?.tolerance_mm ?? 0), this.part);
    this.see_cut(this.cut_shown);
  }

  see_cut(on) {
    this.cut_shown = on;
    if (this.cut) this.cut.group.visible = on;
    if (this.path?.mesh) this.path.mesh.visible = !(on && this.cut);
    this.touch();
    dx.draw();
  }

  clear_path() {
    this.cut?.clear();
    this.cut = null;
    this.shown_share = null;
    this.path?.clear();
    this.path = null;
    this.tag = "";
    this.touch();
  }

  // ---- what moves

  // On the screen again: anything may have been changed since.
  came() {
    this.stage.fill();
    this.touch();
    this.ask();
    this.fitted();
  }

  // Tools and offsets as they are now.
  async fitted() {
    for (const what of ["tools", "offsets"]) {
      const said = await call("GET", what, null, true);
      if (said.ok) this.facts[what] = said.body[what];
    }
  }

  status(status) {
    if (!looked_at()) return;
    const { job, joints = {}, on_table } = status;
    this.follow(job);
    this.place_offset(status.work_offset);
    this.turn(joints);
    this.take_tool(status.tool);
    if (this.shown_share !== null && !MOVES.includes(status.mode)) return; // what is planned is looked at
    if (this.shown_share !== null) this.scrub(null);
    this.set_tool(on_table);
    if (on_table) this.leave(on_table.tip);
    if (this.path && job && job.name !== "MDI") this.path.progress(job, on_table?.tip);
    const turned = [...this.tables, ...this.heads].map(({ name }) => joints[name]?.actual);
    const key = JSON.stringify([on_table, turned, this.path?.at]);
    if (key !== this.posed) this.touch();
    this.posed = key;
  }

  turn(joints) {
    const where = (name) => joints[name]?.actual ?? joints[name]?.machine ?? 0;
    for (const { name, group, direction, point: { x, y, z }, sense } of [...this.tables, ...this.heads]) {
      const turned = new THREE.Matrix4().makeRotationAxis(direction, (sense * where(name) * Math.PI) / 180);
      group.matrix.makeTranslation(x, y, z).multiply(turned).multiply(new THREE.Matrix4().makeTranslation(-x, -y, -z));
    }
    this.gauge.position.set(where("X"), where("Y"), where("Z"));
    const back = new THREE.Matrix4();
    if (this.frame === "part") for (const { group } of this.tables) back.multiply(group.matrix);
    this.root.matrix.copy(back.invert());
    this.root.matrixWorldNeedsUpdate = true;
  }

  // The tool at a share of the planned path; null: where the machine has it.
  scrub(share) {
    this.shown_share = this.path ? share : null;
    this.trail.visible = this.shown_share === null;
    if (this.shown_share === null) return this.touch();
    const pose = this.path.pose(share);
    this.set_tool(pose);
    this.touch();
    return pose;
  }

  set_tool(pose) {
    this.tool.visible = Boolean(pose);
    if (!pose) return;
    this.tool.position.set(...pose.tip);
    this.tool.quaternion.setFromUnitVectors(UP, vector(pose.axis).normalize());
  }

  leave([x, y, z]) {
    const points = this.trail.geometry.getAttribute("position");
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
    this.trail.geometry.setDrawRange(0, this.trail_count);
  }

  // ---- what is pressed

  clear() {
    this.trail_count = 0;
    this.trail.geometry.setDrawRange(0, 0);
    this.touch();
  }

  see(one) {
    this.frame = one;
    if (dx.status) this.turn(dx.status.joints ?? {});
    this.touch();
  }

  look(from) {
    this.stage.look(from, this.ball(from === "machine"));
  }

  fit() {
    this.stage.fit(this.ball(this.frame === "machine"));
  }

  // Round what is looked at: the part; where there is none the table with the tool; or all that can be reached.
  ball(machine) {
    this.root.updateMatrixWorld(true);
    const box = new THREE.Box3();
    if (machine) box.setFromObject(this.box);
    else if (this.path) this.path.bound(box);
    if (box.isEmpty()) {
      box.setFromObject(this.disc);
      if (this.tool.visible && this.tool.children.length) box.expandByObject(this.tool);
    }
    const ball = box.getBoundingSphere(new THREE.Sphere());
    ball.radius = Math.max(10, ball.radius);
    return ball;
  }
}
