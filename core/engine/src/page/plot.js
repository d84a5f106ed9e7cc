"use strict";
// Axes of a drawing: scales, ticks, and shapes that move to another part of the plane.

// A scale as the drawing states it: two coordinates of the drawing, the values there, and `log`.
const scaleOf = (text) => {
  const [p0, p1, v0, v1] = text.split(" ").map(Number);
  return { p0, p1, v0, v1, log: text.endsWith("log") };
};
const valueAt = (s, place) => {
  const share = (place - s.p0) / (s.p1 - s.p0);
  return s.log ? s.v0 * (s.v1 / s.v0) ** share : s.v0 + share * (s.v1 - s.v0);
};
const FAR = 1e5;
const placeOf = (s, value) => {
  const share = s.log ? Math.log(value / s.v0) / Math.log(s.v1 / s.v0) : (value - s.v0) / (s.v1 - s.v0);
  const place = s.p0 + share * (s.p1 - s.p0);
  if (Number.isNaN(place)) return s.log ? s.p0 : place;
  return Math.max(-FAR, Math.min(FAR, place));
};

const minus = (text) => text.replace("-", "\u2212");
const written = (value, digits = 4) => {
  if (!Number.isFinite(value)) return "\u2013";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e7)) return minus(value.toExponential(digits - 1));
  return minus(String(Number(value.toPrecision(digits))));
};
// A value of a scale, with the digits that a tenth of a unit of the drawing can tell.
const readAt = (s, value) => {
  const step = Math.abs((s.v1 - s.v0) / (s.p1 - s.p0));
  const decimals = Math.ceil(-Math.log10(step));
  if (s.log || !(decimals >= 0 && decimals <= 6)) return written(value, 3);
  return minus(value.toFixed(decimals));
};
// A value with the name and unit of its axis, from a label such as `time [ms]`.
const withUnit = (label, text) => {
  const parts = /^(.*) \[(.*)\]$/.exec(label);
  return parts ? `${parts[1]} ${text} ${parts[2]}` : `${label} ${text}`.trim();
};

const ticksOf = (s, count) => {
  if (!count) return [];
  const [low, high] = [Math.min(s.v0, s.v1), Math.max(s.v0, s.v1)];
  if (s.log) {
    const found = [];
    const [first, last] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
    const stride = Math.max(1, Math.ceil((last - first) / 6));
    const within = last - first <= 2 ? [1, 2, 5] : [1];
    for (let power = first; power <= last; power += stride) {
      for (const digit of within) {
        const value = digit * 10 ** power;
        if (value >= low * 0.999 && value <= high * 1.001) found.push([value, written(value, 2)]);
      }
    }
    if (found.length > 1) return found;
  }
  const raw = (high - low) / Math.max(1, count - 1);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * ([[1.5, 1], [3, 2], [7, 5]].find(([most]) => raw / power < most) || [0, 10])[1];
  if (!(step > 0)) return [];
  const decimals = Math.max(0, -Math.floor(Math.log10(step * 1.0001)));
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i <= high / step + 1e-9 && found.length < 50; i += 1) {
    const value = i * step;
    found.push([value, decimals > 6 || Math.abs(value) >= 1e6 ? written(value) : minus((i === 0 ? 0 : value).toFixed(decimals))]);
  }
  return found;
};

const SVG = "http://www.w3.org/2000/svg";
const element = (name, attributes, text) => {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
};

// Pieces of a path made of M, l and z steps: lists of points in the drawing's coordinates.
const piecesOf = (path) => {
  if (path.pieces) return path.pieces;
  path.pieces = [];
  let at = [0, 0];
  for (const step of path.getAttribute("d").match(/[Mlz][^Mlz]*/g) || []) {
    const last = path.pieces[path.pieces.length - 1];
    if (step[0] === "z") {
      if (last) last.closed = true;
      continue;
    }
    const [dx, dy] = step.match(/-?(?:\d+\.?\d*|\.\d+)/g).map(Number);
    at = step[0] === "M" ? [dx, dy] : [at[0] + dx, at[1] + dy];
    if (step[0] === "M") path.pieces.push([at]);
    else last.push(at);
  }
  return path.pieces;
};

// The plot of a drawing: its scales as drawn, and as they are shown now.
class Plot {
  constructor(group) {
    this.group = group;
    this.svg = group.ownerSVGElement;
    this.drawn = { x: scaleOf(group.dataset.x), y: scaleOf(group.dataset.y) };
    this.shown = { x: { ...this.drawn.x }, y: { ...this.drawn.y } };
    this.labels = { x: group.dataset.xLabel || "", y: group.dataset.yLabel || "" };
    [this.across, this.along] = group.dataset.ticks.split(" ").map(Number);
    this.inside = group.querySelector("svg");
  }

  get curves() {
    return [...this.inside.querySelectorAll("path[data-name]")].filter((path) => path.style.display !== "none");
  }

  // From coordinates as drawn to coordinates as shown.
  x(place) { return placeOf(this.shown.x, valueAt(this.drawn.x, place)); }
  y(place) { return placeOf(this.shown.y, valueAt(this.drawn.y, place)); }

  // The least positive value and the greatest value of the curves, for a logarithmic axis; null if one is negative.
  positive() {
    let [low, high] = [Infinity, 0];
    const note = (place) => {
      const value = valueAt(this.drawn.y, place);
      if (value > 1e-3 * Math.abs(this.drawn.y.v1)) low = Math.min(low, value);
      high = Math.max(high, value);
      return value;
    };
    const slack = -2e-3 * Math.abs(this.drawn.y.v1);
    for (const path of this.inside.querySelectorAll("path.line, path[data-name], rect.bar, rect.s-histogram")) {
      const places = path.tagName === "rect" ? [Number(path.getAttribute("y"))] : piecesOf(path).flat().map((p) => p[1]);
      for (const place of places) if (note(place) < slack) return null;
    }
    return high > low ? [low * 0.8, high * 1.25] : null;
  }

  show(x, y) {
    this.shown = { x, y };
    for (const shape of this.inside.querySelectorAll("path, line, rect, circle, text")) this.move(shape);
    this.ticks();
    for (const second of this.svg.querySelectorAll(".second")) second.style.display = this.zoomed ? "none" : "";
  }

  get zoomed() {
    return ["x", "y"].some((k) => ["v0", "v1", "log"].some((name) => this.shown[k][name] !== this.drawn[k][name]));
  }

  move(shape) {
    shape.was ||= Object.fromEntries(["x", "y", "x1", "y1", "x2", "y2", "cx", "cy", "width", "height"]
      .filter((name) => shape.hasAttribute(name)).map((name) => [name, Number(shape.getAttribute(name))]));
    const was = shape.was;
    const set = (name, value) => shape.setAttribute(name, value.toFixed(1));
    if (shape.tagName === "path") {
      // Marks such as crosses and dots keep their shape; only their centre moves.
      const rigid = /cross|s-pair|s-run|s-invalid/.test(shape.getAttribute("class"));
      const text = piecesOf(shape).map((piece) => {
        const [cx, cy] = [0, 1].map((k) => piece.reduce((sum, p) => sum + p[k], 0) / piece.length);
        const at = ([px, py]) => rigid ? [this.x(cx) + px - cx, this.y(cy) + py - cy] : [this.x(px), this.y(py)];
        return `M${piece.map((p) => at(p).map((v) => v.toFixed(1)).join(" ")).join("L")}${piece.closed ? "z" : ""}`;
      });
      shape.setAttribute("d", text.join(""));
    } else if (shape.tagName === "rect") {
      const [left, right] = [this.x(was.x), this.x(was.x + was.width)];
      const [top, bottom] = [this.y(was.y), this.y(was.y + was.height)];
      set("x", left); set("y", top); set("width", Math.max(0, right - left)); set("height", Math.max(0, bottom - top));
    } else if (shape.tagName === "circle") {
      set("cx", this.x(was.cx)); set("cy", this.y(was.cy));
    } else if (shape.tagName === "text") {
      set("x", this.x(was.x));
    } else {
      for (const name of ["x1", "x2"]) set(name, this.x(was[name]));
      for (const name of ["y1", "y2"]) set(name, this.y(was[name]));
    }
  }

  ticks() {
    const { x, y } = this.shown;
    const [low, high] = [this.svg.querySelector(".x-ticks"), this.svg.querySelector(".y-ticks")];
    if (low && this.across) {
      low.replaceChildren(...ticksOf(x, this.across).flatMap(([value, label]) => {
        const place = placeOf(x, value).toFixed(1);
        return [element("line", { class: "grid", x1: place, x2: place, y1: y.p1, y2: y.p0 }),
          element("text", { class: "tick", x: place, y: y.p0 + 14, "text-anchor": "middle" }, label)];
      }));
    }
    if (high && this.along) {
      high.replaceChildren(...ticksOf(y, this.along).flatMap(([value, label]) => {
        const place = placeOf(y, value);
        return [element("line", { class: "grid", x1: x.p0, x2: x.p1, y1: place.toFixed(1), y2: place.toFixed(1) }),
          element("text", { class: "tick", x: x.p0 - 5, y: (place + 3.6).toFixed(1), "text-anchor": "end" }, label)];
      }));
    }
  }

  // Where the pointer is, in the drawing's coordinates.
  at(event) {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
    return [point.x, point.y];
  }

  holds([x, y]) {
    const { x: across, y: along } = this.drawn;
    return x >= across.p0 && x <= across.p1 && y <= along.p0 && y >= along.p1;
  }
}
