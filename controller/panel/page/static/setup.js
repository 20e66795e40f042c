// Set-up: homing, work offsets, tools, the machine file, and what the drives were told.
(() => {
  "use strict";
  const dx = window.dx;
  const word = (key) => dx.word(`setup.${key}`);
  const $ = (id) => document.getElementById(id);
  let page = "homing";
  let spindle = 0; // the tool in it, as the machine has it
  let tool = 1; // that touches off: the one in the spindle, until another one is picked

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

  function homing(name, joint) {
    const home = async () => {
      if (await dx.ask(word("home_ask").replace("{0}", name))) dx.call("POST", "machine/home", { axes: [name] });
    };
    return dx.el(
      "tr",
      {},
      dx.el("th", { scope: "row" }, dx.el("span", { class: "axis-name" }, name)),
      dx.el("td", {}, dx.el("div", { class: "row" }, dx.chip(word(joint.homed ? "homed" : "not_homed"), joint.homed ? "go" : "hold"), joint.limit ? dx.chip(`${word("limit")} ${joint.limit}`, "stop") : null)),
      dx.el("td", { class: "figures hide-narrow" }, `${figure(dx.axis(name).home)} ${dx.axis(name).unit ?? ""}`),
      dx.el("td", { class: "figures hide-narrow" }, (dx.axis(name).travel ?? []).map(figure).join(" … ")),
      dx.el("td", {}, dx.button(word("home"), home, { "data-needs": "control", "data-modes": "OFF READY" })),
    );
  }

  let last = 0;
  dx.on("status", (status) => {
    if (status.tool && status.tool !== spindle) pick((spindle = status.tool));
    const now = performance.now();
    if (!dx.shown("setup") || now - last < 200) return;
    last = now;
    const joints = Object.entries(status.joints ?? {}).map(([name, joint]) => [name, { homed: joint.homed, limit: joint.limit }]);
    if (page === "homing") dx.fill("setup-homing", (rows) => rows.map(([name, joint]) => homing(name, joint)), joints, dx.facts?.axes);
    if (page === "drives") commissioned(status);
    if (page === "offsets") dx.write($("setup-tip"), tip(status));
  });

  // The tip is that of the tool in the spindle, whichever is picked.
  function tip(status) {
    const at = (status.on_table?.tip ?? []).map((v, i) => `${"XYZ"[i]} ${dx.forms.mm(v)}`);
    return [status.tool ? `T${status.tool}:` : "", ...at].join("   ").trim() || "–";
  }

  function pick(number) {
    tool = number;
    if ($("setup-tool")) $("setup-tool").value = String(tool);
  }

  // ---- fields: what is typed stays until it is saved or given up, and nothing else is sent

  const input = (label, attrs = {}) => dx.el("input", { type: "text", inputmode: "decimal", "aria-label": label, ...attrs });
  // A decimal comma is what half of the shops type.
  const number = (text) => (text.trim() ? Number(text.trim().replace(",", ".").replace("−", "-")) : NaN);
  const same = (field, a, b) => a === b || (field.dataset.field !== "name" && number(a) === number(b));
  const typed = (field) => !same(field, field.value, field.defaultValue);
  const fields = (row) => [...row.querySelectorAll("[data-field]")];
  const mark = (field) => field.toggleAttribute("data-typed", typed(field));

  // Rows by name, of values in force; ``value(values, field)`` is what a field shows of them.
  function table(id, rows, make, value) {
    const place = $(id);
    if (!place) return;
    const there = new Map([...place.children].map((row) => [row.dataset.row, row]));
    dx.fill(id, (names) => names.map((name) => there.get(name) ?? make(name)), rows.map(([name]) => name));
    const values = Object.fromEntries(rows);
    for (const row of place.children) for (const field of fields(row)) in_force(field, value(values[row.dataset.row], field.dataset.field));
  }

  function in_force(field, value) {
    const kept = typed(field);
    if (!kept && field === document.activeElement) return;
    field.defaultValue = typeof value === "string" ? value : figure(value);
    if (!kept || !typed(field)) field.value = field.defaultValue;
    mark(field);
  }

  // What a row is to be: what was typed in it, of the rest what is in force now. null: a figure is none.
  function wanted(row, values, value) {
    const found = fields(row).map((field) => {
      const name = field.dataset.field;
      if (!typed(field)) return [name, value(values, name)];
      return [name, name === "name" ? field.value : number(field.value)];
    });
    if (found.every(([, one]) => typeof one === "string" || Number.isFinite(one))) return Object.fromEntries(found);
    dx.say(word("number"), "warn");
    return null;
  }

  // Saved is over what is in force at this moment, not over what this page saw last.
  async function save(row, what, value, body) {
    const name = row.dataset.row;
    const now = await dx.call("GET", what);
    const values = now.ok && now.body[what][name];
    const all = values && wanted(row, values, value);
    if (!all) return;
    const said = await dx.call("PUT", `${what}/${name}`, body(all, values));
    if (said.ok) dx.say(word("saved").replace("{0}", what === "tools" ? `T${name}` : name));
    look();
  }

  const look = () => looks.forEach((one) => one());
  document.addEventListener("input", (event) => event.target.closest?.(".setup [data-row]") && mark(event.target));
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !event.target.closest?.(".setup [data-row]")) return;
    event.target.value = event.target.defaultValue;
    mark(event.target);
  });

  // ---- offsets

  const of_offset = (values, field) => (field[0] === "r" ? (values.turned_deg ?? [0, 0, 0]) : values.origin_mm)["XYZ".indexOf(field.at(-1))];
  const offset_body = (all) => ({ origin_mm: [all.X, all.Y, all.Z], turned_deg: [all.rX, all.rY, all.rZ] });

  function offset(name) {
    const row = dx.el(
      "tr",
      { "data-row": name },
      dx.el("th", { scope: "row" }, dx.el("span", { class: "axis-name" }, name), dx.el("span", { class: "dim", "data-unset": "" }, ` ${word("unset")}`)),
      ...["X", "Y", "Z"].map((axis) =>
        dx.el(
          "td",
          { "data-label": `${axis} mm` },
          dx.el(
            "div",
            { class: "row" },
            input(`${name} ${axis}`, { "data-field": axis }),
            dx.button(dx.icon("my_location"), () => touch(name, axis), { "data-needs": "control", "data-modes": "OFF READY", title: word("touch").replace("{0}", axis), "aria-label": `${name}: ${word("touch").replace("{0}", axis)}` }),
          ),
        ),
      ),
      ...["X", "Y", "Z"].map((axis) => dx.el("td", { class: "hide-narrow" }, input(`${name} ${word("turned")} ${axis}`, { "data-field": `r${axis}` }))),
      dx.el("td", {}, dx.button(word("save"), () => save(row, "offsets", of_offset, offset_body), { "data-needs": "control", "data-modes": "OFF READY FAULT" })),
    );
    return row;
  }

  async function touch(name, axis) {
    const by = tool;
    const asked = [name, axis, by].reduce((text, fact, i) => text.replace(`{${i}}`, fact), word("touch_ask"));
    const other = spindle && by !== spindle ? ` ${word("touch_other").replace("{0}", spindle)}` : "";
    const value = await ask(asked + other, "0");
    if (value === null) return;
    const said = await dx.call("POST", `offsets/${name}/touch_off`, { [axis]: value, tool: by });
    if (said.ok) dx.say(word("saved").replace("{0}", name));
    look();
  }

  // A question with a number; null: given up.
  async function ask(sentence, start) {
    const given = await dx.ask_for(sentence, "setup.set", start, { inputmode: "decimal" });
    if (given === null) return null;
    const value = number(given);
    return Number.isFinite(value) ? value : (dx.say(word("number"), "warn"), null);
  }

  looks.push(
    dx.every("setup", 2, "offsets", (body) => {
      if (!shows("offsets")) return;
      table("setup-offsets", Object.entries(body.offsets), offset, of_offset);
      for (const row of $("setup-offsets").children) row.querySelector("[data-unset]").hidden = !body.offsets[row.dataset.row].unset;
    }),
  );

  // ---- tools

  const FIELDS = ["radius_mm", "length_mm", "flute_mm", "corner_mm", "taper_deg"];
  const of_tool = (values, field) => (field === "taper_deg" ? ((values.taper_rad ?? 0) * 180) / Math.PI : (values[field] ?? (field === "name" ? "" : 0)));
  // What stays is left out where it may be: turned to degrees and back it would be another taper by a hair.
  const stays = (field, one, values) => ["corner_mm", "taper_deg"].includes(field) && one === of_tool(values, field);
  const tool_body = (all, values) => Object.fromEntries(Object.entries(all).filter(([field, one]) => !stays(field, one, values)));

  function tool_row(number_) {
    const row = dx.el(
      "tr",
      { "data-row": number_ },
      dx.el("th", { scope: "row" }, dx.el("span", { class: "axis-name" }, `T${number_}`)),
      dx.el("td", { "data-label": word("name") }, input(`T${number_} ${word("name")}`, { class: "wide", inputmode: "text", "data-field": "name" })),
      ...FIELDS.map((field) => dx.el("td", { "data-label": word(field) }, input(`T${number_} ${word(field)}`, { "data-field": field }))),
      dx.el(
        "td",
        {},
        dx.el(
          "div",
          { class: "row" },
          dx.button(word("save"), () => save(row, "tools", of_tool, tool_body), { "data-needs": "control" }),
          number_ === "1" ? null : dx.button(word("delete"), () => remove_tool(number_), { "data-needs": "control" }),
        ),
      ),
    );
    return row;
  }

  async function remove_tool(number_) {
    if (!(await dx.ask(word("delete_ask").replace("{0}", `T${number_}`)))) return;
    await dx.call("DELETE", `tools/${number_}`);
    look();
  }

  // A tool that is there is never written over by one that is added.
  async function add_tool() {
    const number_ = await ask(word("add_ask"), String(Math.max(0, ...tools.map(([n]) => Number(n))) + 1));
    if (number_ === null) return;
    if (!Number.isInteger(number_) || number_ < 1 || number_ > 99999) return dx.say(word("tool_number"), "warn");
    const now = await dx.call("GET", "tools");
    if (!now.ok) return;
    if (now.body.tools[number_]) return dx.say(word("tool_there").replace("{0}", number_), "warn");
    await dx.call("PUT", `tools/${number_}`, { name: "", radius_mm: 3, length_mm: 0, flute_mm: 15 });
    look();
  }
  document.addEventListener("click", (event) => event.target.closest?.("#setup-add") && add_tool());
  document.addEventListener("change", (event) => event.target.id === "setup-tool" && pick(Number(event.target.value)));

  let tools = [];
  looks.push(
    dx.every("setup", 2, "tools", (body) => {
      tools = Object.entries(body.tools).sort((a, b) => Number(a[0]) - Number(b[0]));
      dx.fill("setup-tool", (rows) => rows.map(([n, one]) => dx.el("option", { value: n, selected: Number(n) === tool }, `T${n} ${one.name ?? ""}`)), tools);
      if (shows("tools")) table("setup-tools", tools, tool_row, of_tool);
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
    const drives = (status.drives ?? []).map((drive) => [drive.axis, drive.bus, drive.node, drive.state, drive.heard]);
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
            dx.el("td", {}, dx.words[`drives.state.${state}`] ?? state ?? "–"),
            ...fitted(dx.axis(name)).map((words) => dx.el("td", { class: "hide-narrow" }, words)),
          ),
        ),
      drives,
      dx.facts?.axes,
    );
  }

  // How a drive is set up: profile, homing, what notices that the controller is gone.
  function fitted(axis) {
    const homing = axis.absolute ? word("absolute") : word("method").replace("{0}", axis.homing_method ?? "–");
    return [axis.profile ?? "–", homing, axis.supervision ? word(`supervision.${axis.supervision}`) : "–"];
  }

  dx.on("built", (name) => {
    if (name === "setup") turn(page);
  });
  dx.on("view", (name) => {
    if (name !== "setup") return pick(spindle || tool); // what was picked was for the touch that is over
    told = null;
  });
})();
