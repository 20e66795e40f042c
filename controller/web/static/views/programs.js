// The store: programs come in by drag and drop, are checked, and are loaded from here.
import { call, every } from "../api.js";
import { ask_for } from "../dialog.js";
import { html, useRef } from "../dom.js";
import { Editor, edit, editing, write_new } from "../editor.js";
import { forms } from "../forms.js";
import { Icon } from "../icons.js";
import { Maps, Verdict, verdict_of } from "../maps.js";
import { Act, Card, Chip, ScrolledTable, Wrong } from "../parts.js";
import { Offer, StateThere } from "../restart.js";
import { Enqueue, Queue } from "../queue.js";
import { dx } from "../store.js";
import { known, sentence, word as text } from "../texts.js";
import { Uploads, in_folder } from "../uploads.js";

const word = (key, ...values) => text(`programs.${key}`, ...values);
const TONES = { passed: "go", exceeds: "stop", over_limit: "stop", refused: "stop", failed: "stop", running: "info", waiting: "info" };
const RESULTS = { completed: "go", fault: "stop", refused: "stop", lost: "stop", stopped: "hold" };
const AT_REST = "OFF READY FAULT"; // a job that runs is kept
const path_of = (name) => `programs/${encodeURIComponent(name)}`;

// ---- what is there: the list in brief, and all of the one that is chosen

const told = { rows: [], wrong: "", wanted: "", chosen: "", one: null, around: [], calls: [] };

const look = every("programs", 1, "programs?brief=true", (body) => take(body.programs), (wrong) => (told.wrong = wrong));
dx.on("kept", (name) => {
  told.chosen = name;
  enter(name.slice(0, Math.max(0, name.lastIndexOf("/"))));
  look();
});

const tag = (row) => row && `${row.name} ${row.sha256} ${row.check.state} ${row.check.result.stored ?? ""}`;

function take(rows) {
  told.rows = rows;
  if (dx.folder && !here().length) dx.folder = ""; // the last of it was moved or deleted
  const row = rows.find(({ name }) => name === told.chosen);
  if (!row) told.one = null;
  else if (tag(row) !== tag(told.one)) detail(row);
}

async function detail({ name }) {
  const said = await call("GET", path_of(name), null, true);
  if (!said.ok || name !== told.chosen) return;
  const { file = "", line, column = 0, called_at } = said.body.check.result;
  const [around, calls] = await Promise.all([lines_around(name, file, line, column), lines_around(name, "", called_at, 1)]);
  if (name !== told.chosen) return;
  Object.assign(told, { one: said.body, around, calls });
  dx.draw();
}

async function lines_around(name, file, line, column) {
  if (!line) return [];
  const said = await call("GET", `${path_of(name)}/around?line=${line}&column=${column}&file=${encodeURIComponent(file)}`, null, true);
  return said.body.lines ?? [];
}

function choose(row) {
  told.chosen = row.name;
  if (told.one?.name !== row.name) told.one = null;
  detail(row);
  dx.draw();
}

// ---- the list

function View() {
  if (editing()) return html`<${Card} class="programs-editor"><${Editor} row_of=${(name) => told.rows.find((row) => row.name === name)} /><//>`;
  return html`<div class="programs">
    <${Card} class="programs-list">
      <${Offer} /><${StateThere} /><${Uploads}>
        <${Act} text=${word("new")} needs="role" icon="edit" data-edit="new" press=${() => write_new(told.rows.map(({ name }) => name))} />
      <//><${Wrong} text=${told.wrong} />
      <${Trail} />
      ${told.rows.length > 5 && html`<input type="search" id="programs-filter" value=${told.wanted} placeholder=${word("filter")} aria-label=${word("filter")} oninput=${search} />`}
      ${told.rows.length ? html`<${List} />` : html`<p class="dim">${word("none")}</p>`}
      <${Queue} />
    <//>
    <${Card} class="programs-detail">${told.one ? html`<${Detail} key=${told.one.name} one=${told.one} />` : html`<p class="dim">${word("select")}</p>`}<//>
  </div>`;
}
export default { name: "programs", View };

function search(event) {
  told.wanted = event.target.value;
  dx.draw();
}

const List = () => html`<${ScrolledTable} word=${word} columns=${["name", "check", "time", "last", "size"].map((key) => `${key} p-${key}`)}>
  ${folders().map(([folder, count]) => html`<tr key=${`${folder}/`} class="entry" data-folder=${folder} onclick=${() => enter(in_folder(folder))}>
    <td colspan="5"><button class="plain" type="button"><${Icon} name="folder" /> ${folder}</button> <span class="dim figures">${count}</span></td></tr>`)}
  ${shown().map((row) => html`<${Row} key=${row.name} row=${row} />`)}<//>`;

// ---- folders: what stands before a slash in a name

const leaf = (name) => name.slice(name.lastIndexOf("/") + 1);
const here = () => told.rows.filter(({ name }) => name.startsWith(in_folder("")));
const rest = ({ name }) => name.slice(in_folder("").length);

// A search looks into all that is within; else what lies in folders is behind them.
const shown = () => here().filter((row) => (told.wanted ? rest(row).toLowerCase().includes(told.wanted.toLowerCase()) : !rest(row).includes("/")));

function folders() {
  const within = (told.wanted ? [] : here()).map(rest).filter((name) => name.includes("/")).map((name) => name.split("/")[0]);
  return [...new Set(within)].map((folder) => [folder, within.filter((one) => one === folder).length]);
}

function enter(folder) {
  Object.assign(dx, { folder });
  told.wanted = "";
  dx.draw();
}

async function move_folder() {
  const to = (await ask_for(word("move_ask", dx.folder), "programs.move", dx.folder, { maxlength: 200 }))?.trim();
  if (!to || to === dx.folder) return;
  const said = await call("PATCH", `folders/${encodeURIComponent(dx.folder)}`, { name: to });
  if (said.ok) enter(to);
  look();
}

function Trail() {
  if (!dx.folder) return null;
  const parts = dx.folder.split("/");
  return html`<nav class="row trail" aria-label=${word("folder")}>
    <${Act} text=${word("top")} needs="" data-trail="" press=${() => enter("")} />
    ${parts.map((part, i) => html`/ <${Act} text=${part} needs="" aria-current=${i === parts.length - 1 ? "location" : undefined} data-trail=${part} press=${() => enter(parts.slice(0, i + 1).join("/"))} />`)}
    <${Act} text=${word("move")} needs="role" icon="edit" data-move=${dx.folder} press=${move_folder} />
  </nav>`;
}

function Row({ row }) {
  const { name, check, last_run: run } = row;
  return html`<tr class="entry" data-program=${name} aria-selected=${name === told.chosen ? "true" : undefined} onclick=${() => choose(row)}>
    <td class="p-name"><div class="named">
      <${Thumbnail} name=${name} check=${check} />
      <div><button class="plain" type="button">${rest(row)}</button>
        ${dx.loaded() && name === dx.status.job.name && html`<${Chip} tone="info">${word("loaded")}<//>`}
        <div class="dim when"><span>${word("uploaded")}</span> <${Moment} at=${row.uploaded_s} /></div></div>
    </div></td>
    <td class="p-check"><${State} check=${check} /></td>
    <td class="figures p-time">${forms.time(check.result.takes_s ?? check.result.duration_s)}</td>
    <td class="p-last">${run && html`<${Chip} tone=${RESULTS[run.result] ?? "dim"}>${known(`result.${run.result}`, run.result)}<//>
      <div class="dim when"><${Moment} at=${run.began_s} /></div>`}</td>
    <td class="figures p-size">${forms.size(row.size)}</td>
  </tr>`;
}

// ---- its path as a picture, of the check that is known; drawn anew where that is another one

const picture_of = ({ result }) => result.stored ?? result.pictured;
const picture = (name, check, height) => `/api/v1/${path_of(name)}/picture.svg?height=${height}&of=${picture_of(check)}`;
const hidden = ({ target }) => (target.style.visibility = "hidden"); // the oldest pictures go

const THUMBNAIL = 54; // px
const Thumbnail = ({ name, check }) => html`<span class="thumbnail">${picture_of(check) ? html`<img key=${picture_of(check)} src=${picture(name, check, THUMBNAIL)} alt="" loading="lazy" onerror=${hidden} />` : html`<${Icon} name="programs" />`}</span>`;

const PREVIEW = 270; // px
function Preview({ one: { name, check } }) {
  if (!picture_of(check)) return null;
  const lines = check.result.guilty_lines ?? [];
  return html`<figure class="preview">
    <img key=${picture_of(check)} src=${picture(name, check, PREVIEW)} alt=${word("picture", name)} onerror=${({ target }) => (target.parentNode.hidden = true)} />
    ${lines.length > 0 && html`<figcaption class="note wrong">${word("guilty", lines.slice(0, MOST_LINES).join(", "))}</figcaption>`}
  </figure>`;
}
const MOST_LINES = 10; // that are named below it

const Moment = ({ at }) => html`<time class="figures" data-at=${String(at)}>${forms.moment(at)}</time>`;

function State({ check }) {
  const state = verdict_of(check);
  return html`<${Chip} tone=${TONES[state] ?? "dim"}>${text(`check.${state}`)}<//>${state === "running" && html`<span class="figures dim">${forms.percent(check.progress)}</span>`}`;
}

// ---- one program

function Detail({ one }) {
  const { check } = one;
  return html`
    <h2 class="program-title">${one.name}</h2>
    <${Acts} one=${one} />
    <${Preview} key=${picture_of(check)} one=${one} />
    ${check.result.sentence ? html`<${Refused} check=${check} />` : check.state === "passed" && html`<${Found} check=${check.result} made=${one.completed} />`}
    ${check.state === "passed" && html`<${Places} name=${one.name} lines=${one.lines} />`}`;
}

function Acts({ one }) {
  const { name } = one;
  const path = path_of(name);
  async function rename() {
    const other = (await ask_for(word("rename_ask", name), "programs.rename", name, { maxlength: 200 }))?.trim();
    if (!other || other === name) return;
    const said = await call("PATCH", path, { name: other });
    if (said.ok) told.chosen = said.body.name;
    look();
  }
  return html`<div class="row program-acts">
    <${Act} text=${word("load")} call="POST job" body=${{ program: name }} kind="go" icon="load" command="load" />
    ${dx.loaded() && name === dx.status.job.name && html`<${Act} text=${word("unload")} call="DELETE job" icon="eject" modes=${AT_REST} />`}
    <${Enqueue} name=${name} />
    <${Act} text=${word("edit")} needs="role" icon="edit" data-edit="open" press=${() => edit(one)} />
    <${Act} text=${word("ask_check")} call=${`POST ${path}/check`} needs="role" icon="check" />
    <a class="act" href=${`/api/v1/${path}/text`} download=${leaf(name)}><${Icon} name="download" /><span>${word("download")}</span></a>
    <${Act} text=${word("rename")} data-rename=${name} needs="role" icon="flag" press=${rename} />
    <${Act} text=${word("delete")} call=${`DELETE ${path}`} ask=${word("delete_ask", name)} needs="role" kind="warn" icon="delete" />
  </div>`;
}

// All that is refused, each with its line and a caret; of what the path refuses the text around the place.
function Refused({ check }) {
  const refusals = check.result.refusals ?? [];
  if (refusals.length < 2) return html`<${RefusedOne} check=${check} />`;
  const counts = Object.entries(check.result.counts ?? {}).map(([code, count]) => `${code || "–"} ${count}`);
  return html`<p class="wrong figures">${word("refusals", Object.values(check.result.counts ?? {}).reduce((a, b) => a + b, 0))}: ${counts.join(", ")}</p>
    <div id="programs-wrong" tabindex="0">${refusals.map((one) => html`<div key=${`${one.file} ${one.line} ${one.column}`}>
      <${Wrong} text=${`${one.file}:${one.line}:${one.column}: ${sentence(one)}`} />
      ${one.shown.length > 0 && html`<pre class="listing caret">${one.shown.join("\n")}</pre>`}</div>`)}</div>`;
}

// The name of a called file stands before the sentence: the lines below are then not those of the program.
const named = ({ file, ...result }) => file && file !== told.chosen ? `${file}:${result.line}: ${sentence(result)}` : sentence(result);
const RefusedOne = ({ check: { verdict, result } }) => html`
  ${verdict ? html`<${Verdict} told=${verdict} />` : html`<${Wrong} text=${named(result)} />`}
  ${told.around.length > 0 && html`<pre class="listing caret" id="programs-wrong" tabindex="0">${told.around.join("\n")}</pre>`}
  ${told.calls.length > 0 && html`<p class="note">${word("called", result.file)}</p><pre class="listing caret" id="programs-calls" tabindex="0">${told.calls.join("\n")}</pre>`}`;

const SHARES = ["velocity", "acceleration", "jerk"];

function Found({ check, made }) {
  const binds = (check.cut_binds ?? []).filter(({ share }) => share >= 0.01).map(({ what, share }) => `${forms.bound(what)} ${forms.percent(share)}`);
  const overcut = check.verified?.overcut_mm;
  const facts = [
    ["time", forms.time(check.takes_s ?? check.duration_s)],
    ...(check.work ?? []).map(({ what, length_mm, time_s }) => [`work.${what}`, `${length_mm.toFixed(1)} mm, ${forms.time(time_s)}`]),
    ["blocks", check.blocks ?? "–"],
    ["binds", binds.join(", ")],
    ["made", made || ""],
    ["overcut", typeof overcut === "number" ? `${(overcut * 1000).toFixed(1)} µm` : ""],
  ];
  return html`
    <dl class="facts wide">${facts.filter(([, value]) => value !== "").map(([key, value]) => html`<dt>${word(key)}</dt><dd class="figures">${value}</dd>`)}</dl>
    <${Verdict} told=${check.verdict} />
    <${Maps} verified=${check.verified ?? {}} verdict=${check.verdict} />
    <${Wrong} text=${sentence(check.warning)} />
    <${Box} joints=${check.joints ?? []} />
    <${Tools} tools=${check.tools ?? []} />
    <${Holes} holes=${check.holes ?? []} count=${check.hole_count ?? 0} />
    ${(check.notes ?? []).map((one) => html`<p class="dim note">${text("run.line")} ${one.line}: ${sentence(one)}</p>`)}`;
}

const Share = ({ share, over }) => html`<td class=${`figures ${over ? "wrong" : ""}`}>${forms.percent(share)}${over && html` <span class="note">${word("over_limit")}</span>`}</td>`;

// What each axis does; a share of more than its limit is said in colour and word.
const BOX = ["run.axis", ...["from", "to", ...SHARES].map((one) => `programs.${one}`)];
const Box = ({ joints }) => html`<${ScrolledTable} class="box" word=${text} columns=${BOX}>${joints.map((joint) => html`<tr key=${joint.name}>
    <th scope="row">${joint.name}</th>
    <td class="figures">${joint.lowest.toFixed(2)}</td><td class="figures">${joint.highest.toFixed(2)}</td>
    ${SHARES.map((one) => html`<${Share} key=${one} share=${joint[`${one}_share`]} over=${joint.over?.includes(one)} />`)}
  </tr>`)}<//>`;

const range = (ends) => (ends ? [...new Set(ends.map((end) => end.toFixed(0)))].join("–") : "");

// What each tool does, as programmed.
const TOOLS = ["tool", "cut_time", "rapid_time", "cut_length", "speed_range", "feed_range", "deepest"];
const Tools = ({ tools }) => tools.length > 0 && html`<${ScrolledTable} class="box tools" word=${word} columns=${TOOLS}>${tools.map((one) => html`<tr key=${one.tool}>
    <th scope="row">T${one.tool}</th>
    <td class="figures">${forms.seconds(one.cut_s)}</td><td class="figures">${forms.seconds(one.rapid_s)}</td>
    <td class="figures">${one.cut_mm.toFixed(1)}</td><td class="figures">${range(one.spindle_rev_min)}</td>
    <td class="figures">${range(one.feed_mm_min)}</td><td class="figures">${one.deepest_mm?.toFixed(3) ?? ""}</td>
  </tr>`)}<//>`;

// The holes of its cycles: the place where the feed begins, and to which height along the plane's axis.
const ALONG = { G17: "Z", G18: "Y", G19: "X" };
const MAX_HOLES = 100; // of the page; the command line has more
const HOLES = ["line", "tool", "cycle", "offset", "x", "y", "z", "to"];
const Holes = ({ holes, count }) => holes.length > 0 && html`<p class="dim note">${word("holes")}: ${count}</p>
  <${ScrolledTable} class="box holes" word=${(key) => text(key === "line" ? "run.line" : `programs.${key}`)} columns=${HOLES}>${holes.slice(0, MAX_HOLES).map((one, i) => html`<tr key=${i}>
    <th scope="row">${one.line}</th><td>T${one.tool}</td><td>${one.cycle}</td><td>${one.offset}</td>
    ${["x", "y", "z"].map((axis) => html`<td class="figures">${one[axis].toFixed(3)}</td>`)}
    <td class="figures">${ALONG[one.plane]}${one.to.toFixed(3)}</td>
  </tr>`)}<//>`;

// To begin elsewhere; what will be in force there is shown once it is loaded.
function Places({ name, lines }) {
  const form = useRef(null);
  const FIELDS = [["line", lines, "1"], ["fraction", 100, "any"], ["dry", 1000, "any"]];
  function load() {
    const value = (field) => form.current.elements[field].valueAsNumber;
    const body = { program: name };
    if (value("line") >= 1) body.line = Math.round(value("line"));
    if (value("fraction") >= 0) body.fraction = value("fraction") / 100;
    if (value("dry") > 0) body.dry_run_mm = value("dry");
    if (form.current.elements.block_delete.checked) body.block_delete = true;
    return call("POST", "job", body);
  }
  return html`<form class="row places" data-program=${name} ref=${form} onsubmit=${(event) => event.preventDefault()}>
    ${FIELDS.map(([field, most, step]) => html`<label><span class="dim">${word(field)}</span>
      <input type="number" name=${field} min="0" max=${most} step=${step} /></label>`)}
    <label><span class="dim">${word("block_delete")}</span><input type="checkbox" name="block_delete" /></label>
    <${Act} text=${word("load_there")} kind="go" icon="from" command="load" press=${load} />
  </form>`;
}
