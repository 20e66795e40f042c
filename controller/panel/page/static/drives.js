// Drives and buses: what each says of itself, and how much room a tick has.
(() => {
  "use strict";
  const dx = window.dx;
  const word = (key) => dx.word(`drives.${key}`);
  const TONES = { OPERATION_ENABLED: "go", FAULT: "stop", FAULT_REACTION_ACTIVE: "stop", QUICK_STOP_ACTIVE: "hold" };
  // Bits of the statusword (CiA 402, 6041h); 8, 14 and 15 are the maker's own.
  const BITS = ["ready", "on", "enabled", "fault", "voltage", "no_quick_stop", "disabled", "warning", "8", "remote", "reached", "limit", "follows", "following_error", "14", "15"];
  const QUIET = new Set(["8", "14", "15"]);

  const bits = (status) =>
    typeof status === "number"
      ? BITS.map((name, i) => ((status >> i) & 1 ? dx.chip(dx.words[`drives.bit.${name}`] ?? name, name === "fault" || name === "following_error" ? "stop" : QUIET.has(name) ? "" : "info") : null))
      : ["–"];

  const age = (seconds) => (typeof seconds === "number" ? `${Math.round(seconds * 1000)} ms` : "–");

  const warmth = (degrees) => (typeof degrees === "number" ? `${degrees.toFixed(1)} °C` : "–");

  function build(status) {
    // Only where the machine file says how the drives tell it.
    const told = status.drives.some((drive) => drive.temperature_c !== undefined);
    document.querySelector(".drives-all")?.toggleAttribute("data-warmth", told);
    dx.fill("drives-list", (names) => names.map(row), status.drives.map((drive) => drive.axis));
  }

  const cell = (axis, what, classes = "figures") => dx.el("td", { class: classes, "data-drive": `${axis}.${what}`, "data-label": word(what) });
  function row(axis) {
    return dx.el(
      "tr",
      {},
      dx.el("th", { scope: "row" }, dx.el("span", { class: "axis-name" }, axis)),
      cell(axis, "node", "d-node figures"),
      cell(axis, "state", ""),
      cell(axis, "mode", "d-mode"),
      cell(axis, "target", "figures d-target"),
      cell(axis, "actual"),
      cell(axis, "error"),
      cell(axis, "warmth", "figures d-warmth"),
      cell(axis, "age", "figures d-age"),
      cell(axis, "said", ""),
      cell(axis, "bits", "d-bits"),
    );
  }

  let last = 0;
  dx.on("status", (status) => {
    const now = performance.now();
    if (!dx.shown("drives") || now - last < 90 || !status.drives) return; // ten times a second are enough to read
    last = now;
    build(status);
    for (const drive of status.drives) {
      const joint = status.joints?.[drive.axis] ?? {};
      const texts = { node: `${drive.bus} · ${drive.node}`, target: dx.forms.mm(joint.machine), actual: dx.forms.mm(joint.actual), error: dx.forms.um(joint.error), age: age(drive.heartbeat_age_s), warmth: warmth(drive.temperature_c) };
      for (const [what, text] of Object.entries(texts)) dx.write(at(drive.axis, what), text);
      put(drive.axis, "state", drive.state, () => dx.chip(dx.words[`drives.state.${drive.state}`] ?? drive.state ?? "–", TONES[drive.state] ?? "info"));
      put(drive.axis, "mode", [drive.homing, drive.cyclic_mode], () => mode(drive));
      put(drive.axis, "said", drive.error, () =>
        drive.error ? dx.el("span", { class: "wrong" }, drive.error) : dx.el("span", { class: "dim" }, word("nothing")),
      );
      put(drive.axis, "bits", drive.statusword, () => bits(drive.statusword));
    }
  });

  const mode = (drive) => (drive.homing ? word("homing") : (dx.words[`drives.cyclic.${drive.cyclic_mode}`] ?? "–"));
  const at = (axis, what) => document.querySelector(`[data-drive="${axis}.${what}"]`);
  function put(axis, what, value, make) {
    const place = at(axis, what);
    const key = JSON.stringify(value ?? null);
    if (!place || place.dataset.value === key) return;
    place.dataset.value = key;
    place.replaceChildren(...[make()].flat().filter(Boolean));
  }

  // ---- buses

  const percent = (share) => (typeof share === "number" ? `${(share * 100).toFixed(1)} %` : "–");
  function meter(label, share, { max_share: most, near_share: near }) {
    const tone = typeof share !== "number" ? "" : share > most ? "stop" : share > near ? "hold" : "go";
    const bar = dx.el("div", { class: "meter", "data-tone": tone, role: "img", "aria-label": `${label} ${percent(share)}` });
    bar.style.setProperty("--share", Math.min(1, share ?? 0));
    bar.style.setProperty("--most", most);
    return [dx.el("span", { class: "dim" }, label), bar, dx.el("span", { class: "figures" }, percent(share))];
  }

  function bus(one, limits) {
    const counters = one.transmit_errors === null || one.transmit_errors === undefined ? "" : `  TEC ${one.transmit_errors}  REC ${one.receive_errors}`;
    return dx.el(
      "div",
      { class: "bus" },
      dx.el("div", { class: "row spread" }, dx.el("strong", {}, one.name), dx.el("span", { class: "dim" }, `${one.interface} · ${one.bit_rate ? one.bit_rate / 1000 + " kbit/s" : word("untimed")}`)),
      dx.el("div", { class: "meters" }, ...meter(word("budget"), one.budget_share, limits), ...meter(word("fullest"), one.fullest_share, limits), ...meter(word("measured"), one.measured_share, limits)),
      dx.el("div", { class: "row spread" }, dx.el("span", { class: "dim" }, `${one.frames_per_s} ${word("frames")}`), dx.el("span", { class: one.error_frames ? "wrong" : "dim" }, `${one.error_frames} ${word("error_frames")}${counters}`)),
    );
  }

  function lateness(late) {
    const all = late.ticks.reduce((a, b) => a + b, 0) || 1;
    return late.ticks.flatMap((count, i) => {
      const from = late.from_us[i];
      const to = late.from_us[i + 1];
      const label = to === undefined ? `≥ ${from} µs` : `${from} – ${to} µs`;
      // A logarithm: one tick in a million is what one looks for.
      const bar = dx.el("div", { class: "meter", "data-tone": count && from >= late.skipped_from_us ? "stop" : "info", role: "img", "aria-label": `${label}: ${count}` });
      bar.style.setProperty("--share", count ? (1 + Math.log10(count)) / (1 + Math.log10(all)) : 0);
      bar.style.setProperty("--most", 1);
      return [dx.el("span", { class: "figures dim" }, label), bar, dx.el("span", { class: "figures" }, String(count))];
    });
  }

  dx.every("drives", 1, "machine/buses", (body) => {
    dx.fill("drives-buses", (buses) => buses.map((one) => bus(one, body)), body.buses);
    dx.fill("drives-late", lateness, body.lateness);
    dx.write(document.getElementById("drives-late-of"), word("late_of").replace("{0}", Math.round(body.lateness.seconds)));
  });
})();
