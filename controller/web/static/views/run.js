// While cutting: where the axes are, how fast it goes and why not faster, and the cycle.
import { call, every } from "../api.js";
import { html, useEffect, useRef, useState } from "../dom.js";
import { forms } from "../forms.js";
import { show } from "../frame.js";
import { Act, AxisName, Bar, Card, Codes, Facts, Figure, field } from "../parts.js";
import { Guide } from "../guide.js";
import { Listing } from "../listing.js";
import { SpindleOverride } from "../peripherals.js";
import { Offer, StateThere, start_question } from "../restart.js";
import { QueueNext } from "../queue.js";
import { dx } from "../store.js";
import { word } from "../texts.js";
import { ToolPicture, touch } from "./setup_tables.js";

const RAPIDS = [0, 25, 50, 100];
const TOLD_MS = 300; // after an answer, until a status tells what it did

function View() {
  return html`<div class="run" data-large=${dx.large ? "1" : undefined}>
    <div class="column"><${Axes} /><${Program} /></div>
    <div class="column"><${Feed} /></div>
    <div class="column"><${Cycle} /><${Tool} /></div>
  </div>`;
}
export default { name: "run", View };

// ---- axes

const COLUMNS = ["axis", "work", "machine", "to_go", "actual", "error"];

function Axes() {
  const status = dx.status ?? {};
  const head = (name) => html`<th key=${name} class=${`c-${name}`} scope="col">${word(`run.${name}`)}${name === "work" && html` <${Figure} class="strong">${status.work_offset}<//> ${forms.units()}`}</th>`;
  return html`<${Card} title=${word("run.axes")} class="run-axes">
    <table class="dro">
      <thead><tr>${COLUMNS.map(head)}</tr></thead>
      <tbody>${(dx.facts.axes ?? []).map((axis) => html`<${Axis} key=${axis.name} axis=${axis} joint=${status.joints?.[axis.name] ?? {}} />`)}</tbody>
    </table>
    <${Figure} tag="p" class="warning">${status.shown?.warning}<//>
    ${!dx.facts.axes && html`<p class="dim">${word("frame.no_machine")}</p>`}
  <//>`;
}

// Here the active work offset reads what is typed; Enter alone makes it zero.
const set = (name) => touch(dx.status?.work_offset ?? "G54", name, 0);

function Axis({ axis: { name, unit, following_error: most }, joint }) {
  const form = unit === "mm" ? forms.length : forms.deg;
  const share = typeof joint.error === "number" ? joint.error / most : 0;
  const size = Math.min(1, Math.abs(share));
  const end = joint.limit ? `${word("run.limit")} ${joint.limit.replace("-", "−")}` : "";
  // The bar is full at the following error that ends the run.
  return html`<tr data-axis=${name}>
    <th scope="row">
      <${Act} class="axis-set" needs="control" modes="OFF READY" title=${word("run.set_axis", name)} aria-label=${word("run.set_axis", name)} data-set=${name} press=${() => set(name)}><${AxisName} name=${name} /><//>
      <span class="marks">
        <span class="mark-home" data-homed=${name} data-state=${joint.homed ? "yes" : "no"}>${word(joint.homed ? "run.homed" : "run.not_homed")}</span>
        <span class="mark-limit" data-limit=${name}>${end}</span>
      </span>
    </th>
    <${Figure} tag="td" class="big c-work">${form(joint.work)}<//>
    ${["machine", "to_go", "actual"].map((column) => html`<${Figure} tag="td" class=${`c-${column}`}>${form(joint[column])}<//>`)}
    <td class="c-error"><div class="error">
      <div class="error-bar" data-error=${name} data-tone=${size > 0.8 ? "stop" : size > 0.5 ? "hold" : "go"} style=${{ "--size": String(size), "--side": share < 0 ? "1" : "0" }}>
        </div>
      <${Figure} class="error-figure">${forms.um(joint.error)}<//>
    </div></td>
  </tr>`;
}

function Tool() {
  const letters = (values, names, form) => [...names].map((one) => html`<span class="pair"><span class="dim">${one}</span>
    <${Figure}>${form(values?.[one])}<//></span>`);
  return html`<${Card} title=${word("run.tool")} class="run-tool">
    <div class="triple"><span class="dim">${word("run.tip")}</span>${letters(dx.status?.tip, "XYZ", forms.length)}</div>
    <div class="triple"><span class="dim">${word("run.vector")}</span>${letters(dx.status?.axis, "IJK", forms.unit)}</div>
    <${Codes} />
  <//>`;
}

// ---- feed

function Feed() {
  const { feed_mm_min: feed, limited_by, spindle, coolant } = dx.status ?? {};
  const loaded = Boolean(dx.facts.spindle?.tells_load);
  const share = typeof spindle?.load === "number" ? spindle.load / 100 : null;
  const running = ["mist", "flood"].filter((kind) => coolant?.[kind]).map((kind) => word(`run.${kind}`));
  return html`<${Card} title=${word("run.feed", forms.units())} class="run-feed">
    <${Figure} tag="div" class="huge">${forms.feed(feed?.actual)}<//>
    <dl class="facts">
      <dt>${word("run.programmed")}</dt><${Figure} tag="dd">${forms.feed(feed?.programmed)}<//>
      <dt>${word("run.limited")}</dt><${Figure} tag="dd" class="chip">${forms.bound(limited_by)}<//>
      ${dx.facts.spindle && html`<dt>${word(loaded ? "run.spindle_load" : "run.spindle")}</dt>
        <dd><${Figure} class="strong">${forms.int(spindle?.actual_rev_min)}<//><span class="dim"> / </span><${Figure}>${forms.int(spindle?.rev_min)}<//>${loaded && html`<span class="dim">, </span><${Figure} class="strong" id="run-load">${forms.percent(share)}<//>`}</dd>`}
      ${dx.facts.outputs && html`<dt>${word("run.coolant")}</dt><${Figure} tag="dd">${running.join(", ") || "–"}<//>`}
    </dl>
    <div class="overrides"><${Override} /><${Rapid} /><${SpindleOverride} /></div>
  <//>`;
}

// What is told by the machine is shown, what is dragged is sent when it is let go.
const override = { dragging: false, wanted: null, telling: 0 };

async function ask_override(percent) {
  override.wanted = Math.min(200, Math.max(0, percent));
  clearTimeout(override.telling);
  await call("PUT", "overrides/feed", { share: override.wanted / 100 });
  clearTimeout(override.telling);
  override.telling = setTimeout(() => (override.wanted = null), TOLD_MS);
}

// There is no change where it is dragged back to where it was.
for (const name of ["change", "pointerup", "pointercancel", "keyup", "focusout"])
  document.addEventListener(name, () => (override.dragging = false));

function Override() {
  const slider = useRef(null);
  const now = dx.status?.override;
  const percent = Math.round((now ?? 1) * 100);
  useEffect(() => {
    if (!override.dragging && override.wanted === null && typeof now === "number") slider.current.value = percent;
  });
  const step = (by) => html`<${Act} text=${`${by < 0 ? "−" : "+"}10`} data-override=${String(by)} aria-label=${`${by < 0 ? "−" : "+"}10 %`} press=${() => ask_override((override.wanted ?? percent) + by)} />`;
  return html`<div class="override">
    <span class="dim">${word("run.feed_override")}</span>
    ${step(-10)}<${Figure} class="override-figure">${forms.percent(now)}<//>${step(10)}
    <${Act} text="100 %" call="PUT overrides/feed" body=${{ share: 1 }} title=${word("run.reset_override")} />
    <div class="slider-row"><input class="slider" type="range" id="run-override" min="0" max="200" step="5" aria-label=${word("run.feed_override")} ref=${slider} ...${field({})}
      oninput=${() => (override.dragging = true)} onchange=${(event) => ask_override(event.target.valueAsNumber)} />
      ${dx.facts.spindle?.adaptive && html`<${Adaptive} />`}</div>
  </div>`;
}

// The switch, and where it counts the share that the load of the spindle leaves.
function Adaptive() {
  const { on, share } = dx.status?.adaptive ?? {};
  return html`<${Toggle} name="adaptive" path="adaptive_feed"> <${Figure} id="run-adaptive">${on ? forms.percent(share) : "–"}<//><//>`;
}

const Rapid = () => html`<div class="override">
  <span class="dim">${word("run.rapid_override")}</span>
  ${RAPIDS.map((percent) => html`<${Act} key=${percent} text=${`${percent} %`} call="PUT overrides/rapid" body=${{ share: percent / 100 }} data-rapid=${String(percent)}
    aria-label=${`${word("run.rapid_override")} ${percent} %`} aria-pressed=${String(Math.round((dx.status?.rapid_override ?? -1) * 100) === percent)} />`)}
</div>`;

// ---- the cycle

function Cycle() {
  const job = dx.status?.job;
  const tall = (key, path, more) => html`<${Act} text=${word(`run.${key}`)} call=${`POST cycle/${path}`} class="tall" ...${more} />`;
  const time = (key) => html`<div class="time"><span class="dim">${word(`run.${key}`)}</span>
    <${Figure} class="strong">${forms.time(job?.[`${key}_s`])}<//></div>`;
  return html`<${Card} title=${word("run.cycle")} class="run-cycle">
    <${Offer} />
    <div class="cycle">
      ${tall("start", "start", { kind: "go", ask: start_question(), modes: "READY", icon: "play", keys: "F4", given: dx.loaded(), why: "why.no_program" })}
      ${tall("resume", "resume", { kind: "go", modes: "HOLD", icon: "reset", keys: "F6" })}
      <${Aside} /><${InThread} />
      <div class="toggles"><${Toggle} key="single" name="single" path="single_block" /><${Toggle} key="optional" name="optional" path="optional_stop" /><${Skip} job=${job} /></div>
    </div>
    <div class="row times">${["elapsed", "left", "duration"].map(time)}
      <div class="time"><span class="dim">${word("run.parts")}</span><${Figure} class="strong" id="run-parts">${made(job)}<//></div></div>
    <div class="row drives-row">
      <${Act} text=${word("run.enable")} call="POST machine/enable" modes="OFF" icon="power" />
      <${Act} text=${word("run.disable")} call="POST machine/disable" modes="READY" icon="off" />
      <${Act} text=${word("run.home")} call="POST machine/home" body=${{}} ask=${word("run.home_ask")} modes="OFF READY" icon="home" />
    </div>
    <${Guide} />
  <//>`;
}

const Toggle = ({ name, path, children }) => {
  const on = Boolean(dx.status?.[path]);
  return html`<${Act} class="toggle" data-toggle=${`PUT cycle/${path}`} aria-pressed=${String(on)} press=${() => call("PUT", `cycle/${path}`, { on: !on })}>${word(`run.${name}`)}${children}<//>`;
};

// Lines that begin with /, left out or not: the program is loaded anew so, from its beginning.
const Skip = ({ job }) =>
  html`<${Act} text=${word("run.skip")} class="toggle" id="run-skip" modes="OFF READY" aria-pressed=${String(Boolean(job?.block_delete))}
    given=${Boolean(job?.name) && job.state === "loaded" && typeof job.text !== "string" && !job.restart?.length && !job.dry_run_mm} why="why.not_whole"
    press=${() => call("POST", "job", { program: job.name, block_delete: !job.block_delete })} />`;

// Off along the tool axis by what is given, preset to what is possible here; and back to the path.
function Aside() {
  const [given, give] = useState(null); // null: as far as possible
  const { retract_room_mm: room, aside } = dx.status ?? {};
  const there = typeof room === "number";
  useEffect(() => {
    if (!there) give(null); // it moves, or stands off already: the next place has its own
  }, [there]);
  const value = given ?? (there ? String(room) : "");
  const rules = { modes: "HOLD READY", given: there, why: aside ? "why.aside" : "why.no_room" };
  const label = word("run.retract_mm");
  return html`<div class="aside">
    <label><input type="number" id="run-retract-mm" min="0.001" step="any" max=${room ?? ""} aria-label=${label} title=${label} value=${value} oninput=${(event) => give(event.target.value)} ...${field(rules)} /></label>
    <${Act} id="run-retract" text=${word("run.retract")} ...${rules} press=${() => call("POST", "cycle/retract", { mm: Number(value) })} />
    <${Act} text=${word("run.return")} call="POST cycle/return" modes="HOLD" given=${Boolean(aside)} why="why.on_path" />
  </div>`;
}

// A tool that a fault, a stop or a loss of power has left in its thread is turned out of it before all else.
function InThread() {
  if (!dx.status?.notices?.some(({ name }) => name === "IN_THREAD")) return null;
  const out = (key, body) => html`<${Act} id=${`run-${key}`} text=${word(`run.${key}`)} call="POST cycle/withdraw" body=${body} ask=${word(`run.${key}_ask`)} modes="OFF READY HOLD" kind="warn" />`;
  return html`<div class="aside">${out("withdraw", {})}${out("is_out", { is_out: true })}</div>`;
}

// ---- the program

// Those that came last and passed their check: loaded without a look at the list.
const RECENT = 3;
const NO_VERDICT = { within: true };
let stored = [];
every("run", 3, "programs?brief=true", (body) => (stored = body.programs));

const made = (job) => stored.find(({ name }) => name === job?.name)?.completed ?? "–";

export const recent = () =>
  stored.filter(({ check }) => check.state === "passed" && (check.verdict ?? NO_VERDICT).within).sort((a, b) => b.uploaded_s - a.uploaded_s).slice(0, RECENT);

// The tool that the program waits for: what it looks like, and its measures.
const MEASURES = ["radius_mm", "length_mm", "flute_mm", "corner_mm"];
function Wanted({ number }) {
  const [tool, set] = useState(null);
  useEffect(() => {
    call("GET", "tools", null, true).then(({ body }) => set(body.tools?.[number] ?? null));
  }, [number]);
  if (!tool) return null;
  return html`<div class="row wanted" id="run-wanted"><${ToolPicture} n=${number} tool=${tool} />
    <${Facts} rows=${[[`T${number}`, tool.name], ...MEASURES.map((name) => [word(`setup.${name}`), forms.mm(tool[name])])]} /></div>`;
}

function Program() {
  const { job, in_block: at } = dx.status ?? {};
  return html`<${Card} class="run-program">
    <div class="row program-head">
      <h2>${word("run.program")}</h2>
      <span class="dim">${word("run.line")}</span><${Figure} class="strong">${forms.text(job?.line)}<//>
      <span class="dim">${word("run.block")}</span><${Figure} class="strong">${forms.text(job?.block)}<//>
      <${Figure} class="dim">${forms.what(at?.what)}<//><${Figure} class="strong">${forms.percent(at?.fraction)}<//>
      <span class="u"><span class="dim">u </span><${Figure} class="strong">${forms.u(at?.u)}<//></span>
    </div>
    <${QueueNext} />
    ${job?.message && html`<${Figure} class="strong">${job.message}<//>`}
    ${dx.status?.tool_change?.number > 0 && html`<${Wanted} key=${dx.status.tool_change.number} ...${dx.status.tool_change} />`}
    <${Bar} class="block-bar" share=${at?.fraction} title=${word("run.block")} />
    <${StateThere} />
    <${Listing} job=${job} />
    ${!dx.loaded() && html`<div class="empty" id="run-empty">
      <p class="dim">${word("frame.no_program")}</p>
      <${Act} text=${word("run.choose")} needs="" icon="programs" press=${() => show("programs")} />
      ${recent().map(({ name }) => html`<${Act} key=${name} text=${word("run.load", name)} call="POST job" body=${{ program: name }} modes="OFF READY" icon="load" data-load=${name} />`)}
    </div>`}
  <//>`;
}
