// Set-up: homing, work offsets, tools, the machine file, and what the drives were told.
import { html } from "../dom.js";
import { Act, AxisName, Card, Chip, Table, Wrong } from "../parts.js";
import { dx } from "../store.js";
import { known, word as text } from "../texts.js";
import { Backup } from "./setup_backup.js";
import { BringUp } from "./setup_bring_up.js";
import { Calibration } from "./setup_calibration.js";
import { Changer } from "./setup_changer.js";
import { File, read_anew } from "./setup_file.js";
import { Notices } from "./setup_notices.js";
import { Usage } from "./setup_usage.js";
import { Probing } from "./setup_probing.js";
import { Users } from "./setup_users.js";
import { Offsets, Tools, figure, forget_pick, wrong } from "./setup_tables.js";

const word = (key, ...values) => text(`setup.${key}`, ...values);
const PARTS = { homing: Homing, offsets: Offsets, tools: Tools, changer: Changer, probing: Probing, calibration: Calibration, bring_up: BringUp, usage: Usage, file: File, backup: Backup, drives: Drives, users: Users, notices: Notices };
export const at = { part: "homing" };

function View() {
  const Part = PARTS[at.part];
  const turn = (part) => {
    at.part = part;
    dx.tell("view", "setup");
    dx.draw();
  };
  return html`<div class="looks setup">
    <div class="pages">${Object.keys(PARTS).map((part) => html`<button key=${part} class="act" type="button" data-setup=${part} aria-pressed=${String(part === at.part)} onclick=${() => turn(part)}>
      <span>${word(part)}</span></button>`)}</div>
    <${Wrong} id="setup-said" text=${wrong()} />
    <div class="part" key=${at.part} data-part=${at.part} data-shown="1"><${Card} title=${word(at.part)} tabindex="0"><${Part} /><//></div>
  </div>`;
}
export default { name: "setup", View };

dx.on("view", (name) => (name === "setup" ? read_anew() : forget_pick())); // what was picked was for that touch

// ---- homing

const HOMING = ["axis", "state", "home_at figures hide-narrow", "travel figures hide-narrow", ""];
const FREE = { command: "home" };
const minus = (text) => text.replaceAll("-", "−");

function Homing() {
  const joints = Object.entries(dx.status?.joints ?? {});
  return html`
    <${Table} word=${word} columns=${HOMING} body="setup-homing">${joints.map(([name, joint]) => html`<${Axis} key=${name} name=${name} joint=${joint} />`)}<//>
    <div class="row"><${Act} text=${word("home_all")} call="POST machine/home" body=${{}} ask=${word("home_all_ask")} ...${FREE} icon="home" /></div>`;
}

function Axis({ name, joint: { homed, limit } }) {
  const { home, unit = "", travel = [] } = dx.axis(name);
  return html`<tr>
    <th scope="row"><${AxisName} name=${name} /></th>
    <td><div class="row">
      <${Chip} tone=${homed ? "go" : "hold"}>${word(homed ? "homed" : "not_homed")}<//>${limit && html`<${Chip} tone="stop">${word("limit")} ${limit}<//>`}</div>
      </td>
    <td class="figures hide-narrow">${minus(figure(home))} ${unit}</td>
    <td class="figures hide-narrow">${minus(travel.map(figure).join(" … "))}</td>
    <td>
      <${Act} text=${word("home")} aria-label=${`${word("home")} ${name}`} ask=${word("home_ask", name)} call="POST machine/home" body=${{ axes: [name] }} ...${FREE} />
      </td>
  </tr>`;
}

// ---- commissioning

const DRIVES = ["axis", "node figures", "heartbeat", "state", "profile hide-narrow", "homing_how hide-narrow", "supervision hide-narrow"];

function Drives() {
  const { commissioned: done, drives = [], mode } = dx.status ?? {};
  const tone = done === undefined ? "" : done ? "go" : "hold";
  return html`
    <div class="row">
      <span id="setup-commissioned"><${Chip} tone=${tone}>${done === undefined ? "–" : word(done ? "commissioned" : "not_commissioned")}<//></span>
      <${Chip}>${text(`mode.${mode ?? "OFF"}`)}<//>
    </div>
    <p class="dim">${word("how")}</p>
    <${Table} word=${word} columns=${DRIVES} body="setup-drives">${drives.map((drive) => html`<${Drive} key=${drive.axis} drive=${drive} />`)}<//>`;
}

// How a drive is set up: profile, homing, what notices that the controller is gone.
function Drive({ drive: { axis, bus, node, state, heard } }) {
  const { absolute, homing_method, profile, supervision } = dx.axis(axis);
  const fitted = [profile ?? "–", absolute ? word("absolute") : word("method", homing_method ?? "–"), supervision ? word(`supervision.${supervision}`) : "–"];
  return html`<tr>
    <th scope="row"><${AxisName} name=${axis} /></th>
    <td class="figures">${bus} · ${node}</td>
    <td><${Chip} tone=${heard ? "go" : "stop"}>${word(heard ? "heard" : "silent")}<//></td>
    <td>${known(`drives.state.${state}`, state ?? "–")}</td>
    ${fitted.map((words) => html`<td class="hide-narrow">${words}</td>`)}
  </tr>`;
}
