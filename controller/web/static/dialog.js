// Questions and notices: drawn by the page alone, so that they need nobody's answer to be shown or to go away.
import { Component, createRef, html } from "./dom.js";
import { Icon } from "./icons.js";
import { dx } from "./store.js";
import { word } from "./texts.js";

// true or false; with a ``field`` (attributes of an input) what was typed, or null.
export const ask = (sentence, yes = "frame.yes", field = null, start = "") =>
  new Promise((resolve) => {
    dx.question?.end(false); // who asked it must not wait for ever
    const end = (said) => {
      if (dx.question !== question) return;
      dx.question = null;
      dx.draw();
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

// The browser keeps the focus in it, and gives it back behind it; what is not in it cannot be reached meanwhile.
// So the stops are, at their own place, and what is said of a stop (``children``).
export class Question extends Component {
  dialog = createRef();

  componentDidMount() {
    this.dialog.current.showModal();
    const field = this.dialog.current.querySelector("input");
    if (field) field.value = this.props.asked.start; // once: what is typed stays
    field?.select();
    this.place();
    window.addEventListener("resize", this.place);
  }

  componentDidUpdate() {
    this.place();
  }

  componentWillUnmount() {
    window.removeEventListener("resize", this.place);
    this.dialog.current.close();
  }

  place = () => {
    const { left, top, width, height } = document.querySelector("header .stops").getBoundingClientRect();
    const px = Object.entries({ left, top, width, height }).map(([name, value]) => [name, `${value}px`]);
    Object.assign(this.dialog.current.querySelector(".stops").style, Object.fromEntries(px));
  };

  render({ asked: { sentence, yes, field, end }, children }) {
    const no = () => end(field ? null : false);
    const answered = (event) => {
      event.preventDefault(); // nothing is sent by it
      end(field ? this.dialog.current.querySelector("input").value : true);
    };
    return html`<dialog class="dx-ask" role="alertdialog" aria-label=${sentence} ref=${this.dialog} oncancel=${no}>
      <form class="card" method="dialog" onsubmit=${answered}>
        <p>${sentence}</p>
        ${field && html`<input type="text" aria-label=${sentence} autofocus ...${field} />`}
        <div class="row">
          <button class="act" data-kind="go" autofocus=${!field}>${word(yes)}</button>
          <button class="act" type="button" onclick=${no}>${word("frame.no")}</button>
        </div>
      </form>
      ${children}
    </dialog>`;
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
