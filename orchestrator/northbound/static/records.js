// What is on record: the charges, and the batteries with their health over time.

import { bayPath, figure, go, h, lasting, link, moment, put, store, table, word, languageNow } from "./page.js";
import { chart, drawCurve } from "./curves.js";

const PAGE = 50;

/** An answer's JSON; an Error with the station's own sentence if it refuses. */
export async function readJson(path) {
  const url = new URL(path, location.origin);
  url.searchParams.set("language", languageNow());
  const answer = await fetch(url);
  const said = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Error(said.text ?? `HTTP ${answer.status}`);
  return said;
}

const query = (asked) =>
  new URLSearchParams(
    Object.entries(asked).filter(([, value]) => value !== "" && value !== null && value !== undefined),
  ).toString();

/** The charges that match, newest first. */
export const charges = async (asked) => (await readJson(`/api/sessions?${query(asked)}`)).sessions;

/** A charge's curve: [Unix seconds, SOC, A, V, °C]. */
export async function curve(id) {
  const { session, points } = await readJson(`/api/sessions/${encodeURIComponent(id)}`);
  return pointsOf(session, points);
}

const pointsOf = (session, points) =>
  points.map((one) => [
    session.begin.unix_s + one.elapsed_s,
    one.soc_pct,
    one.charger_a,
    one.pack_v,
    one.temperature_c,
  ]);
const socOf = (one) => `${figure(one.values?.soc_pct?.begin, 0, "%")} → ${figure(one.values?.soc_pct?.end, 0, "%")}`;
const kWh = (wh) => figure(typeof wh === "number" ? wh / 1000 : null, 2, "kWh");

// --- history ---------------------------------------------------------------------------------------------------------

const COLUMNS = [
  ["began", "time"],
  ["bay", ""],
  ["battery", ""],
  ["lasted", "number"],
  ["charged", "number"],
  ["energy", "number"],
  ["soc", "number"],
  ["result", "text"],
];

function row(one) {
  const opened = h(
    "a",
    { href: `/history?charge=${encodeURIComponent(one.id)}` },
    moment(one.begin.unix_s, { date: true }),
  );
  return [
    opened,
    link(bayPath(one.bay), one.bay),
    link(`/batteries?battery=${encodeURIComponent(one.battery.id)}`, one.battery.id),
    lasting(one.lasted_s),
    figure(one.charger.ah, 2, "Ah"),
    kWh(one.charger.wh),
    socOf(one),
    one.result_text || word("goes_on"),
  ];
}

/** A date field's day as Unix seconds, at its beginning here. */
const dayS = (value, days = 0) => (value ? new Date(`${value}T00:00`).getTime() / 1000 + 86_400 * days : "");

export function historyView(main) {
  const given = new URLSearchParams(location.search);
  if (given.has("charge")) return chargeView(main, given.get("charge"));
  const input = (name, type) => h("input", { type, name, value: given.get(name) ?? "" });
  const bays = h(
    "select",
    { name: "bay" },
    h("option", { value: "" }, word("any")),
    [...store.bays.keys()].map((name) => h("option", { value: name, selected: name === given.get("bay") }, name)),
  );
  const field = (name, control) => h("label", {}, word(name), control);
  const form = h(
    "form",
    {
      class: "filters",
      onsubmit: (event) => {
        event.preventDefault();
        const asked = query(Object.fromEntries(new FormData(form)));
        go(`/history${asked ? `?${asked}` : ""}`);
      },
    },
    field("bay", bays),
    field("battery", input("battery", "text")),
    field("from_day", input("from", "date")),
    field("to_day", input("to", "date")),
    h("button", { class: "act" }, word("apply")),
  );
  const asked = {
    bay: given.get("bay"),
    battery: given.get("battery"),
    since: dayS(given.get("from")),
    until: dayS(given.get("to"), 1),
  };
  const list = h("div"),
    more = h("button", { type: "button", class: "plain", hidden: true, onclick: () => read() }, word("more"));
  const csv = h(
    "a",
    { href: `/api/sessions.csv?${query(asked)}`, download: "charges.csv", class: "button" },
    word("csv"),
  );
  main.append(h("h1", {}, word("history")), form, list, h("p", { class: "after" }, more, csv));
  const found = [];

  async function read() {
    try {
      const next = await charges({ ...asked, limit: PAGE, before: found.at(-1)?.id });
      found.push(...next);
      more.hidden = next.length < PAGE;
      list.replaceChildren(
        found.length ? table(word("history"), COLUMNS, found.map(row)) : h("p", { class: "wait" }, word("nothing")),
      );
    } catch (error) {
      put(list, word("failed", { why: error.message }));
    }
  }
  read();
  return { title: word("history") };
}

/** One charge: its figures and its curve. */
function chargeView(main, id) {
  const about = h("div", {}),
    picture = h("div", { class: "curve" });
  main.append(
    h("p", { class: "way" }, link("/history", `← ${word("history")}`)),
    h("h1", {}, word("charge")),
    about,
    h("section", { class: "card" }, picture),
  );
  (async () => {
    try {
      const { session, points, lines } = await readJson(`/api/sessions/${encodeURIComponent(id)}`);
      const shown = COLUMNS.map(([name], at) =>
        h(
          "div",
          {},
          h("dt", {}, word(name)),
          h("dd", {}, at ? row(session)[at] : moment(session.begin.unix_s, { date: true })),
        ),
      );
      about.replaceChildren(
        h("section", { class: "card" }, h("dl", {}, shown)),
        lines?.length
          ? h(
              "section",
              { class: "card" },
              h(
                "ul",
                { class: "plainlist" },
                lines.map((one) => h("li", {}, one)),
              ),
            )
          : "",
      );
      await drawCurve(picture, pointsOf(session, points));
    } catch (error) {
      put(about, word("failed", { why: error.message }));
    }
  })();
  return { title: word("charge") };
}

// --- batteries -------------------------------------------------------------------------------------------------------

export function batteriesView(main) {
  const one = new URLSearchParams(location.search).get("battery");
  if (one) return batteryView(main, one);
  const list = h("div");
  main.append(h("h1", {}, word("batteries")), list);
  (async () => {
    try {
      const { batteries } = await readJson("/api/batteries");
      const rows = batteries.map((battery) => [
        link(`/batteries?battery=${encodeURIComponent(battery.id)}`, battery.id),
        figure(battery.charges, 0),
        figure(battery.ah, 1, "Ah"),
        kWh(battery.wh),
        figure(battery.soh_pct, 0, "%"),
        moment(battery.last_unix_s),
      ]);
      list.replaceChildren(
        rows.length
          ? table(
              word("batteries"),
              [
                ["battery", ""],
                ["charges", "number"],
                ["charged", "number"],
                ["energy", "number"],
                ["soh_bmu", "number"],
                ["last_charge", "time"],
              ],
              rows,
            )
          : h("p", { class: "wait" }, word("nothing")),
      );
    } catch (error) {
      put(list, word("failed", { why: error.message }));
    }
  })();
  return { title: word("batteries") };
}

/** The life of one battery: what its charges show of its health, and how that has changed. */
function batteryView(main, id) {
  const about = h("div"),
    picture = h("div", { class: "curve" }),
    list = h("div");
  main.append(
    h("p", { class: "way" }, link("/batteries", `← ${word("batteries")}`)),
    h("h1", {}, id),
    about,
    h("section", { class: "card" }, h("h2", {}, word("health_time")), picture),
    list,
  );
  (async () => {
    try {
      const { lines } = await readJson(`/api/batteries/${encodeURIComponent(id)}`);
      about.replaceChildren(
        h(
          "section",
          { class: "card" },
          h("h2", {}, word("health")),
          h(
            "ul",
            { class: "plainlist" },
            (lines ?? []).map((one) => h("li", {}, one)),
          ),
        ),
      );
      const found = await charges({ battery: id, limit: PAGE });
      list.replaceChildren(table(word("charges"), COLUMNS, found.map(row)));
      await showLife(picture, found);
    } catch (error) {
      put(about, word("failed", { why: error.message }));
    }
  })();
  return { title: id };
}

/** SOH as its BMU said at the end of each charge, and what each charge took. */
async function showLife(element, found) {
  const at = found.toReversed().filter((one) => typeof one.values?.soh_pct?.end === "number");
  if (at.length < 2) {
    put(element, word("nothing"));
    return;
  }
  const columns = [
    at.map((one) => one.begin.unix_s),
    at.map((one) => one.values.soh_pct.end),
    at.map((one) => one.charger.ah),
  ];
  await chart(element, [
    {
      dates: true,
      columns,
      series: [
        [word("soh_bmu"), "%", 0, "volts"],
        [word("charged"), "Ah", 1, "amps"],
      ],
    },
  ]);
}
