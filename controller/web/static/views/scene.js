// The machine in three dimensions: part, path, tool and rotaries. What draws it comes when it is first looked at.
import { html, useLayoutEffect, useRef } from "../dom.js";
import { forms } from "../forms.js";
import { Icon } from "../icons.js";
import { Scale } from "../maps.js";
import { Act, Figure } from "../parts.js";
import { dx } from "../store.js";
import { word as text } from "../texts.js";

const word = (key) => text(`scene.${key}`);
const LOOKS = ["iso", "top", "front", "side"];
// What is drawn, with its colour: ways that are ahead, what is done of them, and bodies.
const KEYS = { rapid: "--dim", feed: "--info", along: "--text", done: "--go", trail: "--hold", surface: "--wall", tool: "--hold", holder: "--dim", table: "--dim", travel: "--dim" };
const shown = { picture: null, coming: false, wrong: "" };

async function come(place) {
  shown.coming = true;
  const found = await import("../scene/picture.js").catch(() => null);
  if (!found) return setTimeout(() => (shown.coming = false), 1000); // the panel is away: asked for again
  const { MachinePicture } = found;
  const picture = new MachinePicture(dx.facts);
  const wrong = (sentence) => {
    shown.wrong = sentence;
    dx.draw();
  };
  try {
    picture.show_in(place, wrong);
    window.dxScene = shown.picture = picture;
    dx.draw();
  } catch {
    wrong(word("no_gl"));
  }
}

// One picture for all places: it is where one looks. What draws it comes after all that is more needed.
export function ScenePlace({ view }) {
  const place = useRef(null);
  useLayoutEffect(() => {
    if (!dx.shown(view)) return;
    if (shown.picture) shown.picture.stage.stand_in(place.current);
    else if (!shown.coming && dx.facts.axes && (dx.all_views || view === "scene")) come(place.current);
  });
  return html`<div class="scene-place" role="img" aria-label=${word("picture")} ref=${place}></div>`;
}

// Along the planned program before anything moves: by the slider, or played.
const SPEEDS = [1, 5, 20];
const scrub = { line: null, speed: 1, playing: 0 };

function to(picture, share) {
  scrub.line = picture.scrub(share)?.line ?? null;
  dx.draw();
}

function play(picture) {
  cancelAnimationFrame(scrub.playing);
  let before = performance.now();
  const takes_ms = 1000 * (dx.status?.job?.duration_s || 60);
  const step = (now) => {
    if (picture.shown_share === null) return halt(); // the machine moves, or another program was loaded
    const share = Math.min(1, picture.shown_share + (scrub.speed * Math.max(0, now - before)) / takes_ms);
    before = now;
    scrub.playing = share < 1 ? requestAnimationFrame(step) : 0;
    to(picture, share);
  };
  to(picture, (picture.shown_share ?? 0) % 1);
  scrub.playing = requestAnimationFrame(step);
}

function halt() {
  cancelAnimationFrame(scrub.playing);
  scrub.playing = 0;
  dx.draw();
}

function Scrub({ picture }) {
  const act = (name, text, press, more = {}) => html`<button class="act" type="button" data-scene=${name} onclick=${press} ...${more}><span>${text}</span></button>`;
  const speed = (times) => act(`speed ${times}`, `${times} ×`, () => ((scrub.speed = times), dx.draw()), { key: times, "aria-pressed": String(scrub.speed === times) });
  const live = () => {
    halt();
    to(picture, null);
  };
  const drag = (event) => {
    const share = event.target.valueAsNumber; // before it is drawn anew
    halt();
    to(picture, share);
  };
  return html`<div class="row scene-scrub">
    ${scrub.playing ? act("pause", word("pause"), halt) : act("play", word("play"), () => play(picture))}
    <input class="slider" id="scene-scrub" type="range" min="0" max="1" step="any" aria-label=${word("scrub")} value=${picture.shown_share ?? 0}
      oninput=${drag} />
    ${SPEEDS.map(speed)}
    <span class="figures" id="scene-line">${picture.shown_share === null ? word("live") : `${word("planned")} ${scrub.line}`}</span>
    ${act("live", word("to_live"), live, { "aria-pressed": String(picture.shown_share === null) })}
  </div>`;
}

function View() {
  const { picture } = shown;
  const see = (frame) => {
    picture?.see(frame);
    picture?.look(frame === "machine" ? "machine" : "iso");
    dx.draw();
  };
  const look = (from) => html`<button key=${from} class="act" type="button" data-scene=${`look ${from}`} onclick=${() => picture?.look(from)}>
    <span>${word(from)}</span></button>`;
  return html`<div class="looks scene"><div class="card scene-card">
    <${ScenePlace} view="scene" />
    <div class="scene-over">
    <div class="row scene-tools">
      ${["part", "machine"].map((frame) => html`<button key=${frame} class="act" type="button" data-scene=${`frame ${frame}`} aria-pressed=${String((picture?.frame ?? "part") === frame)} onclick=${() => see(frame)}>
        <span>${word(frame)}</span></button>`)}
      ${LOOKS.map(look)}
      <button class="act" type="button" data-scene="fit" onclick=${() => picture?.fit()}><${Icon} name="fit" /><span>${word("fit")}</span></button>
      <${Act} text=${word("cut")} needs="" data-scene="cut" given=${Boolean(picture?.cut)} why="scene.no_cut" aria-pressed=${String(Boolean(picture?.cut && picture.cut_shown))} press=${() => picture.see_cut(!picture.cut_shown)} />
      <button class="act" type="button" data-scene="clear" onclick=${() => picture?.clear()}><span>${word("clear")}</span></button>
    </div>
    ${picture?.cut && picture.cut_shown && html`<div class="scene-scale"><${Scale} full_um=${picture.cut.full_um} tolerance_um=${picture.cut.tolerance_um} />
      <p class="dim note">${text("maps.scale", picture.cut.full_um.toFixed(0))}</p></div>`}
    ${picture?.path && html`<${Scrub} picture=${picture} />`}
    <div class="scene-said">
      ${[..."XYZ"].map((axis) => html`<span><span class="dim">${axis} </span><${Figure}>${forms.length(dx.status?.tip?.[axis])}<//></span>`)}
      ${Object.entries(KEYS).map(([key, colour]) => html`<span class="key dim"><i class=${key} style=${{ "--colour": `var(${colour})` }}></i>
        <span>${word(key)}</span></span>`)}
      <span class="key dim" id="scene-scale"><i class="ruler"></i><span></span></span>
      <span class="dim" id="scene-said">${shown.wrong}</span>
    </div>
    </div>
  </div></div>`;
}
export default { name: "scene", View };
