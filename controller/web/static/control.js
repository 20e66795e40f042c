// The control token: of this page, kept over its reload and not copied with a tab.
import { call } from "./api.js";
import { ask, say } from "./dialog.js";
import { changed, dx } from "./store.js";
import { word } from "./texts.js";

const KEPT = "directrix.control";
dx.token = sessionStorage.getItem(KEPT) ?? "";
sessionStorage.removeItem(KEPT);
window.addEventListener("pagehide", () => dx.token && sessionStorage.setItem(KEPT, dx.token));
window.addEventListener("pageshow", () => sessionStorage.removeItem(KEPT));

function hold(token) {
  dx.token = token;
  dx.tell("control", { holder: dx.holder });
  dx.draw();
}

const GONE_S = 15; // a page that holds it is heard of every few seconds
const HEARD_MS = 5000;

export const free = () => !dx.holds() && dx.holder === null;
export const gone = () => !dx.holds() && dx.holder !== null && dx.silent_s > GONE_S;

export async function take() {
  const other = dx.holder !== null && !dx.holds();
  if (other) await look(); // how long nothing was heard of whoever holds it
  const question = gone() ? word("frame.take_gone", dx.holder, Math.round(dx.silent_s)) : word("frame.take_over", dx.holder);
  if (other && !(await ask(question))) return;
  const said = await call("POST", "control", { take_over: other });
  if (!said.ok) return;
  Object.assign(dx, { holder: said.body.holder, silent_s: 0 });
  hold(said.body.token);
  return true;
}

export async function give() {
  const said = await call("DELETE", "control");
  if (said.ok) dx.holder = null;
  hold("");
}

// Who holds it now, and whether it is this page: after a connection was lost, and when it changed.
export async function look() {
  const sent = dx.token;
  const said = await call("GET", "control", null, true);
  if (!said.ok) return;
  Object.assign(dx, { holder: said.body.holder, silent_s: said.body.silent_s ?? 0 });
  if (sent !== dx.token) return changed();
  if (sent && !said.body.mine && dx.holder) say(word("frame.taken", dx.holder), "warn");
  hold(said.body.mine ? sent : "");
}

let asking = 0;
dx.on("heard.control", (data) => {
  dx.holder = data.holder;
  clearTimeout(asking);
  asking = setTimeout(look, 100); // the answer to our own taking may still be on its way
  dx.tell("control", { holder: dx.holder });
  changed();
});
dx.on("lost", () => hold(""));
dx.on("connected", look);
setInterval(() => dx.holder !== null && !document.hidden && look(), HEARD_MS);

// Whoever leaves takes no control along.
export async function log_out() {
  if (dx.holds()) await give();
  const said = await call("DELETE", "session");
  if (said.ok) location.assign("/login");
}
