// Hearing the machine: its events as they come, and how old they are.
import { API, call, ticked } from "./api.js";
import { forms } from "./forms.js";
import { sequence_text } from "./parts.js";
import { changed, dx } from "./store.js";
import { sentence, word } from "./texts.js";

const STALE_MS = 700; // statuses come every 50 ms, or 200 at rest
const SILENT_MS = 3000; // a socket that says nothing for so long is opened anew
const AGAIN_MS = 400;
let lastStatus = -Infinity;
let lastTick = -Infinity; // when the machine was seen to have ticked on: never later than the last status
let lastWord = performance.now();
let whole = {}; // the status as the machine told it

// A copy with another value at a path; what is beside it stays the same object.
function put(object, path, value) {
  const [key, ...rest] = path;
  return { ...object, [key]: rest.length ? put(object[key], rest, value) : value };
}

function heard(text) {
  const { event, data } = JSON.parse(text);
  lastWord = performance.now();
  if (event === "status") return status((whole = data));
  if (event === "changes") {
    for (const [path, value] of Object.entries(data)) whole = put(whole, path.split("/"), value);
    return status(whole);
  }
  if (event === "service") {
    dx.answers = data.answers;
    dx.why = sentence(data);
    if (!data.answers) last();
  }
  dx.tell(event === "control" ? "heard.control" : event, data);
  changed();
}

function status(data) {
  // Without a tick there is no figure that could be old; one that hangs leaves its last ones.
  if (!ticked(data) || data.tick.number !== dx.status?.tick?.number) lastTick = lastWord;
  lastStatus = lastWord;
  if (dx.stale) age();
  shown(data);
}

export function shown(data) {
  dx.status = { ...data, control: dx.holder, shown: in_words(data) };
  dx.tell("status", dx.status);
  changed();
}

// What a service that is gone told last, as old as it is.
async function last() {
  const { ok, body } = await call("GET", "status?last=true", null, true);
  if (!ok || typeof body.gone_s !== "number" || dx.answers) return;
  lastTick = lastStatus = performance.now() - 1000 * body.gone_s;
  shown(body);
}

// What is wrong and what is under way.
function in_words({ fault, sequence, notices, interlock, warning, waiting, spindle, tool_change, spindle_change, change }) {
  const trusted = fault && typeof fault.position_trusted === "boolean";
  const told = (name) => sentence(notices?.find((one) => one.name === name && name !== fault?.name));
  const waits = spindle?.at_speed === false ? "waits.spindle" : "waits.others";
  const asked = change ?? tool_change ?? spindle_change;
  const running = sequence?.state === "running" && sequence_text(sequence);
  return {
    fault: fault ? sentence(fault) || fault.name : "",
    next: trusted ? word(fault.position_trusted ? "frame.trusted" : "frame.not_trusted") : "",
    under_way: running || (asked ? sentence(asked) : waiting ? word(waits) : ""),
    interlock: told(interlock),
    warning: [warning, "PLAN_SILENT", "IN_THREAD", "FILE_DAMAGED", "NOT_RECORDED"].map(told).find(Boolean) || "",
    failed: sequence?.state === "failed" ? sentence(sequence) : "",
  };
}

// ---- age

function age() {
  const now = performance.now();
  const is_old = (since) => !dx.answers || now - since > STALE_MS;
  const [stale, silent] = [lastTick, lastStatus].map(is_old);
  const turned = stale !== dx.stale;
  const other = turned || silent !== dx.silent;
  Object.assign(dx, { stale, silent });
  if (turned) dx.tell("stale", stale);
  if (other) dx.draw();
  else if (stale) changed();
  if (dx.socket?.readyState === WebSocket.OPEN && dx.answers && now - lastWord > SILENT_MS) dx.socket.close();
}

// Why figures are old, and for how long.
export function old() {
  const open = dx.socket?.readyState === WebSocket.OPEN;
  const text = word(!dx.silent ? "frame.no_tick" : open && !dx.answers ? "frame.no_service" : "frame.no_panel");
  const since = Math.round((performance.now() - lastTick) / 1000);
  return Number.isFinite(since) ? `${text} (${word("frame.since")} ${forms.whole_seconds(since)})` : text;
}

function connect() {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  dx.socket = new WebSocket(`${scheme}//${location.host}${API}events?changes=true&language=${dx.language}`);
  lastWord = performance.now();
  dx.socket.onmessage = (message) => heard(message.data);
  dx.socket.onopen = () => dx.tell("connected", null);
  dx.socket.onclose = (event) => {
    dx.tell("disconnected", null);
    if (event.code === 1008) dx.tell("connected", null); // logged out: what is asked then says so
    setTimeout(connect, AGAIN_MS);
  };
}

export function listen() {
  connect();
  setInterval(age, 100);
}
