// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// The survey: what the mission does, and what an operator may ask for.

import { fixed, forPerson, language, languages, loadRare, said, t } from "./texts.js";
import { command, connect, connected, emergency, listen, lost, nowS, sections, silence, takeControls, valuesAt } from "./link.js";
import { draft, draw, fit, insideOf, load, mark, onPlace, showLayer, shownLayer, showRobot, zoom } from "./map.js";
import { addCorner, drawingBar, know, renderPlan, showChoices, startPlan } from "./plan.js";
import { renderResults, reportSince, showRuns, startResults } from "./results.js";
import { $, button, duration, element, fill, guard, metres, setText, slide } from "./widgets.js";

const OLD_S = 10, GONE_S = 30, SNAP_M = 12, RETRY_MS = 1000, LOOK_MS = 5000;
const TABS = ["plan", "survey", "results"];
let tab = "survey", robot = "", place = null, picking = false, stopping = null, noticeTimer = 0, wasStale = "", wasPressed = false, report = {}, lookedMs = 0;

const mission = () => sections[`mission/${robot}`];
const guided = () => Boolean(mission()?.guided || sections.border);  // by this page, which a person has drawn the border on before
const mayAsk = () => sections.viewer?.may_steer ?? false;  // has the controls, or may have them
const taken = () => mayAsk() && Boolean(sections.viewer.holder) && !sections.viewer.holds;
const maySteer = () => connected() && mayAsk() && !taken();
const heardAgo = () => nowS() - (sections.heard?.[`mission/${robot}`] ?? -Infinity);
const holder = () => (sections.viewer.holder === "console" ? t("another_device") : said(sections.viewer.holder));
const ended = () => mission()?.phase === "finished";
const anyEmergency = () => (sections.robots ?? []).some((one) => sections[`mission/${one}`]?.emergency);

// Why the state that is shown may be old; empty if it is not.
function stale() {
  if (ended() || !mission()) return "";
  if (lost()) return t("no_connection");
  return heardAgo() > OLD_S && !sections.watch_only ? t("not_heard_for", { duration: duration(Math.floor(heardAgo())) }) : "";
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
  notice(reply.accepted ? said(reply.message) : t("not_done", { why: said(reply.message) }), !reply.accepted);
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
    stopping.text = said(reply.error) || t("no_answer_from", { who: said(missing) });
    render();
    await new Promise((resolve) => { setTimeout(resolve, RETRY_MS); });
  }
  render();
}

async function takeOver() {
  notice(t(await takeControls() ? "you_have_controls" : "no_answer"));
}

async function release() {
  stopping = null;
  const reply = await emergency("release");
  if (!reply.acknowledged) notice(t("still_pressed", { why: said(reply.error) || t("other_button") }), true);
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

const percent = (share) => fixed(100 * share, 1);

function placeText(values) {
  if (values === undefined) return ["…", ""];
  if (values === null) return [t("no_answer"), ""];
  const rate = values.rate === undefined ? "" : `${fixed(values.rate, 2)} ± ${fixed(values.rate_sd, 2)} ${t("unit_rate")}`;
  if (values.vwc !== undefined) {
    const range = values.vwc_p05 !== undefined ? t("range_90", { low: percent(values.vwc_p05), high: percent(values.vwc_p95) }) : "";
    return [`${percent(values.vwc)} ± ${percent(values.vwc_sd)} ${t("unit_vwc")}`, [range, `${t("layer_rate")} ${rate}`].filter(Boolean).join("; ")];
  }
  return rate ? [rate, ""] : [t("no_value"), ""];
}

// Corners of an area without stops; as long as it is on the page, it can be lifted.
async function ruleOut(polygon) {
  const to = robot;
  if (!(await ask("rule_out", { polygon }, to))) return false;
  notice(t("area_ruled_out"), false, 20000, button(t("undo"), () => ask("lift", { polygon }, to)));
  return true;
}

// Why no stop can be at a place, empty if one can.
function barred(x, y) {
  const field = sections.field;
  if (!insideOf(field.boundary, x, y)) return t("outside_field");
  if (field.no_go.some((one) => insideOf(one, x, y))) return t("in_no_go");
  return "";
}

function notMeasuring() {
  const now = mission();
  if (!now?.running) return t("no_mission");
  if (now.phase === "returning") return t("drives_home");
  return (sections[`ruled_out/${robot}`] ?? []).some((one) => insideOf(one, place.x, place.y)) ? t("in_ruled_out") : "";
}

function renderPlace() {
  $("place").hidden = !place;
  document.body.classList.toggle("placing", Boolean(place));
  if (!place) return;
  const [value, more] = placeText(place.values);
  setText("place-value", value);
  const where = t("where", { east: fixed(place.x, 1), north: fixed(place.y, 1) });
  setText("place-more", [more, where].filter(Boolean).join(" · "));
  const bar = barred(place.x, place.y), why = bar || notMeasuring();
  fill("place-actions", [place.x, place.y, maySteer(), bar, why], () => {
    if (!maySteer()) return [];
    const target = place.node ? place.node.slice(2) : [place.x, place.y];
    const name = place.node ? t("measure_at", { stop: place.node[1] }) : t("measure_here"), here = [place.x, place.y];
    const dwell = element("input", { type: "number", min: 1, id: "place-dwell", placeholder: t("as_decided") });
    const size = element("select", { id: "place-size" }, ...[5, 10, 20, 40].map((m) => element("option", { value: m }, t("around", { m }))));
    size.addEventListener("change", () => mark([place.x, place.y], octagon(Number(size.value))));
    return [
      element("label", { for: "place-dwell" }, t("dwell_by_fmi")), dwell,
      slide(name, async () => { if (await ask("measure", { place: target, dwell: dwell.value })) leave(); }, "", why),
      element("label", { for: "place-size" }, t("no_stops_in")), size,
      slide(t("rule_out"), async () => { if (await ruleOut(octagon(Number(size.value)))) leave(); }, "", bar),
      button(t("home_here"), async () => { if (await ask("change", { place: here })) leave(); }, "", bar),
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
  setText("headline", now ? `${old && `${t("last_known", { why: old })} `}${headline(now)}` : t("waiting_for_planner"));
  let reason = now ? [now.ended && now.phase === "finished" ? t(`ended_${now.ended}`) : "", said(now.reason)].filter(Boolean).join(": ") : t("never_heard");
  if (now?.emergency) reason += `. ${now.stop_requests ? t("not_standing", { n: now.stop_requests }) : t("stands")}`;
  setText("reason", reason);
  const counting = now?.phase === "counting" || (now?.counts ?? 0) > 0 && now?.paused;
  $("counting").hidden = !counting;
  if (counting) {
    setText("counts", String(now.counts)); setText($("counts").nextElementSibling, t("counts", { n: now.counts }));
    setText("error", now.counts ? `± ${fixed(100 / Math.sqrt(now.counts), 1)} %` : "–");
    setText("dwell", now.planned_dwell_s ? t("s_of", { s: now.dwell_s, of: now.planned_dwell_s }) : `${now.dwell_s} s`);
    $("progress").value = now.planned_dwell_s ? Math.min(1, now.dwell_s / now.planned_dwell_s) : 0;
  }
  const shown = now && [now.running, now.paused, now.phase === "returning", now.emergency, sections.viewer, robot, heardAgo() > GONE_S, lost(), reasons(now), ended(), report];
  if (ended()) lookForReport(sections[`ended/${robot}`]);
  fill("actions", shown, () => actions(now));
}

// The state in a few words.
function headline(now) {
  if (now.emergency) return t(now.stop_requests ? "phase_emergency_asking" : "phase_emergency");
  if (now.phase === "idle" && now.ready === false) return t("phase_not_ready");
  const stop = now.stop?.[0] ?? t("a_stop"), text = t(`phase_${now.phase}`, { stop });
  if (ended()) return `${text}: ${[t("n_stops", { n: now.stops }), now.forecast && spread(now.forecast)].filter(Boolean).join(", ")}`;
  if (now.phase === "cancelling" && now.stop_requests > 1) return `${text}: ${t("asked", { n: now.stop_requests })}`;
  return now.paused && now.needs_operator ? `${text}: ${t("needs_you")}` : text;
}

const hundredths = (share) => fixed(100 * share, share < 0.0995 ? 1 : 0);
// Standard deviation of the map now.
const spread = (one) => `±${hundredths(one.sd)} ${t(one.moisture ? "unit_vwc" : "unit_of_rate")}`;

// When the map is as good as demanded, or how much is missing at the end.
function aimText(one) {
  const said = (value) => one.about === "zone" ? `${fixed(100 * value, 0)} %` : `±${hundredths(value)} ${t(one.moisture ? "unit_vwc" : "unit_of_rate")}`;
  const aim = t(`aim_${one.about}`, { value: said(one.value) });
  const [min, soonest, latest] = one.minutes;
  if (one.met) return t("aim_met", { aim });
  if (min === undefined) return t("aim_unknown", { aim });
  if (min === null) return t(soonest === null ? "aim_missed" : "aim_doubtful", { aim, end: said(one.end[0]), lack: said(Math.abs(one.end[0] - one.value)).replace("±", "") });
  return t("aim_in", { aim, min, soonest, latest: latest ?? t("too_late") });
}

function forecastText(one) {
  const end = one.end && t("forecast_at_end", { error: hundredths(one.end[1]), low: hundredths(one.end[2]), high: hundredths(one.end[3]), min: Math.round(one.end[0] / 60) });
  const [now, later, low, high] = one.wrong.map((share) => share === null ? null : fixed(100 * share, 1));
  const wrong = now === null ? null : later === null ? t("wrong_now", { now }) : t("wrong_later", { now, later, low, high });
  return [[t("forecast_now", { error: spread(one) }), end].filter(Boolean).join(", "), wrong, one.aim && aimText(one.aim)].filter(Boolean).join("; ");
}

// Why the robot cannot be started, sent home, or skip a stop.
function reasons(now) {
  return {
    start: now.ready === false ? said(now.reason) : "", home: now.settings?.home === "" ? t("no_home_below") : "",
    skip: now.stop ? "" : t("no_stop_yet"),
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
  if (!report.at || report.at !== sections[`ended/${robot}`]) return [button(t("no_report"), () => showTab("results"))];
  return [element("a", { class: "button", href: report.href, target: "_blank", rel: "noopener" }, t("open_report", { name: report.name }))];
}

const actions = (now) => [...afterwards(), ...commands(now)];

function commands(now) {
  if (!now || sections.watch_only) return [];
  if (lost()) return [element("p", {}, t("nothing_can_be_asked"))];
  const why = reasons(now);
  if (!mayAsk()) return [element("p", {}, t("read_only"))];
  if (taken()) return [element("p", {}, t("has_controls", { who: holder() }))];
  if (heardAgo() > GONE_S) return [element("p", {}, t("planner_gone"))];
  if (now.emergency) return [slide(t("slide_release"), release, "danger")];
  const end = slide(t("slide_end"), () => ask("abort"), "danger");
  if (!now.running) return [slide(t("slide_start"), () => ask("start"), "", why.start)];
  const home = slide(t("slide_home"), () => ask("return_home"), "", why.home);
  if (now.paused) return [slide(t("slide_resume"), () => ask("resume")), home, end];
  if (now.phase === "returning") return [button(t("pause"), () => ask("pause"), "primary"), end];
  return [
    element("div", { class: "buttons" }, button(t("pause"), () => ask("pause"), "primary"), button(t("skip"), () => ask("skip"), "", why.skip)),
    home, end,
  ];
}

function renderMission() {
  const now = mission();
  setText("used", duration(now?.used_s)); setText("left", duration(now?.left_s));
  setText("stops", String(now?.stops ?? "–")); setText($("stops").nextElementSibling, t("stops", { n: now?.stops })); setText("distance", metres(now?.distance_m));
  for (const id of ["forecast", "plan-forecast"]) setText(id, now?.forecast ? t("forecast", { forecast: forecastText(now.forecast) }) : t("no_forecast"));
  setText("ends", now?.running && now.left_s ? t("ends", { duration: duration(now.left_s) }) : "");
  setText("last-command", now?.last_command ? t("last_command", { command: said(now.last_command) }) : "");
  renderHome(now);
  const ruled = sections[`ruled_out/${robot}`] ?? [];
  $("ruled-part").hidden = !ruled.length;
  fill("ruled", [ruled, maySteer()], () => ruled.map((polygon, index) => {
    const wide = Math.round(Math.max(...polygon.map(([x]) => x)) - Math.min(...polygon.map(([x]) => x)));
    return element("li", {}, element("label", {}, t("across", { number: index + 1, m: wide })), button(t("show"), () => mark(null, polygon)), button(t("lift"), () => ask("lift", { polygon }), "", maySteer() ? "" : t("look_on")));
  }));
  const queue = now?.queue ?? [];
  $("queue-part").hidden = !queue.length;
  fill("queue", [queue, maySteer()], () => queue.map((name, index) => {
    const order = (change) => { const next = [...queue]; change(next); ask("order", { stops: next }); };
    const swap = (one, other) => order((next) => { [next[one], next[other]] = [next[other], next[one]]; });
    const up = button("↑", () => swap(index, index - 1)), down = button("↓", () => swap(index, index + 1));
    const remove = button("✕", () => order((next) => next.splice(index, 1)));
    up.disabled = !maySteer() || index === 0; down.disabled = !maySteer() || index === queue.length - 1; remove.disabled = !maySteer();
    [[up, "queue_up"], [down, "queue_down"], [remove, "queue_remove"]].forEach(([node, key]) => node.setAttribute("aria-label", `${name}: ${t(key)}`));
    return element("li", {}, name, up, down, remove);
  }));
}

function renderHome(now) {
  const name = now?.settings?.home, begun = sections[`start/${robot}`];
  $("home-part").hidden = name === undefined;
  setText("home", name ? t("home_is", { name }) : t("home_none"));
  fill("home-actions", [begun, maySteer(), now?.running], () => (!maySteer() ? [] : [
    button(t(now?.running ? "home_start" : "home_stands"), () => ask("change", { place: begun }), "", begun ? "" : t("not_seen")),
    button(t("home_tap"), () => { picking = true; render(); }),
  ]));
}

// Health, map, frame ---------------------------------------------------------------------------------------------------------

function renderLink() {
  const heard = sections.heard ?? {};
  const node = $("link"), first = heard[`mission/${robot}`], age = first === undefined ? null : Math.max(0, Math.floor(nowS() - first));
  const gone = lost(), over = ended();
  node.dataset.kind = over || !(gone || age === null || (age > OLD_S && !sections.watch_only)) ? "" : "lost";
  node.textContent = over && (gone || sections.watch_only) ? t("link_finished") : gone ? t(heard.map === undefined && !sections.field ? "link_connecting" : "link_lost") : age === null ? t("link_unheard") : age <= 2 ? t("link_live") : t("link_heard", { duration: duration(age) });
  const alarm = $("alarm");
  const text = stopping?.text
    ? t("alarm_stop", { why: stopping.text, n: stopping.tries })
    : !sections.field ? "" : !gone ? unheard() : sections.watch_only ? t("alarm_simulation_over") : over ? t("alarm_over")
    : t(sections.phone === undefined ? "alarm_lost" : sections.over ? "guide_over" : "guide_gone");
  if (alarm.textContent !== text) alarm.textContent = text;
  alarm.hidden = !text;
  alarm.classList.toggle("loud", Boolean(stopping?.text));
  alarm.classList.toggle("calm", !stopping && (over || Boolean(sections.watch_only)));
  const stop = $("stop");
  stop.dataset.kind = stopping ? "asking" : anyEmergency() ? "pressed" : "";
  const word = t(stopping ? "stopping" : anyEmergency() ? "stop_pressed" : "stop");
  if (stop.textContent !== word) stop.textContent = word;
}

const unheard = () => (mission()?.running && heardAgo() > GONE_S ? t("alarm_unheard", { duration: duration(Math.floor(heardAgo())) }) : "");

function renderHealth() {
  const parts = sections.health ?? [], well = parts.filter((part) => !part.level);
  const row = (part) => element("li", { "data-level": part.level }, element("b", {}, `${said(part.name.replace(/^\//, ""))}: `), said(part.message));
  fill("health", parts.filter((part) => part.level), () => parts.filter((part) => part.level).map(row));
  $("well-part").hidden = !well.length;
  setText("well-about", t(stale() || lost() ? "well_unknown" : well.length === parts.length ? "well_all" : "well_some", { n: well.length, all: parts.length }));
  fill("well", well, () => well.map(row));
}

const unitOf = (key) => (key.includes("vwc") ? "unit_vwc" : "unit_rate");
const figure = (value, one) => value === null ? "–" : fixed(value, unitOf(one.key) === "unit_vwc" ? 1 : 2).replace("-", "−");

function renderMap() {
  const about = sections.map;
  const layers = about?.layers ?? [];
  load();
  fill("layers", [layers.map((one) => one.key), shownLayer()], () => layers.map((one) => {
    const node = button(t(`short_${one.key}`), () => { showLayer(one.key); render(); });
    node.setAttribute("aria-pressed", String(one.key === shownLayer()));
    return node;
  }));
  const one = layers.find((each) => each.key === shownLayer());
  $("legend").hidden = !one && Boolean(sections.field) === false;
  fill("legend", [one ?? "none", sections.doubts], () => {
    if (!one) return [element("span", {}, t("no_map"))];
    const bar = element("canvas", { width: 190, height: 1 }), pen = bar.getContext("2d"), shade = pen.createLinearGradient(0, 0, 190, 0);
    one.colours.forEach((colour, index) => shade.addColorStop(index / (one.colours.length - 1), colour));
    pen.fillStyle = shade; pen.fillRect(0, 0, 190, 1);
    return [element("div", {}, `${t(`layer_${one.key}`)} [${t(unitOf(one.key))}]`), bar, element("div", { class: "row" }, element("span", {}, figure(one.limits[0], one)), element("span", {}, t("mean", { value: figure(one.mean, one) })), element("span", {}, figure(one.limits[1], one))), ...(layers.some((each) => each.key === "vwc") ? [] : [element("div", {}, t("rate_only"))]), ...(/^vwc/.test(one.key) ? sections.doubts ?? [] : []).map((key) => element("div", {}, t(`level_${key}`)))];
  });
  draw();
}

// What is tapped on the map at present, with its buttons on it.
function renderMapbar() {
  const drawing = (tab === "plan" || sections.border) && draft.drawing, on = picking || Boolean(drawing);
  document.body.classList.toggle("onmap", on);
  $("mapbar").hidden = !on;
  if (!on) return;
  const [text, ...buttons] = picking ? [t("tap_home"), button(t("cancel"), () => { picking = false; render(); })] : drawingBar();
  setText("mapbar-text", text);
  fill("mapbar-buttons", [picking, text], () => buttons);
}

async function onMap(at) {
  if (picking) { picking = false; render(); await ask("change", { place: at }); }
  else if (tab === "plan" || sections.border) addCorner(at);
  else await choose(at);
}

// Who steers, on each tab.
function renderSteer() {
  $("steer").hidden = !taken() || guided() && tab === "survey";
  fill("steer", [sections.viewer, taken()], () => (!taken() ? [] : [
    element("p", {}, `${t("has_controls", { who: holder() })} ${guided() ? "" : t("stop_for_all")}`), slide(t("slide_take"), takeOver)]));
  if (wasPressed && !anyEmergency() && !lost()) notice(t("stop_released"), false, 20000);
  wasPressed = lost() ? wasPressed : anyEmergency();
}

function renderFrame() {
  const robots = sections.robots ?? [];
  if (!robots.includes(robot) && robots.length) robot = robots[0];
  showRobot(robot);
  setText("field", sections.field?.name || t("tab_survey"));
  $("dose").hidden = !sections.dose || tab !== "survey";
  setText("dose", said(sections.dose ?? ""));
  const only = sections.watch_only ?? "";
  for (const id of ["stop", "health-part", "who-part"]) $(id).hidden = Boolean(only);
  $("watch-only").hidden = !only;
  setText("watch-only-text", said(only));
  $("robots").hidden = robots.length < 2;
  fill("robots", [robots, robot], () => robots.map((one) => {
    const node = button(one.replace("_", " "), () => { robot = one; render(); });
    node.setAttribute("aria-pressed", String(one === robot));
    return node;
  }));
}

function showTab(name) {
  tab = TABS.includes(name) ? name : "survey";
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
  const tabs = TABS.filter((name) => !sections.watch_only || name !== "plan");
  fill("tabs", [tab, tabs.length], () => tabs.map((name) => {
    const node = button(t(`tab_${name}`), () => showTab(name));
    node.setAttribute("aria-pressed", String(name === tab));
    return node;
  }));
}

let guide = null;  // its part of the page comes with a person's survey only
function renderGuide() {
  if (!guide && !guided()) return;
  guide ??= import("./guide.js").catch(() => { guide = null; });
  guide.then((part) => part && guard("guide", () => part.renderGuide({ ask, maySteer, mayAsk, takeOver, holder, mission, robot: () => robot })));
}

// One part that fails stops no other.
const PARTS = [
  ["guide", renderGuide], ["page", renderTabs], ["tab_survey", renderFrame], ["news", renderSteer],
  ["tab_plan", () => tab === "plan" && renderPlan()], ["tab_results", () => tab === "results" && renderResults()],
  ["state", renderState], ["mission", renderMission], ["health", renderHealth], ["link", renderLink], ["map_name", renderMap],
  ["drawing", renderMapbar], ["this_place", renderPlace],
];

function render() {
  forPerson(guided());
  for (const [name, part] of PARTS) guard(name, part);
}

document.title = t("title");
$("language").append(...Object.entries(languages).map(([code, name]) => element("option", { value: code, selected: code === language, title: name }, code.toUpperCase())));
$("language").addEventListener("change", () => { localStorage.setItem("language", $("language").value); location.reload(); });
$("stop").addEventListener("click", stop);
$("place-close").addEventListener("click", leave);
$("zoom-in").addEventListener("click", () => zoom(1.4));
$("zoom-out").addEventListener("click", () => zoom(1 / 1.4));
$("zoom-fit").addEventListener("click", fit);
$("who").value = localStorage.getItem("who") || "";
$("who").addEventListener("change", () => localStorage.setItem("who", $("who").value));
onPlace(onMap);
startPlan({ ask, ruleOut, open: (name) => { showTab(name); scrollTo(0, 0); }, notice, maySteer, mission, render, robot: () => robot });
startResults({ notice, maySteer, know: (names) => { know(names); showTab("plan"); scrollTo(0, 0); $("known").open = true; $("known").scrollIntoView(); } });
addEventListener("hashchange", () => showTab(location.hash.slice(1)));
showTab(location.hash.slice(1));
listen(render);
listen(function first(names) { if (names.size) { silence(first); loadRare().then(render); } });
setInterval(() => { const now = stale() || String(lost()); if (now === wasStale) renderLink(); else { wasStale = now; render(); } }, 1000);
connect();
