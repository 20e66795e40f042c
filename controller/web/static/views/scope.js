// Scope: any signal of every tick; run, single shot with a trigger, cursors, files.
import { html, useEffect } from "../dom.js";
import { forms } from "../forms.js";
import { show } from "../frame.js";
import { Act, Card, Select, Wrong } from "../parts.js";
import { Plot, colour, values_at } from "../scope/plot.js";
import { choose, exported, look, period, press_run, press_single, redraw, shown, sources, state, still_at, zoom } from "../scope/ticks.js";
import { dx, keep } from "../store.js";
import { word as text } from "../texts.js";

const word = (key, ...values) => text(`scope.${key}`, ...values);
const WIDTHS_S = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20];
const EDGES = ["rising", "falling", "either", "change"];
const MOST = 8; // signals at once

export const open_scope = (source) => {
  show("scope");
  choose(source);
};

function View() {
  useEffect(() => {
    sources();
    look();
  }, []);
  return html`<div class="looks scope">
    <${Card} class="scope-screen">
      <${Tools} />
      <${Plot} label=${word("screen")} />
      <div class="row spread"><span class="figures" id="scope-cursors">${cursors() || word("cursor_hint")}</span>
        <${Wrong} id="scope-said" text=${state.wrong} /></div>
    <//>
    <${Card} title=${word("signals")} class="scope-side">
      <div class="stack" id="scope-signals">${state.names.map((name, i) => html`<${Signal} key=${name} name=${name} i=${i} />`)}</div>
      <label><span>${word("add")}</span><${Select} id="scope-add" options=${["", ...Object.keys(state.units)]} text=${(name) => name && shown(name)} value="" choose=${add} /></label>
      <${Trigger} />
      <h2>${word("export")}</h2>
      <div class="row">${["csv", "npz"].map((kind) => html`<a class="act" id=${`scope-${kind}`} href=${exported(kind)} download="">
        <span>${kind.toUpperCase()}</span></a>`)}</div>
    <//>
  </div>`;
}
export default { name: "scope", View };

dx.on("view", (name) => name === "scope" && sources());

// ---- above the screen

function Tools() {
  const live = state.source === "now";
  const only = { needs: "", given: live, why: "why.recorded" };
  const press = (id, icon, label, work) => html`<${Act} id=${`scope-${id}`} icon=${icon} needs="" title=${word(label)} aria-label=${word(label)} press=${work} />`;
  return html`<div class="row scope-bar">
    <${Act} id="scope-run" text=${word("run")} icon="play" ...${only} aria-pressed=${String(live && state.running && !state.armed)} press=${press_run} />
    <${Act} id="scope-single" text=${word("single")} icon="one" ...${only} aria-pressed=${String(live && state.armed)} press=${press_single} />
    <span class="chip" id="scope-state" role="status">${stands()}</span>
    <${Source} />
    <${Select} id="scope-seconds" aria-label=${word("seconds")} options=${WIDTHS_S} text=${(seconds) => `${seconds} s`} value=${state.seconds} choose=${widen} />
    ${press("left", "left", "left", () => zoom(1, 0.5, -0.25))}${press("right", "right", "right", () => zoom(1, 0.5, 0.25))}
    ${press("in", "zoom_in", "zoom_in", () => zoom(0.5))}${press("out", "zoom_out", "zoom_out", () => zoom(2))}
    ${press("none", "flag", "none", () => redraw({ cursors: [null, null], hand: 0 }))}
  </div>`;
}

const stands = () => word(state.armed ? (state.trigger === null ? "waiting" : "filling") : state.running && state.source === "now" ? "running" : "standing");

function widen(seconds) {
  state.seconds = Number(seconds);
  if (state.source !== "now" || !state.running) still_at();
  anew();
}

function Source() {
  const option = ([value, label]) => html`<option key=${value} value=${value} selected=${value === state.source}>${label}</option>`;
  const recordings = state.recordings.map((name) => [`recording:${name}`, name]);
  const runs = state.runs.map((run) => [`run:${run.id}`, `#${run.id} ${run.program} ${forms.date(run.began_s)}`]);
  const listed = [["now"], ...recordings, ...runs].some(([value]) => value === state.source);
  return html`<select id="scope-source" aria-label=${word("source")} onchange=${(event) => choose(event.target.value)}>
    ${option(["now", word("now")])}
    ${recordings.length > 0 && html`<optgroup label=${word("recordings")}>${recordings.map(option)}</optgroup>`}
    ${runs.length > 0 && html`<optgroup label=${word("runs")}>${runs.map(option)}</optgroup>`}
    ${!listed && option([state.source, state.source.split(":")[1]])}
  </select>`;
}

// ---- beside the screen

function anew() {
  keep("scope", { names: state.names, seconds: state.seconds });
  redraw({}, true);
}

function add(name) {
  if (name && !state.names.includes(name) && state.names.length < MOST) state.names = [...state.names, name];
  anew();
}

function Signal({ name, i }) {
  const away = () => {
    state.names = state.names.filter((other) => other !== name);
    anew();
  };
  return html`<div class="signal">
    <i style=${{ "--colour": colour(i) }}></i><strong>${shown(name)}</strong>
    <span class="figures signal-values" data-signal=${name}>${values_at(name).join("\n")}</span>
    <${Act} text="×" needs="" aria-label=${`${word("remove")} ${shown(name)}`} press=${away} />
  </div>`;
}

function Trigger() {
  const number = (key) => html`<label><span>${word(key)}</span>
    <input id=${`scope-${key}`} type="number" step="any" value=${state[key]} oninput=${(event) => (state[key] = event.target.value)} />
    </label>`;
  return html`
    <h2>${word("trigger")}</h2>
    <label><span>${word("trigger_signal")}</span>
      <${Select} id="scope-trigger-signal" options=${Object.keys(state.units)} text=${shown} value=${state.trigger_signal} choose=${(name) => (state.trigger_signal = name)} /></label>
    <div class="grid2">
      <label><span>${word("edge")}</span>
        <${Select} id="scope-edge" options=${EDGES} text=${word} value=${state.edge} choose=${(edge) => (state.edge = edge)} /></label>
      ${number("level")}${number("before")}
    </div>
    <label class="row">
      <input id="scope-freeze" type="checkbox" checked=${state.freeze} onchange=${(event) => (state.freeze = event.target.checked)} />
      <span>${word("freeze")}</span></label>`;
}

function cursors() {
  const [one, two] = state.cursors;
  const apart = one !== null && two !== null ? Math.abs(two - one) : null;
  const between = apart && `Δ ${apart} = ${Number((apart * period()).toPrecision(5))} s = ${Number((1 / (apart * period())).toPrecision(4))} Hz`;
  return [one !== null && `1: ${word("tick")} ${one}`, two !== null && `2: ${word("tick")} ${two}`, between].filter(Boolean).join("   ");
}
