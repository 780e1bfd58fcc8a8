// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// The connection to the console: sections that stay up to date, commands, and the emergency stop.

import { t } from "./texts.js";

export const sections = {};
export let clockOffS = null;  // clock of the robot's computer, less that of this one [s]
// A number that only this page knows: who has the controls.
const client = sessionStorage.getItem("client") || Array.from(crypto.getRandomValues(new Uint8Array(16)), (n) => n.toString(16).padStart(2, "0")).join("");
sessionStorage.setItem("client", client);
const listeners = new Set();
const RETRY_MS = 1000, SILENT_MS = 6000, COMMAND_MS = 9000, CHOICE_MS = 65000, STOP_MS = 6000, LOST_S = 5, DRIFT = 2e-4;
let socket = null, heardAt = null, triedAt = 0, failed = 0, offset = 0, fresh = false;

export const listen = (call) => listeners.add(call);
export const silence = (call) => listeners.delete(call);
export const connected = () => socket !== null && socket.readyState === 1 && heardAt !== null;
// Steady time of the robot's computer now [s], as far as it is known here.
export const nowS = () => performance.now() / 1000 + offset;
export const lost = () => !connected() || silentS() > LOST_S;
export const silentS = () => (heardAt === null ? Infinity : (performance.now() - heardAt) / 1000);

function apply(message) {
  const first = fresh;
  if (fresh) {
    for (const name of Object.keys(sections)) delete sections[name];
    fresh = false;
  }
  // A message may be late, but never early: the earliest of them show the clock. The clocks drift by DRIFT at most.
  const seen = message.now - performance.now() / 1000;
  offset = first ? seen : Math.max(seen, offset - DRIFT * silentS());
  heardAt = performance.now();
  clockOffS = message.utc - Date.now() / 1000;
  for (const [name, value] of Object.entries(message.set ?? {})) sections[name] = value;
  for (const [name, [kept, items]] of Object.entries(message.extend ?? {})) {
    sections[name] = (sections[name] ?? []).slice(0, kept).concat(items);
  }
  for (const call of listeners) call(new Set([...Object.keys(message.set ?? {}), ...Object.keys(message.extend ?? {})]));
}

// Safari takes a certificate that the computer has made for https, but not for WebSockets (WebKit bug 145819). A page
// whose WebSocket has twice ended without a message follows an event stream, which takes a connection of the few
// that a browser opens to one host.
const STREAM_AFTER = 2;

function opened() {
  const path = `${location.host}${location.pathname.replace(/[^/]*$/, "")}live?client=${client}`;
  if (failed >= STREAM_AFTER) return new EventSource(`${location.protocol}//${path}`);
  return new WebSocket(`${location.protocol === "https:" ? "wss:" : "ws:"}//${path}`);
}

export function connect() {
  let mine = {};
  triedAt = performance.now();
  try { mine = opened(); } catch { setTimeout(ended); }  // a browser may forbid it at once
  socket = mine;
  let first = true;
  function ended() {
    if (socket !== mine) return;
    socket = null;
    mine.close?.();
    failed += first ? 1 : 0;
    for (const call of listeners) call(new Set());
    setTimeout(connect, RETRY_MS);
  }
  mine.onmessage = (event) => {
    if (socket !== mine) return;
    if (first && failed < STREAM_AFTER) failed = -Infinity;  // WebSockets work here
    if (first) { fresh = true; first = false; }
    apply(JSON.parse(event.data));
  };
  mine.onclose = mine.onerror = ended;
  mine.end = ended;
}

setInterval(() => {  // a connection that is only silent is lost as well
  if (performance.now() - Math.max(heardAt ?? 0, triedAt) > SILENT_MS) socket?.end();
}, 1000);

// Answer of the console, or {error}.
export async function request(path, content, limitMs = 200000, silence = "no_answer") {
  try {
    const response = await fetch(path, {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ ...content, client }),
      signal: AbortSignal.timeout(limitMs), cache: "no-store",
    });
    return await response.json();
  } catch {
    return { error: t(silence) };
  }
}

export const who = () => (localStorage.getItem("who") || "").trim();
const named = () => ({ who: who() || "console" });

// Reply to a command: {accepted, message}. A reply that does not come is no acceptance.
export async function command(robot, verb, details = {}) {
  const opens = details.field || details.earlier?.length;
  const reply = await request("command", { robot, verb, ...named(), ...details }, opens ? CHOICE_MS : COMMAND_MS, "no_answer_to_command");
  return reply.error ? { accepted: false, message: reply.error } : reply;
}

export const takeControls = async () => (await request("take", named(), COMMAND_MS)).holds === true;

// {acknowledged, missing}, or {error}: why there is no answer.
export const emergency = (path) => request(path, named(), STOP_MS);

export async function valuesAt(x, y) {
  try {
    const response = await fetch(`at?x=${x}&y=${y}`, { cache: "no-store", signal: AbortSignal.timeout(COMMAND_MS) });
    return (await response.json()).values ?? {};
  } catch {
    return null;
  }
}
