// Runs: what was cut, how it went, and where its record is.
(() => {
  "use strict";
  const dx = window.dx;
  const word = (key) => dx.word(`runs.${key}`);
  const TONES = { completed: "go", stopped: "hold", fault: "stop", refused: "stop", lost: "stop", running: "info" };
  let runs = [];
  let chosen = 0;

  // The axis that was off most, of those in mm and of those in degrees: the two do not compare.
  const worst = (facts) => {
    const errors = Object.entries(facts.following_error ?? {}).filter(([, v]) => typeof v === "number");
    const kinds = [errors.filter(([axis]) => !rotary(axis)), errors.filter(([axis]) => rotary(axis))];
    const most = kinds.filter((kind) => kind.length).map((kind) => kind.reduce((a, b) => (b[1] > a[1] ? b : a)));
    return most.map(error).join(", ") || "–";
  };
  const rotary = (axis) => (dx.axis(axis).unit ?? ("ABC".includes(axis) ? "deg" : "mm")) === "deg";
  const error = ([axis, value]) => `${axis} ${dx.forms.um(value)} ${rotary(axis) ? "m°" : "µm"}`;

  function line(run) {
    const facts = run.facts;
    const cells = [
      ["", dx.el("button", { class: "plain", type: "button" }, run.program)],
      ["", dx.chip(dx.words[`result.${run.result}`] ?? run.result, TONES[run.result])],
      ["figures r-began", dx.forms.date(run.began_s)],
      ["figures", dx.seconds(facts.duration_s)],
      ["figures r-cut", dx.seconds(facts.cut_time_s)],
      ["figures r-error", worst(facts)],
    ];
    const row = dx.el("tr", { class: "entry", "aria-selected": String(run.id === chosen) }, ...cells.map(([name, child]) => dx.el("td", { class: name }, child)));
    row.addEventListener("click", () => choose(run.id));
    return row;
  }

  function show() {
    dx.fill("runs-list", (rows) => rows.map(line), runs, chosen);
    const empty = document.getElementById("runs-empty");
    if (empty) empty.hidden = runs.length > 0;
  }

  async function choose(id) {
    chosen = id;
    show();
    const said = await dx.call("GET", `runs/${id}`);
    if (said.ok) dx.fill("runs-detail", detail, said.body);
  }

  function detail(run) {
    const facts = run.facts;
    const fact = (key, value) => (value === undefined || value === null || value === "" ? [] : [dx.el("dt", {}, word(key)), dx.el("dd", { class: "figures" }, value)]);
    const errors = Object.entries(facts.following_error ?? {}).map(error);
    return [
      dx.el("h2", { class: "program-title" }, run.program),
      dx.el("div", { class: "row" }, dx.chip(dx.words[`result.${run.result}`] ?? run.result, TONES[run.result]), dx.el("span", { class: "dim figures" }, `#${run.id}`)),
      facts.sentence ? dx.el("p", { class: "wrong" }, dx.sentence(facts)) : null,
      dx.el(
        "dl",
        { class: "facts wide" },
        ...fact("began", dx.forms.date(run.began_s)),
        ...fact("ended", dx.forms.date(run.ended_s)),
        ...fact("took", dx.seconds(facts.duration_s)),
        ...fact("planned", dx.seconds(facts.planned_s)),
        ...fact("cut", dx.seconds(facts.cut_time_s)),
        ...fact("ticks", facts.ticks === undefined ? null : String(facts.ticks)),
        ...fact("skips", facts.skips === undefined ? null : String(facts.skips)),
        ...fact("error", errors.join(", ")),
        ...fact("from_line", facts.line ? String(facts.line) : null),
        ...fact("sha", run.sha256.slice(0, 16)),
      ),
      dx.el(
        "div",
        { class: "row" },
        (run.files ?? []).includes("setpoints.npz") ? dx.button(word("scope"), () => dx.openScope?.(`run:${run.id}`)) : null,
        run.result === "running" ? null : dx.el("a", { class: "act", href: `/api/v1/runs/${run.id}/report?language=${dx.language}`, target: "_blank", rel: "noopener" }, word("report")),
        ...(run.files ?? []).map((file) => dx.link(file, `runs/${run.id}/files/${encodeURIComponent(file)}`)),
      ),
    ].filter(Boolean);
  }

  const [look] = dx.history("runs", 3, (most) => `runs?most=${most}`, (body) => {
    runs = body.runs;
    show();
  });
  dx.on("job", look);

  dx.every("runs", 5, "statistics/runs", (body) => {
    for (const [id, text] of [
      ["runs-all", String(body.runs)],
      ["runs-completed", String(body.results.completed ?? 0)],
      ["runs-stopped", String(body.results.stopped ?? 0)],
      ["runs-failed", String(body.failed)],
      ["runs-cut", dx.seconds(body.cut_time_s)],
      ["runs-time", dx.seconds(body.duration_s)],
    ]) dx.write(document.getElementById(id), text);
  });
})();
