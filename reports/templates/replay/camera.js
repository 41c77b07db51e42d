  // --- camera ---
  const MARGIN = 1.15;
  const FOCAL = 1.2;           // of the smaller side of a view
  const CLOSE = 1.15;          // sizes of the body: half of what is seen around a body that the camera follows

  class Camera {
    constructor(bodySize) {
      this.size = bodySize;
    }

    axes() {
      const [sa, ca, se, ce] = [Math.sin(this.azimuth), Math.cos(this.azimuth), Math.sin(this.elevation), Math.cos(this.elevation)];
      const right = [ca, 0, -sa], back = [sa * ce, se, ca * ce];
      return [right, cross(back, right), back];
    }

    // Show all of some points, from slightly above.
    frame(points) {
      this.azimuth = 0.5;
      this.elevation = 0.22;
      this.offset = [0, 0, 0];
      this.zoomFactor = 1;
      const axes = this.axes(), along = axes.map((axis) => points.map((point) => dot(axis, point)));
      const low = along.map((all) => all.reduce((a, b) => Math.min(a, b)) - this.size);
      const high = along.map((all) => all.reduce((a, b) => Math.max(a, b)) + this.size);
      this.extent = low.map((least, i) => high[i] - least);
      this.middle = axes.reduce((sum, axis, i) => plus(sum, axis, (low[i] + high[i]) / 2), [0, 0, 0]);
      this.reach = Math.max(...this.extent) / 2;
    }

    turn(sideways, down) {
      this.azimuth -= sideways;
      this.elevation = Math.max(-0.2, Math.min(1.5, this.elevation + down));
    }

    // Move the picture by pixels.
    pan(right, down) {
      const axes = this.axes();
      this.offset = plus(plus(this.offset, axes[0], -right / this.scale), axes[1], down / this.scale);
    }

    zoom(factor) {
      this.zoomFactor = Math.max(this.closest, Math.min(10, this.zoomFactor * factor));
    }

    // What to keep in the view to follow bodies: the middle of their positions, and half of what is to be seen around it.
    around(positions) {
      const [low, high] = [Math.min, Math.max].map((extreme) => [0, 1, 2].map((i) => extreme(...positions.map((position) => position[i]))));
      const middle = mean([low, high]);
      return { middle, reach: CLOSE * this.size + Math.max(...positions.map((position) => size(minus(position, middle)))) };
    }

    // The projection onto a box of the canvas; `followed` is what to keep in the view, from `around`.
    view(box, followed) {
      const [right, up, back] = this.axes(), [wide, tall, deep] = this.extent, side = Math.min(box.width, box.height);
      const focal = FOCAL * side, target = plus(followed?.middle ?? this.middle, this.offset);
      const fitted = deep / 2 + MARGIN * focal * Math.max(wide / box.width, tall / box.height);
      const whole = followed ? followed.reach * (0.5 + 2 * MARGIN * FOCAL) : fitted;
      this.closest = Math.min(1, 2 * FOCAL * this.size / whole);  // the body fills the view
      const distance = this.zoomFactor * whole, eye = plus(target, back, distance);
      this.scale = focal / distance;
      const seen = (point) => {
        const arm = minus(point, eye), depth = -dot(arm, back), scale = focal / Math.max(depth, 1e-3 * distance);
        return { x: box.left + box.width / 2 + scale * dot(arm, right), y: box.top + box.height / 2 - scale * dot(arm, up), depth, scale };
      };
      return { box, seen, eye, target, right, up, scale: this.scale, reach: followed?.reach ?? this.reach };
    }
  }
