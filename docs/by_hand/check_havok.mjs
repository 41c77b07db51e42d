// Repeats, with Havok's package for the web alone, what the page on engines says about it:
// `npm install @babylonjs/havok`, then, in the folder of node_modules, `node check_havok.mjs`.
//
// Lengths in m, times in s, a body has 1 kg; y is up. Havok computes in single precision.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join } from "node:path";
import { pathToFileURL } from "node:url";

const NAME = "@babylonjs/havok";
const found = createRequire(join(process.cwd(), "from_here.js"));
const module = join(dirname(found.resolve(NAME)), "../esm/HavokPhysics_es.js");
const H = await (await import(pathToFileURL(module).href)).default({ wasmBinary: readFileSync(join(dirname(module), "HavokPhysics.wasm")) });

const G = 9.8;
const DT = 1e-3;
const line = (what, measured, exact) => console.log(`${what}: ${measured}; exact: ${exact}`);
const value = ([, one]) => one;
const solid = ([x, y, z]) => [(y * y + z * z) / 3, (x * x + z * z) / 3, (x * x + y * y) / 3];

// States [velocity, spin, position, quaternion] before any step and after each. A body without half extents is a ball of 0.1 m.
function run({ steps, dt = DT, ideal = dt, gravity = 0, e = 0, friction = 0, floor = true, halfExtents, moments, limit, ...start }) {
  const world = value(H.HP_World_Create());
  H.HP_World_SetGravity(world, [0, -gravity, 0]);
  H.HP_World_SetIdealStepTime(world, ideal);
  if (limit) H.HP_World_SetSpeedLimit(world, limit, limit);
  const box = (centre, sizes) => value(H.HP_Shape_CreateBox(centre, [0, 0, 0, 1], sizes));
  const add = (shape, kind) => {
    const body = value(H.HP_Body_Create());
    H.HP_Shape_SetMaterial(shape, [friction, friction, e, H.MaterialCombine.MAXIMUM, H.MaterialCombine.MAXIMUM]);
    H.HP_Body_SetShape(body, shape);
    H.HP_Body_SetMotionType(body, kind);
    return body;
  };
  if (floor) H.HP_World_AddBody(world, add(box([0, -2, 0], [100, 4, 100]), H.MotionType.STATIC), false);
  const shape = halfExtents ? box([0, 0, 0], halfExtents.map((one) => 2 * one)) : value(H.HP_Shape_CreateSphere([0, 0, 0], 0.1));
  const body = add(shape, H.MotionType.DYNAMIC);
  const inertia = moments ?? (halfExtents ? solid(halfExtents) : [0.004, 0.004, 0.004]);
  H.HP_Body_SetMassProperties(body, [[0, 0, 0], 1, inertia, [0, 0, 0, 1]]);
  H.HP_Body_SetQTransform(body, [start.position ?? [0, 9, 0], start.turn ?? [0, 0, 0, 1]]);
  H.HP_Body_SetLinearDamping(body, 0);
  H.HP_Body_SetAngularDamping(body, 0);
  H.HP_Body_SetActivationControl(body, H.ActivationControl.ALWAYS_ACTIVE);
  H.HP_World_AddBody(world, body, false);
  H.HP_Body_SetLinearVelocity(body, start.velocity ?? [0, 0, 0]);
  H.HP_Body_SetAngularVelocity(body, start.spin ?? [0, 0, 0]);
  const state = () => [value(H.HP_Body_GetLinearVelocity(body)), value(H.HP_Body_GetAngularVelocity(body)), ...value(H.HP_Body_GetQTransform(body))];
  const states = [state()];
  for (let step = 0; step < steps; step += 1) {
    H.HP_World_Step(world, dt);
    states.push(state());
  }
  H.HP_World_Release(world);
  return states;
}

// Slow motion without a force.
for (const speed of [0.01, 0.05, 0.11]) {
  const [[[before]], [[after]]] = run({ steps: 1, velocity: [speed, 0, 0], floor: false });
  line(`Deceleration of a free body of ${speed} m/s`, `${((before - after) / DT).toFixed(3)} m/s²`, 0);
}
{
  const [[[slow]]] = run({ steps: 0, velocity: [1e-12, 0, 0], floor: false });
  line("Speed of a body whose speed is set to 1e-12 m/s", slow, 1e-12);
}

// The first step of a fall: N substeps of semi-implicit Euler fall by g dt² (N + 1)/(2 N).
for (const ratio of [0.06, 1, 2, 4]) {
  const [, [, , [, fallen]]] = run({ steps: 1, gravity: G, ideal: DT / ratio, velocity: [1, 0, 0], position: [0, 0, 0], floor: false });
  line(`Fall in a step that is ${ratio} times the ideal one, over g dt²`, (-fallen / (G * DT ** 2)).toFixed(3), "0.5 + 1/(2 N), N = 1, 4, 8, 16");
}

// Limits of the speeds, and a rotation.
{
  const [, [[fast], [, fastSpin]]] = run({ steps: 1, velocity: [1000, 0, 0], spin: [0, 500, 0], floor: false });
  line("By default 1000 m/s and 500 rad/s become", `${fast.toFixed(0)} m/s and ${fastSpin.toFixed(0)} rad/s`, "1000 and 500");
  const [, [[free], [, freeSpin]]] = run({ steps: 1, velocity: [1000, 0, 0], spin: [0, 500, 0], floor: false, limit: 1e15 });
  line("With a limit of 1e15", `${free.toFixed(0)} m/s and ${freeSpin.toFixed(0)} rad/s`, "1000 and 500");
  const [, [, , , [, turned]]] = run({ steps: 1, spin: [0, 50, 0], floor: false });
  line("Angle of a step at 50 rad/s", (2 * Math.asin(turned)).toFixed(6), "0.05; 2 atan(0.025) is 0.049990");
  const spin = [0.4363323129985824, -0.2617993877991494, 0.6981317007977318];
  const [, after] = run({ steps: 10000, spin, moments: [0.00189422, 0.00621102, 0.00719467], floor: false }).at(-1);
  line("Change of the angular velocity of a tumbling body in 10 s", Math.hypot(...after.map((one, axis) => one - spin[axis])).toExponential(1), "about 1 rad/s");
}

// Impacts.
const jumps = (states) => states.findIndex(([[, v]], step) => step && v > states[step - 1][0][1] + 0.2 && v > 0);
{
  const states = run({ steps: 1000, gravity: G, e: 0.5, position: [0, 1.1, 0] });
  const hit = jumps(states);
  line("Ball of restitution 0.5: rebound over the speed two steps before", (-states[hit][0][1] / states[hit - 2][0][1]).toFixed(4), "0.5, less g dt/u = 0.0011");
  line("Speed in the step before over that", (states[hit - 1][0][1] / states[hit - 2][0][1]).toFixed(3), "1; it reaches the floor in that step");
}
for (const e of [0, 0.6]) {
  const states = run({ steps: 300, gravity: G, e, friction: 0.12, position: [0, 0.4, 0], velocity: [6, 0, 0] });
  const hit = states.findIndex(([[v]]) => v < 5.99);
  const speed = -states[hit - 2][0][1] + G * DT;
  line(`Ball with µ 0.12 and restitution ${e}: friction in the impact over µ u`, ((6 - states[hit][0][0]) / 0.12 / speed).toFixed(2), 1 + e);
}
for (const dt of [4e-3, 2e-3, 1e-3]) {
  const turn = [0, 0, Math.SQRT1_2, Math.SQRT1_2];
  const states = run({ dt, steps: 0.4 / dt, e: 0.6, halfExtents: [0.15, 0.1, 0.25], turn, position: [0, 0.35, 0], velocity: [0, -2, 0] });
  const [[, up], spin] = states.at(-1);
  line(`Box of restitution 0.6 that lands flat at 2 m/s, dt ${dt} s`, `${up.toFixed(3)} m/s, ${Math.hypot(...spin).toFixed(3)} rad/s`, "1.2 m/s, 0 rad/s");
}
process.exit(0);
