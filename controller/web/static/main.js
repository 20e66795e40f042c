// The page: it learns what it needs, draws what the store has, and hears the machine.
import { call, headers } from "./api.js";
import * as control from "./control.js";
import { ask, ask_for, say } from "./dialog.js";
import { html, render } from "./dom.js";
import { forms } from "./forms.js";
import { Page, show } from "./frame.js";
import { listen } from "./live.js";
import { estop, hold, stop } from "./stops.js";
import { changed, dx } from "./store.js";
import { learn, word } from "./texts.js";
import run from "./views/run.js";

// Run is there at once; the others come behind the first figures, or before them where one of them is asked for.
const VIEWS = [run, ...["scene", "programs", "jog", "setup", "drives", "scope", "alarms", "runs"].map((name) => ({ name }))];
const load = async (view) => Object.assign(view, (await import(`./views/${view.name}.js`)).default);

// What whoever stands before the page's console, and its tests, may ask.
window.dx = Object.assign(dx, { call, headers, ask, ask_for, say, stop, hold, estop, show, word, forms, take: control.take, give: control.give });

function draw() {
  marks(document.body.dataset);
  render(html`<${Page} views=${VIEWS} />`, document.body);
}

// What colours hang on, wherever they are.
function marks(body) {
  const { status } = dx;
  const flag = (on) => (on ? "1" : "");
  const now = {
    ...{ mode: status?.mode ?? "OFF", stale: flag(dx.stale), role: dx.user?.role ?? "" },
    ...{ fault: flag(status?.fault), barred: flag(status?.shown.interlock), failed: flag(status?.shown.failed) },
    control: dx.holds() ? "mine" : dx.holder ? "other" : "free",
  };
  for (const [name, value] of Object.entries(now)) if (body[name] !== value) body[name] = value;
}

// A field that is off gets no click: a press on it says why, as a button's does.
document.addEventListener("pointerdown", (event) => {
  const off = event.target.closest?.(":disabled[title]");
  if (off) say(off.title);
}, true);

// ---- the machine file can be another one when its service comes back: then the page is made anew

/** @param {Record<string, any>} facts */
const made_of = ({ axes, buses, spindle, inputs, outputs, retract_mm, period_s }) =>
  JSON.stringify([axes, buses, spindle, inputs, outputs, retract_mm, period_s]);

async function facts() {
  const said = await call("GET", "facts?last=true", null, true);
  if (!said.ok) return;
  if (dx.facts.axes && made_of(said.body) !== made_of(dx.facts)) location.reload();
  dx.facts = said.body;
  changed();
}
async function commands() {
  const said = await call("GET", "commands", null, true);
  if (said.ok) dx.commands = Object.fromEntries(said.body.commands.map((one) => [one.name, one]));
}
dx.on("service", (told) => told.answers && facts());

const wanted = () => VIEWS.find(({ name }) => name === location.hash.slice(1)) ?? run;
window.addEventListener("hashchange", () => show(wanted().name));

async function begin() {
  const first = wanted();
  const [, session] = await Promise.all([learn(dx.language), call("GET", "session", null, true), facts(), commands(), load(first)]);
  dx.user = session.ok ? session.body : null;
  document.body.replaceChildren();
  dx.draw = draw; // not before there are words
  show(first.name);
  listen();
  let off = () => {};
  await new Promise((go) => ((off = dx.on("status", go)), setTimeout(go, 1000))); // where there is no service none comes
  off();
  await Promise.all(VIEWS.map(load));
  dx.all_views = true;
  if (!dx.shown(first.name)) dx.tell("view", dx.view); // to the one that has come meanwhile
  dx.draw();
}
const anew = () => setTimeout(() => fetch("/").then(() => location.reload(), anew), 1000);
begin().catch(anew); // the panel went away meanwhile: loaded before it is back, the browser's own error would stand here
