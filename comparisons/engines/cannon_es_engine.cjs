// Worlds of cannon-es for cannon_es_engine.py.
"use strict";
let C;

const load = (library) => void (C = library);
const vector = (numbers) => new C.Vec3(...numbers);
const quaternion = (numbers) => new C.Quaternion(...numbers);
const listed = ({ x, y, z, w }) => (w === undefined ? [x, y, z] : [x, y, z, w]);

function floorOf({ kind, halfSize }) {
  const floor = new C.Body({ mass: 0 });
  if (kind === "box") floor.addShape(new C.Box(vector([halfSize, halfSize, halfSize])), vector([0, -halfSize, 0]));
  else floor.addShape(new C.Plane(), undefined, new C.Quaternion().setFromEuler(-Math.PI / 2, 0, 0)); // its normal is z
  return floor;
}

function open({ dt, gravity, floor, bodies, settings: { world: worlds, solver, contact, body: made } }) {
  const world = new C.World({ gravity: vector(gravity) });
  Object.assign(world.solver, solver);
  Object.assign(world.defaultContactMaterial, contact);
  if (worlds.frictionGravity) world.frictionGravity = vector([0, -worlds.frictionGravity, 0]); // its length alone is used
  if (floor) world.addBody(floorOf(floor));
  const [[body, toBody]] = bodies.map((one) => {
    // The moments of inertia are along the body's axes, so that the body has the principal axes; the shape is turned.
    const axes = quaternion(one.axes);
    const added = new C.Body({ mass: one.mass, ...made });
    const shape = one.radius ? new C.Sphere(one.radius) : new C.Box(vector(one.halfExtents));
    if (floor) added.addShape(shape, undefined, axes.inverse());
    added.position.set(...one.position);
    added.quaternion.copy(quaternion(one.orientation).mult(axes));
    added.velocity.set(...one.velocity);
    added.angularVelocity.set(...one.angular_velocity);
    added.inertia.set(...one.moments); // cannon-es computes them as of the box around the shape
    added.invInertia.set(...one.moments.map((moment) => 1 / moment));
    added.updateInertiaWorld(true);
    world.addBody(added);
    return [added, axes.inverse()];
  });
  
  const state = () => [body.position, body.quaternion.mult(toBody), body.velocity, body.angularVelocity].flatMap(listed);
  return {
    step: () => world.step(dt),
    state,
    close: () => {},
    settings: { ...worlds, ...solver, ...contact, ...made },
    built: { mass: body.mass, moments: listed(body.invInertia).map((one) => 1 / one), axes: bodies[0].axes, gravity: listed(world.gravity) },
  };
}

module.exports = { load, open };
