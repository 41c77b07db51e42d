// The bridge to engines in JavaScript: each request is a line of JSON, and each answer too, after steps with states as doubles.
//
// The driver of an engine is a file with `load(library, home)`, which takes what the package exports and its folder, and `open(scene)`, which
// returns a world: `step()`, `state()` (13 numbers), `close()`, `settings` in force, and perhaps `substeps`, `built` and `broken()`, a sentence.
"use strict";
const fs = require("node:fs");
const path = require("node:path");
const { pathToFileURL } = require("node:url");

console.log = console.error; // answers alone are written to the standard output
const worlds = new Map();
let driver;

async function load({ driver: file, home }) {
  const named = JSON.parse(fs.readFileSync(path.join(home, "package.json"), "utf8"));
  // In some packages `main` is a CommonJS file of an ES package, which Node.js refuses; bundlers take `module`.
  const main = (named.type === "module" && named.module) || named.main;
  const library = await import(pathToFileURL(path.join(home, main)).href);
  driver = require(file);
  await driver.load(library.default ?? library, home);
  return { version: named.version };
}

function open({ world: number, ...scene }) {
  const world = driver.open(scene);
  worlds.set(number, world);
  return { settings: world.settings, substeps: world.substeps ?? 1, built: world.built };
}

function record({ world: number, steps, every }) {
  const world = worlds.get(number);
  const states = new Float64Array(13 * (1 + Math.floor(steps / every)));
  states.set(world.state());
  for (let row = 13; row < states.length; row += 13) {
    for (let step = 0; step < every; step += 1) world.step();
    states.set(world.state(), row);
  }
  return { broken: world.broken?.(), states };
}

function close({ world: number }) {
  worlds.get(number).close();
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
