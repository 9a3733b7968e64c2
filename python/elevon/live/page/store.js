// What the page remembers: the last minutes of the signals that are watched.

const ROWS = 72_000;

export class Store {
  constructor() {
    this.time = new Float64Array(ROWS);
    this.columns = new Map();
    this.count = 0;
    this.gone = 0; // rows that were dropped: slices begin at whole numbers of all rows
    this.latest = {};
  }

  add(frame, names) {
    const { rows, columns, times, values } = frame;
    if (!names.length) return;
    for (const name of names)
      if (!this.columns.has(name)) this.columns.set(name, new Float32Array(ROWS).fill(NaN));
    if (this.count + rows > ROWS) this.shift(rows);
    this.time.set(times, this.count);
    for (const [name, column] of this.columns) {
      const k = names.indexOf(name);
      for (let row = 0; row < rows; row++) column[this.count + row] = k < 0 ? NaN : values[row * columns + k];
    }
    this.count += rows;
    if (rows) names.forEach((name, k) => { this.latest[name] = values[(rows - 1) * columns + k]; });
  }

  shift(rows) {
    const by = Math.max(rows, ROWS / 4);
    this.time.copyWithin(0, by, this.count);
    for (const column of this.columns.values()) column.copyWithin(0, by, this.count);
    this.count -= by;
    this.gone += by;
  }

  clear() { this.count = 0; }

  begin(seconds, end) {
    let low = 0, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time[middle] < end - seconds) low = middle + 1; else high = middle;
    }
    return low;
  }

  // Time and columns of a window; of each slice the least and the greatest, so that no peak is lost.
  window(names, units, seconds, end, slices) {
    const begin = this.begin(seconds, end), last = this.count;
    const stride = Math.max(1, Math.ceil((last - begin) / slices));
    // The same samples make a slice in each picture: peaks stand still while they scroll.
    const first = Math.max(0, begin - (this.gone + begin) % stride);
    const time = [];
    for (let i = first; i < last; i += stride) {
      time.push(this.time[i]);
      if (stride > 1) time.push(this.time[Math.min(i + (stride >> 1), last - 1)]);
    }
    const lines = names.map((name, k) => this.line(this.columns.get(name), units[k], first, last, stride));
    return [time, ...lines];
  }

  line(column, unit, first, last, stride) {
    const out = [], read = v => Number.isFinite(v) ? v * unit.scale + unit.offset : null;
    for (let i = first; i < last; i += stride) {
      if (!column) { out.push(null); if (stride > 1) out.push(null); continue; }
      if (stride === 1) { out.push(read(column[i])); continue; }
      let low = i, high = i;
      const stop = Math.min(i + stride, last);
      for (let j = i; j < stop; j++) {
        if (column[j] < column[low]) low = j;
        if (column[j] > column[high]) high = j;
      }
      const pair = low < high ? [low, high] : [high, low];
      out.push(read(column[pair[0]]), read(column[pair[1]]));
    }
    return out;
  }
}
