// Set-up: homing, work offsets, tools, the machine file, and what the drives were told.
(() => {
  "use strict";
  const dx = window.dx;
  const word = (key) => dx.word(`setup.${key}`);
  const $ = (id) => document.getElementById(id);
  let page = "homing";
  let tool = 1; // that touches off: the one in the spindle, unless another one was picked
  let picked = false;
  let editing = ""; // what is being typed in: it is not written over

  const shows = (name) => dx.shown("setup") && page === name;
  const figure = (v) => (typeof v === "number" ? String(Number(v.toFixed(6))) : "");

  // ---- pages

  function turn(name) {
    page = name;
    for (const part of document.querySelectorAll(".setup .part")) part.toggleAttribute("data-shown", part.dataset.part === name);
    for (const tab of document.querySelectorAll("[data-setup]")) tab.setAttribute("aria-pressed", String(tab.dataset.setup === name));
    if (name === "file") file();
    looks.forEach((look) => look());
  }
  document.addEventListener("click", (event) => {
    const tab = event.target.closest?.("[data-setup]");
    if (tab) turn(tab.dataset.setup);
  });
  const looks = [];

  // ---- homing

  const axis_of = (name) => (dx.facts?.axes ?? []).find((axis) => axis.name === name) ?? {};

  function homing(name, joint) {
    const home = async () => {
      if (await dx.ask(word("home_ask").replace("{0}", name))) dx.call("POST", "machine/home", { axes: [name] });
    };
    return dx.el(
      "tr",
      {},
      dx.el("th", { scope: "row" }, dx.el("span", { class: "axis-name" }, name)),
      dx.el("td", {}, dx.chip(word(joint.homed ? "homed" : "not_homed"), joint.homed ? "go" : "hold")),
      dx.el("td", { class: "figures hide-narrow" }, `${figure(axis_of(name).home)} ${axis_of(name).unit ?? ""}`),
      dx.el("td", { class: "figures hide-narrow" }, (axis_of(name).travel ?? []).map(figure).join(" … ")),
      dx.el("td", {}, joint.limit ? dx.chip(`${word("limit")} ${joint.limit}`, "stop") : "–"),
      dx.el("td", {}, dx.button(word("home"), home, { "data-needs": "control", "data-modes": "OFF READY" })),
    );
  }

  let last = 0;
  dx.on("status", (status) => {
    const now = performance.now();
    if (!dx.shown("setup") || now - last < 200) return;
    last = now;
    const joints = Object.entries(status.joints ?? {}).map(([name, joint]) => [name, { homed: joint.homed, limit: joint.limit }]);
    if (page === "homing") dx.fill("setup-homing", (rows) => rows.map(([name, joint]) => homing(name, joint)), joints, dx.facts?.axes);
    if (page === "drives") commissioned(status);
    if (!picked && status.tool && status.tool !== tool) {
      tool = status.tool;
      if ($("setup-tool")) $("setup-tool").value = String(tool);
    }
    if (page === "offsets") dx.write($("setup-tip"), (status.on_table?.tip ?? []).map((v, i) => `${"XYZ"[i]} ${dx.forms.mm(v)}`).join("   ") || "–");
  });

  // ---- offsets

  const input = (value, label, attrs = {}) => dx.el("input", { type: "text", inputmode: "decimal", value: figure(value), "aria-label": label, ...attrs });
  // A decimal comma is what half of the shops type.
  const number = (place) => Number(place.value.trim().replace(",", ".").replace("−", "-"));

  function row_values(row, names) {
    const values = names.map((name) => number(row.querySelector(`[data-field="${name}"]`)));
    return values.every(Number.isFinite) ? values : (dx.say(word("number"), "warn"), null);
  }

  function offset([name, values]) {
    const turned = values.turned_deg ?? [0, 0, 0];
    const row = dx.el(
      "tr",
      { "data-row": name },
      dx.el("th", { scope: "row" }, dx.el("span", { class: "axis-name" }, name)),
      ...["X", "Y", "Z"].map((axis, i) =>
        dx.el(
          "td",
          { "data-label": `${axis} mm` },
          dx.el(
            "div",
            { class: "row" },
            input(values.origin_mm[i], `${name} ${axis}`, { "data-field": axis }),
            dx.button(dx.icon("my_location"), () => touch(name, axis), { "data-needs": "control", "data-modes": "OFF READY", title: word("touch").replace("{0}", axis), "aria-label": `${name}: ${word("touch").replace("{0}", axis)}` }),
          ),
        ),
      ),
      ...["X", "Y", "Z"].map((axis, i) => dx.el("td", { class: "hide-narrow" }, input(turned[i], `${name} ${word("turned")} ${axis}`, { "data-field": `r${axis}` }))),
      dx.el("td", {}, dx.button(word("save"), () => save_offset(name, row), { "data-needs": "control", "data-modes": "OFF READY FAULT" })),
    );
    return row;
  }

  async function save_offset(name, row) {
    const origin = row_values(row, ["X", "Y", "Z"]);
    const turned = row_values(row, ["rX", "rY", "rZ"]);
    if (!origin || !turned) return;
    const said = await dx.call("PUT", `offsets/${name}`, { origin_mm: origin, turned_deg: turned });
    if (said.ok) dx.say(word("saved").replace("{0}", name));
    fresh("setup-offsets");
  }

  async function touch(name, axis) {
    const value = await ask(word("touch_ask").replace("{0}", name).replace("{1}", axis), "0");
    if (value === null) return;
    const said = await dx.call("POST", `offsets/${name}/touch_off`, { [axis]: value, tool });
    if (said.ok) dx.say(word("saved").replace("{0}", name));
    fresh("setup-offsets");
  }

  // A question with a number; null: given up.
  async function ask(sentence, start) {
    const answer = dx.ask(sentence, "setup.set");
    const box = document.querySelector(".dx-ask");
    const field = input(0, sentence);
    field.value = start;
    box.querySelector("p").after(field);
    field.select();
    field.focus();
    let typed = start;
    field.addEventListener("input", () => (typed = field.value));
    field.addEventListener("keydown", (event) => event.key === "Enter" && box.querySelector("[data-kind=go]").click());
    if (!(await answer)) return null;
    const value = number({ value: typed });
    return Number.isFinite(value) && typed.trim() ? value : (dx.say(word("number"), "warn"), null);
  }

  function fresh(id) {
    editing = "";
    const place = $(id);
    if (place) delete place.dataset.key;
    looks.forEach((look) => look());
  }

  document.addEventListener("input", (event) => {
    const row = event.target.closest?.("[data-row]");
    if (row) editing = row.parentElement.id;
  });

  looks.push(
    dx.every("setup", 2, "offsets", (body) => {
      if (shows("offsets") && editing !== "setup-offsets") dx.fill("setup-offsets", (rows) => rows.map(offset), Object.entries(body.offsets));
    }),
  );

  // ---- tools

  const FIELDS = ["radius_mm", "length_mm", "flute_mm", "corner_mm", "taper_deg"];
  const of_tool = (values, field) => (field === "taper_deg" ? ((values.taper_rad ?? 0) * 180) / Math.PI : (values[field] ?? 0));

  function tool_row([number_, values]) {
    const row = dx.el(
      "tr",
      { "data-row": number_ },
      dx.el("th", { scope: "row" }, dx.el("span", { class: "axis-name" }, `T${number_}`)),
      dx.el("td", { "data-label": word("name") }, dx.el("input", { class: "wide", type: "text", value: values.name ?? "", "aria-label": `T${number_} ${word("name")}`, "data-field": "name" })),
      ...FIELDS.map((field) => dx.el("td", { "data-label": word(field) }, input(of_tool(values, field), `T${number_} ${word(field)}`, { "data-field": field }))),
      dx.el(
        "td",
        {},
        dx.el(
          "div",
          { class: "row" },
          dx.button(word("save"), () => save_tool(number_, row), { "data-needs": "control" }),
          number_ === "1" ? null : dx.button(word("delete"), () => remove_tool(number_), { "data-needs": "control" }),
        ),
      ),
    );
    return row;
  }

  // What this table does not show stays as the service has it.
  async function save_tool(number_, row) {
    const values = row_values(row, FIELDS);
    if (!values) return;
    const body = { name: row.querySelector('[data-field="name"]').value };
    FIELDS.forEach((field, i) => (body[field] = values[i]));
    const said = await dx.call("PUT", `tools/${number_}`, body);
    if (said.ok) dx.say(word("saved").replace("{0}", `T${number_}`));
    fresh("setup-tools");
  }

  async function remove_tool(number_) {
    if (!(await dx.ask(word("delete_ask").replace("{0}", `T${number_}`)))) return;
    await dx.call("DELETE", `tools/${number_}`);
    fresh("setup-tools");
  }

  async function add_tool() {
    const number_ = await ask(word("add_ask"), String(Math.max(0, ...tools.map(([n]) => Number(n))) + 1));
    if (number_ === null) return;
    await dx.call("PUT", `tools/${Math.round(number_)}`, { name: "", radius_mm: 3, length_mm: 0, flute_mm: 15 });
    fresh("setup-tools");
  }
  document.addEventListener("click", (event) => event.target.closest?.("#setup-add") && add_tool());
  document.addEventListener("change", (event) => {
    if (event.target.id !== "setup-tool") return;
    tool = Number(event.target.value);
    picked = true;
  });

  let tools = [];
  looks.push(
    dx.every("setup", 2, "tools", (body) => {
      tools = Object.entries(body.tools).sort((a, b) => Number(a[0]) - Number(b[0]));
      dx.fill("setup-tool", (rows) => rows.map(([n, one]) => dx.el("option", { value: n, selected: Number(n) === tool }, `T${n} ${one.name ?? ""}`)), tools);
      if (shows("tools") && editing !== "setup-tools") dx.fill("setup-tools", (rows) => rows.map(tool_row), tools);
    }),
  );

  // ---- the machine file

  let told = null;
  async function file() {
    if (!told) {
      const said = await dx.call("GET", "machine/file");
      if (!said.ok) return;
      told = said.body;
    }
    filter();
  }

  function filter() {
    if (!told) return;
    const wanted = ($("setup-filter")?.value ?? "").toLowerCase();
    const rows = told.rows.filter((row) => `${row.table} ${row.key} ${row.value} ${row.comment}`.toLowerCase().includes(wanted));
    dx.fill("setup-file", file_rows, rows);
    dx.write($("setup-file-name"), `${told.name}: ${rows.length} / ${told.rows.length}`);
  }

  function file_rows(rows) {
    let table = "";
    return rows.flatMap((row) => {
      const head = row.table === table ? [] : [dx.el("tr", { class: "group" }, dx.el("td", { colspan: "4" }, row.table))];
      table = row.table;
      return [...head, dx.el("tr", {}, dx.el("td", { class: "figures dim" }, String(row.line)), dx.el("td", { class: "key" }, row.key), dx.el("td", { class: "value" }, row.value), dx.el("td", { class: "dim hide-narrow" }, row.comment))];
    });
  }
  document.addEventListener("input", (event) => event.target.id === "setup-filter" && filter());

  // ---- commissioning

  function commissioned(status) {
    const drives = (status.drives ?? []).map((drive) => [drive.axis, drive.bus, drive.node, drive.state, typeof drive.heartbeat_age_s === "number" && drive.heartbeat_age_s < 1]);
    const done = status.commissioned;
    dx.fill(
      "setup-commissioned",
      (known) => [known === undefined ? dx.chip("–") : known ? dx.chip(word("commissioned"), "go") : dx.chip(word("not_commissioned"), "hold")],
      done,
    );
    dx.fill(
      "setup-drives",
      (rows) =>
        rows.map(([name, bus, node, state, heard]) =>
          dx.el(
            "tr",
            {},
            dx.el("th", { scope: "row" }, dx.el("span", { class: "axis-name" }, name)),
            dx.el("td", { class: "figures" }, `${bus} · ${node}`),
            dx.el("td", {}, dx.chip(word(heard ? "heard" : "silent"), heard ? "go" : "stop")),
            dx.el("td", {}, dx.words[`drives.state.${state}`] ?? state),
            ...["profile", "homing", "supervision"].map((key) => dx.el("td", { class: "hide-narrow" }, from_file(name, key))),
          ),
        ),
      drives,
      told === null,
    );
    if (told === null) file();
  }

  const from_file = (axis, key) => (told?.rows ?? []).find((row) => row.table === `axis ${axis}` && row.key === key)?.value ?? word(`default.${key}`);

  dx.on("built", (name) => {
    if (name === "setup") turn(page);
  });
  dx.on("view", (name) => {
    if (name === "setup") told = null;
  });
})();
