  // --- the viewer of one scene ---
  const FAR = 1.5;             // sizes of the body: the camera follows a motion that reaches farther, so that the body fills the view
  const SLOWER = 0.2;          // slow motion, relative to the chosen speed
  const AROUND = 0.25;         // seconds before and after an impact that are shown in slow motion, at the chosen speed
  const STRONG = 0.1;          // impacts with a smaller share of the largest impulse are not slowed down

  class Viewer {
    constructor(home, data) {
      this.home = home;
      this.body = new Body(data.body, data.size);
      this.dt = data.dt;
      this.interval = data.interval;
      this.planes = data.planes;
      this.hasFloor = this.planes.length > 0;
      this.sight = data.sight;
      this.spin = data.spin;
      this.scene = data.scene;
      this.motions = data.motions.map((raw) => new Motion(raw, data.interval));
      this.exact = this.motions.find((motion) => motion.isExact);
      this.engines = this.motions.filter((motion) => !motion.isExact);
      this.chosen = this.engines[0];
      this.duration = Math.max(...this.motions.map((motion) => motion.end));
      this.frames = Math.round(this.duration / this.interval);
      // Arrows are as long as their impulses; one impulse of a broken engine must not make those of the others too short to see.
      const largest = this.motions.filter((motion) => motion.impacts.length).map((motion) => Math.max(...motion.impacts.map((impact) => impact.size)));
      this.strongest = Math.min(...largest);
      this.time = 0;
      this.running = 0;
      this.camera = new Camera(data.size);
      this.build();
      // Plots of the same section set the time, and mark it.
      this.section = home.closest("section");
      this.section.addEventListener("dropspin:seek", (event) => this.go(event.detail));
      document.addEventListener("dropspin:engines", (event) => {
        this.readout.filter(event.detail);
        this.draw();
      });
      this.choose(this.chosen);
      this.reset();
      new ResizeObserver(() => this.draw()).observe(this.canvas);
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    }

    // Native controls work with keyboards and screen readers.
    build() {
      this.canvas = made("canvas", {
        role: "img", tabindex: "0", "aria-label": `${this.scene} in 3D; arrow keys turn the view, plus and minus zoom`,
        onpointerdown: (event) => this.grab(event), onpointermove: (event) => this.drag(event), onpointerup: () => { this.grabbed = null; },
        oncontextmenu: (event) => event.preventDefault(), onkeydown: (event) => this.key(event), ondblclick: () => this.reset(),
      });
      this.canvas.addEventListener("wheel", (event) => {
        if (!event.ctrlKey && document.activeElement !== this.canvas) return;
        event.preventDefault();
        this.zoom(event.deltaY > 0 ? 1.1 : 1 / 1.1);
      }, { passive: false });
      this.button = made("button", { type: "button", onclick: () => this.toggle() }, "Play");
      this.slider = made("input", {
        type: "range", min: "0", max: String(this.frames), step: "1", value: "0", "aria-label": "time",
        oninput: () => this.go(this.slider.valueAsNumber * this.interval),
      });
      this.clock = made("output", { "aria-live": "off" });
      this.jumps = [[-1, "◂ impact", "previous impact"], [1, "impact ▸", "next impact"]].map(([way, text, label]) => button(text, label, () => this.jump(way)));
      this.speed = select(SPEEDS.map((speed) => [String(speed), inWords(speed)]), String(firstSpeed(this.duration, this.spin)), () => {
        this.updateNote();
        if (this.running) this.play();
      });
      this.layout = select([["over", "overlaid"], ["beside", "side by side"]], "over", () => this.draw());
      this.follow = made("input", { type: "checkbox", onchange: () => this.draw() });
      this.loop = made("input", { type: "checkbox" });
      this.slow = made("input", { type: "checkbox" });
      this.strip = new Strip(this);
      this.note = made("p", { role: "status" });
      this.readout = new Readout(this);
      this.home.replaceChildren(
        this.canvas,
        made("p", { class: "controls" }, this.button, button("◂ frame", "one frame back", () => this.step(-1)), button("frame ▸", "one frame on", () => this.step(1)),
          ...(this.hasFloor ? this.jumps : []), this.slider, this.clock),
        made("p", { class: "controls" }, labelled("speed", this.speed), labelled("loop", this.loop), ...(this.hasFloor ? [labelled("slow at impacts", this.slow)] : []), labelled("engines", this.layout), labelled("follow", this.follow),
          made("button", { type: "button", onclick: () => this.reset() }, "Reset view")),
        this.note,
        this.strip.box,
        this.readout.box,
        made("p", { class: "quiet hint" }, `Motions at dt = ${Number((1000 * this.dt).toPrecision(6))} ms. ${HINT}`),
      );
      this.updateNote();
    }

    updateNote() {
      this.note.textContent = spinNote(this.spin, Number(this.speed.value));
      this.note.hidden = !this.note.textContent;
    }

    // Draw this engine's body filled; impacts are found in its motion.
    choose(motion) {
      this.chosen = motion;
      for (const jump of this.jumps) jump.disabled = motion.impacts.length === 0;
      this.draw();
    }

    isFilled(motion) {
      return !motion.isExact && (motion === this.chosen || this.layout.value === "beside");
    }

    // --- time ---
    toggle() {
      if (this.running) this.stop();
      else this.play();
    }

    play() {
      this.stop();
      if (this.time >= this.duration - 1e-9) this.seek(0);
      let last = performance.now();
      const tick = (now) => {
        this.seek(this.time + Math.max(0, now - last) / 1000 * this.pace());
        last = now;
        if (this.time < this.duration) this.running = requestAnimationFrame(tick);
        else if (this.loop.checked) this.play();
        else this.stop();
      };
      this.running = requestAnimationFrame(tick);
      this.button.textContent = "Pause";
    }

    // Seconds of the scene per second on the screen.
    pace() {
      const speed = Number(this.speed.value), { impacts } = this.chosen, largest = Math.max(...impacts.map((impact) => impact.size));
      const isNear = impacts.some((impact) => impact.size >= STRONG * largest && Math.abs(impact.time - this.time) < AROUND * speed);
      return this.slow.checked && isNear ? SLOWER * speed : speed;
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

    // Stop there.
    go(time) {
      this.stop();
      this.seek(time);
    }

    step(frames) {
      this.go((Math.round(this.time / this.interval) + frames) * this.interval);
    }

    jump(way) {
      const times = this.chosen.impacts.map((impact) => impact.time);
      const time = way > 0 ? times.find((one) => one > this.time + 1e-9) : times.findLast((one) => one < this.time - 1e-9);
      if (time !== undefined) this.go(time);
    }

    // The current poses of the bodies, by label.
    poses() {
      return Object.fromEntries(this.motions.map((motion) => [motion.label, motion.at(this.time)]));
    }

    // --- camera ---
    reset() {
      const start = this.motions[0].position[0];
      this.camera.frame(this.motions.flatMap((motion) => motion.position).filter((point) => size(minus(point, start)) <= this.sight));
      this.follow.checked = this.camera.reach > FAR * this.body.size;
      this.draw();
    }

    grab(event) {
      this.canvas.setPointerCapture(event.pointerId);
      this.grabbed = [event.clientX, event.clientY];
    }

    drag(event) {
      if (!this.grabbed) return;
      const right = event.clientX - this.grabbed[0], down = event.clientY - this.grabbed[1];
      if (event.shiftKey || event.buttons & 2) this.camera.pan(right, down);
      else this.camera.turn(right * 0.008, down * 0.008);
      this.grabbed = [event.clientX, event.clientY];
      this.draw();
    }

    zoom(factor) {
      this.camera.zoom(factor);
      this.draw();
    }

    key(event) {
      const arrow = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      const keys = {
        "+": () => this.zoom(1 / 1.1), "=": () => this.zoom(1 / 1.1), "-": () => this.zoom(1.1), 0: () => this.reset(), " ": () => this.toggle(),
        ",": () => this.step(-1), ".": () => this.step(1), p: () => this.jump(-1), n: () => this.jump(1), s: () => this.slow.click(), f: () => this.follow.click(),
      };
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (arrow) {
        if (event.shiftKey) this.camera.pan(-20 * arrow[0], -20 * arrow[1]);
        else this.camera.turn(0.1 * arrow[0], 0.1 * arrow[1]);
        this.draw();
      } else if (event.key.toLowerCase() in keys) keys[event.key.toLowerCase()]();
      else return;
      event.preventDefault();
    }

    // --- drawing ---
    draw() {
      const ratio = devicePixelRatio || 1, width = this.canvas.clientWidth, height = this.canvas.clientHeight;
      if (!width || !height || !this.camera.extent) return;
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
      const pen = this.canvas.getContext("2d"), look = getComputedStyle(this.canvas);
      pen.scale(ratio, ratio);
      this.colours = { ink: look.color, page: look.backgroundColor };
      const isThere = (motion) => motion.shown && !motion.hasEnded(this.time);
      const visible = this.engines.filter(isThere), exact = this.exact && isThere(this.exact) ? this.exact : null;
      const views = this.layout.value === "beside" && visible.length > 1 ? visible.map((motion) => [motion]) : [visible];
      const lines = Math.ceil(views.length / Math.max(1, Math.round(Math.sqrt(views.length * width / height))));
      const columns = Math.ceil(views.length / lines);
      const inSight = (motion) => size(minus(motion.at(this.time).position, this.motions[0].position[0])) <= this.sight;
      const followed = views.map((motions) => [...motions, ...(exact ? [exact] : [])].filter(inSight).map((motion) => motion.at(this.time).position))
        .map((positions) => (this.follow.checked && positions.length ? this.camera.around(positions) : null));
      const reach = Math.max(...followed.map((one) => one?.reach ?? 0));  // the same scale in all views
      views.forEach((motions, i) => {
        const box = { left: (i % columns) * width / columns, top: Math.floor(i / columns) * height / lines, width: width / columns, height: height / lines };
        pen.save();
        pen.beginPath();
        pen.rect(box.left, box.top, box.width, box.height);
        pen.clip();
        this.drawView(pen, box, motions, views.length > 1 ? motions[0] : this.chosen, exact, followed[i] && { ...followed[i], reach });
        if (views.length > 1) write(pen, motions[0].name, { x: box.left + 8, y: box.top + 14 }, this.colours, "left");
        pen.restore();
      });
      this.slider.value = String(this.time / this.interval);
      this.slider.setAttribute("aria-valuetext", `${this.time.toFixed(3)} s`);
      this.clock.textContent = `${this.time.toFixed(3)} s of ${this.duration.toFixed(3)}`;
      this.readout.update(this.time);
      this.strip.update();
      this.section.dispatchEvent(new CustomEvent("dropspin:time", { detail: this.time }));
    }

    // One body is filled; the others and the exact solution are outlines over it, in their own colours.
    drawView(pen, box, motions, filled, exact, followed) {
      const { ink } = this.colours, colour = (motion) => motion.colour || ink;
      const view = this.camera.view(box, followed);
      const all = [...motions, ...(exact ? [exact] : [])], others = all.filter((motion) => motion !== filled);
      for (const plane of this.planes) drawPlane(pen, view, ink, plane);
      if (this.hasFloor) {
        pen.fillStyle = ink;
        pen.globalAlpha = 0.12;
        if (motions.includes(filled)) this.body.drawShadow(pen, view, filled.at(this.time));
        pen.globalAlpha = 1;
      }
      for (const motion of all) drawTrail(pen, view, motion, this.time, colour(motion));
      if (motions.includes(filled)) this.body.draw(pen, view, filled.at(this.time), { ...this.colours, colour: filled.colour, isFilled: true });
      for (const motion of others) {
        this.body.draw(pen, view, motion.at(this.time), { ...this.colours, colour: colour(motion), isDashed: motion.isExact });
      }
      const metresPerImpulse = this.strongest < Infinity ? 0.6 * view.reach / this.strongest : 0;
      for (const motion of [...others, ...(motions.includes(filled) ? [filled] : [])]) {
        this.drawContacts(pen, view, motion, colour(motion));
        const held = motion.held(this.time);
        for (const impact of motion === filled ? motion.recent(this.time) : held ? [held] : []) {
          const tip = plus(impact.point, impact.impulse, metresPerImpulse), width = motion === filled && impact === held ? 3 : 1.5;
          drawArrow(pen, view.seen(impact.point), view.seen(tip), colour(motion), width, this.colours.page, motion.isExact ? DASHES : []);
        }
      }
      drawScales(pen, view, this.colours, this.hasFloor, metresPerImpulse);
    }

    // Dots where corners touch the floor.
    drawContacts(pen, { seen }, motion, colour) {
      if (!this.hasFloor) return;
      pen.fillStyle = colour;
      for (const corner of this.body.corners(motion.at(this.time))) {
        if (corner[1] - this.body.radius > 0.01 * this.body.size) continue;
        const { x, y } = seen([corner[0], 0, corner[2]]);
        pen.beginPath();
        pen.arc(x, y, 3, 0, 2 * Math.PI);
        pen.fill();
      }
    }
  }
