// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// Is everything ready? Each check has a level, what was heard, and what to do.

import { fixed, said, t } from "./texts.js";
import { clockOffS, lost, nowS, sections } from "./link.js";

const SILENT_S = 10, CLOCK_S = 5, FAR_M = 500, LOW_PERCENT = 40, EMPTY_PERCENT = 15;
// What a mission needs: the parts of health that say so.
const CHECKS = [
  ["sensor", /(^|sensor_driver: )(logger link|records)$/], ["gnss", /(^|sensor_driver: )GNSS/], ["planner", /(^|planner: )(guard|frames|position)$/],
  ["navigation", /(^|planner: )navigation$/], ["map", /mapper: |^map$/], ["disk", /recorder: |^bag$/],
];

function battery(robot) {
  const known = sections[`battery/${robot}`], heard = sections.heard?.[`battery/${robot}`];
  if (!known || heard === undefined) return [1, t("not_known"), t("battery_absent")];
  if (nowS() - heard > 6 * SILENT_S) return [1, t("not_heard_now"), t("look_at_robot")];
  const text = [known.charge === null ? "" : `${known.charge} %`, known.voltage === null ? "" : `${fixed(known.voltage, 1)} V`].filter(Boolean).join(", ");
  if (known.charge === null) return [text ? 0 : 1, text || t("not_known"), t("look_at_robot")];
  return [known.charge < EMPTY_PERCENT ? 2 : known.charge < LOW_PERCENT ? 1 : 0, text, t("battery_low")];
}

function datum(robot) {
  const place = sections[`place/${robot}`], border = sections.field?.boundary;
  if (!place || !border) return [1, t("datum_unknown"), t("datum_wait")];
  const [x, y] = place, middle = [0, 1].map((axis) => border.reduce((sum, corner) => sum + corner[axis], 0) / border.length);
  const size = Math.max(...border.map((corner) => Math.hypot(corner[0] - middle[0], corner[1] - middle[1])));
  const away = Math.hypot(x - middle[0], y - middle[1]) - size;
  if (away > FAR_M) return [2, t("datum_far", { m: Math.round(away) }), t("datum_check")];
  return [0, t("datum_well"), ""];
}

function clock() {
  if (clockOffS === null) return [1, t("not_known"), t("reload_page")];
  const off = Math.abs(Math.round(clockOffS));
  if (Math.abs(clockOffS) <= CLOCK_S) return [0, t("clock_well"), ""];
  return [1, t(clockOffS > 0 ? "clock_ahead" : "clock_behind", { s: off }), t("clock_set")];
}

// [name, level, what, remedy], for a robot. Without a link nothing is known to be ready.
export function checks(robot) {
  const found = heardChecks(robot);
  return lost() ? found.map(([name, , text]) => [name, 3, t("check_unlinked", { text }), ""]) : found;
}

function heardChecks(robot) {
  const parts = sections.health ?? [], guided = sections[`mission/${robot}`]?.guided;
  const rows = CHECKS.filter(([key]) => !guided || key !== "navigation").map(([key, pattern]) => {
    const name = t(`check_${key}`);
    const mine = parts.filter((part) => pattern.test(part.name));
    if (!mine.length) return [name, 2, t("not_heard"), t(`check_${key}_absent`)];
    const worst = mine.reduce((one, other) => (other.level > one.level ? other : one));
    return [name, worst.level, said(worst.message), t(`check_${key}_remedy`)];
  });
  const heard = sections.heard?.[`mission/${robot}`];
  if (heard === undefined || nowS() - heard > SILENT_S) rows.unshift([t("check_link"), sections[`mission/${robot}`]?.phase === "finished" ? 3 : 2, t("planner_not_heard"), t("check_link_remedy")]);
  if (!guided) rows.push([t("check_battery"), ...battery(robot)]);
  rows.push([t("check_clock"), ...clock()], [t("check_datum"), ...datum(robot)]);
  return rows;
}
