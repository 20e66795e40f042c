// What a picture of the machine is put together from: lines, letters, cutters.
import * as THREE from "../vendor/three.module.min.js";

const SHANK_MM = 35;
export const vector = (v) => new THREE.Vector3(...(v ?? [0, 0, 0]));
export const UP = new THREE.Vector3(0, 0, 1);

export function line(points, parent, dashed = false) {
  const geometry = new THREE.BufferGeometry().setFromPoints(points);
  const Material = dashed ? THREE.LineDashedMaterial : THREE.LineBasicMaterial;
  const made = new THREE.Line(geometry, new Material({ dashSize: 6, gapSize: 4, transparent: true }));
  if (dashed) made.computeLineDistances();
  parent.add(made);
  return made;
}

// A letter that faces whoever looks, as high as so many mm.
export function letter(text, height_mm, colour) {
  const canvas = Object.assign(document.createElement("canvas"), { width: 64, height: 64 });
  const pen = canvas.getContext("2d");
  Object.assign(pen, { font: "700 52px sans-serif", textAlign: "center", textBaseline: "middle", fillStyle: colour });
  pen.fillText(text, 32, 34);
  const map = new THREE.CanvasTexture(canvas);
  map.colorSpace = THREE.SRGBColorSpace;
  const made = new THREE.Sprite(new THREE.SpriteMaterial({ map, depthTest: false, transparent: true }));
  made.scale.setScalar(height_mm);
  return made;
}

// The axes of a frame, with their letters.
export function frame(length_mm) {
  const made = new THREE.Group();
  made.add(new THREE.AxesHelper(length_mm));
  for (const [i, [name, colour]] of [["X", "#ff5a52"], ["Y", "#3ddc84"], ["Z", "#5c9cff"]].entries()) {
    const sign = letter(name, 0.12 * length_mm, colour);
    sign.position.setComponent(i, 1.08 * length_mm);
    made.add(sign);
  }
  return made;
}

// A body turned about the tool's axis, of [radius, height] points.
function turned(profile, material) {
  const geometry = new THREE.LatheGeometry(profile.map(([r, z]) => new THREE.Vector2(r, z)), 48);
  geometry.rotateX(Math.PI / 2); // three.js turns about Y; the tool's axis is Z
  return new THREE.Mesh(geometry, material);
}

// A tool of the table: the bodies of its profile, and something that holds it where the table has nothing.
export function tool_bodies(tool, materials) {
  const made = tool.profile.map(([name, points]) => turned([[0, points[0][1]], ...points, [0, points.at(-1)[1]]], materials[name]));
  if (tool.holder?.length) return made;
  const all = tool.profile.flatMap(([, points]) => points);
  const [wide, top] = [0, 1].map((k) => Math.max(...all.map((point) => point[k])));
  return [...made, turned([[0, top], [2.5 * wide + 4, top], [3 * wide + 8, top + SHANK_MM]], materials.holder)];
}

// What carries the work: a disc across the last table rotary, a square where there is none.
export function plate(last) {
  const geometry = last ? new THREE.CylinderGeometry(60, 60, 2, 64) : new THREE.BoxGeometry(150, 2, 150);
  const made = new THREE.Mesh(geometry, new THREE.MeshPhongMaterial({ transparent: true, opacity: 0.25, depthWrite: false }));
  const direction = last ? last.direction : UP;
  made.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), direction);
  if (last) made.position.copy(last.point);
  made.position.addScaledVector(direction, -1);
  return made;
}

// The box of what the linear axes reach.
export function limits(axes) {
  const travel = [..."XYZ"].map((name) => axes.find((axis) => axis.name === name)?.travel ?? [0, 0]);
  const edges = new THREE.EdgesGeometry(new THREE.BoxGeometry(...travel.map(([low, high]) => Math.max(1e-3, high - low))));
  const made = new THREE.LineSegments(edges, new THREE.LineBasicMaterial({ transparent: true, opacity: 0.5 }));
  made.position.set(...travel.map(([low, high]) => (low + high) / 2));
  return made;
}
