// What the page knows, at one place: the status as it was heard last, and what all views share.
//
// The page is drawn from it: whoever changes it says so by ``changed``, and what is on the screen follows.
/** @type {Record<string, any> & { status: PageStatus | null }} */
export const dx = {
  status: null, // as GET /status has it, with ``shown``: what is wrong and under way, in words
  stale: true, // its figures are old
  silent: true, // nobody tells anything; a tick that hangs is told of, and can be started anew
  answers: true, // whether the controller's service answers the panel
  socket: null,
  language: document.documentElement.lang,
  words: {},
  commands: {}, // of the machine, by name: what may be asked for, in which modes (GET /commands)
  facts: {}, // of the machine file; {} = no service has answered yet
  user: null, // { name, role, csrf, may_stop }
  holder: null, // of the control token: a name
  silent_s: 0, // for so long nothing was heard of the holder
  inch: kept("inch", false), // lengths of Run and 3-D are shown in inches; programs, tables and steps keep their own unit
  token: "", // "" = this page does not hold it
  view: "",
  folder: "", // of the programs that are listed; what is uploaded goes into it
  question: null, // { sentence, yes, field, start, end }
  notice: null, // { sentence, tone }
};

const hearers = {};

// fn(data) is called with all that is told under a topic; gives what ends that.
dx.on = (topic, fn) => {
  (hearers[topic] ??= []).push(fn);
  return () => (hearers[topic] = hearers[topic].filter((one) => one !== fn));
};

dx.tell = (topic, data) => {
  for (const fn of hearers[topic] ?? []) {
    try {
      fn(data);
    } catch (error) {
      console.error(topic, error);
    }
  }
};

dx.shown = (name) => dx.view === name;
dx.loaded = () => Boolean(dx.status?.job) && dx.status.job.state !== "interrupted"; // not what another service ran
dx.holds = () => dx.token !== "";
dx.axis = (name) => (dx.facts.axes ?? []).find((axis) => axis.name === name) ?? {};
dx.draw = () => {}; // main.js puts the drawing here

let asked = false;

// Draw soon: however much comes, a screen shows sixty pictures a second.
export function changed() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    dx.draw();
  });
}

// What a browser is to remember; one that refuses to is no reason for an error.
export function kept(key, otherwise) {
  try {
    return JSON.parse(localStorage.getItem(`directrix.${key}`)) ?? otherwise;
  } catch {
    return otherwise;
  }
}

export function keep(key, value) {
  try {
    localStorage.setItem(`directrix.${key}`, JSON.stringify(value));
  } catch {
    // it is asked for again
  }
}
