// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// The error of the map against time, as an SVG of 360 x 200.

import { t } from "./texts.js";
import { duration } from "./widgets.js";

const LEFT = 44, RIGHT = 330, TOP = 24, BOTTOM = 168;

function mark(tag, attributes, text = "") {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, given] of Object.entries(attributes)) node.setAttribute(name, given);
  node.textContent = text;
  return node;
}

// Round steps, at most "most" of them up to "top".
function steps(top, most) {
  const rough = top / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map((n) => n * power).find((n) => n >= rough * 0.999);
  return Array.from({ length: Math.floor(top / step + 1e-9) + 1 }, (_, n) => +(n * step).toPrecision(6));
}

// points: [time [h], error [%]]; wanted: error [%]; reached: time at which it is reached [h], or null.
export function chart(points, wanted, reached) {
  const end = points.at(-1)[0] || 1, top = Math.max(...points.map(([, e]) => e), wanted) * 1.05;
  const x = (h) => LEFT + (RIGHT - LEFT) * h / end, y = (e) => BOTTOM - (BOTTOM - TOP) * e / top;
  const grid = steps(top, 4).flatMap((e) => [
    mark("line", { x1: LEFT, x2: RIGHT, y1: y(e), y2: y(e), stroke: "#aab3bd" }),
    mark("text", { x: LEFT - 6, y: y(e) + 5, "text-anchor": "end" }, String(e)),
  ]);
  const times = steps(end, 4).map((h) => mark("text", { x: x(h), y: BOTTOM + 20, "text-anchor": "middle" }, h ? duration(3600 * h) : "0"));
  const found = reached === null ? [] : [
    mark("line", { x1: x(reached), x2: x(reached), y1: y(wanted), y2: BOTTOM, stroke: "#a80018", "stroke-width": 2, "stroke-dasharray": "6 4" }),
    mark("circle", { cx: x(reached), cy: y(wanted), r: 5, fill: "#a80018" }),
    mark("text", { x: x(reached) + (reached > 0.6 * end ? -8 : 8), y: y(wanted) - 8, "text-anchor": reached > 0.6 * end ? "end" : "start", class: "found" }, duration(3600 * reached)),
  ];
  return [...grid, ...times,
    mark("line", { x1: LEFT, x2: RIGHT, y1: y(wanted), y2: y(wanted), stroke: "#a80018", "stroke-width": 2, "stroke-dasharray": "6 4" }),
    mark("polyline", { points: points.map(([h, e]) => `${x(h)},${y(e)}`).join(" "), fill: "none", stroke: "#0b3d66", "stroke-width": 3 }),
    ...found,
    mark("text", { x: LEFT, y: 14 }, t("chart_axis"))];
}
