// Alarms: what is wrong now, and the history with who saw it.
import { call, history } from "../api.js";
import { html } from "../dom.js";
import { forms } from "../forms.js";
import { Act, Card, Chip, Link, Wrong } from "../parts.js";
import { dx } from "../store.js";
import { known, sentence, word as text } from "../texts.js";
import { open_scope } from "./scope.js";

const word = (key) => text(`alarms.${key}`);
const said = (name, what, facts) => known(`alarms.${what}.${name}`, sentence(facts[what]));

let only_open = false;
const list = history("alarms", 2, (most) => `alarms?most=${most}&only=${only_open ? "open" : "all"}`, (body) => body.alarms);
dx.on("alarms", list.look);

function switch_open() {
  only_open = !only_open;
  dx.draw();
  list.anew();
}

function View() {
  return html`<div class="looks alarms">
    <${Card} title=${word("now")} class="alarms-present"><div id="alarms-now"><${Now} fault=${dx.status?.fault} /></div><//>
    <${Card} class="alarms-history">
      <div class="row spread">
        <h2>${word("history")}</h2>
        <button class="act" id="alarms-open" type="button" aria-pressed=${String(only_open)} onclick=${switch_open}><span>${word("only_open")}</span></button>
      </div>
      <${Wrong} id="alarms-said" text=${list.wrong} />
      <div id="alarms-list">${list.rows.length ? list.rows.map((alarm) => html`<${Alarm} key=${alarm.id} alarm=${alarm} />`) : html`<p class="dim">${word("none")}</p>`}</div>
      <button class="act" id="alarms-more" type="button" hidden=${!list.more} onclick=${list.older}><span>${word("more")}</span></button>
    <//>
  </div>`;
}
export default { name: "alarms", View };

// The number is the machine's own; the name is the same in every language, as in the fault table.
const Head = ({ number, name, axis, facts, at_s }) => html`<div class="alarm-head">
  ${number > 0 && html`<span class="figures dim">#${number}</span>`}<span class="dim">${name}</span>
  ${axis && html`<${Chip} tone="info">${axis}<//>`}<${Trusted} facts=${facts} />
  ${at_s > 0 && html`<time class="figures dim">${forms.date(at_s)}</time>`}
</div>`;

function Trusted({ facts }) {
  if (typeof facts.position_trusted !== "boolean") return "–";
  return html`<${Chip} tone=${facts.position_trusted ? "go" : "stop"}>${word(facts.position_trusted ? "trusted" : "not_trusted")}<//>`;
}

// What is there now, with its remedy in full.
function Now({ fault }) {
  if (!fault) return html`<p class="dim">${word("quiet")}</p>`;
  return html`<${Head} number=${fault.number} name=${fault.name} axis=${fault.axis} facts=${fault} at_s=${fault.time_s} />
    <p class="alarm-words">${sentence(fault)}</p>
    <dl class="facts">
      ${["cause", "remedy"].map((what) => html`<dt>${word(what)}</dt><dd>${said(fault.name, what, fault) || "–"}</dd>`)}
      <dt>${word("recording")}</dt><dd><${Recording} facts=${fault} /></dd>
    </dl>`;
}

function Alarm({ alarm: { id, name, axis, at_s, facts, acknowledged_s, acknowledged_by, sentence: told } }) {
  const open = acknowledged_s === null;
  const acknowledge = async () => (await call("POST", `alarms/${id}/acknowledge`)).ok && list.look();
  return html`<article class="alarm-card" data-open=${open ? "1" : undefined}>
    <${Head} number=${id} name=${name} axis=${axis} facts=${facts} at_s=${at_s} />
    <p><strong>${told}</strong></p>
    <dl class="facts">
      ${["cause", "remedy"].map((what) => said(name, what, facts) && html`<dt>${word(what)}</dt><dd>${said(name, what, facts)}</dd>`)}
      ${facts.line > 0 && html`<dt>${word("line")}</dt><dd class="figures">${facts.line}</dd>`}
    </dl>
    <div class="row alarm-foot">
      ${open
        ? html`<${Act} text=${word("acknowledge")} aria-label=${`${word("acknowledge")} ${id}`} needs="role" press=${acknowledge} />`
        : html`<span class="dim">${acknowledged_by} · ${forms.date(acknowledged_s)}</span>`}
      ${facts.recording && html`<${Recording} facts=${facts} />`}
    </div>
  </article>`;
}

function Recording({ facts }) {
  const name = facts.recording?.split("/").pop();
  if (!name) return "–";
  const path = `recordings/${encodeURIComponent(name)}`;
  return html`<span class="row">
    <${Act} text=${word("scope")} needs="" press=${() => open_scope(`recording:${name}`)} />
    <${Link} text="trace.npz" path=${`${path}/trace.npz`} /><${Link} text="frames.log" path=${`${path}/frames.log`} />
  </span>`;
}
