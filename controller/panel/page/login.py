"""The log-in page: plain HTML, for it stands before everything else."""

from __future__ import annotations

import json
from html import escape

from controller.panel.page.words import FRAME, Language, spoken

_HTML = """<!doctype html>
<html lang="{language}"><head><meta charset="utf-8"><title>Directrix</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="/page/icon.svg"><link rel="stylesheet" href="/page/page.css"></head>
<body class="{body} login"><main><form class="card" id="login">
<h1>Directrix</h1>
<label>{name}<input id="name" autocomplete="username" autofocus required maxlength="40"></label>
<label>{password}<input id="password" type="password" autocomplete="current-password" required></label>
<p id="said" role="alert"></p>
<button class="act" data-kind="go">{title}</button>
</form></main>
<script>
const form = document.getElementById("login");
form.addEventListener("submit", async (event) => {{
  event.preventDefault();
  const body = {{ name: form.querySelector("#name").value, password: form.querySelector("#password").value }};
  const said = document.getElementById("said");
  try {{
    const answer = await fetch("/api/v1/session", {{
      method: "POST", headers: {{ "Content-Type": "application/json" }}, body: JSON.stringify(body),
    }});
    if (answer.ok) return location.assign("/");
    const facts = (await answer.json()).error;
    said.textContent = ("{language}" === "de" && facts.sentence_de) || facts.sentence;
  }} catch (error) {{
    said.textContent = {no_panel};
  }}
}});
</script></body></html>
"""


def page(language: Language, dark: bool) -> str:
    """The whole document."""
    word = spoken((FRAME,), language)
    return _HTML.format(
        language=language,
        body="body--dark" if dark else "body--light",
        name=escape(word["login.name"]),
        password=escape(word["login.password"]),
        title=escape(word["login.title"]),
        no_panel=json.dumps(word["frame.no_panel"]),
    )
