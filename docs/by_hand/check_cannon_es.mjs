// Repeats, with cannon-es alone, what the page on engines says about it:
// `npm install cannon-es`, then, in the folder of node_modules, `node check_cannon_es.mjs`.
//
// Lengths in m, times in s, masses in kg; y is up, and gravity 9.8 m/s² unless a line says otherwise.
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const NAME = "cannon-es";
const found = createRequire(join(process.cwd(), "from_here.js"));
const C = await import(pathToFileURL(found.resolve(NAME)).href);

const G = 9.8;
const DT = 1e-3;
const shown = (number) => number.toExponential(2);
const line = (what, measured, exact) => console.log(`${what}: ${measured}; exact: ${exact}`);

// A world with a floor whose contacts are solved in one step (relaxation 1e9), or as by default (3 steps).
function world(contact, gravity = G) {
  const made = new C.World({ gravity: new C.Vec3(0, -gravity, 0) });
  made.solver.iterations = 1000;
  Object.assign(made.defaultContactMaterial, { contactEquationRelaxation: 1e9, frictionEquationRelaxation: 1e9 }, contact);
  const floor = new C.Body({ mass: 0 });
  floor.addShape(new C.Plane(), undefined, new C.Quaternion().setFromEuler(-Math.PI / 2, 0, 0));
  made.addBody(floor);
  return made;
}

// A body of 1 kg in a world: its moments of inertia are set after its shape.
function put(made, shape, moments, { position = [0, 0, 0], velocity = [0, 0, 0], spin = [0, 0, 0], turn = [0, 0, 0] }) {
  const body = new C.Body({ mass: 1, linearDamping: 0, angularDamping: 0 });
  if (shape) body.addShape(shape);
  const computed = body.inertia.toArray();
  body.position.set(...position);
  body.quaternion.setFromEuler(...turn);
  body.velocity.set(...velocity);
  body.angularVelocity.set(...spin);
  body.inertia.set(...moments);
  body.invInertia.set(...moments.map((moment) => 1 / moment));
  body.updateInertiaWorld(true);
  made.addBody(body);
  return { body, computed };
}

function run(made, duration) {
  for (let step = 0; step < Math.round(duration / DT); step += 1) made.step(DT);
}

const box = (a, b, c) => [(b * b + c * c) / 3, (a * a + c * c) / 3, (a * a + b * b) / 3];
const BALL = [0.004, 0.004, 0.004];

// The ratio of a ball's speeds after and before an impact.
function restitution(contact) {
  const made = world({ restitution: 0.5, friction: 0, ...contact });
  const { body } = put(made, new C.Sphere(0.1), BALL, { position: [0, 1.1, 0] });
  let before = 0;
  for (let step = 0; step < 1000; step += 1) {
    before = body.velocity.y;
    made.step(DT);
    if (body.velocity.y > 0) return -body.velocity.y / before;
  }
  return NaN;
}
line("Ball of restitution 0.5, relaxation 1e9", restitution({}).toFixed(6), 0.5);
line("The same by default", restitution({ contactEquationRelaxation: 3 }).toFixed(3), 0.5);

// A box strikes the floor with one corner while it turns: the normal speed of the corner before and after.
{
  const made = world({ restitution: 0.5, friction: 0 }, 0);
  const moments = box(0.1, 0.15, 0.25);
  const { body } = put(made, new C.Box(new C.Vec3(0.1, 0.15, 0.25)), moments, { position: [0, 0.35, 0], velocity: [0, -1, 0], turn: [0.4, 0.2, 0.5], spin: [3, 0, 2] });
  const corner = () => {
    const arms = [-1, 1].flatMap((x) => [-1, 1].flatMap((y) => [-1, 1].map((z) => body.quaternion.vmult(new C.Vec3(0.1 * x, 0.15 * y, 0.25 * z)))));
    return arms.reduce((low, arm) => (arm.y < low.y ? arm : low));
  };
  for (let step = 0; step < 1000; step += 1) {
    const arm = corner();
    const [earlier, centre] = [body.velocity.vadd(body.angularVelocity.cross(arm)).y, body.velocity.y];
    made.step(DT);
    const later = body.velocity.vadd(body.angularVelocity.cross(arm)).y;
    if (body.velocity.y === centre) continue;
    line("Speed of a corner after its impact over that before", (-later / earlier).toFixed(3), 0.5);
    line("The same over that of the centre", (-later / centre).toFixed(3), "no law");
    break;
  }
}

// A box of µ 0.3 slides at 3 m/s: the speed lost in the first step, by the gravity that friction is limited by.
for (const [name, gravity] of [["gravity (the default)", undefined], ["gravity dt/4", (G * DT) / 4]]) {
  const made = world({ restitution: 0, friction: 0.3 });
  if (gravity) made.frictionGravity = new C.Vec3(0, -gravity, 0);
  const { body } = put(made, new C.Box(new C.Vec3(0.3, 0.1, 0.2)), box(0.3, 0.1, 0.2), { position: [0, 0.1, 0], velocity: [3, 0, 0] });
  run(made, 2 * DT); // in the first step the box does not touch the floor yet
  line(`Speed lost by a sliding box in a step, limit of ${name}`, `${shown(3 - body.velocity.x)} m/s`, shown(0.3 * G * DT));
}

// A box falls at 2 m/s with a slip of 3 m/s: the impulse of friction over that of the floor.
{
  const made = world({ restitution: 0, friction: 0.3 });
  made.frictionGravity = new C.Vec3(0, -G * DT, 0);
  const { body } = put(made, new C.Sphere(0.1), BALL, { position: [0, 0.101, 0], velocity: [3, -2, 0] });
  run(made, 3 * DT);
  line("Impulse of friction of a ball that falls at 2 m/s over the normal one", shown((3 - body.velocity.x) / 2), 0.3);
}

// Free bodies.
{
  const made = world({}, 0);
  const moments = [0.00189422, 0.00621102, 0.00719467];
  const spin = [0.4363323129985824, -0.2617993877991494, 0.6981317007977318];
  const { body } = put(made, null, moments, { spin });
  run(made, 10);
  line("Change of the angular velocity of a tumbling body in 10 s", shown(body.angularVelocity.distanceTo(new C.Vec3(...spin))), "about 1 rad/s");
}
{
  const made = world({}, 0);
  const { body } = put(made, null, BALL, { spin: [0, 10, 0] });
  run(made, 0.001);
  line("Angle of a step at 10 rad/s", 2 * Math.asin(body.quaternion.y), `0.01; 2 atan(0.005) is ${2 * Math.atan(0.005)}`);
}
{
  const { computed } = put(world({}), new C.Sphere(0.1), BALL, {});
  line("Moment of inertia of a ball of 0.1 m by default", computed[0].toFixed(5), "0.00400; of its bounding cube 0.00667");
}
