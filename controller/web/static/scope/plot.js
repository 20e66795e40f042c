// The scope's screen: a lane for each signal over one axis of time, a trigger's mark and two cursors.
import { Component, createRef, html } from "../dom.js";
import uPlot from "../vendor/uplot.js";
import { ends, lower, period, redraw, shown, state, zoom } from "./ticks.js";

const COLOURS = {
  dark: ["#5cc8ff", "#ffbe3d", "#3ddc84", "#ff8a85", "#c9a4ff", "#7fe3d4", "#f0f3a0", "#ffa6d8"],
  light: ["#00609a", "#8a5a00", "#0b6b3a", "#b3141b", "#6a3fb0", "#00695c", "#5f6300", "#a3216e"],
};
const AROUND = 0.08; // of a lane, above and below its trace
const theme = () => document.documentElement.dataset.theme;
export const colour = (i) => COLOURS[theme()][i % 8];
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const figure = (v) => (v === null || v === undefined ? "–" : String(Number(v.toPrecision(6))).replace("-", "−"));

// ---- the values

// The last column that begins no later than a tick.
const column = (tick) => Math.max(0, lower(state.data.ticks, tick + 1) - 1);

function value_at(name, tick) {
  const i = column(tick);
  const [low, high] = [state.data.low[name]?.[i], state.data.high[name]?.[i]];
  return low === high ? figure(low) : `${figure(low)} … ${figure(high)}`;
}

// At the cursors, or the newest.
export function values_at(name) {
  if (!state.data?.ticks.length) return [];
  const [one, two] = state.cursors;
  return [one ?? state.data.ticks.at(-1), ...(two === null ? [] : [two])].map((tick) => value_at(name, tick));
}

function range(name) {
  let [low, high] = [Infinity, -Infinity];
  // Drawn a little later than it is asked for: by then another source may be chosen, of which nothing has come.
  for (const v of state.data?.low[name] ?? []) if (v !== null && v < low) low = v;
  for (const v of state.data?.high[name] ?? []) if (v !== null && v > high) high = v;
  return low <= high ? [low, high] : [0, 0];
}

// A scale on which a signal lies within the i-th of so many lanes.
function lane(name, i, lanes) {
  const [low, high] = range(name);
  const around = high > low ? AROUND * (high - low) : Math.abs(high) * 0.1 || 1;
  const span = high - low + 2 * around;
  return [low - around - (lanes - 1 - i) * span, high + around + i * span];
}

// Both ends of every column; the nearer one comes first: a slope is no saw.
function points(name) {
  const [lows, highs] = [state.data.low[name] ?? [], state.data.high[name] ?? []];
  let before = null;
  return state.data.ticks.flatMap((_, k) => {
    const [low, high] = [lows[k] ?? null, highs[k] ?? null];
    const falls = before !== null && low !== null && Math.abs(high - before) < Math.abs(low - before);
    before = falls ? low : high;
    return falls ? [high, low] : [low, high];
  });
}

// ---- the screen

function nice(step) {
  const power = 10 ** Math.floor(Math.log10(step));
  return [1, 2, 5, 10].map((n) => n * power).find((n) => n >= step) ?? step;
}

// Ticks of round times, counted from the trigger where there is one.
const zero = () => (state.trigger !== null && state.source === "now" && !state.running ? state.trigger : ends()[0]);
function splits(plot, _, first, last) {
  const step = nice(((last - first) * period()) / Math.max(2, Math.floor(plot.width / 110)));
  const found = [];
  for (let t = Math.ceil(((first - zero()) * period()) / step) * step; t <= (last - zero()) * period() + 1e-12; t += step) found.push(zero() + t / period());
  return found;
}

function options(size) {
  const { names } = state;
  const line = { stroke: css("--line"), width: 1 };
  return {
    ...size,
    padding: [8, 26, 0, 26],
    legend: { show: false },
    cursor: { show: false },
    scales: {
      x: { time: false, range: () => ends() },
      ...Object.fromEntries(names.map((name, i) => [name, { range: () => lane(name, i, names.length) }])),
    },
    axes: [{ stroke: css("--dim"), grid: line, ticks: line, font: "14px sans-serif", splits, values: (_, at) => at.map((tick) => `${Number(((tick - zero()) * period()).toFixed(6))} s`) }],
    series: [{}, ...names.map((name, i) => ({ scale: name, stroke: colour(i), width: 1.6, points: { show: false } }))],
    hooks: { draw: [lanes, marks] },
  };
}

// Between the lanes a line, in each its name with what it reaches.
function lanes({ ctx: pen, bbox: { left, top, width, height } }) {
  const [dots, high] = [devicePixelRatio, height / Math.max(1, state.names.length)];
  Object.assign(pen, { font: `500 ${14 * dots}px sans-serif`, textAlign: "left", textBaseline: "alphabetic" });
  state.names.forEach((name, i) => {
    const [from, to] = range(name);
    const text = `${shown(name)}  ${figure(from)} … ${figure(to)} ${state.units[name] ?? ""}`;
    pen.fillStyle = css("--line");
    pen.fillRect(left, top + (i + 1) * high, width, dots);
    pen.globalAlpha = 0.8;
    pen.fillStyle = css("--bg");
    pen.fillRect(left + 2 * dots, top + i * high + 2 * dots, pen.measureText(text).width + 10 * dots, 20 * dots);
    pen.globalAlpha = 1;
    pen.fillStyle = colour(i);
    pen.fillText(text, left + 7 * dots, top + i * high + 17 * dots);
  });
}

function marks(plot) {
  const { ctx: pen, bbox } = plot;
  const dots = devicePixelRatio;
  const line = (tick, style, dash, name) => {
    if (tick === null) return;
    const x = plot.valToPos(tick, "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) return;
    pen.strokeStyle = pen.fillStyle = style;
    pen.lineWidth = 1.5 * dots;
    pen.setLineDash(dash.map((n) => n * dots));
    pen.beginPath();
    pen.moveTo(x, bbox.top);
    pen.lineTo(x, bbox.top + bbox.height);
    pen.stroke();
    pen.setLineDash([]);
    pen.font = `700 ${14 * dots}px sans-serif`;
    pen.fillText(name, x + 4 * dots, bbox.top + bbox.height - 6 * dots);
  };
  line(state.trigger, css("--hold"), [6, 4], "T");
  line(state.cursors[0], css("--text"), [], "1");
  line(state.cursors[1], css("--text"), [2, 3], "2");
}

// ---- cursors: a tick each

// A tick that is shown: between two columns there is nothing to be read.
const exact = (tick) => (state.data.per_column === 1 ? state.data.ticks[column(tick)] : tick);

function set(share) {
  const [first, last] = ends();
  const tick = exact(Math.round(first + Math.min(1, Math.max(0, share)) * (last - first)));
  const [one, two] = state.cursors;
  const cursors = one !== null && two === null && one !== tick ? [one, tick] : [tick, null];
  redraw({ cursors, hand: cursors[1] === null ? 0 : 1 });
}

// By keys: 1 and 2 take a cursor in hand, arrows lead it from column to column, with shift ten at once.
const STEPS = { ArrowLeft: -1, ArrowRight: 1 };
function typed(event) {
  if (!state.data?.ticks.length || event.ctrlKey || event.metaKey || event.altKey) return;
  const taken = ["1", "2"].indexOf(event.key);
  if (event.key === "Escape") Object.assign(state, { cursors: [null, null], hand: 0 });
  else if (taken >= 0) take(taken);
  else if (event.key in STEPS) lead(STEPS[event.key] * (event.shiftKey ? 10 : 1));
  else return;
  event.preventDefault();
  redraw({});
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
  state.cursors[state.hand] = ticks[Math.min(ticks.length - 1, Math.max(0, column(state.cursors[state.hand]) + columns))];
}

export class Plot extends Component {
  place = createRef();

  componentDidMount() {
    this.watch = new ResizeObserver(() => this.draw());
    this.watch.observe(this.place.current);
    // Not by an attribute: what scrolls must not scroll the page, too.
    this.place.current.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.draw();
  }

  componentDidUpdate() {
    this.draw();
  }

  componentWillUnmount() {
    this.watch.disconnect();
    this.plot?.destroy();
  }

  draw() {
    const place = this.place.current;
    const size = { width: place.clientWidth, height: place.clientHeight };
    if (!state.data || !size.width || !size.height) return;
    state.width = size.width;
    const key = JSON.stringify([state.names, theme(), size]);
    const drawn = [state.data, ...ends(), ...state.cursors, state.trigger];
    if (key === this.key && drawn.every((one, i) => one === this.drawn[i])) return;
    const data = [state.data.ticks.flatMap((tick) => [tick, tick]), ...state.names.map(points)];
    if (key !== this.key) {
      this.plot?.destroy();
      this.plot = new uPlot(options(size), data, place);
    } else this.plot.setData(data);
    Object.assign(this, { key, drawn });
  }

  share(event) {
    const box = this.plot.over.getBoundingClientRect();
    return (event.clientX - box.left) / box.width;
  }

  wheel(event) {
    event.preventDefault();
    if (this.plot) zoom(event.deltaY > 0 ? 1.25 : 0.8, this.share(event));
  }

  render({ label }) {
    return html`<div class="scope-canvas" id="scope-canvas" role="application" tabindex="0" aria-label=${label} aria-describedby="scope-cursors"
      data-per-column=${state.data ? String(state.data.per_column) : undefined} ref=${this.place} onkeydown=${typed}
      onpointerdown=${(event) => this.plot && state.data?.ticks.length && set(this.share(event))}></div>`;
  }
}
