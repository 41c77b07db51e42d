// Rapier in Node.js, driven by rapier_js_engine.py: each request is a line of JSON, and each answer too, after steps with states as doubles.
"use strict";
const fs = require("node:fs");
const path = require("node:path");
const { pathToFileURL } = require("node:url");

const vector = ([x, y, z]) => ({ x, y, z });
const quaternion = ([x, y, z, w]) => ({ x, y, z, w });
const listed = ({ x, y, z, w }) => (w === undefined ? [x, y, z] : [x, y, z, w]);
const worlds = new Map();
let R;

async function load({ home }) {
  const named = JSON.parse(fs.readFileSync(path.join(home, "package.json"), "utf8"));
  // In some releases `main` is a CommonJS file of an ES package, which Node.js refuses; bundlers take `module`.
  const file = named.type === "module" ? named.module : named.main;
  const loaded = await import(pathToFileURL(path.join(home, file)).href);
  R = loaded.default ?? loaded;
  await R.init();
  return { version: named.version };
}

function floor({ kind, halfSize }) {
  if (kind === "box") return R.ColliderDesc.cuboid(halfSize, 1, halfSize).setTranslation(0, -1, 0);
  if (kind === "plane") return new R.ColliderDesc(new R.HalfSpace(vector([0, 1, 0])));
  const corners = [-1, 0, -1, -1, 0, 1, 1, 0, -1, 1, 0, 1].map((one) => halfSize * one);
  return R.ColliderDesc.trimesh(new Float32Array(corners), new Uint32Array([0, 1, 2, 2, 1, 3]));
}

function open({ world: number, gravity, parameters, bodies, made, ground }) {
  const world = new R.World(vector(gravity));
  const inForce = {};
  for (const [name, value] of Object.entries(parameters)) {
    if (!(name in world.integrationParameters)) continue; // old releases lack some
    world.integrationParameters[name] = value;
    inForce[name] = world.integrationParameters[name] ?? value; // some cannot be read
  }
  const surface = (shape) => shape.setDensity(0).setRestitution(ground.restitution).setFriction(ground.friction);
  const [body] = bodies.map((one) => {
    const moving = R.RigidBodyDesc.dynamic()
      .setTranslation(...one.position)
      .setRotation(quaternion(one.orientation))
      .setLinvel(...one.velocity)
      .setAngvel(vector(one.angular_velocity))
      .setLinearDamping(made.linearDamping ?? 0)
      .setAngularDamping(made.angularDamping ?? 0)
      .setCanSleep(made.canSleep)
      .setAdditionalMassProperties(one.mass, vector([0, 0, 0]), vector(one.moments), quaternion(one.axes));
    const added = world.createRigidBody(moving);
    if (ground.kind) {
      const shape = one.radius ? R.ColliderDesc.ball(one.radius) : R.ColliderDesc.cuboid(...one.halfExtents);
      world.createCollider(surface(shape), added);
    }
    added.recomputeMassPropertiesFromColliders(); // else it has none before the first step
    return added;
  });
  if (ground.kind) world.createCollider(surface(floor(ground)));
  worlds.set(number, { world, body });
  const [mass, moments, axes] = [body.mass(), body.principalInertia?.(), body.principalInertiaLocalFrame?.()]; // from 0.11.2 on
  return {
    parameters: inForce,
    substeps: world.integrationParameters.numSolverIterations ?? 1,
    built: moments && { mass, moments: listed(moments), axes: listed(axes), gravity: listed(world.gravity) },
  };
}

const state = (body) => [body.translation(), body.rotation(), body.linvel(), body.angvel()].flatMap(listed);

function record({ world: number, steps, every }) {
  const { world, body } = worlds.get(number);
  const states = new Float64Array(13 * (1 + Math.floor(steps / every)));
  states.set(state(body));
  for (let row = 13; row < states.length; row += 13) {
    for (let step = 0; step < every; step += 1) world.step();
    states.set(state(body), row);
  }
  return { enabled: body.isEnabled?.() ?? true, states };
}

function close({ world: number }) {
  worlds.get(number).world.free();
  worlds.delete(number);
  return {};
}

function send(bytes) {
  for (let sent = 0; sent < bytes.length; ) sent += fs.writeSync(1, bytes, sent);
}

function answer({ states, ...rest }) {
  const packed = states ? Buffer.from(states.buffer) : Buffer.alloc(0);
  send(Buffer.concat([Buffer.from(JSON.stringify({ ...rest, bytes: packed.length }) + "\n"), packed]));
}

async function main() {
  const todo = { load, open, record, close };
  const chunk = Buffer.alloc(65536);
  let text = "";
  for (;;) {
    const count = fs.readSync(0, chunk); // 0 when Python has ended
    if (count === 0) return;
    text += chunk.toString("utf8", 0, count);
    for (let end; (end = text.indexOf("\n")) >= 0; text = text.slice(end + 1)) {
      const { todo: name, ...given } = JSON.parse(text.slice(0, end));
      answer(await todo[name](given));
    }
  }
}

main().catch((error) => {
  answer({ error: String(error) });
  process.exit(1);
});
