// The path of a checked program with its surfaces: what is done, and what is to do.
import { lower } from "../scope/ticks.js";
import * as THREE from "../vendor/three.module.min.js";
import { css } from "./stage.js";

const RAPID = 0;
const REACH_MM = 50;

export class Path {
  at = 0; // the point that the tool has passed last
  mesh = null;
  ruled = null;

  constructor(shape, parent) {
    this.shape = shape;
    this.parent = parent;
    if (shape.rulings.length) this.surfaces(shape);
    const position = new THREE.BufferAttribute(new Float32Array(shape.tips.flat()), 3);
    this.ahead = this.line(position, true); // two lines over the same points
    this.done = this.line(position, false);
    this.reached(0);
    this.paint();
  }

  surfaces({ rulings, surfaces }) {
    const position = new THREE.BufferAttribute(new Float32Array(rulings.flat()), 3);
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
    this.mesh = new THREE.Mesh(skin, new THREE.MeshPhongMaterial({ side: THREE.DoubleSide, transparent: true, opacity: 0.45, depthWrite: false }));
    const wires = new THREE.BufferGeometry();
    wires.setAttribute("position", position); // upper and lower end in turn: pairs are the rulings
    this.ruled = new THREE.LineSegments(wires, new THREE.LineBasicMaterial({ transparent: true, opacity: 0.5 }));
    this.parent.add(this.mesh, this.ruled);
  }

  line(position, colours) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", position);
    if (colours) geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * position.count), 3));
    const made = new THREE.Line(geometry, new THREE.LineBasicMaterial({ vertexColors: colours }));
    made.frustumCulled = false;
    this.parent.add(made);
    return made;
  }

  paint() {
    this.done.material.color.set(css("--go"));
    this.mesh?.material.color.set(css("--wall"));
    this.ruled?.material.color.set(css("--wall"));
    const colours = this.ahead.geometry.getAttribute("color");
    const kinds = ["--dim", "--info", "--text"].map((name) => new THREE.Color(css(name)));
    this.shape.kinds.forEach((kind, i) => colours.setXYZ(i, kinds[kind].r, kinds[kind].g, kinds[kind].b));
    colours.needsUpdate = true;
  }

  reached(i) {
    this.at = i;
    this.done.geometry.setDrawRange(0, i + 1);
    this.ahead.geometry.setDrawRange(i, this.shape.tips.length - i);
  }

  // The point of the path that the tool has passed last: of its motion, the nearest.
  progress(job, tip) {
    const { motions, tips } = this.shape;
    if (typeof job.block !== "number" || !tip) return this.reached(job.state === "completed" ? tips.length - 1 : 0);
    // Where the motion lost its own points by thinning, its neighbours stand for it.
    const first = Math.max(0, lower(motions, job.block) - 1);
    const end = lower(motions, job.block + 1);
    let [best, least] = [first, Infinity];
    for (let i = first; i < Math.min(tips.length, end + 1); i += 1) {
      const away = (tips[i][0] - tip[0]) ** 2 + (tips[i][1] - tip[1]) ** 2 + (tips[i][2] - tip[2]) ** 2;
      if (away < least) [best, least] = [i, away];
    }
    this.reached(best);
  }

  // How far along each point is: mm, and as much for a radian of the axis as the tool's reach would go.
  get lengths() {
    const { tips, axes } = this.shape;
    const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    if (!this.measured) {
      this.measured = [0];
      for (let i = 1; i < tips.length; i += 1)
        this.measured.push(this.measured[i - 1] + apart(tips[i], tips[i - 1]) + REACH_MM * apart(axes[i], axes[i - 1]));
    }
    return this.measured;
  }

  // The tool's pose at a share of the path, and the program line there.
  pose(share) {
    const { tips, axes, lines } = this.shape;
    const wanted = share * this.lengths.at(-1);
    const i = Math.min(tips.length - 1, lower(this.lengths, wanted));
    const from = Math.max(0, i - 1);
    const span = this.lengths[i] - this.lengths[from];
    const part = span > 0 ? (wanted - this.lengths[from]) / span : 0;
    const between = (values) => values[from].map((value, k) => value + part * (values[i][k] - value));
    this.reached(i);
    return { tip: between(tips), axis: between(axes), line: lines[i] };
  }

  // The part is what is fed: rapids lead far away.
  bound(box) {
    const point = new THREE.Vector3();
    const take = (at) => box.expandByPoint(point.set(...at).applyMatrix4(this.parent.matrixWorld));
    this.shape.tips.forEach((tip, i) => this.shape.kinds[i] !== RAPID && take(tip));
    for (const ruling of this.shape.rulings) {
      take(ruling.slice(0, 3));
      take(ruling.slice(3));
    }
  }

  clear() {
    for (const child of [...this.parent.children]) {
      this.parent.remove(child);
      child.geometry?.dispose();
      child.material?.dispose();
    }
  }
}
