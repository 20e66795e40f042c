// The run view's own figures: the text with the line that runs, bars of following errors, overrides.
(() => {
  "use strict";
  const AROUND = 14; // lines shown before the one that runs
  const ROWS = 60;
  const TOLD_MS = 300; // after an answer, until a status tells what it did
  const dx = window.dx;
  let program = { key: "", lines: null };
  let painted = "";

  dx.forms.u = (v) => (typeof v === "number" ? v.toFixed(4) : "–");
  dx.forms.what = (v) => (v ? (dx.words["what." + v] ?? v) : "");
  dx.forms.coolant = (v) => ["mist", "flood"].filter((kind) => v?.[kind]).map((kind) => dx.word(`run.${kind}`)).join(", ") || "–";
  dx.forms.unit = (v) => (typeof v === "number" ? v.toFixed(5).replace("-", "−") : "–");

  // ---- the program text

  async function fetched(job) {
    const key = job ? `${job.name} ${job.sha256}` : "";
    if (key === program.key) return;
    program = { key, lines: null };
    painted = "";
    if (!job) return;
    if (typeof job.text === "string") {
      program.lines = job.text.split("\n"); // typed by hand, and in no store
      return listing();
    }
    const answer = await fetch(`/api/v1/programs/${encodeURIComponent(job.name)}/text`, { headers: dx.headers() });
    if (!answer.ok || key !== program.key) return;
    program.lines = (await answer.text()).split(/\r\n|\n|\r/);
    listing();
  }

  function listing() {
    const place = document.getElementById("run-listing");
    if (!place) return;
    const job = dx.status?.job;
    const empty = document.getElementById("run-empty");
    if (empty) empty.hidden = Boolean(job);
    place.hidden = !job;
    if (!job) return;
    const now = job.line ?? 0;
    const first = Math.max(1, now - AROUND);
    const key = `${program.key} ${first} ${now} ${program.lines?.length}`;
    if (key === painted) return;
    painted = key;
    place.replaceChildren(...rows(program.lines ?? [], first, now));
    // Only the listing scrolls: a page that jumped at each line could not be read on a phone.
    const line = place.querySelector(".now");
    if (line) place.scrollTop = line.offsetTop - place.offsetTop - (place.clientHeight - line.clientHeight) / 2;
  }

  function rows(lines, first, now) {
    const found = [];
    for (let n = first; n <= Math.min(lines.length, first + ROWS); n++) {
      const one = document.createElement("div");
      one.className = n === now ? "now" : n < now ? "past" : "";
      const number = document.createElement("span");
      number.className = "n";
      number.textContent = n;
      const words = document.createElement("span");
      words.textContent = lines[n - 1] || " ";
      one.append(number, words);
      found.push(one);
    }
    return found;
  }

  // ---- axes

  function marks(status) {
    for (const one of document.querySelectorAll("[data-homed]")) {
      const homed = Boolean(status.joints?.[one.dataset.homed]?.homed);
      one.dataset.state = homed ? "yes" : "no";
      const shown = dx.word(homed ? "run.homed" : "run.not_homed");
      if (one.textContent !== shown) one.textContent = shown;
    }
    for (const one of document.querySelectorAll("[data-limit]")) {
      const limit = status.joints?.[one.dataset.limit]?.limit;
      const shown = limit ? `${dx.word("run.limit")} ${limit.replace("-", "−")}` : "";
      if (one.textContent !== shown) one.textContent = shown;
    }
    for (const one of document.querySelectorAll("[data-error]")) {
      const axis = dx.facts.axes?.find((a) => a.name === one.dataset.error);
      const error = status.joints?.[one.dataset.error]?.error;
      const share = axis && typeof error === "number" ? error / axis.following_error : 0;
      const size = Math.min(1, Math.abs(share));
      one.style.setProperty("--size", size);
      one.style.setProperty("--side", share < 0 ? 1 : 0);
      one.dataset.tone = size > 0.8 ? "stop" : size > 0.5 ? "hold" : "go";
    }
  }

  // ---- overrides: what is told by the machine is shown, what is dragged is sent when it is let go

  let dragging = false;
  let wanted = null; // override (%) that was asked for and may not be told yet
  let telling = 0;

  async function ask_override(percent) {
    wanted = Math.min(200, Math.max(0, percent));
    clearTimeout(telling);
    await dx.call("PUT", "overrides/feed", { share: wanted / 100 });
    clearTimeout(telling);
    telling = setTimeout(() => (wanted = null), TOLD_MS);
  }

  document.addEventListener("input", (event) => event.target.id === "run-override" && (dragging = true));
  document.addEventListener("change", (event) => event.target.id === "run-override" && ask_override(event.target.valueAsNumber));
  // There is no change where it is dragged back to where it was.
  for (const name of ["change", "pointerup", "pointercancel", "keyup", "focusout"])
    document.addEventListener(name, () => (dragging = false));
  document.addEventListener("click", (event) => {
    const step = event.target.closest?.("[data-override]");
    if (step && dx.status) ask_override((wanted ?? Math.round(dx.status.override * 100)) + Number(step.dataset.override));
    const toggle = event.target.closest?.("[data-toggle]");
    if (toggle && !toggle.disabled) {
      const [method, path] = toggle.dataset.toggle.split(" ");
      dx.call(method, path, { on: toggle.getAttribute("aria-pressed") !== "true" });
    }
  });

  function overrides(status) {
    const slider = document.getElementById("run-override");
    if (slider && !dragging && wanted === null && typeof status.override === "number") slider.value = Math.round(status.override * 100);
    for (const one of document.querySelectorAll("[data-rapid]")) {
      const now = Math.round((status.rapid_override ?? -1) * 100) === Number(one.dataset.rapid);
      one.setAttribute("aria-pressed", String(now));
    }
  }

  // ---- off along the tool axis: preset to what is possible here, until somebody gives another distance

  let given = false;

  function retract(status) {
    const field = document.getElementById("run-retract-mm");
    const room = status.retract_room_mm;
    if (!field) return;
    if (typeof room !== "number") given = false; // it moves, or stands off already: the next place has its own
    field.max = room ?? "";
    if (!given) field.value = typeof room === "number" ? room : "";
    const body = JSON.stringify({ mm: field.valueAsNumber });
    const button = document.getElementById("run-retract");
    if (button.dataset.body !== body) button.dataset.body = body;
  }

  document.addEventListener("input", (event) => {
    if (event.target.id !== "run-retract-mm") return;
    given = true;
    retract(dx.status ?? {});
  });

  dx.on("status", (status) => fetched(status.job));
  dx.on("painted", (status) => {
    if (!dx.shown("run")) return;
    listing();
    marks(status);
    overrides(status);
    retract(status);
  });
})();
