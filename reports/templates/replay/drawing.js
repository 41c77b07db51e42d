  // --- what is drawn beside the bodies ---
  const write = (pen, text, { x, y }, { ink, page }, align = "center") => {
    pen.save();
    pen.font = "12px system-ui, sans-serif";
    pen.textAlign = align;
    pen.textBaseline = "middle";
    pen.lineJoin = "round";
    pen.lineWidth = 3;
    pen.strokeStyle = page;
    pen.fillStyle = ink;
    pen.strokeText(text, x, y);
    pen.fillText(text, x, y);
    pen.restore();
  };

  const gridSpacing = (reach) => 10 ** Math.floor(Math.log10(reach / 2));

  // A grid on a plane, about the point of it that is nearest to the target.
  const drawPlane = (pen, { seen, target, reach }, ink, { point, along, ends }) => {
    const spacing = gridSpacing(reach), lines = Math.ceil(2 * reach / spacing);
    const [x, z] = along.map((axis) => Math.round(axis.reduce((sum, share, i) => sum + share * (target[i] - point[i]), 0) / spacing));
    const within = (u, i) => (ends ? Math.max(-ends[i], Math.min(ends[i], u)) : u);
    const at = ([u, v]) => seen(point.map((start, i) => start + within(u * spacing, 0) * along[0][i] + within(v * spacing, 1) * along[1][i]));
    pen.strokeStyle = ink;
    pen.lineWidth = 1;
    pen.globalAlpha = 0.18;
    pen.beginPath();
    for (let n = -lines; n <= lines; n++) {
      path(pen, [[x + n, z - lines], [x + n, z + lines]].map(at));
      path(pen, [[x - lines, z + n], [x + lines, z + n]].map(at));
    }
    pen.stroke();
    pen.globalAlpha = 1;
  };

  const drawTrail = (pen, { seen }, motion, time, colour) => {
    pen.strokeStyle = colour;
    pen.lineWidth = 1;
    pen.globalAlpha = 0.6;
    pen.setLineDash(motion.isExact ? DASHES : []);
    pen.beginPath();
    path(pen, motion.trail(time).map(seen));
    pen.stroke();
    pen.setLineDash([]);
    pen.globalAlpha = 1;
  };

  // With a margin in the colour of the page, so that it is seen on a body of its own colour.
  const drawArrow = (pen, from, to, colour, width, page, dashes = []) => {
    const angle = Math.atan2(to.y - from.y, to.x - from.x), head = Math.min(9, Math.hypot(to.x - from.x, to.y - from.y));
    const barbs = [-0.4, 0, 0.4].map((side) => (side ? { x: to.x - head * Math.cos(angle + side), y: to.y - head * Math.sin(angle + side) } : to));
    for (const [ink, wide] of [[page, width + 3], [colour, width]]) {
      pen.strokeStyle = ink;
      pen.lineWidth = wide;
      for (const [points, pattern] of [[[from, to], ink === colour ? dashes : []], [barbs, []]]) {
        pen.setLineDash(pattern);
        pen.beginPath();
        path(pen, points);
        pen.stroke();
      }
    }
    pen.setLineDash([]);
  };

  // The world's axes, a scale bar and the length of an impulse's arrow, at the bottom of a view.
  const drawScales = (pen, view, colours, hasFloor, metresPerImpulse) => {
    const { box, right, up, scale } = view, bottom = box.top + box.height;
    const origin = { x: box.left + 42, y: bottom - 30 };
    pen.lineWidth = 1.2;
    pen.strokeStyle = colours.ink;
    ["x", "y up", "z"].forEach((name, i) => {
      const at = (distance) => ({ x: origin.x + distance * right[i], y: origin.y - distance * up[i] });
      if (Math.hypot(right[i], up[i]) < 0.15) return;  // it points at the eye
      drawArrow(pen, origin, at(24), colours.ink, 1.2, colours.page);
      write(pen, name, at(34), colours);
    });
    const longest = Math.min(120, box.width / 3), edge = box.left + box.width - 12;
    const metres = nice(longest / scale), bar = metres * scale;
    pen.strokeStyle = colours.ink;
    pen.lineWidth = 1.5;
    pen.beginPath();
    path(pen, [{ x: edge - bar, y: bottom - 15 }, { x: edge - bar, y: bottom - 9 }, { x: edge, y: bottom - 9 }, { x: edge, y: bottom - 15 }]);
    pen.stroke();
    const grid = hasFloor ? `, grid ${plain(gridSpacing(view.reach))} m` : "";
    write(pen, `${plain(metres)} m${grid}`, { x: edge, y: bottom - 24 }, colours, "right");
    if (!metresPerImpulse) return;
    const impulse = nice(longest / (metresPerImpulse * scale)), long = impulse * metresPerImpulse * scale;
    drawArrow(pen, { x: edge - long, y: bottom - 42 }, { x: edge, y: bottom - 42 }, colours.ink, 2.5, colours.page);
    write(pen, `impulse ${plain(impulse)} N s`, { x: edge, y: bottom - 56 }, colours, "right");
  };
