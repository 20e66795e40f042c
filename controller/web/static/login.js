// The log-in: it stands before everything else, and asks one thing.
import { html, render, useState } from "./dom.js";
import { dx } from "./store.js";
import { learn, sentence, word } from "./texts.js";

function LogIn() {
  const [said, say] = useState("");
  async function send(event) {
    event.preventDefault();
    const { name, password } = event.target.elements;
    try {
      const answer = await fetch("/api/v1/session", {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify({ name: name.value, password: password.value }),
      });
      if (answer.ok) location.assign("/");
      else say(sentence((await answer.json()).error));
    } catch {
      say(word("frame.no_panel"));
    }
  }
  return html`<main><form class="card" onsubmit=${send}>
    <h1>Directrix</h1>
    <label>${word("login.name")}<input id="name" name="name" autocomplete="username" autofocus required maxlength="40" /></label>
    <label>${word("login.password")}<input id="password" name="password" type="password" autocomplete="current-password" required /></label>
    <p role="alert">${said}</p>
    <button class="act" data-kind="go">${word("login.title")}</button>
  </form></main>`;
}

await learn(dx.language);
render(html`<${LogIn} />`, document.body);
