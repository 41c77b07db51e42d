// Repeats, with Rapier's package for JavaScript alone, what the page on engines says about it:
// `npm install @dimforge/rapier3d-compat`, then, in the folder of node_modules, `node check_rapier_js.mjs`.
//
// Lengths in m, times in s, masses in kg; Rapier computes in single precision.
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const NAME = "@dimforge/rapier3d-compat";
const found = createRequire(join(process.cwd(), "from_here.js"));
const R = (await import(pathToFileURL(found.resolve(NAME)).href)).default;
console.warn = () => {}; // init() warns of a change of its own
await R.init();
console.log(`Rapier ${R.version()}`);

const G = 9.8; // m/s²
const HEIGHT = 1; // m, of the ball's lowest point
const vector = (x, y, z) => ({ x, y, z });
const UNTURNED = { x: 0, y: 0, z: 0, w: 1 };

function world(dt, gravity, parameters) {
  const made = new R.World(vector(0, -gravity, 0));
  Object.assign(made.integrationParameters, { dt, ...parameters });
  return made;
}

// A dropped ball of restitution 0.5: the ratio of its speeds after and before the step of the impact, and the error of its first apex [m].
function bounce(dt, parameters) {
  const dropped = world(dt, G, parameters);
  const ball = dropped.createRigidBody(R.RigidBodyDesc.dynamic().setTranslation(0, HEIGHT + 0.1, 0));
  for (const [shape, owner] of [[R.ColliderDesc.ball(0.1), ball], [new R.ColliderDesc(new R.HalfSpace(vector(0, 1, 0)))]]) {
    dropped.createCollider(shape.setRestitution(0.5).setFriction(0), owner);
  }
  let [before, after, apex] = [0, 0, 0];
  for (let step = 0; step * dt < 0.95; step += 1) {
    const earlier = ball.linvel().y;
    dropped.step();
    if (!after && ball.linvel().y > 0) [before, after] = [earlier, ball.linvel().y];
    if (after) apex = Math.max(apex, ball.translation().y - 0.1);
  }
  return { restitution: -after / before, height: apex - 0.25 * HEIGHT };
}

// A free body: its angular velocity after a time, and the relative change of its energy.
function spin(dt, duration, rate, moments) {
  const free = world(dt, 0, { numSolverIterations: 1 });
  const turning = R.RigidBodyDesc.dynamic().setAngvel(vector(...rate)).setCanSleep(false);
  const body = free.createRigidBody(turning.setAdditionalMassProperties(1, vector(0, 0, 0), vector(...moments), UNTURNED));
  for (let step = 0; step < Math.round(duration / dt); step += 1) free.step();
  const energy = (w) => moments.reduce((sum, moment, axis) => sum + moment * w[axis] ** 2, 0);
  const { x, y, z } = body.angvel();
  return { rate: [x, y, z], energy: energy(inBody(body.rotation(), [x, y, z])) / energy(rate) - 1 };
}

// A vector of the world in the axes of a body: v + 2 w (v × u) + 2 (v × u) × u, with the quaternion (u, w).
function inBody({ x, y, z, w }, v) {
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const once = cross(v, [x, y, z]);
  const twice = cross(once, [x, y, z]);
  return v.map((component, axis) => component + 2 * w * once[axis] + 2 * twice[axis]);
}

const box = (a, b, c) => [(b * b + c * c) / 3, (a * a + c * c) / 3, (a * a + b * b) / 3];
const shown = (number) => number.toExponential(2);
const one = { numSolverIterations: 1, normalizedPredictionDistance: G * 1e-6 };
for (const [name, parameters] of [["one substep", one], ["default settings", {}]]) {
  const { restitution, height } = bounce(1e-3, parameters);
  console.log(`a ball of restitution 0.5 at 1 ms, ${name}: ratio of speeds ${restitution.toFixed(6)}, error of the rebound ${shown(height)} m`);
}
const steady = spin(1e-3, 10, [5, 0, 0], box(0.1, 0.2, 0.3));
console.log(`10 s about a principal axis at 1 ms: energy ${shown(steady.energy)}`);
const tumbling = spin(1e-3, 30, [0.4363323129985824, -0.2617993877991494, 0.6981317007977318], [0.00189422, 0.00621102, 0.00719467]);
console.log(`30 s of tumbling at 1 ms: energy ${shown(tumbling.energy)}`);
const fast = spin(2e-3, 10, [500, 0, 0], box(0.2, 0.2, 0.2));
console.log(`500 rad/s at 2 ms: ${fast.rate[0].toFixed(1)} rad/s, π/4 in a step is ${(Math.PI / 8e-3).toFixed(1)} rad/s; energy ${shown(fast.energy)}`);
process.exit(0); // WebAssembly's worlds are not freed one by one
