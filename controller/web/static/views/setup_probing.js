// Probing cycles: a picture of each, its values, and one of them from where the probe stands.
import { API, call, every } from "../api.js";
import { html } from "../dom.js";
import { forms } from "../forms.js";
import { Act, ScrolledTable, Typed } from "../parts.js";
import { dx } from "../store.js";
import { known, word as text } from "../texts.js";
import { number } from "./setup_tables.js";

const SHOWN = 20; // of what was found; the table has all
const word = (key) => text(`probing.${key}`);
const told = { cycles: [], offsets: [], found: [], chosen: { cycle: "edge", offset: "none" } };
const take = (body) => Object.assign(told, body);
every("setup", 60, "probing", take);
every("setup", 2, "probing/found", take);

const Value = ({ name, label = word(name), usual, ...more }) =>
  html`<${Typed} name=${name} label=${label} value=${told.chosen[name] ?? usual} set=${(typed) => ((told.chosen[name] = typed), dx.draw())} text=${(one) => known(`probing.${name}.${one}`, one)} ...${more} />`;

const figure = ([name, value]) => {
  const [, what, unit] = name.match(/^(.*)_(mm|deg)$/) ?? [null, name, ""];
  return html`${known(`probing.found.${what}`, what)} <b class="figures">${unit ? forms.u(value) : value}</b>${unit && ` ${unit === "deg" ? "°" : unit}`} `;
};

const Found = ({ one }) => html`<tr><td>${forms.moment(one.at_s)}</td><td>${one.program}</td>
  <td>${known(`probing.cycle.${one.cycle}`, one.cycle)}</td><td>${Object.entries(one.values).map(figure)}</td></tr>`;

export function Probing() {
  const { cycle, offset, ...typed } = told.chosen;
  const { values = [], sets } = told.cycles.find(({ name }) => name === cycle) ?? {};
  const of = ({ name, choices, usual }) => [name, choices ? (typed[name] ?? usual) : number(String(typed[name] ?? usual))];
  const run = () => call("POST", "probing", { cycle, offset: sets ? offset : "none", values: Object.fromEntries(values.map(of)) });
  return html`<p class="dim">${word("stands")}</p>
    <div class="row"><img class="probing-picture" src=${`/api/v1/probing/${cycle}.svg`} alt=${word(`cycle.${cycle}`)} /><div class="probing">
      <${Value} name="cycle" choices=${told.cycles.map(({ name }) => name)} />
      ${values.map((one) => html`<${Value} key=${cycle + one.name} label=${word(`value.${one.name}`)} ...${one} />`)}
      ${sets && html`<${Value} name="offset" choices=${told.offsets} />`}</div></div>
    <div class="row"><${Act} id="probing-run" text=${word("run")} kind="go" icon="play" command="probe" ask=${word("run_ask")} press=${run} /></div>
    ${told.found.length > 0 && html`<${ScrolledTable} id="probing-found" word=${word} columns=${["time", "program", "cycle", "found"]}>${told.found.slice(0, SHOWN).map((one) => html`<${Found} key=${one.at_s + one.cycle} one=${one} />`)}<//>
      <a href=${`${API}probing/found.csv`} download>${word("csv")}</a>`}`;
}
