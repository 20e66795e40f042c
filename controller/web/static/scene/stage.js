// Where a picture is looked at from: renderer, the two cameras, the hand that turns them, and the scale.
import { dx } from "../store.js";
import { OrbitControls } from "../vendor/orbit.js";
import * as THREE from "../vendor/three.module.min.js";

export const looked_at = () => ["scene", "run", "jog"].some(dx.shown);
const SMALL_MS = 200; // between two pictures beside figures
const FAR_MM = 20000;
const FOV = 40; // degrees
const SCALE_PX = 110; // at most
// From the camera's side to what it looks at. From a side proper it is drawn in parallel, to be measured by.
const WAYS = { iso: [-0.9, -1.2, 0.9], machine: [-0.9, -1.2, 0.9], top: [0, -0.001, 1], front: [0, -1, 0.001], side: [1, 0, 0.001] };
const PARALLEL = ["top", "front", "side"];

export const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim() || "#888888";

export class Stage {
  drawn = 0; // pictures
  asked = false;

  constructor(root, place) {
    this.scene = new THREE.Scene();
    this.perspective = new THREE.PerspectiveCamera(FOV, 1, 1, FAR_MM);
    this.parallel = new THREE.OrthographicCamera(-1, 1, 1, -1, -FAR_MM, FAR_MM);
    for (const camera of [this.perspective, this.parallel]) {
      camera.up.set(0, 0, 1);
      const lamp = new THREE.DirectionalLight(0xffffff, 2);
      lamp.position.set(0.3, 0.5, 1);
      camera.add(lamp);
      this.scene.add(camera);
    }
    this.camera = this.perspective;
    this.scene.add(new THREE.AmbientLight(0xffffff, 1.6), root);
    this.renderer = new THREE.WebGLRenderer({ antialias: true });
    this.renderer.setPixelRatio(devicePixelRatio);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener("change", () => this.touch());
    this.resized = new ResizeObserver(() => this.fill());
    this.stand_in(place);
  }

  // Where it is on the screen, until it is put into another place.
  stand_in(place) {
    if (place === this.place) return;
    this.resized.disconnect();
    this.place = place;
    place.append(this.renderer.domElement);
    this.resized.observe(place);
    this.fill();
  }

  // Drawn soon, and only where somebody looks: a page that is left open must not keep a processor busy.
  touch() {
    if (this.asked) return;
    this.asked = true;
    const draw = () => {
      this.asked = false;
      if (!looked_at() || document.hidden) return;
      this.drawn += 1;
      this.renderer.render(this.scene, this.camera);
      this.scale();
    };
    if (!dx.shown("scene")) setTimeout(() => requestAnimationFrame(draw), SMALL_MS);
    else requestAnimationFrame(draw);
  }

  fill() {
    const { clientWidth: width, clientHeight: height } = this.place;
    if (!width || !height) return;
    this.renderer.setSize(width, height);
    this.perspective.aspect = width / height;
    this.perspective.updateProjectionMatrix();
    this.span(this.parallel.top);
    this.touch();
  }

  // Half of the height that the parallel camera sees, mm.
  span(half) {
    const aspect = this.place.clientWidth / this.place.clientHeight || 1;
    Object.assign(this.parallel, { top: half, bottom: -half, left: -half * aspect, right: half * aspect });
    this.parallel.updateProjectionMatrix();
  }

  // From a side, with all of a ball in sight.
  look(from, ball) {
    this.camera = PARALLEL.includes(from) ? this.parallel : this.perspective;
    this.controls.object = this.camera;
    this.aim(new THREE.Vector3(...WAYS[from]), ball);
  }

  // From where one looks, with all of a ball in sight.
  fit(ball) {
    this.aim(this.camera.position.clone().sub(this.controls.target), ball);
  }

  aim(way, { center, radius }) {
    const narrow = Math.min(1, this.place.clientWidth / this.place.clientHeight || 1);
    const far = (1.1 * radius) / Math.sin((FOV * Math.PI) / 360) / narrow;
    this.controls.target.copy(center);
    this.camera.position.copy(center).addScaledVector(way.normalize(), far);
    this.parallel.zoom = 1;
    this.span((1.1 * radius) / narrow);
    this.controls.update();
    this.touch();
  }

  // A bar as long as a round number of mm, at what one looks at.
  scale() {
    const [bar, text] = document.querySelector("#scene-scale")?.children ?? [];
    if (!bar) return;
    const away = this.camera.position.distanceTo(this.controls.target);
    const height = this.camera === this.parallel ? (2 * this.parallel.top) / this.parallel.zoom : 2 * away * Math.tan((FOV * Math.PI) / 360);
    const per_mm = this.place.clientHeight / height;
    const power = 10 ** Math.floor(Math.log10(SCALE_PX / per_mm));
    const length = [5, 2, 1].map((n) => n * power).find((n) => n * per_mm <= SCALE_PX);
    bar.style.width = `${length * per_mm}px`;
    text.textContent = `${Number(length.toPrecision(1))} mm`;
  }
}
