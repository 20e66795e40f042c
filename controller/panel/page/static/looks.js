// What several views use: elements, lists that are asked for while their view is on the screen.
(() => {
  "use strict";
  const dx = window.dx;

  // <tag attrs>children</tag>; a text is a child, too. Attributes beginning with "on" are listeners.
  dx.el = (tag, attrs = {}, ...children) => {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attrs)) {
      if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
      else if (name in made && typeof value === "boolean") made[name] = value;
      else if (value !== null && value !== undefined && value !== false) made.setAttribute(name, value === true ? "" : value);
    }
    made.append(...children.filter((child) => child !== null && child !== undefined));
    return made;
  };

  dx.chip = (words, tone = "") => dx.el("span", { class: "chip", "data-tone": tone || null }, words);
  dx.icon = (name) => dx.el("i", { class: "q-icon notranslate material-icons", "aria-hidden": "true" }, name);
  dx.button = (words, press, attrs = {}) => dx.el("button", { class: "act", type: "button", onclick: press, ...attrs }, words);

  // Children are exchanged only where they changed: what one is pointing at stays under the finger.
  dx.fill = (id, make, ...from) => {
    const place = document.getElementById(id);
    if (!place) return;
    const key = JSON.stringify(from);
    if (place.dataset.key === key) return;
    place.dataset.key = key;
    place.replaceChildren(...[make(...from)].flat());
  };

  dx.write = (place, text) => {
    if (place && place.textContent !== text) place.textContent = text;
  };

  // Ask for a path again and again while a view is shown; fn gets the body of each answer.
  dx.every = (view, seconds, path, fn) => {
    let busy = false;
    const look = async () => {
      if (!dx.shown(view) || busy || document.hidden) return;
      busy = true;
      try {
        const said = await dx.call("GET", typeof path === "function" ? path() : path, null, true);
        dx.write(document.getElementById(`${view}-said`), said.ok ? "" : dx.sentence(said.body.error));
        if (said.ok) fn(said.body);
      } finally {
        busy = false;
      }
    };
    dx.on("view", (name) => name === view && setTimeout(look, 50));
    dx.on("built", look);
    setInterval(look, seconds * 1000);
    return look;
  };

  // A history, the newest first. What is listed is asked for anew at each look, so that old entries are up to
  // date, too. Gives [look, anew]: the second lists no more than at first.
  const PAGE = 50;
  const MOST = 1000; // that the routes tell at once
  dx.history = (view, seconds, path, fn) => {
    let wanted = PAGE;
    const look = dx.every(view, seconds, () => path(wanted), (body) => {
      fn(body);
      const more = document.getElementById(`${view}-more`);
      if (more) more.hidden = body.before === null || wanted >= MOST;
    });
    const list = (most) => {
      wanted = Math.min(MOST, most);
      look();
    };
    document.addEventListener("click", (event) => event.target.closest?.(`#${view}-more`) && list(wanted + PAGE));
    return [look, () => list(PAGE)];
  };

  // A question with an answer in words; null: given up.
  dx.ask_for = async (sentence, yes, start, attrs = {}) => {
    const answer = dx.ask(sentence, yes);
    const box = document.querySelector(".dx-ask");
    const field = dx.el("input", { type: "text", value: start, "aria-label": sentence, ...attrs });
    field.addEventListener("keydown", (event) => event.key === "Enter" && box.querySelector("[data-kind=go]").click());
    box.querySelector("p").after(field);
    field.select();
    field.focus();
    return (await answer) ? field.value : null;
  };

  dx.axis = (name) => (dx.facts?.axes ?? []).find((axis) => axis.name === name) ?? {};
  dx.link = (words, path) => dx.el("a", { class: "act", href: `/api/v1/${path}`, download: "" }, words);
  dx.seconds = (v) => (typeof v !== "number" ? "–" : v < 60 ? `${v.toFixed(1)} s` : dx.forms.time(v));
})();
