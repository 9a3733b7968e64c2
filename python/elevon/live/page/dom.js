// Elements in one line, numbers as a person reads them.

export const by = id => document.getElementById(id);

const SVG = "http://www.w3.org/2000/svg";

function filled(node, attributes, children) {
  for (const [key, value] of Object.entries(attributes ?? {})) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (key.startsWith("aria-") && typeof value === "boolean") node.setAttribute(key, String(value));
    else if (value === true) node.setAttribute(key, "");
    else if (value !== false && value != null) node.setAttribute(key, value);
  }
  node.append(...children.filter(child => child != null));
  return node;
}

export const element = (name, attributes, ...children) =>
  filled(document.createElement(name), attributes, children);

export const drawn = (name, attributes, ...children) =>
  filled(document.createElementNS(SVG, name), attributes, children);

// Sets an attribute, or the text, only where it changes: what stands still is not painted again.
export function put(node, key, value) {
  const was = node.was ??= {};
  if (was[key] === value) return;
  was[key] = value;
  if (key === "text") node.textContent = value;
  else if (value === null) node.removeAttribute(key);
  else node.setAttribute(key, value);
}

// Whether a node is on the screen, without asking the layout for it.
export class Sight {
  constructor(node) {
    this.seen = true;
    this.watch = new IntersectionObserver(entries => { this.seen = entries.at(-1).isIntersecting; });
    this.watch.observe(node);
  }
}

export function digits(value, count = 3) {
  if (value == null || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(count - 1);
  const places = size === 0 ? 0 : Math.max(0, count - 1 - Math.floor(Math.log10(size)));
  return value.toFixed(Math.min(places, 6));
}

// SI to what is read, and back.
export const toShown = (value, unit) => value * unit.scale + (unit.offset ?? 0);
export const toSi = (value, unit) => (value - (unit.offset ?? 0)) / unit.scale;
