// The station itself: versions, policies, journal and links; and the way in.

import { bayPath, h, link, moment, put, signedIn, store, table, word } from "./page.js";

const HEADERS = { "Content-Type": "application/json" };

export function stationView(main) {
  const parts = h("div", { class: "columns" });
  main.append(h("h1", {}, word("station")), parts);
  return {
    title: word("station"),
    update() {
      const bays = [...store.bays.values()],
        { journal, persisted, strays = [] } = store.station;
      const about = [
        store.station,
        store.page,
        bays.map(({ policy, port, bmu, charger, battery }) => [
          policy,
          port,
          bmu,
          charger.online,
          charger.problem,
          battery.online,
          battery.problem,
        ]),
      ];
      const key = JSON.stringify(about);
      if (parts.dataset.key === key) return;
      parts.dataset.key = key;
      const card = (title, ...inside) => h("section", { class: "card" }, h("h2", {}, word(title)), inside);
      parts.replaceChildren(
        h(
          "div",
          {},
          card("policies", policies(bays)),
          card(
            "journal",
            pairList([
              ["directory", journal?.directory],
              ["journal", journal?.problem || word("well")],
              ["persisted", persisted?.problem || word("well")],
            ]),
          ),
          card(
            "versions",
            h(
              "dl",
              {},
              Object.entries(store.page ?? {}).map(([name, value]) =>
                h("div", {}, h("dt", {}, name === "version" ? "orchestrator" : name), h("dd", {}, String(value))),
              ),
            ),
          ),
        ),
        h(
          "div",
          {},
          card("links", links(bays)),
          strays.length
            ? card(
                "strays",
                h(
                  "ul",
                  { class: "plainlist" },
                  strays.map((one) => h("li", {}, h("b", {}, one.port), ` ${one.problem || one.state}`)),
                ),
              )
            : "",
        ),
      );
    },
  };
}

const pairList = (lines) =>
  h(
    "dl",
    {},
    lines.map(([name, value]) => h("div", {}, h("dt", {}, word(name)), h("dd", {}, value))),
  );

/** Each policy in force, with the bays that use it. */
function policies(bays) {
  const found = new Map();
  for (const { name, policy } of bays)
    if (policy) found.set(policy.sha256, { policy, bays: [...(found.get(policy.sha256)?.bays ?? []), name] });
  return [...found.values()].map(({ policy, bays: of }) =>
    h(
      "div",
      { class: "policy" },
      h("h3", {}, policy.name),
      pairList([
        ["file", policy.file],
        ["in_force", typeof policy.since === "number" ? moment(policy.since) : word("nothing")],
        ["used_by", of.join(", ")],
      ]),
      h("p", { class: "small hash" }, `SHA-256 ${policy.sha256}`),
      policy.waiting_sha256 ? h("p", {}, word("waiting")) : "",
    ),
  );
}

function links(bays) {
  const how = (part) => (part.online ? word("answers") : part.problem || word("silent"));
  const node = (bmu) => (bmu ? `0x${bmu.node_id.toString(16).toUpperCase()} · ${bmu.can}` : "");
  return table(
    word("links"),
    [
      ["bay", ""],
      ["port", ""],
      ["charger", "text"],
      ["battery", "text"],
    ],
    bays.map((bay) => [
      link(bayPath(bay.name), bay.name),
      bay.port,
      how(bay.charger),
      `${node(bay.bmu)} · ${how(bay.battery)}`,
    ]),
  );
}

/** The way in. */
export function loginView(main) {
  const said = h("p", { role: "alert", class: "bad" });
  const name = h("input", { name: "name", autocomplete: "username", required: true }),
    password = h("input", { name: "password", type: "password", autocomplete: "current-password", required: true });
  const form = h(
    "form",
    {
      class: "card login",
      onsubmit: async (event) => {
        event.preventDefault();
        put(said, "");
        try {
          const answer = await fetch("/api/login", {
            method: "POST",
            headers: HEADERS,
            body: JSON.stringify({ name: name.value, password: password.value }),
          });
          const found = await answer.json().catch(() => ({}));
          if (!answer.ok) {
            put(said, found.text ?? word("sign_in_wrong"));
            return;
          }
          signedIn();
        } catch (error) {
          put(said, word("failed", { why: error.message }));
        }
      },
    },
    h("h1", {}, word("sign_in")),
    h("p", {}, word("sign_in_first")),
    h("label", {}, word("name"), name),
    h("label", {}, word("password"), password),
    said,
    h("button", { class: "act" }, word("sign_in")),
  );
  main.append(form);
  name.focus();
  return { title: word("sign_in") };
}
