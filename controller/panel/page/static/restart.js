// What was interrupted, offered where one would go on; and what is in force where a program begins in its middle.
import { every } from "./api.js";
import { html } from "./dom.js";
import { forms } from "./forms.js";
import { Act } from "./parts.js";
import { dx } from "./store.js";
import { sentence, word } from "./texts.js";

let told = null;
const looks = ["programs", "run"].map((view) => every(view, 3, "restart", (body) => (told = body)));
dx.on("job", () => looks.forEach((look) => look()));

export function Offer() {
  const shown = told?.name && !dx.status?.job;
  if (!shown) return null;
  const at = [told.name, told.line ?? "–", Math.round((told.fraction ?? 0) * 100), forms.date(told.interrupted_s)];
  return html`<div class="offer">
    <p class="strong">${word("programs.offer", ...at)}</p>
    ${told.offered
      ? html`<${Act} text=${word("programs.go_on")} kind="go" call="POST job" body=${{ program: told.program, restart: true }} modes="OFF READY" />`
      : html`<p class="dim">${word("programs.not_offered")} ${sentence(told)}</p>`}
  </div>`;
}

export function StateThere() {
  const { job } = dx.status ?? {};
  const rows = (job?.state === "loaded" && ((dx.language === "de" && job.restart_de) || job.restart)) || [];
  return rows.length > 0 && html`<div class="restart"><h2>${word("programs.state_there")}</h2><ul>${rows.map((row) => html`<li>${row}</li>`)}</ul></div>`;
}
