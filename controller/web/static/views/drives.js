// Drives and buses: what each says of itself, and how much room a tick has.
import { every } from "../api.js";
import { html } from "../dom.js";
import { forms } from "../forms.js";
import { AxisName, Card, Chip, Facts, Figure, Meter, Table, Wrong } from "../parts.js";
import { dx } from "../store.js";
import { known, sentence, word as text } from "../texts.js";

const word = (key, ...values) => text(`drives.${key}`, ...values);
const TONES = { OPERATION_ENABLED: "go", FAULT: "stop", FAULT_REACTION_ACTIVE: "stop", QUICK_STOP_ACTIVE: "hold" };
// Bits of the statusword (CiA 402, 6041h); 8, 14 and 15 are the maker's own.
const BITS = ["ready", "on", "enabled", "fault", "voltage", "no_quick_stop", "disabled", "warning", "8", "remote", "reached", "limit", "follows", "following_error", "14", "15"];
const BAD = ["fault", "following_error"];
const COLUMNS = ["axis", "node d-node", "state", "mode d-mode", "target figures d-target", "actual figures", "error figures", "warmth figures d-warmth", "age figures d-age", "said", "bits d-bits"];

// Of the tick's own values these have their form; what else the live state declares as tick.* is shown as it is,
// under its text or else its name.
const FORMS = { period_ms: ["period", forms.ms], late_max_ms: ["late_max", forms.ms], skips: ["skips", forms.int] };
const tick_rows = ({ number: _number = 0, age_s: _age_s = 0, ...tick }) =>
  Object.entries({ period_ms: undefined, late_max_ms: undefined, skips: undefined, ...tick }).map(([name, value]) =>
    name in FORMS ? [word(FORMS[name][0]), FORMS[name][1](value)] : [known(`drives.${name}`, name), String(value)]);

const told = { buses: null, wrong: "" };
every("drives", 1, "machine/buses", (body) => (told.buses = body), (wrong) => (told.wrong = wrong));

function View() {
  const { buses, wrong } = told;
  const drives = dx.status?.drives ?? [];
  // Only where the machine file says how the drives tell it.
  const warm = drives.some((drive) => drive.temperature_c !== undefined);
  return html`<div class="looks drives">
    <${Card} title=${text("view.drives")} class="drives-all" tabindex="0" data-warmth=${warm ? "1" : undefined}>
      <${Table} word=${word} columns=${COLUMNS} body="drives-list">${drives.map((drive) => html`<${Drive} key=${drive.axis} drive=${drive} />`)}<//>
    <//>
    <${Card} title=${word("buses")} class="drives-bus">
      <${Wrong} id="drives-said" text=${wrong} />
      <div class="stack" id="drives-buses">${buses?.buses.map((one) => html`<${Bus} key=${one.name} bus=${one} limits=${buses} />`)}</div>
    <//>
    <${Card} title=${word("late")} class="drives-lateness">
      <p class="dim" id="drives-late-of">${buses && word("late_of", Math.round(buses.lateness.seconds))}</p>
      <div class="meters" id="drives-late">${buses && html`<${Lateness} late=${buses.lateness} />`}</div>
    <//>
    <${Card} title=${word("tick")} class="drives-tick">
      <${Facts} rows=${tick_rows(dx.status?.tick ?? {})} />
    <//>
  </div>`;
}
export default { name: "drives", View };

function Drive({ drive }) {
  const joint = dx.status.joints?.[drive.axis] ?? {};
  const cell = (what, value, classes = "figures") => html`<td class=${classes} data-drive=${`${drive.axis}.${what}`} data-label=${word(what)}>${value}</td>`;
  const mode = drive.homing ? word("homing") : known(`drives.cyclic.${drive.cyclic_mode}`, "–");
  return html`<tr>
    <th scope="row"><${AxisName} name=${drive.axis} /></th>
    ${cell("node", `${drive.bus} · ${drive.node}`, "d-node figures")}
    ${cell("state", html`<${Chip} tone=${TONES[drive.state] ?? "info"}>${known(`drives.state.${drive.state}`, drive.state ?? "–")}<//>`, "")}
    ${cell("mode", mode, "d-mode")}
    ${cell("target", forms.mm(joint.machine), "figures d-target")}
    ${cell("actual", forms.mm(joint.actual))}
    ${cell("error", forms.um(joint.error))}
    ${cell("warmth", typeof drive.temperature_c === "number" ? `${drive.temperature_c.toFixed(1)} °C` : "–", "figures d-warmth")}
    ${cell("age", typeof drive.heartbeat_age_s === "number" ? `${Math.round(drive.heartbeat_age_s * 1000)} ms` : "–", "figures d-age")}
    ${cell("said", drive.error ? html`<span class="wrong">${sentence(drive.error)}</span>` : html`<span class="dim">${word("nothing")}</span>`, "")}
    ${cell("bits", bits(drive.statusword), "d-bits")}
  </tr>`;
}

const tone = (name) => (BAD.includes(name) ? "stop" : Number(name) ? "" : "info");
const bits = (status) =>
  typeof status === "number" ? BITS.filter((_, i) => (status >> i) & 1).map((name) => html`<${Chip} key=${name} tone=${tone(name)}>${word(`bit.${name}`)}<//>`) : "–";

const percent = (share) => (typeof share === "number" ? `${(share * 100).toFixed(1)} %` : "–");

function Bus({ bus, limits: { max_share: most, near_share: near } }) {
  const row = (key, share) => html`
    <span class="dim">${word(key)}</span>
    <${Meter} label=${`${word(key)} ${percent(share)}`} share=${share} most=${most} tone=${typeof share !== "number" ? "" : share > most ? "stop" : share > near ? "hold" : "go"} />
    <${Figure}>${percent(share)}<//>`;
  const counted = typeof bus.transmit_errors === "number";
  return html`<div class="bus">
    <div class="row spread"><strong>${bus.name}</strong>
      <span class="dim">${bus.interface} · ${bus.bit_rate ? `${bus.bit_rate / 1000} kbit/s` : word("untimed")}</span></div>
    <div class="meters">${row("budget", bus.budget_share)}${row("fullest", bus.fullest_share)}${row("measured", bus.measured_share)}</div>
    <div class="row spread"><span class="dim">${bus.frames_per_s} ${word("frames")}</span>
      <span class=${bus.error_frames ? "wrong" : "dim"}>${bus.error_frames} ${word("error_frames")}${counted && `  TEC ${bus.transmit_errors}  REC ${bus.receive_errors}`}</span>
      </div>
  </div>`;
}

// By a logarithm: one tick in a million is what one looks for.
function Lateness({ late }) {
  const all = late.ticks.reduce((a, b) => a + b, 0) || 1;
  return late.ticks.map((count, i) => {
    const [from, to] = [late.from_us[i], late.from_us[i + 1]];
    const label = to === undefined ? `≥ ${from} µs` : `${from} – ${to} µs`;
    const share = count ? (1 + Math.log10(count)) / (1 + Math.log10(all)) : 0;
    return html`<span class="figures dim">${label}</span>
      <${Meter} label=${`${label}: ${count}`} share=${share} tone=${count && from >= late.skipped_from_us ? "stop" : "info"} />
      <${Figure}>${count}<//>`;
  });
}
