// Calibration, set-up of the part, inspection: what was measured is evaluated, and told beside what it would change.
import { call, every } from "../api.js";
import { html } from "../dom.js";
import { mixed, scale_um } from "../maps.js";
import { Act, Facts, ScrolledTable, Select, TextFile, Typed } from "../parts.js";
import { dx } from "../store.js";
import { known, word as text } from "../texts.js";
import { number } from "./setup_tables.js";

const word = (key, ...values) => text(`measure.${key}`, ...values);
const named = (key) => known(`measure.${key}`, key);
const told = { measurements: [], name: "rotaries", typed: {}, table: "", file: "", program: "", programs: [], found: null, busy: false };
every("setup", 60, "calibration", (body) => Object.assign(told, body));
every("setup", 5, "programs?brief=true", (body) => (told.programs = body.programs));

const kind = () => told.measurements.find(({ name }) => name === told.name) ?? { values: [] };
const choose = (name) => (Object.assign(told, { name, found: null }), dx.draw());

function Value({ name, usual, choices, unit }) {
  const value = told.typed[`${told.name} ${name}`] ?? usual ?? "";
  const set = (typed) => ((told.typed[`${told.name} ${name}`] = typed), dx.draw());
  return html`<${Typed} name=${name} label=${named(`value.${name}`)} unit=${unit} choices=${choices} text=${(one) => one} value=${value} set=${set} />`;
}

async function evaluate() {
  const { takes, values } = kind();
  const typed = values.map(({ name, usual, choices }) => [name, told.typed[`${told.name} ${name}`] ?? usual, choices]);
  const said = typed.filter(([, value]) => value !== undefined && value !== null && value !== "");
  const body = {
    values: Object.fromEntries(said.map(([name, value, choices]) => [name, choices ? value : number(String(value))])),
    table: ["touches", "laser"].includes(takes) ? told.table : "",
    program: kind().program === "no" ? "" : told.program,
    ticks: takes === "ticks" ? "now" : null,
  };
  Object.assign(told, { busy: true, found: null });
  dx.draw();
  const answer = await call("POST", `calibration/${told.name}`, body);
  Object.assign(told, { busy: false, found: answer.ok ? answer.body : null });
  dx.draw();
}

// ---- what came out

const is_row = (one) => one !== null && typeof one === "object" && !Array.isArray(one);
const figure = (value) => {
  if (value === null || value === undefined) return "–";
  if (typeof value === "boolean") return value ? "✓" : "–";
  if (Array.isArray(value)) return value.map(figure).join("  ");
  if (is_row(value)) return Object.entries(value).map(([name, one]) => `${named(name)} ${figure(one)}`).join("  ");
  return typeof value === "number" ? String(Number(value.toFixed(7))).replace("-", "−") : String(value).replace(/^um$/, "µm");
};

function Rows({ name, rows }) {
  const columns = Object.keys(rows[0]);
  return html`<h2>${named(name)}</h2><${ScrolledTable} word=${named} columns=${columns} body=${`measure-${name}`}>${rows.map((row, i) => html`<tr key=${i}>${columns.map((column) => html`<td class="figures">${figure(row[column])}</td>`)}</tr>`)}<//>`;
}

// Deviations on the surface, u to the right, v downwards: as touched, and as the plan leaves them.
function Walls({ touches }) {
  const on = touches.filter(({ u }) => u !== null);
  if (!on.length) return null;
  const full_um = scale_um([{ map_um: [on.flatMap((one) => [one.deviation_um, one.predicted_um ?? null])] }]);
  const wall = (feature, field) => html`<figure key=${feature + field}><figcaption>${feature}: ${named(field)}</figcaption>
    <svg class="wall" viewBox="-4 -4 108 48" role="img" aria-label=${`${feature} ${named(field)}`}><rect width="100" height="40" />${on.filter((one) => one.feature === feature && typeof one[field] === "number").map((one) => html`<circle key=${one.touch} cx=${100 * one.u} cy=${40 * one.v} r="3.5" style=${{ fill: `rgb(${mixed(one[field], full_um).join(", ")})` }}><title>${figure(one[field])} µm</title></circle>`)}</svg></figure>`;
  const fields = ["deviation_um", "predicted_um"].filter((field) => on.some((one) => typeof one[field] === "number"));
  return html`<div class="row">${[...new Set(on.map((one) => one.feature))].flatMap((feature) => fields.map((field) => wall(feature, field)))}</div><p class="dim">${text("maps.scale", full_um.toFixed(0))}</p>`;
}

function save(content) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(new Blob([content])), download: "machine.toml" });
  link.click();
  URL.revokeObjectURL(link.href);
}

function Found({ found: { told: facts, machine_file: file, picture } }) {
  const entries = Object.entries(facts);
  const rows = entries.filter(([, value]) => Array.isArray(value) && value.length && value.every(is_row));
  const { offset, origin_mm, turned_deg } = facts;
  return html`<div id="measure-found">
    <${Facts} rows=${entries.filter((one) => !rows.includes(one)).map(([name, value]) => [named(name), figure(value)])} />
    ${picture && html`<img class="measure-picture" src=${`data:image/png;base64,${picture}`} alt=${named(`kind.${told.name}`)} />`}
    ${facts.touches?.length > 0 && html`<${Walls} touches=${facts.touches} />`}
    ${rows.map(([name, value]) => html`<${Rows} key=${name} name=${name} rows=${value} />`)}
    <div class="row">
      ${offset && origin_mm && told.name === "part" && html`<${Act} id="measure-set" text=${word("set", offset)} ask=${word("set_ask", offset)} command="set_offset" press=${() => call("PUT", `offsets/${offset}`, { origin_mm, turned_deg })} />`}
      ${file && html`<${Act} id="measure-file" text=${word("file")} needs="" icon="load" press=${() => save(file)} />`}</div>
    ${file && html`<p class="dim">${word("file_how")}</p>`}</div>`;
}

export function Calibration() {
  const { takes, values, program } = kind();
  const take = (content, file) => (Object.assign(told, { table: content, file }), dx.draw());
  const names = told.programs.map(({ name }) => name);
  return html`<p class="dim">${known(`measure.how.${told.name}`, "")}</p>
    <div class="probing">
      <${Typed} name="measurement" label=${word("what")} choices=${told.measurements.map(({ name }) => name)} text=${(one) => named(`kind.${one}`)} value=${told.name} set=${choose} />
      ${values.map((one) => html`<${Value} key=${told.name + one.name} ...${one} />`)}
      ${program !== "no" && program && html`<label>${word("program")} <${Select} name="program" options=${["", ...names]} text=${(one) => one || "–"} value=${told.program} choose=${(one) => ((told.program = one), dx.draw())} /></label>`}</div>
    <div class="row">
      ${["touches", "laser"].includes(takes) && html`<${TextFile} text=${told.file || word(`take.${takes}`)} accept=".csv" needs="" take=${take} />`}
      ${takes === "touches" && html`<${Act} id="measure-touches" text=${word("own")} needs="" press=${own_touches} />`}
      <${Act} id="measure-run" text=${word(told.busy ? "busy" : "evaluate")} needs="role" kind="go" given=${!told.busy} why="measure.busy" press=${evaluate} /></div>
    ${told.found && html`<${Found} found=${told.found} />`}`;
}

// What the machine's own probe has touched.
async function own_touches() {
  const answer = await fetch("/api/v1/probing/touches.csv");
  if (answer.ok) Object.assign(told, { table: await answer.text(), file: word("own") });
  dx.draw();
}
