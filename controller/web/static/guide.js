// What to do next, in one sentence, as the machine says it; with the button for it where it can be done now.
import { free, take } from "./control.js";
import { html } from "./dom.js";
import { show } from "./frame.js";
import { Act } from "./parts.js";
import { not_offered, offer, start_question } from "./restart.js";
import { dx } from "./store.js";
import { sentence, word } from "./texts.js";
import { recent } from "./views/run.js";
import { confirm } from "./views/setup_changer.js";

// By the verb of the service: the button, as an Act takes it; none where this page has not what it needs.
const BUTTONS = {
  reset: () => ({ text: word("frame.reset"), call: "POST machine/reset", kind: "warn", icon: "reset" }),
  enable: () => ({ text: word("run.enable"), call: "POST machine/enable", icon: "power" }),
  home: () => ({ text: word("run.home"), call: "POST machine/home", body: {}, ask: word("run.home_ask"), icon: "home" }),
  start: () => ({ text: word("run.start"), call: "POST cycle/start", ask: start_question(), kind: "go", icon: "play" }),
  resume: () => ({ text: word("run.resume"), call: "POST cycle/resume", kind: "go", icon: "reset" }),
  return: () => ({ text: word("run.return"), call: "POST cycle/return" }),
  stop: () => ({ text: word("frame.stop"), call: "POST cycle/stop", needs: "role", kind: "warn" }),
  withdraw: ({ is_out }) => ({ ...thread(is_out ? "is_out" : "withdraw"), body: is_out ? { is_out } : {} }),
  load: () => offer() && { text: word("programs.go_on"), call: "POST job", body: { program: offer().program, restart: true }, kind: "go", icon: "load" },
  mdi: ({ text }) => ({ text, call: "POST mdi", body: { text }, ask: `${word("jog.mdi_ask")} ${text}`, icon: "play" }),
  changer_confirm: () => ({ text: word("changer.confirm"), press: () => confirm(dx.status.changer), needs: "role", icon: "setup" }),
};
const thread = (key) => ({ text: word(`run.${key}`), call: "POST cycle/withdraw", ask: word(`run.${key}_ask`), kind: "warn" });

// Why the last run did not come to its end: until somebody has seen it, or another begins.
const Ended = ({ why }) => html`<p class="ended" role="status"><strong>${sentence(why)}</strong> <${Act} text=${word("run.seen")} call="POST job/seen" needs="role" /></p>`;

export function Guide() {
  const why = dx.status?.ended_early;
  return html`${why && html`<${Ended} why=${why} />`}<${Next} />`;
}

function Next() {
  const next = dx.status?.next;
  if (!next || dx.silent) return null;
  const button = BUTTONS[next.verb]?.(next.args);
  const control = button && dx.user?.role !== "view" && needs_control(next.verb, button);
  return html`<p class="next" data-verb=${next.verb} data-place=${next.place} data-waits=${next.waits ? "1" : undefined}>
    <span>${word("run.next")}</span> <strong>${control ? word("next.control") : (next.verb === "load" && not_offered()) || sentence(next)}</strong>
    ${control ? html` <${Act} text=${word("frame.take")} needs="role" class="next-take" icon="hand" press=${take} />` : button && html` <${Act} ...${button} />`}
    ${next.place === "programs" && html` <${Choose} />`}
    ${next.place === "alarms" && html` <${Act} text=${word("view.alarms")} needs="" icon="alarms" press=${() => show("alarms")} />`}
  </p>`;
}

// Where nobody has control, the yes to a question takes it, too.
const needs_control = (verb, button) => !dx.holds() && verb !== "stop" && !(free() && (button.ask || verb === "changer_confirm"));

// The program that came last and passed its check, or a look at the list.
function Choose() {
  const [last] = dx.status.job || !dx.holds() ? [] : recent();
  return html`${last && html`<${Act} text=${word("run.load", last.name)} call="POST job" body=${{ program: last.name }} icon="load" />`}
    <${Act} text=${word("run.choose")} needs="" icon="programs" press=${() => show("programs")} />`;
}
