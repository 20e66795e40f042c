// What views are made of: buttons that ask and say why they cannot, cards, chips, figures.
import { API, call } from "./api.js";
import { free, take } from "./control.js";
import { ask, say } from "./dialog.js";
import { html, useRef, useState } from "./dom.js";
import { Icon } from "./icons.js";
import { dx } from "./store.js";
import { word } from "./texts.js";

// Why something cannot be pressed now; "" = it can. The machine refuses by itself, this only says so before.
//   needs: "control", "role" (to operate), "set_up" (that role) or "" (nothing)
//   command: it can be pressed in the modes that the table of commands has for it   modes: or in these, of fewer
//   given, why: what else must hold, and the key of the sentence where it does not
//   takes: what is asked takes control, too, where nobody has it
export function reason({ needs = "control", command = "", modes = possible(command), given = true, why = "", takes = false }) {
  if (needs && dx.silent) return word("why.silent");
  if (needs && dx.user?.role === "view") return word("why.role");
  if (needs === "set_up" && dx.user?.role !== "set_up") return word("why.set_up");
  if (needs === "control" && !dx.holds() && !(takes && free())) return dx.holder ? word("why.other", dx.holder) : word("why.control");
  const mode = dx.status?.mode ?? "OFF";
  const where = typeof modes === "string" ? modes.split(" ") : modes;
  if (where && !where.includes(mode)) return word("why.mode", where.map(in_words).join(", "), in_words(mode));
  if (waits(command)) return word("why.under_way", sequence_text(dx.status.sequence));
  return given ? "" : word(why);
}

// Why a stop is not taken from who asks; "" = it is, as far as is known.
export const no_stop = () => (dx.user?.may_stop === false ? word("why.no_stop") : "");

// The modes in which a command of the machine is possible; null: in every one.
export const possible = (command) => (command ? (dx.commands[command]?.modes ?? []) : null);
const in_words = (mode) => word(`mode.${mode}`);

// Whether a command that takes long has to wait for another one; what is loaded last is what counts.
function waits(command) {
  const { sequence } = dx.status ?? {};
  if (sequence?.state !== "running" || !dx.commands[command]?.one_at_a_time) return false;
  return command !== "load" || sequence.name !== "load";
}

// What is under way, in a word or two.
export const sequence_text = ({ name }) => word(`sequence.${name.replaceAll(" ", "_")}`);

// A button: it asks ``call`` ("POST cycle/hold") with ``body`` when it is pressed, or does ``press``. One that
// is off can still be reached and pressed, and then says why.
export function Act({ text, call: asks, body, press, needs, command, modes, given, why, kind, ask: question, icon, small: _small, keys, children, ...more }) {
  const rules = { needs, command, modes, given, why, takes: Boolean(question) };
  const off = reason(rules);
  async function pressed(event) {
    const now = reason(rules);
    if (now) return say(now);
    if (question && !(await asked(question, needs))) return;
    if (press) return press(event);
    const [method, path] = asks.split(" ");
    await call(method, path, body);
  }
  return html`<button
    type="button" ...${more} class=${`act ${more.class ?? ""}`} data-kind=${kind} data-call=${asks}
    aria-disabled=${off ? "true" : undefined} title=${off || more.title} onclick=${pressed}
  >
    ${icon && html`<${Icon} name=${icon} />`}${(text || children) && html`<span>${text ?? children}</span>`}
    ${keys && html`<kbd>${keys}</kbd>`}
  </button>`;
}

// Whether it is meant; where nobody has control and it needs that, the same yes takes it.
export async function asked(question, needs = "control") {
  const takes = needs === "control" && free();
  if (!(await ask(takes ? `${question} ${word("frame.takes")}` : question))) return false;
  return !takes || take();
}

// Attributes of a field that can be off; a press on one that is says why, see main.js.
export const field = (rules) => {
  const off = reason(rules);
  return off ? { disabled: true, title: off } : {};
};

export const Card = ({ title, children, ...more }) =>
  html`<div ...${more} class=${`card ${more.class ?? ""}`}>${title && html`<h2>${title}</h2>`}${children}</div>`;

export const Chip = ({ tone, children, ...more }) => html`<span ...${more} class="chip" data-tone=${tone}>${children}</span>`;

// A figure that the machine tells: it is greyed where it is old.
// What is in force, one code of each group, and T H D F S.
export const Codes = () => dx.status?.codes?.length > 0 && html`<div class="codes" role="group" aria-label=${word("run.codes")}>${dx.status.codes.map((code) => html`<${Chip} key=${code}>${code}<//>`)}</div>`;
export const Figure = ({ tag = "span", children, ...more }) =>
  html`<${tag} ...${more} class=${`figures ${more.class ?? ""}`}>${children}<//>`;

// As long as a share, 0 to 1.
export const Bar = ({ share, ...more }) =>
  html`<div ...${more} class=${`bar ${more.class ?? ""}`} style=${{ "--share": typeof share === "number" ? Math.min(1, Math.max(0, share)) : 0 }}></div>`;

// Of such a length, with a mark at the most that is allowed.
export const Meter = ({ label, share, most = 1, tone }) =>
  html`<div class="meter" data-tone=${tone} role="img" aria-label=${label} style=${{ "--share": Math.min(1, share ?? 0), "--most": most }}></div>`;

// Choices of which one holds.
export const Choice = ({ label, name, values, chosen, choose }) =>
  html`<div class="choice" role="group" aria-label=${label}>
    <span class="dim">${label}</span>
    ${values.map(([value, text]) => html`<button key=${value} class="act" type="button" data-choice=${name} data-value=${value} aria-pressed=${String(value === chosen)} onclick=${() => choose(value)}>
      <span>${text}</span></button>`)}
  </div>`;

// One of some values, each with its text.
export const Select = ({ options, text = (one) => one, value, choose, ...more }) =>
  html`<select ...${more} value=${value} onchange=${(event) => choose(event.target.value)}>${options.map((one) => html`<option key=${one} value=${one} selected=${one === value}>${text(one)}</option>`)}</select>`;

// A value that the service keeps, and what changes it: the one that was chosen last shows at once and until ``ask``
// is done; refused, the service's own shows again.
export function useChosen(value, ask) {
  const [chosen, set] = useState();
  const last = useRef(0);
  const choose = async (wanted) => {
    const own = ++last.current;
    set(wanted);
    try {
      await ask(wanted);
    } finally {
      if (own === last.current) set(undefined);
    }
  };
  return [chosen ?? value, choose];
}

// A value that is asked for: one of ``choices``, or typed.
export const Typed = ({ label, unit, name, choices, text, value, set }) =>
  html`<label>${label}${unit && `, ${unit}`} ${choices?.length ? html`<${Select} name=${name} options=${choices} text=${text} value=${value} choose=${set} />` : html`<input name=${name} inputmode=${choices ? undefined : "decimal"} value=${value} oninput=${(event) => set(event.target.value)} />`}</label>`;

// Terms and what they are; rows whose value is not known are left out.
export const Facts = ({ rows, ...more }) =>
  html`<dl ...${more} class=${`facts ${more.class ?? ""}`}>
    ${rows.filter(([, value]) => value !== undefined && value !== null && value !== "").map(([term, value]) => html`<dt>${term}</dt>
      <dd class="figures">${value}</dd>`)}
  </dl>`;

// Rows under a head; of a column the key of its text and then its classes, "" = it has no text. ``body``: the rows' id.
export const Table = ({ word, columns, body, children, ...more }) => html`<table ...${more} class=${`list ${more.class ?? ""}`}>
  <thead><tr>${columns.map((column) => {
    const [key, ...classes] = column.split(" ");
    return key ? html`<th scope="col" class=${classes.join(" ")}>${word(key)}</th>` : html`<td></td>`;
  })}</tr></thead><tbody id=${body}>${children}</tbody></table>`;
export const ScrolledTable = (props) => html`<div class="scroll" tabindex="0"><${Table} ...${props} /></div>`;

// A file of this computer's, as text: ``take(text, name)``. The same one may be chosen again.
export function TextFile({ text, accept, take, ...rules }) {
  const off = reason(rules);
  const chosen = async ({ target }) => {
    const [file] = target.files;
    const content = file && (await file.text());
    target.value = "";
    if (file) take(content, file.name);
  };
  const why = () => off && say(off); // the label's; that of the field: see main.js
  return html`<label class="act" aria-disabled=${off ? "true" : undefined} title=${off || undefined} onclick=${why}><span>${text}</span><input type="file" accept=${accept} ...${field(rules)} onchange=${chosen} /></label>`;
}

export const Link = ({ text, path, ...more }) => html`<a class="act" href=${`${API}${path}`} download="" ...${more}>${text}</a>`;
export const Wrong = ({ text, ...more }) => text && html`<p class="wrong" role="alert" ...${more}>${text}</p>`;
export const AxisName = ({ name }) => html`<span class="axis-name">${name}</span>`;
