// While cutting: where the axes are, tool, feed and spindle and why not faster, the program, and the cycle.
import { call, every } from "../api.js";
import { html, useEffect, useRef, useState } from "../dom.js";
import { forms } from "../forms.js";
import { show } from "../frame.js";
import { Guide } from "../guide.js";
import { Act, AxisName, Bar, Card, Chip, Codes, Facts, Figure, Meter, field } from "../parts.js";
import { Listing } from "../listing.js";
import { verdict_of } from "../maps.js";
import { SpindleOverride } from "../peripherals.js";
import { Offer, StateThere, can_start, start_question } from "../restart.js";
import { QueueNext } from "../queue.js";
import { dx } from "../store.js";
import { word } from "../texts.js";
import { ScenePlace } from "./scene.js";
import { ToolPicture, touch } from "./setup_tables.js";

const RAPIDS = [0, 25, 50, 100];
const TOLD_MS = 300; // after an answer, until a status tells what it did

function View() {
  return html`<div class="run">
    <${Axes} /><${InForce} /><${ToolFeedSpindle} /><${Program} />
    <${Card} class="run-scene"><${ScenePlace} view="run" /><//>
    <${Cycle} />
  </div>`;
}
export default { name: "run", View };

// ---- axes: names, figures and units each in their column

const LONG = 8; // signs of a figure for which a narrow screen has room
const COLUMNS = ["axis", "work", "unit", "to_go", "machine", "actual", "error"];

export function Axes() {
  const { joints, work_offset } = dx.status ?? {};
  const head = (name) => html`<th key=${name} class=${`c-${name}`} scope="col">${word(`run.${name}`)}${name === "work" && html` <${Figure} class="strong">${work_offset}<//>`}</th>`;
  return html`<${Card} class="run-axes">
    <table class="dro" aria-label=${word("run.axes")}>
      <thead><tr>${COLUMNS.map(head)}</tr></thead>
      <tbody>${(dx.facts.axes ?? []).map((axis) => html`<${Axis} key=${axis.name} axis=${axis} joint=${joints?.[axis.name] ?? {}} />`)}</tbody>
    </table>
    ${!dx.facts.axes && html`<p class="dim">${word("frame.no_machine")}</p>`}
  <//>`;
}

// Here the active work offset reads what is typed; Enter alone makes it zero.
const set = (name) => touch(dx.status?.work_offset ?? "G54", name, 0);

function Axis({ axis: { name, unit, following_error: most }, joint }) {
  const linear = unit === "mm";
  const form = linear ? forms.length : forms.deg;
  const share = typeof joint.error === "number" ? joint.error / most : 0;
  const size = Math.min(1, Math.abs(share));
  const end = joint.limit ? `${word("run.limit")} ${joint.limit.replace("-", "−")}` : "";
  const figure = (column, more = "") => {
    const text = form(joint[column]);
    return html`<${Figure} key=${column} tag="td" class=${`${more}c-${column}`} data-long=${text.length > LONG || undefined}>${text}<//>`;
  };
  // The bar is full at the following error that ends the run.
  return html`<tr data-axis=${name}>
    <th scope="row" class="c-axis">
      <${Act} class="axis-set" needs="control" modes="OFF READY" title=${word("run.set_axis", name)} aria-label=${word("run.set_axis", name)} data-set=${name} press=${() => set(name)}><${AxisName} name=${name} /><//>
      <span class="marks">
        <span class="mark-home" data-homed=${name} data-state=${joint.homed ? "yes" : "no"}>${word(joint.homed ? "run.homed" : "run.not_homed")}</span>
        <span class="mark-limit" data-limit=${name}>${end}</span>
      </span>
    </th>
    ${figure("work", "big ")}
    <td class="c-unit dim">${linear ? forms.units() : "°"}</td>
    ${["to_go", "machine", "actual"].map((column) => figure(column))}
    <td class="c-error"><div class="error">
      <div class="error-bar" data-error=${name} data-tone=${size > 0.8 ? "stop" : size > 0.5 ? "hold" : "go"} style=${{ "--size": String(size), "--side": share < 0 ? "1" : "0" }}>
        </div>
      <${Figure} class="error-figure">${forms.um(joint.error)} ${linear ? "µm" : "m°"}<//>
    </div></td>
  </tr>`;
}

// The codes in force, and where the tip is in the part.
function InForce() {
  const letters = (values, names, form) => [...names].map((one) => html`<span class="pair"><span class="dim">${one}</span> <${Figure}>${form(values?.[one])}<//></span>`);
  return html`<${Card} class="run-state">
    <${Codes} />
    <div class="triple"><span class="dim">${word("run.tip")}</span>${letters(dx.status?.tip, "XYZ", forms.length)}</div>
    <div class="triple vector"><span class="dim">${word("run.vector")}</span>${letters(dx.status?.axis, "IJK", forms.unit)}</div>
  <//>`;
}

// ---- tool, feed, spindle

const known = { tools: {}, used: [] };
every("run", 5, "tools", (body) => (known.tools = body.tools));
every("run", 5, "usage", (body) => (known.used = body.tools));

export const ToolFeedSpindle = () => html`<${Card} class="run-tfs"><${Tool} /><${Feed} /><${Spindle} /><//>`;

// One of the three: its letter, its figure, and what belongs to it.
const Line = ({ letter, label, size, figure, picture, children, ...more }) => html`<div ...${more} class=${`tfs ${more.class ?? ""}`} role="group" aria-label=${label}>
  <span class="letter" aria-hidden="true">${letter}</span>${picture}<${Figure} class=${size} data-long=${figure.length > 4 || undefined}>${figure}<//><dl class="notes">${children}</dl></div>`;

const in_force = (letter) => dx.status?.codes?.find((code) => code.startsWith(letter));

function Tool() {
  const { tool: number } = dx.status ?? {};
  const tool = known.tools[number];
  const words = [in_force("H") ?? in_force("G43.1"), in_force("D")].filter(Boolean).join(" ");
  return html`<${Line} letter="T" label=${word("run.tool")} size="middle" class="run-tool" figure=${forms.text(number)} picture=${tool && html`<${ToolPicture} n=${number} tool=${tool} />`}>
    ${tool?.name && html`<dt>${word("setup.name")}</dt><dd class="tool-name" title=${tool.name}>${tool.name}</dd>`}
    ${words && html`<dt>${word("run.words")}</dt><${Figure} tag="dd">${words}<//>`}
    <${Life} use=${known.used.find((one) => one.number === number)} />
  <//>`;
}

// What is left of the limit that is nearest.
function Life({ use }) {
  if (!use) return null;
  const { cut_s = 0, cut_m = 0, parts = 0, most_cut_min, most_cut_m, most_parts, worn } = use;
  const spent = [[cut_s / 60, most_cut_min], [cut_m, most_cut_m], [parts, most_parts]].filter(([, most]) => most).map(([used, most]) => used / most);
  const left = forms.percent(Math.max(0, 1 - Math.max(...spent)));
  return (worn || spent.length > 0) && html`<dt>${word("run.life")}</dt>
    <dd id="run-life">${worn ? html`<${Chip} tone="stop">${word("usage.worn")}<//>` : html`<span class="dim" aria-hidden="true">${word("run.life")}</span> <${Figure}>${left}<//>`}</dd>`;
}

function Feed() {
  const { feed_mm_min: feed, limited_by } = dx.status ?? {};
  const unit = `${forms.units()}/min`;
  return html`<${Line} letter="F" label=${word("run.feed", forms.units())} size="huge" class="run-feed" figure=${forms.feed(feed?.actual)}>
    <dt>${word("run.programmed")}</dt><dd><${Figure}>${forms.feed(feed?.programmed)}<//> <span class="dim">${unit}</span></dd>
    ${limited_by && html`<dt>${word("run.limited")}</dt><${Figure} tag="dd" class="bound">${forms.bound(limited_by)}<//>`}
  <//>`;
}

function Spindle() {
  const { spindle, coolant } = dx.status ?? {};
  const share = typeof spindle?.load === "number" ? spindle.load / 100 : null;
  const running = ["mist", "flood"].filter((kind) => coolant?.[kind]).map((kind) => word(`run.${kind}`));
  if (!dx.facts.spindle && !dx.facts.outputs) return null;
  return html`<${Line} letter="S" label=${word("run.spindle")} size="middle" class="run-spindle" figure=${forms.int(spindle?.actual_rev_min)}>
    ${dx.facts.spindle?.driven === false && html`<dd class="by-hand">${word("run.spindle_by_hand")}</dd>`}
    ${dx.facts.spindle && html`<dt>${word("run.programmed")}</dt><dd><${Figure}>${forms.int(spindle?.rev_min)}<//> <span class="dim">1/min</span></dd>`}
    ${dx.facts.spindle?.tells_load && html`<dt>${word("run.spindle_load")}</dt><dd class="load"><${Figure} id="run-load">${forms.percent(share)}<//><${Meter} label=${word("run.spindle_load")} share=${share} tone=${share > 1 ? "stop" : "go"} /></dd>`}
    ${dx.facts.outputs && html`<dt>${word("run.coolant")}</dt><${Figure} tag="dd">${running.join(", ") || "–"}<//>`}
  <//>`;
}

// ---- overrides

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
    <input class="slider" type="range" id="run-override" min="0" max="200" step="5" aria-label=${word("run.feed_override")} ref=${slider} ...${field({})}
      oninput=${() => (override.dragging = true)} onchange=${(event) => ask_override(event.target.valueAsNumber)} />
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
  const coming = ["next_tool", "next_stop"].filter((key) => job?.[`${key}_s`] != null);
  const in_thread = dx.status?.notices?.some(({ name }) => name === "IN_THREAD");
  return html`<${Card} class="run-cycle">
    <${Offer} />
    <${Guide} />
    <div class="cycle">
      <div class="presses">
        ${tall("start", "start", { ...can_start(), ask: start_question(), command: "start", icon: "play", keys: "F4" })}
        ${tall("resume", "resume", { kind: "go", command: "resume", icon: "reset", keys: "F6" })}
      </div>
      <div class="presses"><${Toggle} key="single" name="single" path="single_block" /><${Toggle} key="optional" name="optional" path="optional_stop" /><${Skip} job=${job} />${dx.facts.spindle?.adaptive && html`<${Adaptive} />`}</div>
      ${in_thread ? html`<${InThread} />` : html`<${Aside} />`}
      <div class="presses">
        <${Act} text=${word("run.enable")} call="POST machine/enable" command="enable" icon="power" />
        <${Act} text=${word("run.disable")} call="POST machine/disable" modes="READY" icon="off" />
        <${Act} text=${word("run.home")} call="POST machine/home" body=${{}} ask=${word("run.home_ask")} command="home" icon="home" />
      </div>
      <${Override} /><${Rapid} /><${SpindleOverride} />
    </div>
    <div class="times">${["elapsed", "left", ...coming, ...(coming.length < 2 ? ["duration"] : [])].map(time)}
      <div class="time"><span class="dim">${word("run.parts")}</span><${Figure} class="strong" id="run-parts">${made(job)}<//></div></div>
  <//>`;
}

const Toggle = ({ name, path, children }) => {
  const on = Boolean(dx.status?.[path]);
  return html`<${Act} class="toggle" data-toggle=${`PUT cycle/${path}`} aria-pressed=${String(on)} press=${() => call("PUT", `cycle/${path}`, { on: !on })}>${word(`run.${name}`)}${children}<//>`;
};

// Lines that begin with /, left out or not: the program is loaded anew so, from its beginning.
const Skip = ({ job }) =>
  html`<${Act} text=${word("run.skip")} class="toggle" id="run-skip" command="load" aria-pressed=${String(Boolean(job?.block_delete))}
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
  const rules = { command: "retract", given: there, why: aside ? "why.aside" : "why.no_room" };
  const label = word("run.retract_mm");
  return html`<div class="aside">
    <label><input type="number" id="run-retract-mm" min="0.001" step="any" max=${room ?? ""} aria-label=${label} title=${label} value=${value} oninput=${(event) => give(event.target.value)} ...${field(rules)} /></label>
    <${Act} id="run-retract" text=${word("run.retract")} ...${rules} press=${() => call("POST", "cycle/retract", { mm: Number(value) })} />
    <${Act} text=${word("run.return")} call="POST cycle/return" command="return" given=${Boolean(aside)} why="why.on_path" />
  </div>`;
}

// A tool that a fault, a stop or a loss of power has left in its thread is turned out of it before all else.
function InThread() {
  const out = (key, body) => html`<${Act} id=${`run-${key}`} text=${word(`run.${key}`)} call="POST cycle/withdraw" body=${body} ask=${word(`run.${key}_ask`)} command="withdraw" kind="warn" />`;
  return html`<div class="presses">${out("withdraw", {})}${out("is_out", { is_out: true })}</div>`;
}

// ---- the program

// Those that came last and passed their check: loaded without a look at the list.
const RECENT = 3;
let stored = [];
every("run", 3, "programs?brief=true", (body) => (stored = body.programs));

const made = (job) => stored.find(({ name }) => name === job?.name)?.completed ?? "–";

export const recent = () =>
  stored.filter(({ check }) => verdict_of(check) === "passed").sort((a, b) => b.uploaded_s - a.uploaded_s).slice(0, RECENT);

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
      ${recent().map(({ name }) => html`<${Act} key=${name} text=${word("run.load", name)} call="POST job" body=${{ program: name }} command="load" icon="load" data-load=${name} />`)}
    </div>`}
  <//>`;
}
