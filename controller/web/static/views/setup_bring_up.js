// Bring-up: a new machine step by step. What a step does, and what came of it, the panel says; here it is begun.
import { API, call, every } from "../api.js";
import { ask_for } from "../dialog.js";
import { html, useState } from "../dom.js";
import { forms } from "../forms.js";
import { Act, Chip, Select } from "../parts.js";
import { dx } from "../store.js";
import { sentence, word as text } from "../texts.js";
import { number } from "./setup_tables.js";

const word = (key, ...values) => text(`bring_up.${key}`, ...values);
const TONES = { good: "go", bad: "stop", skipped: "hold" };
const told = { steps: [], at: "", wrong: "", part: "", programs: [] };
const look = every("setup", 1, "bring-up", take, (wrong) => (told.wrong = wrong));
every("setup", 5, "programs?brief=true", (body) => (told.programs = body.programs.map(({ name }) => name)));

const open_step = () => told.steps.find(({ verdict }) => verdict === null);

// The step that is shown: that under way, else the chosen one, else the first that is open.
function take(body) {
  Object.assign(told, body);
  if (body.under_way) told.at = body.under_way;
  if (!told.steps.some(({ step }) => step === told.at)) told.at = open_step()?.step ?? told.steps[0]?.step ?? "";
}

async function asked(path, body) {
  await call("POST", `bring-up/${path}`, body);
  await look();
}

const choose = (step) => (Object.assign(told, { at: step }), dx.draw());

function next() {
  const from = told.steps.findIndex(({ step }) => step === told.at);
  const found = [...told.steps.slice(from + 1), ...told.steps].find(({ verdict }) => verdict === null);
  if (found) choose(found.step);
}

async function skip(step) {
  const reason = await ask_for(word("skip_ask", sentence(step.title)), "bring_up.skip", "", { maxlength: 200 });
  if (reason) await asked(`${step.step}/skip`, { reason });
}

const Verdict = ({ row: { verdict, older, step } }) =>
  step === told.under_way ? html`<${Chip} tone="hold">${word("under_way")}<//>` : html`<${Chip} tone=${TONES[verdict]}>${word(verdict ?? "open")}${older ? `, ${word("older")}` : ""}<//>`;

const Entry = ({ row }) => html`<li><button type="button" class="step" data-step=${row.step} aria-current=${row.step === told.at ? "step" : undefined} onclick=${() => choose(row.step)}>
  <span>${sentence(row.title)}</span><${Verdict} row=${row} /></button></li>`;

// What the step under way asks for: a figure, a yes, something by hand.
function Question({ question: { number: of, question: kind, text: asks } }) {
  const [typed, type] = useState("");
  const say = (answer) => asked("answer", { number: of, answer });
  const value = number(typed);
  const set_up = { needs: "set_up" };
  return html`<div class="asks" role="group" aria-live="polite" data-question=${kind}><p class="strong">${sentence(asks)}</p>
    <div class="row">
      ${kind === "value" && html`<input name="gauge" inputmode="decimal" aria-label=${sentence(asks)} value=${typed} oninput=${(event) => type(event.target.value)} onkeydown=${(event) => event.key === "Enter" && Number.isFinite(value) && say(value)} />
        <${Act} id="step-value" text=${word("enter")} kind="go" ...${set_up} given=${Number.isFinite(value)} why="bring_up.no_number" press=${() => say(value)} />`}
      ${kind === "confirm" && html`<${Act} id="step-yes" text=${text("frame.yes")} kind="go" ...${set_up} press=${() => say(true)} /><${Act} id="step-no" text=${word("not_so")} ...${set_up} press=${() => say(false)} />`}
      ${kind === "hand" && html`<${Act} id="step-done" text=${word("done")} kind="go" ...${set_up} press=${() => say(true)} />`}
      ${kind === "watch" && html`<span class="dim">${word("watches")}</span><${Act} id="step-none" text=${word("none_there")} ...${set_up} press=${() => say(true)} />`}
      <${Act} id="step-leave" text=${word("leave")} ...${set_up} press=${() => say(null)} /></div></div>`;
}

const Found = ({ row: { figures = [], findings = [], proposals = [], at_s, not_done } }) => html`
  ${not_done && html`<p id="step-not-done" class="wrong">${sentence(not_done)}</p>`}
  ${at_s && html`<p class="dim">${forms.moment(at_s)}</p>`}
  ${findings.length > 0 && html`<ul class="findings">${findings.map((one, i) => html`<li key=${i}>${sentence(one)}</li>`)}</ul>`}
  ${figures.length > 0 && html`<ul class="dim">${figures.map((one, i) => html`<li key=${i}>${sentence(one)}</li>`)}</ul>`}
  ${proposals.map((one) => html`<p key=${one.key}><code>[${one.axis}] ${one.key} = ${String(one.new)}</code> <span class="dim">${word("in_place_of", String(one.old))} ${sentence(one.why)}</span></p>`)}`;

function Step({ row }) {
  const own = row.step === told.under_way;
  const free = !told.under_way;
  const part = row.kind === "dry_run";
  const begin = () => asked(row.step, { part: part ? told.part : "" });
  return html`<article class="step-shown" data-shown-step=${row.step}>
    <h3>${sentence(row.title)} <${Verdict} row=${row} /></h3>
    <dl class="facts"><dt>${word("does")}</dt><dd>${sentence(row.do)}</dd><dt>${word("look")}</dt><dd>${sentence(row.look)}</dd></dl>
    ${part && html`<label>${text("measure.program")} <${Select} name="part" options=${["", ...told.programs]} text=${(one) => one || "–"} value=${told.part} choose=${(one) => ((told.part = one), dx.draw())} /></label>`}
    ${own && (told.question ? html`<${Question} key=${told.question.number} question=${told.question} />` : html`<p role="status" class="asks">${word("works")}</p>`)}
    ${!own && html`<div class="row">
      <${Act} id="step-begin" text=${word(row.verdict ? "again" : "begin")} kind="go" icon="play" ask=${word(row.moves ? "moves_ask" : "begin_ask", sentence(row.title))} given=${free && (!part || told.part !== "") && dx.user?.role === "set_up"} why=${dx.user?.role !== "set_up" ? "why.set_up" : free ? "bring_up.no_part" : "bring_up.busy"} press=${begin} />
      <${Act} id="step-skip" text=${word("skip")} needs="set_up" given=${free} why="bring_up.busy" press=${() => skip(row)} />
      <${Act} id="step-next" text=${word("next")} needs="" given=${free && Boolean(open_step())} why=${free ? "bring_up.all_done" : "bring_up.busy"} press=${next} /></div>`}
    <${Found} row=${row} /></article>`;
}

export function BringUp() {
  const row = told.steps.find(({ step }) => step === told.at);
  if (!row) return html`<p class=${told.wrong ? "wrong" : "dim"}>${told.wrong || word("works")}</p>`;
  return html`<div class="row spread"><p>${sentence(told.summary)}</p><a id="bring-up-report" href=${`${API}bring-up/report.html`} target="_blank">${word("report")}</a></div>
    <div class="bring-up"><ol class="steps">${told.steps.map((one) => html`<${Entry} key=${one.step} row=${one} />`)}</ol><${Step} key=${row.step} row=${row} /></div>
    <p class="dim">${word("kept", told.folder)}</p>`;
}
