// Wear: how much tools have cut and axes have gone, what of it is at its end, and what was done about it.
import { call, every } from "../api.js";
import { ask, ask_for, say } from "../dialog.js";
import { html } from "../dom.js";
import { forms } from "../forms.js";
import { Act, AxisName, Chip, ScrolledTable, Select, Wrong } from "../parts.js";
import { dx } from "../store.js";
import { known, word as text } from "../texts.js";
import { number, tools } from "./setup_tables.js";

const word = (key, ...values) => text(`usage.${key}`, ...values);
const told = { tools: [], counters: [], items: [], counter: "motion", wrong: "" };
every("setup", 2, "usage", (body) => Object.assign(told, body), (wrong) => (told.wrong = wrong));

async function change(method, path, body) {
  const said = await call(method, `usage/${path}`, body);
  if (said.ok) Object.assign(told, said.body);
  dx.draw();
}

const WHOLE = ["parts", "sister"];
const named = (counter) => known(`usage.counter.${counter}`, counter);
const amount = (v) => (v < 10 ? v.toFixed(2) : v.toFixed(1));

// A number that is typed; "" = no limit, undefined = nothing is to be changed.
async function limit(sentence, start) {
  const given = await ask(sentence, "setup.set", { inputmode: "decimal" }, start === null ? "" : String(start));
  if (given === null || given === false) return undefined;
  const value = given.trim() ? number(given) : null;
  return value === null || value > 0 ? value : void say(text("setup.number"), "warn");
}

const Used = ({ used, most, unit = "", label, press }) =>
  html`<${Act} class="figures" needs="role" title=${word("limit")} aria-label=${`${label}: ${word("limit")}`} press=${press}>${used} / ${most ?? "∞"} ${unit}<//>`;

function Tool({ n, name, use }) {
  const { cut_s = 0, cut_m = 0, parts = 0, most_cut_min = null, most_cut_m = null, most_parts = null, sister = null, worn = false, since_s } = use ?? {};
  const set = async (field, start) => {
    const value = await limit(word(`${field}_ask`, n), start);
    if (value !== undefined) await change("PUT", `tools/${n}`, { cut_min: most_cut_min, cut_m: most_cut_m, parts: most_parts, sister, [field]: WHOLE.includes(field) && value ? Math.ceil(value) : value });
  };
  const renew = async () => (await ask(word("renew_ask", n))) && change("POST", `tools/${n}/renewed`);
  return html`<tr data-tool=${n}>
    <th scope="row"><${AxisName} name=${`T${n}`} /> ${name} ${worn && html`<${Chip} tone="stop">${word("worn")}<//>`}</th>
    <td><${Used} used=${amount(cut_s / 60)} most=${most_cut_min} unit="min" label=${`T${n} ${word("cut")}`} press=${() => set("cut_min", most_cut_min)} /></td>
    <td><${Used} used=${amount(cut_m)} most=${most_cut_m} unit="m" label=${`T${n} ${word("way")}`} press=${() => set("cut_m", most_cut_m)} /></td>
    <td><${Used} used=${parts} most=${most_parts} label=${`T${n} ${word("parts")}`} press=${() => set("parts", most_parts)} /></td>
    <td><${Act} class="figures" needs="role" title=${word("sister_set")} aria-label=${`T${n} ${word("sister")}`} press=${() => set("sister", sister)}>${sister ? `T${sister}` : "–"}<//></td>
    <td class="hide-narrow">${since_s ? forms.moment(since_s) : "–"}</td>
    <td><${Act} text=${word("renew")} aria-label=${`T${n}: ${word("renew")}`} needs="role" press=${renew} /></td>
  </tr>`;
}

function Item({ one: { name, counter, every: most, used, unit, due, done_s, done_by } }) {
  const set = async () => {
    const value = await limit(word("every_ask", name, unit), most);
    if (value) await change("PUT", "maintenance", { name, counter, every: value });
  };
  const done = async () => (await ask(word("done_ask", name))) && change("POST", "maintenance/done", { name });
  const remove = async () => (await ask(word("remove_ask", name))) && change("PUT", "maintenance", { name });
  return html`<tr data-item=${name}>
    <th scope="row">${name} ${due && html`<${Chip} tone="stop">${word("due")}<//>`}<div class="dim">${named(counter)}</div></th>
    <td><${Used} used=${amount(used)} most=${most} unit=${known(`usage.unit.${unit}`, unit)} label=${name} press=${set} /></td>
    <td class="hide-narrow">${done_s ? `${forms.moment(done_s)} ${done_by}` : "–"}</td>
    <td><div class="row"><${Act} text=${word("done")} aria-label=${`${name}: ${word("done")}`} needs="role" press=${done} />
      <${Act} icon="delete" title=${word("remove")} aria-label=${`${name}: ${word("remove")}`} needs="set_up" press=${remove} /></div></td>
  </tr>`;
}

async function add() {
  const name = (await ask_for(word("name_ask"), "users.add", "", { maxlength: 60 }))?.trim();
  const value = name && (await limit(word("every_ask", name, known(`usage.unit.${unit_of(told.counter)}`)), null));
  if (value) await change("PUT", "maintenance", { name, counter: told.counter, every: value });
}
const unit_of = (counter) => told.counters.find(({ name }) => name === counter)?.unit;

export function Usage() {
  const pick = (counter) => ((told.counter = counter), dx.draw());
  return html`<${Wrong} text=${told.wrong} />
    <${ScrolledTable} word=${word} body="usage-tools" columns=${["tool", "cut", "way", "parts", "sister", "since hide-narrow", ""]}>${tools().map(([n, { name }]) => html`<${Tool} key=${n} n=${n} name=${name} use=${told.tools.find((one) => String(one.number) === n)} />`)}<//>
    <h2>${word("maintenance")}</h2>
    <div class="sums">${told.counters.map(({ name, value, unit }) => html`<div class="sum" key=${name} data-counter=${name}><span class="dim">${named(name)}</span>
      <span class="figures">${amount(value)} ${known(`usage.unit.${unit}`, unit)}</span></div>`)}</div>
    ${told.items.length > 0 && html`<${ScrolledTable} word=${word} body="usage-items" columns=${["item", "used", "last hide-narrow", ""]}>${told.items.map((one) => html`<${Item} key=${one.name} one=${one} />`)}<//>`}
    <div class="row"><${Select} aria-label=${word("counter")} options=${told.counters.map(({ name }) => name)} text=${named} value=${told.counter} choose=${pick} />
      <${Act} id="usage-add" text=${word("add")} needs="set_up" press=${add} /></div>`;
}
