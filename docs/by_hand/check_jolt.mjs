// Repeats, with Jolt's package for JavaScript alone, what the page on engines says about it:
// `npm install jolt-physics`, then, in the folder of node_modules, `node check_jolt.mjs`.
//
// Lengths in m, times in s, a body has 1 kg; y is up. Jolt computes in single precision.
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const NAME = "jolt-physics";
const found = createRequire(join(process.cwd(), "from_here.js"));
const J = await (await import(pathToFileURL(found.resolve(NAME)).href)).default();

const G = 9.8;
const DT = 1e-3;
const line = (what, measured, exact) => console.log(`${what}: ${measured}; exact: ${exact}`);
const shown = (number) => number.toExponential(2);
const listed = (value) => [value.GetX(), value.GetY(), value.GetZ(), ...(value.GetW ? [value.GetW()] : [])];
const vector = (numbers) => new J.Vec3(...numbers);
const box = ([x, y, z]) => [(y * y + z * z) / 3, (x * x + z * z) / 3, (x * x + y * y) / 3];

// States [position, quaternion, velocity, spin] before any step and after each; a body without half extents is a ball of 0.1 m.
// A step's fall is the distance within which contacts are looked for, and depth is pushed out.
function run({ steps, dt = DT, gravity = 0, e = 0, friction = 0, system = {}, body = {}, halfExtents, moments, ...start }) {
  const [pairs, broad, settings] = [new J.ObjectLayerPairFilterTable(2), new J.BroadPhaseLayerInterfaceTable(2, 2), new J.JoltSettings()];
  pairs.EnableCollision(0, 1);
  for (const layer of [0, 1]) broad.MapObjectToBroadPhaseLayer(layer, new J.BroadPhaseLayer(layer));
  const filter = new J.ObjectVsBroadPhaseLayerFilterTable(broad, 2, pairs, 2);
  Object.assign(settings, { mObjectLayerPairFilter: pairs, mBroadPhaseLayerInterface: broad, mObjectVsBroadPhaseLayerFilter: filter });
  const jolt = new J.JoltInterface(settings);
  const physics = jolt.GetPhysicsSystem();
  const exact = { mPenetrationSlop: 0, mMinVelocityForRestitution: 0, mSpeculativeContactDistance: gravity * dt * dt };
  physics.SetPhysicsSettings(Object.assign(physics.GetPhysicsSettings(), exact, { mUseBodyPairContactCache: false }, system));
  physics.SetGravity(vector([0, -gravity, 0]));
  const add = (shape, position, turn, motion, layer, more) => {
    const creation = new J.BodyCreationSettings(shape, new J.RVec3(...position), new J.Quat(...turn), motion, layer);
    const added = physics.GetBodyInterface().CreateBody(Object.assign(creation, { mRestitution: e, mFriction: friction }, more));
    physics.GetBodyInterface().AddBody(added.GetID(), layer ? J.EActivation_Activate : J.EActivation_DontActivate);
    return added;
  };
  const floor = new J.PlaneShape(new J.Plane(vector([0, 1, 0]), 0));
  if (gravity) add(floor, [0, 0, 0], [0, 0, 0, 1], J.EMotionType_Static, 0);
  const shape = halfExtents ? new J.BoxShape(vector(halfExtents), 0) : new J.SphereShape(0.1);
  const more = { mLinearDamping: 0, mAngularDamping: 0, mAllowSleeping: false, mLinearVelocity: vector(start.velocity ?? [0, 0, 0]) };
  Object.assign(more, { mApplyGyroscopicForce: true, mMaxAngularVelocity: 1e15, ...body, mAngularVelocity: vector(start.spin ?? [0, 0, 0]) });
  const made = add(shape, start.position ?? [0, 0, 0], start.turn ?? [0, 0, 0, 1], J.EMotionType_Dynamic, 1, more);
  const inertia = moments ?? (halfExtents ? box(halfExtents) : [0.004, 0.004, 0.004]);
  made.GetMotionProperties().SetInverseMass(1);
  made.GetMotionProperties().SetInverseInertia(vector(inertia.map((moment) => 1 / moment)), new J.Quat(0, 0, 0, 1));
  const state = () => [made.GetPosition(), made.GetRotation(), made.GetLinearVelocity(), made.GetAngularVelocity()].map(listed);
  const states = [state()];
  for (let step = 0; step < steps; step += 1) {
    jolt.Step(dt, 1);
    states.push(state());
  }
  J.destroy(jolt);
  return states;
}

// A ball of restitution 0.5 falls 1 m, and one lands at 0.9 m/s.
const rebound = (states) => {
  const hit = states.findIndex(([, , [, v]]) => v > 0);
  return hit < 0 ? 0 : -states[hit][2][1] / states[hit - 1][2][1];
};
line("Ball of restitution 0.5 that falls 1 m", rebound(run({ steps: 600, gravity: G, e: 0.5, position: [0, 1.1, 0] })).toFixed(6), 0.5);
const slow = { steps: 200, gravity: G, e: 0.5, position: [0, 0.1413, 0] };
line("Ball that lands at 0.9 m/s", rebound(run(slow)).toFixed(6), 0.5);
line("The same by default", rebound(run({ ...slow, system: { mMinVelocityForRestitution: 1 } })).toFixed(6), 0.5);
{
  const states = run({ steps: 600, gravity: G, e: 0.5, position: [0, 1.1, 0], system: { mSpeculativeContactDistance: 0.02 } });
  const hit = states.findIndex(([, , [, v]]) => v > 0);
  line("Height of the ball in its impact, contacts within 2 cm", `${shown(states[hit - 1][0][1] - 0.1)} m`, "0 m, up to a step late or early");
}

// A leaning stick, 1 m long, slips on a smooth floor: no force is horizontal.
for (const kept of [false, true]) {
  const [lean, halfExtents] = [0.1, [0.02, 0.5, 0.02]];
  const height = 0.5 * Math.cos(lean) + 0.02 * Math.sin(lean);
  const turn = [0, 0, Math.sin(lean / 2), Math.cos(lean / 2)];
  const states = run({ steps: 500, gravity: G, halfExtents, turn, position: [0, height, 0], system: { mUseBodyPairContactCache: kept } });
  line(`Horizontal speed of a slipping stick after 0.5 s, contacts ${kept ? "" : "not "}kept`, `${shown(states.at(-1)[2][0])} m/s`, 0);
}

// Free bodies.
const spin = [0.4363323129985824, -0.2617993877991494, 0.6981317007977318];
const brick = [0.00189422, 0.00621102, 0.00719467];
const energy = (states) => {
  const turned = ([, [x, y, z, w], , v]) => {
    const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    const once = cross(v, [x, y, z]);
    const twice = cross(once, [x, y, z]);
    return v.map((component, axis) => component + 2 * w * once[axis] + 2 * twice[axis]);
  };
  const kinetic = (state) => turned(state).reduce((sum, rate, axis) => sum + brick[axis] * rate ** 2, 0);
  return kinetic(states.at(-1)) / kinetic(states[0]) - 1;
};
for (const mApplyGyroscopicForce of [true, false]) {
  const states = run({ steps: 10000, dt: 2e-3, spin, moments: brick, body: { mApplyGyroscopicForce } });
  const change = Math.hypot(...states.at(-1)[3].map((one, axis) => one - spin[axis]));
  const name = `20 s of tumbling at 2 ms, gyroscopic term ${mApplyGyroscopicForce ? "on" : "off, as by default"}`;
  line(name, `angular velocity changes by ${shown(change)} rad/s, energy by ${shown(energy(states))}`, "about 1 rad/s, 0");
}
line("Angle of a step at 50 rad/s", (2 * Math.asin(run({ steps: 1, spin: [0, 50, 0] })[1][1][1])).toFixed(6), "0.05; 2 atan(0.025) is 0.049990");
line("1000 steps of 0.9e-6 rad turn by", shown(2 * Math.asin(run({ steps: 1000, spin: [0, 0.9e-3, 0] }).at(-1)[1][1])), "9.0e-4 rad");
line("1000 steps of 1.1e-6 rad turn by", shown(2 * Math.asin(run({ steps: 1000, spin: [0, 1.1e-3, 0] }).at(-1)[1][1])), "1.1e-3 rad");
line("By default 500 rad/s become", run({ steps: 1, spin: [0, 500, 0], body: { mMaxAngularVelocity: 0.25 * Math.PI * 60 } })[1][3][1].toFixed(1), 500);
process.exit(0);
