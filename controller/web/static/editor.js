// A program is written and mended here: read by the machine's own reader while one types, and kept by the upload.
import { API, call, headers } from "./api.js";
import { ask, ask_for, say } from "./dialog.js";
import { html, useEffect, useRef } from "./dom.js";
import { Act, Wrong } from "./parts.js";
import { dx } from "./store.js";
import { sentence, word as text } from "./texts.js";
import { in_folder, send } from "./uploads.js";

const word = (key, ...values) => text(`edit.${key}`, ...values);
const MAX_BYTES = 1_000_000; // of what the reader takes as a draft
const PAUSE_MS = 500; // in typing, before it is read
const LOOKS_UP = 100; // lines, for the cycle that repeats on the line of the caret
const ENDS_CYCLE = ["G0", "G1", "G2", "G3", "G80"];
let drawn = []; // codes of which there is a picture
let draft = null; // { name, sha256, ends, stored, area, dirty, refusals, reading, compares }

export const editing = () => draft !== null;

export async function edit({ name, size, sha256 }) {
  if (size > MAX_BYTES) return say(word("large", name), "warn");
  const answer = await fetch(`${API}programs/${encodeURIComponent(name)}/text`, { headers: headers() }).catch(() => null);
  if (!answer?.ok) return say(text("frame.no_panel"), "warn");
  const stored = await answer.text();
  if (stored.includes("\ufffd")) return say(word("no_text", name), "warn");
  open({ name, sha256, stored });
}

export async function write_new(names) {
  const name = (await ask_for(word("new_ask"), "edit.new", in_folder("part.ngc"), { maxlength: 200 }))?.trim();
  if (!name) return;
  if (names.includes(name.normalize())) return say(word("there", name), "warn");
  open({ name, sha256: "", stored: "" });
}

function open({ name, sha256, stored }) {
  const ends = stored.includes("\r\n") ? "\r\n" : "\n";
  draft = { name, sha256, ends, stored, area: null, dirty: false, refusals: [], reading: 0, read: false, compares: false };
  dx.draw();
}

// ---- read while one types

function typed() {
  draft.dirty = draft.area.text !== draft.area.stored;
  draft.read = false;
  clearTimeout(draft.reading);
  draft.reading = setTimeout(read, PAUSE_MS);
  dx.draw();
}

async function read() {
  const own = draft;
  const { text: sent } = own.area;
  const said = await call("POST", "drafts", { name: own.name, text: sent }, true);
  if (own !== draft || sent !== own.area.text) return;
  if (said.status === 429) return (own.reading = setTimeout(read, PAUSE_MS));
  own.wrong = said.ok ? "" : sentence(said.body.error);
  own.refusals = said.ok ? said.body.refusals : [];
  own.read = said.ok;
  own.area.mark(own.refusals.map((one) => ({ ...one, sentence: sentence(one) })));
  dx.draw();
}

// The picture of the cycle that the caret's line calls, or repeats: { code, path }.
function picture() {
  let own = true;
  for (const line of draft.area?.above(LOOKS_UP) ?? []) {
    const source = line.replace(/\([^)]*\)|;.*/g, "");
    const probe = own && /^\s*o\s*<\s*probe_(\w+)\s*>\s*call/i.exec(source)?.[1].toLowerCase();
    if (probe && probe !== "touch") return { code: `probe_${probe}`, path: `probing/${probe}` };
    const codes = [...source.matchAll(/g\s*0*(\d+(?:\.\d+)?)/gi)].map(([, number]) => `G${number}`);
    const code = codes.find((one) => drawn.includes(one));
    if (code) return { code, path: `cycles/${code}` };
    if (codes.some((one) => ENDS_CYCLE.includes(one))) return null;
    own = false;
  }
  return null;
}

// ---- kept, or left

async function keep_it(row) {
  const own = draft;
  if ((row?.sha256 ?? "") !== own.sha256 && !(await ask(word("other", own.name), "programs.replace"))) return;
  const written = own.area.text;
  const file = new File([written.replaceAll("\n", own.ends)], own.name);
  const why = await send(file, {}, own.name);
  if (why) return say(`${own.name}: ${why}`, "warn");
  if (own === draft) close();
  dx.tell("kept", own.name);
}

function close() {
  clearTimeout(draft?.reading);
  draft?.area?.end();
  draft = null;
  dx.draw();
}

const leave = async () => (!draft.dirty || (await ask(word("leave_ask", draft.name)))) && close();

function compare() {
  draft.compares = !draft.compares;
  draft.area.compare(draft.compares);
  dx.draw();
}

export function Editor({ row_of }) {
  const place = useRef(null);
  const own = draft;
  useEffect(() => {
    import("./edit/area.js").then(({ Area }) => {
      if (own !== draft) return;
      own.area = new Area(place.current, own.stored.replaceAll("\r\n", "\n"), word("text_of", own.name), typed, () => dx.draw());
      read();
      if (!drawn.length) call("GET", "cycles", null, true).then((said) => said.ok && ((drawn = said.body.cycles), dx.draw()));
      dx.draw();
    }, () => own === draft && (close(), say(text("frame.no_panel"), "warn")));
  }, [own]);
  const rules = { needs: "role", given: Boolean(own.area), why: "why.still_loading" };
  const first = own.refusals[0];
  const shown = picture();
  return html`<div class="editor">
    <div class="row editor-head">
      <h2 class="program-title">${own.name}</h2>
      <${Act} text=${word("keep")} icon="check" kind="go" data-edit="keep" ...${rules} given=${own.dirty} why="edit.unchanged" press=${() => keep_it(row_of(own.name))} />
      <${Act} text=${word("compare")} needs="" data-edit="compare" aria-pressed=${String(own.compares)} press=${compare} given=${own.dirty || own.compares} why="edit.unchanged" />
      <${Act} text=${word("leave")} needs="" icon="close" data-edit="leave" press=${leave} />
    </div>
    <div class="editor-area" ref=${place}></div>
    ${shown && html`<img class="editor-picture" key=${shown.code} src=${`${API}${shown.path}.svg`} alt=${shown.code} onerror=${(event) => (event.target.hidden = true)} />`}
    <div class="editor-said" role="status">
      <${Wrong} text=${own.wrong} />
      ${first ? own.refusals.map((one) => html`<button class="plain wrong" type="button" key=${`${one.line} ${one.column}`} onclick=${() => own.area.go(one)}>${word("at", one.line, one.column)} ${sentence(one)}</button>`)
        : html`<span class="dim">${own.wrong ? "" : word(own.read ? "reads" : "reading")}</span>`}
    </div>
  </div>`;
}
