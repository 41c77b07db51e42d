  // --- motions: reports/replay/data.py writes them ---
  const bytes = (text) => Uint8Array.from(atob(text), (character) => character.charCodeAt(0)).buffer;
  const unpacked = (column, count) => {
    if (typeof column === "number") return Array(count).fill(column);
    if (!("step" in column)) return Array.from(new Float32Array(bytes(column.data)));
    return Array.from(new Uint16Array(bytes(column.data)), (level) => column.low + column.step * level);
  };
  const rows = (columns, count) => {
    const all = columns.map((column) => unpacked(column, count));
    return Array.from({ length: count }, (_, row) => all.map((column) => column[row]));
  };
  // The upper halves of 32-bit floats.
  const doubled = (text) => Array.from(new Float32Array(Uint32Array.from(new Uint16Array(bytes(text)), (half) => half * 65536).buffer));

  const HELD = 0.25;           // seconds of the scene: the largest impulse within them is shown

  class Motion {
    constructor(raw, interval) {
      this.label = raw.label;
      this.name = raw.name;
      this.colour = raw.colour;
      this.isExact = raw.isExact;
      this.shown = true;
      this.times = [...Array.from({ length: raw.count }, (_, frame) => frame * interval), ...raw.between].sort((a, b) => a - b);
      this.position = rows(raw.position, this.times.length);
      this.orientation = rows(raw.rotation, this.times.length).map((v) => about(unit(v), size(v)));
      this.turns = raw.turns;
      this.errors = raw.errors.map(doubled);
      this.impacts = raw.impacts.map((impact) => ({ ...impact, size: size(impact.impulse) }));
      this.end = this.times.at(-1);
    }

    hasEnded(time) {
      return time > this.end + 1e-9;
    }

    // The last frame that is not after a time.
    row(time) {
      let low = 0, high = this.times.length;
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (this.times[middle] <= time + 1e-9) low = middle; else high = middle;
      }
      return low;
    }

    nearest(time) {
      const row = this.row(time), next = this.times[row + 1] ?? Infinity;
      return next - time < time - this.times[row] ? row + 1 : row;
    }

    // Between frames the motion is straight and the rotation uniform.
    at(time) {
      const row = this.row(time), s = (time - this.times[row]) / (this.times[row + 1] - this.times[row]);
      const position = this.position[row], orientation = this.orientation[row];
      if (row === this.times.length - 1 || s < 1e-6) return { position, orientation };
      return {
        position: plus(times(position, 1 - s), this.position[row + 1], s),
        orientation: turned(orientation, this.orientation[row + 1], s, this.turns[row] ?? 0),
      };
    }

    trail(time) {
      return [...this.position.slice(0, this.row(time) + 1), this.at(time).position];
    }

    // The impacts within the last HELD seconds, and the one of them with the largest impulse.
    recent(time) {
      return this.impacts.filter((impact) => impact.time <= time + 1e-9 && impact.time >= time - HELD - 1e-9);
    }

    held(time) {
      return this.recent(time).reduce((best, impact) => (best && best.size >= impact.size ? best : impact), null);
    }
  }
