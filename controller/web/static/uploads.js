// Uploads with their progress, by the same route as any script.
import { API, call, headers } from "./api.js";
import { ask, say } from "./dialog.js";
import { html } from "./dom.js";
import { show } from "./frame.js";
import { Icon } from "./icons.js";
import { Bar } from "./parts.js";
import { changed, dx } from "./store.js";
import { sentence, word } from "./texts.js";

const SHOWN_MS = 15000; // one that was refused
export const in_folder = (name) => (dx.folder ? `${dx.folder}/${name}` : name);
let uploads = []; // { name, share, said }
let over = false;
// One after another: a browser has six connections to a server, and a stop needs one of them.
let before = Promise.resolve();

function upload(file) {
  const name = in_folder(file.name);
  const one = { name, share: null, said: "" };
  const away = () => {
    uploads = uploads.filter((other) => other !== one);
    dx.draw();
  };
  uploads = [...uploads, one];
  before = before.then(async () => {
    if (!(await wanted(name))) return away();
    one.said = await send(file, one, name);
    if (!one.said) return away();
    say(`${name}: ${one.said}`, "warn");
    setTimeout(away, SHOWN_MS);
  });
}

// What is there already is replaced only by one who says so. The store has names composed, some systems do not.
async function wanted(name) {
  const there = await call("GET", `programs/${encodeURIComponent(name.normalize())}`, null, true);
  return !there.ok || ask(word("programs.replace_ask", name), "programs.replace");
}

// "" where it was taken, else why not.
export function send(file, one, name) {
  const form = new FormData();
  form.append("name", name); // a file's own name has no folder
  form.append("file", file, file.name);
  const asking = new XMLHttpRequest();
  asking.open("POST", `${API}programs`);
  for (const header of Object.entries(headers())) asking.setRequestHeader(...header);
  asking.upload.onprogress = ({ loaded, total }) => {
    one.share = total ? loaded / total : 0;
    dx.draw();
  };
  return new Promise((resolve) => {
    asking.onloadend = () => resolve(asking.status === 201 ? "" : refusal(asking));
    asking.send(form);
  });
}

function refusal(asking) {
  try {
    return sentence(JSON.parse(asking.responseText).error) || word("frame.no_panel");
  } catch {
    return word("frame.no_panel"); // no answer at all: the panel is gone
  }
}

// Dropped anywhere on the page it is an upload: never a page that is opened in place of this one.
function drag(on) {
  if (over !== on) changed();
  over = on;
}
document.addEventListener("dragover", (event) => {
  event.preventDefault();
  if (event.dataTransfer?.types.includes("Files")) show("programs");
  drag(true);
});
document.addEventListener("dragleave", (event) => event.relatedTarget === null && drag(false));
document.addEventListener("drop", (event) => {
  event.preventDefault();
  drag(false);
  for (const file of event.dataTransfer?.files ?? []) upload(file);
  changed();
});

export function Uploads({ children }) {
  const take = (event) => {
    for (const file of event.target.files) upload(file);
    event.target.value = "";
    changed();
  };
  return html`
    <div class="drop" id="programs-drop" data-over=${over ? "1" : undefined}>
      <${Icon} name="upload" /><span>${word("programs.drop")}</span>
      <label class="act"><span>${word("programs.choose")}</span><input type="file" multiple id="programs-file" onchange=${take} /></label>${children}
    </div>
    <div class="uploads" id="programs-uploads" aria-live="polite">${uploads.map(
      (one) => html`<div class="upload" key=${one} data-tone=${one.said ? "stop" : undefined}><span class="upload-name">${one.name}</span>
        <${Bar} share=${one.share} />
        <span class="figures upload-share">${one.said || (one.share === null ? "" : `${Math.round(one.share * 100)} %`)}</span></div>`,
    )}</div>`;
}
