// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// Small parts of the page.

import { fixed, t } from "./texts.js";

export const $ = (id) => document.getElementById(id);

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

export function setText(id, text) {
  const node = typeof id === "string" ? $(id) : id;
  if (node.textContent !== text) node.textContent = text;
}

const reasoned = (text, why) => (why ? `${text}: ${why}` : text);

// "why" disables it, and is in it.
export const button = (text, call, kind = "", why = "") => element("button", { type: "button", class: kind, onclick: call, disabled: Boolean(why) }, reasoned(text, why));

let slides = 0;
let held = null; // the slide under a finger
for (const end of ["pointerup", "pointercancel"]) window.addEventListener(end, () => { held = null; });

// A control that must be moved to its end: for what moves a robot. By keyboard: End, or the arrow keys.
export function slide(text, call, kind = "", why = "") {
  const id = `slide-${++slides}`;
  const input = element("input", { type: "range", min: 0, max: 100, step: 5, value: 0, id, disabled: Boolean(why) });
  const reset = () => { input.value = 0; };
  const done = () => {
    const far = Number(input.value) >= 95;
    reset();
    if (far) call();
  };
  input.addEventListener("change", () => { if (!input.dataset.keys) done(); });
  input.addEventListener("keydown", (event) => { if (event.key.startsWith("Arrow") || event.key.startsWith("Page")) input.dataset.keys = 1; });
  input.addEventListener("keyup", () => {
    if (input.dataset.keys && Number(input.value) >= 95) { delete input.dataset.keys; done(); }
  });
  input.addEventListener("pointerdown", () => { delete input.dataset.keys; held = input; });
  input.addEventListener("blur", reset);
  return element("div", { class: `slide ${why ? "off" : kind}`, "data-slide": text }, input, element("label", { for: id }, reasoned(text, why)));
}

// Replaces children if what they depend on has changed, but a slide only when no finger is on it any more: the robot
// judges whether what it asks for is still possible.
export function fill(id, key, make) {
  const node = $(id);
  const text = JSON.stringify(key);
  if (node.dataset.key === text || node.contains(held)) return;
  node.replaceChildren(...make());
  node.dataset.key = text;
}

// Runs a part of the page; what fails is named at the top, as long as it does, and the rest goes on.
const faults = new Map();
export function guard(name, part) {
  let fault = "";
  try { part(); } catch (error) {
    fault = String(error);
    if (faults.get(name) !== fault) (window.reportError ?? console.error)(error);
  }
  if ((faults.get(name) ?? "") === fault) return;
  faults.set(name, fault);
  const lines = [...faults].filter(([, why]) => why).map(([one, why]) => t("part_failed", { part: t(one), why }));
  setText("faults", lines.join(" "));
  $("faults").hidden = !lines.length;
}

export function duration(seconds) {
  if (seconds === null || seconds === undefined) return "–";
  if (seconds < 90) return `${Math.round(seconds)} s`;
  const minutes = Math.round(seconds / 60);
  return minutes < 90 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${String(minutes % 60).padStart(2, "0")}`;
}

export const metres = (value) => (value === null || value === undefined ? "–" : value < 1000 ? `${value} m` : `${fixed(value / 1000, 2)} km`);
