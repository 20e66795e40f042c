// Work offsets and tools: tables whose fields stay as they were typed until they are saved or given up.
import { call, every } from "../api.js";
import { ask, ask_for, say } from "../dialog.js";
import { Component, createRef, html } from "../dom.js";
import { forms } from "../forms.js";
import { Act, AxisName, Table } from "../parts.js";
import { dx } from "../store.js";
import { word as text } from "../texts.js";

const word = (key, ...values) => text(`setup.${key}`, ...values);
const told = { offsets: {}, tools: {}, wrong: {} };
const look_at = (what) => every("setup", 2, what, (body) => (told[what] = body[what]), (wrong) => (told.wrong[what] = wrong));
const looks = { offsets: look_at("offsets"), tools: look_at("tools") };
const look = () => Object.values(looks).forEach((one) => one());
dx.on("setup", look);
export const wrong = () => Object.values(told.wrong).find(Boolean);

export const figure = (v) => (typeof v === "number" ? String(Number(v.toFixed(6))) : "");
// A decimal comma is what half of the shops type.
export const number = (typed) => (typed.trim() ? Number(typed.trim().replace(",", ".").replace("−", "-")) : NaN);
const same = (name, a, b) => a === b || (name !== "name" && number(a) === number(b));

async function ask_number(sentence, start) {
  const given = await ask_for(sentence, "setup.set", start, { inputmode: "decimal" });
  if (given === null) return null;
  const value = number(given);
  return Number.isFinite(value) ? value : (say(word("number"), "warn"), null);
}

// A field shows what is in force, until something else is typed; Escape gives that up.
class Field extends Component {
  input = createRef();

  settle() {
    const { current: input } = this.input;
    const { name, value } = this.props;
    const shown = typeof value === "string" ? value : figure(value);
    const typed = !same(name, input.value, input.defaultValue);
    if (!typed && input === document.activeElement) return; // a half typed figure may be worth as much as the old one
    input.defaultValue = shown;
    if (!typed || same(name, input.value, shown)) input.value = shown;
    this.mark();
  }

  mark() {
    const { current: input } = this.input;
    input.toggleAttribute("data-typed", !same(this.props.name, input.value, input.defaultValue));
  }

  componentDidMount() {
    this.input.current.defaultValue = this.input.current.value = typeof this.props.value === "string" ? this.props.value : figure(this.props.value);
  }

  componentDidUpdate() {
    this.settle();
  }

  render({ name, label, class: classes, mode = "decimal" }) {
    const key = (event) => {
      if (event.key !== "Escape") return;
      event.target.value = event.target.defaultValue;
      this.mark();
    };
    return html`<input type="text" class=${classes} inputmode=${mode} aria-label=${label} data-field=${name} ref=${this.input} oninput=${() => this.mark()} onkeydown=${key} />`;
  }
}

// What a row is to be: what was typed in it, of the rest what is in force now. null: a figure is none.
function wanted(row, values, value) {
  const found = [...row.querySelectorAll("[data-field]")].map((input) => {
    const { field: name } = input.dataset;
    if (same(name, input.value, input.defaultValue)) return [name, value(values, name)];
    return [name, name === "name" ? input.value : number(input.value)];
  });
  if (found.every(([, one]) => typeof one === "string" || Number.isFinite(one))) return Object.fromEntries(found);
  say(word("number"), "warn");
  return null;
}

// Saved is over what is in force at this moment, not over what this page saw last.
async function save(event, what, name, value, body) {
  const row = event.target.closest("[data-row]");
  const now = await call("GET", what);
  const values = now.ok && now.body[what][name];
  const all = values && wanted(row, values, value);
  if (!all) return;
  const said = await call("PUT", `${what}/${name}`, body(all, values));
  if (!said.ok) return look();
  for (const input of row.querySelectorAll("[data-typed]")) input.defaultValue = input.value;
  say(word("saved", what === "tools" ? `T${name}` : name));
  look();
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
function tip({ tool: number_, on_table } = {}) {
  const at = (on_table?.tip ?? []).map((v, i) => `${"XYZ"[i]} ${forms.mm(v)}`);
  return [number_ ? `T${number_}:` : "", ...at].join("   ").trim() || "–";
}

export function Offsets() {
  const pick = (event) => {
    tool = Number(event.target.value);
    dx.draw();
  };
  return html`
    <div class="row">
      <span class="dim">${word("tip")}</span><span class="figures strong" id="setup-tip">${tip(dx.status ?? {})}</span>
      <label class="row dim"><span>${word("touch_by")}</span>
        <select id="setup-tool" value=${String(tool)} onchange=${pick}>${tools().map(([n, one]) => html`<option key=${n} value=${n} selected=${Number(n) === tool}>T${n} ${one.name ?? ""}</option>`)}</select>
      </label>
    </div>
    <table class="list">
      <thead><tr>
        <th scope="col">${word("offset")}</th>${AXES.map((axis) => html`<th scope="col">${axis} mm</th>`)}${AXES.map((axis) => html`<th scope="col" class="hide-narrow">${word("turned")} ${axis} °</th>`)}<td>
        </td></tr></thead>
      <tbody id="setup-offsets">${Object.entries(told.offsets).map(([name, values]) => html`<${Offset} key=${name} name=${name} values=${values} />`)}</tbody>
    </table>`;
}

function Offset({ name, values }) {
  const at = (axis) => html`<td data-label=${`${axis} mm`}><div class="row">
    <${Field} name=${axis} label=${`${name} ${axis}`} value=${of_offset(values, axis)} />
    <${Act} icon="target" modes="OFF READY" title=${word("touch", axis)} aria-label=${`${name}: ${word("touch", axis)}`} press=${() => touch(name, axis)} />
  </div></td>`;
  return html`<tr data-row=${name}>
    <th scope="row"><${AxisName} name=${name} /><span class="dim" data-unset="" hidden=${!values.unset}> ${word("unset")}</span></th>
    ${AXES.map(at)}
    ${AXES.map((axis) => html`<td class="hide-narrow">
      <${Field} name=${`r${axis}`} label=${`${name} ${word("turned")} ${axis}`} value=${of_offset(values, `r${axis}`)} /></td>`)}
    <td>
      <${Act} text=${word("save")} aria-label=${`${word("save")} ${name}`} modes="OFF READY FAULT" press=${(event) => save(event, "offsets", name, of_offset, offset_body)} />
      </td>
  </tr>`;
}

export async function touch(name, axis, by = tool) {
  const other = spindle && by !== spindle ? ` ${word("touch_other", spindle)}` : "";
  const value = await ask_number(word("touch_ask", name, axis, by) + other, "0");
  if (value === null) return;
  const said = await call("POST", `offsets/${name}/touch_off`, { [axis]: value, tool: by });
  if (said.ok) say(word("saved", name));
  look();
}

// ---- tools

const FIELDS = ["radius_mm", "length_mm", "flute_mm", "corner_mm", "taper_deg"];
export const tools = () => Object.entries(told.tools).sort((a, b) => Number(a[0]) - Number(b[0]));
const of_tool = (values, field) => (field === "taper_deg" ? ((values.taper_rad ?? 0) * 180) / Math.PI : (values[field] ?? (field === "name" ? "" : 0)));
// What stays is left out where it may be: turned to degrees and back it would be another taper by a hair.
const stays = (field, one, values) => ["corner_mm", "taper_deg"].includes(field) && one === of_tool(values, field);
const tool_body = (all, values) => Object.fromEntries(Object.entries(all).filter(([field, one]) => !stays(field, one, values)));

export function Tools() {
  return html`
    <${Table} word=${word} columns=${["tool", "name", ...FIELDS, ""]} body="setup-tools">${tools().map(([n, values]) => html`<${Tool} key=${n} n=${n} values=${values} />`)}<//>
    <div class="row"><${Act} id="setup-add" text=${word("add")} press=${add_tool} /></div>`;
}

const Tool = ({ n, values }) => html`<tr data-row=${n}>
  <th scope="row"><${AxisName} name=${`T${n}`} /></th>
  <td data-label=${word("name")}><${Field} name="name" label=${`T${n} ${word("name")}`} class="wide" mode="text" value=${of_tool(values, "name")} /></td>
  ${FIELDS.map((name) => html`<td data-label=${word(name)}><${Field} name=${name} label=${`T${n} ${word(name)}`} value=${of_tool(values, name)} /></td>`)}
  <td><div class="row">
    <${Act} text=${word("save")} aria-label=${`${word("save")} T${n}`} press=${(event) => save(event, "tools", n, of_tool, tool_body)} />
    ${n !== "1" && html`<${Act} text=${word("delete")} aria-label=${`${word("delete")} T${n}`} press=${() => remove_tool(n)} />`}
  </div></td>
</tr>`;

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
  const now = await call("GET", "tools");
  if (!now.ok) return;
  if (now.body.tools[n]) return say(word("tool_there", n), "warn");
  await call("PUT", `tools/${n}`, { name: "", radius_mm: 3, length_mm: 0, flute_mm: 15 });
  look();
}
