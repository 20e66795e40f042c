// Maps of the cut surfaces: how far each is off, as rows of colour with the figures beside them.
import { html } from "./dom.js";
import { sentence, word as text } from "./texts.js";

const word = (key, ...values) => text(`maps.${key}`, ...values);
export const MOST = 12; // maps on the screen: of the surfaces that are off most
export const MIN_UM = 1; // full colour at no less
export const OVER = [211, 34, 42]; // red: too deep
export const UNDER = [29, 111, 165]; // blue: left standing
export const NONE = [190, 198, 205]; // between

// What has full colour: all but the outermost hundredth of the points lies below it.
export function scale_um(surfaces) {
  const amounts = surfaces.flatMap(({ map_um }) => map_um.flat()).filter((t) => t !== null).map(Math.abs);
  amounts.sort((a, b) => a - b);
  return amounts.length ? Math.max(MIN_UM, amounts[Math.floor(0.99 * (amounts.length - 1))]) : MIN_UM;
}

// Red, green and blue, 0 to 255.
export function mixed(um, full_um) {
  const share = Math.min(1, Math.abs(um) / full_um);
  return NONE.map((from, i) => Math.round(from + share * ((um < 0 ? OVER : UNDER)[i] - from)));
}
const colour = (um, full_um) => (um === null ? "transparent" : `rgb(${mixed(um, full_um).join(", ")})`);

// One row of a map as a gradient; what is not cut is left open.
export const colours = (row, full_um) => `linear-gradient(to right, ${row.map((t) => colour(t, full_um)).join(", ")})`;

// Whether the surfaces keep their tolerance: one sentence, in colour and with a sign.
export function Verdict({ told }) {
  if (!told) return null;
  return told.within
    ? html`<p class="verdict" data-tone="go"><span aria-hidden="true">✓</span> ${sentence(told)}</p>`
    : html`<p class="verdict wrong" data-tone="stop" role="alert"><span aria-hidden="true">✗</span> ${sentence(told)}</p>`;
}

// What a check says in one word: no green one beside a wall that is off, nor beside an axis over its limit.
export function verdict_of({ state, verdict, over_limit }) {
  if (state !== "passed") return state;
  return verdict && !verdict.within ? "exceeds" : over_limit ? "over_limit" : state;
}

const off = (one) => Math.max(one.overcut_mm, one.undercut_mm);

// The surfaces that are off most, in the program's order; nothing where nothing was verified.
export function Maps({ verified: { surfaces = [], left_out = 0 }, verdict }) {
  if (!surfaces.length) return null;
  const shown = [...surfaces].sort((a, b) => off(b) - off(a)).slice(0, MOST);
  const full_um = scale_um(shown);
  const more = surfaces.length - shown.length + left_out;
  return html`
    <h2>${word("title")}</h2>
    ${surfaces.filter((one) => shown.includes(one)).map((one) => html`<${Surface} key=${one.line} one=${one} full_um=${full_um} tolerance_um=${1000 * (verdict?.tolerance_mm ?? 0)} />`)}
    <${Scale} full_um=${full_um} tolerance_um=${1000 * (verdict?.tolerance_mm ?? 0)} />
    <p class="dim note">${word("scale", full_um.toFixed(0))}</p>
    ${more > 0 && html`<p class="dim note">${word("more", more)}</p>`}`;
}

function Surface({ one, full_um, tolerance_um }) {
  const [over, under] = [one.overcut_mm, one.undercut_mm].map((mm) => (1000 * mm).toFixed(1));
  const parts = [`${word("surface", one.line)}: ${word("over", over)}`, word("under", under)];
  if (one.overcut_at) parts.push(word("worst", one.overcut_at[0].toFixed(3), one.overcut_at[1].toFixed(2)));
  const beyond = tolerance_um > 0 && 1000 * off(one) > tolerance_um;
  return html`
    <p class=${`figures note ${beyond ? "wrong" : ""}`}>${parts.join(", ")}</p>
    <div class="map-box">
      <div class="map-axis down figures"><span>0</span><span>${mm(one.height_mm)}</span></div>
      <div class="map" role="img" aria-label=${parts.join(", ")} data-map=${String(one.line)}>
        ${one.map_um.map((row) => html`<div style=${{ backgroundImage: colours(row, full_um) }}></div>`)}
        ${tolerance_um > 0 && html`<svg viewBox=${`0 -0.5 ${one.map_um[0].length - 1} ${one.map_um.length}`} preserveAspectRatio="none" aria-hidden="true">
          <path class="contour" d=${contour(one.map_um, tolerance_um)} /></svg>`}
      </div>
      <div class="map-axis figures">${(one.along_mm ?? []).map((at) => html`<span>${mm(at)}</span>`)}</div>
    </div>`;
}

const mm = (value) => (typeof value === "number" ? `${value.toFixed(1)} mm` : "");

// Where the amount crosses a level, as a path over the grid of columns and rows: straight within a cell.
export function contour(rows, level) {
  const lines = [];
  for (let r = 0; r + 1 < rows.length; r++)
    for (let c = 0; c + 1 < rows[r].length; c++) {
      const corners = [[c, r], [c + 1, r], [c + 1, r + 1], [c, r + 1]];
      const over = corners.map(([x, y]) => (rows[y][x] === null ? null : Math.abs(rows[y][x]) - level));
      if (over.includes(null)) continue;
      const crossed = corners.flatMap((from, i) => crossing(from, corners[(i + 1) % 4], over[i], over[(i + 1) % 4]));
      for (let i = 0; i + 1 < crossed.length; i += 2) lines.push(`M${crossed[i]}L${crossed[i + 1]}`);
    }
  return lines.join("");
}

function crossing(from, to, a, b) {
  if (a > 0 === b > 0) return [];
  const at = a / (a - b);
  return [from.map((value, i) => +(value + at * (to[i] - value)).toFixed(3)).join(" ")];
}

// What the colours stand for.
export function Scale({ full_um, tolerance_um }) {
  const steps = Array.from({ length: 21 }, (_, i) => (i / 10 - 1) * full_um);
  const marks = tolerance_um > 0 && tolerance_um < full_um ? [-tolerance_um, tolerance_um] : [];
  return html`<div class="map-scale figures note"><span>−${full_um.toFixed(0)} µm</span>
    <div style=${{ backgroundImage: colours(steps, full_um) }}>${marks.map((at) => html`<i style=${{ left: `${50 + (50 * at) / full_um}%` }}></i>`)}</div><span>+${full_um.toFixed(0)} µm</span></div>
    ${tolerance_um > 0 && html`<p class="dim note">${word("contour", tolerance_um.toFixed(0))}</p>`}`;
}
