// Scope: any signal of every tick; run, single shot with a trigger, cursors, files. Data come thinned for the
// width of the screen, each column with its lowest and highest tick, so that no spike is lost.
(() => {
  "use strict";
  const dx = window.dx;
  const word = (key) => dx.word(`scope.${key}`);
  const $ = (id) => document.getElementById(id);
  const COLOURS = { dark: ["#5cc8ff", "#ffbe3d", "#3ddc84", "#ff8a85", "#c9a4ff", "#7fe3d4", "#f0f3a0", "#ffa6d8"], light: ["#00609a", "#8a5a00", "#0b6b3a", "#b3141b", "#6a3fb0", "#00695c", "#5f6300", "#a3216e"] };
  const KEPT = "directrix.scope";
  const PAD = { left: 8, right: 8, top: 8, bottom: 22 };
  const state = { source: "now", names: [], seconds: 2, running: true, armed: false, first: null, last: null, trigger: null, cursors: [null, null], hand: 0, data: null, units: {}, fired: "" };
  try {
    const kept = JSON.parse(localStorage.getItem(KEPT) ?? "{}");
    if (Array.isArray(kept.names)) state.names = kept.names.slice(0, 8);
    if (typeof kept.seconds === "number") state.seconds = kept.seconds;
  } catch (error) {
    // nothing that is kept is worth an error
  }
  const keep = () => localStorage.setItem(KEPT, JSON.stringify({ names: state.names, seconds: state.seconds }));
  const colour = (i) => (document.body.classList.contains("body--dark") ? COLOURS.dark : COLOURS.light)[i % 8];
  const css = (name) => getComputedStyle(document.body).getPropertyValue(name).trim();

  // ---- asking

  let busy = false;
  let wanted = false; // another picture is asked for, or was while one was on its way

  const path = (kind, more) => `ticks${kind}?${new URLSearchParams({ source: state.source, ...more })}`;

  // null where it was refused, and where another source was chosen meanwhile.
  async function get(kind, more) {
    const { source } = state;
    const said = await dx.call("GET", path(kind, more), null, true);
    if (source !== state.source) return null;
    dx.write($("scope-said"), said.ok ? "" : dx.sentence(said.body.error));
    return said.ok ? said.body : null;
  }

  async function signals() {
    const body = await get("/signals", {});
    if (!body) return null;
    state.units = body.signals;
    state.names = state.names.filter((name) => name in body.signals);
    if (!state.names.length) state.names = ["feed", `${Object.keys(body.signals)[0].split(".")[0]}.error`];
    options(Object.keys(body.signals));
    return body;
  }

  function options(names) {
    for (const id of ["scope-add", "scope-trigger-signal"]) {
      const place = $(id);
      if (!place || place.options.length > 1) continue;
      for (const name of names) place.append(dx.el("option", { value: name }, shown(name)));
      if (id === "scope-trigger-signal") place.value = "feed";
    }
  }

  const shown = (name) => {
    const [axis, what] = name.includes(".") ? name.split(".") : ["", name];
    return `${axis} ${dx.words[`scope.signal.${what}`] ?? what}`.trim();
  };

  async function window_(first, last) {
    const width = Math.max(200, Math.min(1600, $("scope-canvas")?.clientWidth ?? 800));
    const more = { names: state.names.join(","), most: Math.round(width / 2) };
    if (first !== null) more.first = Math.max(0, first);
    if (last !== null) more.last = last;
    const body = await get("", more);
    if (!body) return;
    if (!Object.keys(body.high).length) body.high = body.low;
    state.data = body;
    draw();
  }

  async function look() {
    if (busy) {
      wanted = true;
      return;
    }
    busy = true;
    const asked = wanted;
    wanted = false; // from here on it stands for what comes while this one is on its way
    try {
      if (!Object.keys(state.units).length && !(await signals())) return;
      if (state.source !== "now") await still(asked);
      else if (state.armed) await hunt();
      else if (state.running) await roll();
      else if (asked) await window_(state.first, state.last);
    } finally {
      busy = false;
      if (wanted) setTimeout(look, 0);
    }
  }

  const period = () => state.data?.period_s ?? dx.facts?.period_s ?? 0.002;
  const width_ticks = () => Math.max(2, Math.round(state.seconds / period()));

  async function roll() {
    const span = state.data ? null : await get("/signals", {});
    if (state.source !== "now") return;
    const newest = span?.newest ?? state.data?.newest ?? null;
    // The newest tick is known from the last answer; what came since is in this one.
    state.first = newest === null ? null : newest - width_ticks();
    state.last = null;
    await window_(state.first, null);
    if (state.last === null && state.data?.ticks.length) { // else another one was chosen meanwhile
      state.last = state.data.newest;
      state.first = state.data.newest - width_ticks();
    }
  }

  async function still(asked) {
    if (state.first === null) {
      const body = await get("/signals", {});
      if (!body) return;
      [state.first, state.last] = [body.oldest, body.newest];
    }
    if (!state.data || asked) await window_(state.first, state.last);
  }

  // A single shot: wait for the trigger, then until all that is wanted behind it has come.
  async function hunt() {
    if (state.trigger === null) {
      const more = { name: $("scope-trigger-signal").value, level: Number($("scope-level").value) || 0, edge: $("scope-edge").value };
      if (state.after !== null) more.after = state.after;
      const body = await get("/trigger", more);
      if (!body) return;
      if (body.tick === null) {
        state.after = Math.max(state.after ?? 0, (body.newest ?? 1) - 1);
        return;
      }
      state.trigger = body.tick;
    }
    const before = Math.round((width_ticks() * (Number($("scope-before").value) || 0)) / 100);
    state.first = state.trigger - before;
    state.last = state.first + width_ticks();
    await window_(state.first, state.last);
    if ((state.data?.newest ?? 0) >= state.last) {
      state.armed = state.running = false;
      buttons();
    }
  }

  // ---- drawing

  function draw() {
    const canvas = $("scope-canvas");
    const data = state.data;
    if (!canvas || !data) return;
    const scale = window.devicePixelRatio || 1;
    const { clientWidth: w, clientHeight: h } = canvas;
    if (canvas.width !== Math.round(w * scale)) canvas.width = Math.round(w * scale);
    if (canvas.height !== Math.round(h * scale)) canvas.height = Math.round(h * scale);
    const pen = canvas.getContext("2d");
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, w, h);
    const [first, last] = ends();
    canvas.dataset.perColumn = data.per_column; // a cursor reads one tick where that is 1
    const x = (tick) => PAD.left + ((tick - first) / Math.max(1, last - first)) * (w - PAD.left - PAD.right);
    grid(pen, w, h, first, last, x);
    const lane = (h - PAD.top - PAD.bottom) / Math.max(1, state.names.length);
    state.names.forEach((name, i) => trace(pen, name, i, PAD.top + i * lane, lane, x, w));
    marks(pen, h, x);
    values();
  }

  const ends = () => {
    const ticks = state.data.ticks;
    const first = state.first ?? ticks[0] ?? 0;
    return [first, Math.max(first + 1, state.last ?? ticks[ticks.length - 1] ?? first + 1)];
  };

  function grid(pen, w, h, first, last, x) {
    pen.strokeStyle = css("--line");
    pen.fillStyle = css("--dim");
    pen.font = "14px Roboto, sans-serif";
    pen.lineWidth = 1;
    const seconds = (last - first) * period();
    const step = nice(seconds / Math.max(2, Math.floor(w / 110)));
    const zero = state.trigger !== null && state.source === "now" && !state.running ? state.trigger : first;
    const from = Math.ceil(((first - zero) * period()) / step) * step;
    for (let t = from; t <= (last - zero) * period() + 1e-12; t += step) {
      const at = Math.round(x(zero + t / period())) + 0.5;
      pen.beginPath();
      pen.moveTo(at, PAD.top);
      pen.lineTo(at, h - PAD.bottom);
      pen.stroke();
      const label = `${Number(t.toFixed(6))} s`;
      if (at + pen.measureText(label).width + 4 < w) pen.fillText(label, at + 3, h - 6);
    }
  }

  function nice(step) {
    const power = 10 ** Math.floor(Math.log10(step));
    return [1, 2, 5, 10].map((n) => n * power).find((n) => n >= step) ?? step;
  }

  const range = (name) => {
    let low = Infinity;
    let high = -Infinity;
    for (const v of state.data.low[name] ?? []) if (v !== null && v < low) low = v;
    for (const v of state.data.high[name] ?? []) if (v !== null && v > high) high = v;
    return low <= high ? [low, high] : [0, 0];
  };
  const figure = (v) => (v === null || v === undefined ? "–" : String(Number(v.toPrecision(6))).replace("-", "−"));

  function trace(pen, name, i, top, lane, x, w) {
    const [low, high] = range(name);
    const around = high > low ? 0.08 * (high - low) : Math.abs(high) * 0.1 || 1;
    const y = (v) => top + lane - ((v - low + around) / (high - low + 2 * around)) * lane;
    pen.strokeStyle = css("--line");
    pen.beginPath();
    pen.moveTo(PAD.left, Math.round(top + lane) + 0.5);
    pen.lineTo(w - PAD.right, Math.round(top + lane) + 0.5);
    pen.stroke();
    pen.strokeStyle = colour(i);
    pen.lineWidth = 1.6;
    pen.lineJoin = "round";
    pen.beginPath();
    let down = false;
    let before = 0;
    const { ticks } = state.data;
    const lows = state.data.low[name] ?? [];
    const highs = state.data.high[name] ?? [];
    for (let k = 0; k < ticks.length; k += 1) {
      if (lows[k] === null || lows[k] === undefined) {
        down = false;
        continue;
      }
      const at = x(ticks[k]);
      // Of a column's two ends the nearer one comes first: a slope is no saw.
      const near = down && Math.abs(highs[k] - before) < Math.abs(lows[k] - before);
      const [from, to] = near ? [highs[k], lows[k]] : [lows[k], highs[k]];
      if (down) pen.lineTo(at, y(from));
      else pen.moveTo(at, y(from));
      if (to !== from) pen.lineTo(at, y(to));
      before = to;
      down = true;
    }
    pen.stroke();
    label(pen, `${shown(name)}  ${figure(low)} … ${figure(high)} ${state.units[name] ?? ""}`, i, top);
  }

  function label(pen, text, i, top) {
    pen.font = "500 14px Roboto, sans-serif";
    pen.fillStyle = css("--bg");
    pen.globalAlpha = 0.8;
    pen.fillRect(PAD.left + 2, top + 2, pen.measureText(text).width + 10, 20);
    pen.globalAlpha = 1;
    pen.fillStyle = colour(i);
    pen.fillText(text, PAD.left + 7, top + 17);
  }

  function marks(pen, h, x) {
    const line = (tick, style, dash, name) => {
      if (tick === null) return;
      pen.strokeStyle = pen.fillStyle = style;
      pen.setLineDash(dash);
      pen.lineWidth = 1.5;
      pen.beginPath();
      pen.moveTo(x(tick), PAD.top);
      pen.lineTo(x(tick), h - PAD.bottom);
      pen.stroke();
      pen.setLineDash([]);
      pen.font = "700 14px Roboto, sans-serif";
      pen.fillText(name, x(tick) + 4, h - PAD.bottom - 6);
    };
    line(state.trigger, css("--hold"), [6, 4], "T");
    line(state.cursors[0], css("--text"), [], "1");
    line(state.cursors[1], css("--text"), [2, 3], "2");
  }

  // ---- cursors: a tick each, and the values there

  function index(tick) {
    const { ticks } = state.data;
    let low = 0;
    let high = ticks.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (ticks[middle] <= tick) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  const at = (name, tick) => {
    const i = index(tick);
    const [low, high] = [state.data.low[name]?.[i], state.data.high[name]?.[i]];
    return low === high ? figure(low) : `${figure(low)} … ${figure(high)}`;
  };

  function values() {
    const [one, two] = state.cursors;
    for (const name of state.names) {
      const place = document.querySelector(`[data-signal="${name}"]`);
      if (!place || !state.data?.ticks.length) continue;
      const last = state.data.ticks[state.data.ticks.length - 1];
      dx.write(place, [one ?? last, ...(two === null ? [] : [two])].map((tick) => at(name, tick)).join("\n"));
    }
    const apart = one !== null && two !== null ? Math.abs(two - one) : null;
    const text = [one !== null ? `1: ${word("tick")} ${one}` : "", two !== null ? `2: ${word("tick")} ${two}` : "", apart ? `Δ ${apart} = ${Number((apart * period()).toPrecision(5))} s = ${Number((1 / (apart * period())).toPrecision(4))} Hz` : ""];
    dx.write($("scope-cursors"), text.filter(Boolean).join("   ") || word("cursor_hint"));
  }

  // A tick that is shown: between two columns there is nothing to be read.
  const exact = (tick) => (state.data.per_column === 1 ? state.data.ticks[index(tick)] : tick);

  function pointed(event) {
    if (!state.data?.ticks.length) return;
    const box = event.target.getBoundingClientRect();
    const [first, last] = ends();
    const share = (event.clientX - box.left - PAD.left) / (box.width - PAD.left - PAD.right);
    const tick = exact(Math.round(first + Math.min(1, Math.max(0, share)) * (last - first)));
    const [one, two] = state.cursors;
    if (one === null) state.cursors = [tick, null];
    else if (two === null && one !== tick) state.cursors = [one, tick];
    else state.cursors = [tick, null];
    state.hand = state.cursors[1] === null ? 0 : 1;
    draw();
  }

  // By keys: 1 and 2 take a cursor in hand, arrows lead it from column to column, with shift ten at once.
  const STEPS = { ArrowLeft: -1, ArrowRight: 1 };
  function typed(event) {
    if (event.target.id !== "scope-canvas" || !state.data?.ticks.length || event.ctrlKey || event.metaKey || event.altKey) return;
    const taken = ["1", "2"].indexOf(event.key);
    if (event.key === "Escape") presses["scope-none"]();
    else if (taken >= 0) take(taken);
    else if (event.key in STEPS) lead(STEPS[event.key] * (event.shiftKey ? 10 : 1));
    else return;
    event.preventDefault();
    draw();
  }

  function take(hand) {
    const [first, last] = ends();
    if (hand === 1 && state.cursors[0] === null) take(0);
    state.hand = hand;
    state.cursors[hand] ??= exact(Math.round(first + (hand ? 0.6 : 0.4) * (last - first)));
  }

  function lead(columns) {
    if (state.cursors[state.hand] === null) return take(state.hand);
    const { ticks } = state.data;
    const to = index(state.cursors[state.hand]) + columns;
    state.cursors[state.hand] = ticks[Math.min(ticks.length - 1, Math.max(0, to))];
  }

  function zoom(factor, centre = 0.5) {
    if (!state.data) return;
    const [first, last] = ends();
    const span = Math.max(8, Math.round((last - first) * factor));
    state.running = state.armed = false;
    state.first = Math.max(0, Math.round(first + (last - first) * centre - span * centre));
    state.last = state.first + span;
    buttons();
    wanted = true;
    look();
  }

  function move(share) {
    const [first, last] = ends();
    const by = Math.round((last - first) * share);
    state.running = state.armed = false;
    state.first = Math.max(0, first + by);
    state.last = state.first + (last - first);
    buttons();
    wanted = true;
    look();
  }

  // ---- what is pressed

  function list() {
    dx.fill(
      "scope-signals",
      (names) =>
        names.map((name, i) => {
          const mark = dx.el("i", {});
          mark.style.setProperty("--colour", colour(i));
          const away = () => {
            state.names = state.names.filter((other) => other !== name);
            changed();
          };
          return dx.el("div", { class: "signal" }, mark, dx.el("strong", {}, shown(name)), dx.el("span", { class: "figures signal-values", "data-signal": name }), dx.button("×", away, { "aria-label": `${word("remove")} ${shown(name)}` }));
        }),
      state.names,
      document.body.className,
    );
  }

  function changed() {
    keep();
    list();
    files();
    wanted = true;
    look();
  }

  function files() {
    for (const kind of ["csv", "npz"]) {
      const link = $(`scope-${kind}`);
      if (!link) continue;
      const more = { names: state.names.join(",") };
      if (!state.running && state.first !== null) Object.assign(more, { first: Math.max(0, state.first), last: state.last ?? 0 });
      link.href = `/api/v1/${path(`/export.${kind}`, more)}`;
    }
  }

  function buttons() {
    const live = state.source === "now";
    const set = (id, on) => $(id)?.setAttribute("aria-pressed", String(on));
    set("scope-run", live && state.running && !state.armed);
    set("scope-single", live && state.armed);
    for (const id of ["scope-run", "scope-single"]) if ($(id)) $(id).disabled = !live;
    dx.write($("scope-state"), state.armed ? word(state.trigger === null ? "waiting" : "filling") : state.running && live ? word("running") : word("standing"));
    files();
  }

  const presses = {
    "scope-run": () => {
      state.running = !state.running || state.armed;
      state.armed = false;
      state.trigger = null;
      if (state.running) state.cursors = [null, null];
    },
    "scope-single": () => {
      state.armed = !state.armed;
      state.trigger = null;
      state.cursors = [null, null];
      state.after = state.data?.newest ?? null;
      if (!state.armed) state.running = false;
    },
    "scope-in": () => zoom(0.5),
    "scope-out": () => zoom(2),
    "scope-left": () => move(-0.25),
    "scope-right": () => move(0.25),
    "scope-none": () => Object.assign(state, { cursors: [null, null], hand: 0 }),
  };
  document.addEventListener("click", (event) => {
    const press = presses[event.target.closest?.("[id^=scope-]")?.id];
    if (!press) return;
    press();
    buttons();
    draw();
  });
  document.addEventListener("pointerdown", (event) => event.target.id === "scope-canvas" && pointed(event));
  document.addEventListener("keydown", typed);
  document.addEventListener(
    "wheel",
    (event) => {
      if (event.target.id !== "scope-canvas") return;
      event.preventDefault();
      const box = event.target.getBoundingClientRect();
      zoom(event.deltaY > 0 ? 1.25 : 0.8, (event.clientX - box.left) / box.width);
    },
    { passive: false },
  );
  document.addEventListener("change", (event) => {
    const { id, value } = event.target;
    if (id === "scope-add" && value) {
      if (!state.names.includes(value) && state.names.length < 8) state.names.push(value);
      event.target.value = "";
      changed();
    } else if (id === "scope-seconds") {
      state.seconds = Number(value);
      keep();
      if (state.source !== "now" || !state.running) {
        const [first] = state.data ? ends() : [0];
        state.first = first;
        state.last = first + width_ticks();
      }
      changed();
    } else if (id === "scope-source") choose(value);
  });

  function choose(source) {
    Object.assign(state, { source, data: null, first: null, last: null, trigger: null, cursors: [null, null], armed: false, running: source === "now", units: {} });
    const place = $("scope-source");
    if (place && place.value !== source) {
      if (![...place.options].some((one) => one.value === source)) place.append(dx.el("option", { value: source }, source.split(":")[1]));
      place.value = source;
    }
    buttons();
    wanted = true;
    look();
  }
  // From alarms and runs: their ticks, opened here.
  dx.openScope = (source) => {
    dx.show("scope");
    opened = source;
    if ($("scope-source")) choose(source);
  };
  let opened = "";

  async function sources() {
    const place = $("scope-source");
    if (!place) return;
    const [recordings, runs] = await Promise.all([dx.call("GET", "recordings", null, true), dx.call("GET", "runs?most=30", null, true)]);
    const groups = [dx.el("option", { value: "now" }, word("now"))];
    const group = (label, entries) => entries.length && groups.push(dx.el("optgroup", { label }, ...entries.map(([value, text]) => dx.el("option", { value }, text))));
    group(word("recordings"), (recordings.body.recordings ?? []).map((one) => [`recording:${one.name}`, one.name]));
    group(word("runs"), (runs.body.runs ?? []).filter((run) => run.facts.record).map((run) => [`run:${run.id}`, `#${run.id} ${run.program} ${dx.forms.date(run.began_s)}`]));
    place.replaceChildren(...groups);
    if (![...place.options].some((one) => one.value === state.source)) place.append(dx.el("option", { value: state.source }, state.source.split(":")[1]));
    place.value = state.source;
  }

  dx.on("built", (name) => {
    if (name !== "scope") return;
    $("scope-seconds").value = String(state.seconds);
    sources();
    if (opened) choose(opened);
    list();
    buttons();
    look();
    new ResizeObserver(() => draw()).observe($("scope-canvas"));
  });
  dx.on("view", (name) => name === "scope" && sources());
  // A fault: what led to it stays on the screen.
  dx.on("alarm", (fault) => {
    if (!fault || !state.running || state.armed || state.source !== "now" || !$("scope-freeze")?.checked) return;
    setTimeout(() => {
      state.running = false;
      buttons();
    }, 500);
  });
  setInterval(() => {
    if (!dx.shown("scope") || document.hidden || !$("scope-canvas") || dx.stale) return;
    list();
    buttons();
    if (state.source === "now" && (state.running || state.armed)) look();
  }, 150);
})();
