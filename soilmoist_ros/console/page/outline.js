// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// The field that is planned for: drawn on the map, read from a file, walked with the robot, or chosen from the saved ones.

import { fixed, said, t } from "./texts.js";
import { request, sections } from "./link.js";
import { draft, draw } from "./map.js";
import { $, button, element, fill, setText } from "./widgets.js";

const MAX_FILE = 2_000_000;
let page = null, area = null, saved = "", before = {};  // saved: the file that was chosen from the list, or made of what is drawn

export const drawn = () => draft.boundary.length > 2 && draft.drawing !== draft.boundary;
export const areaDrawn = () => (drawn() ? area : null);  // without no-go areas [m2]; null while it is unknown or refused
const hasDraft = () => drawn() || draft.areas.some((one) => one.length > 2 && one !== draft.drawing);
export const walk = () => sections[`walk/${page.robot()}`];

function field() {
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
  if (answer.error) { page.notice(said(answer.error), true); return null; }
  return answer.file;
}

export function fieldIsUsed() {
  saved = "";
  $("field-file").value = "";
  clear();
}

export function addCorner([x, y]) {
  if (!draft.drawing) { page.notice(t("draw_what")); return; }
  draft.drawing.push([Math.round(x * 100) / 100, Math.round(y * 100) / 100]);
  changed();
}

export function begin(kind) {
  before = { boundary: draft.boundary, areas: [...draft.areas] };
  draft.drawing = [];
  if (kind === "boundary") draft.boundary = draft.drawing; else draft.areas.push(draft.drawing);
  changed();
}

// What the map shows while corners are tapped: a text and buttons.
export function drawingBar() {
  const count = draft.drawing.length, few = count < 3 ? t("corners_more", { n: 3 - count }) : "";
  return [t(draft.drawing === draft.boundary ? "tap_boundary" : "tap_area", { n: count }),
    button(t("undo"), () => { draft.drawing.pop(); changed(); }, "", count ? "" : t("no_corner")),
    button(t("cancel"), () => { Object.assign(draft, before, { drawing: null }); changed(); }), button(t("done"), done, "primary", few)];
}

export function clear() { Object.assign(draft, { boundary: [], areas: [], drawing: null }); changed(); }

function changed() { area = null; draw(); page.render(); }

async function done() {
  draft.drawing = null;
  draft.areas = draft.areas.filter((one) => one.length > 2);
  if (draft.boundary.length < 3) draft.boundary = [];
  changed();
  if (!hasDraft()) return;
  const asked = JSON.stringify(field()), answer = await request("plan", { task: "field", ...field() });
  if (JSON.stringify(field()) !== asked) return;  // it was drawn anew meanwhile
  if (answer.error) page.notice(said(answer.error), true);
  else { area = answer.area_m2; page.render(); if (answer.note) page.notice(said(answer.note)); }
}

function take(ring, isArea, more = []) {
  if (isArea) draft.areas.push(ring);
  else Object.assign(draft, { boundary: ring, areas: more });
  return done();
}

async function read(file) {
  if (file.size > MAX_FILE) { page.notice(t("file_too_large", { size: fixed(file.size / 1e6, 1) }), true); return; }
  const content = await new Promise((resolve) => { const reader = new FileReader(); reader.onload = () => resolve(reader.result.split(",")[1] ?? ""); reader.readAsDataURL(file); });
  const answer = await request("plan", { task: "outline", name: file.name, content, datum: sections.field?.datum });
  if (answer.error) { page.notice(said(answer.error), true); return; }
  await take(answer.boundary, false, answer.no_go);
  if (answer.note) page.notice(said(answer.note));
}

async function ruleOut() {
  for (const polygon of draft.areas.filter((one) => one.length > 2)) if (!(await page.ruleOut(polygon))) return;
  draft.areas = [];
  changed();
}

// A walk is recorded by the console, so that a phone may sleep meanwhile.
export async function beginWalk(kind) {
  const answer = await request("walk", { robot: page.robot(), do: "begin", kind, who: page.who() });
  if (answer.error) page.notice(said(answer.error), true);
}

export async function endWalk(keep) {
  const answer = await request("walk", { robot: page.robot(), do: "end" });
  if (answer.error) { page.notice(said(answer.error), true); return; }
  if (!keep) return;
  const ring = await request("plan", { task: "walk", places: answer.places ?? [], sd: answer.sd });
  if (ring.error) { page.notice(said(ring.error), true); return; }
  await take(ring.ring, answer.kind === "area");
  page.notice(t("walk_done", { n: ring.ring.length, places: answer.count, accuracy: accuracy(ring.sd), m: fixed(ring.tolerance_m, 1), gap: fixed(ring.gap_m, 1) }), false, 20000);
}

const accuracy = (sd) => (sd === null || sd === undefined ? t("accuracy_unknown") : t("accuracy", { m: fixed(sd, 2) }));

function about(kind) {
  const now = walk();
  if (now) return t(now.kind === "area" ? "walks_area" : "walks_boundary", { who: now.who || t("somebody"), n: now.count, accuracy: accuracy(now.sd) });
  if (kind) return "";
  if (!hasDraft()) return t("draft_none");
  const count = field().no_go.length, size = area ? `, ${fixed(area / 10000, 2)} ha` : "";
  return t(drawn() ? "draft_drawn" : "draft_present", { areas: t("n_areas", { n: count }), size });
}

export function renderOutline() {
  const may = page.maySteer(), now = walk(), kind = draft.drawing === null ? "" : draft.drawing === draft.boundary ? "boundary" : "area";
  const running = page.mission()?.running ?? false;
  setText("draft-about", about(kind));
  $("import-part").hidden = !may;
  fill("drawing", [kind, draft.drawing?.length ?? 0, hasDraft(), draft.areas.length, may, Boolean(now), running], () => {
    if (!may) return [];
    const row = (...nodes) => element("div", { class: "buttons" }, ...nodes);
    if (now) return [row(button(t("walk_finish"), () => endWalk(true), "primary"), button(t("walk_discard"), () => endWalk(false)))];
    if (kind) return [];
    const nodes = [
      row(button(t("draw_boundary"), () => begin("boundary")), button(t("draw_area"), () => begin("area"))),
      row(button(t("walk_boundary"), () => beginWalk("boundary")), button(t("walk_area"), () => beginWalk("area"))),
    ];
    if (hasDraft()) nodes.push(button(t("clear"), clear));
    if (draft.areas.length && running) nodes.push(button(t("rule_out_drawn"), ruleOut));
    return nodes;
  });
}

export function renderFiles(files) {
  const now = page.mission()?.settings?.field;
  const names = ["(start)", ...(files?.fields ?? [])];
  fill("field-file", [names, now, sections.field?.name], () => [
    element("option", { value: "" }, t("as_it_is", { name: sections.field?.name ?? "" })),
    ...names.map((name) => element("option", { value: name, selected: name === saved }, name === "(start)" ? t("field_of_start") : name.replace(/\.yaml$/, "")))]);
}

export function startOutline(given) {
  page = given;
  $("import").addEventListener("change", async (event) => { const [file] = event.target.files; event.target.value = ""; if (file) await read(file); });
  $("field-file").addEventListener("change", (event) => { saved = event.target.value; page.render(); });
}
