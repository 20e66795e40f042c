// Stop, hold and emergency stop: at the press, not at its end, and whatever lies over the page.
import { call } from "./api.js";
import { say } from "./dialog.js";
import { asked, no_stop, reason } from "./parts.js";
import { start_question } from "./restart.js";
import { dx } from "./store.js";
import { word } from "./texts.js";

const AT_REST = ["OFF", "READY", "JOG", "STOPPING"]; // then a stop that is refused is nobody's mistake
const CONFIRMED_MS = 500;

// A stop that may not have come through is said at once, with what to press instead.
async function sent(request) {
  const not_sent = () => say(word("frame.not_sent"), "warn", true);
  const late = dx.silent ? (not_sent(), 0) : setTimeout(not_sent, CONFIRMED_MS);
  const said = await request;
  clearTimeout(late);
  if (said.status === 0) not_sent();
  else if (dx.notice?.sentence === word("frame.not_sent")) say(said.ok ? word("frame.sent_late") : "", "info");
  return said;
}

export function stop() {
  dx.tell("stop", null);
  call("POST", "jog/stop", {}, true);
  return sent(call("POST", "cycle/stop", null, AT_REST.includes(dx.status?.mode) || dx.silent));
}

export function estop() {
  dx.tell("stop", null);
  return sent(call("POST", "machine/estop", null, dx.silent));
}

export function hold() {
  dx.tell("stop", null);
  return sent(call("POST", "cycle/hold", null, dx.silent));
}

// From who may only look none is taken: it is said at the press, and not by the machine after it.
const allowed = (work) => () => {
  const why = no_stop();
  return why ? say(why, "warn") : work();
};

function at_once(id, work) {
  document.addEventListener("pointerdown", (event) => event.target.closest?.(id) && work(), true);
  const press = (event) => ["Enter", " "].includes(event.key) && !event.repeat && event.target.closest?.(id) && work();
  document.addEventListener("keydown", press, true);
}
at_once("#dx-stop", allowed(stop));
at_once("#dx-estop", allowed(estop));
at_once("#dx-hold", allowed(hold));

// The keys that stand on the buttons.
const CYCLE = { F4: { path: "start", question: start_question }, F6: { path: "resume" } };
const KEYS = { F8: allowed(hold), F9: allowed(stop) };

async function cycle({ path, question }) {
  const why = reason({ command: path, takes: Boolean(question) });
  if (why) return say(why);
  if (!question || (await asked(question()))) call("POST", `cycle/${path}`);
}

document.addEventListener(
  "keydown",
  (event) => {
    if (!(event.key in KEYS || event.key in CYCLE) || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    if (event.repeat) return;
    if (KEYS[event.key]) KEYS[event.key]();
    else cycle(CYCLE[event.key]);
  },
  true,
);
