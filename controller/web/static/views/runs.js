// Runs: what was cut, how it went, and where its record is.
import { call, every, history } from "../api.js";
import { html } from "../dom.js";
import { forms } from "../forms.js";
import { Act, Card, Chip, Facts, Link, Table, Wrong } from "../parts.js";
import { dx } from "../store.js";
import { known, sentence, word as text } from "../texts.js";
import { open_scope } from "./scope.js";

const word = (key) => text(`runs.${key}`);
const TONES = { completed: "go", stopped: "hold", fault: "stop", refused: "stop", lost: "stop", running: "info" };
const COLUMNS = ["program", "result", "began figures", "took figures", "cut figures r-cut", "error figures r-error"];

const list = history("runs", 3, (most) => `runs?most=${most}`, (body) => body.runs);
let sums = null;
let chosen = null;
dx.on("job", list.look);
every("runs", 5, "statistics/runs", (body) => (sums = body));

async function choose(id) {
  chosen = { id };
  dx.draw();
  const said = await call("GET", `runs/${id}`);
  if (said.ok && chosen.id === id) chosen = said.body;
  dx.draw();
}

async function keep(run) {
  const said = await call("PUT", `runs/${run.id}/kept`, { on: !run.facts.kept });
  if (said.ok && chosen?.id === run.id) chosen = said.body;
  dx.draw();
}

function View() {
  return html`<div class="looks runs">
    <${Card} title=${word("sums")} class="runs-sums"><div class="sums"><${Sums} /></div><//>
    <${Card} class="runs-history" tabindex="0">
      <${Wrong} id="runs-said" text=${list.wrong} />
      <${Table} word=${word} columns=${COLUMNS} body="runs-list">${list.rows.map((run) => html`<${Row} key=${run.id} run=${run} />`)}<//>
      ${!list.rows.length && html`<p class="dim" id="runs-empty">${word("none")}</p>`}
      <button class="act" id="runs-more" type="button" hidden=${!list.more} onclick=${list.older}><span>${word("more")}</span></button>
    <//>
    <${Card} class="runs-record">
      <div class="stack" id="runs-detail">${chosen?.facts && html`<${Detail} run=${chosen} />`}</div>
      ${!chosen && html`<p class="dim">${word("select")}</p>`}
    <//>
  </div>`;
}
export default { name: "runs", View };

function Sums() {
  const { runs, results = {}, failed, cut_time_s, duration_s } = sums ?? {};
  const shown = { all: runs, completed: sums && (results.completed ?? 0), stopped: sums && (results.stopped ?? 0), failed };
  const figures = { ...shown, cut: forms.seconds(cut_time_s), time: forms.seconds(duration_s) };
  return Object.entries(figures).map(([key, value]) => html`<div class="sum">
    <span class="figures big" id=${`runs-${key}`}>${value ?? "–"}</span><span class="dim">${word(key)}</span></div>`);
}

// The axis that was off most, of those in mm and of those in degrees: the two do not compare.
const rotary = (axis) => (dx.axis(axis).unit ?? ("ABC".includes(axis) ? "deg" : "mm")) === "deg";
const error = ([axis, value]) => `${axis} ${forms.um(value)} ${rotary(axis) ? "m°" : "µm"}`;
function worst(facts) {
  const errors = Object.entries(facts.following_error ?? {}).filter(([, v]) => typeof v === "number");
  const kinds = [errors.filter(([axis]) => !rotary(axis)), errors.filter(([axis]) => rotary(axis))];
  const most = kinds.filter((kind) => kind.length).map((kind) => kind.reduce((a, b) => (b[1] > a[1] ? b : a)));
  return most.map(error).join(", ") || "–";
}

const Result = ({ result }) => html`<${Chip} tone=${TONES[result]}>${known(`result.${result}`, result)}<//>`;

const Row = ({ run }) => html`<tr class="entry" aria-selected=${String(run.id === chosen?.id)} onclick=${() => choose(run.id)}>
  <td><button class="plain" type="button">${run.program}</button></td>
  <td><${Result} result=${run.result} />${run.facts.sentence && html` <span class="dim run-why">${sentence(run.facts)}</span>`}</td>
  <td class="figures r-began">${forms.date(run.began_s)}</td>
  <td class="figures">${forms.seconds(run.facts.duration_s)}</td>
  <td class="figures r-cut">${forms.seconds(run.facts.cut_time_s)}</td>
  <td class="figures r-error">${worst(run.facts)}</td>
</tr>`;

function Detail({ run }) {
  const { facts } = run;
  const rows = [
    ...[["began", forms.date(run.began_s)], ["ended", forms.date(run.ended_s)], ["took", forms.seconds(facts.duration_s)]],
    ...[["planned", forms.seconds(facts.planned_s)], ["cut", forms.seconds(facts.cut_time_s)], ["ticks", facts.ticks], ["skips", facts.skips]],
    ...[["error", Object.entries(facts.following_error ?? {}).map(error).join(", ")], ["from_line", facts.line || null], ["sha", run.sha256.slice(0, 16)]],
  ];
  return html`
    <h2 class="program-title">${run.program}</h2>
    <div class="row"><${Result} result=${run.result} /><span class="dim figures">#${run.id}</span></div>
    <${Wrong} text=${facts.sentence && sentence(facts)} />
    <${Facts} class="wide" rows=${rows.map(([key, value]) => [word(key), value])} />
    <div class="row">
      ${(run.files ?? []).includes("setpoints.npz") && html`<${Act} text=${word("scope")} needs="" press=${() => open_scope(`run:${run.id}`)} />`}
      ${facts.record && html`<${Act} id="run-keep" text=${word(facts.kept ? "release" : "keep")} needs="role" press=${() => keep(run)} />`}
      ${run.result !== "running" && html`<a class="act" href=${`/api/v1/runs/${run.id}/report?language=${dx.language}`} target="_blank" rel="noopener">${word("report")}</a>`}
      ${(run.files ?? []).map((file) => html`<${Link} key=${file} text=${file} path=${`runs/${run.id}/files/${encodeURIComponent(file)}`} />`)}
    </div>`;
}
