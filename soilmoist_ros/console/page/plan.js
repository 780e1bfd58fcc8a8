// Plan: is everything ready, where is the field, and what will a mission of some hours bring?

import { clockOffS, nowS, request, sections } from "./link.js";
import { draft, draw } from "./map.js";
import { $, button, duration, element, fill, setText, slide } from "./widgets.js";

const SILENT_S = 10, CLOCK_S = 5, FAR_M = 500, MAX_FILE = 2_000_000;
// What a mission needs: the parts of health that say so, and what to do if none is heard.
const CHECKS = [
  ["Sensor", /sensor_driver: (logger link|records)$/, "start the sensor driver, and check logger_uri"],
  ["GNSS", /sensor_driver: GNSS/, "start the sensor driver, and check gnss_uri"],
  ["Planner", /planner: (guard|frames|position)$/, "start the planner"],
  ["Navigation", /planner: navigation$/, "start the navigation of the robot"],
  ["Map", /mapper: /, "start the mapper"],
  ["Disk and recording", /recorder: /, "start the recorder, or do without a recording"],
];
const FIELDS = [
  ["hours", "Time [h]", { type: "number", step: "0.1", min: "0.1", max: "12", value: "2", required: true }],
  ["strategy", "Strategy", { type: "text", value: "gcb" }],
  ["dwell", "Dwell: fmi:SECONDS, ami:THRESHOLD or optimal", { type: "text", value: "optimal" }],
  ["variation", "How much the field varies [% of the rate]", { type: "number", step: "1", min: "1", max: "100", value: "12" }],
  ["wanted", "Wanted error of the map [% of the rate]", { type: "number", step: "0.1", min: "0.1", value: "5" }],
];
let page = null, busy = false, found = null, area = null;

const value = (name) => $(`plan-${name}`).value.trim();
const drawn = () => draft.boundary.length > 2 && draft.drawing !== draft.boundary;

// The field that is planned for: what is drawn, else that of the nodes.
function field() {
  const own = sections.field;
  const areas = draft.areas.filter((one) => one.length > 2);
  return {
    name: drawn() ? "drawn field" : own.name, datum: draft.datum ?? own.datum,
    boundary: drawn() ? draft.boundary : own.boundary, no_go: [...(drawn() ? [] : own.no_go), ...areas],
  };
}

export function addCorner([x, y]) {
  if (!draft.drawing) { page.notice("Choose what to draw first: boundary or no-go area."); return; }
  draft.drawing.push([Math.round(x * 100) / 100, Math.round(y * 100) / 100]);
  changed();
}

function changed() { found = null; area = null; draw(); page.render(); }

async function done() {
  draft.drawing = null;
  draft.areas = draft.areas.filter((one) => one.length > 2);
  if (draft.boundary.length < 3) draft.boundary = [];
  changed();
  if (!drawn() && !draft.areas.length) return;
  const answer = await request("plan", { task: "field", ...field() });
  if (answer.error) page.notice(answer.error, true);
  else { area = answer.area_m2; page.render(); }
}

async function download() {
  const answer = await request("plan", { task: "field", ...field() });
  if (answer.error) { page.notice(answer.error, true); return; }
  const link = element("a", { href: URL.createObjectURL(new Blob([answer.file], { type: "text/yaml" })), download: "field.yaml" });
  link.click();
  URL.revokeObjectURL(link.href);
}

async function read(file) {
  if (file.size > MAX_FILE) { page.notice(`The file has ${file.size} bytes; ${MAX_FILE} are read at most.`, true); return; }
  const content = await new Promise((resolve) => { const reader = new FileReader(); reader.onload = () => resolve(reader.result.split(",")[1] ?? ""); reader.readAsDataURL(file); });
  const answer = await request("plan", { task: "outline", name: file.name, content, datum: sections.field?.datum });
  if (answer.error) { page.notice(answer.error, true); return; }
  Object.assign(draft, { boundary: answer.boundary, areas: answer.no_go, drawing: null });
  await done();
}

async function ruleOut() {
  for (const polygon of draft.areas.filter((one) => one.length > 2)) if (!(await page.ask("rule_out", { polygon }))) return;
  draft.areas = [];
  changed();
}

async function forecast(event) {
  event.preventDefault();
  if (busy || !sections.field) return;
  busy = true;
  page.render();
  found = await request("plan", {
    task: "forecast", ...field(), hours: Number(value("hours")), strategy: value("strategy"), dwell: value("dwell"),
    variation: Number(value("variation")) / 100, rate_cps: sections.map?.layers?.find((one) => one.key === "rate")?.mean,
  });
  busy = false;
  if (found.error) { page.notice(found.error, true); found = null; }
  page.render();
}

async function use() {
  await page.ask("change", { hours: Number(value("hours")), strategy: value("strategy"), dwell: value("dwell") });
}

function checks() {
  const parts = sections.health ?? [];
  const rows = CHECKS.map(([name, pattern, remedy]) => {
    const mine = parts.filter((part) => pattern.test(part.name));
    if (!mine.length) return [name, 2, `not heard: ${remedy}`];
    const worst = mine.reduce((one, other) => (other.level > one.level ? other : one));
    return [name, worst.level, worst.message];
  });
  const heard = sections.heard?.[`mission/${page.robot()}`];
  if (heard === undefined || nowS() - heard > SILENT_S) rows.unshift(["Link to the robot", 2, "the planner is not heard: start it, or check the network"]);
  const off = clockOffS;
  if (off !== null) rows.push(["Clock", Math.abs(off) > CLOCK_S ? 1 : 0, Math.abs(off) > CLOCK_S ? `the robot's computer is ${Math.abs(Math.round(off))} s ${off > 0 ? "ahead of" : "behind"} this one: set the wrong one` : "agrees with this computer"]);
  const place = sections[`place/${page.robot()}`], border = sections.field?.boundary ?? [];
  if (place && border.length) {
    const near = Math.min(...border.map(([x, y]) => Math.hypot(x - place[0], y - place[1])));
    const size = Math.max(...border.map(([x, y]) => Math.hypot(x - border[0][0], y - border[0][1])));
    const far = near > size + FAR_M;
    rows.push(["Datum", far ? 2 : 0, far ? `the robot is ${Math.round(near)} m from the field: is this its field file?` : "the robot is at the field"]);
  }
  return rows;
}

export function renderPlan() {
  const rows = checks();
  fill("checks", rows, () => rows.map(([name, level, text]) => element("li", { "data-level": level }, element("b", {}, `${name}: `), text)));
  const may = page.mayAsk(), kind = draft.drawing === null ? "" : draft.drawing === draft.boundary ? "boundary" : "area";
  setText("draft-about", kind ? `Tap the corners on the map, in order. ${draft.drawing.length} so far.` : drawn() || draft.areas.length ? `Drawn: ${drawn() ? "boundary" : "the boundary of the nodes"} with ${field().no_go.length} no-go areas${area ? `, ${(area / 10000).toFixed(2)} ha` : ""}.` : "The field of the nodes. Draw another one, or further no-go areas.");
  fill("drawing", [kind, draft.drawing?.length ?? 0, drawn(), draft.areas.length, may], () => {
    if (!may) return [];
    if (kind) {
      const undo = button("Undo corner", () => { draft.drawing.pop(); changed(); });
      return [element("div", { class: "buttons" }, undo, button("Done", done, "primary"))];
    }
    const nodes = [element("div", { class: "buttons" },
      button("Draw boundary", () => { draft.boundary = []; draft.drawing = draft.boundary; changed(); }),
      button("Draw no-go area", () => { const one = []; draft.areas.push(one); draft.drawing = one; changed(); }))];
    if (drawn() || draft.areas.length) nodes.push(element("div", { class: "buttons" }, button("Download field file", download), button("Clear", () => { Object.assign(draft, { boundary: [], areas: [], drawing: null }); changed(); })));
    if (draft.areas.length) nodes.push(button("Rule these areas out now", ruleOut));
    return nodes;
  });
  $("plan-run").disabled = busy || !may;
  $("plan-run").textContent = busy ? "Simulating…" : "Forecast";
  $("forecast-part").hidden = !found;
  if (found) showForecast();
  const now = page.mission();
  fill("plan-start", [may, now?.running ?? null], () => (!may || !now ? [] : [
    button("Use time, strategy and dwell", use),
    ...(now.running ? [] : [slide("Slide to start", () => page.ask("start"))]),
  ]));
}

function showForecast() {
  const wanted = Number(value("wanted")), hours = Number(value("hours"));
  const reached = found.points.find(([, error]) => 100 * error <= wanted);
  const end = found.points.at(-1);
  if (!end) { setText("forecast-text", "The time is too short for a map."); return; }
  setText("forecast-text", `After ${duration(hours * 3600)}: ±${(100 * end[1]).toFixed(1)} %, ${found.stops} stops, ${found.distance_m} m. ` + (reached ? `For ±${wanted} % you need ${duration(reached[0])}.` : `±${wanted} % is not reached.`));
  setText("forecast-note", `From simulated missions on random fields of this outline, with ${found.rate_cps} counts/s that vary by ${Math.round(100 * found.variation)} %. Error: root mean square over the field.`);
  fill("forecast-chart", [found.points, wanted], () => chart(found.points.map(([s, e]) => [s / 3600, 100 * e]), wanted));
}

function chart(points, wanted) {
  const mark = (tag, attributes, text = "") => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, given] of Object.entries(attributes)) node.setAttribute(name, given);
    node.textContent = text;
    return node;
  };
  const right = points.at(-1)[0] || 1, top = Math.max(...points.map(([, e]) => e), wanted) * 1.1;
  const x = (h) => 40 + 310 * h / right, y = (e) => 150 - 140 * e / top;
  const nodes = [0, 0.25, 0.5, 0.75, 1].flatMap((share) => [
    mark("line", { x1: 40, x2: 350, y1: y(share * top), y2: y(share * top), stroke: "#aab3bd" }),
    mark("text", { x: 36, y: y(share * top) + 4, "text-anchor": "end" }, (share * top).toFixed(1)),
    mark("text", { x: x(share * right), y: 168, "text-anchor": share === 1 ? "end" : "middle" }, `${(share * right).toFixed(1)} h`),
  ]);
  return [...nodes,
    mark("line", { x1: 40, x2: 350, y1: y(wanted), y2: y(wanted), stroke: "#a80018", "stroke-width": 2, "stroke-dasharray": "6 4" }),
    mark("polyline", { points: points.map(([h, e]) => `${x(h)},${y(e)}`).join(" "), fill: "none", stroke: "#0b3d66", "stroke-width": 3 }),
    mark("text", { x: 350, y: 14, "text-anchor": "end" }, "error of the map [%]")];
}

export function startPlan(given) {
  page = given;
  $("plan-form").append(...FIELDS.flatMap(([name, text, attributes]) => [element("label", { for: `plan-${name}` }, text), element("input", { id: `plan-${name}`, ...attributes })]), element("button", { type: "submit", id: "plan-run", class: "primary" }, "Forecast"));
  $("plan-form").addEventListener("submit", forecast);
  $("plan-wanted").addEventListener("input", () => { if (found) showForecast(); });
  $("import").addEventListener("change", async (event) => { const [file] = event.target.files; event.target.value = ""; if (file) await read(file); });
}
