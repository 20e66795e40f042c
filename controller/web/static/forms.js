// How figures are written; a dash where nothing is known.
import { dx } from "./store.js";
import { known, word } from "./texts.js";

const NONE = "–";

const number = (digits, factor = 1) => (v) => {
  if (typeof v !== "number") return NONE;
  const text = (v * factor).toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
};
// As the operator wants them: millimetres, or inches with a digit more.
const length = (mm, inch) => (v) => (dx.inch ? number(inch, 1 / 25.4) : number(mm))(v);
const two = (n) => String(n).padStart(2, "0");

function time(v) {
  if (typeof v !== "number") return "–:––";
  const s = Math.max(0, Math.round(v));
  const [h, m] = [Math.floor(s / 3600), Math.floor(s / 60) % 60];
  return h ? `${h}:${two(m)}:${two(s % 60)}` : `${m}:${two(s % 60)}`;
}

function size(bytes) {
  let [value, unit] = [bytes, "B"];
  for (unit of ["B", "kB", "MB", "GB"]) {
    if (value < 1000 || unit === "GB") break;
    value /= 1000;
  }
  return `${value.toFixed(unit === "B" ? 0 : 1)} ${unit}`;
}

// Day, month, year and 24 hours: what English alone stands for has the month first, and hours of half a day.
const place = () => (dx.language === "en" ? "en-GB" : dx.language);

// ``Y velocity`` in the page's language.
function bound(text) {
  if (!text) return NONE;
  const [axis, kind] = text.split(/ (.*)/);
  return known(`bound.${text}`) || (known(`bound.${kind}`) ? `${axis} ${known(`bound.${kind}`)}` : text);
}

export const forms = {
  mm: number(3),
  length: length(3, 4),
  deg: number(3),
  um: number(1, 1000),
  feed: length(0, 1),
  units: () => (dx.inch ? "in" : "mm"),
  int: number(0),
  ms: number(2),
  u: number(4),
  unit: number(5),
  percent: (v) => (typeof v === "number" ? `${Math.round(v * 100)} %` : NONE),
  text: (v) => (v === null || v === undefined || v === "" ? NONE : String(v)),
  plain: (v) => (v === null || v === undefined ? "" : String(v)),
  time,
  whole_seconds: (v) => (v < 120 ? `${v} s` : time(v)),
  seconds: (v) => (typeof v !== "number" ? NONE : v < 60 ? `${v.toFixed(1)} s` : time(v)),
  size,
  bound,
  date: (v) => (typeof v === "number" ? new Date(v * 1000).toLocaleString(place(), { dateStyle: "medium", timeStyle: "medium" }) : NONE),
  moment: (v) => new Date(v * 1000).toLocaleString(place(), { dateStyle: "medium", timeStyle: "short" }),
  what: (v) => (v ? known(`what.${v}`, word("what.other")) : ""),
  mode: (v) => (v ? word(`mode.${v}`) : NONE),
};
