// The path of a checked program with its surfaces: what is done, and what is to do.
import * as THREE from "../vendor/three.module.min.js";
import { css } from "./stage.js";

const RAPID = 0;

// The first index whose number is not below the wanted one.
function lower(numbers, wanted) {
  let [low, high] = [0, numbers.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (numbers[middle] < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
}

export class Path {
  at = 0; // the point that the tool has passed last

  constructor(shape, parent) {
    Object.assign(this, { shape, parent, mesh: null, ruled: null });
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
    this.mesh?.material.color.set(css("--accent"));
    this.ruled?.material.color.set(css("--accent"));
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
