// The plots of a page. Each element with data-charts="ID" holds those in the JSON with that id; they are made when the scene around them is first opened.
// Pointer: values at the nearest point; drag: zoom; double click: whole plot. A legend entry hides its lines; with Shift, all others.
"use strict";
(() => {
  const [HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [230, 62, 12, 8, 40];
  const [CHARACTER, BESIDE] = [6.2, 30];  // pixels: the width of a digit of a tick, and the room for the name of the axis
  const NEAR = 40;           // pixels within which a point has its values shown
  const SHORTEST_DRAG = 6;   // pixels; anything shorter is a click
  const DASHES = { dashed: "4 3", dotted: "1 3", dashdot: "7 3 1 3", long: "11 3" };
  const BETWEEN_MARKERS = 90;  // pixels along a line whose markers are sparse
  const MARKERS = {
    o: "M-3.2,0a3.2,3.2 0 1,0 6.4,0a3.2,3.2 0 1,0 -6.4,0", s: "M-3,-3h6v6h-6z", D: "M0,-4l4,4l-4,4l-4,-4z", "^": "M0,-4l4,7h-8z",
    v: "M0,4l4,-7h-8z", P: "M-1.3,-4h2.6v2.7h2.7v2.6h-2.7v2.7h-2.6v-2.7h-2.7v-2.6h2.7z", X: "M-3.5,-3.5l7,7M-3.5,3.5l7,-7",
    x: "M-3,-3l6,6M-3,3l6,-6", "*": "M0,-4.5v9M-4,-2.2l8,4.4M-4,2.2l8,-4.4",
  };
  const RAISED = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

  const unpacked = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const positions = (x) => (Array.isArray(x) ? x.map((value) => value ?? NaN) : Array.from({ length: x.count }, (_, i) => x.first + i * x.step));

  // --- numbers and ticks ---
  const shown = (value, digits = 3) => {
    if (value === 0) return "0";
    const size = Math.abs(value);
    const text = size < 1e-3 || size >= 1e5 ? value.toExponential(digits - 1) : String(Number(value.toPrecision(Math.max(digits, 4))));
    return text.replace("e+", "e").replaceAll("-", "−");
  };
  const power = (exponent) => "10" + [...String(exponent)].map((digit) => RAISED[digit]).join("");
  const linearTicks = ([low, high], most) => {
    const rough = (high - low) / most, size = 10 ** Math.floor(Math.log10(rough));
    const step = size * [1, 2, 5, 10].find((n) => n * size >= rough * 0.999);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const ticks = [];
    for (let n = Math.ceil(low / step - 1e-6); n * step <= high + 1e-6 * step; n += 1) {
      const value = n * step, plain = Math.abs(value) < 1e5 && digits <= 8;
      ticks.push([value, plain ? value.toFixed(digits).replace("-", "−") : shown(value)]);
    }
    return ticks;
  };
  const logTicks = ([low, high], most) => {
    const [first, last] = [Math.ceil(low - 1e-9), Math.floor(high + 1e-9)];
    if (last - first >= 1) {
      const every = Math.ceil((last - first + 1) / most);
      return Array.from({ length: last - first + 1 }, (_, i) => first + i).filter((n) => n % every === 0).map((n) => [n, power(n)]);
    }
    return linearTicks([10 ** low, 10 ** high], 4).filter(([value]) => value > 0).map(([value]) => [Math.log10(value), shown(value, 2)]);
  };

  // The label of a row: a long one has a line for each engine and one for each option.
  const linesOf = (text) => (text.length > 22 ? text.split(/(?<=,) | (?=[−(])/) : [text]);

  class Chart {
    constructor(home, raw, section, engines) {
      Object.assign(this, { home, raw, section, engines });
      this.hidden = new Set();
      this.yLog = raw.yLog ?? false;
      this.difference = false;
      this.zoomed = null;
      const xs = raw.x.map(positions);
      const reference = raw.lines.find((line) => line.label === raw.reference);
      const exact = reference && unpacked(reference.y);
      this.lines = raw.lines.map((line) => {
        const x = xs[line.x], [low, high] = [line.low, line.high].map((one) => one && unpacked(one));
        const stored = line.y ? unpacked(line.y) : low.map((value, i) => (value + high[i]) / 2), common = line.common ?? 0;
        const y = Array.from(stored, (value, i) => (i < common ? exact[i] + value : value));
        const difference = exact && Array.from(stored, (value, i) => (line === reference ? 0 : i < common ? value : NaN));
        return { ...line, x, y, low, high, difference, isEnvelope: !line.y };
      });
      this.build();
      new ResizeObserver(() => this.draw()).observe(this.plot);
    }

    get visible() {
      return this.lines.filter((line) => !this.hidden.has(line.label) && !this.engines.hidden.has(line.label));
    }

    build() {
      const { raw } = this;
      this.plot = made("div", { class: "plot" });
      this.svg = drawn("svg", { role: "img", "aria-label": [raw.yLabel, raw.xLabel].filter(Boolean).join(" over ") || "polhode" });
      this.tip = made("div", { class: "tip", role: "status", hidden: "" });
      this.plot.append(this.svg, this.tip);
      this.plot.addEventListener("pointermove", (event) => this.move(event));
      this.plot.addEventListener("pointerleave", () => this.point(null));
      this.plot.addEventListener("pointerdown", (event) => this.grab(event));
      this.plot.addEventListener("pointerup", (event) => this.release(event));
      this.plot.addEventListener("pointercancel", () => { this.grabbed = null; this.draw(); });
      this.plot.addEventListener("dblclick", () => this.zoom(null));
      const toggle = (text, isOn, act) => made("button", { type: "button", "aria-pressed": String(isOn()), onclick: (event) => {
        act();
        event.currentTarget.setAttribute("aria-pressed", String(isOn()));
        this.zoom(null);
      } }, text);
      this.whole = made("button", { type: "button", hidden: "", onclick: () => this.zoom(null) }, "Whole plot");
      const tools = made("div", { class: "tools" });
      if (!raw.rows && !raw.map) tools.append(toggle("Log", () => this.yLog, () => { this.yLog = !this.yLog; }));
      if (raw.reference) tools.append(toggle("Difference from exact", () => this.difference, () => { this.difference = !this.difference; }));
      tools.append(this.whole);
      this.legend = made("div", { class: "legend" });
      for (const label of new Set(this.lines.map((line) => line.label))) this.legend.append(this.entry(label));
      this.home.append(this.plot, this.legend, tools, ...(raw.remark ? [made("p", { class: "quiet" }, raw.remark)] : []));
    }

    entry(label) {
      const line = this.lines.find((one) => one.label === label), swatch = drawn("svg", { width: 22, height: 10, "aria-hidden": "true" });
      swatch.append(...this.strokes(line, "M1,5H21", [[11, 5]]));
      const button = made("button", { type: "button", "aria-pressed": "true", title: "Hide or show; with Shift: this one alone" }, swatch, line.name ?? label);
      button.dataset.label = label;
      button.addEventListener("click", (event) => {
        if (event.shiftKey) {
          const others = this.lines.map((one) => one.label).filter((one) => one !== label);
          const alone = others.every((one) => this.hidden.has(one)) && !this.hidden.has(label);
          this.hidden = new Set(alone ? [] : others);
        } else if (!this.hidden.delete(label)) this.hidden.add(label);
        this.draw();
      });
      return button;
    }

    // The values of a line as they are drawn: as they are, or their difference from the exact solution; on a logarithmic axis their sizes.
    values(line) {
      const y = this.difference ? line.difference : line.y;
      return this.yLog ? Array.from(y, (value) => Math.log10(Math.max(Math.abs(value), this.floor))) : y;
    }

    get floor() {
      return this.raw.rounding ? this.raw.rounding / 10 : 1e-17;
    }

    xOf(value) {
      return this.raw.xLog ? Math.log10(value) : value;
    }

    ranges() {
      if (this.zoomed) return this.zoomed;
      const reach = (all) => all.reduce(([a, b], v) => (Number.isFinite(v) ? [Math.min(a, v), Math.max(b, v)] : [a, b]), [Infinity, -Infinity]);
      const lines = this.visible, size = (value) => (this.yLog ? Math.log10(Math.max(Math.abs(value), this.floor)) : value);
      let x = this.raw.xRange ? this.raw.xRange.map((v) => this.xOf(v)) : reach(lines.flatMap((line) => line.x.map((v) => this.xOf(v))));
      const bands = this.difference ? [] : lines.flatMap((line) => [line.low, line.high]).filter(Boolean).flatMap((band) => Array.from(band, size));
      let y = reach([...lines.flatMap((line) => Array.from(this.values(line))), ...bands]);
      if (this.raw.rows) y = [this.raw.rows.length - 0.5, -0.5];
      else if (!Number.isFinite(y[0])) y = [0, 1];
      else if (this.raw.flat && !this.difference && !this.yLog) y = [Math.min(0, 2 * y[0]), Math.max(0, 2 * y[1])];
      if (!Number.isFinite(x[0])) x = [0, 1];
      const wider = ([a, b], share) => (a === b ? [a - 0.5, b + 0.5] : [a - share * (b - a), b + share * (b - a)]);
      return [this.raw.xRange ? x : wider(x, this.raw.map ? 0.12 : 0.03), this.raw.rows ? y : wider(y, this.raw.map ? 0.12 : 0.05)];
    }

    draw() {
      const width = this.plot.clientWidth, { raw } = this;
      if (!width) return;
      for (const button of this.legend.children) {
        button.setAttribute("aria-pressed", String(!this.hidden.has(button.dataset.label)));
        button.hidden = this.engines.hidden.has(button.dataset.label);
      }
      let [[x0, x1], [y0, y1]] = this.ranges();
      this.yTicks = raw.rows ? raw.rows.map((row, i) => [i, row]) : (this.yLog ? logTicks : linearTicks)([y0, y1], 6);
      const longest = Math.max(0, ...this.yTicks.map(([, text]) => text.length));
      const left = raw.rows ? Math.min(0.36 * width, CHARACTER * Math.max(...raw.rows.flatMap(linesOf).map((text) => text.length)) + 1.5 * BESIDE) : raw.map ? RIGHT : Math.max(LEFT, CHARACTER * longest + BESIDE), height = raw.rows ? 60 + Math.max(26, ...raw.rows.map((row) => 12 * linesOf(row).length)) * raw.rows.length : HEIGHT;
      const [wide, tall] = [width - left - RIGHT, height - TOP - (raw.map ? TOP : BOTTOM)];
      if (raw.map) {   // the same scale along both axes
        const scale = Math.max((x1 - x0) / wide, (y1 - y0) / tall), [mx, my] = [(x0 + x1) / 2, (y0 + y1) / 2];
        [x0, x1, y0, y1] = [mx - scale * wide / 2, mx + scale * wide / 2, my - scale * tall / 2, my + scale * tall / 2];
      }
      this.frame = { x0, x1, y0, y1, left, wide, tall, width, height };
      this.toX = (v) => left + (this.xOf(v) - x0) / (x1 - x0) * wide;
      this.toY = (v) => TOP + (y1 - v) / (y1 - y0) * tall;
      this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      this.svg.setAttribute("height", height);
      const clip = `clip-${raw.id}`;
      const box = drawn("clipPath", { id: clip });
      box.append(drawn("rect", { x: left, y: TOP, width: wide, height: tall }));
      const marks = drawn("g", { "clip-path": `url(#${clip})` });
      for (const line of this.visible) marks.append(...this.path(line));
      this.cursor = drawn("line", { class: "now", y1: TOP, y2: TOP + tall, visibility: "hidden" });
      this.spot = drawn("g", { class: "spot" });
      this.frameOfZoom = drawn("rect", { class: "zoom", visibility: "hidden" });
      const texts = (raw.texts ?? []).map(([x, y, text]) => drawn("text", { x: this.toX(x), y: this.toY(y), "text-anchor": "middle" }, text));
      this.svg.replaceChildren(box, ...(raw.map ? [] : this.axes()), marks, ...texts, this.cursor, this.spot, this.frameOfZoom);
      this.whole.hidden = !this.zoomed;
      if (this.time !== undefined) this.seek(this.time);
    }

    axes() {
      const { x0, x1, y0, y1, left, wide, tall, height } = this.frame, { raw } = this, parts = [];
      const xTicks = raw.ticks ? raw.ticks.map(([v, text]) => [this.xOf(v), text]) : (raw.xLog ? logTicks : linearTicks)([x0, x1], wide / 60);
      let used = -Infinity;
      for (const [v, text] of xTicks.filter(([v]) => v >= x0 - 1e-9 && v <= x1 + 1e-9)) {
        const x = left + (v - x0) / (x1 - x0) * wide, half = 3.2 * text.length + 3;
        if (x - half < used) continue;
        used = x + half;
        parts.push(drawn("line", { class: "grid", x1: x, x2: x, y1: TOP, y2: TOP + tall }), drawn("text", { x, y: TOP + tall + 15, "text-anchor": "middle" }, text));
      }
      for (const [v, text] of this.yTicks) {
        const y = this.toY(v);
        if (!raw.rows) parts.push(drawn("line", { class: "grid", x1: left, x2: left + wide, y1: y, y2: y }));
        const label = drawn("text", { x: left - 6, y: y + 4, "text-anchor": "end" }, raw.rows ? "" : text);
        if (raw.rows) label.append(...this.inRows(text, left - 6, y));
        parts.push(label);
      }
      if (raw.rounding && this.yLog) {
        const top = Math.max(TOP, this.toY(Math.log10(raw.rounding)));
        if (top < TOP + tall) parts.push(drawn("rect", { class: "rounding", x: left, y: top, width: wide, height: TOP + tall - top }));
      }
      parts.push(drawn("text", { x: left + wide / 2, y: height - 6, "text-anchor": "middle" }, raw.xLabel));
      const name = drawn("text", { transform: `translate(${raw.yLabel?.includes("\n") ? 10 : 16},${TOP + tall / 2}) rotate(-90)`, "text-anchor": "middle" });
      const words = (this.difference ? [this.yLog ? "absolute difference" : "difference"] : []).concat((raw.yLabel ?? "").split("\n"));
      name.append(...words.map((part, i) => drawn("tspan", { x: 0, dy: i ? 12 : 0 }, part)));
      parts.push(name);
      return parts;
    }

    inRows(text, x, y) {
      const parts = linesOf(text);
      return parts.map((part, i) => drawn("tspan", { x, y: y + 4 + (i - (parts.length - 1) / 2) * 11 }, part));
    }

    path(line) {
      const y = this.values(line), points = [];
      let d = "", isDown = false;
      for (let i = 0; i < y.length; i += 1) {
        if (!Number.isFinite(y[i]) || !Number.isFinite(line.x[i])) { isDown = false; continue; }
        const [px, py] = [this.toX(line.x[i]).toFixed(1), this.toY(y[i]).toFixed(1)];
        d += isDown && line.step ? `H${px}V${py}` : `${isDown ? "L" : "M"}${px},${py}`;
        isDown = true;
        points.push([px, py]);
      }
      const parts = [];
      if (line.low && !this.difference) {
        const scaled = (v) => this.toY(this.yLog ? Math.log10(Math.max(Math.abs(v), this.floor)) : v).toFixed(1);
        const there = line.x.map((_, i) => i).filter((i) => Number.isFinite(line.low[i]) && Number.isFinite(line.high[i]));
        const edge = (band, rows) => rows.map((i) => `${this.toX(line.x[i]).toFixed(1)},${scaled(band[i])}`).join("L");
        const band = `M${edge(line.high, there)}L${edge(line.low, [...there].reverse())}Z`;
        if (there.length) parts.push(drawn("path", { d: band, fill: line.colour || "currentColor", "fill-opacity": 0.15, stroke: line.isEnvelope ? line.colour || "currentColor" : "none", "data-label": line.label }));
      }
      if (!line.isEnvelope) parts.push(...this.strokes(line, d, line.sparse ? this.thinned(line, points) : points));
      return parts;
    }

    // A few of the points, at other places for each line, so that the markers of lines that coincide are all visible.
    thinned(line, points) {
      const sparse = this.lines.filter((one) => one.sparse);
      let left = (sparse.indexOf(line) + 0.5) / sparse.length * BETWEEN_MARKERS;
      return points.filter((point, i) => {
        left -= i ? Math.hypot(point[0] - points[i - 1][0], point[1] - points[i - 1][1]) : 0;
        const isMarked = left <= 0;
        if (isMarked) left = BETWEEN_MARKERS;
        return isMarked;
      });
    }

    strokes(line, d, points) {
      const colour = line.colour || "currentColor", parts = [];
      if (line.width && d) {
        parts.push(drawn("path", { d, fill: "none", stroke: colour, "stroke-width": line.width, "stroke-linejoin": "round", "data-label": line.label, ...(line.dashes ? { "stroke-dasharray": DASHES[line.dashes] } : {}) }));
      }
      if (line.marker) {
        for (const [x, y] of points) parts.push(drawn("path", { d: MARKERS[line.marker], transform: `translate(${x},${y})`, fill: "none", stroke: colour, "stroke-width": 1.4, "data-label": line.label }));
      }
      return parts;
    }

    // --- pointer ---
    at(event) {
      const box = this.svg.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    }

    nearest([px, py]) {
      let best = { distance: NEAR };
      for (const line of this.visible) {
        const y = this.values(line);
        for (let i = 0; i < y.length; i += 1) {
          if (!Number.isFinite(y[i])) continue;
          const distance = Math.hypot(this.toX(line.x[i]) - px, this.toY(y[i]) - py);
          if (distance < best.distance) best = { distance, line, i };
        }
      }
      return best.line ? best : null;
    }

    move(event) {
      const here = this.at(event);
      if (this.grabbed) {
        const [a, b] = [this.grabbed, here];
        for (const [key, value] of Object.entries({ x: Math.min(a[0], b[0]), y: Math.min(a[1], b[1]), width: Math.abs(a[0] - b[0]), height: Math.abs(a[1] - b[1]), visibility: "visible" })) {
          this.frameOfZoom.setAttribute(key, value);
        }
      } else this.point(this.raw.map || this.raw.rows ? null : this.nearest(here));
    }

    // Show the values of a point, and those of the other lines at the same place.
    point(found) {
      this.tip.hidden = !found;
      this.spot?.replaceChildren();
      if (!found) return;
      const { line, i } = found, x = line.x[i], y = this.values(line);
      this.spot.append(drawn("circle", { cx: this.toX(x), cy: this.toY(y[i]), r: 4, fill: "none", stroke: line.colour || "currentColor", "stroke-width": 2 }));
      const text = (one, at) => {
        if (one.low && !this.difference) return `${shown(one.low[at])} … ${shown(one.high[at])}`;
        const value = (this.difference ? one.difference : one.y)[at];
        const isRounding = Math.abs(value) <= (this.raw.rounding ?? 0) || (this.difference && this.raw.flat && Math.abs(value) <= 1e-9 * Math.abs(one.y[at]));
        return isRounding ? "≈ 0 (rounding)" : shown(value);
      };
      const place = this.raw.ticks?.find(([v]) => Math.abs(v - x) <= 1e-9 * Math.abs(x))?.[1] ?? shown(x, 4);
      const rows = this.visible.flatMap((one) => {
        const at = one === line ? i : one.x.findIndex((v) => Math.abs(v - x) <= 1e-9 * Math.abs(x));
        return at < 0 || !Number.isFinite(one.y[at]) || (one !== line && one.dashes === "dashed" && one.colour) ? [] : [made("div", one === line ? { class: "chosen" } : {}, `${one.name ?? one.label}: ${text(one, at)}`)];
      });
      this.tip.replaceChildren(made("div", { class: "quiet" }, `${(this.raw.xLabel ?? "").replace(/ \[.*/, "")} ${place}`), ...rows);
      const right = this.toX(x) > this.frame.width / 2;
      this.tip.style.left = right ? "" : `${this.toX(x) + 12}px`;
      this.tip.style.right = right ? `${this.frame.width - this.toX(x) + 12}px` : "";
      this.tip.style.top = `${Math.max(0, Math.min(this.toY(y[i]) - 20, this.frame.height - 90))}px`;
    }

    grab(event) {
      if (event.button !== 0 || this.raw.map || this.raw.rows) return;
      this.grabbed = this.at(event);
      this.plot.setPointerCapture(event.pointerId);
      this.point(null);
    }

    release(event) {
      if (!this.grabbed) return;
      const [a, b] = [this.grabbed, this.at(event)];
      this.grabbed = null;
      this.frameOfZoom.setAttribute("visibility", "hidden");
      const { x0, x1, y0, y1, left, wide, tall } = this.frame;
      const xAt = (px) => x0 + (px - left) / wide * (x1 - x0), yAt = (py) => y1 - (py - TOP) / tall * (y1 - y0);
      if (Math.hypot(a[0] - b[0], a[1] - b[1]) < SHORTEST_DRAG) {
        if (this.raw.xLabel?.startsWith("time [")) this.section.dispatchEvent(new CustomEvent("dropspin:seek", { detail: xAt(b[0]) }));
        return;
      }
      const range = (u, v, most) => (Math.abs(u - v) < most ? null : [Math.min(u, v), Math.max(u, v)]);
      const x = range(xAt(a[0]), xAt(b[0]), 0.02 * (x1 - x0)), y = range(yAt(a[1]), yAt(b[1]), 0.02 * (y1 - y0));
      this.zoom([x ?? [x0, x1], y ?? [y0, y1]]);
    }

    zoom(ranges) {
      this.zoomed = ranges;
      this.draw();
    }

    // Mark a time of the replay.
    seek(time) {
      this.time = time;
      if (!this.cursor || !this.raw.xLabel?.startsWith("time [")) return;
      const x = this.toX(time), { left, wide } = this.frame;
      this.cursor.setAttribute("x1", x);
      this.cursor.setAttribute("x2", x);
      this.cursor.setAttribute("visibility", x >= left && x <= left + wide ? "visible" : "hidden");
    }
  }

  const engines = { hidden: new Set() }, charts = [];
  const open = (home) => {
    const section = home.closest("section") ?? document.body;
    const all = JSON.parse(document.getElementById(home.dataset.charts).textContent);
    all.forEach((raw, i) => {
      const figure = made("div", { class: "chart" });
      home.append(figure);
      figure.chart = new Chart(figure, { ...raw, id: `${home.dataset.charts}-${i}` }, section, engines);
      charts.push(figure.chart);
    });
    const mine = charts.slice(-all.length);
    section.addEventListener("dropspin:time", (event) => { for (const chart of mine) chart.seek(event.detail); });
  };
  for (const home of document.querySelectorAll("[data-charts]")) {
    const scene = home.closest("details");
    if (!scene || scene.open) open(home);
    else scene.addEventListener("toggle", () => open(home), { once: true });
  }
  document.addEventListener("dropspin:engines", (event) => {
    engines.hidden = new Set(event.detail);
    for (const chart of charts) chart.draw();
  });
})();
