// What was interrupted, offered where one would go on; and what is in force where a program begins in its middle.
import { every } from "./api.js";
import { html } from "./dom.js";
import { forms } from "./forms.js";
import { Act } from "./parts.js";
import { dx } from "./store.js";
import { sentence, word } from "./texts.js";

const ENDED = ["stopped", "fault", "interrupted"];
let told = null;
every("programs run", 3, "restart", (body) => (told = body));

export const offer = () => (told?.offered ? told : null);
export const not_offered = () => (told?.name && !told.offered ? sentence(told) : "");

// Nothing else is loaded, and it does not run.
const waits = (job) => !job || (job.sha256 === told.sha256 && ENDED.includes(job.state));

export function Offer() {
  if (!told?.name || !waits(dx.status?.job)) return null;
  const share = (value) => (typeof value === "number" ? (value * 100).toFixed(1) : "–");
  const at = [told.name, told.line ?? "–", share(told.fraction), forms.date(told.interrupted_s)];
  return html`<div class="offer">
    <p class="strong">${told.change ? sentence(told.says) : word("programs.offer", ...at)}</p>
    ${typeof told.done === "number" && html`<p class="offer-left">${word("programs.offer_left", share(told.done), forms.time(told.left_s), told.tool)}</p>`}
    ${told.offered
      ? html`<${Act} text=${word("programs.go_on")} kind="go" call="POST job" body=${{ program: told.program, restart: true }} command="load" />`
      : html`<p class="dim">${word("programs.not_offered")} ${sentence(told)}</p>`}
  </div>`;
}

// A start of an interrupted program from its beginning is asked for by name.
export function start_question() {
  const { job } = dx.status ?? {};
  const over = told?.name && job?.sha256 === told.sha256 && !job.restart?.length;
  const question = over ? word("run.start_over_ask", job.name, told.line ?? "–") : word("run.start_ask");
  return job?.starts ? `${question} ${sentence(job.starts)}` : question;
}

// Start is green where it starts, and says with what; where it would be refused it says what comes before.
export function can_start() {
  const { job, next, can_start: can = true } = dx.status ?? {};
  const loaded = dx.loaded();
  return { kind: can && loaded ? "go" : undefined, given: loaded && can, why: loaded ? sentence(next) : "why.no_program", title: sentence(job?.starts) };
}

export function StateThere() {
  const { job } = dx.status ?? {};
  const rows = (job?.state === "loaded" && job.restart) || [];
  return rows.length > 0 && html`<div class="restart"><h2>${word("programs.state_there")}</h2><ul>${rows.map((row) => html`<li>${sentence(row)}</li>`)}</ul></div>`;
}
