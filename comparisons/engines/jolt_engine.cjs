// Worlds of Jolt for jolt_engine.py.
"use strict";
const FIXED = 0; // the layers of objects
const MOVING = 1;
const listed = (value) => [value.GetX(), value.GetY(), value.GetZ(), ...(value.GetW ? [value.GetW()] : [])];
let J;

const load = async (library) => void (J = await library());
const vector = (numbers) => new J.Vec3(...numbers);
const quaternion = (numbers) => new J.Quat(...numbers);

function layers() {
  const [pairs, broad] = [new J.ObjectLayerPairFilterTable(2), new J.BroadPhaseLayerInterfaceTable(2, 2)];
  pairs.EnableCollision(FIXED, MOVING);
  for (const layer of [FIXED, MOVING]) broad.MapObjectToBroadPhaseLayer(layer, new J.BroadPhaseLayer(layer));
  return Object.assign(new J.JoltSettings(), {
    mMaxWorkerThreads: 0,
    mObjectLayerPairFilter: pairs,
    mBroadPhaseLayerInterface: broad,
    mObjectVsBroadPhaseLayerFilter: new J.ObjectVsBroadPhaseLayerFilterTable(broad, 2, pairs, 2),
  });
}

function floorOf({ kind, halfSize }) {
  if (kind === "box") return [new J.BoxShape(vector([halfSize, halfSize, halfSize]), 0), -halfSize];
  return [new J.PlaneShape(new J.Plane(vector([0, 1, 0]), 0), undefined, halfSize), 0];
}

function open({ dt, gravity, floor, bodies, settings: { system: chosen, body: made, surface } }) {
  const jolt = new J.JoltInterface(layers());
  const system = jolt.GetPhysicsSystem();
  const settings = Object.assign(system.GetPhysicsSettings(), chosen);
  system.SetPhysicsSettings(settings);
  system.SetGravity(vector(gravity));
  const adder = system.GetBodyInterface();
  const add = (creation, layer) => {
    const body = adder.CreateBody(Object.assign(creation, surface));
    adder.AddBody(body.GetID(), layer === FIXED ? J.EActivation_DontActivate : J.EActivation_Activate);
    return body;
  };
  if (floor) {
    const [shape, height] = floorOf(floor);
    add(new J.BodyCreationSettings(shape, new J.RVec3(0, height, 0), quaternion([0, 0, 0, 1]), J.EMotionType_Static, FIXED), FIXED);
  }
  const [body] = bodies.map((one) => {
    const shape = one.radius ? new J.SphereShape(one.radius) : new J.BoxShape(vector(one.halfExtents), 0);
    const [position, turn] = [new J.RVec3(...one.position), quaternion(one.orientation)];
    const creation = new J.BodyCreationSettings(shape, position, turn, J.EMotionType_Dynamic, MOVING);
    creation.mOverrideMassProperties = J.EOverrideMassProperties_MassAndInertiaProvided;
    creation.mMassPropertiesOverride.mMass = one.mass;
    creation.mLinearVelocity = vector(one.velocity);
    creation.mAngularVelocity = vector(one.angular_velocity);
    const added = add(Object.assign(creation, made), MOVING);
    // As a tensor Jolt would find the axes, in single precision.
    added.GetMotionProperties().SetInverseInertia(vector(one.moments.map((moment) => 1 / moment)), quaternion(one.axes));
    return added;
  });
  const motion = body.GetMotionProperties();
  return {
    step: () => jolt.Step(dt, 1),
    state: () => [body.GetPosition(), body.GetRotation(), body.GetLinearVelocity(), body.GetAngularVelocity()].flatMap(listed),
    close: () => J.destroy(jolt),
    settings: { ...chosen, ...made, ...surface },
    built: {
      mass: 1 / motion.GetInverseMass(),
      moments: listed(motion.GetInverseInertiaDiagonal()).map((one) => 1 / one),
      axes: listed(motion.GetInertiaRotation()),
      gravity: listed(system.GetGravity()),
    },
  };
}

module.exports = { load, open };
