// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// The map: a picture of the server in metres of the field, and what is drawn over it.

import { sections } from "./link.js";
import { guard } from "./widgets.js";

const canvas = document.getElementById("map");
const pen = canvas.getContext("2d");
const view = { x: 0, y: 0, scale: 1, fitted: false, moved: false };  // centre [m], pixels per metre; whether fingers moved it
const picture = { image: null, version: -1, key: "", extent: null, loading: false };
const pointers = new Map();
export const draft = { boundary: [], areas: [], drawing: null, shown: false };  // what is drawn on the page Plan
let shownRobot = "";
let chosen = null, area = null, onChoose = () => {}, moved = 0, asked = false, layer = "";

export const onPlace = (call) => { onChoose = call; };
export function mark(place, corners = null) { chosen = place; area = corners; draw(); }
export function showLayer(key) { layer = key; load(); }
export function showRobot(name) { shownRobot = name; }
export const shownLayer = () => layer;

export function insideOf(corners, x, y) {
  return corners.reduce((inside, [ax, ay], index) => {
    const [bx, by] = corners.at(index - 1);
    return (ay > y) !== (by > y) && x < (bx - ax) * (y - ay) / (by - ay) + ax ? !inside : inside;
  }, false);
}

// Robots and their next stops: [robot, place].
const marks = () => (sections.robots ?? []).flatMap((robot) => [sections[`place/${robot}`], sections[`plan/${robot}`]?.[0]].filter(Boolean).map((place) => [robot, place]));

function boxOf(points) {
  const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
  return [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
}

// Marks that the whole field is shown with; those farther away than it is wide are arrows at the edge.
function nearMarks() {
  const [west, east, south, north] = boxOf(sections.field.boundary), size = Math.max(east - west, north - south);
  return marks().map(([, place]) => place).filter(([x, y]) => x > west - size && x < east + size && y > south - size && y < north + size);
}

export function fit() {
  if (!sections.field?.boundary || !canvas.clientWidth) return;
  const [west, east, south, north] = boxOf([...sections.field.boundary, ...nearMarks()]);
  // Next to the map on a phone, over it on a desk: buttons at the top, the legend at the bottom.
  const small = canvas.clientWidth < 500, legend = document.querySelector(".legend").offsetHeight;
  const [top, bottom, sides] = small ? [14, 30, 130] : [70, legend + 24, 150];
  const tall = Math.max(canvas.clientHeight - top - bottom, 100), wide = canvas.clientWidth - sides;
  view.scale = Math.max(0.01, Math.min(wide / (east - west || 1), tall / (north - south || 1)));
  view.x = (west + east) / 2; view.y = (south + north) / 2 + (top - bottom) / 2 / view.scale;
  view.fitted = true; view.moved = false;
  draw();
}

export function zoom(factor, at = [canvas.clientWidth / 2, canvas.clientHeight / 2]) {
  const [x, y] = ground(at);
  view.scale = Math.min(500, Math.max(0.02, view.scale * factor));
  const [nx, ny] = ground(at);
  view.x += x - nx; view.y += y - ny; view.moved = true;
  draw();
}

const pixel = ([x, y]) => [canvas.clientWidth / 2 + (x - view.x) * view.scale, canvas.clientHeight / 2 - (y - view.y) * view.scale];
const ground = ([px, py]) => [view.x + (px - canvas.clientWidth / 2) / view.scale, view.y - (py - canvas.clientHeight / 2) / view.scale];

// One picture per map: the next one is loaded when the last one is here.
export function load() {
  const about = sections.map;
  if (!about?.layers?.length || picture.loading) return;
  if (!about.layers.some((one) => one.key === layer)) layer = about.layers[0].key;
  if (picture.version === about.version && picture.key === layer) return;
  picture.loading = true;
  const { version, extent } = about, key = layer, image = new Image();
  const done = (ok) => {
    picture.loading = false;
    if (ok) Object.assign(picture, { image, version, key, extent });
    draw();
    if (ok) setTimeout(load, 500); else setTimeout(load, 2000);
  };
  image.onload = () => done(true);
  image.onerror = () => done(false);
  image.src = `map/${key}.png?v=${version}`;
}

export function draw() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => { asked = false; guard("map", paint); });
}

function path(points, closed = true) {
  pen.beginPath();
  points.forEach((point, index) => pen[index ? "lineTo" : "moveTo"](...pixel(point)));
  if (closed) pen.closePath();
}

function paint() {
  const ratio = window.devicePixelRatio || 1, [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!width) return;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
  }
  if (view.field !== sections.field) {  // it comes again with each connection
    if (String(view.field?.boundary) !== String(sections.field?.boundary)) view.fitted = false;
    view.field = sections.field;
  }
  if (!view.fitted || !view.moved && !pointers.size && !draft.drawing && sections.field && nearMarks().some(outside)) fit();
  canvas.dataset.view = [view.x, view.y, view.scale].join(" ");  // for tests, which tap places of the field
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const field = sections.field;
  if (!field) return;
  if (!sections.border) { path(field.boundary); pen.fillStyle = "#f3f1e6"; pen.fill(); }
  if (picture.image) image(picture.image, picture.extent);
  for (const hole of field.no_go) hatch(hole, "#a80018");
  for (const robot of sections.robots ?? []) for (const [index, one] of (sections[`ruled_out/${robot}`] ?? []).entries()) {
    hatch(one, "#6a3a00");
    label(String(index + 1), pixel([0, 1].map((axis) => one.reduce((sum, corner) => sum + corner[axis] / one.length, 0))), "#6a3a00", "center", 15, true);
  }
  for (const robot of sections.robots ?? []) { const home = sections[`mission/${robot}`]?.home_place; if (home) label("⌂", pixel(home), "#0b5127", "center", 26, true); }
  if (!sections.border) { path(field.boundary); line("#fff", 5); line("#10151b", 2.5); }
  nodes(); measured();
  (sections.robots ?? []).forEach(robotLayer);
  for (const [robot, place] of marks()) if (outside(place)) arrow(place, colourOf(robot));
  if (draft.shown || sections.border) drafts();
  if (area) hatch(area, "#6a3a00");
  if (chosen) cross(pixel(chosen));
  if (document.activeElement === canvas && canvas.matches(":focus-visible")) cross([width / 2, height / 2], "#ffb000");
  scaleBar(width, height);
}

function image(shown, [west, east, south, north]) {
  const [left, top] = pixel([west, north]), [right, bottom] = pixel([east, south]);
  pen.imageSmoothingEnabled = false;
  pen.drawImage(shown, left, top, right - left, bottom - top);
}

function line(colour, width, dash = []) {
  pen.strokeStyle = colour; pen.lineWidth = width; pen.setLineDash(dash); pen.stroke(); pen.setLineDash([]);
}

function disc(place, radius, fill, edge = "#fff") {
  const [x, y] = pixel(place);
  pen.beginPath(); pen.arc(x, y, radius, 0, 7); pen.fillStyle = fill; pen.fill();
  if (edge) line(edge, 1.5);
}

function hatch(corners, colour) {
  path(corners); pen.fillStyle = `${colour}30`; pen.fill(); line(colour, 2);
  pen.save(); pen.clip();
  const xs = corners.map((c) => pixel(c)[0]), ys = corners.map((c) => pixel(c)[1]);
  const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  pen.beginPath();
  const step = Math.max(9, (right - left + bottom - top) / 200);
  for (let x = left - (bottom - top); x < right; x += step) { pen.moveTo(x, bottom); pen.lineTo(x + bottom - top, top); }
  line(colour, 1);
  pen.restore();
}

function drafts() {
  for (const robot of sections.robots ?? []) {
    const walk = sections[`walk/${robot}/places`] ?? [];
    if (walk.length > 1) { path(walk, false); line("#fff", 6); line("#5a1a8a", 3.5); }
  }
  if (draft.boundary.length) { path(draft.boundary, draft.drawing !== draft.boundary); line("#fff", 6); line("#5a1a8a", 3.5, [10, 5]); }
  for (const one of draft.areas) if (one.length > 2) hatch(one, "#a80018"); else if (one.length) { path(one, false); line("#a80018", 3); }
  for (const corner of [...draft.boundary, ...draft.areas.flat()]) disc(corner, 6, "#5a1a8a");
}

function nodes() {
  pen.beginPath();
  for (const pair of sections.edges ?? []) pair.forEach((one, index) => pen[index ? "lineTo" : "moveTo"](...pixel(sections.nodes[one].slice(1))));
  line("#ffffffa0", 2.5); line("#10151b70", 1);
  if (view.scale < 2) return;
  for (const [, x, y] of sections.nodes ?? []) disc([x, y], 2, "#10151b80", null);
}

function measured() {
  for (const place of sections.samples ?? []) disc(place, 2.2, "#10151b", null);
  for (const place of sections.visits ?? []) disc(place, 5, "#fff", "#10151b");
}

const COLOURS = ["#a80018", "#5a1a8a", "#0b5127", "#10151b"], NEAR = 8, EDGE = 24;
const colourOf = (robot) => COLOURS[sections.robots.indexOf(robot) % COLOURS.length];

function outside(place) {
  const [x, y] = pixel(place);
  return x < 0 || y < 0 || x > canvas.clientWidth || y > canvas.clientHeight;
}

// What is out of view: where it is, and how far beyond the edge.
function arrow(place, colour) {
  const [x, y] = pixel(place), at = [[x, canvas.clientWidth], [y, canvas.clientHeight]].map(([one, end]) => Math.min(Math.max(one, EDGE), end - EDGE));
  pen.save(); pen.translate(...at); pen.rotate(Math.atan2(y - at[1], x - at[0]));
  pen.beginPath(); pen.moveTo(16, 0); pen.lineTo(-8, 10); pen.lineTo(-8, -10); pen.closePath();
  pen.fillStyle = colour; pen.fill(); line("#fff", 2.5);
  pen.restore();
  const left = at[0] > canvas.clientWidth / 2 ? -18 : 18, [gx, gy] = ground(at);
  label(`${Math.round(Math.hypot(place[0] - gx, place[1] - gy))} m`, [at[0] + left, at[1]], "#10151b", left < 0 ? "right" : "left", 14, true);
}

// The plan of the chosen robot, its first stops with numbers; of the others the next stop only.
function planLayer(robot, place, stops, colour) {
  const mine = robot === shownRobot || (sections.robots ?? []).length < 2, near = stops.slice(0, mine ? NEAR : 1);
  if (mine && stops.length > NEAR) {
    path(stops.slice(NEAR - 1), false); line("#ffffff90", 3); line(`${colour}80`, 1.2, [3, 5]);
    for (const stop of stops.slice(NEAR)) disc(stop, 3.5, colour);
  }
  path(place ? [place, ...near] : near, false); line("#fff", 4); line(colour, 2.2, [7, 5]);
  [...near.entries()].reverse().forEach(([number, stop]) => {
    disc(stop, number ? 9 : 12, colour);
    label(String(number + 1), pixel(stop), "#fff", "center", 12);
  });
}

function robotLayer(robot) {
  const several = (sections.robots ?? []).length > 1, colour = colourOf(robot);
  const trail = sections[`trail/${robot}`];
  if (trail?.length > 1) { path(trail, false); line("#ffffffb0", 4); line(several ? colour : "#0b3d66", 1.8); }
  const place = sections[`place/${robot}`], plan = sections[`plan/${robot}`] ?? [], mission = sections[`mission/${robot}`];
  if (plan.length) {
    planLayer(robot, place, plan, several ? colour : "#b34700");
    const dwell = mission?.planned_dwell_s;
    if (dwell) label(`${dwell} s`, pixel(plan[0]).map((v, axis) => v + (axis ? -18 : 0)), "#10151b", "center", 13, true);
  }
  if (!place) return;
  const [x, y] = pixel(place);
  if (place[3] > 0) { pen.beginPath(); pen.arc(x, y, Math.max(place[3] * view.scale, 1), 0, 7); pen.fillStyle = "#a8001830"; pen.fill(); }
  pen.save(); pen.translate(x, y);
  if (place[2] === null) { pen.beginPath(); pen.arc(0, 0, 10, 0, 7); }
  else { pen.rotate((place[2] * Math.PI) / 180); pen.beginPath(); pen.moveTo(0, -16); pen.lineTo(11, 12); pen.lineTo(0, 6); pen.lineTo(-11, 12); pen.closePath(); }
  pen.fillStyle = colour; pen.fill(); line("#fff", 2.5);
  pen.restore();
  if (robot) label(robot.replace("_", " "), [x, y + 26], "#10151b", "center", 13, true);
}

function label(text, [x, y], colour, align, size, paper = false) {
  pen.font = `700 ${size}px system-ui, sans-serif`; pen.textAlign = align; pen.textBaseline = "middle";
  if (paper) { pen.lineWidth = 4; pen.strokeStyle = "#fff"; pen.strokeText(text, x, y); }
  pen.fillStyle = colour; pen.fillText(text, x, y);
}

function cross([x, y], colour = "#10151b") {
  pen.beginPath(); pen.moveTo(x - 16, y); pen.lineTo(x + 16, y); pen.moveTo(x, y - 16); pen.lineTo(x, y + 16);
  line("#fff", 6); line(colour, 3);
}

function scaleBar(width, height) {
  const rough = 90 / view.scale, power = 10 ** Math.floor(Math.log10(rough));
  const length = [1, 2, 5, 10].map((n) => n * power).filter((n) => n <= rough * 1.2).pop() ?? power;
  // On a phone the buttons are above the right corner.
  const left = width < 500 ? 14 : width - 14 - length * view.scale, right = left + length * view.scale, y = height - 14;
  pen.beginPath(); pen.moveTo(left, y - 6); pen.lineTo(left, y); pen.lineTo(right, y); pen.lineTo(right, y - 6);
  line("#fff", 5); line("#10151b", 2);
  label(`${length} m`, [(left + right) / 2, y - 12], "#10151b", "center", 13, true);
}

// Fingers, mouse, keys ------------------------------------------------------------------------------------------------

const inside = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, inside(event));
  if (pointers.size === 1) moved = 0;
});
canvas.addEventListener("pointermove", (event) => {
  const before = pointers.get(event.pointerId);
  if (!before) return;
  const now = inside(event), other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
  moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
  if (other) {
    const factor = Math.hypot(now[0] - other[0], now[1] - other[1]) / (Math.hypot(before[0] - other[0], before[1] - other[1]) || 1);
    moved = 99;
    zoom(factor, [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2]);
  } else if (moved > 8) {
    view.x -= (now[0] - before[0]) / view.scale; view.y += (now[1] - before[1]) / view.scale; view.moved = true;
    draw();
  }
  pointers.set(event.pointerId, now);
});
for (const kind of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(kind, (event) => {
    if (kind === "pointerup" && pointers.size === 1 && moved <= 8) onChoose(ground(inside(event)));
    pointers.delete(event.pointerId);
  });
}
canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(event.deltaY < 0 ? 1.2 : 1 / 1.2, inside(event)); }, { passive: false });
canvas.addEventListener("keydown", (event) => {
  const step = 40 / view.scale, moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
  if (moves[event.key]) { view.x += moves[event.key][0]; view.y += moves[event.key][1]; view.moved = true; draw(); }
  else if (event.key === "+") zoom(1.25);
  else if (event.key === "-") zoom(0.8);
  else if (event.key === "Enter") onChoose([view.x, view.y]);
  else return;
  event.preventDefault();
});
for (const kind of ["focus", "blur"]) canvas.addEventListener(kind, draw);
new ResizeObserver(() => { view.fitted = false; draw(); }).observe(canvas);
