// Asking the panel: by the same routes as any script.
import { dx } from "./store.js";
import { ask, ask_for, say } from "./dialog.js";
import { sentence, word } from "./texts.js";

export const API = "/api/v1/";
export const ticked = (status) => typeof status?.tick?.number === "number";

// With the tick that was seen: a panel that hung must not do later what was pressed before.
export const headers = () => ({
  ...(ticked(dx.status) ? { "X-Seen-Tick": String(dx.status.tick.number) } : {}),
  ...(dx.user?.csrf ? { "X-CSRF-Token": dx.user.csrf } : {}),
  ...(dx.token ? { "X-Control-Token": dx.token } : {}),
});

// { ok, status, body }; a refusal is said, unless ``quiet``. ``path`` as ``programs/part.ngc``.
export async function call(method, path, body, quiet = false) {
  const json = body !== undefined && body !== null;
  let said = { ok: false, status: 0, body: {} };
  try {
    const answer = await fetch(path.startsWith("/") ? path : API + path, {
      method,
      keepalive: true,
      headers: { ...headers(), ...(json ? { "Content-Type": "application/json" } : {}) },
      body: json ? JSON.stringify(body) : undefined,
    });
    said = { ok: answer.ok, status: answer.status, body: await answer.json().catch(() => ({})) };
  } catch {
    said.body = { error: { sentence: word("frame.no_panel") } };
  }
  if (said.status === 401) location.assign("/login");
  if (!said.ok && said.body.error?.code === "confirm" && path !== CONFIRM && (await password_again())) return call(method, path, body, quiet);
  const more = quiet || said.ok ? undefined : CONFIRMED[said.body.error?.code];
  if (more) return (await confirmed(said.body.error)) ? call(method, path, { ...body, ...more }) : said;
  if (!said.ok) refused(said, quiet);
  return said;
}

// A run that cannot be kept, or cuts with a worn tool, and a typed line that moves something, start only where
// somebody says so: by the code of the refusal what is asked with then.
const CONFIRMED = { unrecorded: { unrecorded: true }, worn: { worn: true }, moves: { still: false } };
const confirmed = (facts) => ask(`${sentence(facts)} ${word(`run.${facts.code}_ask`)}`);

// What is changed of users and tokens asks for the password again, once in a while.
const CONFIRM = "session/confirm";
async function password_again() {
  const password = await ask_for(word("users.confirm_ask"), "users.confirm", "", { type: "password", autocomplete: "current-password", maxlength: 200 });
  return password !== null && (await call("POST", CONFIRM, { password })).ok;
}

function refused(said, quiet) {
  const facts = said.body.error ?? {};
  if (facts.code === "control" && dx.token) dx.tell("lost", null);
  if (!quiet) say(sentence(facts) || `${said.status}`, "warn");
}

// Ask for a path again and again while one of the views is shown, and when programs or the job change; fn gets
// the body of each answer, ``wrong`` the sentence of one that is none. Gives what looks at once.
export function every(views, seconds, path, fn, wrong = (_sentence) => {}) {
  let busy = false;
  const look = async () => {
    if (!views.split(" ").some(dx.shown) || busy || document.hidden) return;
    busy = true;
    try {
      const said = await call("GET", typeof path === "function" ? path() : path, null, true);
      wrong(said.ok ? "" : sentence(said.body.error));
      if (said.ok) fn(said.body);
      dx.draw();
    } finally {
      busy = false;
    }
  };
  for (const topic of ["view", "programs", "job"]) dx.on(topic, look);
  setInterval(look, seconds * 1000);
  return look;
}

// A history, the newest first. All that is listed is asked for anew at each look, so that old entries are
// up to date, too. { rows, more, wrong, look, anew, older }.
const PAGE = 50;
const MOST = 1000; // that the routes tell at once
export function history(view, seconds, path, rows) {
  const told = { rows: [], more: false, wrong: "", wanted: PAGE };
  const take = (body) => Object.assign(told, { rows: rows(body), more: body.before !== null && told.wanted < MOST });
  told.look = every(view, seconds, () => path(told.wanted), take, (wrong) => (told.wrong = wrong));
  const list = (most) => {
    told.wanted = Math.min(MOST, most);
    told.look();
  };
  told.older = () => list(told.wanted + PAGE);
  told.anew = () => list(PAGE);
  return told;
}
