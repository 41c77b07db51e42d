  // --- page ---
  const SPEEDS = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2];
  const SHORTEST_SHOW = 4;     // seconds that a motion lasts at least at the speed chosen first, if a speed is slow enough
  const FRAME_RATE = 60;       // of a usual screen, per second
  const FRAMES_PER_TURN = 20;  // fewer do not show in which direction a body turns
  const HINT = "Drag: turn. Right-drag, Shift-drag: move. Wheel after a click: zoom. Keys: arrows, Shift-arrows, + −, 0 reset, Space play, comma/period frame, P/N impact, S slow at impacts, F follow.";

  const labelled = (text, control) => made("label", {}, text + " ", control);
  const button = (text, label, onclick) => made("button", { type: "button", "aria-label": label, title: label, onclick }, text);
  const select = (pairs, chosen, onchange) => made("select", { onchange }, ...pairs.map(([value, text]) => {
    const option = made("option", { value }, text);
    option.selected = value === chosen;
    return option;
  }));
  // A positive number with some significant digits.
  const rounded = (n, digits = 2) => {
    if (n === 0) return "0";
    return n >= 1e-3 && n < 10 ** digits ? n.toPrecision(digits) : n.toExponential(digits - 1);
  };
  const inWords = (speed) => (speed < 1 ? `1/${Math.round(1 / speed)}` : String(speed));
  const framesPerTurn = (spin, speed) => 2 * Math.PI * FRAME_RATE / (spin * speed);

  // The speed chosen first: slow enough to see the motion and its turns.
  const firstSpeed = (duration, spin) =>
    SPEEDS.findLast((speed) => speed <= 1 && duration / speed >= SHORTEST_SHOW && framesPerTurn(spin, speed) >= FRAMES_PER_TURN) ?? SPEEDS[0];

  // What a fast spin means for the picture; nothing where the body turns slowly enough at real time and at the chosen speed.
  const spinNote = (spin, speed) => {
    if (framesPerTurn(spin, Math.max(1, speed)) >= FRAMES_PER_TURN) return "";
    const frames = framesPerTurn(spin, speed), turns = `The body turns ${rounded(spin / (2 * Math.PI))} times a second`;
    if (frames < FRAMES_PER_TURN) return `${turns}: at speed ${inWords(speed)} a turn takes ${rounded(frames)} frames of a ${FRAME_RATE} Hz screen, too few to show it; choose a lower speed.`;
    return `${turns}; at speed ${inWords(speed)} a turn takes ${rounded(frames)} frames of a ${FRAME_RATE} Hz screen.`;
  };

  // The table below the view: the legend, where the filled body is chosen, and the values at the time that is shown.
  class Readout {
    constructor(viewer) {
      const { motions, exact, hasFloor, scene } = viewer, group = `filled-${viewer.home.dataset.replay}`;
      this.viewer = viewer;
      this.rows = motions.map((motion) => this.row(motion, group));
      const heads = ["body (chosen: filled)", "shown", "height [m]", ...(exact ? ["position error [m]", "orientation error [rad]"] : []),
        ...(hasFloor ? [`largest impulse in ${HELD} s [N s]`] : [])];
      const table = made("table", {}, made("thead", {}, made("tr", {}, ...heads.map((text) => made("th", { scope: "col" }, text)))),
        made("tbody", {}, ...this.rows.map((row) => row.element)));
      this.box = made("div", { class: "scroll", role: "region", "aria-label": `${scene}: positions of the bodies` }, table);
      stopWhereItScrolls.observe(this.box);
    }

    row(motion, group) {
      const { viewer } = this;
      const show = made("input", { type: "checkbox", "aria-label": `show ${motion.name}`, onchange: () => { motion.shown = show.checked; viewer.draw(); } });
      show.checked = true;
      const swatch = made("span", { class: "swatch" });
      const choose = made("input", { type: "radio", name: group, onchange: () => viewer.choose(motion) });
      choose.checked = motion === viewer.chosen;
      const name = motion.isExact ? made("span", { class: "exact" }, swatch, motion.name) : made("label", {}, choose, " ", swatch, motion.name);
      const cells = Array.from({ length: 1 + (viewer.exact ? 2 : 0) + (viewer.hasFloor ? 1 : 0) }, () => made("td"));
      return { cells, swatch, show, element: made("tr", {}, made("th", { scope: "row" }, name), made("td", {}, show), ...cells) };
    }

    // Show the engines that the filter of the page leaves.
    filter(labels) {
      this.viewer.motions.forEach((motion, i) => {
        const { element, show } = this.rows[i];
        element.hidden = labels.includes(motion.label);
        motion.shown = show.checked && !element.hidden;
      });
    }

    // The height is that of the body as drawn; the errors are those of the nearest frame.
    update(time) {
      this.viewer.motions.forEach((motion, i) => {
        const { cells, swatch } = this.rows[i], row = motion.nearest(time), held = motion.held(time);
        const texts = [motion.at(time).position[1].toFixed(3)];
        if (this.viewer.exact) texts.push(...[0, 1].map((k) => (motion.errors.length && !Number.isNaN(motion.errors[k][row]) ? rounded(motion.errors[k][row]) : "–")));
        if (this.viewer.hasFloor) texts.push(held ? `${rounded(held.size, 3)} at ${held.time.toFixed(3)} s` : "–");
        if (motion.hasEnded(time)) texts.fill("–").splice(0, 1, `ended at ${motion.end.toFixed(3)} s`);
        cells.forEach((cell, k) => { cell.textContent = texts[k]; });
        swatch.style.borderColor = motion.colour || "currentColor";
        swatch.style.background = this.viewer.isFilled(motion) ? motion.colour : "none";
      });
    }
  }

  // The impacts of each body over time; a click goes to the nearest one.
  class Strip {
    constructor(viewer) {
      this.viewer = viewer;
      this.rows = viewer.motions.filter((motion) => motion.impacts.length).map((motion) => this.row(motion));
      this.box = made("div", { class: "strip" }, ...this.rows.flatMap((row) => [row.name, row.svg]));
    }

    row(motion) {
      const { viewer } = this, largest = Math.max(...motion.impacts.map((impact) => impact.size));
      const svg = drawn("svg", { viewBox: "0 0 1000 20", preserveAspectRatio: "none", role: "img", "aria-label": `impacts of ${motion.name}: ${motion.impacts.length}` });
      const ticks = motion.impacts.map((impact) => `M${(1000 * impact.time / viewer.duration).toFixed(1)},20v${(-20 * Math.sqrt(impact.size / largest)).toFixed(1)}`);
      const now = drawn("path", { d: "M0,0v20", class: "now" });
      svg.append(drawn("path", { d: ticks.join(""), stroke: motion.colour || "currentColor" }), now);
      svg.addEventListener("click", (event) => {
        const box = svg.getBoundingClientRect(), time = (event.clientX - box.left) / box.width * viewer.duration;
        viewer.go(motion.impacts.map((impact) => impact.time).reduce((best, other) => (Math.abs(other - time) < Math.abs(best - time) ? other : best)));
      });
      return { motion, svg, now, name: made("span", {}, motion.name) };
    }

    update() {
      for (const { motion, svg, now, name } of this.rows) {
        now.setAttribute("transform", `translate(${1000 * this.viewer.time / this.viewer.duration} 0)`);
        svg.classList.toggle("hidden", !motion.shown);
        name.hidden = !motion.shown;
      }
    }
  }
