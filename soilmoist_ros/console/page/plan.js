// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// Plan: is everything ready, what is known before, and what will a mission of some hours bring?

import { fixed, language, said, t } from "./texts.js";
import { request, sections, who } from "./link.js";
import { chart } from "./chart.js";
import { checks } from "./checks.js";
import { field, fieldFile, fieldIsUsed, hasDraft, renderFiles, renderOutline, startOutline } from "./outline.js";
import { $, button, duration, element, fill, setText, slide } from "./widgets.js";

export { addCorner, drawingBar } from "./outline.js";

const DWELLS = { optimal: null, fmi: "60", ami: "3" };  // amounts to begin with
let page = null, busy = false, found = null, files = null, runs = null, touched = new Set();
const known = { earlier: null, covariates: null };  // names that are chosen; null: as they are

const value = (name) => $(`plan-${name}`).value.trim();
const number = (name) => Number(value(name) || 0);
const settings = () => page.mission()?.settings ?? {};
const ofMoisture = () => settings().target === "vwc";

function dwellText() {
  if (value("dwell") === "optimal") return "optimal";
  return value("dwell") === "fmi" ? `fmi:${number("dwell-by")}` : `ami:${number("dwell-by")}%`;
}

// A rule as the planner writes it, as a sentence.
export function dwellWords(text = "") {
  const [kind, amount] = text.split(":");
  if (kind === "fmi") return t("dwell_words_fmi", { n: Number(amount) });
  return kind === "ami" ? t("dwell_words_ami", { error: fixed(+(parseFloat(amount) * (text.endsWith("%") ? 1 : 100)).toPrecision(3), 1) }) : t("dwell_words_optimal");
}

// What is changed with "change": what differs from what the planner has.
function changes() {
  const now = settings(), good = number("good") / 100;
  const all = { hours: number("hours"), strategy: value("strategy"), dwell: dwellText(), until_sd: good, until_gain: number("gain") };
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
  for (const name of ["earlier", "covariates"]) if (known[name] !== null) survey[name] = [...known[name]];
  const shared = Object.keys(survey).length > 0;
  if (shared) page.notice(t("opens_field"));
  for (const robot of shared ? sections.robots : []) {
    if (!(await page.ask("change", robot === page.robot() ? { ...own, ...survey } : survey, robot))) return false;
  }
  if (!shared && Object.keys(own).length && !(await page.ask("change", own))) return false;
  if (shared) { fieldIsUsed(); Object.assign(known, { earlier: null, covariates: null }); }
  touched = new Set();
  if (!shared && !Object.keys(own).length) page.notice(t("has_plan"));
  return true;
}

async function forecast(event) {
  event.preventDefault();
  if (busy || !sections.field) return;
  busy = true;
  page.render();
  found = await request("plan", {
    task: "forecast", ...field(), hours: number("hours"), strategy: value("strategy"), dwell: dwellText(),
    until_sd: ofMoisture() ? 0 : number("good") / 100, until_gain: number("gain"),
    variation: number("variation") / 100, rate_cps: sections.map?.layers?.find((one) => one.key === "rate")?.mean,
  });
  busy = false;
  if (found.error) { page.notice(said(found.error), true); found = null; }
  page.render();
  if (found) $("forecast-part").scrollIntoView({ block: "nearest" });
}

// Knowledge from before -------------------------------------------------------------------------------------------------

export async function showChoices() {
  const get = async (path) => { try { return await (await fetch(path, { cache: "no-store" })).json(); } catch { return null; } };
  [files, runs] = await Promise.all([get("files"), get("runs")]);
  page.render();
}

// From the page Results: the next mission begins with what these runs know.
export function know(names) { known.earlier = new Set(names); page.render(); }

function choiceList(id, kind, names, facts) {
  const now = settings()[kind], chosen = known[kind] ?? new Set(now ?? []);
  fill(id, [names, [...chosen], page.maySteer(), facts], () => names.map((name, index) => {
    const box = element("input", { type: "checkbox", id: `${kind}-${index}` });
    box.checked = chosen.has(name);
    box.disabled = !page.maySteer();
    box.addEventListener("change", () => { const next = new Set(chosen); next[box.checked ? "add" : "delete"](name); known[kind] = next; page.render(); });
    return element("li", {}, box, element("label", { for: box.id }, name, element("span", {}, facts[index])));
  }));
}

function renderKnown() {
  const usable = (runs?.runs ?? []).filter((run) => run.finished);
  choiceList("earlier", "earlier", usable.map((run) => run.name), usable.map((run) => [run.field, run.start ? run.start.slice(0, 10) : "", run.stops ? t("n_stops", { n: run.stops }) : ""].filter(Boolean).join(" · ")));
  choiceList("covariates", "covariates", files?.covariates ?? [], (files?.covariates ?? []).map(() => ""));
  const names = (kind) => (known[kind] === null ? settings()[kind] : [...known[kind]]);
  const say = (kind) => (names(kind) === undefined ? t("known_as_started") : names(kind).join(", ") || t("none"));
  const more = known.earlier !== null || known.covariates !== null ? t("known_use") : "";
  setText("known-about", `${t("earlier")}: ${say("earlier")}. ${t("covariates")}: ${say("covariates")}. ${more}`.trim());
  setText("known-none", [usable.length ? "" : t("known_no_runs", { folder: runs?.folder ?? "runs" }), files?.covariates?.length ? "" : t("known_no_covariates", { folder: files?.covariates_folder ?? "covariates" })].filter(Boolean).join(" "));
}

// The form and the forecast ----------------------------------------------------------------------------------------------

function input(name, text, attributes, hint = "") {
  const node = element("input", { id: `plan-${name}`, type: "number", ...attributes });
  return [element("label", { for: node.id }, text), node, ...(hint ? [element("p", { class: "small", id: `plan-${name}-hint` }, hint)] : [])];
}

function choice(name, text, options) {
  const node = element("select", { id: `plan-${name}` }, ...options.map(([key, label]) => element("option", { value: key }, label)));
  return [element("label", { for: node.id }, text), node, element("p", { class: "small", id: `plan-${name}-about` })];
}

function makeForm() {
  const part = (id, ...nodes) => element("div", { id, class: "grid" }, ...nodes);
  $("plan-form").append(
    ...input("hours", t("plan_hours"), { step: "0.1", min: "0.1", max: "12", value: "2", required: true }),
    ...choice("strategy", t("strategy"), []),
    ...choice("dwell", t("dwell"), Object.keys(DWELLS).map((key) => [key, t(`dwell_${key}`)])),
    part("plan-dwell-part", ...input("dwell-by", "", { step: "any", min: "0.1" })),
    element("details", {}, element("summary", {}, t("plan_more")),
      part("plan-more",
        ...input("good", "", { step: "any", min: "0", placeholder: t("never") }),
        ...input("gain", t("plan_gain"), { step: "any", min: "0", placeholder: t("never") }))),
    ...input("variation", t("plan_variation"), { step: "1", min: "1", max: "100", value: "12" }),
    ...input("wanted", t("plan_wanted"), { step: "0.1", min: "0.1", value: "5" }),
    element("button", { type: "submit", id: "plan-run", class: "primary" }, t("try")));
}

// The form begins with what the planner has; what an operator has typed stays.
function prefill() {
  const now = settings();
  fill("plan-strategy", sections.choices?.strategies ?? [], () => (sections.choices?.strategies ?? []).map(([key, label], index) => element("option", { value: key }, index ? said(label) : t("recommended", { label: said(label) }))));
  if (now.hours === undefined) return;
  const [kind, amount] = now.dwell.split(":");
  const given = { hours: now.hours, strategy: now.strategy, dwell: kind, good: +(100 * now.until_sd).toPrecision(6) || "", gain: now.until_gain || "" };
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
  $("plan-run").disabled = busy || !may;
  $("plan-run").textContent = busy ? t("simulating") : may ? t("try") : `${t("try")}: ${t("only_holder")}`;
  $("forecast-part").hidden = !found;
  if (found) showForecast();
  const running = now?.running ?? null;
  fill("plan-start", [may, running, now?.ready === false && now.reason], () => {
    if (!may || !now) return [];
    if (running) return [element("p", {}, t("plan_running")), button(t("plan_change"), use)];
    return [slide(t("plan_start"), async () => { if (await use() && await page.ask("start")) page.open("survey"); }, "", now.ready === false ? said(now.reason) : ""), button(t("plan_keep"), use)];
  });
}

// When the error falls to what is wanted [s], and whether that is beyond the simulated time.
function needed(wanted) {
  const points = found.points.map(([s, e]) => [s, 100 * e]).filter(([s]) => s > 0);
  const reached = points.findLastIndex(([, e]) => e > wanted) + 1;  // it stays below from then on
  if (reached < points.length) return [points[reached][0], false];
  const late = points.slice(-Math.ceil(points.length / 3)), end = late.at(-1);
  if (late.length < 3) return [null, true];
  const slope = Math.log(end[1] / late[0][1]) / Math.log(end[0] / late[0][0]);  // a power of time
  const s = end[0] * (wanted / end[1]) ** (1 / slope);
  return slope < -0.05 && s < 4 * end[0] ? [s, true] : [null, true];
}

function showForecast() {
  const wanted = number("wanted"), end = found.points.at(-1);
  if (!end) { setText("forecast-text", t("too_short")); $("forecast-figures").hidden = true; fill("forecast-chart", [], () => []); return; }
  const [s, beyond] = needed(wanted);
  $("forecast-figures").hidden = false;
  setText("forecast-error", `± ${fixed(100 * end[1], 1)} %`); setText("forecast-stops", String(found.stops)); setText($("forecast-stops").nextElementSibling, t("stops", { n: found.stops }));
  setText("forecast-way", found.distance_m < 1000 ? `${found.distance_m} m` : `${fixed(found.distance_m / 1000, 1)} km`); setText("forecast-end", duration(found.ends_s));
  setText("forecast-text", t(s === null ? "wanted_never" : beyond ? "wanted_beyond" : "wanted_in", { error: wanted.toLocaleString(language), duration: duration(s) }));
  setText("forecast-note", t("forecast_note", { rate: found.rate_cps.toLocaleString(language), variation: Math.round(100 * found.variation) }));
  fill("forecast-chart", [found.points, wanted], () => chart(found.points.map(([t, e]) => [t / 3600, 100 * e]), wanted, beyond ? null : s / 3600));
  $("forecast-chart").setAttribute("aria-label", `${t("forecast_chart")}: ± ${fixed(100 * end[1], 1)} %, ${duration(end[0])}`);
}

export function startPlan(given) {
  page = { ...given, who, changed: () => { found = null; } };
  makeForm();
  startOutline(page);
  $("plan-form").addEventListener("submit", forecast);
  $("plan-form").addEventListener("input", (event) => { const name = event.target.id.replace("plan-", ""); touched.add(name); if (name !== "wanted") found = null; if (event.target.id === "plan-dwell") $("plan-dwell-by").value = ""; page.render(); });
  $("plan-form").addEventListener("change", () => page.render());
}
