// Spindle, coolant and clamps by hand, where the machine has them; and the override of the spindle.
import { call } from "./api.js";
import { html, useState } from "./dom.js";
import { forms } from "./forms.js";
import { Act, Card, Figure, field } from "./parts.js";
import { dx } from "./store.js";
import { word } from "./texts.js";

const BOUNDS = [50, 150]; // percent
const RULES = { command: "spindle" };

export function SpindleOverride() {
  if (!dx.facts.spindle?.driven) return null;
  const now = Math.round((dx.status?.spindle?.override ?? 1) * 100);
  const ask = (percent) => call("PUT", "overrides/spindle", { share: Math.min(BOUNDS[1], Math.max(BOUNDS[0], percent)) / 100 });
  const step = (by) => html`<${Act} text=${`${by < 0 ? "−" : "+"}10`} data-spindle=${String(by)} aria-label=${`${word("run.spindle_override")} ${by < 0 ? "−" : "+"}10 %`} press=${() => ask(now + by)} />`;
  return html`<div class="override">
    <span class="dim">${word("run.spindle_override")}</span>
    ${step(-10)}<${Figure} class="override-figure">${forms.percent(dx.status?.spindle?.override)}<//>${step(10)}
    <${Act} text="100 %" data-spindle="100" aria-label=${`${word("run.spindle_override")} 100 %`} press=${() => ask(100)} />
  </div>`;
}

function Spindle({ most }) {
  const [given, give] = useState("1000");
  const { rev_min: told } = dx.status?.spindle ?? {};
  const turn = (sign) => call("PUT", "machine/spindle", { rev_min: sign * Number(given) });
  const label = word("run.spindle_hand");
  const way = (name, sign, sign_text) => html`<${Act} text=${sign_text} data-hand=${name} aria-label=${word(`run.spindle_${name}`)} title=${word(`run.spindle_${name}`)} aria-pressed=${String(sign * (told ?? 0) > 0)}
    ask=${word("run.spindle_ask", given)} ...${RULES} press=${() => turn(sign)} />`;
  return html`<div class="hand spindle-hand">
    <label><span class="dim">${label}</span><input type="number" id="run-spindle" min="0" max=${most} step="any" aria-label=${label} title=${label} value=${given} oninput=${(event) => give(event.target.value)} ...${field(RULES)} /></label>
    ${way("right", 1, "M3")}${way("left", -1, "M4")}
    <${Act} text="M5" data-hand="off" aria-label=${word("run.spindle_off")} title=${word("run.spindle_off")} ...${RULES} press=${() => turn(0)} />
  </div>`;
}

function Coolant({ kinds }) {
  const now = { mist: Boolean(dx.status?.coolant?.mist), flood: Boolean(dx.status?.coolant?.flood) };
  return kinds.map((kind) => html`<${Act} key=${kind} text=${word(`run.${kind}`)} class="toggle" data-hand=${kind} aria-pressed=${String(now[kind])} command="coolant"
    press=${() => call("PUT", "machine/coolant", { ...now, [kind]: !now[kind] })} />`);
}

// An output of a clamp is on while it is open.
function Clamps({ axes }) {
  const is_open = ({ clamp }) => Boolean(dx.status?.outputs?.[clamp]);
  const turned = (axis) => axes.filter((one) => is_open(one) !== (one === axis)).map(({ name }) => name);
  return axes.map((axis) => html`<${Act} key=${axis.name} text=${`${word("run.clamp", axis.name)}: ${word(is_open(axis) ? "run.clamp_open" : "run.clamp_closed")}`} class="toggle" data-hand=${`clamp ${axis.name}`}
    aria-pressed=${String(is_open(axis))} command="clamps" press=${() => call("PUT", "machine/clamps", { open: turned(axis) })} />`);
}

export function ByHand() {
  const { spindle, outputs = [], axes = [] } = dx.facts;
  const kinds = [["mist", "mist"], ["flood", "coolant"]].filter(([, output]) => outputs.includes(output)).map(([kind]) => kind);
  const clamped = axes.filter(({ clamp }) => clamp);
  const others = kinds.length + clamped.length > 0;
  if (!spindle?.driven && !others) return null;
  return html`<${Card} title=${word("jog.peripherals")}>
    ${spindle?.driven && html`<${Spindle} most=${spindle.max_rev_min} />`}
    ${others && html`<div class="hand"><${Coolant} kinds=${kinds} /><${Clamps} axes=${clamped} /></div>`}
  <//>`;
}
