// Worlds of a body that falls without turning, with a package that adds two numbers.
"use strict";
let add;

const load = (library) => void (add = library.add);

function open({ dt, gravity, bodies: [{ position, orientation, velocity, angular_velocity: spin }], settings }) {
  let [x, v] = [position, velocity];
  const moved = (values, rates) => values.map((value, axis) => add(value, dt * rates[axis]));
  return {
    step() {
      v = moved(v, gravity);
      x = moved(x, v);
    },
    state: () => [...x, ...orientation, ...v, ...spin],
    broken: () => (x[1] < settings.lowest ? "below the lowest height" : undefined),
    close: () => console.log("what a package prints is no answer"),
    settings,
  };
}

module.exports = { load, open };
