  // --- vectors and quaternions [x, y, z, w] ---
  const plus = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
  const minus = (a, b) => plus(a, b, -1);
  const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const size = (a) => Math.hypot(...a);
  const unit = (a) => times(a, 1 / (size(a) || 1));
  const mean = (points) => times(points.reduce((sum, point) => plus(sum, point), [0, 0, 0]), 1 / points.length);
  const rotate = (q, v) => {
    const t = times(cross(q, v), 2);
    return plus(plus(v, t, q[3]), cross(q, t));
  };
  const multiply = (a, b) => [...plus(plus(times(b, a[3]), a, b[3]), cross(a, b)), a[3] * b[3] - dot(a, b)];
  const about = (axis, angle) => [...times(axis, Math.sin(angle / 2)), Math.cos(angle / 2)];
  // From one orientation to another: the shorter rotation, or a fraction of it and of the whole turns beyond it.
  const turned = (a, b, share, turns) => {
    const q = multiply(b, [-a[0], -a[1], -a[2], a[3]]), v = q[3] < 0 ? times(q, -1) : q.slice(0, 3);
    const angle = 2 * Math.atan2(size(v), Math.abs(q[3]));
    return multiply(about(unit(v), share * (angle + 2 * Math.PI * turns)), a);
  };
  // The outward normal of a polygon whose corners are counterclockwise.
  const normal = (points) => unit(points.reduce((sum, p, i) => plus(sum, cross(p, points[(i + 1) % points.length])), [0, 0, 0]));
  // The largest of 1, 2, 5, 10, 20, … (and of their fractions) that is at most n.
  const nice = (n) => {
    const power = 10 ** Math.floor(Math.log10(n));
    return power * [5, 2, 1].find((digit) => digit * power <= n * (1 + 1e-9));
  };
  // Such a number as text.
  const plain = (n) => String(Number(n.toPrecision(1)));
