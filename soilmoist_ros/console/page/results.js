// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// Results: the surveys on the robot's computer, their reports and files, and two of them compared.

import { fixed, said, t } from "./texts.js";
import { request, sections } from "./link.js";
import { $, button, duration, element, fill, metres, setText } from "./widgets.js";

const SHOWN_FILES = 12;
let page = null, list = null, chosen = new Set(), jobsDone = 0;

export async function showRuns() {
  try {
    list = await (await fetch("runs", { cache: "no-store" })).json();
  } catch {
    list = null;
    page.notice(t("no_answer"), true);
  }
  renderResults();
}

// Name and address of the report of a mission that ended at a time [s since 1970]; null if it is not made yet.
export async function reportSince(endS) {
  try {
    const [run] = (await (await fetch("runs", { cache: "no-store" })).json()).runs;  // the latest; "changed" has minutes
    return run?.report && Date.parse(run.changed) / 1000 + 60 >= endS ? [run.name, address(run.name, "report.html")] : null;
  } catch {
    return null;
  }
}

async function make(what, runs, more = {}) {
  const answer = await request("make", { what, runs, ...more });
  page.notice(said(answer.error ?? answer.message), Boolean(answer.error) || !answer.started);
}

const address = (run, file) => `runs/${encodeURIComponent(run)}/${file.split("/").map(encodeURIComponent).join("/")}`;
const size = (bytes) => (bytes < 1e6 ? `${Math.max(1, Math.round(bytes / 1000))} kB` : `${fixed(bytes / 1e6, 1)} MB`);

function card(run) {
  const box = element("input", { type: "checkbox", id: `choose-${run.name}` });
  box.checked = chosen.has(run.name);
  box.addEventListener("change", () => { chosen[box.checked ? "add" : "delete"](run.name); renderResults(); });
  const facts = [
    run.field, run.simulated ? t("simulated") : "", run.start ? run.start.replace("T", " ").replace(/:\d\dZ$/, " UTC") : t("changed_at", { at: run.changed.replace("T", " ").replace("+00:00", " UTC") }),
    run.duration_s ? duration(run.duration_s) : "", run.stops ? t("n_stops", { n: run.stops }) : "", run.distance_m ? metres(Math.round(run.distance_m)) : "",
    run.vwc ? t("mean_moisture", { vwc: fixed(100 * run.vwc, 1) }) : "",
  ].filter(Boolean).join(" · ");
  const row = ([name, bytes]) => element("li", {}, element("a", { href: address(run.name, name), download: true }, name), ` ${size(bytes)}`);
  const files = run.files.filter(([name]) => name !== "report.html" && !name.startsWith("configuration/"));
  const actions = element("div", { class: "grid" });
  if (run.report) actions.append(element("a", { class: "button", href: address(run.name, "report.html"), target: "_blank", rel: "noopener" }, t("open_map_page")));
  else if (run.recording && page.maySteer()) actions.append(button(t("make_report"), () => make("report", [run.name]), "primary"));
  if (run.report && page.maySteer()) {
    const format = element("select", { id: `format-${run.name}` }, ...list.formats.map((one) => element("option", { value: one }, one)));
    actions.append(element("label", { for: format.id }, t("export_for")), element("div", { class: "buttons" }, format, button(t("export"), () => make("export", [run.name], { formats: [format.value] }))));
  }
  const more = files.length > SHOWN_FILES ? [element("p", { class: "small" }, t("more_files", { n: files.length - SHOWN_FILES }))] : [];
  return element("article", { class: "card" },
    element("div", { class: "choose" }, box, element("label", { for: box.id }, element("h2", {}, run.name))),
    element("p", {}, facts), actions,
    element("details", {}, element("summary", {}, t("files", { count: files.length })), element("ul", {}, ...files.slice(0, SHOWN_FILES).map(row)), ...more));
}

export function renderResults() {
  const runs = list?.runs ?? [];
  chosen = new Set([...chosen].filter((name) => runs.some((run) => run.name === name)));
  setText("runs-about", list ? t("runs_about", { n: runs.length, folder: list.folder }) : "…");
  fill("runs-actions", [[...chosen], page.maySteer()], () => {
    const names = [...chosen];
    if (!names.length) return [];
    const nodes = [element("p", { class: "small" }, t("for_tools", { runs: names.map((name) => `${list.folder}/${name}`).join(", ") }))];
    if (page.maySteer()) nodes.unshift(button(t("know", { n: names.length }), () => page.know(names)));
    if (names.length > 1 && page.maySteer()) nodes.unshift(button(t("compare", { n: names.length }), () => make("compare", names), "primary"));
    return nodes;
  });
  const jobs = Object.entries(sections.jobs ?? {});
  fill("jobs", jobs, () => jobs.map(([name, job]) => element("li", { "data-level": job.state === "failed" ? 2 : 0 }, element("b", {}, `${said(name)}: `), job.state === "failed" ? said(job.text) : t(`job_${job.state}`))));
  const ended = jobs.filter(([, job]) => job.state === "done").length;
  if (ended > jobsDone) { jobsDone = ended; showRuns(); return; }
  jobsDone = ended;
  fill("runs", [list, page.maySteer()], () => runs.map(card));
}

export function startResults(given) {
  page = given;
  $("runs-reload").addEventListener("click", showRuns);
}
