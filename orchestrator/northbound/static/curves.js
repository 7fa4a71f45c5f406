// Curves, drawn by uPlot (vendor/), which is loaded with the first of them.

import { figure, h, languageNow, moment, put, word } from "./page.js";

let ready = null;

function uplot() {
  ready ??= new Promise((resolve, reject) => {
    const style = h("link", { rel: "stylesheet", href: "/static/vendor/uplot-1.6.32.min.css" });
    const script = h("script", { src: "/static/vendor/uplot-1.6.32.min.js" });
    script.addEventListener("load", () => resolve(window.uPlot));
    script.addEventListener("error", () => reject(new Error("uPlot")));
    document.head.append(style, script);
  });
  return ready;
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
/** Where figures are whole, so are the distances of the ticks. */
const WHOLE = [1, 2, 5, 10, 20, 25, 50, 100, 200, 500, 1000];
const drawn = new WeakMap();

/** Draws [Unix seconds, SOC, A, V, °C] into an element: two charts with one time axis. */
export function drawCurve(element, points) {
  if (points.length < 2) {
    put(element, word("no_curve"));
    return Promise.resolve();
  }
  const columns = [0, 1, 2, 3, 4].map((column) => points.map((point) => point[column]));
  return chart(element, [
    {
      columns: [columns[0], columns[1], columns[2]],
      series: [
        ["SOC", "%", 0, "soc"],
        [word("current"), "A", 1, "amps"],
      ],
    },
    {
      columns: [columns[0], columns[3], columns[4]],
      series: [
        [word("voltage"), "V", 1, "volts"],
        [word("temperature"), "°C", 0, "degrees"],
      ],
    },
  ]);
}

/** Draws charts with an axis at each side; kept ones get new data only. */
export async function chart(element, charts) {
  const Plot = await uplot();
  const width = Math.max(240, element.clientWidth),
    key = `${languageNow()} ${width} ${charts.length} ${colour("ink")}`;
  const kept = drawn.get(element);
  if (kept?.key === key && kept.plots[0].root.isConnected) {
    kept.plots.forEach((plot, at) => plot.setData(charts[at].columns));
    return;
  }
  kept?.plots.forEach((plot) => plot.destroy());
  element.replaceChildren();
  drawn.set(element, { key, plots: charts.map((one) => new Plot(options(one, width), one.columns, element)) });
}

function options({ series, dates = false }, width) {
  const stroke = colour("ink"),
    grid = { stroke: colour("line"), width: 1 },
    font = "12px system-ui, sans-serif";
  const times = { stroke, grid, font, ticks: grid, values: (_, splits) => timesOf(splits, dates) };
  const sides = series.map(([, unit, digits, name], at) => ({
    scale: name,
    side: at ? 1 : 3,
    stroke: colour(name),
    grid: at ? { show: false } : grid,
    ticks: grid,
    font,
    size: 58,
    ...(digits ? {} : { incrs: WHOLE }),
    values: (_, splits) => splits.map((one) => figure(one, digits, unit)),
  }));
  const lines = series.map(([label, unit, digits, name], at) => ({
    label,
    scale: name,
    stroke: colour(name),
    width: 2,
    dash: at ? [6, 3] : undefined,
    spanGaps: dates,
    points: { show: dates },
    value: (_, value) => figure(value, digits + 1, unit),
  }));
  const range = (_, low, high) =>
    low === null ? [0, 1] : [low - Math.max(0.5, (high - low) * 0.1), high + Math.max(0.5, (high - low) * 0.1)];
  return {
    width,
    height: 200,
    cursor: { drag: { x: true, y: false } },
    legend: { live: true },
    scales: Object.fromEntries([
      ["x", {}],
      ...series.map(([, , , name]) => [name, name === "soc" ? { range: [0, 100] } : { range }]),
    ]),
    axes: [times, ...sides],
    series: [{ label: word("time"), value: (_, at) => (at === null ? "–" : moment(at)) }, ...lines],
  };
}

/** As fine as the distance of the ticks. */
function timesOf(splits, dates) {
  const seconds = splits.length > 1 && splits[1] - splits[0] < 60;
  return splits.map((one) => (dates ? day(one) : moment(one, { seconds }).split(" ").at(-1)));
}

const day = (unixS) =>
  new Intl.DateTimeFormat(languageNow(), { month: "numeric", day: "numeric" }).format(unixS * 1000);
