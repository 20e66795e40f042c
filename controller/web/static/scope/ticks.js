// What the scope shows, and how it comes: thinned for the width of the screen, each column with its lowest
// and highest tick, so that no spike is lost.
import { call } from "../api.js";
import { changed, dx, kept } from "../store.js";
import { known, sentence } from "../texts.js";

const before = kept("scope", {});
export const state = {
  ...{ source: "now", recordings: [], runs: [] },
  names: Array.isArray(before.names) ? before.names.slice(0, 8) : [],
  seconds: typeof before.seconds === "number" ? before.seconds : 2,
  ...{ running: true, armed: false, freeze: true },
  ...{ first: null, last: null }, // ticks at the ends of the screen
  ...{ trigger: null, trigger_signal: "feed", edge: "rising", level: "0", before: "20", after: null },
  ...{ cursors: [null, null], hand: 0 }, // ticks; which of them the keys lead
  ...{ data: null, units: {}, width: 800, wrong: "" },
};

// The first index whose number is not below the wanted one.
export function lower(numbers, wanted) {
  let [low, high] = [0, numbers.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (numbers[middle] < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
}

// ``X commanded`` in the page's language.
export function shown(name) {
  const [axis, what] = name.includes(".") ? name.split(".") : ["", name];
  return `${axis} ${known(`scope.signal.${what}`, what)}`.trim();
}

const path = (kind, more) => `ticks${kind}?${new URLSearchParams({ source: state.source, ...more })}`;
export const period = () => state.data?.period_s ?? dx.facts.period_s ?? 0.002;
const width_ticks = () => Math.max(2, Math.round(state.seconds / period()));

export const ends = () => {
  const ticks = state.data?.ticks ?? [];
  const first = state.first ?? ticks[0] ?? 0;
  return [first, Math.max(first + 1, state.last ?? ticks.at(-1) ?? first + 1)];
};

// The place where it stands, at the width that is chosen.
export function still_at() {
  [state.first] = ends();
  state.last = state.first + width_ticks();
}

// null where it was refused, and where another source was chosen meanwhile.
async function get(kind, more) {
  const { source } = state;
  const said = await call("GET", path(kind, more), null, true);
  if (source !== state.source) return null;
  state.wrong = said.ok ? "" : sentence(said.body.error);
  return said.ok ? said.body : null;
}

async function signals() {
  const body = await get("/signals", {});
  if (!body) return null;
  state.units = body.signals;
  state.names = state.names.filter((name) => name in body.signals);
  if (!state.names.length) state.names = ["feed", `${Object.keys(body.signals)[0].split(".")[0]}.error`];
  return body;
}

async function fetch_window(first, last) {
  const width = Math.max(200, Math.min(1600, state.width));
  const more = { names: state.names.join(","), most: Math.round(width / 2) };
  if (first !== null) more.first = Math.max(0, first);
  if (last !== null) more.last = last;
  const body = await get("", more);
  if (!body) return;
  if (!Object.keys(body.high).length) body.high = body.low;
  state.data = body;
}

// ---- looking: one at a time, and what was asked for meanwhile is not lost

let busy = false;
let wanted = false; // another picture is asked for, or was while one was on its way

export async function look() {
  if (busy) {
    wanted = true;
    return;
  }
  busy = true;
  const asked = wanted;
  wanted = false; // from here on it stands for what comes while this one is on its way
  try {
    if (!Object.keys(state.units).length && !(await signals())) return;
    if (state.source !== "now") await still(asked);
    else if (state.armed) await hunt();
    else if (state.running) await roll();
    else if (asked) await fetch_window(state.first, state.last);
  } finally {
    busy = false;
    changed();
    if (wanted) setTimeout(look, 0);
  }
}

// Drawn anew with other values; ``asks``: also with other ticks.
export function redraw(values, asks = false) {
  Object.assign(state, values);
  dx.draw();
  if (!asks) return;
  wanted = true;
  look();
}

async function roll() {
  const span = state.data ? null : await get("/signals", {});
  if (state.source !== "now") return;
  const newest = span?.newest ?? state.data?.newest ?? null;
  // The newest tick is known from the last answer; what came since is in this one.
  state.first = newest === null ? null : newest - width_ticks();
  state.last = null;
  await fetch_window(state.first, null);
  if (state.last !== null || !state.data?.ticks.length) return; // another one was chosen meanwhile
  state.last = state.data.newest;
  state.first = state.data.newest - width_ticks();
}

async function still(asked) {
  if (state.first === null) {
    const body = await get("/signals", {});
    if (!body) return;
    [state.first, state.last] = [body.oldest, body.newest];
  }
  if (!state.data || asked) await fetch_window(state.first, state.last);
}

// A single shot: wait for the trigger, then until all that is wanted behind it has come.
async function hunt() {
  if (state.trigger === null && !(await fired())) return;
  const earlier = Math.round((width_ticks() * (Number(state.before) || 0)) / 100);
  state.first = state.trigger - earlier;
  state.last = state.first + width_ticks();
  await fetch_window(state.first, state.last);
  if ((state.data?.newest ?? 0) >= state.last) state.armed = state.running = false;
}

async function fired() {
  const more = { name: state.trigger_signal, level: Number(state.level) || 0, edge: state.edge };
  if (state.after !== null) more.after = state.after;
  const body = await get("/trigger", more);
  if (!body) return false;
  if (body.tick === null) state.after = Math.max(state.after ?? 0, (body.newest ?? 1) - 1);
  else state.trigger = body.tick;
  return state.trigger !== null;
}

// ---- what is pressed

export function press_run() {
  const running = !state.running || state.armed;
  redraw({ running, armed: false, trigger: null, ...(running ? { cursors: [null, null] } : {}) });
}

export function press_single() {
  const armed = !state.armed;
  redraw({ armed, trigger: null, cursors: [null, null], after: state.data?.newest ?? null, running: armed && state.running });
}

// So many times as long about a place on the screen, and shifted by a share of it.
export function zoom(factor, centre = 0.5, shift = 0) {
  if (!state.data) return;
  const [first, last] = ends();
  const span = Math.max(8, Math.round((last - first) * factor));
  const from = Math.max(0, Math.round(first + (last - first) * (centre + shift) - span * centre));
  redraw({ running: false, armed: false, first: from, last: from + span }, true);
}

export function choose(source) {
  const afresh = { first: null, last: null, trigger: null, cursors: [null, null], armed: false, data: null, units: {} };
  redraw({ source, running: source === "now", ...afresh }, true);
}

// The address of a file with what is shown.
export function exported(kind) {
  const more = { names: state.names.join(",") };
  if (!state.running && state.first !== null) Object.assign(more, { first: Math.max(0, state.first), last: state.last ?? 0 });
  return `/api/v1/${path(`/export.${kind}`, more)}`;
}

export async function sources() {
  const [recordings, runs] = await Promise.all([call("GET", "recordings", null, true), call("GET", "runs?most=30", null, true)]);
  state.recordings = (recordings.body.recordings ?? []).map(({ name }) => name);
  state.runs = (runs.body.runs ?? []).filter((run) => run.facts.record);
  changed();
}

// A fault: what led to it stays on the screen.
dx.on("alarm", (fault) => {
  if (!fault || !state.running || state.armed || state.source !== "now" || !state.freeze) return;
  setTimeout(() => redraw({ running: false }), 500);
});
setInterval(() => {
  if (dx.shown("scope") && !document.hidden && !dx.stale && state.source === "now" && (state.running || state.armed)) look();
}, 150);
