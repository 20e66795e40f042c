// The tool changer: which tool is where, and the dialogue after a change that was interrupted.
import { call } from "../api.js";
import { ask } from "../dialog.js";
import { html } from "../dom.js";
import { Act, AxisName, Chip, Table, asked } from "../parts.js";
import { dx } from "../store.js";
import { sentence, word as text } from "../texts.js";

const word = (key, ...values) => text(`changer.${key}`, ...values);
const typed = (question, start) => ask(question, "setup.set", { inputmode: "numeric" }, start);

const named = (tool) => (tool === null ? word("unknown") : tool ? `T${tool}` : word("empty"));

async function whole(question, start) {
  const given = (await typed(question, String(start ?? ""))) || "";
  return /^\d+$/.test(given.trim()) ? Number(given) : null;
}

export async function confirm(found) {
  const spindle = await whole(word("spindle_ask"), found.spindle);
  if (spindle === null) return;
  const given = await typed(word("away_ask"), found.away.join(" "));
  if (given === null || given === false) return;
  const away = (given.match(/\d+/g) ?? []).map(Number);
  const out = away.map(named).join(", ") || word("no_tool");
  if (await asked(word("clear_ask", spindle ? named(spindle) : word("no_tool"), out))) await call("POST", "changer/confirm", { spindle, away, clear: true });
}

async function give(pocket, tool) {
  const number = await whole(word("pocket_ask", pocket), tool ?? 0);
  if (number !== null) await call("PUT", `changer/pockets/${pocket}`, { tool: number });
}

const place = (here) => word(here === null ? "unknown" : here ? "here" : "gone");

function Pocket({ row: { pocket, tool, here } }) {
  return html`<tr data-pocket=${pocket}><th scope="row">${pocket}</th>
    <td>${tool ? html`<${AxisName} name=${`T${tool}`} />` : "–"}</td>
    <td>${tool ? html`<${Chip} tone=${here ? "go" : "hold"}>${place(here)}<//>` : ""}</td>
    <td><${Act} icon="edit" title=${word("pocket_ask", pocket)} aria-label=${word("pocket_ask", pocket)} press=${() => give(pocket, tool)} /></td></tr>`;
}

export function Changer() {
  const found = dx.status?.changer;
  if (!found) return html`<p class="dim">${word("by_hand")}</p>`;
  return html`${found.doubt && html`<p id="changer-doubt" class="wrong">${sentence(found.doubt)}</p>`}
    <p>${word("spindle")}: <span id="changer-spindle">${named(found.spindle)}</span>
      ${found.step && html` · ${word("step")} ${found.step.step + 1}: ${found.step.name}`}
      ${found.preparing && html` · ${word("preparing", `T${found.preparing.tool}`)}: ${found.preparing.name}`}
      ${found.ready > 0 && html` · ${word("ready", `T${found.ready}`)}`}</p>
    <div class="row"><${Act} id="changer-confirm" text=${word("confirm")} press=${() => confirm(found)} /></div>
    <${Table} word=${word} columns=${["pocket", "tool", "place", ""]} body="changer-pockets">${found.pockets.map((row) => html`<${Pocket} key=${row.pocket} row=${row} />`)}<//>`;
}
