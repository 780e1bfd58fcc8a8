// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// The guide of a person with the sensor: where to go, how long to stay, when it is enough.

import { fixed, said, t } from "./texts.js";
import { connected, request, sections, takeControls } from "./link.js";
import { draft, insideOf } from "./map.js";
import { areaDrawn, begin, beginWalk, clear, drawn, endWalk, fieldFile, fieldIsUsed, walk } from "./outline.js";
import { $, button, duration, element, fill, setText, slide } from "./widgets.js";

const RING_M = 2 * Math.PI * 44, BUSY = ["planning", "waiting", "cancelling"], ASIDE_S = 60, STRIDE_M = 3, BORDER_M = 5;
const DEVICES = /(^|sensor_driver: )(logger link|records|GNSS( link)?)$/;
let before = "", sound = null, use = null;

// A hidden page, or a battery that is low, ends the wake lock; some browsers want a tap before it.
let awake = null;
const isAwake = () => Boolean(awake && !awake.released);
async function stayAwake() {
  if (document.hidden || isAwake()) return;
  awake = await navigator.wakeLock?.request("screen").catch(() => null) ?? null;
}
stayAwake();
// A sound needs a tap before it; phones that are silent vibrate.
addEventListener("pointerdown", () => { sound ??= window.AudioContext ? new AudioContext() : null; stayAwake(); });

function signal(tone, pattern) {
  navigator.vibrate?.(pattern);
  if (!sound) return;
  if (sound.state !== "running") sound.resume().catch(() => null);  // a call, or the lock screen, has stopped it
  pattern.filter((_, index) => index % 2 === 0).forEach((ms, index) => {
    const voice = sound.createOscillator(), volume = sound.createGain(), at = sound.currentTime + 0.3 * index;
    voice.frequency.value = tone;
    volume.gain.setValueAtTime(0.4, at);
    voice.connect(volume).connect(sound.destination);
    voice.start(at); voice.stop(at + ms / 1000);
  });
}

const where = () => sections[`place/${use.robot()}`] ?? [];
const errorOf = (counts) => fixed(100 / Math.sqrt(counts), counts < 2500 ? 1 : 2);
const leftOf = (now) => Math.max(0, (now.planned_dwell_s ?? 0) - countedS(now));
// Time that has been counted, not that of the clock: a logger may have died.
const countedS = (now) => now.exposure_s ?? now.dwell_s ?? 0;
const isDry = () => (sections.health ?? []).some((part) => part.level >= 2 && DEVICES.test(part.name));
const isEnough = (now) => now.counts > 0 && leftOf(now) === 0 && !isDry();

function stayText(now) {
  if (!now.counts || !countedS(now)) return "";
  const s = leftOf(now) || ASIDE_S;
  return t("guide_more", { s, now: errorOf(now.counts), then: errorOf(now.counts * (countedS(now) + s) / countedS(now)) });
}

// Direction of travel, clockwise from north [deg]: from where the person was a few steps ago.
function headingFrom([x, y]) {
  const from = (sections[`trail/${use.robot()}`] ?? []).findLast(([tx, ty]) => Math.hypot(x - tx, y - ty) >= STRIDE_M);
  return from ? Math.atan2(x - from[0], y - from[1]) * 180 / Math.PI : null;
}

// Nearest place of the border, for who is outside by more than a few metres.
function wayBack([x, y]) {
  const border = sections.field?.boundary;
  if (!border || sections.border || x === undefined || insideOf(border, x, y)) return null;
  const places = border.map(([ax, ay], index) => {
    const [bx, by] = border[(index + 1) % border.length], dx = bx - ax, dy = by - ay;
    const share = Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1)));
    return [ax + share * dx, ay + share * dy];
  }).map(([px, py]) => [Math.hypot(px - x, py - y), px, py]).sort((one, other) => one[0] - other[0]);
  return places[0][0] > BORDER_M ? places[0] : null;
}

// All that is wrong, the worst of each part; what the arrow says already is left out.
function alarms(now) {
  const told = new Set(), back = wayBack(where());
  return (sections.health ?? []).filter((part) => {
    const said = back && part.message.startsWith("outside: ") && part.message.split("; ").length < 3;
    if (part.level < (now?.running ? 1 : 2) || told.has(part.name) || said) return false;
    return Boolean(told.add(part.name));
  });
}

// What the person sees at a glance: an arrow, or a ring; and one line on it.
function view(now) {
  const [x, y] = where();
  if (sections.border && connected() && !sections.over) return borderView(x === undefined);
  if (!now) return { kind: "wait", title: t(sections.over ? "guide_over" : "waiting_for_planner") };
  if (now.phase === "finished") return { kind: "done", title: t("phase_finished"), big: t("n_stops", { n: now.stops }), line: sections.report ? t("guide_report", { path: sections.report }) : sections.report === "" ? t("guide_making") : "" };
  if (sections.over) return { kind: "wait", edge: "warn", title: t("guide_over"), line: t("guide_again") };
  if (!connected()) return { kind: "wait", edge: "bad", title: t(sections.phone === undefined ? "guide_no_link" : "no_connection") };
  if (now.paused) return { kind: "wait", title: t("phase_paused"), line: said(now.reason) };
  if (now.phase === "counting") {
    const share = now.planned_dwell_s ? Math.min(1, countedS(now) / now.planned_dwell_s) : 0;
    if (isDry()) return { kind: "ring", edge: "bad", title: t("guide_dry"), share, big: now.counts ? `±${errorOf(now.counts)} %` : "" };
    return { kind: "ring", title: isEnough(now) ? t("guide_enough") : t("guide_stay"), share, big: isEnough(now) ? `±${errorOf(now.counts)} %` : `${leftOf(now)} s`, line: stayText(now) };
  }
  if (now.stop && (now.phase === "travelling" || now.phase === "returning")) {
    if (x === undefined) return { kind: "wait", title: t("guide_go"), line: t("guide_no_place") };
    const [leadX, leadY, wayM] = now.leads ?? now.stop.slice(1);
    const back = wayBack([x, y]);
    if (back) return { kind: "arrow", title: t("guide_back"), turn: Math.round(Math.atan2(back[1] - x, back[2] - y) * 180 / Math.PI - (headingFrom([x, y]) ?? 0)), big: `${Math.round(back[0])} m`, line: t("guide_outside") };
    const bearing = Math.atan2(leadX - x, leadY - y) * 180 / Math.PI, metres = Math.round(Math.hypot(leadX - x, leadY - y));
    const stop = wayM > metres + 10 ? `${now.stop[0]}, ${Math.round(wayM)} m` : now.stop[0];
    const heading = headingFrom([x, y]), words = heading === null ? `${stop}; ${t("guide_north")}` : stop;
    return { kind: "arrow", title: now.phase === "returning" ? t("guide_home") : t("guide_go"), turn: Math.round(bearing - (heading ?? 0)), big: `${metres} m`, line: words };
  }
  if (BUSY.includes(now.phase)) return { kind: "wait", title: t("phase_planning") };
  return { kind: "wait", edge: now.ready ? "" : "warn", title: now.ready ? t("phase_idle") : t("phase_not_ready"), line: said(now.reason) };
}

// The border of the field, which the command begins with if it was given no field file.
function borderView(isLost) {
  const area = areaDrawn(), now = walk();
  if (isLost) return { kind: "wait", title: t("border_title"), line: t("guide_no_place") };
  if (now) return { kind: "wait", title: t("border_walks"), big: t("border_places", { n: now.count }), line: t("border_once") };
  return { kind: "wait", title: t("border_title"), big: area === null ? "" : `${fixed(area / 10000, 2)} ha`, line: t(area === null ? "border_how" : "border_right") };
}

function borderActions() {
  if (where()[0] === undefined || draft.drawing) return [];
  if (walk()) return [button(t("walk_finish"), () => endWalk(true), "primary big"), button(t("walk_discard"), () => endWalk(false))];
  if (drawn()) return [...(areaDrawn() === null ? [] : [button(t("border_use"), useBorder, "primary big", saving ? "…" : "")]), button(t("clear"), clear)];
  return [button(t("border_walk"), () => beginWalk("boundary"), "primary big"), button(t("border_tap"), () => begin("boundary"), "big")];
}

let saving = false;
async function useBorder() {
  saving = true;
  renderGuide(use);
  const field = await fieldFile();
  if (field && await use.ask("change", { field })) fieldIsUsed();
  saving = false;
}

function actions(now) {
  const { ask, maySteer, mayAsk, takeOver, holder } = use;
  if (!connected() || sections.over || !now && !sections.border || now?.phase === "finished" && sections.report !== undefined) return [];
  if (!mayAsk()) return [element("p", {}, t("read_only"))];
  if (!maySteer()) return [element("p", {}, t("has_controls", { who: holder() })), slide(t("slide_take"), takeOver)];
  if (sections.border) return borderActions();
  const big = (text, call, kind = "primary") => button(text, call, `${kind} big`);
  const here = () => ask("measure", { place: where().slice(0, 2) });
  const end = slide(t("guide_end"), () => ask("abort"), "danger");
  if (now.paused) return [big(t("guide_resume"), () => ask("resume")), end];
  if (!now.running) return now.ready ? [big(t("guide_start"), () => ask("start"))] : [];
  const pause = button(t("pause"), () => ask("pause"));
  if (now.phase === "counting") return [big(isEnough(now) ? t("guide_go_on") : t("guide_go_on_now"), () => ask("skip"), isEnough(now) ? "primary" : ""), element("div", { class: "buttons" }, pause), end];
  if (now.phase === "travelling") return [big(near(now) ? t("guide_there") : t("guide_here"), here, near(now) ? "primary" : ""), element("div", { class: "buttons" }, button(t("guide_other"), () => ask("skip")), pause), end];
  return [element("div", { class: "buttons" }, pause), end];
}

// Where the phone is the GNSS receiver: its position goes to the computer as long as this page has the controls.
const ASK_MS = 2000, PLACE = { enableHighAccuracy: true, maximumAge: 0, timeout: 20000 };
const mayPlace = window.isSecureContext && navigator.geolocation;
const GONE_S = 6, TELL_MS = 60_000, DAY_S = 86400;
let watch = null, busy = false, cameAt = 0, fault = "", tickedAt = Date.now(), backAt = 0, awayS = 0;

async function sendPlace({ coords, timestamp }) {
  cameAt = performance.now();
  if (busy || watch === null) return;
  busy = true;
  const { latitude, longitude, accuracy, altitude, speed } = coords;
  const age_s = (Date.now() - timestamp) / 1000;  // some phones count from another day than 1970
  const answer = await request("position", { latitude, longitude, accuracy, altitude, speed, age_s: Math.abs(age_s) < DAY_S ? age_s : 0 }, 5000);
  if (answer.error && sections.viewer && !sections.viewer.holder) await takeControls();  // the command was started again
  busy = false;
  fault = said(answer.error ?? "");
}

function failPlace({ code }) {
  fault = t({ 1: "phone_denied", 3: "phone_waiting" }[code] ?? "phone_none");
  if (code === 1) stopPhone();
}

function startPhone() {
  stopPhone();
  sessionStorage.setItem("phone", "1");
  fault = t("phone_waiting");
  watch = navigator.geolocation.watchPosition(sendPlace, failPlace, PLACE);
}

function stopPhone() {
  if (watch !== null) navigator.geolocation.clearWatch(watch);
  watch = null;
  sessionStorage.removeItem("phone");
}

// Some browsers say nothing while the phone stands. A page that is hidden, frozen or asleep gets no positions: it says
// so when it is seen again, and starts anew.
function tick() {
  if (document.hidden) return;
  const goneS = (Date.now() - tickedAt) / 1000;
  tickedAt = Date.now();
  if (watch === null) return;
  if (goneS > GONE_S) { [awayS, backAt] = [goneS, tickedAt]; startPhone(); }
  else if (performance.now() - cameAt > ASK_MS) navigator.geolocation.getCurrentPosition(sendPlace, () => null, PLACE);
}
setInterval(tick, ASK_MS);
document.addEventListener("visibilitychange", () => { tick(); stayAwake(); if (watch !== null && !document.hidden) startPhone(); });
addEventListener("pageshow", tick);
if (sessionStorage.getItem("phone") && mayPlace) startPhone();

// One tap, also after somebody else had the controls.
function phoneActions() {
  if (!sections.phone || watch !== null || !connected() || !use.maySteer()) return [];
  if (!mayPlace) return [element("p", {}, t("phone_insecure"))];
  return [button(t("phone_use"), async () => { if (await takeControls()) startPhone(); }, "primary big")];
}

function near(now) {
  const [x, y, , sd] = where();
  return now.stop && Math.hypot(now.stop[1] - x, now.stop[2] - y) <= Math.max(now.guided, 2 * (sd ?? 0));
}

function picture(shown) {
  const svg = (inner) => { const box = element("div", { class: `sign ${shown.kind}` }); box.innerHTML = `<svg viewBox="0 0 100 100" aria-hidden="true">${inner}</svg>`; return box; };
  if (shown.kind === "arrow") return [svg(`<path d="M50 6 L84 90 L50 70 L16 90 Z" transform="rotate(${shown.turn} 50 50)"/>`)];
  if (shown.kind === "ring") return [svg(`<circle cx="50" cy="50" r="44"/><circle class="full" cx="50" cy="50" r="44" stroke-dasharray="${(shown.share * RING_M).toFixed(1)} ${RING_M.toFixed(1)}" transform="rotate(-90 50 50)"/>`)];
  return [];
}

export function renderGuide(helpers) {
  use = helpers;
  document.body.classList.toggle("guided", Boolean(use.mission()?.guided || sections.border));
  document.body.classList.toggle("guiding", Boolean(use.mission()?.running));
  if (watch !== null && sections.viewer?.holder && !sections.viewer.holds) stopPhone();
  const now = use.mission(), shown = view(now), wrong = connected() && now?.phase !== "finished" ? alarms(now) : [];
  fill("guide-sign", [shown.kind, shown.turn, shown.share], () => picture(shown));
  setText("guide-title", shown.title); setText("guide-big", shown.big ?? ""); setText("guide-line", shown.line ?? "");
  const gone = Date.now() - backAt < TELL_MS ? t("phone_away", { duration: duration(awayS) }) : "";
  const lines = [...(watch !== null && gone ? [gone] : []), ...(sections.phone && fault ? [fault] : []), ...wrong.map((part) => `${said(part.name)}: ${said(part.message)}`)];
  fill("guide-alarm", lines, () => lines.map((line) => element("p", {}, line)));
  $("guide").dataset.edge = shown.edge || (wrong.length ? (wrong.some((part) => part.level === 2) ? "bad" : "warn") : "");
  const rest = now?.running ? [t("n_stops", { n: now.stops }), t("guide_left", { duration: duration(now.left_s) })] : [];
  setText("guide-rest", [...rest, watch === null || isAwake() ? "" : t("phone_sleeps")].filter(Boolean).join(" · "));
  fill("guide-actions", [now?.phase, now?.paused, now?.running, now?.ready, sections.over, isEnough(now ?? {}), near(now ?? {}), sections.viewer, sections.report, connected(), watch !== null, sections.border && [where()[0] === undefined, draft.drawing, drawn(), areaDrawn(), walk(), saving]], () => [...phoneActions(), ...actions(now)]);
  const key = now ? `${now.phase} ${now.stop?.[0]} ${isEnough(now)}` : "";
  if (key !== before && before) {
    if (now?.phase === "travelling") signal(660, [200, 100, 200]);
    else if (now?.phase === "counting") signal(isEnough(now) ? 990 : 440, isEnough(now) ? [400, 100, 400] : [150]);
    else if (now?.phase === "finished") signal(520, [600]);
  }
  before = key;
}

document.head.append(element("link", { rel: "stylesheet", href: "page/guide.css" }));
$("panel").prepend(element("article", { id: "guide", class: "card", "aria-label": t("guide") },
  element("p", { id: "guide-title", role: "status" }), element("div", { class: "glance" }, element("div", { id: "guide-sign" }), element("p", { id: "guide-big" })),
  element("p", { id: "guide-line" }), element("div", { id: "guide-alarm" }), element("div", { id: "guide-actions" }), element("p", { id: "guide-rest", class: "small" })));
