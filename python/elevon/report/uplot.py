"""Interactive time charts inside a page, with uPlot (vendored, MIT) and nothing from the network.

A page carries the library once (`assets`), then any number of charts (`chart`). Data travel as
base64 inside the page: times as float64, values as float32, thinned to the extremes of equal time
slices when they are many, so that no peak is lost.
"""

import base64
import json
from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from importlib.resources import files

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.report.policy import policy

COLOURS = ("#2f7fd1", "#e0782f", "#2f9e6e", "#d1483c", "#8a6fd0", "#8a929d", "#b8860b", "#0f8b8d")
"""Of middle lightness, legible on white and near-black, distinct to the colour-blind."""

_MOST_POINTS = 20_000

_STYLE = """
.elevon-chart { margin: 0 0 1.6rem; }
.elevon-chart h3 { font: 600 1rem system-ui, sans-serif; margin: 0 0 .3rem; }
.elevon-chart .note { font: .8rem system-ui, sans-serif; opacity: .7; margin: .2rem 0 0; }
.elevon-chart .plot { width: 100%; }
.elevon-chart .u-legend { text-align: left; font-size: .8rem; }
"""

_SCRIPT = """
(() => {
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
  const known = values => Array.from(values, v => Number.isFinite(v) ? v : null);
  const ink = () => getComputedStyle(document.body).color;
  const sync = uPlot.sync("elevon");
  function draw(host) {
    const spec = JSON.parse(host.querySelector("script").textContent);
    const plot = host.querySelector(".plot");
    const grid = { stroke: "rgba(128,128,128,.25)", width: 1 };
    const axis = (label, size) => ({ label, stroke: ink, grid, ticks: grid, labelSize: 22, size });
    const width = () => Math.max(200, plot.clientWidth);
    const number = (u, v) => v == null ? "--" : Number(v.toPrecision(7)).toString();
    const shade = u => spec.shaded.forEach(([start, end, text, alarming], k) => {
      const [from, to] = [start, end].map(t => u.valToPos(t, "x", true));
      const { left, top, width, height } = u.bbox;
      const [a, b] = [Math.max(from, left), Math.min(to, left + width)];
      if (b <= a) return;
      u.ctx.save();
      u.ctx.fillStyle = alarming ? "rgba(209,72,60,.12)" : `rgba(128,136,148,${k % 2 ? .05 : .14})`;
      u.ctx.fillRect(a, top, b - a, height);
      u.ctx.beginPath(); u.ctx.rect(a, top, b - a, height); u.ctx.clip();
      u.ctx.fillStyle = alarming ? "#c0392b" : ink();
      u.ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
      u.ctx.fillText(text, a + 4, top + (13 + 13 * (k % 3)) * devicePixelRatio);
      u.ctx.restore();
    });
    const options = {
      width: width(), height: spec.height, cursor: { sync: { key: sync.key } },
      scales: { x: { time: false, distr: spec.log ? 3 : 1 }, y: { distr: spec.log ? 3 : 1 } },
      hooks: { drawClear: [shade] }, axes: [axis(spec.x, 34), axis(spec.y, 60)],
      series: [{ label: spec.x, value: number }, ...spec.series.map(s => ({
        label: s.name, stroke: s.colour, dash: s.dash, width: 1.4, value: number,
        points: { show: false } }))],
    };
    const data = [Array.from(new Float64Array(bytes(spec.time))),
      ...spec.series.map(s => known(new Float32Array(bytes(s.values))))];
    const drawn = new uPlot(options, data, plot);
    new ResizeObserver(() => drawn.setSize({ width: width(), height: spec.height })).observe(plot);
    host.dataset.ready = "1";
  }
  document.addEventListener("DOMContentLoaded",
    () => document.querySelectorAll(".elevon-chart").forEach(draw));
})();
"""


@cache
def assets() -> str:
    """Return the style and script elements that a page with charts needs, once.

    Returns
    -------
    str
        HTML for the head of the page. The page must allow inline scripts and styles.
    """
    vendor = files("elevon.report") / "vendor"
    library = (vendor / "uPlot.iife.min.js").read_text(encoding="utf-8")
    style = (vendor / "uPlot.min.css").read_text(encoding="utf-8")
    licence = (vendor / "LICENSE-uplot.txt").read_text(encoding="utf-8")
    return (
        f"<style>{style}{_STYLE}</style>\n"
        f"<script>/*\n{licence}*/\n{library}</script>\n<script>{_SCRIPT}</script>"
    )


def chart(
    title: str,
    time: npt.ArrayLike,
    lines: Mapping[str, npt.ArrayLike],
    *,
    x_label: str = "time [s]",
    y_label: str = "",
    height: int = 260,
    note: str = "",
    breaks: tuple[int, ...] = (),
    shaded: Sequence[tuple[float, float, str, bool]] = (),
    logarithmic: bool = False,
    dashed: Sequence[str] = (),
) -> str:
    """Return one chart as an HTML element; the page needs `assets` in its head.

    Parameters
    ----------
    title : str
        Heading; any text, it is escaped, as are all other texts.
    time : array_like, shape (n,)
        Abscissa, increasing.
    lines : mapping of str to array_like, shape (n,)
        Name to values; values that are not finite leave a hole in the line.
    x_label, y_label : str
        Axis labels with units.
    height : int
        Height of the plot in CSS pixels.
    note : str
        Small text below; that the data were thinned is added to it.
    breaks : tuple of int
        Indices k after which every line is interrupted (gaps of a clock).
    shaded : sequence of (start, end, text, alarming)
        Stretches of the abscissa that are shaded and named.
    logarithmic : bool
        Of both axes.
    dashed : sequence of str
        Lines that are drawn dashed.

    Returns
    -------
    str
        An HTML element.
    """
    instants = np.asarray(time, dtype=np.float64)
    values = {name: np.asarray(line, dtype=np.float64) for name, line in lines.items()}
    if breaks:
        instants, values = _interrupted(instants, values, breaks)
    selected, drawn = thinned(instants, values)
    if selected.size < instants.size:
        note = f"{note} " if note else ""
        note += (
            f"{instants.size} samples drawn as the extremes of {selected.size // 2} time slices."
        )
    spec = {
        "x": x_label,
        "y": y_label,
        "height": int(height),
        "shaded": [list(item) for item in shaded],
        "log": bool(logarithmic),
        "time": _base64(selected),
        "series": [
            {
                "name": name,
                "colour": COLOURS[k % len(COLOURS)],
                "dash": [6, 4] if name in dashed else [],
                "values": _base64(_float32(line)),
            }
            for k, (name, line) in enumerate(drawn.items())
        ],
    }
    data = json.dumps(spec).replace("<", "\\u003c")
    caption = f'<p class="note">{escape(note)}</p>' if note else ""
    return (
        f'<section class="elevon-chart"><h3>{escape(title)}</h3><div class="plot"></div>{caption}'
        f'<script type="application/json">{data}</script></section>'
    )


def page(title: str, body: str) -> str:
    """Return a whole self-contained page around charts.

    Parameters
    ----------
    title : str
        Title, escaped.
    body : str
        HTML, such as charts one after the other; taken as it is.
    """
    look = (
        ":root { color-scheme: light dark; } body { margin: 1.5rem auto; max-width: 75rem; "
        "padding: 0 1rem; background: Canvas; color: CanvasText; } "
        "h1 { font: 600 1.3rem system-ui, sans-serif; }"
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy(assets())}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{look}</style>\n{assets()}</head>\n"
        f"<body><h1>{escape(title)}</h1>\n{body}\n</body></html>\n"
    )


def thinned(
    time: Floats, values: Mapping[str, Floats], most: int = _MOST_POINTS
) -> tuple[Floats, dict[str, Floats]]:
    """Keep the least and the greatest value of each of equal slices of the samples.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Abscissa.
    values : mapping of str to ndarray, shape (n,)
        Lines.
    most : int
        The largest number of points selected.

    Returns
    -------
    time : ndarray, shape (m,)
        As given when n <= most, else two instants for each slice.
    values : dict of str to ndarray, shape (m,)
        As given, or the extremes in the order in which they occur; a slice with no finite value is
        NaN.
    """
    if time.size <= most:
        return time, dict(values)
    edges = np.unique(np.linspace(0, time.size, most // 2 + 1).astype(np.intp))
    starts = edges[:-1]
    middles = (starts + edges[1:]) // 2
    selected = np.empty(2 * starts.size)
    selected[0::2], selected[1::2] = time[starts], time[middles]
    return selected, {name: _extremes(line, starts) for name, line in values.items()}


def _extremes(line: Floats, starts: npt.NDArray[np.intp]) -> Floats:
    finite = np.isfinite(line)
    low = np.minimum.reduceat(np.where(finite, line, np.inf), starts)
    high = np.maximum.reduceat(np.where(finite, line, -np.inf), starts)
    with np.errstate(invalid="ignore"):  # a slice without any value has no middle
        rising = line[starts] <= (low + high) / 2
    pair = np.empty(2 * starts.size)
    pair[0::2], pair[1::2] = np.where(rising, low, high), np.where(rising, high, low)
    pair[~np.isfinite(pair)] = np.nan
    return pair


def _interrupted(
    time: Floats, values: Mapping[str, Floats], breaks: tuple[int, ...]
) -> tuple[Floats, dict[str, Floats]]:
    """Put a sample without value into the middle of each gap."""
    after = np.asarray(breaks, dtype=np.intp)
    holes = (time[after] + time[after + 1]) / 2
    lines = {name: np.insert(line, after + 1, np.nan) for name, line in values.items()}
    return np.insert(time, after + 1, holes), lines


def _float32(line: Floats) -> npt.NDArray[np.float32]:
    with np.errstate(over="ignore"):  # beyond float32 is drawn as missing
        return line.astype(np.float32)


def _base64(array: npt.NDArray[np.float64] | npt.NDArray[np.float32]) -> str:
    kind = "<f4" if array.dtype == np.float32 else "<f8"
    return base64.b64encode(array.astype(kind).tobytes()).decode("ascii")
