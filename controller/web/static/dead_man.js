// Jog with a dead-man: moves while a button is held and this page is seen, and not a moment longer.
//
// The machine itself stops 200 ms after the last request; whatever ends a press sends the end at
// once as well. A press has a name, so that a request which comes late cannot begin it again.
import { call } from "./api.js";
import { say } from "./dialog.js";
import { possible, reason } from "./parts.js";
import { changed, dx } from "./store.js";
import { sentence, word } from "./texts.js";

const AGAIN_MS = 70;
export const RULES = { command: "jog" };
export const chosen = { frame: "joint", step: "0", speed: 0.2, keyboard: false };

// mm/min or degrees/min that every axis of the kind may have: all of it, and what is chosen.
const of_kind = (linear) => (dx.facts.axes ?? []).filter(({ kind }) => (kind === "linear") === linear).map(({ velocity }) => velocity);
export const full = (linear) => 60 * (dx.facts.rapid_share ?? 1) * Math.min(...of_kind(linear));
const feed = (axis) => Math.max(0.001, chosen.speed * full(axis.length > 1 || dx.axis(axis).kind === "linear"));
let press = null; // { name, axis, sign, source, timer, asking }
let presses = 0;

// ``source``: the button that is held, or "key".
function begin(axis, sign, source) {
  const why = reason(RULES);
  if (why) return say(why);
  if (press || dx.stale) return;
  const { frame, step } = chosen;
  if (step !== "0") {
    const distance = sign * Number(step) * (axis.length > 1 ? Math.SQRT2 : 1); // each of the two by the step
    return call("POST", "jog/step", { frame, axis, distance, feed: feed(axis) });
  }
  const name = `${Date.now().toString(36)}-${++presses}-${Math.random().toString(36).slice(2, 8)}`;
  press = { name, axis, sign, source, frame, asking: false, timer: setInterval(again, AGAIN_MS) };
  again();
  changed();
}

// One request at a time: those that wait behind a slow one would come all at once. One that comes
// too late moves nothing: the panel knows it by the tick that was seen here.
async function again() {
  const own = press;
  if (!own || own.asking) return;
  own.asking = true;
  const body = { frame: own.frame, axis: own.axis, speed: own.sign, feed: feed(own.axis), press: own.name };
  const said = await call("POST", "jog", body, true);
  own.asking = false;
  if (said.ok || own !== press) return;
  const { error } = said.body;
  if (error?.code !== "late") end();
  say(sentence(error), "warn");
}

export function end(tell = false) {
  if (!press) return;
  clearInterval(press.timer);
  const { name } = press;
  press = null;
  call("POST", "jog/stop", { press: name }, true);
  if (tell) say(word("jog.stopped"));
  changed();
}

export const held = (axis, sign) => press?.axis === axis && press.sign === sign;
const of = ({ dataset }) => [dataset.jog, dataset.sign === "+" ? 1 : -1];

// ---- pointer

document.addEventListener("pointerdown", (event) => {
  const button = event.target.closest?.("[data-jog]");
  if (!button || event.button !== 0) return;
  event.preventDefault();
  // Not captured: a finger that slides off the button has let it go.
  if (button.hasPointerCapture?.(event.pointerId)) button.releasePointerCapture(event.pointerId);
  begin(...of(button), button);
});
const let_go = (event) => {
  if (event.type === "contextmenu" && event.target.closest?.("[data-jog]")) event.preventDefault();
  if (press && press.source !== "key") end();
};
for (const name of ["pointerup", "pointercancel", "contextmenu"]) document.addEventListener(name, let_go, true);
document.addEventListener("pointerout", (event) => {
  if (press && press.source === event.target.closest?.("[data-jog]") && !press.source.contains(event.relatedTarget)) end();
});

// ---- whatever takes the page out of sight or the machine out of reach

window.addEventListener("blur", () => end(true));
document.addEventListener("visibilitychange", () => document.hidden && end());
window.addEventListener("beforeunload", () => end());
window.addEventListener("pagehide", () => end());
document.addEventListener("freeze", () => end());
dx.on("disconnected", () => end());
dx.on("stale", (stale) => stale && end());
dx.on("stop", () => end());
dx.on("control", () => !dx.holds() && end());
dx.on("status", (status) => press && !possible("jog").includes(status.mode) && end());
dx.on("view", (name) => {
  if (name === "jog") return;
  end();
  chosen.keyboard = false;
});

// ---- keyboard: off until it is switched on, and off again with the view

const KEYS = {
  ...{ ArrowLeft: ["X", -1], ArrowRight: ["X", 1], ArrowDown: ["Y", -1], ArrowUp: ["Y", 1] },
  ...{ PageDown: ["Z", -1], PageUp: ["Z", 1] },
};
document.addEventListener("keydown", (event) => {
  const button = event.target.closest?.("[data-jog]");
  const own = button && [" ", "Enter"].includes(event.key);
  if (own) event.preventDefault();
  if (event.repeat || !dx.shown("jog")) return;
  if (own) begin(...of(button), "key");
  else if (chosen.keyboard && KEYS[event.key] && !event.target.closest?.("input, textarea, .dx-ask")) {
    event.preventDefault();
    begin(...KEYS[event.key], "key");
  }
});
window.addEventListener("keyup", () => press?.source === "key" && end(), true);
