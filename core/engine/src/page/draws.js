// Regions of the pairs: draws of the posterior, their responses and their residuals.

// Draws of the posterior with their responses.
const source = document.getElementById("draws");
const { values: draws, residuals } = source ? JSON.parse(source.textContent) : { values: null };
const isPairs = (node) => draws && node.dataset.name === "pairs";

// Cells of the map of residuals, which show those of the chosen draws for a while.
const cells = () => document.querySelectorAll('figure[data-name="residuals"] [data-strip] rect');
const unmark = () => {
  for (const shape of document.querySelectorAll("[data-overlay]")) shape.remove();
  for (const cell of cells()) {
    if (!cell.own) continue;
    cell.setAttribute("class", cell.own.shade);
    cell.hint = cell.own.hint;
    delete cell.own;
  }
};
const overlay = (plot, shape) => {
  shape.dataset.overlay = "";
  plot.inside.append(shape);
};
// The draws in a rectangle of a pair.
const within = (plot, area) => {
  const { x, y } = plot.drawn;
  const [low, high] = [[valueAt(x, area.left), valueAt(y, area.bottom)], [valueAt(x, area.right), valueAt(y, area.top)]];
  return draws.map((_, i) => i).filter((i) => {
    const [u, v] = [draws[i][plot.pair.column], draws[i][plot.pair.row]];
    return u >= low[0] && u <= high[0] && v >= low[1] && v <= high[1];
  });
};
// The same curve in another plot, whose axes show the same quantities in other ranges.
const carried = (path, from, to) => {
  const at = ([x, y]) => [placeOf(to.shown.x, valueAt(from.drawn.x, x)), placeOf(to.shown.y, valueAt(from.drawn.y, y))];
  const pieces = piecesOf(path).map((piece) => `M${piece.map((p) => at(p).map((v) => v.toFixed(1)).join(" ")).join("L")}`);
  const marked = element("path", { class: "brushed", d: pieces.join("") });
  marked.pieces = piecesOf(path).map((piece) => piece.map(([x, y]) => [placeOf(to.drawn.x, valueAt(from.drawn.x, x)), placeOf(to.drawn.y, valueAt(from.drawn.y, y))]));
  return marked;
};
// The value of a curve at a place, both in the units of the axes; between points on a straight line.
const curveAt = (plot, path, x) => {
  const place = placeOf(plot.drawn.x, x);
  for (const piece of piecesOf(path)) {
    for (let i = 0; i < piece.length; i += 1) {
      const [[x0, y0], [x1, y1]] = [piece[Math.max(0, i - 1)], piece[i]];
      if (Math.abs(x1 - place) < 0.06) return valueAt(plot.drawn.y, y1);
      if (x0 < place && place < x1) return valueAt(plot.drawn.y, y0 + ((y1 - y0) * (place - x0)) / (x1 - x0));
    }
  }
  return NaN;
};
const shadeOf = (value) => {
  const step = Math.min(5, Math.round(Math.abs(value) / 1.2));
  return step ? `c-${value < 0 ? "minus" : "plus"}-${step}` : "c-0";
};
// Shows the residuals of the chosen draws, averaged, in the map of residuals.
const markResiduals = (plot, paths) => {
  const known = (residuals[titleOf(plot.svg)] || []).map(([x, mean, sd]) => {
    const differences = paths.map((path) => (mean - curveAt(plot, path, x)) / sd);
    return [x, differences.reduce((sum, d) => sum + d, 0) / paths.length];
  }).filter(([, value]) => Number.isFinite(value));
  for (const strip of document.querySelectorAll('figure[data-name="residuals"] [data-strip]')) {
    if (strip.dataset.strip !== titleOf(plot.svg)) continue;
    const [low, high] = strip.dataset.ends.split(" ").map(Number);
    const last = Number(strip.dataset.cells) - 1;
    const left = Number(strip.dataset.left);
    const width = Number(strip.dataset.width);
    for (const cell of strip.querySelectorAll("rect")) {
      const number = Math.round((Number(cell.getAttribute("x")) - left) / width);
      const own = known.filter(([x]) => Math.round(((x - low) / (high - low || 1)) * last) === number).map(([, value]) => value);
      if (!own.length) continue;
      const value = own.reduce((a, b) => (Math.abs(b) > Math.abs(a) ? b : a));
      cell.own = { shade: cell.getAttribute("class"), hint: cell.hint };
      cell.setAttribute("class", `strip of-draws ${shadeOf(value)}`);
      cell.hint = (cell.own.hint || "").replace(/[^ ]*$/, `${minus(value.toFixed(1))} at the chosen draws`);
    }
  }
};
// Marks draws in all pairs, and their responses in all figures that have them.
const markDraws = (figure, chosen) => {
  unmark();
  for (const plot of figure.plots.filter((own) => own.pair)) {
    const { x, y } = plot.drawn;
    const dot = (i) => `M${placeOf(x, draws[i][plot.pair.column]).toFixed(1)} ${placeOf(y, draws[i][plot.pair.row]).toFixed(1)}l.1 0`;
    if (chosen.length) overlay(plot, element("path", { class: "brushed-point", d: chosen.map(dot).join("") }));
  }
  for (const plot of figures.flatMap(({ plots }) => plots)) {
    const paths = new Map([...plot.inside.querySelectorAll("path.s-draw")].map((path) => [path.dataset.name, path]));
    if (!paths.size) continue;
    // The panels of the calibrated simulation with the same title show the same quantity.
    const alike = figures.filter(({ node }) => node.dataset.name === "validation").flatMap(({ plots }) => plots)
      .filter((other) => titleOf(other.svg) === titleOf(plot.svg) && other.labels.y === plot.labels.y);
    const marked = chosen.map((i) => paths.get(`draw ${i + 1}`)).filter((own) => own);
    for (const path of marked) {
      for (const to of [plot, ...alike]) overlay(to, carried(path, plot, to));
    }
    if (marked.length) markResiduals(plot, marked);
  }
  const some = chosen.length === 1 ? `Draw ${chosen[0] + 1}` : `${chosen.length} of ${draws.length} drawn draws`;
  figure.note.textContent = `${some} chosen; their responses are marked in the figures below, and the map of residuals shows their mean residuals. Escape clears.`;
  heard.textContent = `${some} chosen`;
};
