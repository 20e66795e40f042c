// Notices by webhook and mail: what is set, and what came of the last one by each way.
import { call } from "../api.js";
import { say } from "../dialog.js";
import { html, useEffect, useRef } from "../dom.js";
import { forms } from "../forms.js";
import { Act, Chip, Wrong, field } from "../parts.js";
import { dx } from "../store.js";
import { sentence, word as text } from "../texts.js";

const word = (key) => text(`notices.${key}`);
const RULES = { needs: "set_up" };
const EVENTS = ["alarms", "program_end", "tool_change"];
const CHOICES = { security: ["starttls", "tls", "none"], language: ["en", "de"] };
const FIELDS = { webhook: "url", host: "text", port: "number", security: "", user: "text", password: "password", sender: "email", to: "text", language: "" };
const told = { facts: null, wrong: "" };

async function ask(method, path, body, quiet) {
  const said = await call(method, path, body, quiet);
  if (said.ok) told.facts = said.body;
  told.wrong = said.ok || !quiet ? "" : sentence(said.body.error);
  dx.draw();
  return said.ok;
}

// What is secret is sent only where something was typed: empty, it stays.
async function save(form) {
  const body = {};
  for (const { name, type, value, checked } of form.querySelectorAll("[name]"))
    if (type === "checkbox") body[name] = checked;
    else if (!["webhook", "password"].includes(name) || value) body[name] = type === "number" ? Number(value) : value.trim();
  if (!(await ask("PATCH", "notices", body))) return;
  for (const name of ["webhook", "password"]) form.querySelector(`[name=${name}]`).value = "";
  say(word("saved"));
}

const Input = ({ name, type, facts }) => {
  const kept = name === "webhook" ? facts.webhook : name === "password" && facts.password_set && word("kept");
  const more = ["webhook", "password"].includes(name) ? { placeholder: kept || "", autocomplete: "new-password" } : { value: facts[name] };
  return html`<label class="row dim"><span>${word(name)}</span>${CHOICES[name]
    ? html`<select name=${name} ...${field(RULES)}>${CHOICES[name].map((one) => html`<option key=${one} value=${one} selected=${one === facts[name]}>${word(`is.${one}`)}</option>`)}</select>`
    : html`<input class="wide" type=${type} name=${name} ...${more} ...${field(RULES)} />`}</label>`;
};

const Last = ({ way, last }) => html`<p data-way=${way}>${word(`way.${way}`)} <${Chip} tone=${last.sent ? "go" : "stop"}>${word(last.sent ? "sent" : "failed")}<//> ${forms.date(last.at_s)} ${sentence(last)}</p>`;

export function Notices() {
  const form = useRef(null);
  useEffect(() => void (dx.user?.role === "set_up" && ask("GET", "notices", null, true)), []);
  const { facts } = told;
  if (dx.user?.role !== "set_up") return html`<p class="dim">${text("why.set_up")}</p>`;
  return html`<${Wrong} text=${told.wrong} />
    ${facts && html`<div class="form" id="notices" ref=${form}>
      <p class="dim">${word("told")}</p>
      <div class="row">${EVENTS.map((name) => html`<label class="row"><input type="checkbox" name=${name} checked=${facts[name]} ...${field(RULES)} /><span>${word(name)}</span></label>`)}</div>
      ${Object.entries(FIELDS).map(([name, type]) => html`<${Input} key=${name} name=${name} type=${type} facts=${facts} />`)}
      <div class="row">
        <${Act} id="notices-save" text=${word("save")} ...${RULES} press=${() => save(form.current)} />
        <${Act} id="notices-test" text=${word("test")} ...${RULES} given=${Boolean(facts.webhook || facts.host)} why="notices.none" press=${() => ask("POST", "notices/test")} />
        <${Act} id="notices-off" text=${word("off_webhook")} ...${RULES} given=${Boolean(facts.webhook)} why="notices.none" press=${() => ask("PATCH", "notices", { webhook: "" })} />
      </div>
      ${Object.entries(facts.last).map(([way, last]) => html`<${Last} key=${way} way=${way} last=${last} />`)}
    </div>`}`;
}
