// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// The survey: what the mission does, and what an operator may ask for.

import { command, connect, connected, emergency, listen, lost, nowS, sections, takeControls, valuesAt } from "./link.js";
import { draft, draw, fade, fit, load, mark, onPlace, showLayer, shownLayer, showRobot, zoom } from "./map.js";
import { addCorner, drawingBar, dwellWords, know, renderPlan, showChoices, startPlan } from "./plan.js";
import { renderResults, reportSince, showRuns, startResults } from "./results.js";
import { $, button, duration, element, fill, metres, setText, slide } from "./widgets.js";

const OLD_S = 10, GONE_S = 30, SNAP_M = 12, RETRY_MS = 1000, LOOK_MS = 5000;
const SETTINGS = [
  ["hours", "Time of the mission from its start [h]", { type: "number", step: "0.1", min: "0.1" }],
  ["dwell", "How long to count at a stop"], ["strategy", "How stops are chosen"], ["target", "Which map is to be good"],
];
const DWELLS = ["optimal", "fmi:30", "fmi:60", "fmi:120", "fmi:300", "ami:5%", "ami:3%", "ami:2%"];
const TARGETS = [["vwc", "soil moisture"], ["rate", "neutron rate"]];
const TABS = [["plan", "Plan"], ["survey", "Survey"], ["results", "Results"]];
let tab = "survey", robot = "", place = null, picking = false, stopping = null, noticeTimer = 0, wasStale = "", wasPressed = false, report = {}, lookedMs = 0;

const mission = () => sections[`mission/${robot}`];
const mayAsk = () => sections.viewer?.may_steer ?? false;  // has the controls, or may have them
const taken = () => mayAsk() && Boolean(sections.viewer.holder) && !sections.viewer.holds;
const maySteer = () => connected() && mayAsk() && !taken();
const heardAgo = () => nowS() - (sections.heard?.[`mission/${robot}`] ?? -Infinity);
const holder = () => (sections.viewer.holder === "console" ? "Another device" : sections.viewer.holder);
const ended = () => mission()?.phase === "finished";
const anyEmergency = () => (sections.robots ?? []).some((one) => sections[`mission/${one}`]?.emergency);

// Why the state that is shown may be old; empty if it is not.
function stale() {
  if (ended() || !mission()) return "";
  if (lost()) return "No connection";
  return heardAgo() > OLD_S && !sections.watch_only ? `Not heard for ${duration(Math.floor(heardAgo()))}` : "";
}

// Commands -----------------------------------------------------------------------------------------------------------

function notice(text, bad = false, ms = bad ? 15000 : 6000, ...more) {
  const node = $("notice");
  node.replaceChildren(text, ...more);
  node.dataset.kind = bad ? "bad" : "";
  node.hidden = false;
  clearTimeout(noticeTimer);
  noticeTimer = setTimeout(() => { node.hidden = true; }, ms);
}

async function ask(verb, details = {}, to = robot) {
  const reply = await command(to, verb, details);
  notice(reply.accepted ? reply.message : `Not done: ${reply.message}`, !reply.accepted);
  return reply.accepted;
}

// Asks until every planner has acknowledged the stop; until then the page says so loudly.
async function stop() {
  if (stopping) return;
  stopping = { tries: 0, text: "" };
  while (stopping) {
    stopping.tries += 1;
    render();
    const reply = await emergency("stop");
    if (reply.acknowledged) { stopping = null; break; }
    const missing = (reply.missing ?? []).map((name) => name.replace("_", " ")).join(", ");
    stopping.text = reply.error ?? `no answer from ${missing}`;
    render();
    await new Promise((resolve) => { setTimeout(resolve, RETRY_MS); });
  }
  render();
}

async function takeOver() {
  notice(await takeControls() ? "You have the controls." : "The console did not answer.");
}

async function release() {
  stopping = null;
  const reply = await emergency("release");
  if (!reply.acknowledged) notice(`STOP is still pressed: ${reply.error ?? "another button is pressed, or the planner does not answer"}`, true);
}

// A place of the map ----------------------------------------------------------------------------------------------------

async function choose([x, y]) {
  const near = (sections.nodes ?? []).map(([name, nx, ny]) => [Math.hypot(nx - x, ny - y), name, nx, ny]).sort((a, b) => a[0] - b[0])[0];
  place = { x, y, node: near && near[0] <= SNAP_M ? near : null, values: undefined };
  mark([x, y]);
  render();
  const mine = place;
  mine.values = await valuesAt(x, y);
  if (place === mine) render();
  $("place").scrollIntoView({ block: "nearest" });
}

function leave() { place = null; mark(null); render(); }

function octagon(radius) {
  return [...Array(8).keys()].map((n) => [place.x + radius * Math.cos((n + 0.5) * Math.PI / 4), place.y + radius * Math.sin((n + 0.5) * Math.PI / 4)]);
}

const percent = (share) => (100 * share).toFixed(1);

function changeText(values) {
  const key = ["change_vwc", "change_rate"].find((one) => values[one] !== undefined);
  if (!key) return "";
  const [say, unit] = key === "change_vwc" ? [percent, "% by volume"] : [(rate) => rate.toFixed(2), "counts/s"];
  const sure = values.significant === 0 ? "may be chance" : "significant";
  return `change ${values[key] < 0 ? "" : "+"}${say(values[key])} ± ${say(values[`${key}_sd`])} ${unit}, ${sure}`;
}

function placeText(values) {
  if (values === undefined) return ["…", ""];
  if (values === null) return ["The console did not answer", ""];
  const change = changeText(values);
  if (values.vwc !== undefined) {
    const range = values.vwc_p05 !== undefined ? `90 % between ${percent(values.vwc_p05)} and ${percent(values.vwc_p95)}` : "";
    return [`${percent(values.vwc)} ± ${percent(values.vwc_sd)} % by volume`, [range, `rate ${values.rate.toFixed(2)} ± ${values.rate_sd.toFixed(2)} counts/s`, change].filter(Boolean).join("; ")];
  }
  if (values.rate !== undefined) return [`${values.rate.toFixed(2)} ± ${values.rate_sd.toFixed(2)} counts/s`, change];
  return ["No value here yet", ""];
}

// Corners of an area without stops; as long as it is on the page, it can be lifted.
async function ruleOut(polygon) {
  const to = robot;
  if (!(await ask("rule_out", { polygon }, to))) return false;
  notice("No stop is chosen in this area any more.", false, 20000, button("Undo", () => ask("lift", { polygon }, to)));
  return true;
}

function insideOf(corners, x, y) {
  return corners.reduce((inside, [ax, ay], index) => {
    const [bx, by] = corners.at(index - 1);
    return (ay > y) !== (by > y) && x < (bx - ax) * (y - ay) / (by - ay) + ax ? !inside : inside;
  }, false);
}

// Why no stop can be at a place, empty if one can.
function barred(x, y) {
  const field = sections.field;
  if (!insideOf(field.boundary, x, y)) return "outside the field";
  if (field.no_go.some((one) => insideOf(one, x, y))) return "in a no-go area";
  return "";
}

function notMeasuring() {
  const now = mission();
  if (!now?.running) return "no mission is under way";
  if (now.phase === "returning") return "the robot drives home";
  return (sections[`ruled_out/${robot}`] ?? []).some((one) => insideOf(one, place.x, place.y)) ? "in an area without stops" : "";
}

function renderPlace() {
  $("place").hidden = !place;
  document.body.classList.toggle("placing", Boolean(place));
  if (!place) return;
  const [value, more] = placeText(place.values);
  setText("place-value", value);
  const where = `${place.x.toFixed(1)} m east, ${place.y.toFixed(1)} m north`;
  setText("place-more", [more, where].filter(Boolean).join(" · "));
  const bar = barred(place.x, place.y), why = bar || notMeasuring();
  fill("place-actions", [place.x, place.y, maySteer(), bar, why], () => {
    if (!maySteer()) return [];
    const target = place.node ? place.node.slice(2) : [place.x, place.y];
    const name = place.node ? `Slide: measure at ${place.node[1]}` : "Slide: measure here", here = [place.x, place.y];
    const dwell = element("input", { type: "number", min: 1, id: "place-dwell", placeholder: "as the mission decides" });
    const size = element("select", { id: "place-size" }, ...[5, 10, 20, 40].map((m) => element("option", { value: m }, `${m} m around`)));
    size.addEventListener("change", () => mark([place.x, place.y], octagon(Number(size.value))));
    return [
      element("label", { for: "place-dwell" }, "Time at the stop [s]"), dwell,
      slide(name, async () => { if (await ask("measure", { place: target, dwell: dwell.value })) leave(); }, "", why),
      element("label", { for: "place-size" }, "No stops in an area"), size,
      slide("Slide: rule this area out", async () => { if (await ruleOut(octagon(Number(size.value)))) leave(); }, "", bar),
      button("Make this place home", async () => { if (await ask("change", { place: here })) leave(); }, "", bar),
    ];
  });
}

// Mission ------------------------------------------------------------------------------------------------------------------

function kindOf(now) {
  if (!now) return "unknown";
  if (now.emergency || now.needs_operator) return "danger";
  return now.paused ? "paused" : now.phase === "counting" ? "counting" : now.moving ? "moving" : "idle";
}

function renderState() {
  const now = mission(), old = stale();
  document.body.classList.toggle("stale", Boolean(old));
  $("state").dataset.kind = old ? "unknown" : kindOf(now);
  setText("headline", now ? `${old && `${old}. Last known: `}${now.headline}` : "Waiting for the planner");
  let reason = now?.reason ?? "It has not been heard yet.";
  if (now?.emergency) reason += now.stop_requests ? `. The robot is not known to stand (asked ${now.stop_requests} times)` : ". The robot stands";
  setText("reason", reason);
  const counting = now?.phase === "counting" || (now?.counts ?? 0) > 0 && now?.paused;
  $("counting").hidden = !counting;
  if (counting) {
    setText("counts", String(now.counts));
    setText("error", now.error_percent === null ? "–" : `± ${now.error_percent.toFixed(1)} %`);
    setText("dwell", now.planned_dwell_s ? `${now.dwell_s} of ${now.planned_dwell_s} s` : `${now.dwell_s} s`);
    $("progress").value = now.planned_dwell_s ? Math.min(1, now.dwell_s / now.planned_dwell_s) : 0;
    spark(sections[`count/${robot}`] ?? []);
  }
  const shown = now && [now.running, now.paused, now.phase === "returning", now.emergency, sections.viewer, robot, heardAgo() > GONE_S, lost(), reasons(now), ended(), report];
  if (ended()) lookForReport(sections[`ended/${robot}`]);
  fill("actions", shown, () => actions(now));
}

// Why the robot cannot be started, sent home, or skip a stop.
function reasons(now) {
  return {
    start: now.ready === false ? now.reason : "", home: now.settings?.home === "" ? "there is no home, set it below" : "",
    skip: now.stop ? "" : "no stop is chosen yet",
  };
}

async function lookForReport(at) {
  if (!at || report.at === at || performance.now() < lookedMs + LOOK_MS || lost()) return;
  lookedMs = performance.now();
  const found = await reportSince(at);
  if (found) { report = { at, name: found[0], href: found[1] }; render(); }
}

// What is left to do after a mission.
function afterwards() {
  if (!ended()) return [];
  if (!report.at || report.at !== sections[`ended/${robot}`]) return [button("No report yet: go to the results", () => showTab("results"))];
  return [element("a", { class: "button", href: report.href, target: "_blank", rel: "noopener" }, `Open the report (${report.name})`)];
}

const actions = (now) => [...afterwards(), ...commands(now)];

function commands(now) {
  if (!now || sections.watch_only) return [];
  if (lost()) return [element("p", {}, "No connection: nothing can be asked for. STOP is tried until it is acknowledged.")];
  const why = reasons(now);
  if (!mayAsk()) return [element("p", {}, "Read-only: open the address with the token that the console prints.")];
  if (taken()) return [element("p", {}, `${holder()} has the controls.`)];
  if (heardAgo() > GONE_S) return [element("p", {}, "The planner is not heard any more: it has ended, or the link to it is lost.")];
  if (now.emergency) return [slide("Slide to release STOP", release, "danger")];
  const end = slide("Slide to end the mission", () => ask("abort"), "danger");
  if (!now.running) return [slide("Slide to start", () => ask("start"), "", why.start)];
  const home = slide("Slide to drive home and end", () => ask("return_home"), "", why.home);
  if (now.paused) return [slide("Slide to resume", () => ask("resume")), home, end];
  if (now.phase === "returning") return [button("Pause", () => ask("pause"), "primary"), end];
  return [
    element("div", { class: "buttons" }, button("Pause", () => ask("pause"), "primary"), button("Skip this stop", () => ask("skip"), "", why.skip)),
    home, end,
  ];
}

function spark(counts) {
  const points = counts.filter(([, n]) => n > 0).map(([s, n]) => [s, 100 / Math.sqrt(n)]);
  const line = $("spark").firstElementChild;
  if (points.length < 2) { line.setAttribute("points", ""); return; }
  const lastS = points.at(-1)[0] || 1, top = Math.min(points[0][1], 60);
  line.setAttribute("points", points.map(([s, e]) => `${(300 * s / lastS).toFixed(1)},${(42 - 40 * Math.min(e, top) / top).toFixed(1)}`).join(" "));
}

function renderMission() {
  const now = mission();
  setText("used", duration(now?.used_s)); setText("left", duration(now?.left_s));
  setText("stops", String(now?.stops ?? "–")); setText("distance", metres(now?.distance_m));
  for (const id of ["forecast", "plan-forecast"]) setText(id, now?.forecast ? `Forecast of the map: ${now.forecast}` : "No forecast yet.");
  setText("ends", now?.running && now.left_s ? `Ends in ${duration(now.left_s)} of mission time at the latest, way home included.` : "");
  setText("last-command", now?.last_command ? `Last command: ${now.last_command}` : "");
  renderHome(now);
  if (now?.settings?.dwell) renderChoices(now.settings);
  const ruled = sections[`ruled_out/${robot}`] ?? [];
  $("ruled-part").hidden = !ruled.length;
  fill("ruled", [ruled, maySteer()], () => ruled.map((polygon, index) => {
    const wide = Math.round(Math.max(...polygon.map(([x]) => x)) - Math.min(...polygon.map(([x]) => x)));
    return element("li", {}, element("label", {}, `${index + 1}: ${wide} m across`), button("Show", () => mark(null, polygon)), button("Lift", () => ask("lift", { polygon }), "", maySteer() ? "" : "look on only"));
  }));
  const queue = now?.queue ?? [];
  $("queue-part").hidden = !queue.length;
  fill("queue", [queue, maySteer()], () => queue.map((name, index) => {
    const order = (change) => { const next = [...queue]; change(next); ask("order", { stops: next }); };
    const swap = (one, other) => order((next) => { [next[one], next[other]] = [next[other], next[one]]; });
    const up = button("↑", () => swap(index, index - 1)), down = button("↓", () => swap(index, index + 1));
    const remove = button("✕", () => order((next) => next.splice(index, 1)));
    up.disabled = !maySteer() || index === 0; down.disabled = !maySteer() || index === queue.length - 1; remove.disabled = !maySteer();
    [[up, "earlier"], [down, "later"], [remove, "remove"]].forEach(([node, text]) => node.setAttribute("aria-label", `${name}: ${text}`));
    return element("li", {}, name, up, down, remove);
  }));
  $("change").hidden = !maySteer();
}

function renderHome(now) {
  const name = now?.settings?.home, begun = sections[`start/${robot}`];
  $("home-part").hidden = name === undefined;
  setText("home", name ? `The robot drives to ${name} at the end.` : "There is no home: the robot stays where the mission ends.");
  fill("home-actions", [begun, maySteer(), now?.running], () => (!maySteer() ? [] : [
    button(now?.running ? "Home is where it started" : "Home is where it stands", () => ask("change", { place: begun }), "", begun ? "" : "not seen by this page"),
    button("Tap home on the map", () => { picking = true; render(); }),
  ]));
}

// What may be chosen instead of the present settings, in words.
function renderChoices(now) {
  const strategies = (sections.choices?.strategies ?? []).map(([key, text]) => [key, text]);
  const words = (list, key) => list.find(([one]) => one === key)?.[1] ?? key;
  for (const [name, list] of [["dwell", DWELLS.map((key) => [key, dwellWords(key)])], ["strategy", strategies], ["target", TARGETS]]) {
    const present = name === "dwell" ? dwellWords(now[name]) : words(list, now[name]);
    fill(`set-${name}`, [present, list], () => [["", `as it is: ${present}`], ...list].map(([key, text]) => element("option", { value: key }, text)));
  }
}

function settingsForm() {
  const inputs = SETTINGS.map(([name, text, attributes]) => [name, text, element(attributes ? "input" : "select", { id: `set-${name}`, ...attributes })]);
  $("settings").append(...inputs.flatMap(([, text, input]) => [element("label", { for: input.id }, text), input]), element("button", { type: "submit", class: "primary" }, "Change"));
  $("settings").addEventListener("submit", async (event) => {
    event.preventDefault();
    const given = inputs.filter(([, , input]) => input.value.trim()).map(([name, , input]) => [name, input.type === "number" ? Number(input.value) : input.value.trim()]);
    if (await ask("change", Object.fromEntries(given))) event.target.reset();
  });
}

// Health, map, frame ---------------------------------------------------------------------------------------------------------

function renderAges() {
  const heard = sections.heard ?? {}, several = (sections.robots ?? []).length > 1;
  const rows = (sections.robots ?? []).flatMap((one) => {
    const name = several ? one.replace("_", " ") : "robot";
    return [[`${name} last heard`, heard[`mission/${one}`]], [several ? `${name}: position` : "position", heard[`fix/${one}`]]];
  });
  rows.push(["map", heard.map, true]);
  const list = rows.map(([text, at, slow]) => {
    const age = at === undefined ? null : Math.max(0, nowS() - at);
    const old = !ended() && (age === null || (!slow && age > OLD_S));
    return [text, age === null ? "never" : `${duration(Math.floor(age))} ago`, old];
  });
  fill("ages", list, () => list.map(([text, age, old]) => element("li", { "data-kind": old ? "old" : "" }, element("span", {}, text), element("b", {}, age))));
  const node = $("link"), first = heard[`mission/${robot}`], age = first === undefined ? null : Math.max(0, Math.floor(nowS() - first));
  const gone = lost(), over = ended();
  node.dataset.kind = over || !(gone || age === null || (age > OLD_S && !sections.watch_only)) ? "" : "lost";
  node.textContent = over && (gone || sections.watch_only) ? "finished" : gone ? "connection lost" : age === null ? "robot not heard yet" : age <= 2 ? "live" : `robot last heard ${duration(age)} ago`;
  const alarm = $("alarm");
  const text = stopping?.text
    ? `STOP WAS NOT ACKNOWLEDGED (${stopping.text}). Use the button on the robot. Trying again, ${stopping.tries} so far.`
    : !sections.field ? "" : !gone ? unheard() : sections.watch_only ? "The simulation has ended." : over ? "The connection has ended, after the mission."
    : "Connection to the console lost. The robot goes on by itself; STOP may not reach it.";
  if (alarm.textContent !== text) alarm.textContent = text;
  alarm.hidden = !text;
  alarm.classList.toggle("loud", Boolean(stopping?.text));
  alarm.classList.toggle("calm", !stopping && (over || Boolean(sections.watch_only)));
  const stop = $("stop");
  stop.dataset.kind = stopping ? "asking" : anyEmergency() ? "pressed" : "";
  const word = stopping ? "STOPPING…" : anyEmergency() ? "STOP is pressed" : "STOP";
  if (stop.textContent !== word) stop.textContent = word;
}

const unheard = () => (mission()?.running && heardAgo() > GONE_S ? `The robot has not been heard for ${duration(Math.floor(heardAgo()))}. It goes on by itself; STOP may not reach it.` : "");

function renderHealth() {
  const parts = sections.health ?? [], well = parts.filter((part) => !part.level);
  const row = (part) => element("li", { "data-level": part.level }, element("b", {}, `${part.name.replace(/^\//, "")}: `), part.message);
  fill("health", parts.filter((part) => part.level), () => parts.filter((part) => part.level).map(row));
  $("well-part").hidden = !well.length;
  setText("well-about", stale() || lost() ? `Not known now; ${well.length} parts worked when last heard` : `${well.length === parts.length ? "All well: " : ""}${well.length} of ${parts.length} parts work`);
  fill("well", well, () => well.map(row));
}

const figure = (value, one) => value === null ? "–" : value.toFixed(one.unit.startsWith("%") ? 1 : 2).replace("-", "−");

function renderMap() {
  const about = sections.map;
  const layers = about?.layers ?? [];
  load();
  fill("layers", [layers.map((one) => one.key), shownLayer()], () => layers.map((one) => {
    const node = button({ vwc: "Moisture", vwc_sd: "± Moisture", rate: "Rate", rate_sd: "± Rate", change_vwc: "Change", change_rate: "Change" }[one.key] ?? one.title, () => { showLayer(one.key); render(); });
    node.setAttribute("aria-pressed", String(one.key === shownLayer()));
    return node;
  }));
  const one = layers.find((each) => each.key === shownLayer());
  $("fade-part").hidden = !sections.background?.version;
  $("photo-error").hidden = !sections.background?.error;
  setText("photo-error", sections.background?.error ? `No photo: ${sections.background.error}` : "");
  $("legend").hidden = !one && Boolean(sections.field) === false;
  fill("legend", one ?? "none", () => {
    if (!one) return [element("span", {}, "No map yet: it begins with the first samples")];
    const bar = element("canvas", { width: 190, height: 1 }), pen = bar.getContext("2d"), shade = pen.createLinearGradient(0, 0, 190, 0);
    one.colours.forEach((colour, index) => shade.addColorStop(index / (one.colours.length - 1), colour));
    pen.fillStyle = shade; pen.fillRect(0, 0, 190, 1);
    return [element("div", {}, `${one.title} [${one.unit}]`), bar, element("div", { class: "row" }, element("span", {}, figure(one.limits[0], one)), element("span", {}, `mean ${figure(one.mean, one)}`), element("span", {}, figure(one.limits[1], one))), ...(one.note ? [element("div", {}, one.note)] : [])];
  });
  draw();
}

// What is tapped on the map at present, with its buttons on it.
function renderMapbar() {
  const drawing = tab === "plan" && draft.drawing, on = picking || Boolean(drawing);
  document.body.classList.toggle("onmap", on);
  $("mapbar").hidden = !on;
  if (!on) return;
  const [text, ...buttons] = picking ? ["Tap where home is.", button("Cancel", () => { picking = false; render(); })] : drawingBar();
  setText("mapbar-text", text);
  fill("mapbar-buttons", [picking, text], () => buttons);
}

async function onMap(at) {
  if (picking) { picking = false; render(); await ask("change", { place: at }); }
  else if (tab === "plan") addCorner(at);
  else await choose(at);
}

// Who steers, on each tab.
function renderSteer() {
  $("steer").hidden = !taken();
  fill("steer", [sections.viewer, taken()], () => (!taken() ? [] : [
    element("p", {}, `${holder()} has the controls. STOP works for everybody.`), slide("Slide to take over the controls", takeOver)]));
  if (wasPressed && !anyEmergency() && !lost()) notice("STOP is released. Nothing moves before somebody resumes.", false, 20000);
  wasPressed = lost() ? wasPressed : anyEmergency();
}

function renderFrame() {
  const robots = sections.robots ?? [];
  if (!robots.includes(robot) && robots.length) robot = robots[0];
  showRobot(robot);
  setText("field", sections.field?.name ?? "Survey");
  $("dose").hidden = !sections.dose || tab !== "survey";
  setText("dose", sections.dose ?? "");
  const only = sections.watch_only ?? "";
  for (const id of ["stop", "health-part", "who-part"]) $(id).hidden = Boolean(only);
  $("watch-only").hidden = !only;
  setText("watch-only-text", only);
  $("robots").hidden = robots.length < 2;
  fill("robots", [robots, robot], () => robots.map((one) => {
    const node = button(one.replace("_", " "), () => { robot = one; render(); });
    node.setAttribute("aria-pressed", String(one === robot));
    return node;
  }));
}

function showTab(name) {
  tab = TABS.some(([one]) => one === name) ? name : "survey";
  picking = false;
  document.querySelector("main").dataset.tab = tab;
  $("plan").hidden = tab !== "plan"; $("results").hidden = tab !== "results"; $("panel").hidden = tab !== "survey";
  draft.shown = tab === "plan";
  if (location.hash !== `#${tab}`) history.replaceState(null, "", `#${tab}`);
  if (tab === "results") showRuns();
  if (tab === "plan") showChoices();
  render();
}

function renderTabs() {
  const tabs = TABS.filter(([name]) => !sections.watch_only || name !== "plan");
  fill("tabs", [tab, tabs.length], () => tabs.map(([name, text]) => {
    const node = button(text, () => showTab(name));
    node.setAttribute("aria-pressed", String(name === tab));
    return node;
  }));
}

let guide = null;  // its part of the page comes with a person's survey only
function renderGuide() {
  if (!guide && !mission()?.guided) return;
  guide ??= import("./guide.js");
  guide.then((part) => part.renderGuide({ ask, maySteer, mayAsk, takeOver, mission, robot: () => robot }));
}

function render() { renderGuide(); renderTabs(); renderFrame(); renderSteer(); if (tab === "plan") renderPlan(); if (tab === "results") renderResults(); renderState(); renderMission(); renderHealth(); renderAges(); renderMap(); renderMapbar(); renderPlace(); }

$("stop").addEventListener("click", stop);
$("place-close").addEventListener("click", leave);
$("zoom-in").addEventListener("click", () => zoom(1.4));
$("zoom-out").addEventListener("click", () => zoom(1 / 1.4));
$("zoom-fit").addEventListener("click", fit);
$("fade").value = localStorage.getItem("fade") ?? 70;
$("fade").addEventListener("input", () => fade(Number($("fade").value)));
$("who").value = localStorage.getItem("who") || "";
$("who").addEventListener("change", () => localStorage.setItem("who", $("who").value));
settingsForm();
onPlace(onMap);
startPlan({ ask, ruleOut, open: (name) => { showTab(name); scrollTo(0, 0); }, notice, maySteer, mission, render, robot: () => robot });
startResults({ notice, maySteer, know: (names) => { know(names); showTab("plan"); scrollTo(0, 0); $("known").open = true; $("known").scrollIntoView(); } });
addEventListener("hashchange", () => showTab(location.hash.slice(1)));
showTab(location.hash.slice(1));
listen(render);
setInterval(() => { const now = stale() || String(lost()); if (now === wasStale) renderAges(); else { wasStale = now; render(); } }, 1000);
connect();
