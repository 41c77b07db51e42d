// The viewer of the motions of a scene. For each one a page has an element with data-replay="ID", and its data as JSON in the element with that id.
"use strict";
(() => {
  const LIGHT = [0.35, 0.85, 0.4];
  const SPEEDS = [0.01, 0.03, 0.1, 0.25, 0.5, 1, 2];
  const SHORTEST_SHOW = 4;     // seconds that a motion lasts at least at the speed chosen first, if a speed is slow enough
  const GLOW = 0.35;           // seconds that an impulse stays visible
  const MARGIN = 1.15;
  const FOCAL = 1.2;           // of the smaller side of a view

  // --- vectors and quaternions [x, y, z, w] ---
  const plus = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
  const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const size = (a) => Math.hypot(...a);
  const rotate = (q, v) => {
    const t = times(cross(q, v), 2);
    return plus(plus(v, t, q[3]), cross(q, t));
  };
  const multiply = (a, b) => [...plus(plus(times(b, a[3]), a, b[3]), cross(a, b)), a[3] * b[3] - dot(a, b)];
  // The shorter rotation from one attitude to another.
  const shorter = (a, b) => {
    const q = multiply(b, [-a[0], -a[1], -a[2], a[3]]), v = q[3] < 0 ? times(q, -1) : q.slice(0, 3);
    return { axis: times(v, 1 / (size(v) || 1)), angle: 2 * Math.atan2(size(v), Math.abs(q[3])) };
  };
  // A fraction of that rotation and of the whole turns beyond it.
  const turned = (a, b, share, turns) => {
    const { axis, angle } = shorter(a, b), half = share * (angle / 2 + Math.PI * turns);
    return multiply([...times(axis, Math.sin(half)), Math.cos(half)], a);
  };

  // --- data ---
  const unpackedColumn = (column, count) => {
    if (typeof column === "number") return Array(count).fill(column);
    const bytes = Uint8Array.from(atob(column.data), (c) => c.charCodeAt(0));
    return "scale" in column ? Array.from(new Int32Array(bytes.buffer), (n) => n * column.scale) : Array.from(new Float64Array(bytes.buffer));
  };
  const unpacked = (columns, count) => {
    const all = columns.map((column) => unpackedColumn(column, count));
    return Array.from({ length: columns.length ? count : 0 }, (_, row) => all.map((column) => column[row]));
  };
  const readMotion = (raw, interval) => {
    const position = unpacked(raw.position, raw.count), orientation = unpacked(raw.orientation, raw.count);
    const impulses = unpacked(raw.impulses, raw.struck.length), points = unpacked(raw.points, raw.struck.length);
    const last = position.length - 1;
    return {
      label: raw.label, colour: raw.colour, isExact: raw.isExact, shown: true, position, orientation, last,
      hasEnded: (time) => time > last * interval + 1e-9,
      strikes: raw.struck.map((frame, i) => ({ time: frame * interval, impulse: impulses[i], point: points[i] })),
      at(time) {
        const place = Math.max(0, Math.min(time / interval, last)), row = Math.min(Math.floor(place + 1e-9), last), s = place - row;
        if (s < 1e-6 || row === last) return { position: position[row], orientation: orientation[row] };
        return {
          position: plus(times(position[row], 1 - s), position[row + 1], s),
          orientation: turned(orientation[row], orientation[row + 1], s, raw.turns[row] ?? 0),
        };
      },
    };
  };

  // --- page ---
  const made = (tag, attributes = {}, ...children) => {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
      else element.setAttribute(name, value);
    }
    element.append(...children);
    return element;
  };
  const labelled = (text, control) => made("label", {}, text + " ", control);
  const options = (pairs, chosen) => pairs.map(([value, text]) => {
    const option = made("option", { value }, text);
    option.selected = value === chosen;
    return option;
  });
  const rounded = (n) => (n === 0 ? "0" : Math.abs(n) >= 0.0995 && Math.abs(n) < 1000 ? n.toFixed(3) : n.toExponential(1));
  const shade = (colour, light) => {
    const parts = [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
    return `rgb(${parts.map((n) => Math.round(light < 1 ? n * light : n + (255 - n) * (light - 1))).join(" ")})`;
  };

  class Viewer {
    constructor(home, data) {
      this.home = home;
      this.body = data.body;
      this.interval = data.interval;
      this.hasFloor = data.hasFloor;
      this.size = data.size;
      this.sight = data.sight;
      this.scene = data.scene;
      this.motions = data.motions.map((raw) => readMotion(raw, data.interval));
      this.exact = this.motions.find((motion) => motion.isExact);
      this.engines = this.motions.filter((motion) => !motion.isExact);
      this.frames = Math.max(...this.motions.map((motion) => motion.last));
      this.duration = this.frames * this.interval;
      this.strongest = Math.max(0, ...this.motions.flatMap((motion) => motion.strikes.map((strike) => size(strike.impulse))));
      this.time = 0;
      this.running = 0;
      this.findPlots();
      this.build();
      this.frame();
      new ResizeObserver(() => this.draw()).observe(this.canvas);
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    }

    // Native controls work with keyboards and screen readers.
    build() {
      this.canvas = made("canvas", {
        role: "img", tabindex: "0", "aria-label": `${this.scene} in 3D; arrow keys turn the view, plus and minus zoom`,
        onpointerdown: (event) => this.grab(event), onpointermove: (event) => this.drag(event), onpointerup: () => { this.grabbed = null; },
        onkeydown: (event) => this.key(event), ondblclick: () => { this.frame(); this.draw(); },
      });
      this.canvas.addEventListener("wheel", (event) => {
        if (!event.ctrlKey && document.activeElement !== this.canvas) return;
        event.preventDefault();
        this.zoom(event.deltaY > 0 ? 1.1 : 1 / 1.1);
      }, { passive: false });
      this.button = made("button", { type: "button", onclick: () => this.toggle() }, "Play");
      this.slider = made("input", {
        type: "range", min: "0", max: String(this.frames), step: "1", value: "0", "aria-label": "time",
        oninput: () => { this.stop(); this.seek(this.slider.valueAsNumber * this.interval); },
      });
      this.clock = made("output", {});
      const slow = SPEEDS.findLast((speed) => this.duration / speed >= SHORTEST_SHOW) ?? SPEEDS[0];
      this.speed = made("select", { onchange: () => { if (this.running) this.play(); } }, ...options(SPEEDS.map((n) => [String(n), `${n} ×`]), String(Math.min(1, slow))));
      this.layout = made("select", { onchange: () => this.draw() }, ...options([["over", "overlaid"], ["beside", "side by side"]], "over"));
      this.follow = made("input", { type: "checkbox", onchange: () => this.draw() });
      const step = (frames, text, label) => made("button", {
        type: "button", "aria-label": label, onclick: () => { this.stop(); this.seek((Math.round(this.time / this.interval) + frames) * this.interval); },
      }, text);
      this.rows = this.motions.map((motion) => this.row(motion));
      const heads = ["shown", "height [m]", ...(this.exact ? ["position error [m]", "attitude error [rad]"] : []), ...(this.hasFloor ? ["last impulse [N s]"] : [])];
      const table = made("table", {}, made("thead", {}, made("tr", {}, ...heads.map((text) => made("th", { scope: "col" }, text)))),
        made("tbody", {}, ...this.rows.map((row) => row.element)));
      const box = made("div", { class: "scroll", role: "region", "aria-label": `${this.scene}: positions of the bodies` }, table);
      stopWhereItScrolls.observe(box);
      this.home.replaceChildren(
        this.canvas,
        made("p", { class: "controls" }, this.button, step(-1, "◂", "one frame back"), step(1, "▸", "one frame on"), this.slider, this.clock,
          labelled("speed", this.speed), labelled("engines", this.layout), labelled("follow", this.follow)),
        box,
      );
    }

    row(motion) {
      const box = made("input", { type: "checkbox", onchange: () => { motion.shown = box.checked; this.draw(); } });
      box.checked = true;
      const dot = made("span", { class: "dot", style: motion.colour ? `background:${motion.colour}` : "border:1px dashed" });
      const cells = Array.from({ length: 1 + (this.exact ? 2 : 0) + (this.hasFloor ? 1 : 0) }, () => made("td"));
      return { cells, element: made("tr", {}, made("th", { scope: "row" }, made("label", {}, box, " ", dot, motion.label)), ...cells) };
    }

    // Plots over time in the same section set the time, and mark it.
    findPlots() {
      this.section = this.home.closest("section") ?? document.body;
      this.section.addEventListener("dropspin:seek", (event) => {
        this.stop();
        this.seek(event.detail);
      });
    }

    // --- time ---
    toggle() {
      if (this.running) this.stop();
      else this.play();
    }

    play() {
      this.stop();
      const start = { time: this.time >= this.duration - 1e-9 ? 0 : this.time, at: performance.now() };
      const tick = (now) => {
        this.seek(start.time + Math.max(0, now - start.at) / 1000 * Number(this.speed.value));
        if (this.time >= this.duration) this.stop();
        else this.running = requestAnimationFrame(tick);
      };
      this.running = requestAnimationFrame(tick);
      this.button.textContent = "Pause";
    }

    stop() {
      cancelAnimationFrame(this.running);
      this.running = 0;
      this.button.textContent = "Play";
    }

    seek(time) {
      this.time = Math.max(0, Math.min(time, this.duration));
      this.draw();
    }

    // The current poses of the bodies, by label.
    poses() {
      return Object.fromEntries(this.motions.map((motion) => [motion.label, motion.at(this.time)]));
    }

    // --- camera ---
    axes() {
      const [sa, ca, se, ce] = [Math.sin(this.azimuth), Math.cos(this.azimuth), Math.sin(this.elevation), Math.cos(this.elevation)];
      const right = [ca, 0, -sa], back = [sa * ce, se, ca * ce];
      return [right, cross(back, right), back];
    }

    // Fit the whole motion into the view, from slightly above.
    frame() {
      this.azimuth = 0.5;
      this.elevation = 0.22;
      const axes = this.axes(), start = this.motions[0].position[0];
      const points = this.motions.flatMap((motion) => motion.position).filter((point) => size(plus(point, start, -1)) <= this.sight);
      const along = axes.map((axis) => points.map((point) => dot(axis, point)));
      const low = along.map((all) => all.reduce((a, b) => Math.min(a, b)) - this.size);
      const high = along.map((all) => all.reduce((a, b) => Math.max(a, b)) + this.size);
      this.extent = low.map((least, i) => high[i] - least);
      this.target = axes.reduce((sum, axis, i) => plus(sum, axis, (low[i] + high[i]) / 2), [0, 0, 0]);
      this.reach = Math.max(...this.extent) / 2;
      this.zoomFactor = 1;
      this.follow.checked = this.reach > 25 * this.size;
    }

    grab(event) {
      this.canvas.setPointerCapture(event.pointerId);
      this.grabbed = [event.clientX, event.clientY];
    }

    drag(event) {
      if (!this.grabbed) return;
      this.turn((event.clientX - this.grabbed[0]) * 0.008, (event.clientY - this.grabbed[1]) * 0.008);
      this.grabbed = [event.clientX, event.clientY];
    }

    turn(sideways, down) {
      this.azimuth -= sideways;
      this.elevation = Math.max(-0.2, Math.min(1.5, this.elevation + down));
      this.draw();
    }

    zoom(factor) {
      this.zoomFactor = Math.max(0.02, Math.min(10, this.zoomFactor * factor));
      this.draw();
    }

    key(event) {
      const turns = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
      const zooms = { "+": 1 / 1.1, "=": 1 / 1.1, "-": 1.1 };
      if (event.key in turns) this.turn(...turns[event.key]);
      else if (event.key in zooms) this.zoom(zooms[event.key]);
      else if (event.key === " ") this.toggle();
      else return;
      event.preventDefault();
    }

    // --- drawing ---
    draw() {
      const ratio = devicePixelRatio || 1, width = this.canvas.clientWidth, height = this.canvas.clientHeight;
      if (!width || !height) return;
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
      const pen = this.canvas.getContext("2d");
      pen.scale(ratio, ratio);
      this.ink = getComputedStyle(this.canvas).color;
      const isThere = (motion) => motion.shown && !motion.hasEnded(this.time);
      const visible = this.engines.filter(isThere), ghost = this.exact && isThere(this.exact) ? this.exact : null;
      const views = this.layout.value === "beside" && visible.length > 1 ? visible.map((motion) => [motion]) : [visible];
      const columns = Math.min(views.length, Math.max(1, Math.round(Math.sqrt(views.length * width / height))));
      const rows = Math.ceil(views.length / columns);
      views.forEach((motions, i) => {
        const box = { left: (i % columns) * width / columns, top: Math.floor(i / columns) * height / rows, width: width / columns, height: height / rows };
        pen.save();
        pen.beginPath();
        pen.rect(box.left, box.top, box.width, box.height);
        pen.clip();
        this.drawView(pen, box, motions, ghost);
        if (views.length > 1) {
          pen.fillStyle = this.ink;
          pen.font = "13px system-ui, sans-serif";
          pen.fillText(motions[0].label, box.left + 8, box.top + 18);
        }
        pen.restore();
      });
      this.updateTable();
    }

    drawView(pen, box, motions, ghost) {
      const leading = motions[0] ?? ghost;
      const target = this.follow.checked && leading ? leading.at(this.time).position : this.target;
      const [right, up, back] = this.axes(), [wide, tall, deep] = this.extent;
      const focal = FOCAL * Math.min(box.width, box.height), whole = deep / 2 + MARGIN * focal * Math.max(wide / box.width, tall / box.height);
      const distance = this.zoomFactor * whole * (this.follow.checked ? Math.min(1, 4 * this.size / this.reach) : 1);
      const eye = plus(target, back, distance);
      const seen = (p) => {
        const arm = plus(p, eye, -1), depth = -dot(arm, back);
        const scale = focal / Math.max(depth, 1e-3 * distance);
        return { x: box.left + box.width / 2 + scale * dot(arm, right), y: box.top + box.height / 2 - scale * dot(arm, up), depth, scale };
      };
      const view = { pen, seen, eye, target, reach: this.follow.checked ? 4 * this.size : this.reach };
      if (this.hasFloor) this.drawFloor(view);
      const nearest = (motion) => seen(motion.at(this.time).position).depth;
      const farFirst = [...motions].sort((a, b) => nearest(b) - nearest(a));
      for (const motion of farFirst) {
        if (this.hasFloor) this.drawShadow(view, motion);
        this.drawTrail(view, motion);
      }
      for (const motion of farFirst) this.drawBody(view, motion, motions.length > 1 ? 0.6 : 0.9);
      if (ghost) {
        this.drawTrail(view, ghost);
        this.drawGhost(view, ghost);
      }
      for (const motion of [...farFirst, ...(ghost ? [ghost] : [])]) this.drawContact(view, motion);
    }

    drawFloor({ pen, seen, target, reach }) {
      const spacing = 10 ** Math.floor(Math.log10(reach / 2)), lines = Math.ceil(reach / spacing);
      const [x, z] = [Math.round(target[0] / spacing), Math.round(target[2] / spacing)];
      pen.strokeStyle = this.ink;
      pen.lineWidth = 1;
      pen.globalAlpha = 0.18;
      pen.beginPath();
      for (let n = -lines; n <= lines; n++) {
        this.path(pen, [[(x + n) * spacing, 0, (z - lines) * spacing], [(x + n) * spacing, 0, (z + lines) * spacing]].map(seen));
        this.path(pen, [[(x - lines) * spacing, 0, (z + n) * spacing], [(x + lines) * spacing, 0, (z + n) * spacing]].map(seen));
      }
      pen.stroke();
      pen.globalAlpha = 1;
    }

    path(pen, points) {
      points.forEach(({ x, y }, i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    }

    corners(motion) {
      const { position, orientation } = motion.at(this.time);
      return this.body.vertices.map((vertex) => plus(position, rotate(orientation, vertex)));
    }

    drawShadow({ pen, seen }, motion) {
      const corners = this.corners(motion);
      pen.fillStyle = this.ink;
      pen.globalAlpha = 0.1;
      pen.beginPath();
      if (this.body.radius) {
        const [x, , z] = corners[0], r = this.body.radius;
        this.path(pen, Array.from({ length: 33 }, (_, i) => seen([x + r * Math.cos(i * Math.PI / 16), 0, z + r * Math.sin(i * Math.PI / 16)])));
      } else {
        // The faces that point up cover the shadow once.
        for (const face of this.body.faces) {
          const flat = face.map((i) => [corners[i][0], 0, corners[i][2]]);
          if (this.body.isFlat || this.normal(face.map((i) => corners[i]))[1] > 0) this.path(pen, [...flat, flat[0]].map(seen));
        }
      }
      pen.fill();
      pen.globalAlpha = 1;
    }

    normal(points) {
      const n = [0, 0, 0].map((_, i) => points.reduce((sum, p, k) => sum + cross(p, points[(k + 1) % points.length])[i], 0));
      return times(n, 1 / (size(n) || 1));
    }

    drawTrail({ pen, seen }, motion) {
      const until = Math.min(motion.last, Math.floor(this.time / this.interval + 1e-9));
      pen.strokeStyle = motion.colour || this.ink;
      pen.lineWidth = 1;
      pen.globalAlpha = 0.5;
      pen.setLineDash(motion.isExact ? [3, 4] : []);
      pen.beginPath();
      this.path(pen, [...motion.position.slice(0, until + 1), motion.at(this.time).position].map(seen));
      pen.stroke();
      pen.setLineDash([]);
      pen.globalAlpha = 1;
    }

    drawBody(view, motion, alpha) {
      const { pen, seen, eye } = view;
      if (this.body.radius) {
        this.drawBall(view, motion, alpha);
        return;
      }
      const corners = this.corners(motion);
      for (const face of this.body.faces) {
        const points = face.map((i) => corners[i]), normal = this.normal(points), facing = dot(normal, plus(eye, points[0], -1));
        if (facing <= 0 && !this.body.isFlat) continue;
        const lit = dot(normal, LIGHT) * Math.sign(facing || 1);
        pen.beginPath();
        this.path(pen, points.map(seen));
        pen.closePath();
        pen.globalAlpha = alpha;
        pen.fillStyle = shade(motion.colour, 0.85 + 0.4 * lit);
        pen.fill();
        pen.globalAlpha = 1;
        pen.strokeStyle = shade(motion.colour, 0.6);
        pen.lineWidth = 1.2;
        pen.stroke();
      }
    }

    drawBall({ pen, seen, eye }, motion, alpha) {
      const { position, orientation } = motion.at(this.time), r = this.body.radius, centre = seen(position);
      pen.beginPath();
      pen.arc(centre.x, centre.y, r * centre.scale, 0, 2 * Math.PI);
      if (!motion.isExact) {
        const glow = pen.createRadialGradient(centre.x + 0.3 * r * centre.scale, centre.y - 0.45 * r * centre.scale, 0, centre.x, centre.y, r * centre.scale);
        glow.addColorStop(0, shade(motion.colour, 1.25));
        glow.addColorStop(1, shade(motion.colour, 0.7));
        pen.globalAlpha = alpha;
        pen.fillStyle = glow;
        pen.fill();
      }
      pen.globalAlpha = 1;
      pen.strokeStyle = motion.isExact ? this.ink : shade(motion.colour, 0.6);
      pen.lineWidth = 1.2;
      pen.stroke();
      // Three great circles, on the near side: they show the rotation of the sphere.
      for (const axis of [0, 1, 2]) {
        pen.beginPath();
        let isDrawing = false;
        for (let i = 0; i <= 48; i++) {
          const angle = i * Math.PI / 24, arm = [0, 0, 0];
          arm[(axis + 1) % 3] = Math.cos(angle);
          arm[(axis + 2) % 3] = Math.sin(angle);
          const point = plus(position, rotate(orientation, arm), r), isFront = dot(plus(point, position, -1), plus(eye, point, -1)) > 0;
          if (isFront) {
            const { x, y } = seen(point);
            if (isDrawing) pen.lineTo(x, y); else pen.moveTo(x, y);
          }
          isDrawing = isFront;
        }
        pen.stroke();
      }
    }

    drawGhost(view, motion) {
      const { pen, seen } = view;
      pen.setLineDash([4, 3]);
      if (this.body.radius) {
        this.drawBall(view, motion, 0);
      } else {
        const corners = this.corners(motion);
        pen.strokeStyle = this.ink;
        pen.lineWidth = 1.2;
        pen.globalAlpha = 0.8;
        pen.beginPath();
        for (const face of this.body.faces) this.path(pen, [...face, face[0]].map((i) => seen(corners[i])));
        pen.stroke();
      }
      pen.globalAlpha = 1;
      pen.setLineDash([]);
    }

    // Draw contact points as dots, and an impulse as an arrow that fades.
    drawContact({ pen, seen, reach }, motion) {
      if (!this.hasFloor) return;
      const colour = motion.colour || this.ink;
      pen.fillStyle = pen.strokeStyle = colour;
      for (const corner of this.corners(motion)) {
        if (corner[1] - this.body.radius > 0.01 * this.size) continue;
        const { x, y } = seen([corner[0], 0, corner[2]]);
        pen.beginPath();
        pen.arc(x, y, 3, 0, 2 * Math.PI);
        pen.fill();
      }
      const strike = this.lastStrike(motion), age = strike ? (this.time - strike.time) / Number(this.speed.value) : Infinity;
      if (age > GLOW || this.strongest === 0) return;
      const long = 0.6 * reach * Math.sqrt(size(strike.impulse) / this.strongest);
      const from = seen(strike.point), to = seen(plus(strike.point, strike.impulse, long / size(strike.impulse)));
      const angle = Math.atan2(to.y - from.y, to.x - from.x);
      pen.globalAlpha = 1 - 0.8 * age / GLOW;
      pen.lineWidth = 2.5;
      pen.setLineDash(motion.isExact ? [4, 3] : []);
      pen.beginPath();
      this.path(pen, [from, to]);
      pen.stroke();
      pen.setLineDash([]);
      pen.beginPath();
      this.path(pen, [-0.4, 0, 0.4].map((side) => (side ? { x: to.x - 9 * Math.cos(angle + side), y: to.y - 9 * Math.sin(angle + side) } : to)));
      pen.stroke();
      pen.globalAlpha = 1;
    }

    lastStrike(motion) {
      return motion.strikes.findLast((strike) => strike.time <= this.time + 1e-9);
    }

    // Values are those of the nearest frame: no interpolation.
    updateTable() {
      const frame = Math.round(this.time / this.interval);
      this.slider.value = String(this.time / this.interval);
      this.slider.setAttribute("aria-valuetext", `${this.time.toFixed(3)} s`);
      this.clock.textContent = `${this.time.toFixed(3)} s of ${this.duration.toFixed(3)}`;
      this.motions.forEach((motion, i) => {
        const row = Math.min(frame, motion.last), values = [motion.position[row][1]];
        if (this.exact) {
          const isKnown = !motion.isExact && frame <= this.exact.last && frame <= motion.last;
          values.push(isKnown ? size(plus(motion.position[frame], this.exact.position[frame], -1)) : null);
          values.push(isKnown ? shorter(motion.orientation[frame], this.exact.orientation[frame]).angle : null);
        }
        if (this.hasFloor) {
          const strike = this.lastStrike(motion);
          values.push(strike ? size(strike.impulse) : null);
        }
        const ended = motion.hasEnded(this.time) ? `ended at ${(motion.last * this.interval).toFixed(3)} s` : null;
        values.forEach((value, k) => { this.rows[i].cells[k].textContent = ended && k === 0 ? ended : ended || value === null ? "–" : rounded(value); });
      });
      this.section.dispatchEvent(new CustomEvent("dropspin:time", { detail: this.time }));
    }
  }

  // A viewer is made when its button is pressed, so that a page of many scenes opens fast.
  for (const home of document.querySelectorAll("[data-replay]")) {
    const start = () => {
      home.viewer = new Viewer(home, JSON.parse(document.getElementById(home.dataset.replay).textContent));
    };
    home.hidden = false;
    if ("open" in home.dataset) start();
    else home.append(made("button", { type: "button", onclick: () => { start(); home.viewer.button.focus(); } }, "Replay in 3D"));
  }
})();
