// Moving by hand: jog with a dead-man, steps, and lines of program typed in.
import { call } from "../api.js";
import { RULES, chosen, end, full, held } from "../dead_man.js";
import { ask } from "../dialog.js";
import { html, useRef, useState } from "../dom.js";
import { forms } from "../forms.js";
import { Guide } from "../guide.js";
import { ByHand } from "../peripherals.js";
import { Act, AxisName, Card, Choice, Codes, Figure, reason } from "../parts.js";
import { dx, keep, kept } from "../store.js";
import { word as text } from "../texts.js";
import { ScenePlace } from "./scene.js";

const word = (key, ...values) => text(`jog.${key}`, ...values);
const FRAMES = ["joint", "part", "tool"];
const STEPS = ["0", "0.001", "0.01", "0.1", "1", "10"];

const View = () => html`<div class="jog"><${Jog} /><div class="column"><${Card} class="jog-scene"><${ScenePlace} view="jog" /><//><${Mdi} /><${ByHand} /></div></div>`;
export default { name: "jog", View };

function choose(name, value) {
  end();
  chosen[name] = value;
  dx.draw();
}

function Jog() {
  const frames = FRAMES.map((frame) => [frame, word(frame)]);
  const steps = STEPS.map((step) => [step, step === "0" ? word("continuous") : step]);
  return html`<${Card} title=${word("title")} class="jog-card">
    <div class="row jog-choices">
      <${Choice} label=${word("frame")} name="frame" values=${frames} chosen=${chosen.frame} choose=${(value) => choose("frame", value)} />
      <${Choice} label=${word("step")} name="step" values=${steps} chosen=${chosen.step} choose=${(value) => choose("step", value)} />
      <${Speed} /><${Keyboard} />
    </div>
    <div class="jog-pads" id="jog-axes"><${Cross} />${(dx.facts.axes ?? []).filter(moves).filter(({ name }) => !CROSS.includes(name)).map(({ name }) => html`<${Column} key=${name} name=${name} />`)}</div>
    <div class="jog-figures">${(dx.facts.axes ?? []).map(({ name, unit }) => html`<div key=${name}><${AxisName} name=${name} /><${Figure} class="big">${forms[unit](dx.status?.joints?.[name]?.work)}<//></div>`)}</div>
    <p class="dim">${word("hint")}</p>
  <//>`;
}

// Rotaries have no direction in the part, nor in the tool's frame.
const moves = (axis) => chosen.frame === "joint" || axis.kind === "linear";
const CROSS = ["X", "Y"];

// As one looks at the table: X to the right, Y away; the diagonals between them, and the way to zero.
export const Cross = () => html`<div class="jog-cross">
  <${Held} axis="X-Y" sign="-" text="↖" /><${Held} axis="Y" sign="+" /><${Held} axis="X+Y" sign="+" text="↗" />
  <${Held} axis="X" sign="-" /><${Zero} axes=${CROSS} /><${Held} axis="X" sign="+" />
  <${Held} axis="X+Y" sign="-" text="↙" /><${Held} axis="Y" sign="-" /><${Held} axis="X-Y" sign="+" text="↘" />
</div>`;
const Column = ({ name }) => html`<div class="jog-column"><${Held} axis=${name} sign="+" /><${Zero} axes=${[name]} /><${Held} axis=${name} sign="-" /></div>`;

function Held({ axis, sign, text }) {
  const off = reason(RULES);
  const [one, way, other] = axis;
  const words = { "+": word("plus"), "-": word("minus") };
  const second = way && (way === sign ? "+" : "-");
  const label = [`${one} ${words[sign]}`, ...(other ? [`${other} ${words[second]}`] : [])].join(", ");
  return html`<button class="jog-button" type="button" data-jog=${axis} data-sign=${sign} aria-label=${label} title=${off || undefined}
    aria-disabled=${off ? "true" : undefined} data-down=${held(axis, sign === "+" ? 1 : -1) ? "1" : undefined}>${text ?? `${axis}${sign === "-" ? "−" : "+"}`}</button>`;
}

// Lines by hand, so that they are checked as any; distance mode and G16 stay as they were.
function Zero({ axes }) {
  const place = axes.map((axis) => `${axis}0`).join(" ");
  const on = (code) => dx.status?.codes?.includes(code);
  const [cartesian, again] = [on("G16") ? "G15 " : "", `${on("G16") ? "\nG16" : ""}${on("G91") ? "\nG91" : ""}`];
  return html`<${Act} class="jog-zero" text=${place} title=${word("go_to", place)} aria-label=${word("go_to", place)} data-zero=${axes.join("")} command="mdi" modes="READY" ask=${word("go_ask", place, dx.status?.work_offset ?? "")}
    press=${() => call("POST", "mdi", { text: `G90 ${cartesian}G0 ${place}${again}` })} />`;
}

// What is chosen of the speed that every axis may have; rotaries have their own.
function Speed() {
  const percent = Math.round(chosen.speed * 100);
  const drag = (event) => {
    chosen.speed = event.target.valueAsNumber / 100;
    dx.draw();
  };
  const shown = [[true, "mm/min"], [false, "°/min"]].filter(([linear]) => Number.isFinite(full(linear))).map(([linear, unit]) => `${Math.round(chosen.speed * full(linear))} ${unit}`);
  return html`<label class="jog-speed">
    <span class="dim">${word("speed")}</span>
    <input class="slider" type="range" id="jog-speed" min="1" max="100" value=${percent} aria-valuetext=${shown.join(", ")} oninput=${drag} />
    <span class="figures" id="jog-speed-shown">${shown.join(", ")}</span>
  </label>`;
}

function Keyboard() {
  async function turn() {
    chosen.keyboard = !chosen.keyboard && (await ask(word("keyboard_ask")));
    dx.draw();
  }
  return html`<${Act} id="jog-keyboard" text=${word("keyboard")} icon="keyboard" class="toggle" aria-pressed=${String(chosen.keyboard)} press=${turn} />`;
}

// ---- lines of the machine file by name: asked for, refused and run as what is typed is

export function Macros() {
  const { macros = [] } = dx.facts;
  if (!macros.length) return null;
  const may = ({ role }) => (role === "set_up" ? { given: dx.user?.role === "set_up", why: "why.set_up" } : {});
  const lines = (macro) => macro.lines.join("\n");
  return html`<div class="macros" role="group" aria-label=${word("macros")}>${macros.map((macro) => html`<${Act} key=${macro.name} text=${macro.name} data-macro=${macro.name} title=${lines(macro)} command="macro" ...${may(macro)}
    body=${{ still: true }} call=${`POST macros/${encodeURIComponent(macro.name)}`} />`)}</div>`;
}

// ---- MDI, with what was typed before

const MOST = 50;
let history = kept("mdi", []);
let back = -1;

function Mdi() {
  const field = useRef(null);
  const [, again] = useState(0);
  const rules = { command: "mdi" };

  async function run() {
    const typed = field.current.value.trim();
    if (!typed || reason(rules)) return;
    history = [typed, ...history.filter((old) => old !== typed)].slice(0, MOST);
    keep("mdi", history);
    back = -1;
    again((n) => n + 1);
    const said = await call("POST", "mdi", { text: typed, still: true });
    if (said.ok) field.current.value = "";
  }

  function recall(event) {
    const { value, selectionStart } = event.target;
    const above = value.slice(0, selectionStart).includes("\n"); // then the key moves within the text
    if (event.key === "Enter" && !event.shiftKey) {
      event.preventDefault();
      if (!event.repeat) run();
    }
    if (event.key === "ArrowUp" && !above && back < history.length - 1) event.target.value = history[++back];
    if (event.key === "ArrowDown" && back > 0) event.target.value = history[--back];
  }

  const take = (old) => {
    field.current.value = old;
    field.current.focus();
  };
  return html`<${Card} title=${word("mdi")} class="mdi-card">
    <${Guide} />
    <${Codes} />
    <${Macros} />
    <form class="mdi" id="mdi" autocomplete="off" onsubmit=${(event) => event.preventDefault()}>
      <textarea id="mdi-text" rows="2" maxlength="1000" spellcheck=${false} aria-label=${word("mdi")} placeholder="G0 X10." ref=${field} onkeydown=${recall}>
        </textarea>
      <${Act} id="mdi-run" text=${word("run")} kind="go" icon="play" ...${rules} press=${run} />
    </form>
    <h2>${word("history")}</h2>
    <div class="mdi-history scroll" id="mdi-history" tabindex="0">${history.map((old) => html`<button key=${old} type="button" onclick=${() => take(old)}>${old}</button>`)}</div>
  <//>`;
}
