// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// Is everything ready? Each check has a level, what was heard, and what to do.

import { clockOffS, lost, nowS, sections } from "./link.js";

const SILENT_S = 10, CLOCK_S = 5, FAR_M = 500, LOW_PERCENT = 40, EMPTY_PERCENT = 15;
// What a mission needs: the parts of health that say so, what to do if none is heard, and if it is not well.
const CHECKS = [
  ["Sensor", /sensor_driver: (logger link|records)$/, "start the sensor driver", "check the cable and power of the logger, and logger_uri"],
  ["GNSS", /sensor_driver: GNSS/, "start the sensor driver", "wait under open sky; check the antenna, the corrections, and gnss_uri"],
  ["Planner", /planner: (guard|frames|position)$/, "start the planner", "do what it says, then look again"],
  ["Navigation", /planner: navigation$/, "start the planner and the navigation of the robot", "start the navigation of the robot, and check that its map is loaded"],
  ["Map", /mapper: /, "start the mapper", "look at the log of the mapper"],
  ["Disk and recording", /recorder: /, "start the recorder, or do without a recording", "make space: take old runs home, and remove them"],
];

function battery(robot) {
  const known = sections[`battery/${robot}`], heard = sections.heard?.[`battery/${robot}`];
  if (!known || heard === undefined) return [1, "not known", "look at the robot itself, or let it publish sensor_msgs/BatteryState on battery_state"];
  if (nowS() - heard > 6 * SILENT_S) return [1, "not heard any more", "look at the robot itself"];
  const text = [known.charge === null ? "" : `${known.charge} %`, known.voltage === null ? "" : `${known.voltage} V`].filter(Boolean).join(", ");
  if (known.charge === null) return [text ? 0 : 1, text || "not known", "look at the robot itself"];
  return [known.charge < EMPTY_PERCENT ? 2 : known.charge < LOW_PERCENT ? 1 : 0, text, "charge it or change it, or plan a shorter mission"];
}

function datum(robot) {
  const place = sections[`place/${robot}`], border = sections.field?.boundary;
  if (!place || !border) return [1, "not known: the robot has no position yet", "wait for the GNSS receiver"];
  const [x, y] = place, middle = [0, 1].map((axis) => border.reduce((sum, corner) => sum + corner[axis], 0) / border.length);
  const size = Math.max(...border.map((corner) => Math.hypot(corner[0] - middle[0], corner[1] - middle[1])));
  const away = Math.hypot(x - middle[0], y - middle[1]) - size;
  if (away > FAR_M) return [2, `the robot is ${Math.round(away)} m from the field`, "check that this is its field file, and the datum in it"];
  return [0, "the robot is at the field", ""];
}

function clock() {
  if (clockOffS === null) return [1, "not known", "reload the page"];
  const off = Math.abs(Math.round(clockOffS));
  if (Math.abs(clockOffS) <= CLOCK_S) return [0, "agrees with this device", ""];
  return [1, `the robot's computer is ${off} s ${clockOffS > 0 ? "ahead of" : "behind"} this device`, "set the wrong one; the receiver's time or NTP sets the robot's"];
}

// [name, level, what, remedy], for a robot. Without a link nothing is known to be ready.
export function checks(robot) {
  const found = heardChecks(robot);
  return lost() ? found.map(([name, , text]) => [name, 3, `not known without a connection; last: ${text}`, ""]) : found;
}

function heardChecks(robot) {
  const parts = sections.health ?? [];
  const rows = CHECKS.map(([name, pattern, absent, remedy]) => {
    const mine = parts.filter((part) => pattern.test(part.name));
    if (!mine.length) return [name, 2, "not heard", absent];
    const worst = mine.reduce((one, other) => (other.level > one.level ? other : one));
    return [name, worst.level, worst.message, remedy];
  });
  const heard = sections.heard?.[`mission/${robot}`];
  if (heard === undefined || nowS() - heard > SILENT_S) rows.unshift(["Link to the robot", sections[`mission/${robot}`]?.phase === "finished" ? 3 : 2, "the planner is not heard", "start it, or check the network"]);
  rows.push(["Battery", ...battery(robot)], ["Clock", ...clock()], ["Datum", ...datum(robot)]);
  return rows;
}
