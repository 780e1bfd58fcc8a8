// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// The guide of a person with the sensor: where to go, how long to stay, when it is enough.

import { connected, sections } from "./link.js";
import { $, button, duration, element, fill, setText, slide } from "./widgets.js";

const TEXT = {
  ready: "Ready", notReady: "Not ready yet", start: "Start the survey", choosing: "Choosing the next stop", go: "Go to the next stop", there: "I am there",
  here: "Measure here", other: "Another stop", stay: "Stay here", enough: "Enough", goOn: "Go on", goOnNow: "Go on now", pause: "Pause", resume: "Go on with the survey",
  paused: "Paused", end: "Slide to end the survey", home: "Go home", done: "Finished", noLink: "No connection: what the sensor counts is stored all the same",
  readOnly: "Read-only: open the address with the token that the command prints.", north: "north is up until you walk", noPlace: "no position yet",
  counts: (n) => `${n} counts`, left: (s) => `${s} s`, ofStops: (n) => `${n} ${n === 1 ? "stop" : "stops"}`, taken: (who) => `${who} has the controls`, take: "Slide to take over",
  more: (s, now, then) => `stay ${s} s more: ±${now} % → ±${then} %`, error: (now) => `±${now} % so far`, report: (path) => `The report: ${path}`, making: "Making the map",
  outside: "You are outside the field: the map takes no counts from here",
};
const RING_M = 2 * Math.PI * 44, BUSY = ["planning", "waiting", "cancelling"], ASIDE_S = 60, STRIDE_M = 3;
let before = "", sound = null, use = null;

// A sound needs a tap before it; phones that are silent vibrate.
addEventListener("pointerdown", () => {
  sound ??= window.AudioContext ? new AudioContext() : null;
  navigator.wakeLock?.request("screen").catch(() => null);
}, { once: true });

function signal(tone, pattern) {
  navigator.vibrate?.(pattern);
  if (!sound) return;
  pattern.filter((_, index) => index % 2 === 0).forEach((ms, index) => {
    const voice = sound.createOscillator(), volume = sound.createGain(), at = sound.currentTime + 0.3 * index;
    voice.frequency.value = tone;
    volume.gain.setValueAtTime(0.4, at);
    voice.connect(volume).connect(sound.destination);
    voice.start(at); voice.stop(at + ms / 1000);
  });
}

const where = () => sections[`place/${use.robot()}`] ?? [];
const errorOf = (counts) => (100 / Math.sqrt(counts)).toFixed(counts < 2500 ? 1 : 2);
const leftOf = (now) => Math.max(0, (now.planned_dwell_s ?? 0) - (now.dwell_s ?? 0));
const isEnough = (now) => now.counts > 0 && leftOf(now) === 0;

function stayText(now) {
  if (!now.counts || !now.dwell_s) return "";
  const s = leftOf(now) || ASIDE_S;
  return TEXT.more(s, errorOf(now.counts), errorOf(now.counts * (now.dwell_s + s) / now.dwell_s));
}

// Direction of travel, clockwise from north [deg]: from where the person was a few steps ago.
function headingFrom([x, y]) {
  const from = (sections[`trail/${use.robot()}`] ?? []).findLast(([tx, ty]) => Math.hypot(x - tx, y - ty) >= STRIDE_M);
  return from ? Math.atan2(x - from[0], y - from[1]) * 180 / Math.PI : null;
}

function isOutside([x, y]) {
  let inside = false;
  const ring = sections.field?.boundary ?? [];
  ring.forEach(([ax, ay], index) => {
    const [bx, by] = ring.at(index - 1);
    if (ay > y !== by > y && x < (bx - ax) * (y - ay) / (by - ay) + ax) inside = !inside;
  });
  return ring.length > 0 && !inside;
}

// What the person sees at a glance: an arrow, or a ring; and one line on it.
function view(now) {
  const [x, y] = where();
  if (!now) return { kind: "wait", title: TEXT.noLink };
  if (now.phase === "finished") return { kind: "done", title: TEXT.done, big: TEXT.ofStops(now.stops), line: sections.report ? TEXT.report(sections.report) : sections.report === "" ? TEXT.making : "" };
  if (!connected()) return { kind: "wait", title: TEXT.noLink };
  if (now.paused) return { kind: "wait", title: TEXT.paused, line: now.reason };
  if (now.phase === "counting") {
    const share = now.planned_dwell_s ? Math.min(1, now.dwell_s / now.planned_dwell_s) : 0;
    return { kind: "ring", title: isEnough(now) ? TEXT.enough : TEXT.stay, share, big: isEnough(now) ? `±${errorOf(now.counts)} %` : TEXT.left(leftOf(now)), line: stayText(now) };
  }
  if (now.stop && (now.phase === "travelling" || now.phase === "returning")) {
    if (x === undefined) return { kind: "wait", title: TEXT.go, line: TEXT.noPlace };
    const bearing = Math.atan2(now.stop[1] - x, now.stop[2] - y) * 180 / Math.PI, metres = Math.round(Math.hypot(now.stop[1] - x, now.stop[2] - y));
    const heading = headingFrom([x, y]), said = heading === null ? `${now.stop[0]}; ${TEXT.north}` : now.stop[0];
    return { kind: "arrow", title: now.phase === "returning" ? TEXT.home : TEXT.go, turn: Math.round(bearing - (heading ?? 0)), big: `${metres} m`, line: isOutside([x, y]) ? TEXT.outside : said };
  }
  if (BUSY.includes(now.phase)) return { kind: "wait", title: TEXT.choosing };
  return { kind: "wait", title: now.ready ? TEXT.ready : TEXT.notReady, line: now.reason };
}

function actions(now) {
  const { ask, maySteer, mayAsk, takeOver } = use;
  if (!connected() || !now || now.phase === "finished" && sections.report !== undefined) return [];
  if (!mayAsk()) return [element("p", {}, TEXT.readOnly)];
  if (!maySteer()) return [element("p", {}, TEXT.taken(sections.viewer.holder)), slide(TEXT.take, takeOver)];
  const big = (text, call, kind = "primary") => button(text, call, `${kind} big`);
  const here = () => ask("measure", { place: where().slice(0, 2) });
  const end = slide(TEXT.end, () => ask("abort"), "danger");
  if (now.paused) return [big(TEXT.resume, () => ask("resume")), end];
  if (!now.running) return now.ready ? [big(TEXT.start, () => ask("start"))] : [];
  const pause = button(TEXT.pause, () => ask("pause"));
  if (now.phase === "counting") return [big(isEnough(now) ? TEXT.goOn : TEXT.goOnNow, () => ask("skip"), isEnough(now) ? "primary" : ""), element("div", { class: "buttons" }, pause), end];
  if (now.phase === "travelling") return [big(near(now) ? TEXT.there : TEXT.here, here, near(now) ? "primary" : ""), element("div", { class: "buttons" }, button(TEXT.other, () => ask("skip")), pause), end];
  return [element("div", { class: "buttons" }, pause), end];
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
  document.body.classList.toggle("guided", Boolean(use.mission()?.guided));
  const now = use.mission(), shown = view(now), worst = (sections.health ?? [])[0];
  fill("guide-sign", [shown.kind, shown.turn, shown.share], () => picture(shown));
  setText("guide-title", shown.title); setText("guide-big", shown.big ?? ""); setText("guide-line", shown.line ?? "");
  setText("guide-alarm", worst?.level && now?.running ? `${worst.name}: ${worst.message}` : "");
  setText("guide-rest", now?.running ? `${TEXT.ofStops(now.stops)} · ${duration(now.left_s)} left` : "");
  fill("guide-actions", [now?.phase, now?.paused, now?.running, now?.ready, isEnough(now ?? {}), near(now ?? {}), sections.viewer, sections.report, connected()], () => actions(now));
  const key = now ? `${now.phase} ${now.stop?.[0]} ${isEnough(now)}` : "";
  if (key !== before && before) {
    if (now?.phase === "travelling") signal(660, [200, 100, 200]);
    else if (now?.phase === "counting") signal(isEnough(now) ? 990 : 440, isEnough(now) ? [400, 100, 400] : [150]);
    else if (now?.phase === "finished") signal(520, [600]);
  }
  before = key;
}

document.head.append(element("link", { rel: "stylesheet", href: "page/guide.css" }));
$("panel").prepend(element("article", { id: "guide", class: "card", "aria-label": "Guide" },
  element("p", { id: "guide-title", role: "status" }), element("div", { class: "glance" }, element("div", { id: "guide-sign" }), element("p", { id: "guide-big" })),
  element("p", { id: "guide-line" }), element("p", { id: "guide-alarm" }), element("div", { id: "guide-actions" }), element("p", { id: "guide-rest", class: "small" })));
