// Worlds of Rapier for rapier_js_engine.py.
"use strict";
const vector = ([x, y, z]) => ({ x, y, z });
const quaternion = ([x, y, z, w]) => ({ x, y, z, w });
const listed = ({ x, y, z, w }) => (w === undefined ? [x, y, z] : [x, y, z, w]);
let R;

async function load(library) {
  R = library;
  await R.init();
}

function floorOf({ kind, halfSize }) {
  if (kind === "box") return R.ColliderDesc.cuboid(halfSize, 1, halfSize).setTranslation(0, -1, 0);
  if (kind === "plane") return new R.ColliderDesc(new R.HalfSpace(vector([0, 1, 0])));
  const corners = [-1, 0, -1, -1, 0, 1, 1, 0, -1, 1, 0, 1].map((one) => halfSize * one);
  return R.ColliderDesc.trimesh(new Float32Array(corners), new Uint32Array([0, 1, 2, 2, 1, 3]));
}

function open({ gravity, floor, bodies, settings: { parameters, body: made, surface: material } }) {
  const world = new R.World(vector(gravity));
  const inForce = {};
  for (const [name, value] of Object.entries(parameters)) {
    if (!(name in world.integrationParameters)) continue; // old releases lack some
    world.integrationParameters[name] = value;
    inForce[name] = world.integrationParameters[name] ?? value; // some cannot be read
  }
  const surface = (shape) => shape.setDensity(0).setRestitution(material.restitution).setFriction(material.friction);
  const [body] = bodies.map((one) => {
    const moving = R.RigidBodyDesc.dynamic()
      .setTranslation(...one.position)
      .setRotation(quaternion(one.orientation))
      .setLinvel(...one.velocity)
      .setAngvel(vector(one.angular_velocity))
      .setLinearDamping(made.linearDamping ?? 0)
      .setAngularDamping(made.angularDamping ?? 0)
      .setCanSleep(made.canSleep ?? true)
      .setAdditionalMassProperties(one.mass, vector([0, 0, 0]), vector(one.moments), quaternion(one.axes));
    const added = world.createRigidBody(moving);
    if (floor) world.createCollider(surface(one.radius ? R.ColliderDesc.ball(one.radius) : R.ColliderDesc.cuboid(...one.halfExtents)), added);
    added.recomputeMassPropertiesFromColliders(); // else it has none before the first step
    return added;
  });
  if (floor) world.createCollider(surface(floorOf(floor)));
  const [mass, moments, axes] = [body.mass(), body.principalInertia?.(), body.principalInertiaLocalFrame?.()]; // from 0.11.2 on
  return {
    step: () => world.step(),
    state: () => [body.translation(), body.rotation(), body.linvel(), body.angvel()].flatMap(listed),
    broken: () => (body.isEnabled?.() ?? true ? undefined : "Rapier disabled the body: its state is not finite"),
    close: () => world.free(),
    settings: { ...inForce, ...made, ...material },
    substeps: world.integrationParameters.numSolverIterations,
    built: moments && { mass, moments: listed(moments), axes: listed(axes), gravity: listed(world.gravity) },
  };
}

module.exports = { load, open };
