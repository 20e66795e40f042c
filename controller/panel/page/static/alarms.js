// Alarms: what is wrong now, and the history with who saw it.
(() => {
  "use strict";
  const dx = window.dx;
  const word = (key) => dx.word(`alarms.${key}`);
  const said = (name, what) => dx.words[`alarms.${what}.${name}`] ?? "";
  let before = null; // of the next page
  let pages = [];

  const recording = (facts) => (facts.recording ? facts.recording.split("/").pop() : "");

  function links(facts) {
    const name = recording(facts);
    if (!name) return "–";
    const path = `recordings/${encodeURIComponent(name)}`;
    return dx.el(
      "span",
      { class: "row" },
      dx.button(word("scope"), () => dx.openScope?.(`recording:${name}`)),
      dx.link("trace.npz", `${path}/trace.npz`),
      dx.link("frames.log", `${path}/frames.log`),
    );
  }

  function seen(alarm) {
    if (alarm.acknowledged_s !== null) {
      return dx.el("span", { class: "dim" }, `${alarm.acknowledged_by} · ${dx.forms.date(alarm.acknowledged_s)}`);
    }
    const press = async () => {
      const answer = await dx.call("POST", `alarms/${alarm.id}/acknowledge`);
      if (answer.ok) look();
    };
    return dx.button(word("acknowledge"), press, { "data-needs": "role", "aria-label": `${word("acknowledge")} ${alarm.id}` });
  }

  function trusted(facts) {
    if (facts.position_trusted === undefined || facts.position_trusted === null) return "–";
    return facts.position_trusted ? dx.chip(word("trusted"), "go") : dx.chip(word("not_trusted"), "stop");
  }

  function card(alarm) {
    const facts = alarm.facts;
    const open = alarm.acknowledged_s === null;
    return dx.el(
      "article",
      { class: "alarm-card", "data-open": open ? "1" : null },
      dx.el(
        "div",
        { class: "alarm-head" },
        dx.el("span", { class: "figures dim" }, `#${alarm.id}`),
        dx.el("strong", {}, alarm.name),
        alarm.axis ? dx.chip(alarm.axis, "info") : null,
        trusted(facts),
        dx.el("time", { class: "figures dim" }, dx.forms.date(alarm.at_s)),
      ),
      dx.el("p", {}, dx.sentence(facts, alarm.sentence)),
      dx.el(
        "dl",
        { class: "facts" },
        ...["cause", "remedy"].flatMap((what) => {
          const text = said(alarm.name, what) || facts[what] || "";
          return text ? [dx.el("dt", {}, word(what)), dx.el("dd", {}, text)] : [];
        }),
        ...(facts.line ? [dx.el("dt", {}, word("line")), dx.el("dd", { class: "figures" }, String(facts.line))] : []),
      ),
      dx.el("div", { class: "row alarm-foot" }, seen(alarm), recording(facts) ? links(facts) : null),
    );
  }

  function show() {
    const alarms = pages.flat();
    dx.fill("alarms-list", (rows) => (rows.length ? rows.map(card) : dx.el("p", { class: "dim" }, word("none"))), alarms);
    const more = document.getElementById("alarms-more");
    if (more) more.hidden = before === null;
  }

  const look = dx.every("alarms", 2, () => `alarms?most=50&only=${only()}`, (body) => {
    if (pages.length > 1) return; // older pages are being read
    pages = [body.alarms];
    before = body.before;
    show();
  });
  const only = () => (document.getElementById("alarms-open")?.getAttribute("aria-pressed") === "true" ? "open" : "all");

  document.addEventListener("click", async (event) => {
    if (event.target.closest?.("#alarms-more")) {
      const said = await dx.call("GET", `alarms?most=50&only=${only()}&before_id=${before}`);
      if (!said.ok) return;
      pages.push(said.body.alarms);
      before = said.body.before;
      show();
    }
    const toggle = event.target.closest?.("#alarms-open");
    if (toggle) {
      toggle.setAttribute("aria-pressed", String(toggle.getAttribute("aria-pressed") !== "true"));
      pages = [];
      look();
    }
  });
  dx.on("alarms", look);

  // What is there now, with its remedy in full.
  dx.on("status", (status) => {
    if (!dx.shown("alarms")) return;
    const fault = status.fault;
    dx.fill(
      "alarms-now",
      (now) =>
        now
          ? [
              dx.el("div", { class: "alarm-head" }, dx.el("strong", {}, now.name), now.axis ? dx.chip(now.axis, "info") : null, trusted(now)),
              dx.el("p", { class: "alarm-words" }, dx.sentence(now, now.sentence)),
              dx.el(
                "dl",
                { class: "facts" },
                dx.el("dt", {}, word("cause")),
                dx.el("dd", {}, said(now.name, "cause") || now.cause || "–"),
                dx.el("dt", {}, word("remedy")),
                dx.el("dd", {}, said(now.name, "remedy") || now.remedy || "–"),
                dx.el("dt", {}, word("recording")),
                dx.el("dd", {}, links(now)),
              ),
            ]
          : dx.el("p", { class: "dim" }, word("quiet")),
      fault ?? null,
    );
  });
})();
