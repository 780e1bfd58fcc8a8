// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// The field that is planned for: drawn on the map, read from a file, walked with the robot, or chosen from the saved ones.

import { request, sections } from "./link.js";
import { draft, draw } from "./map.js";
import { $, button, element, fill, setText } from "./widgets.js";

const MAX_FILE = 2_000_000;
let page = null, area = null, saved = "", before = {};  // saved: the file that was chosen from the list, or made of what is drawn

export const drawn = () => draft.boundary.length > 2 && draft.drawing !== draft.boundary;
export const hasDraft = () => drawn() || draft.areas.some((one) => one.length > 2 && one !== draft.drawing);
const walk = () => sections[`walk/${page.robot()}`];

export function field() {
  const own = sections.field;
  const areas = draft.areas.filter((one) => one.length > 2);
  return {
    name: drawn() ? "drawn field" : own.name, datum: own.datum,
    boundary: drawn() ? draft.boundary : own.boundary, no_go: [...(drawn() ? [] : own.no_go), ...areas],
  };
}

// Name of the file for the next mission, which is saved first if it is drawn; "" for the present field, null if it is refused.
export async function fieldFile() {
  if (!hasDraft()) return saved;
  const answer = await request("field", { ...field(), who: page.who() });
  if (answer.error) { page.notice(answer.error, true); return null; }
  return answer.file;
}

export function fieldIsUsed() {
  Object.assign(draft, { boundary: [], areas: [], drawing: null });
  saved = "";
  $("field-file").value = "";
  changed();
}

export function addCorner([x, y]) {
  if (!draft.drawing) { page.notice("Choose what to draw first: boundary or no-go area."); return; }
  draft.drawing.push([Math.round(x * 100) / 100, Math.round(y * 100) / 100]);
  changed();
}

function begin(kind) {
  before = { boundary: draft.boundary, areas: [...draft.areas] };
  draft.drawing = [];
  if (kind === "boundary") draft.boundary = draft.drawing; else draft.areas.push(draft.drawing);
  changed();
}

// What the map shows while corners are tapped: a text and buttons.
export function drawingBar() {
  const count = draft.drawing.length, few = count < 3 ? `${3 - count} more` : "";
  return [`Tap the corners of the ${draft.drawing === draft.boundary ? "boundary" : "no-go area"}, in order: ${count} so far.`,
    button("Undo", () => { draft.drawing.pop(); changed(); }, "", count ? "" : "no corner"),
    button("Cancel", () => { Object.assign(draft, before, { drawing: null }); changed(); }), button("Done", done, "primary", few)];
}

function changed() { area = null; page.changed(); draw(); page.render(); }

async function done() {
  draft.drawing = null;
  draft.areas = draft.areas.filter((one) => one.length > 2);
  if (draft.boundary.length < 3) draft.boundary = [];
  changed();
  if (!hasDraft()) return;
  const asked = JSON.stringify(field()), answer = await request("plan", { task: "field", ...field() });
  if (JSON.stringify(field()) !== asked) return;  // it was drawn anew meanwhile
  if (answer.error) page.notice(answer.error, true);
  else { area = answer.area_m2; page.render(); if (answer.note) page.notice(answer.note); }
}

function take(ring, isArea, more = []) {
  if (isArea) draft.areas.push(ring);
  else Object.assign(draft, { boundary: ring, areas: more });
  return done();
}

export function save(name, text) {
  const link = element("a", { href: URL.createObjectURL(new Blob([text], { type: "text/yaml" })), download: name });
  link.click();
  URL.revokeObjectURL(link.href);
}

async function download() {
  const answer = await request("plan", { task: "field", ...field() });
  if (answer.error) page.notice(answer.error, true); else save("field.yaml", answer.file);
}

async function read(file) {
  if (file.size > MAX_FILE) { page.notice(`The file has ${(file.size / 1e6).toFixed(1)} MB; 2 MB are read at most. Export the boundary alone.`, true); return; }
  const content = await new Promise((resolve) => { const reader = new FileReader(); reader.onload = () => resolve(reader.result.split(",")[1] ?? ""); reader.readAsDataURL(file); });
  const answer = await request("plan", { task: "outline", name: file.name, content, datum: sections.field?.datum });
  if (answer.error) { page.notice(answer.error, true); return; }
  await take(answer.boundary, false, answer.no_go);
  if (answer.note) page.notice(answer.note);
}

async function ruleOut() {
  for (const polygon of draft.areas.filter((one) => one.length > 2)) if (!(await page.ruleOut(polygon))) return;
  draft.areas = [];
  changed();
}

// A walk is recorded by the console, so that a phone may sleep meanwhile.
async function beginWalk(kind) {
  const answer = await request("walk", { robot: page.robot(), do: "begin", kind, who: page.who() });
  if (answer.error) page.notice(answer.error, true);
}

async function endWalk(keep) {
  const answer = await request("walk", { robot: page.robot(), do: "end" });
  if (answer.error) { page.notice(answer.error, true); return; }
  if (!keep) return;
  const ring = await request("plan", { task: "walk", places: answer.places ?? [], sd: answer.sd });
  if (ring.error) { page.notice(ring.error, true); return; }
  await take(ring.ring, answer.kind === "area");
  page.notice(`${ring.ring.length} corners from ${answer.count} places. Receiver ${accuracy(ring.sd)}; corners within ${ring.tolerance_m.toFixed(1)} m of the walk; its ends, ${ring.gap_m} m apart, are joined.`, false, 20000);
}

const accuracy = (sd) => (sd === null || sd === undefined ? "of unknown accuracy" : `± ${sd.toFixed(2)} m at worst`);

function about(kind) {
  const now = walk();
  if (now) return `${now.who || "Somebody"} walks the ${now.kind === "area" ? "no-go area" : "boundary"} with the robot: ${now.count} places, receiver ${accuracy(now.sd)}.`;
  if (kind) return "";
  if (!hasDraft()) return "The next mission explores this field. Draw, walk or import another one, or add no-go areas.";
  const count = field().no_go.length, size = area ? `, ${(area / 10000).toFixed(2)} ha` : "";
  return `Drawn: ${drawn() ? "a boundary" : "the present boundary"} with ${count} no-go area${count === 1 ? "" : "s"}${size}. Start with this plan to use it.`;
}

export function renderOutline() {
  const may = page.maySteer(), now = walk(), kind = draft.drawing === null ? "" : draft.drawing === draft.boundary ? "boundary" : "area";
  const running = page.mission()?.running ?? false;
  setText("draft-about", about(kind));
  $("import-part").hidden = !may;
  fill("drawing", [kind, draft.drawing?.length ?? 0, hasDraft(), draft.areas.length, may, Boolean(now), running], () => {
    if (!may) return [];
    const row = (...nodes) => element("div", { class: "buttons" }, ...nodes);
    if (now) return [row(button("Finish the walk", () => endWalk(true), "primary"), button("Discard it", () => endWalk(false)))];
    if (kind) return [];
    const nodes = [
      row(button("Draw boundary", () => begin("boundary")), button("Draw no-go area", () => begin("area"))),
      row(button("Walk boundary", () => beginWalk("boundary")), button("Walk no-go area", () => beginWalk("area"))),
    ];
    if (hasDraft()) nodes.push(row(button("Download field file", download), button("Clear", () => { Object.assign(draft, { boundary: [], areas: [], drawing: null }); changed(); })));
    if (draft.areas.length && running) nodes.push(button("Rule these areas out now", ruleOut));
    return nodes;
  });
}

export function renderFiles(files) {
  const now = page.mission()?.settings?.field;
  const names = ["(start)", ...(files?.fields ?? [])];
  fill("field-file", [names, now, sections.field?.name], () => [
    element("option", { value: "" }, `As it is: ${sections.field?.name ?? ""}`),
    ...names.map((name) => element("option", { value: name, selected: name === saved }, name === "(start)" ? "The field of the start" : name.replace(/\.yaml$/, "")))]);
}

export function startOutline(given) {
  page = given;
  $("import").addEventListener("change", async (event) => { const [file] = event.target.files; event.target.value = ""; if (file) await read(file); });
  $("field-file").addEventListener("change", (event) => { saved = event.target.value; page.changed(); page.render(); });
}
