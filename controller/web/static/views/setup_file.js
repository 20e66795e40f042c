// The machine file, value by value with its lines: to be read and searched.
import { call } from "../api.js";
import { html, useEffect } from "../dom.js";
import { Table } from "../parts.js";
import { dx } from "../store.js";
import { word as text } from "../texts.js";

const word = (key) => text(`setup.${key}`);
let told = null;
let wanted = "";

export const read_anew = () => (told = null);

async function read() {
  const said = await call("GET", "machine/file");
  if (said.ok) told = said.body;
  dx.draw();
}

export function File() {
  useEffect(() => {
    if (!told) read();
  });
  const found = (told?.rows ?? []).filter((row) => `${row.table} ${row.key} ${row.value} ${row.comment}`.toLowerCase().includes(wanted.toLowerCase()));
  const search = (event) => {
    wanted = event.target.value;
    dx.draw();
  };
  return html`
    <div class="row spread">
      <span class="strong" id="setup-file-name">${told && `${told.name}: ${found.length} / ${told.rows.length}`}</span>
      <input class="wide" id="setup-filter" type="search" value=${wanted} placeholder=${word("filter")} aria-label=${word("filter")} oninput=${search} />
    </div>
    <p class="dim">${word("read_only")}</p>
    <${Table} class="file-table" word=${word} columns=${["line figures", "key", "value", "comment hide-narrow"]} body="setup-file">
      ${found.map((row, i) => html`<${Row} key=${row.line} row=${row} first=${row.table !== found[i - 1]?.table} />`)}<//>`;
}

const Row = ({ row, first }) => html`
  ${first && html`<tr class="group"><td colspan="4">${row.table}</td></tr>`}
  <tr><td class="figures dim">${row.line}</td><td class="key">${row.key}</td><td class="value">${row.value}</td>
    <td class="dim hide-narrow">${row.comment}</td></tr>`;
