// Worlds of Havok for havok_engine.py, whose lengths are in units of `unit` metres.
"use strict";
const fs = require("node:fs");
const path = require("node:path");
const THICKNESS = 4; // of the floor, which is a box, in units
const UNTURNED = [0, 0, 0, 1];
let H;

async function load(library, home) {
  H = await library({ wasmBinary: fs.readFileSync(path.join(home, "lib/esm/HavokPhysics.wasm")) });
}

// What a function of Havok returns beside its result.
function done(result) {
  const [code, value] = Array.isArray(result) ? result : [result];
  if (code !== H.Result.RESULT_OK) throw new Error("a function of Havok failed");
  return value;
}

function open({ dt, gravity, floor, bodies, settings: { world: chosen, body: made, surface } }) {
  const { unit, idealStepTime, linearSpeedLimit = 200, angularSpeedLimit = 100 } = chosen;
  const { restitution, friction } = surface;
  const world = done(H.HP_World_Create());
  const scaled = (numbers) => numbers.map((one) => one / unit);
  done(H.HP_World_SetGravity(world, scaled(gravity)));
  if (idealStepTime) done(H.HP_World_SetIdealStepTime(world, idealStepTime));
  done(H.HP_World_SetSpeedLimit(world, linearSpeedLimit, angularSpeedLimit));
  const add = (shape, kind) => {
    const body = done(H.HP_Body_Create());
    if (floor) {
      done(H.HP_Shape_SetMaterial(shape, [friction, friction, restitution, H.MaterialCombine.MAXIMUM, H.MaterialCombine.MAXIMUM]));
      done(H.HP_Body_SetShape(body, shape));
    }
    done(H.HP_Body_SetMotionType(body, kind));
    return body;
  };
  const box = (centre, halfExtents) => done(H.HP_Shape_CreateBox(centre, UNTURNED, halfExtents.map((one) => 2 * one)));
  if (floor) {
    const half = floor.halfSize / unit;
    done(H.HP_World_AddBody(world, add(box([0, -THICKNESS / 2, 0], [half, THICKNESS / 2, half]), H.MotionType.STATIC), false));
  }
  const [body] = bodies.map((one) => {
    const shape = one.radius ? done(H.HP_Shape_CreateSphere([0, 0, 0], one.radius / unit)) : box([0, 0, 0], scaled(one.halfExtents));
    const added = add(shape, H.MotionType.DYNAMIC);
    const moments = one.moments.map((moment) => moment / one.mass / unit ** 2);
    done(H.HP_Body_SetMassProperties(added, [[0, 0, 0], one.mass, moments, one.axes]));
    done(H.HP_Body_SetQTransform(added, [scaled(one.position), one.orientation]));
    if (made.linearDamping !== undefined) done(H.HP_Body_SetLinearDamping(added, made.linearDamping));
    if (made.angularDamping !== undefined) done(H.HP_Body_SetAngularDamping(added, made.angularDamping));
    if (made.alwaysActive) done(H.HP_Body_SetActivationControl(added, H.ActivationControl.ALWAYS_ACTIVE));
    done(H.HP_World_AddBody(world, added, false));
    done(H.HP_Body_SetLinearVelocity(added, scaled(one.velocity))); // outside of a world it is limited to 200
    done(H.HP_Body_SetAngularVelocity(added, one.angular_velocity));
    return added;
  });
  const metres = (numbers) => numbers.map((one) => one * unit);
  const [, mass, moments, axes] = done(H.HP_Body_GetMassProperties(body));
  return {
    step: () => done(H.HP_World_Step(world, dt)),
    state() {
      const [position, orientation] = done(H.HP_Body_GetQTransform(body));
      const [velocity, spin] = [done(H.HP_Body_GetLinearVelocity(body)), done(H.HP_Body_GetAngularVelocity(body))];
      return [...metres(position), ...orientation, ...metres(velocity), ...spin];
    },
    close: () => done(H.HP_World_Release(world)),
    settings: { ...chosen, ...made, ...surface },
    substeps: Math.min(8, Math.max(1, Math.ceil((4 * dt) / (idealStepTime ?? 1 / 60)))),
    built: { mass, moments: moments.map((one) => one * mass * unit ** 2), axes, gravity },
  };
}

module.exports = { load, open };
