// Where snapshots come from: the server's socket, or a session that was recorded in the page.

const HEAD = 32;

export function unpack(buffer) {
  const view = new DataView(buffer);
  const rows = view.getUint32(24, true), columns = view.getUint32(28, true);
  const times = new Float64Array(rows);
  for (let i = 0; i < rows; i++) times[i] = view.getFloat64(HEAD + 8 * i, true);
  const values = new Float32Array(rows * columns);
  const begin = HEAD + 8 * rows;
  for (let i = 0; i < values.length; i++) values[i] = view.getFloat32(begin + 4 * i, true);
  return { time: view.getFloat64(0, true), factor: view.getFloat64(8, true),
    wanted: view.getFloat32(16, true), choice: view.getUint32(20, true), rows, columns, times, values };
}

export class LiveSource {
  constructor() {
    const token = new URLSearchParams(location.search).get("token");
    this.query = token ? `?token=${encodeURIComponent(token)}` : "";
    this.viewer = "";
    this.choice = 0;
    this.names = [];
  }

  async model() {
    return (await fetch(`model${this.query}`)).json();
  }

  async act(message) {
    const answer = await fetch(`act${this.query}`, { method: "POST", body: JSON.stringify(message),
      headers: { "content-type": "application/json", "x-viewer": this.viewer } });
    return answer.json();
  }

  fileAddress(name) {
    return `files/${encodeURIComponent(name)}${this.query}`;
  }

  watch(names) {
    this.names = names;
    this.choice += 1;
    if (this.socket?.readyState === WebSocket.OPEN)
      this.socket.send(JSON.stringify({ watch: names, choice: this.choice }));
  }

  begin(handlers) {
    const address = new URL(`stream${this.query}`, location.href);
    address.protocol = location.protocol.replace("http", "ws");
    this.socket = new WebSocket(address);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => this.watch(this.names);
    this.socket.onmessage = event => {
      if (typeof event.data !== "string") {
        const frame = unpack(event.data);
        handlers.frame(frame, frame.choice === this.choice ? this.names : []);
        return;
      }
      const message = JSON.parse(event.data);
      if (message.viewer) this.viewer = message.viewer;
      if (message.state) handlers.state({ ...message.state, mine: message.mine });
    };
    this.socket.onclose = () => {
      handlers.lost();
      setTimeout(() => this.begin(handlers), 1500);
    };
  }
}

// A recorded session: frames thirty times a second from the arrays of session.json, in a loop.
export class RecordedSource {
  constructor(session) {
    this.session = session;
    this.names = [];
    const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
    this.times = new Float64Array(bytes(session.times));
    this.columns = Object.fromEntries(
      Object.entries(session.values).map(([name, text]) => [name, new Float32Array(bytes(text))]));
  }

  async model() { return this.session.model; }
  async act() { return { error: "a recorded session takes no commands: start elevon live" }; }
  fileAddress() { return "#"; }
  watch(names) { this.names = names; }

  begin(handlers) {
    let at = 0, offset = 0, start = performance.now();
    const step = () => {
      const now = (performance.now() - start) / 1000;
      const first = at;
      while (at < this.times.length && this.times[at] - this.times[0] <= now) at++;
      this.hand(handlers, first, at, offset);
      if (at >= this.times.length) {
        offset += this.times.at(-1) - this.times[0] + 0.01;
        at = 0;
        start = performance.now();
      }
      setTimeout(step, 33);
    };
    step();
  }

  hand(handlers, first, last, offset) {
    const names = this.names.filter(name => name in this.columns);
    const rows = last - first, values = new Float32Array(rows * names.length);
    const times = Float64Array.from(this.times.subarray(first, last), t => t + offset);
    names.forEach((name, column) => {
      for (let i = 0; i < rows; i++) values[i * names.length + column] = this.columns[name][first + i];
    });
    const time = this.times[Math.max(0, last - 1)];
    handlers.frame({ time: time + offset, factor: 1, wanted: 1, rows, columns: names.length, times, values }, names);
    const state = this.session.states.findLast(item => item.time <= time) ?? this.session.states[0];
    if (state && state !== this.state) handlers.state(this.state = state);
  }
}
