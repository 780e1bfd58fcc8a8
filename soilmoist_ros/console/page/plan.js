// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// Plan: is everything ready, what is known before, and what is the next mission?

import { said, t } from "./texts.js";
import { sections, who } from "./link.js";
import { checks } from "./checks.js";
import { fieldFile, fieldIsUsed, renderFiles, renderOutline, startOutline } from "./outline.js";
import { $, button, element, fill, setText, slide } from "./widgets.js";

export { addCorner, drawingBar } from "./outline.js";

const DWELLS = { optimal: null, fmi: "60", ami: "3" };  // amounts to begin with
let page = null, files = null, runs = null, touched = new Set(), earlier = null;  // names of runs that are chosen; null: as they are

const value = (name) => $(`plan-${name}`).value.trim();
const number = (name) => Number(value(name) || 0);
const settings = () => page.mission()?.settings ?? {};
const ofMoisture = () => (settings().targets ?? ["vwc"]).includes("vwc") && (value("target") || settings().target || "rate") !== "rate";

function dwellText() {
  if (value("dwell") === "optimal") return "optimal";
  return value("dwell") === "fmi" ? `fmi:${number("dwell-by")}` : `ami:${number("dwell-by")}%`;
}

// What is changed with "change": what differs from what the planner has.
function changes() {
  const now = settings(), good = number("good") / 100;
  const all = { hours: number("hours"), strategy: value("strategy"), dwell: dwellText(), target: value("target"), until_sd: good };
  const same = (name, one) => (name === "dwell" ? sameDwell(one, now.dwell) : typeof one === "number" ? Math.abs(one - now[name]) < 1e-9 : one === now[name]);
  return Object.fromEntries(Object.entries(all).filter(([name, one]) => !same(name, one)));
}

function sameDwell(one, other) {
  if (one === other) return true;
  const parts = [one, other].map((text) => /^(\w+):([\d.]+)(%?)$/.exec(text ?? ""));
  return Boolean(parts[0] && parts[1]) && parts[0][1] === parts[1][1] && Math.abs(parts[0][2] / (parts[0][3] ? 100 : 1) - parts[1][2] / (parts[1][3] ? 100 : 1)) < 1e-9;
}

// Tell the planners the plan; whether they accept it.
async function use() {
  const own = changes(), survey = {};
  const file = await fieldFile();
  if (file === null) return false;
  if (file) survey.field = file;
  if (earlier !== null) survey.earlier = [...earlier];
  const shared = Object.keys(survey).length > 0;
  if (shared) page.notice(t("opens_field"));
  for (const robot of shared ? sections.robots : []) {
    if (!(await page.ask("change", robot === page.robot() ? { ...own, ...survey } : survey, robot))) return false;
  }
  if (!shared && Object.keys(own).length && !(await page.ask("change", own))) return false;
  if (shared) { fieldIsUsed(); earlier = null; }
  touched = new Set();
  if (!shared && !Object.keys(own).length) page.notice(t("has_plan"));
  return true;
}

// Knowledge from before -------------------------------------------------------------------------------------------------

export async function showChoices() {
  const get = async (path) => { try { return await (await fetch(path, { cache: "no-store" })).json(); } catch { return null; } };
  [files, runs] = await Promise.all([get("files"), get("runs")]);
  page.render();
}

// From the page Results: the next mission begins with what these runs know.
export function know(names) { earlier = new Set(names); page.render(); }

function renderKnown() {
  const usable = (runs?.runs ?? []).filter((run) => run.finished), now = settings().earlier, chosen = earlier ?? new Set(now ?? []);
  fill("earlier", [usable, [...chosen], page.maySteer()], () => usable.map((run, index) => {
    const box = element("input", { type: "checkbox", id: `earlier-${index}` });
    box.checked = chosen.has(run.name);
    box.disabled = !page.maySteer();
    box.addEventListener("change", () => { earlier = new Set(chosen); earlier[box.checked ? "add" : "delete"](run.name); page.render(); });
    const facts = [run.field, run.start ? run.start.slice(0, 10) : "", run.stops ? t("n_stops", { n: run.stops }) : ""].filter(Boolean).join(" · ");
    return element("li", {}, box, element("label", { for: box.id }, run.name, element("span", {}, facts)));
  }));
  const said = now === undefined && earlier === null ? t("known_as_started") : [...chosen].join(", ") || t("none");
  setText("known-about", `${t("earlier")}: ${said}. ${earlier === null ? "" : t("known_use")}`.trim());
  setText("known-none", usable.length ? "" : t("known_no_runs", { folder: runs?.folder ?? "runs" }));
}

// The form ----------------------------------------------------------------------------------------------

function input(name, text, attributes) {
  const node = element("input", { id: `plan-${name}`, type: "number", ...attributes });
  return [element("label", { for: node.id }, text), node];
}

function choice(name, text, options) {
  const node = element("select", { id: `plan-${name}` }, ...options.map(([key, label]) => element("option", { value: key }, label)));
  return [element("label", { for: node.id }, text), node, element("p", { class: "small", id: `plan-${name}-about` })];
}

function makeForm() {
  const part = (id, ...nodes) => element("div", { id, class: "grid" }, ...nodes);
  $("plan-form").append(
    ...input("hours", t("plan_hours"), { step: "0.1", min: "0.1", value: "2", required: true }),
    ...choice("strategy", t("strategy"), []),
    ...choice("dwell", t("dwell"), Object.keys(DWELLS).map((key) => [key, t(`dwell_${key}`)])),
    part("plan-dwell-part", ...input("dwell-by", "", { step: "any", min: "0.1" })),
    ...choice("target", t("target"), []),
    element("details", {}, element("summary", {}, t("plan_more")),
      part("plan-more",
        ...input("good", "", { step: "any", min: "0", placeholder: t("never") }))));
}

// With another target the number would mean something else; the planner's own has that of the planner.
function otherTarget() {
  $("plan-good").value = "";
  touched[value("target") === settings().target ? "delete" : "add"]("good");
}

// The form begins with what the planner has; what an operator has typed stays.
function prefill() {
  const now = settings();
  fill("plan-strategy", sections.choices?.strategies ?? [], () => (sections.choices?.strategies ?? []).map(([key, label], index) => element("option", { value: key }, index ? said(label) : t("recommended", { label: said(label) }))));
  if (now.hours === undefined) return;
  fill("plan-target", now.targets ?? ["rate"], () => (now.targets ?? ["rate"]).map((key) => element("option", { value: key }, t(`target_${key}`))));
  const [kind, amount] = now.dwell.split(":");
  const given = { hours: now.hours, strategy: now.strategy, target: now.target, dwell: kind, good: +(100 * now.until_sd).toPrecision(6) || "" };
  if (amount) given["dwell-by"] = kind === "ami" ? +(100 * amount).toPrecision(6) : amount;
  for (const [name, one] of Object.entries(given)) {
    const node = $(`plan-${name}`);
    if (!touched.has(name) && document.activeElement !== node && node.value !== String(one)) node.value = one;
  }
}

function renderForm() {
  prefill();
  const about = (sections.choices?.strategies ?? []).find(([key]) => key === value("strategy"));
  setText("plan-strategy-about", said(about?.[2] ?? ""));
  const amount = DWELLS[value("dwell")];
  setText("plan-dwell-about", amount ? "" : t("dwell_optimal_about"));
  $("plan-dwell-part").hidden = !amount;
  if (amount) setText(document.querySelector("label[for=plan-dwell-by]"), t(`dwell_by_${value("dwell")}`));
  if (amount && !value("dwell-by")) $("plan-dwell-by").value = amount;
  setText(document.querySelector("label[for=plan-good]"), t(ofMoisture() ? "plan_good_vwc" : "plan_good_rate"));
}

export function renderPlan() {
  const rows = checks(page.robot()), may = page.maySteer(), now = page.mission(), bad = rows.filter(([, level]) => level > 0).length;
  setText("checks-about", bad ? t("checks_bad", { n: bad, all: rows.length }) : t("checks_good", { n: rows.length }));
  fill("checks", rows, () => rows.map(([name, level, text, remedy]) => element("li", { "data-level": level }, element("b", {}, `${name}: `), text, ...(level && remedy ? [element("span", { class: "remedy" }, t("to_do", { remedy }))] : []))));
  renderOutline();
  renderFiles(files);
  renderKnown();
  renderForm();
  const running = now?.running ?? null;
  fill("plan-start", [may, running, now?.ready === false && now.reason], () => {
    if (!may || !now) return [];
    if (running) return [element("p", {}, t("plan_running")), button(t("plan_change"), use)];
    return [slide(t("plan_start"), async () => { if (await use() && await page.ask("start")) page.open("survey"); }, "", now.ready === false ? said(now.reason) : ""), button(t("plan_keep"), use)];
  });
}

export function startPlan(given) {
  page = { ...given, who };
  makeForm();
  startOutline(page);
  $("plan-form").addEventListener("submit", (event) => event.preventDefault());
  $("plan-form").addEventListener("input", (event) => { const name = event.target.id.replace("plan-", ""); touched.add(name); if (name === "dwell") $("plan-dwell-by").value = ""; if (name === "target") otherTarget(); page.render(); });
  $("plan-form").addEventListener("change", () => page.render());
}
