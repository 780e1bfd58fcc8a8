// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// The map viewer: layers, zoom, the values at a place that the reader chooses, and the surveys of a season.
(function () {
  "use strict";
  var data = JSON.parse(document.getElementById("map-data").textContent);
  var box = document.getElementById("map"), canvas = box.querySelector("canvas"), pen = canvas.getContext("2d");
  var byId = function (id) { return document.getElementById(id); };
  var NOTHING = 65535, MAX_ZOOM = 40, TAP_PX = 8, NEAR_PX = 12;
  var layers = {}, spreads = {}, shown = null, picture = null, hatching = null, now = data.labels ? data.labels.length - 1 : 0;
  var width = 0, height = 0, ratio = 1, scale = 1, centre = { x: 0, y: 0 }, whole = 1, place = null;
  document.documentElement.className += " js";

  // ---- data
  function bytes(text) {
    var raw = atob(text), out = new Uint8Array(raw.length);
    for (var i = 0; i < raw.length; i += 1) { out[i] = raw.charCodeAt(i); }
    return out;
  }
  function unpack(raster) {
    var raw = bytes(raster.data), out = new Float64Array(raw.length / 2);
    for (var i = 0; i < out.length; i += 1) {
      var code = raw[2 * i] + 256 * raw[2 * i + 1];
      out[i] = code === NOTHING ? NaN : raster.offset + raster.step * code;
    }
    return out;
  }
  // A layer of a season has a raster for each survey; any other one is its own raster.
  function values(layer, survey) {
    var raster = layer.maps ? layer.maps[survey === undefined ? now : survey] : layer;
    if (!raster.values) {
      if (layer.minus) {
        var a = values(layers[layer.minus[0]]), b = values(layers[layer.minus[1]]);
        raster.values = a.map(function (value, i) { return value - b[i]; });
      } else { raster.values = unpack(raster); }
    }
    return raster.values;
  }
  function bits(layer) {
    var raster = layer.maps ? layer.maps[now] : layer;
    if (raster.bits === undefined) { raster.bits = raster.hatch ? bytes(raster.hatch) : null; }
    return raster.bits;
  }
  data.layers.forEach(function (layer) {
    layers[layer.key] = layer;
    if (layer.sd) { spreads[layer.sd] = true; }
  });
  function cellAt(layer, x, y) {
    var grid = data.grids[layer.grid];
    var column = Math.round((x - grid.x0) / grid.cell), row = Math.round((y - grid.y0) / grid.cell);
    return column < 0 || row < 0 || column >= grid.nx || row >= grid.ny ? -1 : row * grid.nx + column;
  }
  function valueAt(layer, x, y) { var i = cellAt(layer, x, y); return i < 0 ? NaN : values(layer)[i]; }
  function hatched(layer, i) { var found = bits(layer); return found !== null && (found[i >> 3] >> (i & 7) & 1) === 1; }

  // ---- colours
  function rgb(hex) { return [1, 3, 5].map(function (at) { return parseInt(hex.slice(at, at + 2), 16); }); }
  function limits(layer) { return byId("fixed").checked && layer.fixed ? layer.fixed : [layer.from, layer.to]; }
  function painter(layer) {
    if (layer.kind === "zones") {
      var fills = data.zones.map(function (zone) { return rgb(zone.colour); });
      return function (value) { return fills[Math.round(value)]; };
    }
    var stops = layer.colours.map(rgb), range = limits(layer), last = stops.length - 1;
    return function (value) {
      var at = Math.min(Math.max((value - range[0]) / (range[1] - range[0]), 0), 1) * last;
      var low = stops[Math.floor(at)], high = stops[Math.ceil(at)], part = at - Math.floor(at);
      return low.map(function (c, k) { return c + part * (high[k] - c); });
    };
  }
  function paint() {
    var grid = data.grids[shown.grid], all = values(shown), colour = painter(shown);
    picture = document.createElement("canvas");
    picture.width = grid.nx;
    picture.height = grid.ny;
    var to = picture.getContext("2d"), image = to.createImageData(grid.nx, grid.ny);
    for (var i = 0; i < all.length; i += 1) {
      if (!isNaN(all[i])) {
        var row = grid.ny - 1 - Math.floor(i / grid.nx), at = 4 * (row * grid.nx + i % grid.nx), fill = colour(all[i]);
        image.data[at] = fill[0];
        image.data[at + 1] = fill[1];
        image.data[at + 2] = fill[2];
        image.data[at + 3] = 255;
      }
    }
    to.putImageData(image, 0, 0);
    hatching = null;
    if (bits(shown)) {
      hatching = [];
      for (var r = 0; r < grid.ny; r += 1) {
        for (var c = 0, begin = -1; c <= grid.nx; c += 1) {
          var on = c < grid.nx && hatched(shown, r * grid.nx + c);
          if (on && begin < 0) { begin = c; }
          if (!on && begin >= 0) { hatching.push([begin, r, c - begin]); begin = -1; }
        }
      }
    }
  }

  // ---- view
  function px(x) { return width / 2 + (x - centre.x) * scale; }
  function py(y) { return height / 2 - (y - centre.y) * scale; }
  function fit() {
    var v = data.view;
    whole = Math.min(width / (v[1] - v[0]), height / (v[3] - v[2]));
    scale = whole;
    centre = { x: (v[0] + v[1]) / 2, y: (v[2] + v[3]) / 2 };
  }
  function keepInside() {
    var v = data.view, halfX = width / 2 / scale, halfY = height / 2 / scale;
    function clamp(value, low, high) { return low > high ? (low + high) / 2 : Math.min(Math.max(value, low), high); }
    centre.x = clamp(centre.x, v[0] + halfX, v[1] - halfX);
    centre.y = clamp(centre.y, v[2] + halfY, v[3] - halfY);
    box.style.touchAction = scale > whole * 1.01 ? "none" : "pan-y";
  }
  function zoom(factor, atX, atY) {
    var x = centre.x + (atX - width / 2) / scale, y = centre.y - (atY - height / 2) / scale;
    scale = Math.min(Math.max(scale * factor, whole), whole * MAX_ZOOM);
    centre = { x: x - (atX - width / 2) / scale, y: y + (atY - height / 2) / scale };
    keepInside();
    draw();
  }
  function resize() {
    var v = data.view, was = width, factor = whole ? scale / whole : 1, kept = centre;
    width = box.clientWidth;
    height = Math.round(Math.min(Math.max(width * (v[3] - v[2]) / (v[1] - v[0]), 0.6 * width), 1.15 * width,
      Math.max(0.62 * window.innerHeight, 300)));
    ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    canvas.style.height = height + "px";
    if (was !== width) {
      fit();
      if (was) { scale = whole * factor; centre = kept; }
    }
    keepInside();
    draw();
  }

  // ---- drawing
  function ink(name) { return getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim(); }
  function trace(points, closed) {
    pen.beginPath();
    points.forEach(function (p, i) { if (i) { pen.lineTo(px(p[0]), py(p[1])); } else { pen.moveTo(px(p[0]), py(p[1])); } });
    if (closed) { pen.closePath(); }
  }
  function stroke(points, colour, thick) {
    trace(points);
    pen.strokeStyle = colour;
    pen.lineWidth = thick;
    pen.stroke();
  }
  function stripes(colour) {
    var tile = document.createElement("canvas"), side = 8 * ratio, to = tile.getContext("2d");
    tile.width = tile.height = side;
    to.strokeStyle = colour;
    to.lineWidth = 1.3 * ratio;
    to.beginPath();
    [-side, 0, side].forEach(function (shift) { to.moveTo(shift, side); to.lineTo(shift + side, 0); });
    to.stroke();
    var pattern = pen.createPattern(tile, "repeat");
    pattern.setTransform(new DOMMatrix().scale(1 / ratio));
    return pattern;
  }
  function dot(x, y, radius, fill, edge) {
    pen.beginPath();
    pen.arc(px(x), py(y), radius, 0, 2 * Math.PI);
    pen.fillStyle = fill;
    pen.fill();
    pen.lineWidth = 1;
    pen.strokeStyle = edge;
    pen.stroke();
  }
  function on(name) { var element = byId("show-" + name); return element && element.checked; }
  function robot(i) { return data.robots.length ? data.robots[i % data.robots.length].colour : "#1f2d38"; }

  function draw() {
    var grid = data.grids[shown.grid], half = grid.cell / 2;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.imageSmoothingEnabled = false;
    pen.drawImage(picture, px(grid.x0 - half), py(grid.y0 + (grid.ny - 0.5) * grid.cell),
      grid.nx * grid.cell * scale, grid.ny * grid.cell * scale);
    if (hatching && on("hatch")) {
      pen.beginPath();
      hatching.forEach(function (run) {
        pen.rect(px(grid.x0 + (run[0] - 0.5) * grid.cell), py(grid.y0 + (run[1] + 0.5) * grid.cell),
          run[2] * grid.cell * scale, grid.cell * scale);
      });
      pen.fillStyle = stripes("rgba(20,25,30,.75)");
      pen.fill();
    }
    if (on("noGo")) {
      data.noGo.forEach(function (hole) {
        trace(hole, true);
        pen.fillStyle = ink("faint");
        pen.fill();
        stroke(hole.concat([hole[0]]), ink("ink"), 1);
      });
    }
    if (on("edge")) { data.edge.forEach(function (ring) { stroke(ring, ink("ink"), 1.5); }); }
    if (on("paths")) {
      data.paths.forEach(function (path, i) {
        if (data.robots.length) { stroke(path, "#fff", 3.5); }
        stroke(path, robot(i), data.robots.length ? 2 : 1.2);
        start(path[0]);
      });
    }
    if (on("samples")) {
      var colour = shown.key === "rate" || shown.key === "truth" ? painter(shown) : null;
      var size = (data.samples.length > 400 ? 2 : data.samples.length > 80 ? 2.6 : 3.5) * Math.min(Math.sqrt(scale / whole), 2.5);
      data.samples.forEach(function (s) {
        dot(s[0], s[1], size, colour ? "rgb(" + colour(s[2] / s[3]).map(Math.round).join(",") + ")" : "#fff", "#1f2d38");
      });
    }
    if (on("visits")) { stops(); }
    if (on("quarantined")) {
      data.quarantined.forEach(function (q) {
        var x = px(q[0]), y = py(q[1]);
        [["#fff", 5], ["#b3001b", 2.5]].forEach(function (style) {
          pen.beginPath();
          pen.moveTo(x - 5, y - 5); pen.lineTo(x + 5, y + 5); pen.moveTo(x - 5, y + 5); pen.lineTo(x + 5, y - 5);
          pen.strokeStyle = style[0];
          pen.lineWidth = style[1];
          pen.stroke();
        });
      });
    }
    if (place) { cross(); }
    furniture();
  }
  function start(at) {
    pen.lineWidth = 2;
    pen.strokeStyle = "#1f2d38";
    pen.strokeRect(px(at[0]) - 7, py(at[1]) - 7, 14, 14);
  }
  function stops() {
    var taken = [];
    pen.font = "600 12px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    data.visits.forEach(function (v, i) {
      var x = px(v[0]), y = py(v[1]);
      var free = taken.every(function (t) { return Math.abs(t[0] - x) > 20 || Math.abs(t[1] - y) > 18; });
      dot(v[0], v[1], free ? 10 : 3, "#fff", robot(v[5] - 1));
      if (free) {
        taken.push([x, y]);
        pen.fillStyle = "#1f2d38";
        pen.fillText(String(i + 1), x, y + 0.5);
      }
    });
  }
  function cross() {
    var x = px(place.x), y = py(place.y);
    [["#fff", 4.5], ["#111", 2]].forEach(function (style) {
      pen.beginPath();
      pen.arc(x, y, 9, 0, 2 * Math.PI);
      pen.moveTo(x - 18, y); pen.lineTo(x - 4, y); pen.moveTo(x + 4, y); pen.lineTo(x + 18, y);
      pen.moveTo(x, y - 18); pen.lineTo(x, y - 4); pen.moveTo(x, y + 4); pen.lineTo(x, y + 18);
      pen.strokeStyle = style[0];
      pen.lineWidth = style[1];
      pen.stroke();
    });
  }
  function furniture() {
    var metres = 10, steps = [1, 2, 5], power = Math.pow(10, Math.floor(Math.log10(90 / scale)));
    steps.forEach(function (s) { if (s * power * scale <= 110) { metres = s * power; } });
    var long = metres * scale, x = 10, y = height - 12;
    var text = metres >= 1000 ? metres / 1000 + " km" : metres + " m";
    pen.font = "600 13px system-ui, sans-serif";
    pen.textAlign = "left";
    pen.textBaseline = "alphabetic";
    pen.fillStyle = ink("paper");
    pen.globalAlpha = 0.85;
    pen.fillRect(x - 5, y - 23, Math.max(long, pen.measureText(text).width) + 10, 30);
    pen.fillRect(width - 30, 5, 25, 40);
    pen.globalAlpha = 1;
    pen.fillStyle = ink("ink");
    pen.fillRect(x, y - 2, long, 4);
    pen.fillText(text, x, y - 8);
    pen.textAlign = "center";
    pen.fillText("N", width - 17.5, 42);
    pen.beginPath();
    pen.moveTo(width - 17.5, 8); pen.lineTo(width - 11, 28); pen.lineTo(width - 17.5, 24); pen.lineTo(width - 24, 28);
    pen.closePath();
    pen.fill();
  }

  // ---- legend
  function number(value, digits) { return value.toFixed(digits).replace("-", "\u2212"); }
  function element(tag, text, className) {
    var made = document.createElement(tag);
    if (text) { made.textContent = text; }
    if (className) { made.className = className; }
    return made;
  }
  function legend() {
    var to = byId("map-legend");
    to.textContent = "";
    if (shown.kind === "zones") {
      data.zones.forEach(function (zone) {
        var item = element("span", zone.name + " (" + zone.limits + ")", "swatch");
        item.style.setProperty("--fill", zone.colour);
        to.appendChild(item);
      });
    } else {
      var range = limits(shown), bar = element("div", "", "bar"), ticks = element("div", "", "ticks");
      bar.style.background = "linear-gradient(to right," + shown.colours.join(",") + ")";
      var marks = range === shown.fixed ? [0, 10, 20, 30, 40, 50] : shown.ticks;
      var digits = marks.length > 1 && (marks[1] - marks[0]) % 1 === 0 && marks[0] % 1 === 0 ? 0 : shown.digits;
      marks.forEach(function (tick) {
        var mark = element("span", number(tick, digits));
        mark.style.left = 100 * (tick - range[0]) / (range[1] - range[0]) + "%";
        ticks.appendChild(mark);
      });
      to.appendChild(element("div", (shown.name || shown.title) + " [" + shown.unit + "]", "unit"));
      to.appendChild(bar);
      to.appendChild(ticks);
    }
    if (bits(shown)) { to.appendChild(element("span", shown.hatchText, "swatch hatched")); }
    byId("map-about").textContent = values(shown).every(isNaN) ? "The first survey has none before it." : shown.about;
    byId("fixed").parentNode.hidden = !shown.fixed;
  }

  // ---- reading a place
  function amount(layer, value) { return number(value, layer.digits) + " " + layer.unit; }
  function rows() {
    var found = [];
    data.layers.forEach(function (layer) {
      if (!layer.title || layer.kind === "zones" || layer.minus || spreads[layer.key]) { return; }
      var value = valueAt(layer, place.x, place.y), text;
      if (isNaN(value)) { return; }
      text = amount(layer, value);
      if (layer.sd) { text = number(value, layer.digits) + " \u00b1 " + amount(layer, valueAt(layers[layer.sd], place.x, place.y)); }
      if (layer.low) {
        text += " (90 % interval " + number(valueAt(layers[layer.low], place.x, place.y), 1) + " to " +
          number(valueAt(layers[layer.high], place.x, place.y), 1) + " %)";
        if (hatched(layer, cellAt(layer, place.x, place.y))) { text += ", " + layer.hatchText; }
      }
      found.push([layer.title, text]);
      if (layer.key === "vwc" && data.rootDepth) { found.push(["Water in the upper " + data.rootDepth + " mm", number(value / 100 * data.rootDepth, 0) + " mm"]); }
    });
    var zone = layers.zone, at = zone ? valueAt(zone, place.x, place.y) : NaN;
    if (!isNaN(at)) {
      found.push(["Zone", data.zones[Math.round(at)].name + (hatched(zone, cellAt(zone, place.x, place.y)) ? " (not certain)" : " (certain)")]);
    }
    if (!found.length) { found.push(["No value", "this place is outside the mapped field"]); }
    return found.concat(nearby());
  }
  function nearest(list) {
    var best = null, least = NEAR_PX / scale;
    list.forEach(function (item, i) {
      var d = Math.hypot(item[0] - place.x, item[1] - place.y);
      if (d <= least) { least = d; best = i; }
    });
    return best;
  }
  function nearby() {
    var found = [], s = on("samples") ? nearest(data.samples) : null, v = on("visits") ? nearest(data.visits) : null;
    var q = on("quarantined") ? nearest(data.quarantined) : null;
    if (s !== null) {
      s = data.samples[s];
      found.push(["Sample here", s[2] + " counts in " + number(s[3], 0) + " s: " + number(s[2] / s[3], 2) + " \u00b1 " +
        number(Math.sqrt(s[2]) / s[3], 2) + " counts/s"]);
    }
    if (v !== null) { found.push(["Stop " + (v + 1), data.visits[v][2] + ", " + data.visits[v][4] + " counts in " + data.visits[v][3] + " s"]); }
    if (q !== null) { found.push(["Record left out", data.quarantined[q][2]]); }
    return found;
  }
  function geographic() {
    var p = data.place, dx = (place.x - p.x) / 1000, dy = (place.y - p.y) / 1000, terms = [1, dx, dy, dx * dx, dx * dy, dy * dy];
    function sum(weights) { return weights.reduce(function (total, w, i) { return total + w * terms[i]; }, 0); }
    var lat = sum(p.latitude), lon = sum(p.longitude);
    return Math.abs(lat).toFixed(6) + "\u00b0 " + (lat < 0 ? "S" : "N") + ", " + Math.abs(lon).toFixed(6) + "\u00b0 " + (lon < 0 ? "W" : "E");
  }
  function metres() {
    return number(Math.abs(place.x), 1) + " m " + (place.x < 0 ? "west" : "east") + ", " + number(Math.abs(place.y), 1) + " m " +
      (place.y < 0 ? "south" : "north") + " of the datum";
  }
  function read() {
    var to = byId("map-readout"), list = element("dl");
    rows().concat([["Place", geographic()], ["", metres()]]).forEach(function (row) {
      var item = element("div");
      item.appendChild(element("dt", row[0] || "In the map"));
      item.appendChild(element("dd", row[1]));
      list.appendChild(item);
    });
    to.textContent = "";
    to.appendChild(list);
    if (data.labels) { course(); }
  }
  function choose(x, y) { place = { x: x, y: y }; read(); draw(); }

  // ---- input
  var held = {}, moved = 0, spread = 0;
  function local(event) { var r = canvas.getBoundingClientRect(); return { x: event.clientX - r.left, y: event.clientY - r.top }; }
  function points() { return Object.keys(held).map(function (id) { return held[id]; }); }
  function gap() { var p = points(); return p.length < 2 ? 0 : Math.hypot(p[0].x - p[1].x, p[0].y - p[1].y); }
  canvas.addEventListener("pointerdown", function (event) {
    held[event.pointerId] = local(event);
    moved = points().length > 1 ? TAP_PX + 1 : 0;
    spread = gap();
    if (event.pointerType === "mouse") { canvas.setPointerCapture(event.pointerId); }
  });
  canvas.addEventListener("pointermove", function (event) {
    var before = held[event.pointerId], now = local(event), p;
    if (!before) { return; }
    held[event.pointerId] = now;
    p = points();
    if (p.length === 1) {
      moved += Math.hypot(now.x - before.x, now.y - before.y);
      if (scale > whole * 1.01 && moved > TAP_PX) {
        centre = { x: centre.x - (now.x - before.x) / scale, y: centre.y + (now.y - before.y) / scale };
        keepInside();
        draw();
      }
    } else if (spread > 0) {
      zoom(gap() / spread, (p[0].x + p[1].x) / 2, (p[0].y + p[1].y) / 2);
      spread = gap();
    }
  });
  canvas.addEventListener("pointerup", function (event) {
    var at = local(event);
    if (held[event.pointerId] && moved <= TAP_PX && points().length === 1) {
      choose(centre.x + (at.x - width / 2) / scale, centre.y - (at.y - height / 2) / scale);
    }
    delete held[event.pointerId];
  });
  canvas.addEventListener("pointercancel", function (event) { delete held[event.pointerId]; });
  canvas.addEventListener("wheel", function (event) {
    if (!event.ctrlKey && !event.metaKey) { return; }
    var at = local(event);
    event.preventDefault();
    zoom(Math.exp(-event.deltaY / 300), at.x, at.y);
  }, { passive: false });
  canvas.addEventListener("dblclick", function (event) { var at = local(event); zoom(2, at.x, at.y); });
  box.addEventListener("keydown", function (event) {
    var cell = data.grids[shown.grid].cell * (event.shiftKey ? 10 : 1);
    var step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) { return; }
    if (step) {
      var from = place || { x: centre.x, y: centre.y }, v = data.view;
      var x = Math.min(Math.max(from.x + step[0] * cell, v[0]), v[1]), y = Math.min(Math.max(from.y + step[1] * cell, v[2]), v[3]);
      if (Math.abs(x - centre.x) > 0.45 * width / scale) { centre.x = x; }
      if (Math.abs(y - centre.y) > 0.45 * height / scale) { centre.y = y; }
      keepInside();
      choose(x, y);
    } else if (event.key === "+" || event.key === "=") { zoom(1.5, width / 2, height / 2);
    } else if (event.key === "-") { zoom(1 / 1.5, width / 2, height / 2);
    } else if (event.key === "0") { fit(); keepInside(); draw();
    } else { return; }
    event.preventDefault();
  });
  byId("zoom-in").addEventListener("click", function () { zoom(1.5, width / 2, height / 2); });
  byId("zoom-out").addEventListener("click", function () { zoom(1 / 1.5, width / 2, height / 2); });
  byId("zoom-all").addEventListener("click", function () { fit(); keepInside(); draw(); });

  // ---- choice of layers
  function select(key) { shown = layers[key]; paint(); legend(); if (width) { draw(); } }
  document.querySelectorAll("input[name=layer]").forEach(function (input) {
    input.addEventListener("change", function () { select(input.value); });
    if (input.checked) { select(input.value); }
  });
  document.querySelectorAll("#map-overlays input").forEach(function (input) { input.addEventListener("change", draw); });
  byId("fixed").addEventListener("change", function () { select(shown.key); });
  window.addEventListener("resize", resize);
  ["(prefers-color-scheme: dark)", "print"].forEach(function (query) { window.matchMedia(query).addEventListener("change", draw); });
  window.addEventListener("beforeprint", function () {
    document.querySelectorAll("details:not([open])").forEach(function (part) { part.open = true; part.dataset.opened = "yes"; });
  });
  window.addEventListener("afterprint", function () {
    document.querySelectorAll("details[data-opened]").forEach(function (part) { part.open = false; delete part.dataset.opened; });
  });
  // ---- surveys of a season: a slider over them, and the course at the place
  var slider = byId("when"), timer = null, STEP_MS = 900;
  function survey(number) {
    now = number;
    slider.value = String(now);
    slider.setAttribute("aria-valuetext", data.labels[now]);
    byId("label").textContent = data.labels[now];
    document.querySelectorAll("#surveys tbody tr").forEach(function (row, i) { row.className = i === now ? "now" : ""; });
    select(shown.key);
    if (place) { read(); }
  }
  function play(on) {
    window.clearInterval(timer);
    timer = on ? window.setInterval(function () {
      if (now === data.labels.length - 1) { play(false); } else { survey(now + 1); }
    }, STEP_MS) : null;
    byId("play").textContent = on ? "\u23f8" : "\u25b6";
    byId("play").setAttribute("aria-label", on ? "Pause" : "Play the season");
  }
  function course() {
    var layer = data.layers[0], to = byId("course-here"), cell = cellAt(layer, place.x, place.y), p, wide, end, low, high;
    var mean = data.labels.map(function (_, i) { return cell < 0 ? NaN : values(layer, i)[cell]; });
    var sd = data.labels.map(function (_, i) { return cell < 0 ? NaN : values(layers[layer.sd], i)[cell]; });
    to.hidden = isNaN(mean[now]);
    if (to.hidden) { return; }
    var tall = 170, left = 46, right = 14, top = 12, bottom = 30, sheet = to.querySelector("canvas");
    wide = to.clientWidth;
    sheet.width = wide * ratio;
    sheet.height = tall * ratio;
    sheet.style.height = tall + "px";
    low = Math.min.apply(null, mean.map(function (m, i) { return m - 2 * sd[i]; }));
    high = Math.max.apply(null, mean.map(function (m, i) { return m + 2 * sd[i]; }));
    end = data.days[data.days.length - 1] || 1;
    function x(i) { return left + (wide - left - right) * data.days[i] / end; }
    function y(v) { return top + (tall - top - bottom) * (high - v) / (high - low || 1); }
    function line(points, colour, thick) {
      p.beginPath();
      points.forEach(function (at, i) { if (i) { p.lineTo(at[0], at[1]); } else { p.moveTo(at[0], at[1]); } });
      p.strokeStyle = ink(colour);
      p.lineWidth = thick;
      p.stroke();
    }
    function write(text, atX, atY, align) { p.textAlign = align; p.fillText(text, atX, atY); }
    p = sheet.getContext("2d");
    p.setTransform(ratio, 0, 0, ratio, 0, 0);
    p.clearRect(0, 0, wide, tall);
    p.font = "13px system-ui, sans-serif";
    p.textBaseline = "middle";
    p.fillStyle = ink("soft");
    [low, (low + high) / 2, high].forEach(function (v) {
      line([[left, y(v)], [wide - right, y(v)]], "faint", 1);
      write(number(v, layer.digits), left - 6, y(v), "right");
    });
    write(data.labels[0], left, tall - 12, "left");
    write(data.labels[data.labels.length - 1], wide - right, tall - 12, "right");
    p.fillStyle = ink("line");
    mean.forEach(function (m, i) {
      line([[x(i), y(m - 2 * sd[i])], [x(i), y(m + 2 * sd[i])]], "line", 2);
      p.beginPath();
      p.arc(x(i), y(m), i === now ? 6 : 3.5, 0, 2 * Math.PI);
      p.fill();
    });
    line(mean.map(function (m, i) { return [x(i), y(m)]; }), "line", 1.5);
  }
  resize();
  if (data.labels) {
    slider.addEventListener("input", function () { play(false); survey(Number(slider.value)); });
    byId("play").addEventListener("click", function () {
      if (!timer && now === data.labels.length - 1) { survey(0); }
      play(!timer);
    });
    survey(now);
  }
}());
