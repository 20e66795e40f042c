// Questions and notices: drawn by the page alone, so that they need nobody's answer to be shown or to go away.
import { Component, createRef, html } from "./dom.js";
import { Icon } from "./icons.js";
import { dx } from "./store.js";
import { word } from "./texts.js";

// true or false; with a ``field`` (attributes of an input) what was typed, or null.
export const ask = (sentence, yes = "frame.yes", field = null, start = "") =>
  new Promise((resolve) => {
    dx.question?.end(false); // who asked it must not wait for ever
    const before = document.activeElement;
    const end = (said) => {
      if (dx.question !== question) return;
      dx.question = null;
      dx.draw();
      before?.focus?.({ preventScroll: true });
      resolve(said);
    };
    const question = { sentence, yes, field, start, end };
    dx.question = question;
    dx.draw();
  });

export const ask_for = async (sentence, yes, start, attributes = {}) =>
  (await ask(sentence, yes, attributes, start)) || null;

// What was refused, or done: one sentence at the bottom, which goes by itself; ``stay``: until it is closed.
let fading = 0;
export function say(sentence, tone = "info", stay = false) {
  clearTimeout(fading);
  dx.notice = sentence ? { sentence, tone } : null;
  if (sentence && !stay) fading = setTimeout(() => say(""), 3000 + 60 * sentence.length);
  dx.draw();
}

export const Notice = () =>
  html`<div class="said" id="dx-said" role="status" hidden=${!dx.notice} data-tone=${dx.notice?.tone}>
    <span>${dx.notice?.sentence}</span>
    <button class="close" type="button" aria-label=${word("frame.close")} title=${word("frame.close")} onclick=${() => say("")}>
      <${Icon} name="close" /></button>
  </div>`;

export class Question extends Component {
  box = createRef();

  componentDidMount() {
    const field = this.box.current.querySelector("input");
    if (field) field.value = this.props.asked.start; // once: what is typed stays
    field?.select();
    (field ?? this.box.current.querySelector("[data-kind=go]")).focus();
  }

  render({ asked: { sentence, yes, field, end } }) {
    const typed = () => (field ? this.box.current.querySelector("input").value : true);
    const key = (event) => {
      if (event.key === "Escape") end(field ? null : false);
      if (event.key === "Tab") go_round(event);
      if (event.key !== "Enter" || event.target.tagName !== "INPUT") return;
      event.preventDefault(); // else it would press what gets the focus back, and ask anew
      end(typed());
    };
    // The focus stays with the question; hold and stop have their keys.
    const go_round = (event) => {
      event.preventDefault();
      const all = [...this.box.current.querySelectorAll("input, button")];
      const to = all.indexOf(document.activeElement) + (event.shiftKey ? -1 : 1);
      all[(to + all.length) % all.length].focus();
    };
    return html`<div class="dx-ask" role="alertdialog" aria-modal="true" aria-label=${sentence} tabindex="-1" ref=${this.box} onkeydown=${key}>
      <div class="card">
        <p>${sentence}</p>
        ${field && html`<input type="text" aria-label=${sentence} ...${field} />`}
        <div class="row">
          <button class="act" type="button" data-kind="go" onclick=${() => end(typed())}>${word(yes)}</button>
          <button class="act" type="button" onclick=${() => end(field ? null : false)}>${word("frame.no")}</button>
        </div>
      </div>
    </div>`;
  }
}

// A key that is held must not press what comes under it: a question's yes, a start once more.
document.addEventListener(
  "keydown",
  (event) => {
    if (!event.repeat || event.key !== "Enter" || !event.target.closest?.("button, .dx-ask")) return;
    event.preventDefault();
    event.stopPropagation();
  },
  true,
);
