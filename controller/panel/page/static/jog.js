// Jog with a dead-man: moves while a button is held and this page is seen, and not a moment longer.
//
// The machine itself stops 200 ms after the last request; whatever ends a press sends the end at
// once as well. A press has a name, so that a request which comes late cannot begin it again.
(() => {
  "use strict";
  const AGAIN_MS = 70;
  const MODES = ["READY", "HOLD", "JOG"]; // in which it may move
  const dx = window.dx;
  const chosen = { frame: "joint", step: "0" };
  let speed = 0.2;
  let press = null; // { name, axis, sign, source, timer, asking }
  let keyboard = false;
  let presses = 0;

  function begin(axis, sign, source) {
    if (press || dx.stale || !dx.holds()) return;
    if (chosen.step !== "0") {
      dx.call("POST", "jog/step", { frame: chosen.frame, axis, distance: sign * Number(chosen.step) });
      return;
    }
    const name = `${Date.now().toString(36)}-${++presses}-${Math.random().toString(36).slice(2, 8)}`;
    press = { name, axis, sign, source, frame: chosen.frame, asking: false };
    press.timer = setInterval(again, AGAIN_MS);
    again();
  }

  // One request at a time: those that wait behind a slow one would come all at once. One that comes
  // too late moves nothing: the panel knows it by the tick that was seen here.
  async function again() {
    const own = press;
    if (!own || own.asking) return;
    own.asking = true;
    const body = { frame: own.frame, axis: own.axis, speed: own.sign * speed, press: own.name };
    const said = await dx.call("POST", "jog", body, true);
    own.asking = false;
    if (said.ok || own !== press) return;
    const { error } = said.body;
    if (error?.code !== "late") end();
    dx.say(dx.sentence(error), "warn");
  }

  function end(tell = false) {
    if (!press) return;
    clearInterval(press.timer);
    const { name } = press;
    press = null;
    mark();
    dx.call("POST", "jog/stop", { press: name }, true);
    if (tell) dx.say(dx.word("jog.stopped"));
  }

  function mark() {
    for (const one of document.querySelectorAll("[data-jog]")) {
      const on = press && one.dataset.jog === press.axis && (one.dataset.sign === "+") === press.sign > 0;
      one.toggleAttribute("data-down", Boolean(on));
    }
  }

  // ---- pointer

  document.addEventListener("pointerdown", (event) => {
    const button = event.target.closest?.("[data-jog]");
    if (!button || button.disabled || event.button !== 0) return;
    event.preventDefault();
    // Not captured: a finger that slides off the button has let it go.
    if (button.hasPointerCapture?.(event.pointerId)) button.releasePointerCapture(event.pointerId);
    begin(button.dataset.jog, button.dataset.sign === "+" ? 1 : -1, button);
    mark();
  });
  for (const name of ["pointerup", "pointercancel", "contextmenu"])
    document.addEventListener(name, (event) => {
      if (name === "contextmenu" && event.target.closest?.("[data-jog]")) event.preventDefault();
      if (press && press.source !== "key") end();
    }, true);
  document.addEventListener("pointerout", (event) => {
    if (press && press.source === event.target.closest?.("[data-jog]") && !press.source.contains(event.relatedTarget)) end();
  });

  // ---- whatever takes the page out of sight or the machine out of reach

  window.addEventListener("blur", () => end(true));
  document.addEventListener("visibilitychange", () => document.hidden && end());
  window.addEventListener("beforeunload", () => end());
  window.addEventListener("pagehide", () => end());
  document.addEventListener("freeze", () => end());
  dx.on("disconnected", () => end());
  dx.on("stale", (stale) => stale && end());
  dx.on("stop", () => end());
  dx.on("view", (name) => name !== "jog" && end());
  dx.on("control", () => !dx.holds() && end());
  dx.on("status", (status) => press && !MODES.includes(status.mode) && end());

  // ---- keyboard: off until it is switched on, and off again with the view

  const KEYS = {
    ArrowLeft: ["X", -1], ArrowRight: ["X", 1], ArrowDown: ["Y", -1], ArrowUp: ["Y", 1],
    PageDown: ["Z", -1], PageUp: ["Z", 1],
  };
  document.addEventListener("keydown", (event) => {
    const button = event.target.closest?.("[data-jog]");
    const own = button && (event.key === " " || event.key === "Enter");
    if (own) event.preventDefault();
    if (event.repeat || !dx.shown("jog")) return;
    if (own && !button.disabled) {
      begin(button.dataset.jog, button.dataset.sign === "+" ? 1 : -1, "key");
      mark();
    } else if (keyboard && KEYS[event.key] && !event.target.closest?.("input, textarea, .dx-ask")) {
      event.preventDefault();
      if (MODES.includes(dx.status?.mode)) begin(...KEYS[event.key], "key");
      mark();
    }
  });
  window.addEventListener("keyup", () => press?.source === "key" && end(), true);

  async function switchKeyboard(button) {
    const on = keyboard ? false : await dx.ask(button.dataset.question);
    keyboard = on;
    button.setAttribute("aria-pressed", String(on));
  }
  dx.on("view", (name) => {
    if (name === "jog") return;
    keyboard = false;
    document.getElementById("jog-keyboard")?.setAttribute("aria-pressed", "false");
  });

  // ---- choices

  document.addEventListener("click", (event) => {
    const button = event.target.closest?.("[data-choice]");
    if (button) {
      end();
      chosen[button.dataset.choice] = button.dataset.value;
      for (const one of document.querySelectorAll(`[data-choice=${button.dataset.choice}]`))
        one.setAttribute("aria-pressed", String(one === button));
      fit();
    }
    if (event.target.closest?.("#jog-keyboard")) switchKeyboard(event.target.closest("#jog-keyboard"));
  });
  // Rotaries have no direction in the part, nor in the tool's frame.
  function fit() {
    for (const one of document.querySelectorAll(".jog-axis"))
      one.toggleAttribute("data-off", chosen.frame !== "joint" && !one.dataset.linear);
  }
  document.addEventListener("input", (event) => {
    if (event.target.id !== "jog-speed") return;
    speed = event.target.valueAsNumber / 100;
    document.getElementById("jog-speed-shown").textContent = `${event.target.value} %`;
  });

  // ---- MDI, with what was typed before

  const KEPT = "directrix.mdi";
  const MOST = 50;
  const history = () => JSON.parse(localStorage.getItem(KEPT) ?? "[]");
  let back = -1;

  function list() {
    const place = document.getElementById("mdi-history");
    place?.replaceChildren(
      ...history().map((text) => {
        const one = Object.assign(document.createElement("button"), { type: "button", textContent: text });
        one.onclick = () => {
          document.getElementById("mdi-text").value = text;
          document.getElementById("mdi-text").focus();
        };
        return one;
      }),
    );
  }

  async function run() {
    const field = document.getElementById("mdi-text");
    const button = document.getElementById("mdi-run");
    const text = field.value.trim();
    if (!text || button.disabled || !(await dx.ask(`${button.dataset.question} ${text}`, "jog.run"))) return;
    localStorage.setItem(KEPT, JSON.stringify([text, ...history().filter((old) => old !== text)].slice(0, MOST)));
    back = -1;
    list();
    const said = await dx.call("POST", "mdi", { text });
    if (said.ok) field.value = "";
  }
  document.addEventListener("submit", (event) => event.target.id === "mdi" && event.preventDefault());
  document.addEventListener("click", (event) => event.target.closest?.("#mdi-run") && run());
  document.addEventListener("keydown", (event) => {
    if (event.target.id !== "mdi-text") return;
    const { value, selectionStart } = event.target;
    const above = value.slice(0, selectionStart).includes("\n"); // then the key moves within the text
    if (event.key === "Enter" && !event.shiftKey) {
      event.preventDefault();
      if (!event.repeat) run();
    }
    const old = history();
    if (event.key === "ArrowUp" && !above && back < old.length - 1)
      event.target.value = old[++back];
    if (event.key === "ArrowDown" && back > 0) event.target.value = old[--back];
  });
  dx.on("painted", () => {
    const place = document.getElementById("mdi-history");
    if (place && dx.shown("jog") && !place.childElementCount) list();
  });
})();
