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
import alarms from "./views/alarms.js";
import drives from "./views/drives.js";
import jog from "./views/jog.js";
import programs from "./views/programs.js";
import run from "./views/run.js";
import runs from "./views/runs.js";
import scene from "./views/scene.js";
import scope from "./views/scope.js";
import setup from "./views/setup.js";

const VIEWS = [run, scene, programs, jog, setup, drives, scope, alarms, runs];

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

const made_of = ({ axes, buses, spindle, inputs, outputs, retract_mm, period_s }) =>
  JSON.stringify([axes, buses, spindle, inputs, outputs, retract_mm, period_s]);

async function facts() {
  const said = await call("GET", "facts?last=true", null, true);
  if (!said.ok) return;
  if (dx.facts.axes && made_of(said.body) !== made_of(dx.facts)) location.reload();
  dx.facts = said.body;
  changed();
}
dx.on("service", (told) => told.answers && facts());

const wanted = () => VIEWS.find(({ name }) => name === location.hash.slice(1))?.name ?? VIEWS[0].name;
window.addEventListener("hashchange", () => show(wanted()));

async function begin() {
  const [, session] = await Promise.all([learn(dx.language), call("GET", "session", null, true), facts()]);
  dx.user = session.ok ? session.body : null;
  document.body.replaceChildren();
  dx.draw = draw; // not before there are words
  show(wanted());
  listen();
}
begin().catch(() => setTimeout(() => location.reload(), 1000)); // the panel went away meanwhile
