// Back-ups: saved here, put back at the command line alone, for nothing may run meanwhile.
import { call, every } from "../api.js";
import { say } from "../dialog.js";
import { html, useState } from "../dom.js";
import { forms } from "../forms.js";
import { Act, Link, Table, Wrong } from "../parts.js";
import { dx } from "../store.js";
import { word as text } from "../texts.js";

const word = (key, ...values) => text(`backup.${key}`, ...values);
const told = { backups: [], kept: 0, folder: "", state: "", wrong: "" };
const look = every("setup", 5, "backups", (body) => Object.assign(told, body), (wrong) => (told.wrong = wrong));

const Row = ({ one: { name, made_s, size } }) => html`<tr data-backup=${name}>
  <th scope="row">${forms.date(made_s)}</th>
  <td class="hide-narrow"><code>${name}</code></td>
  <td class="figures">${forms.size(size)}</td>
  <td>${dx.user?.role === "set_up" && html`<${Link} text=${word("download")} path=${`backups/${encodeURIComponent(name)}`} aria-label=${`${word("download")} ${name}`} />`}</td>
</tr>`;

export function Backup() {
  const [saving, set] = useState(false);
  async function save() {
    set(true);
    const said = await call("POST", "backups");
    set(false);
    if (said.ok) say(word("saved", said.body.name));
    look();
  }
  const [latest] = told.backups;
  return html`<p>${word("what", told.kept)}</p>
    <div class="row"><${Act} id="backup-save" text=${word("save")} icon="download" needs="set_up" given=${!saving} why="backup.busy" press=${save} /></div>
    <${Wrong} text=${told.wrong} />
    ${latest
      ? html`<${Table} word=${word} columns=${["made", "name hide-narrow", "size figures", ""]} body="backup-list">${told.backups.map((one) => html`<${Row} key=${one.name} one=${one} />`)}<//>`
      : html`<p class="dim">${word("none")}</p>`}
    <div class="restore"><p>${word("restore")}</p>
      <pre class="listing" tabindex="0" id="backup-restore">directrix backup restore ${told.folder}/${latest?.name ?? word("archive")} --state ${told.state}</pre></div>`;
}
