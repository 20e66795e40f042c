// Notices by webhook and mail: what is set, and what came of the last one by each way.
import { call } from "../api.js";
import { say } from "../dialog.js";
import { html, useEffect } from "../dom.js";
import { forms } from "../forms.js";
import { Act, Chip, Select, Wrong, field } from "../parts.js";
import { dx } from "../store.js";
import { sentence, word as text } from "../texts.js";

const word = (key) => text(`notices.${key}`);
const RULES = { needs: "set_up" };
const EVENTS = ["alarms", "program_end", "tool_change"];
const CHOICES = { security: ["starttls", "tls", "none"], language: ["en", "de"] };
const FIELDS = { webhook: "url", host: "text", port: "number", security: "", user: "text", password: "password", sender: "email", to: "text", language: "" };
const SECRET = ["webhook", "password"]; // nobody is told what they are; empty, they stay
const told = { facts: null, typed: {}, wrong: "" };

async function ask(method, path, body, quiet) {
  const said = await call(method, path, body, quiet);
  if (said.ok) told.facts = said.body;
  told.wrong = said.ok || !quiet ? "" : sentence(said.body.error);
  dx.draw();
  return said.ok;
}

const type = (name, value) => ((told.typed = { ...told.typed, [name]: value }), dx.draw());
const sent = (name, value) => (FIELDS[name] === "number" ? Number(value) : (value.trim?.() ?? value));

async function save() {
  const changed = Object.entries(told.typed).filter(([name, value]) => value || !SECRET.includes(name));
  if (!(await ask("PATCH", "notices", Object.fromEntries(changed.map(([name, value]) => [name, sent(name, value)]))))) return;
  told.typed = {};
  say(word("saved"));
}

const Input = ({ name, kind, facts }) => {
  const value = told.typed[name] ?? (SECRET.includes(name) ? "" : facts[name]);
  const kept = name === "webhook" ? facts.webhook : name === "password" && facts.password_set && word("kept");
  return html`<label class="row dim"><span>${word(name)}</span>${CHOICES[name]
    ? html`<${Select} name=${name} options=${CHOICES[name]} text=${(one) => word(`is.${one}`)} value=${value} choose=${(one) => type(name, one)} ...${field(RULES)} />`
    : html`<input class="wide" type=${kind} name=${name} autocomplete="new-password" placeholder=${kept || ""} value=${value} oninput=${(event) => type(name, event.target.value)} ...${field(RULES)} />`}</label>`;
};

const Last = ({ way, last }) => html`<p data-way=${way}>${word(`way.${way}`)} <${Chip} tone=${last.sent ? "go" : "stop"}>${word(last.sent ? "sent" : "failed")}<//> ${forms.date(last.at_s)} ${sentence(last)}</p>`;

export function Notices() {
  useEffect(() => void (dx.user?.role === "set_up" && ask("GET", "notices", null, true)), []);
  const { facts } = told;
  if (dx.user?.role !== "set_up") return html`<p class="dim">${text("why.set_up")}</p>`;
  return html`<${Wrong} text=${told.wrong} />
    ${facts && html`<div class="form" id="notices">
      <p class="dim">${word("told")}</p>
      <div class="row">${EVENTS.map((name) => html`<label class="row"><input type="checkbox" name=${name} checked=${told.typed[name] ?? facts[name]} onchange=${(event) => type(name, event.target.checked)} ...${field(RULES)} /><span>${word(name)}</span></label>`)}</div>
      ${Object.entries(FIELDS).map(([name, kind]) => html`<${Input} key=${name} name=${name} kind=${kind} facts=${facts} />`)}
      <div class="row">
        <${Act} id="notices-save" text=${word("save")} ...${RULES} press=${save} />
        <${Act} id="notices-test" text=${word("test")} ...${RULES} given=${Boolean(facts.webhook || facts.host)} why="notices.none" press=${() => ask("POST", "notices/test")} />
        <${Act} id="notices-off" text=${word("off_webhook")} ...${RULES} given=${Boolean(facts.webhook)} why="notices.none" press=${() => ask("PATCH", "notices", { webhook: "" })} />
      </div>
      ${Object.entries(facts.last).map(([way, last]) => html`<${Last} key=${way} way=${way} last=${last} />`)}
    </div>`}`;
}
