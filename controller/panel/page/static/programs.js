// Uploads with their progress, by the same route as any script; new names; begin elsewhere.
(() => {
  "use strict";
  const dx = window.dx;

  // One after another: a browser has six connections to a server, and a stop needs one of them.
  let before = Promise.resolve();

  function upload(file) {
    const place = document.getElementById("programs-uploads");
    const line = document.createElement("div");
    line.className = "upload";
    line.innerHTML = '<span class="upload-name"></span><div class="bar"></div><span class="figures upload-share"></span>';
    line.querySelector(".upload-name").textContent = file.name;
    place.append(line);
    before = before.then(async () => ((await wanted(file.name)) ? send(file, line) : line.remove()));
  }

  // What is there already is replaced only by one who says so. The store has names composed, some systems do not.
  async function wanted(name) {
    const there = await dx.call("GET", `programs/${encodeURIComponent(name.normalize())}`, null, true);
    return !there.ok || dx.ask(dx.word("programs.replace_ask").replace("{0}", () => name), "programs.replace");
  }

  function send(file, line) {
    const form = new FormData();
    form.append("file", file, file.name);
    const asking = new XMLHttpRequest();
    asking.open("POST", "/api/v1/programs");
    for (const [name, value] of Object.entries(dx.headers())) asking.setRequestHeader(name, value);
    asking.upload.onprogress = (event) => {
      const share = event.total ? event.loaded / event.total : 0;
      line.querySelector(".bar").style.setProperty("--share", share);
      line.querySelector(".upload-share").textContent = `${Math.round(share * 100)} %`;
    };
    return new Promise((resolve) => {
      asking.onloadend = () => {
        ended(asking, line, file);
        resolve();
      };
      asking.send(form);
    });
  }

  function ended(asking, line, file) {
    if (asking.status === 201) {
      line.remove();
      return;
    }
    let sentence = dx.word("frame.no_panel");
    try {
      sentence = dx.sentence(JSON.parse(asking.responseText).error) || sentence;
    } catch (error) {
      // no answer at all: the panel is gone
    }
    line.dataset.tone = "stop";
    line.querySelector(".upload-share").textContent = sentence;
    setTimeout(() => line.remove(), 15000);
    dx.say(`${file.name}: ${sentence}`, "warn");
  }

  // Dropped anywhere on the page it is an upload: never a page that is opened in place of this one.
  const over = (on) => document.getElementById("programs-drop")?.toggleAttribute("data-over", on);
  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    if (event.dataTransfer?.types.includes("Files")) dx.show("programs");
    over(true);
  });
  document.addEventListener("dragleave", (event) => event.relatedTarget === null && over(false));
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    over(false);
    for (const file of event.dataTransfer?.files ?? []) upload(file);
  });
  document.addEventListener("change", (event) => {
    if (event.target.id !== "programs-file") return;
    for (const file of event.target.files) upload(file);
    event.target.value = "";
  });

  document.addEventListener("click", async (event) => {
    const button = event.target.closest?.("[data-rename]");
    if (!button || button.disabled) return;
    const { question, rename } = button.dataset;
    const name = (await dx.ask_for(question, "programs.rename", rename, { maxlength: 200 }))?.trim();
    if (name && name !== rename) dx.call("PATCH", `programs/${encodeURIComponent(rename)}`, { name });
  });

  document.addEventListener("submit", (event) => event.target.matches?.(".places") && event.preventDefault());
  document.addEventListener("click", async (event) => {
    const button = event.target.closest?.(".places button");
    if (!button || button.disabled) return;
    const form = button.closest("form");
    const value = (name) => form.querySelector(`[name=${name}]`).valueAsNumber;
    const body = { program: form.dataset.program };
    if (value("line") >= 1) body.line = Math.round(value("line"));
    if (value("fraction") >= 0) body.fraction = value("fraction") / 100;
    if (value("dry") > 0) body.dry_run_mm = value("dry");
    if (form.querySelector("[name=block_delete]").checked) body.block_delete = true;
    await dx.call("POST", "job", body);
  });

  // What was interrupted: offered where nothing is loaded, on the views where one would go on.
  function offered(told) {
    const shown = told.name && !dx.status?.job;
    for (const place of document.querySelectorAll("[data-offer]")) {
      const key = shown ? JSON.stringify(told) : "";
      place.hidden = !shown;
      if (place.dataset.told === key) continue;
      place.dataset.told = key;
      place.replaceChildren(...(shown ? offer(told) : []));
    }
  }

  function offer(told) {
    const facts = [told.name, told.line ?? "–", Math.round((told.fraction ?? 0) * 100), dx.forms.date(told.interrupted_s)];
    const words = facts.reduce((text, fact, i) => text.replace(`{${i}}`, fact), dx.word("programs.offer"));
    const body = JSON.stringify({ program: told.program, restart: true });
    const press = { class: "act", type: "button", "data-kind": "go", "data-call": "POST job", "data-body": body, "data-needs": "control", "data-modes": "OFF READY" };
    return [
      dx.el("p", { class: "strong" }, words),
      told.offered ? dx.el("button", press, dx.word("programs.go_on")) : dx.el("p", { class: "dim" }, `${dx.word("programs.not_offered")} ${dx.sentence(told)}`),
    ];
  }
  const looks = ["programs", "run"].map((view) => dx.every(view, 3, "restart", offered));
  dx.on("job", () => looks.forEach((look) => look()));

  // Times of day, as the browser's user writes them.
  const shortly = { dateStyle: "medium", timeStyle: "short" };
  function times() {
    for (const place of document.querySelectorAll("time[data-at]:empty")) {
      place.textContent = new Date(Number(place.dataset.at) * 1000).toLocaleString(dx.language, shortly);
    }
  }
  setInterval(times, 200);

  // What will be in force at the place where the loaded program begins.
  dx.on("painted", ({ job }) => {
    const german = dx.language === "de" && job?.restart_de;
    const told = (job?.state === "loaded" && (german || job.restart)) || [];
    for (const place of document.querySelectorAll("[data-restart]")) {
      place.hidden = told.length === 0;
      if (place.dataset.told === told.join("\n")) continue;
      place.dataset.told = told.join("\n");
      place.querySelector("ul").replaceChildren(...told.map((words) => dx.el("li", {}, words)));
    }
  });
})();
