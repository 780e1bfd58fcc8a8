// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// The map viewer: layers, zoom, the values at a place that the reader chooses, and the surveys of a season.
(function () {
  "use strict";
  const byId = (id) => document.getElementById(id);
  const data = JSON.parse(byId("map-data").textContent), [WEST, EAST, SOUTH, NORTH] = data.view;
  const box = byId("map"), canvas = box.querySelector("canvas"), pen = canvas.getContext("2d");
  const NOTHING = 65535, MAX_ZOOM = 40, TAP_PX = 8, NEAR_PX = 12, DARK = "#1f2d38", FULL = 2 * Math.PI;
  const layers = {}, spreads = new Set();
  let shown = null, picture = null, hatching = [], now = data.labels ? data.labels.length - 1 : 0;
  let width = 0, height = 0, ratio = 1, scale = 1, centre = { x: 0, y: 0 }, whole = 1, place = null;
  document.documentElement.className += " js";

  // ---- data
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  function unpack(raster) {
    const raw = bytes(raster.data);
    return Float64Array.from({ length: raw.length / 2 }, (_, i) => {
      const code = raw[2 * i] + 256 * raw[2 * i + 1];
      return code === NOTHING ? NaN : raster.offset + raster.step * code;
    });
  }
  // A layer of a season has a raster for each survey; any other one is its own raster.
  const rasterOf = (layer, survey = now) => layer.maps ? layer.maps[survey] : layer;
  function values(layer, survey) {
    const raster = rasterOf(layer, survey);
    if (!raster.values && layer.minus) {
      const [a, b] = layer.minus.map((key) => values(layers[key]));
      raster.values = a.map((value, i) => value - b[i]);
    }
    if (!raster.values) { raster.values = unpack(raster); }
    return raster.values;
  }
  function bits(layer) {
    const raster = rasterOf(layer);
    if (raster.bits === undefined) { raster.bits = raster.hatch ? bytes(raster.hatch) : null; }
    return raster.bits;
  }
  data.layers.forEach((layer) => { layers[layer.key] = layer; spreads.add(layer.sd); });
  function cellAt(layer, x, y) {
    const grid = data.grids[layer.grid], column = Math.round((x - grid.x0) / grid.cell), row = Math.round((y - grid.y0) / grid.cell);
    return column < 0 || row < 0 || column >= grid.nx || row >= grid.ny ? -1 : row * grid.nx + column;
  }
  function valueHere(layer) { const i = cellAt(layer, place.x, place.y); return i < 0 ? NaN : values(layer)[i]; }
  function hatched(layer, i) { const found = bits(layer); return found !== null && (found[i >> 3] >> (i & 7) & 1) === 1; }
  const hatchedHere = (layer) => hatched(layer, cellAt(layer, place.x, place.y));

  // ---- colours
  const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  function painter(layer) {
    if (layer.kind === "zones") {
      const fills = (layer.zones || data.zones).map((zone) => rgb(zone.colour));
      return (value) => fills[Math.round(value)];
    }
    const stops = layer.colours.map(rgb), { from, to } = layer, last = stops.length - 1;
    return function (value) {
      const at = Math.min(Math.max((value - from) / (to - from), 0), 1) * last;
      const low = stops[Math.floor(at)], high = stops[Math.ceil(at)], part = at - Math.floor(at);
      return low.map((c, k) => c + part * (high[k] - c));
    };
  }
  function paint() {
    const grid = data.grids[shown.grid], colour = painter(shown);
    picture = document.createElement("canvas");
    picture.width = grid.nx;
    picture.height = grid.ny;
    const to = picture.getContext("2d"), image = to.createImageData(grid.nx, grid.ny);
    values(shown).forEach(function (value, i) {
      const row = grid.ny - 1 - Math.floor(i / grid.nx);
      if (!isNaN(value)) { image.data.set([...colour(value), 255], 4 * (row * grid.nx + i % grid.nx)); }
    });
    to.putImageData(image, 0, 0);
    hatching = [];
    for (let r = 0; bits(shown) && r < grid.ny; r += 1) {
      for (let c = 0, begin = -1; c <= grid.nx; c += 1) {
        const on = c < grid.nx && hatched(shown, r * grid.nx + c);
        if (on && begin < 0) { begin = c; }
        if (!on && begin >= 0) { hatching.push([begin, r, c - begin]); begin = -1; }
      }
    }
  }

  // ---- view
  const px = (x) => width / 2 + (x - centre.x) * scale, py = (y) => height / 2 - (y - centre.y) * scale;
  const toMetres = (at) => [centre.x + (at.x - width / 2) / scale, centre.y - (at.y - height / 2) / scale];
  const clamp = (value, low, high) => low > high ? (low + high) / 2 : Math.min(Math.max(value, low), high);
  function fit() {
    whole = scale = Math.min(width / (EAST - WEST), height / (NORTH - SOUTH));
    centre = { x: (WEST + EAST) / 2, y: (SOUTH + NORTH) / 2 };
  }
  function redraw() {
    const halfX = width / 2 / scale, halfY = height / 2 / scale;
    centre = { x: clamp(centre.x, WEST + halfX, EAST - halfX), y: clamp(centre.y, SOUTH + halfY, NORTH - halfY) };
    box.style.touchAction = scale > whole * 1.01 ? "none" : "pan-y";
    draw();
  }
  function zoom(factor, at = { x: width / 2, y: height / 2 }) {
    const [x, y] = toMetres(at);
    scale = clamp(scale * factor, whole, whole * MAX_ZOOM);
    centre = { x: x - (at.x - width / 2) / scale, y: y + (at.y - height / 2) / scale };
    redraw();
  }
  function resize() {
    const was = width, factor = whole ? scale / whole : 1, kept = centre;
    width = box.clientWidth;
    height = Math.round(Math.min(Math.max(width * (NORTH - SOUTH) / (EAST - WEST), 0.6 * width), 1.15 * width,
      Math.max(0.62 * window.innerHeight, 300)));
    ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    canvas.style.height = height + "px";
    if (was !== width) {
      fit();
      if (was) { scale = whole * factor; centre = kept; }
    }
    redraw();
  }

  // ---- drawing
  const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const on = (name) => { const box = byId("show-" + name); return box && box.checked; };
  const robot = (i) => data.robots.length ? data.robots[i % data.robots.length].colour : DARK;
  function lines(to, several, colour, thick) {
    to.beginPath();
    several.forEach((points) => points.forEach(([x, y], i) => i ? to.lineTo(x, y) : to.moveTo(x, y)));
    to.strokeStyle = colour;
    to.lineWidth = thick;
    to.stroke();
  }
  const stroke = (places, colour, thick) => lines(pen, [places.map(([x, y]) => [px(x), py(y)])], colour, thick);
  function disc(to, x, y, radius, fill, edge) {
    to.beginPath();
    to.arc(x, y, radius, 0, FULL);
    to.fillStyle = fill;
    to.fill();
    if (edge) { to.lineWidth = 1; to.strokeStyle = edge; to.stroke(); }
  }
  function write(to, text, x, y, font, align, baseline = "middle") {
    to.font = font + " system-ui, sans-serif";
    to.textAlign = align;
    to.textBaseline = baseline;
    to.fillText(text, x, y);
  }
  function stripes(colour) {
    const tile = document.createElement("canvas"), side = 8 * ratio;
    tile.width = tile.height = side;
    lines(tile.getContext("2d"), [-side, 0, side].map((x) => [[x, side], [x + side, 0]]), colour, 1.3 * ratio);
    const pattern = pen.createPattern(tile, "repeat");
    pattern.setTransform(new DOMMatrix().scale(1 / ratio));
    return pattern;
  }

  function draw() {
    const grid = data.grids[shown.grid], cell = grid.cell;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.imageSmoothingEnabled = false;
    pen.drawImage(picture, px(grid.x0 - cell / 2), py(grid.y0 + (grid.ny - 0.5) * cell), grid.nx * cell * scale, grid.ny * cell * scale);
    if (hatching.length && on("hatch")) {
      pen.beginPath();
      hatching.forEach(([column, row, count]) => pen.rect(px(grid.x0 + (column - 0.5) * cell),
        py(grid.y0 + (row + 0.5) * cell), count * cell * scale, cell * scale));
      pen.fillStyle = stripes("rgba(20,25,30,.75)");
      pen.fill();
    }
    (on("noGo") ? data.noGo : []).forEach(function (hole) {
      pen.fillStyle = ink("faint");
      stroke(hole.concat([hole[0]]), ink("ink"), 1);
      pen.fill();
      stroke(hole.concat([hole[0]]), ink("ink"), 1);
    });
    (on("edge") ? data.edge : []).forEach((ring) => stroke(ring, ink("ink"), 1.5));
    (on("paths") ? data.paths : []).forEach(function (path, i) {
      const several = data.robots.length > 0;
      if (several) { stroke(path, "#fff", 3.5); }
      stroke(path, robot(i), several ? 2 : 1.2);
      pen.lineWidth = 2;
      pen.strokeStyle = DARK;
      pen.strokeRect(px(path[0][0]) - 7, py(path[0][1]) - 7, 14, 14);
    });
    const colour = shown.key === "rate" || shown.key === "truth" ? painter(shown) : null;
    const size = (data.samples.length > 400 ? 2 : data.samples.length > 80 ? 2.6 : 3.5) * Math.min(Math.sqrt(scale / whole), 2.5);
    (on("samples") ? data.samples : []).forEach(([x, y, counts, exposure]) => disc(pen, px(x), py(y), size,
      colour ? "rgb(" + colour(counts / exposure).map(Math.round).join(",") + ")" : "#fff", DARK));
    if (on("visits")) { stops(); }
    (on("quarantined") ? data.quarantined : []).forEach(function (q) {
      const x = px(q[0]), y = py(q[1]), sides = [[[x - 5, y - 5], [x + 5, y + 5]], [[x - 5, y + 5], [x + 5, y - 5]]];
      lines(pen, sides, "#fff", 5);
      lines(pen, sides, "#b3001b", 2.5);
    });
    if (place) { cross(px(place.x), py(place.y)); }
    furniture();
  }
  function stops() {
    const taken = [];
    data.visits.forEach(function (v, i) {
      const x = px(v[0]), y = py(v[1]), free = taken.every((t) => Math.abs(t[0] - x) > 20 || Math.abs(t[1] - y) > 18);
      disc(pen, x, y, free ? 10 : 3, "#fff", robot(v[5] - 1));
      if (free) {
        taken.push([x, y]);
        pen.fillStyle = DARK;
        write(pen, String(i + 1), x, y + 0.5, "600 12px", "center");
      }
    });
  }
  function cross(x, y) {
    const ring = Array.from({ length: 49 }, (_, i) => [x + 9 * Math.cos(FULL * i / 48), y + 9 * Math.sin(FULL * i / 48)]);
    const arms = [[1, 0], [-1, 0], [0, 1], [0, -1]].map(([a, b]) => [[x + 4 * a, y + 4 * b], [x + 18 * a, y + 18 * b]]);
    lines(pen, [ring, ...arms], "#fff", 4.5);
    lines(pen, [ring, ...arms], "#111", 2);
  }
  function furniture() {
    const power = Math.pow(10, Math.floor(Math.log10(90 / scale))), x = 10, y = height - 12, right = width - 17.5;
    const metres = [1, 2, 5].map((step) => step * power).filter((length) => length * scale <= 110).pop() || 10;
    const text = metres >= 1000 ? metres / 1000 + " km" : metres + " m", long = metres * scale;
    pen.font = "600 13px system-ui, sans-serif";
    pen.fillStyle = ink("paper");
    pen.globalAlpha = 0.85;
    pen.fillRect(x - 5, y - 23, Math.max(long, pen.measureText(text).width) + 10, 30);
    pen.fillRect(width - 30, 5, 25, 40);
    pen.globalAlpha = 1;
    pen.fillStyle = ink("ink");
    pen.fillRect(x, y - 2, long, 4);
    write(pen, text, x, y - 8, "600 13px", "left", "alphabetic");
    write(pen, "N", right, 42, "600 13px", "center", "alphabetic");
    pen.beginPath();
    [[0, 8], [6.5, 28], [0, 24], [-6.5, 28]].forEach(([dx, at]) => pen.lineTo(right + dx, at));
    pen.fill();
  }

  // ---- legend
  const number = (value, digits) => value.toFixed(digits).replace("-", "\u2212");
  function element(tag, text, className) {
    const made = document.createElement(tag);
    if (text) { made.textContent = text; }
    if (className) { made.className = className; }
    return made;
  }
  function legend() {
    const to = byId("map-legend");
    to.textContent = "";
    if (shown.kind === "zones") {
      (shown.zones || data.zones).forEach(function (zone) {
        const item = element("span", zone.name + " (" + zone.limits + ")", "swatch");
        item.style.setProperty("--fill", zone.colour);
        to.append(item);
      });
    } else {
      const bar = element("div", "", "bar"), ticks = element("div", "", "ticks"), marks = shown.ticks;
      bar.style.background = "linear-gradient(to right," + shown.colours.join(",") + ")";
      const digits = marks.length > 1 && (marks[1] - marks[0]) % 1 === 0 && marks[0] % 1 === 0 ? 0 : shown.digits;
      marks.forEach(function (tick) {
        const mark = element("span", number(tick, digits));
        mark.style.left = 100 * (tick - shown.from) / (shown.to - shown.from) + "%";
        ticks.append(mark);
      });
      to.append(element("div", (shown.name || shown.title) + " [" + shown.unit + "]", "unit"), bar, ticks);
    }
    if (bits(shown)) { to.append(element("span", shown.hatchText, "swatch hatched")); }
    byId("map-about").textContent = values(shown).every(isNaN) ? "The first survey has none before it." : shown.about;
  }

  // ---- reading a place
  const amount = (layer, value) => number(value, layer.digits) + " " + layer.unit;
  function rows() {
    const found = [];
    data.layers.forEach(function (layer) {
      if (!layer.title || layer.kind === "zones" || layer.minus || spreads.has(layer.key)) { return; }
      const value = valueHere(layer);
      if (isNaN(value)) { return; }
      let text = amount(layer, value);
      if (layer.sd) { text = number(value, layer.digits) + " \u00b1 " + amount(layer, valueHere(layers[layer.sd])); }
      if (layer.low) {
        const [low, high] = [layer.low, layer.high].map((key) => number(valueHere(layers[key]), 1));
        text += ` (90 % interval ${low} to ${high} %)${hatchedHere(layer) ? ", " + layer.hatchText : ""}`;
      }
      found.push([layer.title, text]);
      if (layer.key === "vwc" && data.rootDepth) { found.push(["Water in the upper " + data.rootDepth + " mm", number(value / 100 * data.rootDepth, 0) + " mm"]); }
    });
    for (const layer of [layers.zone, layers.decision]) {
      const at = layer ? valueHere(layer) : NaN;
      if (!isNaN(at)) { found.push([layer.zones ? layer.title : "Zone", (layer.zones || data.zones)[Math.round(at)].name + (hatchedHere(layer) ? " (not certain)" : " (certain)")]); }
    }
    if (!found.length) { found.push(["No value", "this place is outside the mapped field"]); }
    return found.concat(nearby());
  }
  function nearest(name) {
    const away = data[name].map((item) => Math.hypot(item[0] - place.x, item[1] - place.y));
    const least = away.reduce((low, one) => Math.min(low, one), Infinity);
    return on(name) && least <= NEAR_PX / scale ? away.lastIndexOf(least) : -1;
  }
  function nearby() {
    const found = [], s = data.samples[nearest("samples")], i = nearest("visits"), v = data.visits[i];
    const q = data.quarantined[nearest("quarantined")];
    if (s) {
      found.push(["Sample here", s[2] + " counts in " + number(s[3], 0) + " s: " + number(s[2] / s[3], 2) + " \u00b1 " +
        number(Math.sqrt(s[2]) / s[3], 2) + " counts/s"]);
    }
    if (v) { found.push(["Stop " + (i + 1), v[2] + ", " + v[4] + " counts in " + v[3] + " s"]); }
    if (q) { found.push(["Record left out", q[2]]); }
    return found;
  }
  function geographic() {
    const p = data.place, dx = (place.x - p.x) / 1000, dy = (place.y - p.y) / 1000, terms = [1, dx, dy, dx * dx, dx * dy, dy * dy];
    const [lat, lon] = [p.latitude, p.longitude].map((weights) => weights.reduce((sum, w, i) => sum + w * terms[i], 0));
    return Math.abs(lat).toFixed(6) + "\u00b0 " + (lat < 0 ? "S" : "N") + ", " + Math.abs(lon).toFixed(6) + "\u00b0 " + (lon < 0 ? "W" : "E");
  }
  const metres = () => number(Math.abs(place.x), 1) + " m " + (place.x < 0 ? "west" : "east") + ", " +
    number(Math.abs(place.y), 1) + " m " + (place.y < 0 ? "south" : "north") + " of the datum";
  // What the first layer of a season shows here in each survey.
  function course() {
    const layer = data.layers[0], cell = data.labels ? cellAt(layer, place.x, place.y) : -1;
    const texts = (data.labels || []).map(function (label, i) {
      const [mean, sd] = [layer, layers[layer.sd]].map((of) => cell < 0 ? NaN : values(of, i)[cell]);
      return [label, number(mean, layer.digits) + " \u00b1 " + amount(layer, sd), mean];
    });
    return texts.filter((text) => !isNaN(text[2]));
  }
  function read() {
    const list = element("dl");
    rows().concat(course(), [["Place", geographic()], ["", metres()]]).forEach(function ([name, text]) {
      const item = element("div");
      item.append(element("dt", name || "In the map"), element("dd", text));
      list.append(item);
    });
    byId("map-readout").replaceChildren(list);
  }
  function choose(x, y) { place = { x: x, y: y }; read(); redraw(); }

  // ---- input
  const held = {};
  let moved = 0, spread = 0;
  const local = (event) => { const r = canvas.getBoundingClientRect(); return { x: event.clientX - r.left, y: event.clientY - r.top }; };
  const gap = () => { const [a, b] = Object.values(held); return b ? Math.hypot(a.x - b.x, a.y - b.y) : 0; };
  canvas.addEventListener("pointerdown", function (event) {
    held[event.pointerId] = local(event);
    spread = gap();
    moved = spread ? TAP_PX + 1 : 0;
    if (event.pointerType === "mouse") { canvas.setPointerCapture(event.pointerId); }
  });
  canvas.addEventListener("pointermove", function (event) {
    const before = held[event.pointerId], here = local(event);
    if (!before) { return; }
    held[event.pointerId] = here;
    const [a, b] = Object.values(held);
    if (!b) {
      moved += Math.hypot(here.x - before.x, here.y - before.y);
      if (scale > whole * 1.01 && moved > TAP_PX) {
        centre = { x: centre.x - (here.x - before.x) / scale, y: centre.y + (here.y - before.y) / scale };
        redraw();
      }
    } else if (spread > 0) {
      zoom(gap() / spread, { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 });
      spread = gap();
    }
  });
  canvas.addEventListener("pointerup", function (event) {
    if (held[event.pointerId] && moved <= TAP_PX && Object.keys(held).length === 1) { choose(...toMetres(local(event))); }
    delete held[event.pointerId];
  });
  canvas.addEventListener("pointercancel", (event) => delete held[event.pointerId]);
  canvas.addEventListener("wheel", function (event) {
    if (!event.ctrlKey && !event.metaKey) { return; }
    event.preventDefault();
    zoom(Math.exp(-event.deltaY / 300), local(event));
  }, { passive: false });
  canvas.addEventListener("dblclick", (event) => zoom(2, local(event)));
  const all = () => { fit(); redraw(); }, zooms = { "+": 1.5, "=": 1.5, "-": 1 / 1.5 };
  box.addEventListener("keydown", function (event) {
    const cell = data.grids[shown.grid].cell * (event.shiftKey ? 10 : 1);
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) { return; }
    if (step) {
      const from = place || centre, x = clamp(from.x + step[0] * cell, WEST, EAST), y = clamp(from.y + step[1] * cell, SOUTH, NORTH);
      if (Math.abs(x - centre.x) > 0.45 * width / scale) { centre.x = x; }
      if (Math.abs(y - centre.y) > 0.45 * height / scale) { centre.y = y; }
      choose(x, y);
    } else if (zooms[event.key]) { zoom(zooms[event.key]);
    } else if (event.key === "0") { all();
    } else { return; }
    event.preventDefault();
  });
  byId("zoom-in").addEventListener("click", () => zoom(1.5));
  byId("zoom-out").addEventListener("click", () => zoom(1 / 1.5));
  byId("zoom-all").addEventListener("click", all);

  // ---- choice of layers
  function select(key) { shown = layers[key]; paint(); legend(); if (width) { draw(); } }
  document.querySelectorAll("input[name=layer]").forEach(function (input) {
    input.addEventListener("change", () => select(input.value));
    if (input.checked) { select(input.value); }
  });
  document.querySelectorAll("#map-overlays input").forEach((input) => input.addEventListener("change", draw));
  window.addEventListener("resize", resize);
  ["(prefers-color-scheme: dark)", "print"].forEach((query) => window.matchMedia(query).addEventListener("change", draw));
  window.addEventListener("beforeprint", () => document.querySelectorAll("details:not([open])").forEach(function (part) {
    part.open = true;
    part.dataset.opened = "yes";
  }));
  window.addEventListener("afterprint", () => document.querySelectorAll("details[data-opened]").forEach(function (part) {
    part.open = false;
    delete part.dataset.opened;
  }));

  // ---- surveys of a season: a slider over them
  const slider = byId("when");
  function survey(number) {
    now = number;
    slider.value = String(now);
    slider.setAttribute("aria-valuetext", data.labels[now]);
    byId("label").textContent = data.labels[now];
    document.querySelectorAll("#surveys tbody tr").forEach((row, i) => { row.className = i === now ? "now" : ""; });
    select(shown.key);
    if (place) { read(); }
  }
  resize();
  if (data.labels) {
    slider.addEventListener("input", () => survey(Number(slider.value)));
    survey(now);
  }
}());
