// Alarms: what is wrong now, and the history with who saw it.
(() => {
  "use strict";
  const dx = window.dx;
  const word = (key) => dx.word(`alarms.${key}`);
  const said = (name, what) => dx.words[`alarms.${what}.${name}`] ?? "";

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

  // The number is the machine's own; the name is the same in every language, as in the fault table.
  const head = (number, name) => [number ? dx.el("span", { class: "figures dim" }, `#${number}`) : null, dx.el("span", { class: "dim" }, name)];

  function card(alarm) {
    const facts = alarm.facts;
    const open = alarm.acknowledged_s === null;
    return dx.el(
      "article",
      { class: "alarm-card", "data-open": open ? "1" : null },
      dx.el(
        "div",
        { class: "alarm-head" },
        ...head(facts.number ?? alarm.id, alarm.name),
        alarm.axis ? dx.chip(alarm.axis, "info") : null,
        trusted(facts),
        dx.el("time", { class: "figures dim" }, dx.forms.date(alarm.at_s)),
      ),
      dx.el("p", {}, dx.el("strong", {}, dx.sentence(facts, alarm.sentence))),
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

  function show({ alarms }) {
    dx.fill("alarms-list", (rows) => (rows.length ? rows.map(card) : dx.el("p", { class: "dim" }, word("none"))), alarms);
  }

  const [look, anew] = dx.history("alarms", 2, (most) => `alarms?most=${most}&only=${only()}`, show);
  const only = () => (document.getElementById("alarms-open")?.getAttribute("aria-pressed") === "true" ? "open" : "all");

  document.addEventListener("click", (event) => {
    const toggle = event.target.closest?.("#alarms-open");
    if (!toggle) return;
    toggle.setAttribute("aria-pressed", String(toggle.getAttribute("aria-pressed") !== "true"));
    anew();
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
              dx.el("div", { class: "alarm-head" }, ...head(now.number, now.name), now.axis ? dx.chip(now.axis, "info") : null, trusted(now), now.time_s ? dx.el("time", { class: "figures dim" }, dx.forms.date(now.time_s)) : null),
              dx.el("p", { class: "alarm-words" }, dx.sentence(now)),
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
