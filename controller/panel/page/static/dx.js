// The page's own end: hears the machine's events, shows them, and asks by the same routes as any script.
//
// Nothing here passes through the page's server side, so figures are as fresh as the event, a stop goes
// out whatever else is under way, and a panel that has died is seen at once.
(() => {
  "use strict";
  const API = "/api/v1/";
  const STALE_MS = 700; // statuses come every 50 ms
  const SILENT_MS = 3000; // a socket that says nothing for so long is opened anew
  const boot = window.dxBoot;
  const hearers = {};
  const dx = (window.dx = {
    status: null,
    stale: true,
    words: boot.words,
    language: boot.language,
    facts: boot.facts,
    role: boot.role,
    holder: null,
    token: "",
    view: "",
  });
  let socket = null;
  let lastStatus = -1e9;
  let lastTick = -1e9; // when the machine was seen to have ticked on: never later than the last status
  let silent = true; // nobody tells anything; a tick that hangs is told of, and can be started anew
  let lastWord = performance.now();
  let answers = true; // whether the controller's service answers the panel
  let why = "";

  dx.word = (key) => dx.words[key] ?? key;
  dx.on = (topic, fn) => (hearers[topic] ??= []).push(fn);
  dx.tell = (topic, data) => {
    for (const fn of hearers[topic] ?? []) {
      try {
        fn(data);
      } catch (error) {
        console.error(topic, error);
      }
    }
  };
  dx.shown = (name) => dx.view === name;
  dx.holds = () => dx.token !== "";

  // ---- asking

  const ticked = (status) => typeof status?.tick?.number === "number";

  // With the tick that was seen: a panel that hung must not do later what was pressed before.
  dx.headers = () => ({
    ...(ticked(dx.status) ? { "X-Seen-Tick": String(dx.status.tick.number) } : {}),
    ...(boot.csrf ? { "X-CSRF-Token": boot.csrf } : {}),
    ...(dx.token ? { "X-Control-Token": dx.token } : {}),
  });

  dx.call = async (method, path, body, quiet = false) => {
    const url = path.startsWith("/") ? path : API + path;
    const json = body !== undefined && body !== null;
    let said = { ok: false, status: 0, body: {} };
    try {
      const answer = await fetch(url, {
        method,
        keepalive: true,
        headers: { ...dx.headers(), ...(json ? { "Content-Type": "application/json" } : {}) },
        body: json ? JSON.stringify(body) : undefined,
      });
      said = { ok: answer.ok, status: answer.status, body: await answer.json().catch(() => ({})) };
    } catch (error) {
      said.body = { error: { sentence: dx.word("frame.no_panel") } };
    }
    if (said.status === 401) location.assign("/login");
    const confirmed = await unrecorded(said, quiet);
    if (confirmed) return dx.call(method, path, { ...body, ...confirmed });
    if (!said.ok) refused(said, quiet);
    return said;
  };

  // A run that cannot be kept starts only where somebody says so.
  async function unrecorded({ body }, quiet) {
    if (body.error?.code !== "unrecorded" || quiet) return null;
    const sentence = `${dx.sentence(body.error)} ${dx.word("run.unrecorded_ask")}`;
    return (await dx.ask(sentence)) ? { unrecorded: true } : null;
  }

  function refused(said, quiet) {
    const facts = said.body.error ?? {};
    if (facts.code === "control" && dx.token) hold("");
    if (!quiet) dx.say(dx.sentence(facts) || `${said.status}`, "warn");
  }

  // In the page's language, where it was told in both.
  dx.sentence = (facts, english = facts?.sentence) => (dx.language === "de" && facts?.sentence_de) || english || "";

  // What was refused, or done: a sentence at the bottom, one at a time.
  let fading = 0;
  dx.say = (sentence, tone = "info") => {
    const place = document.getElementById("dx-said");
    if (!place) return;
    place.textContent = sentence;
    place.dataset.tone = tone;
    place.hidden = false;
    clearTimeout(fading);
    fading = setTimeout(() => (place.hidden = true), 3000 + 60 * sentence.length);
  };

  // ---- the control token: of this page, kept over its reload and not copied with a tab

  const KEPT = "directrix.control";
  const kept = sessionStorage.getItem(KEPT);
  sessionStorage.removeItem(KEPT);
  if (kept) dx.token = kept;
  window.addEventListener("pagehide", () => dx.token && sessionStorage.setItem(KEPT, dx.token));
  window.addEventListener("pageshow", () => sessionStorage.removeItem(KEPT));

  function hold(token) {
    dx.token = token;
    dx.tell("control", { holder: dx.holder });
    marks();
  }

  dx.take = async () => {
    const other = dx.holder !== null && !dx.holds();
    if (other && !(await dx.ask(dx.word("frame.take_over").replace("{0}", dx.holder)))) return;
    const said = await dx.call("POST", "control", { take_over: other });
    if (!said.ok) return;
    dx.holder = said.body.holder;
    hold(said.body.token);
  };

  dx.give = async () => {
    const said = await dx.call("DELETE", "control");
    if (said.ok) dx.holder = null;
    hold("");
  };

  // Who holds it now, and whether it is this page: after a connection was lost, and when it changed.
  async function holder() {
    const sent = dx.token;
    const said = await dx.call("GET", "control", null, true);
    if (!said.ok) return;
    dx.holder = said.body.holder;
    if (sent === dx.token && !said.body.mine) dx.token = "";
    dx.tell("control", { holder: dx.holder });
    marks();
  }

  let asking = 0;
  dx.on("heard.control", (data) => {
    dx.holder = data.holder;
    clearTimeout(asking);
    asking = setTimeout(holder, 100); // the answer to our own taking may still be on its way
    dx.tell("control", { holder: dx.holder });
    marks();
  });

  // ---- questions: drawn here, so that they need nobody's answer to be shown or to go away

  dx.ask = (sentence, yes = "frame.yes") =>
    new Promise((resolve) => {
      document.querySelector(".dx-ask")?.end(false); // who asked it must not wait for ever
      const before = document.activeElement;
      const box = document.createElement("div");
      box.className = "dx-ask";
      box.setAttribute("role", "alertdialog");
      box.setAttribute("aria-modal", "true");
      box.setAttribute("aria-label", sentence);
      box.innerHTML = '<div class="card"><p></p><div class="row"><button class="act"></button><button class="act"></button></div></div>';
      box.querySelector("p").textContent = sentence;
      const [go, no] = box.querySelectorAll("button");
      go.textContent = dx.word(yes);
      no.textContent = dx.word("frame.no");
      go.dataset.kind = "go";
      const end = (said) => {
        box.remove();
        before?.focus({ preventScroll: true });
        resolve(said);
      };
      box.end = end;
      go.onclick = () => end(true);
      no.onclick = () => end(false);
      box.onkeydown = (event) => {
        if (event.key === "Escape") end(false);
      }; // returns nothing: false would take every other key away from the buttons
      document.body.append(box);
      go.focus();
    });

  // ---- the machine file can be another one when its service comes back: then the page is built anew

  const made_of = ({ axes, buses, spindle, inputs, outputs, retract_mm, period_s } = {}) =>
    JSON.stringify([axes, buses, spindle, inputs, outputs, retract_mm, period_s]);
  dx.on("service", async (told) => {
    if (!told.answers) return;
    const said = await dx.call("GET", "facts", null, true);
    if (said.ok && made_of(said.body) !== made_of(dx.facts)) location.reload();
  });

  // ---- buttons that ask: <button data-call="POST path" data-body='{}' data-ask="question">

  document.addEventListener("click", async (event) => {
    const button = event.target.closest?.("[data-call]");
    if (!button || button.disabled || button.getAttribute("aria-disabled") === "true") return;
    const { call, body, ask } = button.dataset;
    if (ask && !(await dx.ask(ask, button.dataset.yes || "frame.yes"))) return;
    const [method, path] = call.split(" ");
    button.dataset.busy = "1";
    const said = await dx.call(method, path, body ? JSON.parse(body) : null);
    delete button.dataset.busy;
    dx.tell("called", { button, said, call });
  });

  // Stop and emergency stop: at the press, not at its end, and whatever lies over the page.
  function at_once(id, work) {
    document.addEventListener("pointerdown", (event) => event.target.closest?.(id) && work(), true);
    document.addEventListener(
      "keydown",
      (event) => (event.key === "Enter" || event.key === " ") && !event.repeat && event.target.closest?.(id) && work(),
      true,
    );
  }
  dx.stop = () => {
    dx.tell("stop", null);
    dx.call("POST", "jog/stop", {}, true);
    return dx.call("POST", "cycle/stop", null, ["OFF", "READY", "JOG", "STOPPING"].includes(dx.status?.mode));
  };
  dx.estop = () => {
    dx.tell("stop", null);
    return dx.call("POST", "machine/estop");
  };
  // A key that is held must not press what comes under it: a question's yes, a start once more.
  document.addEventListener("keydown", (event) => {
    if (!event.repeat || event.key !== "Enter" || !event.target.closest?.("button, .dx-ask")) return;
    event.preventDefault();
    event.stopPropagation();
  }, true);
  at_once("#dx-stop", dx.stop);
  at_once("#dx-estop", dx.estop);
  document.addEventListener("keydown", (event) => {
    if (event.key === "F9") {
      event.preventDefault();
      if (!event.repeat) dx.stop();
    }
  }, true);

  // ---- views: all of them in one document, so that changing over takes no time and no server

  dx.show = (name) => {
    const views = [...document.querySelectorAll("section.view")];
    const to = views.find((view) => view.dataset.view === name) ?? views[0];
    if (!to) return;
    for (const view of views) view.toggleAttribute("data-shown", view === to);
    for (const tab of document.querySelectorAll("[data-to]")) {
      if (tab.dataset.to === to.dataset.view) tab.setAttribute("aria-current", "page");
      else tab.removeAttribute("aria-current");
    }
    if (dx.view === to.dataset.view) return;
    dx.view = to.dataset.view;
    history.replaceState(null, "", "#" + dx.view);
    window.emitEvent?.("dx-view", dx.view); // also of a view that is built: the server asks which one is seen
    dx.tell("view", dx.view);
    paint();
  };
  document.addEventListener("click", (event) => {
    const tab = event.target.closest?.("[data-to]");
    if (tab) dx.show(tab.dataset.to);
  });
  window.addEventListener("hashchange", () => dx.show(location.hash.slice(1)));
  // A view that is not made yet is asked for once more: the first time the connection may just have been lost.
  setInterval(() => {
    const view = document.querySelector("section.view[data-shown]");
    if (view && !view.dataset.built && window.emitEvent) window.emitEvent("dx-view", dx.view);
  }, 3000);

  // ---- figures: <span data-live="joints.X.work" data-form="mm">

  const number = (digits, factor = 1) => (v) => {
    if (typeof v !== "number") return "–";
    const text = (v * factor).toFixed(digits);
    return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
  };
  const forms = (dx.forms = {
    mm: number(3),
    deg: number(3),
    um: number(1, 1000),
    feed: number(0),
    int: number(0),
    ms: number(2),
    percent: (v) => (typeof v === "number" ? `${Math.round(v * 100)} %` : "–"),
    text: (v) => (v === null || v === undefined || v === "" ? "–" : String(v)),
    plain: (v) => (v === null || v === undefined ? "" : String(v)),
    yes: (v) => (v === null || v === undefined ? "–" : dx.word(v ? "frame.yes" : "frame.no")),
    list: (v) => (Array.isArray(v) && v.length ? v.join(" ") : "–"),
    time: (v) => {
      if (typeof v !== "number") return "–:––";
      const s = Math.max(0, Math.round(v));
      const two = (n) => String(n).padStart(2, "0");
      const h = Math.floor(s / 3600);
      const m = Math.floor(s / 60) % 60;
      return h ? `${h}:${two(m)}:${two(s % 60)}` : `${m}:${two(s % 60)}`;
    },
    bound: (v) => (v ? bound(v) : "–"),
    date: (v) => (typeof v === "number" ? new Date(v * 1000).toLocaleString(dx.language) : "–"),
  });

  // What limits the feed is told in English words; here they are turned one by one.
  function bound(text) {
    const whole = dx.words["bound." + text];
    if (whole) return whole;
    const [axis, kind] = text.split(/ (.*)/);
    return dx.words["bound." + kind] ? `${axis} ${dx.words["bound." + kind]}` : text;
  }

  dx.at = (from, path) => {
    let value = from;
    for (const part of path.split(".")) {
      if (value === null || value === undefined) return undefined;
      value = value[part];
    }
    return value;
  };

  function shown(value, form) {
    if (form.startsWith("word:")) return value ? dx.word(form.slice(5) + "." + value) : "–";
    return (forms[form] ?? forms.text)(value);
  }

  let asked = false;
  function paint() {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      if (dx.status) draw();
    });
  }

  function draw() {
    for (const one of document.querySelectorAll("[data-live]")) {
      const view = one.closest("section.view");
      if (view && !view.hasAttribute("data-shown")) continue;
      const text = shown(dx.at(dx.status, one.dataset.live), one.dataset.form || "text");
      if (one.textContent !== text) one.textContent = text;
    }
    for (const one of document.querySelectorAll("[data-bar]")) {
      const share = dx.at(dx.status, one.dataset.bar);
      one.style.setProperty("--share", typeof share === "number" ? Math.min(1, Math.max(0, share)) : 0);
    }
    for (const one of document.querySelectorAll("[data-on]")) {
      one.setAttribute("aria-pressed", String(Boolean(dx.at(dx.status, one.dataset.on))));
    }
    // What scrolls can be reached by the keyboard.
    for (const one of document.querySelectorAll(".scroll:not([tabindex])")) one.tabIndex = 0;
    marks();
    dx.tell("painted", dx.status);
  }

  // What may be pressed now; the machine refuses by itself, this only says so beforehand.
  function marks() {
    const body = document.body;
    const mode = dx.status?.mode ?? "OFF";
    if (body.dataset.mode !== mode) body.dataset.mode = mode;
    body.dataset.stale = dx.stale ? "1" : "";
    body.dataset.fault = dx.status?.fault ? "1" : "";
    body.dataset.barred = dx.status?.shown?.interlock ? "1" : "";
    body.dataset.failed = dx.status?.shown?.failed ? "1" : "";
    body.dataset.role = dx.role;
    body.dataset.control = dx.holds() ? "mine" : dx.holder ? "other" : "free";
    const other = document.getElementById("dx-holder");
    if (other) other.textContent = dx.holds() ? dx.word("frame.mine") : (dx.holder ?? dx.word("frame.free"));
    for (const one of document.querySelectorAll("[data-needs], [data-modes]")) {
      const { needs, modes, if: field } = one.dataset;
      const may = dx.role !== "view" && !silent && (needs !== "control" || dx.holds());
      const now = !modes || modes.split(" ").includes(mode);
      const off = !(may && now && (!field || dx.at(dx.status, field)));
      if (one.disabled !== off) one.disabled = off;
    }
  }

  // ---- hearing

  function heard(text) {
    const { event, data } = JSON.parse(text);
    lastWord = performance.now();
    if (event === "status") {
      // Without a tick there is no figure that could be old; one that hangs leaves its last ones.
      if (!ticked(data) || data.tick.number !== dx.status?.tick?.number) lastTick = lastWord;
      dx.status = { ...data, control: dx.holder, shown: sentences(data) };
      lastStatus = lastWord;
      if (dx.stale) age();
      dx.tell("status", dx.status);
      paint();
    } else if (event === "control") {
      dx.tell("heard.control", data);
    } else {
      if (event === "service") {
        answers = data.answers;
        why = dx.sentence(data);
      }
      dx.tell(event, data);
    }
  }

  // What is wrong and what is under way, as the frame's lines show it.
  function sentences({ fault, sequence, notices, interlock, warning, waiting, spindle, tool_change }) {
    const trusted = fault && fault.position_trusted !== null && fault.position_trusted !== undefined;
    const told = (name) => dx.sentence(notices?.find((one) => one.name === name && name !== fault?.name));
    const waits = spindle && !spindle.at_speed ? "waits.spindle" : "waits.others";
    const running = sequence?.state === "running";
    return {
      fault: fault ? dx.sentence(fault) || fault.name : "",
      next: trusted ? dx.word(fault.position_trusted ? "frame.trusted" : "frame.not_trusted") : "",
      under_way: running ? dx.word("sequence." + sequence.name) : tool_change ? dx.sentence(tool_change) : waiting ? dx.word(waits) : "",
      interlock: told(interlock),
      warning: told(warning) || told("PLAN_SILENT"),
      failed: sequence?.state === "failed" ? dx.sentence(sequence) : "",
    };
  }

  function age() {
    const now = performance.now();
    const [stale, quiet] = [now - lastTick > STALE_MS, now - lastStatus > STALE_MS];
    const turned = stale !== dx.stale;
    if (turned || quiet !== silent) {
      [dx.stale, silent] = [stale, quiet];
      if (turned) dx.tell("stale", stale);
      marks();
    }
    if (stale) told_stale(now);
    if (socket && socket.readyState === WebSocket.OPEN && answers && now - lastWord > SILENT_MS) socket.close();
  }

  function told_stale(now) {
    const place = document.getElementById("dx-stale-text");
    if (!place) return;
    const since = lastTick > 0 ? ` ${Math.round((now - lastTick) / 1000)} s` : "";
    const open = socket && socket.readyState === WebSocket.OPEN;
    const text = dx.word(!silent ? "frame.no_tick" : open && !answers ? "frame.no_service" : "frame.no_panel");
    place.textContent = text + (since ? ` (${dx.word("frame.since")}${since})` : "");
    place.title = why;
  }

  function connect() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    socket = new WebSocket(`${scheme}//${location.host}${API}events`);
    lastWord = performance.now();
    socket.onmessage = (message) => heard(message.data);
    socket.onopen = () => {
      dx.tell("connected", null);
      holder();
    };
    socket.onclose = (event) => {
      dx.tell("disconnected", null);
      if (event.code === 1008) holder(); // logged out: the answer says so
      setTimeout(connect, 400);
    };
  }
  connect();
  setInterval(age, 100);

  // ---- theme and language

  dx.remember = (key, value) => {
    document.cookie = `directrix_${key}=${value}; path=/; max-age=31536000; samesite=strict`;
  };
  dx.theme = () => {
    const dark = !document.body.classList.contains("body--dark");
    dx.remember("theme", dark ? "dark" : "light");
    window.setDark?.(dark);
  };
  dx.speak = (language) => {
    dx.remember("language", language);
    location.reload();
  };
  // Whoever leaves takes no control along.
  async function log_out() {
    if (dx.holds()) await dx.give();
    const said = await dx.call("DELETE", "session");
    if (said.ok) location.assign("/login");
  }
  document.addEventListener("click", (event) => {
    if (event.target.closest?.("#dx-theme")) dx.theme();
    if (event.target.closest?.("#dx-language")) dx.speak(dx.language === "en" ? "de" : "en");
    if (event.target.closest?.("#dx-log-out")) log_out();
    if (event.target.closest?.("#dx-control")) (dx.holds() ? dx.give : dx.take)();
  });

  // The frame is there a little later than this script.
  const waiting = setInterval(() => {
    if (!document.querySelector("section.view")) return;
    clearInterval(waiting);
    dx.show(location.hash.slice(1));
    dx.tell("ready", null);
    age();
    marks();
  }, 30);
})();
