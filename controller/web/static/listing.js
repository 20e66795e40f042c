// The text of the loaded program around the line that runs.
import { API, headers } from "./api.js";
import { html, useLayoutEffect, useRef } from "./dom.js";
import { changed, dx } from "./store.js";

const AROUND = 14; // lines shown before the one that runs
const ROWS = 60;
const program = { key: "", lines: [] };

dx.on("status", async ({ job }) => {
  const key = job ? `${job.name} ${job.sha256}` : "";
  if (key === program.key) return;
  Object.assign(program, { key, lines: [] });
  if (!job) return;
  const lines = typeof job.text === "string" ? job.text.split("\n") : await fetched(job.name); // typed by hand: in no store
  if (key !== program.key) return;
  program.lines = lines;
  changed();
});

async function fetched(name) {
  try {
    const answer = await fetch(`${API}programs/${encodeURIComponent(name)}/text`, { headers: headers() });
    return answer.ok ? (await answer.text()).split(/\r\n|\n|\r/) : [];
  } catch {
    return []; // the panel is away; with it the figures are old
  }
}

// Only the listing scrolls: a page that jumped at each line could not be read on a phone.
export function Listing({ job }) {
  const place = useRef(null);
  const now = job?.line ?? 0;
  const first = Math.max(1, now - AROUND);
  useLayoutEffect(() => {
    const line = place.current.querySelector(".now");
    if (line) place.current.scrollTop = line.offsetTop - place.current.offsetTop - (place.current.clientHeight - line.clientHeight) / 2;
  }, [program.key, now, program.lines.length]);
  const rows = job ? program.lines.slice(first - 1, first + ROWS) : [];
  const kind = (n) => (n === now ? "now" : n < now ? "past" : "");
  return html`<pre class="listing" id="run-listing" tabindex="0" hidden=${!job} ref=${place}>${rows.map((text, i) => html`<div key=${first + i} class=${kind(first + i)}><span class="n">${first + i}</span><span>${text || " "}</span></div>`)}</pre>`;
}
