  // --- bodies: filled or as outlines; a mark and axes show their orientation ---
  const LIGHT = unit([0.35, 0.85, 0.4]);
  const SPOT = unit([1, 1, 2]);    // of a sphere, in its own frame
  const SPOT_SIZE = 0.2;           // rad on a sphere, and relative to the distance from the middle of a face to its corner
  const DASHES = [5, 4];
  const SMOOTH = Math.cos(Math.PI / 6); // of the normals of two faces with a smooth edge
  const THIN = 0.4;                     // px
  const MARK = 0.2;                     // of the size of the body; radius of the mark on a smooth surface

  const mixed = (colour, other, share) => {
    const parts = [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
    return `rgb(${parts.map((n) => Math.round(n + (other - n) * share)).join(" ")})`;
  };
  const shade = (colour, light) => (light < 1 ? mixed(colour, 0, 1 - light) : mixed(colour, 255, light - 1));
  const path = (pen, points) => points.forEach(({ x, y }, i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  const polygon = (pen, points) => {
    pen.beginPath();
    path(pen, points);
    pen.closePath();
  };
  const circle = (centre, across, along) => Array.from({ length: 24 }, (_, i) =>
    plus(plus(centre, across, Math.cos(i * Math.PI / 12)), along, Math.sin(i * Math.PI / 12)));
  // Two unit vectors at right angles to a direction.
  const across = (direction) => {
    const one = unit(cross(direction, Math.abs(direction[0]) < 0.8 ? [1, 0, 0] : [0, 1, 0]));
    return [one, cross(direction, one)];
  };

  class Body {
    constructor(raw, bodySize) {
      Object.assign(this, raw);
      this.size = bodySize;
      this.normals = this.faces.map((face) => normal(face.map((i) => this.vertices[i])));
      // The marked face: that which looks most along the axis z of the body.
      const along = this.normals.map((n) => n[2]);
      this.marked = along.indexOf(Math.max(...along));
      // Of a smooth surface its neighbours too, so that it is seen.
      const middles = this.faces.map((face) => mean(face.map((i) => this.vertices[i])));
      this.isMarked = middles.map((middle, i) => i === this.marked || (dot(this.normals[i], this.normals[this.marked]) > SMOOTH
        && size(minus(middle, middles[this.marked])) < MARK * bodySize));
    }

    corners({ position, orientation }) {
      return this.vertices.map((vertex) => plus(position, rotate(orientation, vertex)));
    }

    // The middle and radius of the spot on the marked face, near its first corner: it shows half-turns about the normal too.
    spot() {
      const points = this.faces[this.marked].map((i) => this.vertices[i]), middle = mean(points), arm = minus(points[0], middle);
      const isSmooth = this.isMarked.filter(Boolean).length > 1;
      return { middle: plus(middle, arm, 0.5), radius: isSmooth ? 0.4 * MARK * this.size : SPOT_SIZE * size(arm) };
    }

    // Draw it. `style` has a colour, the colour of the ink, and whether it is filled and dashed.
    draw(pen, view, pose, style) {
      pen.lineWidth = style.isFilled ? 1.2 : 1.6;
      pen.lineJoin = "round";
      pen.setLineDash(style.isDashed ? DASHES : []);
      pen.strokeStyle = style.isFilled ? shade(style.colour, 0.5) : style.colour;
      if (style.isFilled) this.drawAxes(pen, view, pose, style, false);
      if (this.radius) this.drawBall(pen, view, pose, style);
      else this.drawFaces(pen, view, pose, style);
      pen.setLineDash([]);
      if (style.isFilled) this.drawAxes(pen, view, pose, style, true);
    }

    drawFaces(pen, { seen, eye }, pose, style) {
      const corners = this.corners(pose), edges = new Map(), width = pen.lineWidth;
      let isSpotSeen = false;
      this.faces.forEach((face, number) => {
        const n = rotate(pose.orientation, this.normals[number]), facing = dot(n, minus(eye, corners[face[0]]));
        if (facing <= 0 && !this.isFlat) return;
        const isMarked = this.isMarked[number] && facing > 0;
        isSpotSeen ||= isMarked && number === this.marked;
        polygon(pen, face.map((i) => seen(corners[i])));
        pen.fillStyle = isMarked ? mixed(style.colour, 255, 0.72) : shade(style.colour, 0.8 + 0.35 * dot(n, LIGHT) * Math.sign(facing || 1));
        if (style.isFilled) pen.fill();
        // An edge of two faces is drawn once: dashes of two lines would fill each other's gaps.
        face.forEach((i, k) => {
          const ends = [i, face[(k + 1) % face.length]], key = ends.slice().sort().join();
          edges.set(key, { ends, n, isSmooth: edges.has(key) && dot(edges.get(key).n, n) > SMOOTH });
        });
      });
      if (isSpotSeen) this.drawSpot(pen, seen, pose, style);
      for (const { ends, isSmooth } of edges.values()) {
        if (isSmooth && !style.isFilled) continue; // many would hide the body behind them
        pen.lineWidth = isSmooth ? THIN : width;
        pen.beginPath();
        path(pen, ends.map((i) => seen(corners[i])));
        pen.stroke();
      }
    }

    drawSpot(pen, seen, { position, orientation }, style) {
      const { middle, radius } = this.spot(), [one, other] = across(this.normals[this.marked]);
      polygon(pen, circle(middle, times(one, radius), times(other, radius)).map((point) => seen(plus(position, rotate(orientation, point)))));
      pen.fillStyle = pen.strokeStyle;
      if (style.isFilled) pen.fill(); else pen.stroke();
    }

    drawBall(pen, { seen, eye }, { position, orientation }, style) {
      const centre = seen(position), r = this.radius * centre.scale;
      pen.beginPath();
      pen.arc(centre.x, centre.y, r, 0, 2 * Math.PI);
      if (style.isFilled) {
        const glow = pen.createRadialGradient(centre.x + 0.3 * r, centre.y - 0.45 * r, 0, centre.x, centre.y, r);
        glow.addColorStop(0, shade(style.colour, 1.25));
        glow.addColorStop(1, shade(style.colour, 0.7));
        pen.fillStyle = glow;
        pen.fill();
      }
      pen.stroke();
      const surface = (direction) => {
        const point = plus(position, rotate(orientation, direction), this.radius);
        return { isFront: dot(minus(point, position), minus(eye, point)) > 0, ...seen(point) };
      };
      // A meridian and a spot, where they are on the near side.
      const meridian = Array.from({ length: 49 }, (_, i) => surface([0, Math.cos(i * Math.PI / 24), Math.sin(i * Math.PI / 24)]));
      pen.beginPath();
      meridian.forEach((point, i) => { if (i && point.isFront && meridian[i - 1].isFront) path(pen, [meridian[i - 1], point]); });
      pen.stroke();
      const [one, other] = across(SPOT), spot = circle(SPOT, times(one, SPOT_SIZE), times(other, SPOT_SIZE)).map((v) => surface(unit(v)));
      if (!surface(SPOT).isFront) return;
      polygon(pen, spot.filter((point) => point.isFront));
      pen.fillStyle = mixed(style.colour, 255, 0.72);
      if (style.isFilled) pen.fill();
      pen.stroke();
    }

    // Distance from the centre of mass to the surface along a direction of the body's frame.
    surfaceAlong(direction) {
      if (this.radius) return this.radius;
      const exits = this.normals.map((n, i) => dot(n, this.vertices[this.faces[i][0]]) / dot(n, direction)).filter((distance) => distance > 0);
      return Math.min(this.size, ...exits);
    }

    // Draw those of the body's axes that point to the eye, or those that point away, outside of the body only.
    drawAxes(pen, { seen, eye }, { position, orientation }, style, isFront) {
      pen.save();
      pen.setLineDash([]);
      pen.lineWidth = 1;
      pen.strokeStyle = pen.fillStyle = style.ink;
      ["x′", "y′", "z′"].forEach((name, i) => {
        const axis = [0, 1, 2].map((k) => Number(k === i)), direction = rotate(orientation, axis), from = this.surfaceAlong(axis);
        const start = plus(position, direction, from), end = plus(position, direction, from + 0.35 * this.size);
        if (dot(direction, minus(eye, start)) > 0 !== isFront) return;
        pen.beginPath();
        path(pen, [start, end].map(seen));
        pen.stroke();
        write(pen, name, seen(plus(position, direction, from + 0.5 * this.size)), style);
      });
      pen.restore();
    }

    drawShadow(pen, { seen }, pose) {
      const corners = this.corners(pose), flat = (point) => seen([point[0], 0, point[2]]);
      pen.beginPath();
      if (this.radius) path(pen, circle(corners[0], [this.radius, 0, 0], [0, 0, this.radius]).map(flat));
      for (const [number, face] of this.faces.entries()) {
        // The faces that point up cover the shadow once.
        const points = face.map((i) => corners[i]);
        if (this.isFlat || rotate(pose.orientation, this.normals[number])[1] > 0) path(pen, [...points, points[0]].map(flat));
      }
      pen.fill();
    }
  }
