// The frame around every view: what the machine does, what is wrong, who may move it, and the stops.
import { give, gone, log_out, take } from "./control.js";
import { Notice, Question } from "./dialog.js";
import { Component, html } from "./dom.js";
import { forms } from "./forms.js";
import { Icon } from "./icons.js";
import { old } from "./live.js";
import { Act, Bar, Figure, no_stop } from "./parts.js";
import { dx, keep } from "./store.js";
import { known, languages, sentence, word } from "./texts.js";

export function Page({ views }) {
  const built = views.filter(({ name }) => dx.shown(name) || seen.has(name));
  for (const { name } of built) seen.add(name);
  const asked = dx.question;
  return html`
    <div class="shell">
      <header><${Mode} /><${Program} /><${Control} /><${Choices} /><${Stops} away=${Boolean(asked)} /></header>
      <${Lines} />
      <nav aria-label=${word("frame.views")}>
        ${views.map(({ name }) => html`<button key=${name} class="tab" type="button" data-to=${name} aria-current=${dx.shown(name) ? "page" : undefined} onclick=${() => show(name)}>
          <${Icon} name=${name} /><span>${word(`view.${name}`)}</span>
        </button>`)}
      </nav>
      <main class="views">${built.map((view) => html`<${Section} key=${view.name} view=${view} shown=${dx.shown(view.name)} />`)}</main>
      ${!asked && html`<${Notice} />`}
    </div>
    ${asked && html`<${Question} asked=${asked}><${Stops} /><${Notice} /><//>`}
  `;
}
const seen = new Set();

// A view is made when it is first shown, and stands still while another one is.
class Section extends Component {
  shouldComponentUpdate({ shown }) {
    return shown || this.props.shown;
  }

  render({ view: { name, View }, shown }) {
    return html`<section class="view" data-view=${name} data-shown=${shown ? "1" : undefined} aria-label=${word(`view.${name}`)}>
      <h1 class="unseen">${word(`view.${name}`)}</h1>
      ${View && html`<${View} />`}
    </section>`;
  }
}

// All views are in one document, so that changing over takes no time and no server.
export function show(name) {
  if (dx.view === name) return;
  dx.view = name;
  history.replaceState(null, "", `#${name}`);
  dx.draw();
  dx.tell("view", name);
}

// In word and colour, to be read from the other end of the shop.
const Mode = () => html`<div class="mode" role="status" aria-live="polite">
  <${Figure} class="mode-word">${forms.mode(dx.status?.mode)}<//>
  <${Figure} class="mode-more">${dx.status?.shown.under_way}<//>
</div>`;

function Program() {
  const job = dx.status?.job;
  return html`<div class="program">
    <div class="program-line">
      <${Figure} class="program-name">${forms.text(job?.name)}<//>
      <${Figure} class="program-state dim">${job?.state ? word(`state.${job.state}`) : ""}<//>
      <span class="program-left dim"><span>${word("frame.left")} </span><${Figure} class="strong">${forms.time(job?.left_s)}<//></span>
    </div>
    <${Bar} class="program-bar" share=${job?.fraction} />
  </div>`;
}

function Control() {
  const other = gone() ? word("frame.gone", dx.holder, Math.round(dx.silent_s)) : (dx.holder ?? word("frame.free"));
  const whose = dx.holds() ? word("frame.mine") : other;
  return html`<button class="control" id="dx-control" type="button" onclick=${() => (dx.holds() ? give() : take())}>
    <${Icon} name="hand" />
    <span class="control-words"><span class="dim">${word("frame.control")}</span><span class="strong" id="dx-holder">${whose}</span></span>
    <span class="control-act">${word(dx.holds() ? "frame.give" : "frame.take")}</span>
  </button>`;
}

function Choices() {
  const out = `${word("frame.log_out")}: ${dx.user?.name}`;
  const there = languages();
  const other = there[(there.indexOf(dx.language) + 1) % there.length];
  return html`<div class="choices">
    <button class="small" id="dx-language" type="button" title=${word(`language.${other}`)} aria-label=${word(`language.${other}`)} onclick=${() => speak(other)}>${other.toUpperCase()}</button>
    <button class="small" id="dx-theme" type="button" title=${word("frame.theme")} aria-label=${word("frame.theme")} onclick=${theme}>
      <${Icon} name="contrast" /></button>
    ${dx.shown("run") && html`<button class="small" id="dx-unit" type="button" title=${word("frame.unit")} aria-label=${`${word("frame.unit")}: ${forms.units()}`} onclick=${inch}>${forms.units()}</button>`}
    ${dx.user?.csrf && html`<button class="small" id="dx-log-out" type="button" title=${out} aria-label=${out} onclick=${log_out}>
      <span class="user-name">${dx.user.name}</span><${Icon} name="leave" /></button>`}
  </div>`;
}

const remember = (key, value) => (document.cookie = `directrix_${key}=${value}; path=/; max-age=31536000; samesite=strict`);

function speak(language) {
  remember("language", language);
  location.reload();
}

function theme() {
  const root = document.documentElement;
  root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark";
  remember("theme", root.dataset.theme);
  dx.tell("theme", root.dataset.theme);
}

// This browser keeps it.
function inch() {
  dx.inch = !dx.inch;
  keep("inch", dx.inch);
  dx.draw();
}

const KEYS = { hold: "F8", stop: "F9", estop: "" };
// ``away``: they are in the question that is asked, and here is their place.
const Stops = ({ away }) => {
  const off = no_stop();
  return html`<div class="stops" data-away=${away ? "1" : undefined}>${Object.entries(KEYS).map(([name, key]) => html`<button class=${name} id=${away ? undefined : `dx-${name}`} type="button" aria-disabled=${off ? "true" : undefined} title=${off || word(`frame.${name}_title`)}>
    <span>${word(`frame.${name}`)}</span>${key && html`<kbd>${key}</kbd>`}</button>`)}</div>`;
};

// What must not be overlooked: that figures are old; and what is wrong, folded to the first of it.
const WRONG = { fault: ["alarm", "error"], interlock: ["barred", "hand"], warning: ["warning", "error"], failed: ["failed", "info"] };
let unfolded = false;

export function Lines() {
  const shown = dx.status?.shown ?? {};
  const there = Object.keys(WRONG).filter((what) => shown[what] && !(what === "failed" && shown.fault));
  const opens = there.length > 1 || Boolean(shown.fault);
  const open = unfolded && opens;
  const unfold = () => ((unfolded = !unfolded), dx.draw());
  const label = word("frame.messages", there.length);
  const state = (what) => ({ "data-there": there.includes(what) && (open || there[0] === what) ? "1" : undefined });
  const line = (what) => html`<div key=${what} class=${`line ${WRONG[what][0]}`} role="status" ...${state(what)}><${Icon} name=${WRONG[what][1]} /><${Figure}>${shown[what]}<//></div>`;
  return html`<div class="lines">
    <div class="line stale" role="alert"><${Icon} name="no_link" /><strong>${word("frame.stale")}</strong>
      <span id="dx-stale-text" title=${dx.why}>${dx.stale && old()}</span></div>
    <div class="folded" data-unfolded=${open ? "1" : undefined}>
      <div class="wrongs">
        <div class="line alarm" role="alert" ...${state("fault")}><${Icon} name="error" />
          <span class="alarm-words"><${Figure} class="strong">${shown.fault}<//> <${Figure}>${shown.next}<//>
            ${open && html`<span class="remedy">${remedy(dx.status?.fault)}</span>`}</span>
          ${shown.fault && html`<${Act} text=${word("frame.reset")} call="POST machine/reset" command="reset" modes=${null} kind="warn" icon="reset" />`}
        </div>
        ${["interlock", "warning", "failed"].map(line)}
      </div>
      ${opens && html`<button class="act fold" id="dx-messages" type="button" aria-expanded=${String(unfolded)} aria-label=${label} title=${label} onclick=${unfold}><span>${there.length}</span><${Icon} name=${unfolded ? "fold" : "unfold"} /></button>`}
    </div>
  </div>`;
}

// Why it came, and what to do about it; what the alarm itself says is not said twice.
const remedy = (fault) => fault && ["cause", "remedy"].map((what) => known(`alarms.${what}.${fault.name}`, sentence(fault[what])))
  .filter((text) => text && !sentence(fault).includes(text)).join(" ");
