// The surfaces as they are cut: how far each place is off, in the colours of the maps beside the program.
import { mixed, scale_um } from "../maps.js";
import * as THREE from "../vendor/three.module.min.js";

export class Cut {
  full_um = 0;
  tolerance_um = 0;
  group = new THREE.Group();

  // ``surfaces`` of a check, those with ``rulings_mm``; drawn into ``parent``, the table's frame.
  constructor(surfaces, tolerance_um, parent) {
    Object.assign(this, { full_um: scale_um(surfaces), tolerance_um });
    for (const one of surfaces) this.group.add(this.surface(one));
    this.group.visible = false;
    parent.add(this.group);
  }

  // A point for each figure of the map: columns along, rows from the upper edge down.
  surface({ map_um, rulings_mm }) {
    const [places, colours, faces] = [[], [], []];
    const across = map_um.length;
    const colour = new THREE.Color();
    rulings_mm.forEach((ends, k) => map_um.forEach((row, r) => {
      const v = r / (across - 1);
      places.push(...[0, 1, 2].map((i) => (1 - v) * ends[i] + v * ends[i + 3]));
      colour.setRGB(...mixed(row[k] ?? 0, this.full_um).map((part) => part / 255), THREE.SRGBColorSpace);
      colours.push(colour.r, colour.g, colour.b);
    }));
    const cut = (k, r) => map_um[r][k] !== null;
    for (let k = 0; k + 1 < rulings_mm.length; k += 1)
      for (let r = 0; r + 1 < across; r += 1) {
        if (!(cut(k, r) && cut(k + 1, r) && cut(k, r + 1) && cut(k + 1, r + 1))) continue; // what is not cut is open
        const [a, b] = [k * across + r, (k + 1) * across + r];
        faces.push(a, b, a + 1, b, b + 1, a + 1);
      }
    const skin = new THREE.BufferGeometry();
    skin.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
    skin.setAttribute("color", new THREE.Float32BufferAttribute(colours, 3));
    skin.setIndex(faces);
    // Unlit: a shadow would be another deviation.
    return new THREE.Mesh(skin, new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 }));
  }

  clear() {
    this.group.removeFromParent();
    for (const { geometry, material } of this.group.children) [geometry, material].forEach((one) => one.dispose());
  }
}
