// The view of one bay: what it does and why, every limit, its curves, what a person may ask of it, what happened.

import {
  ENERGISED,
  ask,
  bayPath,
  figure,
  go,
  h,
  isOld,
  isUrgent,
  lasting,
  link,
  mayAsk,
  moment,
  put,
  readyAt,
  showRequest,
  showSoc,
  shown,
  stateMark,
  stopButton,
  store,
  word,
} from "./page.js";
import { charges, curve, readJson } from "./records.js";

const HOLD_MS = 1000,
  AGAIN_MS = 5000;
/** How far back the curves reach, and how often what has happened, and the limits, are asked for. */
const CURVE_S = 6 * 3600,
  EVENTS_MS = 15_000,
  CLOSELY_MS = 2000;
/** Records have a point at least so often. */
const GAP_S = 660;
const STARTABLE = ["IDLE", "HELD", "FULL", "SUSPENDED", "OFFLINE"],
  RESETTABLE = ["TRIPPED", "UNCONTROLLABLE"];

export function bayView(main, name) {
  if (!store.bays.has(name)) {
    main.append(h("h1", {}, word("no_bay", { bay: name })), h("p", { class: "way" }, link("/", `← ${word("back")}`)));
    return { title: name };
  }
  const parts = Object.fromEntries(
    ["head", "now", "faults", "limits", "session", "policy"].map((one) => [one, h("div")]),
  );
  const section = (title, ...inside) => h("section", { class: "card" }, h("h2", {}, word(title)), inside);
  const faults = section("faults", parts.faults),
    acts = new Acts(name),
    curves = new Curves(name),
    events = h("div", { class: "roll", tabindex: "0", role: "region", "aria-label": word("events") });
  const asked = h("p", { class: "asked", role: "status", hidden: true });
  const label = h("div");
  const show = h("button", { type: "button", class: "plain", onclick: () => showLabel(label, name) }, word("label"));
  main.append(
    h("p", { class: "way" }, link("/", `← ${word("back")}`)),
    parts.head,
    h(
      "div",
      { class: "columns" },
      h(
        "div",
        {},
        section("now", parts.now),
        faults,
        acts.element,
        section("session", parts.session),
        section("policy", parts.policy),
      ),
      h(
        "div",
        {},
        section("limits", parts.limits),
        section("curves", curves.element),
        section("events", events),
        h("section", { class: "card print" }, show, label),
      ),
    ),
    h(
      "div",
      { class: "foot" },
      asked,
      mayAsk()
        ? [h("p", { class: "hint" }, word("stop_does")), stopButton(name, "large")]
        : h("p", {}, word("only_viewer")),
    ),
  );

  let closely = {}; // limits and forecast: the stream of all bays does not have them
  async function lookClosely() {
    if (document.hidden) return;
    try {
      const { limits, forecast } = await readJson(`/api/bay?bay=${encodeURIComponent(name)}`);
      closely = { limits, forecast };
      view.update();
    } catch {
      /* what the stream tells is shown, and this the next time */
    }
  }

  async function readEvents() {
    try {
      showEvents(events, await readJson(`/api/events?bay=${encodeURIComponent(name)}`));
    } catch (error) {
      put(events, word("failed", { why: error.message }));
    }
  }
  const timers = [setInterval(readEvents, EVENTS_MS), setInterval(lookClosely, CLOSELY_MS)];

  const view = {
    title: name,
    close() {
      timers.forEach(clearInterval);
      curves.close();
    },
    update(names) {
      if (names && !names.includes(name)) return;
      if (!store.bays.has(name)) {
        go(location.pathname);
        return;
      } // it is gone: say so
      const bay = { ...store.bays.get(name), ...closely };
      changed(parts.head, [bay.state, bay.reason, bay.since, bay.alarm, bay.next], () => head(bay));
      changed(parts.now, [bay.battery, bay.charger, bay.forecast, bay.identity], () => nowLines(bay));
      changed(parts.limits, [bay.limits, bay.faults], () => limits(bay));
      changed(parts.session, [bay.session, bay.target], () => session(bay));
      changed(parts.policy, [bay.policy], () => policy(bay));
      changed(parts.faults, bay.faults, () => faultList(bay));
      faults.hidden = !bay.faults.length;
      acts.show(bay);
      curves.add(bay);
      showRequest(asked, bay);
    },
  };
  readEvents();
  lookClosely();
  return view;
}

/** Fills an element anew if what it shows has changed. */
function changed(element, about, make) {
  const key = JSON.stringify(about);
  if (element.dataset.key === key) return;
  element.dataset.key = key;
  element.replaceChildren(...[make()].flat());
}

/** Names and what stands behind them. */
export function pairs(lines) {
  return h(
    "dl",
    {},
    lines
      .filter(([, value]) => value !== "" && value !== null && value !== undefined && value !== false)
      .map(([name, value]) => h("div", {}, h("dt", {}, word(name)), h("dd", {}, value))),
  );
}

function head(bay) {
  const since =
    typeof bay.since === "number" ? h("span", { class: "since" }, word("since", { at: moment(bay.since) })) : null;
  const next =
    bay.next?.text && !bay.reason.includes(bay.next.text)
      ? h("p", { class: "next" }, h("b", {}, `${word("next")}: `), bay.next.text)
      : null;
  return h(
    "div",
    { class: "head", "data-state": bay.state, "data-alarm": bay.alarm },
    h("h1", {}, bay.name),
    h("p", { class: "mark" }, stateMark(bay.state), since),
    h("p", { class: "why" }, isUrgent(bay) ? h("b", {}, `${word(bay.alarm)} · `) : null, bay.reason),
    next,
    timed(bay),
  );
}

const timed = (bay) => (bay.timed_start?.text ? h("p", { class: "next" }, bay.timed_start.text) : null);

function nowLines(bay) {
  const { battery, charger, forecast } = bay;
  const of = (name, digits, unit) => shown(battery[name], digits, unit, isOld(battery, name));
  const chargers = `${shown(charger.voltage_v, 1, "V", charger.old)} · ${shown(charger.current_a, 2, "A", charger.old)}`;
  return [
    h(
      "p",
      { class: "charge" },
      showSoc(h("span", { class: "soc" }), battery),
      h("span", { class: "ready" }, readyAt(bay)),
    ),
    pairs([
      ["battery", `${of("voltage_v", 2, "V")} · ${of("current_a", 2, "A")} · ${of("temperature_c", 1, "°C")}`],
      ["charger", chargers],
      ["step", bay.step === null ? "" : `${bay.step + 1} (${figure(bay.step_current_a, 1, "A")})`],
      ["forecast_bmu", forecast?.bmu_at && moment(forecast.bmu_at)],
      ["forecast_own", forecast?.own_at && moment(forecast.own_at)],
    ]),
    h("p", { class: "small" }, [bay.identity?.text, battery.problem, charger.problem].filter(Boolean).join(" · ")),
  ];
}

function faultList(bay) {
  return h(
    "ul",
    { class: "plainlist" },
    bay.faults.map((fault) =>
      h(
        "li",
        {},
        h("b", {}, fault.effect),
        " ",
        fault.text,
        fault.clears && !fault.text.includes(fault.clears.text) ? h("p", { class: "small" }, fault.clears.text) : null,
      ),
    ),
  );
}

// --- limits ----------------------------------------------------------------------------------------------------------

const STRONG = ["NO_START", "PAUSE", "STOP", "TRIP"],
  MARKS = { binds: "▶", blocking: "■", active: "◆", inactive: "○" };

/** How a limit acts now: it blocks all current, it is the one that sets the step, it is below the highest, or neither. */
export function actOf(limit, highestA, faults) {
  const blocked = faults.some(
    (fault) =>
      STRONG.includes(fault.effect) &&
      (limit.cause.key === fault.cause?.key || (limit.binds && limit.cause.id === "limit_fault")),
  );
  if (blocked || limit.allowed_a === 0) return "blocking";
  if (limit.binds) return "binds";
  return limit.allowed_a !== null && limit.allowed_a < highestA ? "active" : "inactive";
}

function limits(bay) {
  if (!bay.limits?.length) return h("p", {}, word("no_limits"));
  const highestA = Math.max(...bay.limits.map((one) => one.allowed_a ?? 0));
  return h(
    "ul",
    { class: "limits" },
    bay.limits.map((one) => {
      const act = actOf(one, highestA, bay.faults),
        bar = h("span");
      bar.style.width = `${highestA && one.allowed_a !== null ? (100 * one.allowed_a) / highestA : 0}%`;
      return h(
        "li",
        { class: act },
        h("b", { class: "act" }, `${MARKS[act]} ${word(act)}`),
        h("span", { class: "amps" }, one.allowed_a === null ? "" : figure(one.allowed_a, 1, "A")),
        h("span", { class: one.allowed_a === null ? "" : "bar", "aria-hidden": "true" }, bar),
        h("span", { class: "text" }, one.text),
      );
    }),
  );
}

function session({ session: one, target }) {
  if (!one) return h("p", {}, target?.text || word("nothing"));
  const soc = `${figure(one.soc_start_pct, 0, "%")} → ${figure(one.soc_pct, 0, "%")}`;
  return pairs([
    ["soc", soc],
    ["charged", figure(one.charged_ah, 2, "Ah")],
    ["energy", figure(one.charged_wh, 0, "Wh")],
    ["lasted", lasting(one.elapsed_s)],
    ["target", target?.text],
    ["result", one.result],
  ]);
}

function policy({ policy: one }) {
  if (!one) return h("p", {}, word("nothing"));
  return [
    pairs([
      ["policy", `${one.name} (${one.file})`],
      ["in_force", typeof one.since === "number" ? moment(one.since) : ""],
    ]),
    h("p", { class: "small hash" }, `SHA-256 ${one.sha256}`),
    one.waiting_sha256 ? h("p", {}, word("waiting")) : "",
  ];
}

// --- requests --------------------------------------------------------------------------------------------------------

/** Start, pause and reset, each with what it will do. Stop is elsewhere, alone. */
class Acts {
  constructor(name) {
    this.name = name;
    this.list = h("div", { class: "acts" });
    this.because = h("input", { type: "text", maxlength: "200" });
    this.element = h(
      "section",
      { class: "card", hidden: true },
      this.list,
      h("label", { class: "because" }, word("because"), this.because),
    );
  }

  show(bay) {
    const acts = [
      STARTABLE.includes(bay.state) && "start",
      ENERGISED.includes(bay.state) && "pause",
      RESETTABLE.includes(bay.state) && "reset",
    ].filter(Boolean);
    const key = `${mayAsk()} ${acts} ${bay.policy?.name}`;
    if (this.list.dataset.key === key) return;
    this.list.dataset.key = key;
    this.element.hidden = !acts.length || !mayAsk();
    this.list.replaceChildren(
      ...acts.map((act) => {
        const id = `does-${act}`,
          since = () => store.bays.get(this.name)?.since ?? undefined,
          send = (seen) => ask(act, this.name, this.because.value.trim(), seen);
        const does = h(
          "p",
          { id, class: "hint" },
          word(`${act}_does`, { bay: this.name, policy: bay.policy?.name ?? "" }),
        );
        const plain = h(
          "button",
          { type: "button", class: "act", "aria-describedby": id, onclick: () => send() },
          word(act),
        );
        return h("div", {}, does, act === "pause" ? plain : holdButton(act, id, since, send));
      }),
    );
  }
}

/** A button that acts when it has been held for a second, by finger, mouse or key, on what `look` saw as it was pressed. */
function holdButton(act, describedBy, look, done) {
  const what = word(act),
    text = h("span", {}, word("hold", { what }));
  const made = h("button", { type: "button", class: "act hold", "aria-describedby": describedBy }, text);
  let timer = null,
    armed = null,
    seen;
  const begin = () => {
    if (timer !== null) return;
    made.classList.add("held");
    seen = look();
    timer = setTimeout(() => {
      end();
      done(seen);
    }, HOLD_MS);
  };
  const end = () => {
    clearTimeout(timer);
    timer = null;
    made.classList.remove("held");
  };
  const isKey = (event) => event.key === "Enter" || event.key === " ";
  made.addEventListener("pointerdown", (event) => {
    if (!event.button) begin();
  });
  for (const name of ["pointerup", "pointerleave", "pointercancel", "blur"]) made.addEventListener(name, end);
  made.addEventListener("contextmenu", (event) => event.preventDefault());
  made.addEventListener("keydown", (event) => {
    if (!isKey(event)) return;
    event.preventDefault();
    if (!event.repeat) begin(); // held on, it acts once
  });
  made.addEventListener("keyup", (event) => {
    if (isKey(event)) {
      event.preventDefault();
      end();
    }
  });
  made.addEventListener("click", (event) => {
    if (event.detail > 0) return; // of a finger or mouse; others come from assistive technology, which cannot hold: twice, then
    if (armed !== null) {
      clearTimeout(armed);
      armed = null;
      put(text, word("hold", { what }));
      done(seen);
      return;
    }
    seen = look();
    put(text, word("hold_again", { what }));
    armed = setTimeout(() => {
      armed = null;
      put(text, word("hold", { what }));
    }, AGAIN_MS);
  });
  return made;
}

// --- curves and events -----------------------------------------------------------------------------------------------

/** The curves of the last hours: recorded charges, and what has been heard since. */
class Curves {
  constructor(name) {
    this.name = name;
    this.element = h("div", { class: "curve" });
    this.points = []; // [unix s, SOC, A, V, °C]
    this.from = [];
    this.timer = setInterval(() => this.draw(), 10_000);
    this.read();
  }

  async read() {
    const sinceS = Date.now() / 1000 - CURVE_S;
    try {
      const found = await charges({ bay: this.name, since: sinceS, limit: 5 });
      for (const one of found.reverse()) this.from.push(...(await curve(one.id)));
    } catch {
      /* what is heard from now on is shown all the same */
    }
    this.draw();
  }

  add(bay) {
    const { battery, charger } = bay,
      atS = Date.now() / 1000,
      last = this.points.at(-1);
    if (last && atS - last[0] < 1) return;
    const fresh = (name) => (isOld(battery, name) ? null : battery[name]);
    this.points.push([
      atS,
      fresh("soc_pct"),
      charger.old ? null : charger.current_a,
      fresh("voltage_v"),
      fresh("temperature_c"),
    ]);
    if (this.points.length > CURVE_S) this.points.shift();
    if (this.points.length === 3) this.draw();
  }

  async draw() {
    const endS = this.from.at(-1)?.[0] ?? 0,
      beginS = Date.now() / 1000 - CURVE_S;
    const points = [...this.from, ...this.points.filter(([atS]) => atS > endS)].filter(([atS]) => atS > beginS);
    const { drawCurve } = await import("./curves.js");
    drawCurve(this.element, withGaps(points));
  }

  close() {
    clearInterval(this.timer);
  }
}

/** No line across a time of which nothing is known. */
function withGaps(points) {
  return points.flatMap((point, at) =>
    at && point[0] - points[at - 1][0] > GAP_S ? [[points[at - 1][0] + 1, null, null, null, null], point] : [point],
  );
}

function showEvents(element, found) {
  const events = (found.events ?? found).slice(-30).reverse();
  if (!events.length) {
    put(element, word("nothing"));
    return;
  }
  const at = (one) => one.at_unix_s ?? one.unix_s ?? one.at ?? one.time;
  element.replaceChildren(
    h(
      "ol",
      { class: "events" },
      events.map((one) =>
        h(
          "li",
          { class: one.needs || one.person ? "needs" : null },
          h("time", {}, typeof at(one) === "number" ? moment(at(one), { seconds: true }) : String(at(one) ?? "")),
          " ",
          one.text,
        ),
      ),
    ),
  );
}

/** A label to print and stick on the bay: its name, and the way to this view. */
async function showLabel(element, name) {
  const { qrPath } = await import("./label.js");
  const { path, size } = qrPath(new URL(bayPath(name), location.href).href);
  const picture = h(
    "svg",
    { viewBox: `0 0 ${size} ${size}`, class: "qr", role: "img", "aria-label": location.origin + bayPath(name) },
    h("path", { d: path }),
  );
  element.replaceChildren(
    h(
      "div",
      { class: "label" },
      picture,
      h(
        "p",
        {},
        h("b", {}, name),
        h("br"),
        store.station.station,
        h("br"),
        h("small", {}, location.origin + bayPath(name)),
      ),
    ),
    h("button", { type: "button", class: "plain noprint", onclick: () => print() }, word("print")),
  );
}
