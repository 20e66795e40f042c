// Work offsets and tools: tables whose fields stay as they were typed until they are saved or given up.
import { API, call, every } from "../api.js";
import { ask, ask_for, say } from "../dialog.js";
import { html, useState } from "../dom.js";
import { forms } from "../forms.js";
import { Act, AxisName, Link, ScrolledTable, Select, TextFile, field as field_of, useChosen } from "../parts.js";
import { dx } from "../store.js";
import { sentence, word as text } from "../texts.js";

const word = (key, ...values) => text(`setup.${key}`, ...values);
const told = { offsets: {}, tools: {}, wrong: {} };
const look_at = (what) => every("setup", 2, what, (body) => (told[what] = body[what]), (wrong) => (told.wrong[what] = wrong));
const looks = { offsets: look_at("offsets"), tools: look_at("tools") };
const look = () => Object.values(looks).forEach((one) => one());
export const wrong = () => Object.values(told.wrong).find(Boolean);

export const figure = (v) => (typeof v === "number" ? String(Number(v.toFixed(6))) : "");
// A decimal comma is what half of the shops type.
export const number = (typed) => (typed.trim() ? Number(typed.trim().replace(",", ".").replace("−", "-")) : NaN);
const same = (name, a, b) => a === b || (name !== "name" && number(a) === number(b));

async function ask_number(question, start) {
  const given = await ask_for(question, "setup.set", start, { inputmode: "decimal" });
  if (given === null) return null;
  const value = number(given);
  return Number.isFinite(value) ? value : (say(word("number"), "warn"), null);
}

async function read(what) {
  const said = await call("GET", what);
  if (said.ok) told[what] = said.body[what];
  return said.ok;
}

// A row's fields show what is in force, each until something else is typed; Escape gives that up. Saved is what
// was typed over what is in force at that moment, not over what this page saw last.
function use_row(what, name, fields, value, body) {
  const [typed, type] = useState({});
  const now = (field) => value(told[what][name] ?? {}, field);
  const shown = (field) => (typeof now(field) === "string" ? now(field) : figure(now(field)));
  const differs = (field) => field in typed && !same(field, typed[field], shown(field));
  const forget = (field) => type(({ [field]: _, ...others }) => others);
  const input = (field, label, more) => html`<input type="text" inputmode="decimal" ...${more} aria-label=${label} data-field=${field} data-typed=${differs(field) || undefined} value=${typed[field] ?? shown(field)}
    oninput=${({ target }) => type((others) => ({ ...others, [field]: target.value }))} onblur=${() => differs(field) || forget(field)} onkeydown=${({ key }) => key === "Escape" && forget(field)} />`;
  async function save() {
    const own = fields.filter(differs);
    if (!(await read(what)) || !told[what][name]) return;
    const wanted = (field) => (!own.includes(field) ? now(field) : field === "name" ? typed[field] : number(typed[field]));
    const all = Object.fromEntries(fields.map((field) => [field, wanted(field)]));
    if (Object.values(all).some(Number.isNaN)) return say(word("number"), "warn");
    const said = await call("PUT", `${what}/${name}`, body(all, told[what][name]));
    if (!(await read(what)) || !said.ok) return;
    type({});
    say(word("saved", what === "tools" ? `T${name}` : name));
  }
  return { input, save };
}

// ---- offsets

let spindle = 0; // the tool in it, as the machine has it
let tool = 1; // that touches off: the one in the spindle, until another one is picked
dx.on("status", (status) => {
  if (status.tool && status.tool !== spindle) tool = spindle = status.tool;
});
export const forget_pick = () => (tool = spindle || tool);

const AXES = [..."XYZ"];
const of_offset = (values, field) => (field[0] === "r" ? (values.turned_deg ?? [0, 0, 0]) : values.origin_mm)["XYZ".indexOf(field.at(-1))];
const offset_body = (all) => ({ origin_mm: [all.X, all.Y, all.Z], turned_deg: [all.rX, all.rY, all.rZ] });

// The tip is that of the tool in the spindle, whichever is picked.
function tip(status) {
  const { tool: number_, on_table } = status ?? {};
  const at = (on_table?.tip ?? []).map((v, i) => `${"XYZ"[i]} ${forms.mm(v)}`);
  return [number_ ? `T${number_}:` : "", ...at].join("   ").trim() || "–";
}

export function Offsets() {
  const pick = (number_) => ((tool = Number(number_)), dx.draw());
  return html`
    <div class="row">
      <span class="dim">${word("tip")}</span><span class="figures strong" id="setup-tip">${tip(dx.status)}</span>
      <label class="row dim"><span>${word("touch_by")}</span>
        <${Select} id="setup-tool" options=${tools().map(([n]) => n)} text=${(n) => `T${n} ${told.tools[n].name ?? ""}`} value=${String(tool)} choose=${pick} /></label>
    </div>
    <table class="list">
      <thead><tr>
        <th scope="col">${word("offset")}</th>${AXES.map((axis) => html`<th scope="col">${axis} mm</th>`)}${AXES.map((axis) => html`<th scope="col" class="hide-narrow">${word("turned")} ${axis} °</th>`)}<td>
        </td></tr></thead>
      <tbody id="setup-offsets">${Object.keys(told.offsets).map((name) => html`<${Offset} key=${name} name=${name} />`)}</tbody>
    </table>`;
}

function Offset({ name }) {
  const { input, save } = use_row("offsets", name, [...AXES, ...AXES.map((axis) => `r${axis}`)], of_offset, offset_body);
  const at = (axis) => html`<td data-label=${`${axis} mm`}><div class="row">
    ${input(axis, `${name} ${axis}`)}
    <${Act} icon="target" modes="OFF READY" title=${word("touch", axis)} aria-label=${`${name}: ${word("touch", axis)}`} press=${() => touch(name, axis)} />
  </div></td>`;
  return html`<tr data-row=${name}>
    <th scope="row"><${AxisName} name=${name} /><span class="dim" data-unset="" hidden=${!told.offsets[name].unset}> ${word("unset")}</span></th>
    ${AXES.map(at)}
    ${AXES.map((axis) => html`<td class="hide-narrow">${input(`r${axis}`, `${name} ${word("turned")} ${axis}`)}</td>`)}
    <td><div class="row"><${Act} text=${word("save")} aria-label=${`${word("save")} ${name}`} command="set_offset" press=${save} />
      ${told.offsets[name].source === "machine" && html`<${Act} icon="reset" data-forget=${name} title=${word("forget")} aria-label=${`${name}: ${word("forget")}`} command="forget" ask=${word("forget_ask", name)} press=${() => forget_set(name)} />`}</div></td>
  </tr>`;
}

// What was set at the machine gives way to what its file says.
async function forget_set(name) {
  await call("DELETE", `offsets/${encodeURIComponent(name)}`);
  look();
}

// Which figure is set, it shows: in inches where figures are, of rotaries always degrees. What is typed goes as it
// is, for the service does the arithmetic.
async function ask_figure(question, axis) {
  const inch = dx.inch && "XYZ".includes(axis);
  const typed = await ask_for(question, "setup.set", "0", { inputmode: "text" });
  if (typed === null || !inch) return typed;
  const more = typed.trim().startsWith("+") ? "+" : "";
  return `${more}(${typed.trim().slice(more.length)})*25.4`;
}
const unit_of = (axis) => ("XYZ".includes(axis) ? forms.units() : "°");

// Here an axis reads what is typed; Enter alone makes it zero. ``by``: as under G43 with another tool; 0: as it is.
export async function touch(name, axis, by = tool) {
  const { work_offset, joints } = dx.status ?? {};
  const other = Boolean(by && spindle) && by !== spindle;
  const now = name === work_offset && !other ? forms["XYZ".includes(axis) ? "length" : "deg"](joints?.[axis]?.work) : "–";
  const question = word("touch_ask", name, axis, unit_of(axis), now) + (other ? ` ${word("touch_other", by, spindle)}` : "");
  const typed = await ask_figure(question, axis);
  if (typed === null) return;
  const said = await call("POST", `offsets/${encodeURIComponent(name)}/touch_off`, { [axis]: typed, ...(other ? { tool: by } : {}) });
  if (said.ok) say(word("saved", name));
  look();
}

async function touch_length(n) {
  const typed = await ask_figure(word("touch_length", n, unit_of("Z")), "Z");
  if (typed === null) return;
  const said = await call("POST", `tools/${n}/touch_off`, { Z: typed });
  if (said.ok) say(word("saved", `T${n}`));
  look();
}

// ---- tools

const FIELDS = ["radius_mm", "length_mm", "flute_mm", "corner_mm", "taper_deg", "wear_radius_mm", "wear_length_mm"];
let pictured = ""; // number of the tool whose profile is shown; "" = of the one in the spindle
export const tools = () => Object.entries(told.tools).sort((a, b) => Number(a[0]) - Number(b[0]));
const of_tool = (values, field) => (field === "taper_deg" ? ((values.taper_rad ?? 0) * 180) / Math.PI : (values[field] ?? (field === "name" ? "" : 0)));
const KEPT = ["name", "radius_mm", "length_mm", "flute_mm"];
// What stays is left out where it may be: turned to degrees and back it would be another taper by a hair.
const stays = (field, one, values) => !KEPT.includes(field) && one === of_tool(values, field);
const tool_body = (all, values) => Object.fromEntries(Object.entries(all).filter(([field, one]) => !stays(field, one, values)));

export function Tools() {
  const n = [pictured, String(spindle), tools()[0]?.[0]].find((one) => told.tools[one]);
  return html`
    <${ScrolledTable} word=${word} columns=${["tool", "name", ...FIELDS, "centre_cutting", ""]} body="setup-tools">${tools().map(([number_]) => html`<${Tool} key=${number_} n=${number_} />`)}<//>
    <div class="row"><${Act} id="setup-add" text=${word("add")} press=${add_tool} />
      <${TextFile} text=${word("import")} accept=".tbl,.json" needs="control" modes="OFF READY FAULT" take=${import_tools} />
      <${Link} text="tool.tbl" path="tools.tbl" /><${Link} text="tools.json" path="tools.json" /></div>
    ${n && html`<figure><figcaption>T${n} ${told.tools[n].name}</figcaption><${ToolPicture} n=${n} tool=${told.tools[n]} /></figure>`}`;
}

// Its profile, to scale; drawn anew where the tool has changed.
export const ToolPicture = ({ n, tool }) => html`<img class="tool-picture" src=${`${API}tools/${n}/picture?${encodeURIComponent(JSON.stringify(tool))}`} alt=${`T${n} ${word("picture")}`} />`;

async function import_tools(content, file, flute_mm = null) {
  const said = await call("POST", "tools/import", { file, text: content, flute_mm }, true);
  look();
  if (said.ok) return say(word("imported", said.body.result.tools.map((n) => `T${n}`).join(" ")));
  if (said.body.error?.key !== "tool_file.no_flute") return say(sentence(said.body.error), "warn");
  const given = await ask_number(`${sentence(said.body.error)} ${word("flute_ask")}`, "");
  if (given !== null) await import_tools(content, file, given);
}

function Tool({ n }) {
  const { input, save } = use_row("tools", n, ["name", ...FIELDS], of_tool, tool_body);
  const [centre, choose_centre] = useChosen(told.tools[n].centre_cutting ?? true, (on) => set_centre(n, on));
  const here = html`<${Act} icon="target" modes="OFF READY" title=${word("length_here", n)} aria-label=${word("length_here", n)} data-touch-length=${n} press=${() => touch_length(n)} />`;
  return html`<tr data-row=${n}>
    <th scope="row"><${Act} needs="" data-picture=${n} class="axis-set" title=${word("picture")} aria-label=${`T${n}: ${word("picture")}`} press=${() => ((pictured = n), dx.draw())}><${AxisName} name=${`T${n}`} /><//></th>
    <td data-label=${word("name")}>${input("name", `T${n} ${word("name")}`, { class: "wide", inputmode: "text" })}</td>
    ${FIELDS.map((name) => html`<td data-label=${word(name)}>${name === "length_mm" ? html`<div class="row">${input(name, `T${n} ${word(name)}`)}${here}</div>` : input(name, `T${n} ${word(name)}`)}</td>`)}
    <td data-label=${word("centre_cutting")}><input type="checkbox" data-field="centre_cutting" aria-label=${`T${n} ${word("centre_cutting")}`} checked=${centre} onchange=${({ target }) => choose_centre(target.checked)} ...${field_of(SET)} /></td>
    <td><div class="row">
      <${Act} text=${word("save")} aria-label=${`${word("save")} T${n}`} press=${save} />
      ${n !== "1" && html`<${Act} text=${word("delete")} aria-label=${`${word("delete")} T${n}`} press=${() => remove_tool(n)} />`}
    </div></td>
  </tr>`;
}

// Saved as it is ticked, beside what a tool cannot be without.
const SET = { needs: "control", modes: "OFF READY FAULT" };
async function set_centre(n, centre_cutting) {
  const kept = Object.fromEntries(KEPT.map((field) => [field, of_tool(told.tools[n], field)]));
  const said = await call("PUT", `tools/${n}`, { ...kept, centre_cutting });
  if (said.ok) await read("tools");
}

async function remove_tool(n) {
  if (!(await ask(word("delete_ask", `T${n}`)))) return;
  await call("DELETE", `tools/${n}`);
  look();
}

// A tool that is there is never written over by one that is added.
async function add_tool() {
  const n = await ask_number(word("add_ask"), String(Math.max(0, ...tools().map(([one]) => Number(one))) + 1));
  if (n === null) return;
  if (!Number.isInteger(n) || n < 1 || n > 99999) return say(word("tool_number"), "warn");
  if (!(await read("tools"))) return;
  if (told.tools[n]) return say(word("tool_there", n), "warn");
  await call("PUT", `tools/${n}`, { name: "", radius_mm: 3, length_mm: 0, flute_mm: 15 });
  look();
}
