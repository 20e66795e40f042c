// Who may do what here: users, tokens of scripts, and who asked for what.
import { call } from "../api.js";
import { ask, ask_for, say } from "../dialog.js";
import { html, useEffect } from "../dom.js";
import { forms } from "../forms.js";
import { Act, Chip, ScrolledTable, Select, Wrong, useChosen } from "../parts.js";
import { dx } from "../store.js";
import { sentence, word as text } from "../texts.js";

const word = (key, ...values) => text(`users.${key}`, ...values);
const ROLES = ["view", "operate", "set_up"];
const MOST = 100; // of the last things that were asked for
const RULES = { needs: "set_up" };
const PASSWORD = { type: "password", autocomplete: "new-password", minlength: 8, maxlength: 200 };
const told = { users: [], tokens: [], entries: [], sessions: [], wrong: "", role: "operate", made: null };

async function read() {
  const of_set_up = dx.user?.role === "set_up" ? ["users", "tokens", `audit?most=${MOST}`] : [];
  const said = await Promise.all(["sessions", ...of_set_up].map((path) => call("GET", path, null, true)));
  told.wrong = sentence(said.find(({ ok }) => !ok)?.body.error);
  for (const { ok, body } of said) if (ok) Object.assign(told, body);
  dx.draw();
}

async function change(method, path, body) {
  const said = await call(method, path, body);
  if (said.ok) await read();
  return said;
}

async function add_user() {
  const name = (await ask_for(word("name_ask"), "users.add", "", { maxlength: 40 }))?.trim();
  const password = name && (await ask_for(word("password_ask", name), "users.add", "", PASSWORD));
  if (password) await change("POST", "users", { name, password, role: told.role });
}

async function new_password(name) {
  const password = await ask_for(word("password_ask", name), "users.set", "", PASSWORD);
  if (password && (await change("PATCH", `users/${name}`, { password })).ok) say(word("password_set", name));
}

async function own_password() {
  const old = await ask_for(word("old_ask"), "users.set", "", { ...PASSWORD, autocomplete: "current-password", minlength: 1 });
  const password = old && (await ask_for(word("new_ask"), "users.set", "", PASSWORD));
  const said = password && (await change("PUT", "session/password", { old, password }));
  if (!said?.ok) return;
  dx.user = said.body; // the session is another, and what goes with it
  say(word("own_password_set"));
  await read();
}

async function add_token() {
  const name = (await ask_for(word("token_ask"), "users.add", "", { maxlength: 40 }))?.trim();
  const said = name && (await change("POST", "tokens", { name, role: told.role }));
  if (said?.ok) told.made = said.body;
  dx.draw();
}

const remove = async (path, name) => (await ask(word("remove_ask", name), "users.remove")) && change("DELETE", `${path}/${encodeURIComponent(name)}`);
const Remove = ({ path, name }) => html`<${Act} text=${word("remove")} aria-label=${`${word("remove")} ${name}`} kind="warn" ...${RULES} press=${() => remove(path, name)} />`;

// The role that whoever is added next gets, or that somebody has.
const Roles = ({ role, label, choose }) => html`<${Select} aria-label=${label} options=${ROLES} text=${(one) => word(`role.${one}`)} value=${role} choose=${choose} />`;

function RoleOf({ name, role }) {
  const [shown, choose] = useChosen(role, (other) => change("PATCH", `users/${name}`, { role: other }));
  return html`<${Roles} role=${shown} label=${`${word("role")} ${name}`} choose=${choose} />`;
}

const Table = (props) => html`<${ScrolledTable} word=${word} ...${props} />`;

// Of whoever is logged in: the own password, and the sessions that are open.
const Own = () => html`
  ${dx.user?.how === "session" && html`<div class="row"><${Act} id="users-own" text=${word("own_password")} needs="" press=${own_password} /></div>`}
  ${told.sessions.length > 0 && html`<h2>${word("sessions")}</h2><${Table} columns=${["name", "began", "seen", ""]} body="users-sessions">${told.sessions.map((one) => html`<tr key=${one.id} data-session=${one.id}>
    <th scope="row">${one.user}</th><td>${forms.date(one.began_s)}</td><td>${forms.date(one.seen_s)}</td>
    <td>${one.mine ? word("this_one") : html`<${Act} text=${word("end_session")} aria-label=${`${word("end_session")} ${one.user}`} kind="warn" needs="" press=${() => change("DELETE", `sessions/${one.id}`)} />`}</td></tr>`)}<//>`}`;

export function Users() {
  useEffect(() => void read(), []);
  if (dx.user?.role !== "set_up") return html`<${Own} /><p class="dim">${text("why.set_up")}</p>`;
  const pick = (role) => ((told.role = role), dx.draw());
  return html`
    <${Wrong} text=${told.wrong} />
    <div class="row"><${Roles} role=${told.role} label=${word("role_of_new")} choose=${pick} />
      <${Act} id="users-add" text=${word("add_user")} ...${RULES} press=${add_user} given=${told.users.length > 0} why="users.first" />
      <${Act} id="users-token" text=${word("add_token")} ...${RULES} press=${add_token} /></div>
    ${told.made && html`<p class="made" role="status">${word("made", told.made.name)} <code>${told.made.token}</code></p>`}
    ${told.users.length === 0 && html`<p class="dim">${word("first")}</p>`}
    ${told.users.length > 0 && html`<${Table} columns=${["name", "role", ""]} body="users-list">${told.users.map(({ name, role }) => html`<tr key=${name} data-user=${name}>
      <th scope="row">${name}</th>
      <td><${RoleOf} name=${name} role=${role} /></td>
      <td><div class="row"><${Act} text=${word("password")} aria-label=${`${word("password")} ${name}`} ...${RULES} press=${() => new_password(name)} /><${Remove} path="users" name=${name} /></div></td></tr>`)}<//>`}
    ${told.tokens.length > 0 && html`<h2>${word("tokens")}</h2><${Table} columns=${["name", "role", "by", "expires", ""]} body="users-tokens">${told.tokens.map((one) => html`<tr key=${one.name} data-token=${one.name}>
      <th scope="row">${one.name}</th><td>${word(`role.${one.role}`)}</td><td>${one.made_by}</td>
      <td>${one.expires_s ? forms.moment(one.expires_s) : word("never")}</td><td><${Remove} path="tokens" name=${one.name} /></td></tr>`)}<//>`}
    <${Own} />
    <h2>${word("audit")}</h2>
    <${Table} columns=${["when", "name", "action", "outcome"]} body="users-audit">${told.entries.map((one) => html`<tr key=${one.id}>
      <td>${forms.date(one.at_s)}</td><td>${one.user || "–"} <span class="dim">${one.address}</span></td><td>${one.action} <span class="dim">${one.detail}</span></td>
      <td><${Chip} tone=${one.allowed ? "go" : "stop"}>${word(one.allowed ? "allowed" : "refused")}<//></td></tr>`)}<//>`;
}
