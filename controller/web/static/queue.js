// The queue: programs one after another, each so many times; what is next is loaded here and started as any is.
import { call, every } from "./api.js";
import { ask_for } from "./dialog.js";
import { html } from "./dom.js";
import { Act, Chip, Wrong } from "./parts.js";
import { dx } from "./store.js";
import { sentence, word as text } from "./texts.js";

const word = (key, ...values) => text(`queue.${key}`, ...values);
const MOST = 10000;
const BUSY = ["loading", "starting", "running", "held", "stopping"];
/** @type {any} */
let told = { entries: [], next: null };
every("programs run", 2, "queue", (body) => (told = body));

async function change(method, path, body) {
  const said = await call(method, path, body);
  if (said.ok) told = said.body;
  dx.draw();
}

async function asked_count(program, start) {
  const count = Math.round(Number(await ask_for(word("count_ask", program), "queue.set", String(start), { inputmode: "numeric" })));
  return count >= 1 && count <= MOST ? count : null;
}

async function enqueue(program) {
  const count = await asked_count(program, 1);
  if (count) await change("POST", "queue", { program, count });
}
export const Enqueue = ({ name }) => html`<${Act} text=${word("add")} data-enqueue=${name} needs="role" icon="runs" press=${() => enqueue(name)} />`;

const Load = () => html`<${Act} text=${word("load")} class="queue-load" kind="go" icon="load" call="POST queue/load" command="load" given=${told.next !== null} why="queue.nothing" />`;
const GoOn = () => html`<${Act} text=${word("go_on")} class="toggle queue-on" title=${word("go_on_title")} aria-pressed=${String(Boolean(told.go_on))} press=${() => change("PUT", "queue/go_on", { on: !told.go_on })} />`;

export function Queue() {
  if (!told.entries.length) return null;
  return html`<div class="queue">
    <h2>${word("title")}</h2>
    <${Wrong} text=${sentence(told)} />
    <ol>${told.entries.map((one, place) => html`<${Entry} key=${one.id} one=${one} place=${place} />`)}</ol>
    <div class="row"><${Load} /><${GoOn} /></div>
  </div>`;
}

function Entry({ one: { id, program, count, done }, place }) {
  const set = async () => {
    const wanted = await asked_count(program, count);
    if (wanted) await change("PATCH", `queue/${id}`, { count: wanted });
  };
  const path = `queue/${id}`;
  return html`<li class="row" data-entry=${id}>
    <span class="queue-name">${program}</span>
    ${done >= count ? html`<${Chip} tone="go">${word("done")}<//>` : id === told.next && html`<${Chip} tone="info">${word("next")}<//>`}
    <${Act} class="figures" needs="role" title=${word("count")} aria-label=${`${word("count")} ${program}: ${done} / ${count}`} press=${set}>${done} / ${count}<//>
    <${Act} text="↑" needs="role" title=${word("up")} aria-label=${`${word("up")} ${program}`} given=${place > 0} why="queue.first" press=${() => change("PATCH", path, { place: place - 1 })} />
    <${Act} icon="delete" needs="role" title=${word("remove")} aria-label=${`${word("remove")} ${program}`} press=${() => change("DELETE", path)} />
  </li>`;
}

// Where the operator stands when a run has ended.
export function QueueNext() {
  const { job } = dx.status ?? {};
  const next = told.entries.find(({ id }) => id === told.next);
  if (!next || BUSY.includes(job?.state) || (job?.state === "loaded" && job.name === next.program)) return null;
  return html`<div class="offer queue-next">
    <p class="strong">${word("up_next", next.program, next.done + 1, next.count)}</p>
    <${Wrong} text=${sentence(told)} />
    <${Load} />${told.go_on && html`<${Chip} tone="info">${word("goes_on")}<//>`}
  </div>`;
}
