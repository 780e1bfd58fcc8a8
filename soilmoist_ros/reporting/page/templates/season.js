// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// The maps of a season: a slider over the surveys, layers, and the course at a place that the reader chooses.
(function () {
  "use strict";
  var byId = function (id) { return document.getElementById(id); };
  var data = JSON.parse(byId("season-data").textContent), grid = data.grid;
  var box = byId("season-map"), canvas = box.querySelector("canvas"), pen = canvas.getContext("2d");
  var course = byId("season-place"), courseCanvas = course.querySelector("canvas"), coursePen = courseCanvas.getContext("2d");
  var slider = byId("when"), layers = {}, shown = null, now = data.labels.length - 1, cell = null, timer = null;
  var NOTHING = 65535, STEP_MS = 900, ratio = 1, width = 0, height = 0, scale = 1;
  document.documentElement.className += " js";

  // ---- data
  function bytes(text) {
    var raw = atob(text), out = new Uint8Array(raw.length);
    for (var i = 0; i < raw.length; i += 1) { out[i] = raw.charCodeAt(i); }
    return out;
  }
  function values(packed) {
    if (!packed.values) {
      var raw = bytes(packed.data);
      packed.values = new Float64Array(raw.length / 2);
      for (var i = 0; i < packed.values.length; i += 1) {
        var code = raw[2 * i] + 256 * raw[2 * i + 1];
        packed.values[i] = code === NOTHING ? NaN : packed.offset + packed.step * code;
      }
    }
    return packed.values;
  }
  data.layers.forEach(function (layer) { layers[layer.key] = layer; });
  function ink(name) { return getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim(); }
  function number(value, digits) { return value.toFixed(digits).replace("-", "\u2212"); }
  function rgb(hex) { return [1, 3, 5].map(function (at) { return parseInt(hex.slice(at, at + 2), 16); }); }

  // ---- map
  function picture() {
    var made = document.createElement("canvas"), to = made.getContext("2d"), raster = values(shown.maps[now]);
    made.width = grid.nx;
    made.height = grid.ny;
    var pixels = to.createImageData(grid.nx, grid.ny), stops = shown.colours.map(rgb), last = stops.length - 1;
    for (var i = 0; i < raster.length; i += 1) {
      if (isNaN(raster[i])) { continue; }
      var at = Math.min(Math.max((raster[i] - shown.from) / (shown.to - shown.from), 0), 1) * last;
      var low = stops[Math.floor(at)], high = stops[Math.ceil(at)], part = at - Math.floor(at);
      var pixel = 4 * ((grid.ny - 1 - Math.floor(i / grid.nx)) * grid.nx + i % grid.nx);
      for (var k = 0; k < 3; k += 1) { pixels.data[pixel + k] = low[k] + part * (high[k] - low[k]); }
      pixels.data[pixel + 3] = 255;
    }
    to.putImageData(pixels, 0, 0);
    return made;
  }
  function px(x) { return (x - grid.x0 + grid.cell) * scale; }
  function py(y) { return (grid.y0 + grid.ny * grid.cell - y) * scale; }
  function outline(ring) {
    pen.beginPath();
    ring.forEach(function (p, i) { if (i) { pen.lineTo(px(p[0]), py(p[1])); } else { pen.moveTo(px(p[0]), py(p[1])); } });
    pen.closePath();
  }
  function hatch() {
    var text = shown.hatch ? shown.hatch[now] : "", bits = text ? bytes(text) : null;
    if (!bits) { return; }
    pen.beginPath();
    for (var i = 0; i < grid.nx * grid.ny; i += 1) {
      if (bits[i >> 3] >> (i & 7) & 1) {
        var x = px(grid.x0 + (i % grid.nx - 0.5) * grid.cell), y = py(grid.y0 + (Math.floor(i / grid.nx) + 0.5) * grid.cell);
        pen.rect(x, y, grid.cell * scale + 0.5, grid.cell * scale + 0.5);
      }
    }
    pen.save();
    pen.clip();
    pen.beginPath();
    for (var at = -height; at < width; at += 8) { pen.moveTo(at, height); pen.lineTo(at + height, 0); }
    pen.strokeStyle = "rgba(20,25,30,.55)";
    pen.lineWidth = 1.2;
    pen.stroke();
    pen.restore();
  }
  function draw() {
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.imageSmoothingEnabled = false;
    pen.drawImage(picture(), px(grid.x0 - grid.cell / 2), py(grid.y0 + (grid.ny - 0.5) * grid.cell),
      grid.nx * grid.cell * scale, grid.ny * grid.cell * scale);
    hatch();
    data.holes.forEach(function (ring) { outline(ring); pen.fillStyle = ink("faint"); pen.fill(); });
    data.edge.forEach(function (ring) { outline(ring); pen.strokeStyle = ink("ink"); pen.lineWidth = 1.5; pen.stroke(); });
    if (!shown.maps[now].values.some(function (value) { return !isNaN(value); })) {
      pen.fillStyle = ink("ink");
      pen.font = "600 15px system-ui, sans-serif";
      pen.textAlign = "center";
      pen.fillText("The first survey has none before it.", width / 2, height / 2);
    }
    if (cell) {
      var x = px(grid.x0 + cell.column * grid.cell), y = py(grid.y0 + cell.row * grid.cell);
      [["#fff", 4.5], ["#111", 2]].forEach(function (style) {
        pen.beginPath();
        pen.arc(x, y, 9, 0, 2 * Math.PI);
        pen.strokeStyle = style[0];
        pen.lineWidth = style[1];
        pen.stroke();
      });
    }
  }
  function legend() {
    var to = byId("season-legend"), bar = document.createElement("div"), ticks = document.createElement("div");
    var unit = document.createElement("div");
    to.textContent = "";
    unit.className = "unit";
    unit.textContent = shown.title + " [" + shown.unit + "]";
    bar.className = "bar";
    bar.style.background = "linear-gradient(to right," + shown.colours.join(",") + ")";
    ticks.className = "ticks";
    shown.ticks.forEach(function (tick) {
      var mark = document.createElement("span");
      mark.textContent = number(tick, shown.digits);
      mark.style.left = 100 * (tick - shown.from) / (shown.to - shown.from) + "%";
      ticks.appendChild(mark);
    });
    [unit, bar, ticks].forEach(function (part) { to.appendChild(part); });
  }

  // ---- the course at a place
  function at(packed) { return values(packed)[cell.row * grid.nx + cell.column]; }
  function read() {
    var to = byId("season-readout"), first = data.layers[0], text = document.createElement("p");
    if (!cell) { return; }
    var value = at(first.maps[now]);
    to.textContent = "";
    if (isNaN(value)) {
      text.textContent = "This place is outside the mapped field.";
    } else {
      text.textContent = data.labels[now] + ": " + number(value, first.digits) + " \u00b1 " + number(at(first.sds[now]), first.digits) +
        " " + first.unit + (first.key === "vwc" ? " (" + number(at(layers.rate.maps[now]), layers.rate.digits) + " counts/s)" : "") + (layers.change && !isNaN(at(layers.change.maps[now])) ? ", change " +
        number(at(layers.change.maps[now]), layers.change.digits) + " " + layers.change.unit : "");
    }
    to.appendChild(text);
    course.hidden = isNaN(value);
    if (!course.hidden) { drawCourse(first); }
  }
  function drawCourse(layer) {
    var wide = course.clientWidth, tall = 170, left = 46, right = 14, top = 12, bottom = 30;
    courseCanvas.width = wide * ratio;
    courseCanvas.height = tall * ratio;
    courseCanvas.style.height = tall + "px";
    var mean = layer.maps.map(at), sd = layer.sds.map(at);
    var low = Math.min.apply(null, mean.map(function (m, i) { return m - 2 * sd[i]; }));
    var high = Math.max.apply(null, mean.map(function (m, i) { return m + 2 * sd[i]; }));
    var end = data.days[data.days.length - 1] || 1;
    function x(i) { return left + (wide - left - right) * data.days[i] / end; }
    function y(v) { return top + (tall - top - bottom) * (high - v) / (high - low || 1); }
    var p = coursePen;
    p.setTransform(ratio, 0, 0, ratio, 0, 0);
    p.clearRect(0, 0, wide, tall);
    p.font = "13px system-ui, sans-serif";
    p.textBaseline = "middle";
    [low, (low + high) / 2, high].forEach(function (v) {
      p.strokeStyle = ink("faint");
      p.lineWidth = 1;
      p.beginPath(); p.moveTo(left, y(v)); p.lineTo(wide - right, y(v)); p.stroke();
      p.fillStyle = ink("soft");
      p.textAlign = "right";
      p.fillText(number(v, layer.digits), left - 6, y(v));
    });
    p.textAlign = "left";
    p.fillText(data.labels[0], left, tall - 12);
    p.textAlign = "right";
    p.fillText(data.labels[data.labels.length - 1], wide - right, tall - 12);
    p.strokeStyle = ink("line");
    p.fillStyle = ink("line");
    mean.forEach(function (m, i) {
      p.lineWidth = 2;
      p.beginPath(); p.moveTo(x(i), y(m - 2 * sd[i])); p.lineTo(x(i), y(m + 2 * sd[i])); p.stroke();
      p.beginPath(); p.arc(x(i), y(m), i === now ? 6 : 3.5, 0, 2 * Math.PI); p.fill();
    });
    p.lineWidth = 1.5;
    p.beginPath();
    mean.forEach(function (m, i) { if (i) { p.lineTo(x(i), y(m)); } else { p.moveTo(x(i), y(m)); } });
    p.stroke();
  }

  // ---- input
  function show() {
    slider.value = String(now);
    slider.setAttribute("aria-valuetext", data.labels[now]);
    byId("label").textContent = data.labels[now];
    document.querySelectorAll("#surveys tbody tr").forEach(function (row, i) { row.className = i === now ? "now" : ""; });
    draw();
    read();
  }
  function choose(column, row) {
    cell = { column: Math.min(Math.max(column, 0), grid.nx - 1), row: Math.min(Math.max(row, 0), grid.ny - 1) };
    draw();
    read();
  }
  function stop() { window.clearInterval(timer); timer = null; byId("play").textContent = "\u25b6"; byId("play").setAttribute("aria-label", "Play the season"); }
  slider.addEventListener("input", function () { stop(); now = Number(slider.value); show(); });
  byId("play").addEventListener("click", function () {
    if (timer) { stop(); return; }
    byId("play").textContent = "\u23f8";
    byId("play").setAttribute("aria-label", "Pause");
    if (now === data.labels.length - 1) { now = 0; show(); }
    timer = window.setInterval(function () {
      if (now === data.labels.length - 1) { stop(); return; }
      now += 1;
      show();
    }, STEP_MS);
  });
  canvas.addEventListener("click", function (event) {
    var r = canvas.getBoundingClientRect();
    choose(Math.round((event.clientX - r.left) / scale / grid.cell - 1),
      Math.round(grid.ny - (event.clientY - r.top) / scale / grid.cell));
  });
  box.addEventListener("keydown", function (event) {
    var step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!step || event.ctrlKey || event.metaKey || event.altKey) { return; }
    var from = cell || { column: Math.round(grid.nx / 2), row: Math.round(grid.ny / 2) };
    choose(from.column + step[0], from.row + step[1]);
    event.preventDefault();
  });
  document.querySelectorAll("input[name=layer]").forEach(function (input) {
    input.addEventListener("change", function () { shown = layers[input.value]; legend(); draw(); });
    if (input.checked) { shown = layers[input.value]; }
  });
  function resize() {
    width = box.clientWidth;
    ratio = Math.min(window.devicePixelRatio || 1, 3);
    scale = width / ((grid.nx + 1) * grid.cell);
    var most = Math.max(260, 0.62 * window.innerHeight);
    if ((grid.ny + 1) * grid.cell * scale > most) { scale = most / ((grid.ny + 1) * grid.cell); }
    width = (grid.nx + 1) * grid.cell * scale;
    height = (grid.ny + 1) * grid.cell * scale;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    canvas.style.width = width + "px";
    canvas.style.height = height + "px";
    show();
  }
  window.addEventListener("resize", resize);
  if (window.matchMedia) { window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", show); }
  legend();
  resize();
}());
