// Tools of the figures, choice of panels, regions of the pairs, legends, light and dark.

// Panels that are not shown, by title; a choice holds for all figures.
const unwanted = new Set();
const figures = [];
const choose = () => {
  for (const { node, panels } of figures) {
    for (const panel of panels) panel.hidden = panels.length > 1 && unwanted.has(titleOf(panel));
    for (const input of node.querySelectorAll(".choice input")) input.checked = !unwanted.has(input.value);
  }
};
const chooser = (titles, name) => {
  const details = document.createElement("details");
  details.className = "choice";
  const summary = document.createElement("summary");
  summary.textContent = "Panels";
  summary.setAttribute("aria-label", `${name}: Panels to show`);
  const set = document.createElement("fieldset");
  set.setAttribute("aria-label", "panels that are shown, in all figures");
  const all = (on) => () => {
    for (const title of titles) on ? unwanted.delete(title) : unwanted.add(title);
    choose();
  };
  set.append(button("All", `${name}: All panels`, all(true)), button("None", `${name}: None of the panels`, all(false)));
  for (const title of titles) {
    const label = document.createElement("label");
    const input = document.createElement("input");
    input.type = "checkbox";
    input.checked = true;
    input.value = title;
    input.addEventListener("change", () => {
      input.checked ? unwanted.delete(title) : unwanted.add(title);
      choose();
    });
    label.append(input, title);
    set.append(label);
  }
  details.append(summary, set);
  return details;
};

// Draws of the posterior with their responses.
const source = document.getElementById("draws");
const draws = source ? JSON.parse(source.textContent).values : null;
const isPairs = (node) => draws && node.dataset.name === "pairs";

const unmark = () => {
  for (const shape of document.querySelectorAll("[data-overlay]")) shape.remove();
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
    for (const path of chosen.map((i) => paths.get(`draw ${i + 1}`)).filter((own) => own)) {
      for (const to of [plot, ...alike]) overlay(to, carried(path, plot, to));
    }
  }
  const some = chosen.length === 1 ? `Draw ${chosen[0] + 1}` : `${chosen.length} of ${draws.length} drawn draws`;
  figure.note.textContent = `${some} chosen; responses at chosen draws are marked in the figures below. Escape clears.`;
  heard.textContent = `${some} chosen`;
};

// Zoom of the panels of a figure; those with the same axes move together.
const zooming = (figure) => {
  figure.zoom = (plot, x, y) => {
    for (const other of figure.single) {
      const same = other === plot || ["x", "y"].every((k) => other.labels[k] === plot.labels[k]
        && other.drawn[k].v0 === plot.drawn[k].v0 && other.drawn[k].v1 === plot.drawn[k].v1);
      if (same) other.show({ ...other.shown.x, v0: x[0], v1: x[1] }, { ...other.shown.y, v0: y[0], v1: y[1] });
    }
    figure.back.disabled = false;
  };
  figure.scale = (plot, factor) => {
    const part = (s) => {
      const [middle, half] = [(s.p0 + s.p1) / 2, (factor * (s.p1 - s.p0)) / 2];
      return [valueAt(s, middle - half), valueAt(s, middle + half)];
    };
    figure.zoom(plot, part(plot.shown.x), part(plot.shown.y));
  };
  figure.reset = () => {
    for (const plot of figure.single) plot.show({ ...plot.drawn.x }, figure.log ? plot.logarithmic : { ...plot.drawn.y });
    figure.back.disabled = true;
  };
  // A rectangle that was chosen: a region of a pair, or what a panel shall show.
  figure.choose = (plot, area) => {
    if (plot.pair && area) {
      markDraws(figure, within(plot, area));
      overlay(plot, element("rect", { class: "brush", x: area.left, y: area.top, width: area.right - area.left, height: area.bottom - area.top }));
    } else if (plot.pair) unmark();
    else if (area) {
      const { x, y } = plot.shown;
      figure.zoom(plot, [valueAt(x, area.left), valueAt(x, area.right)], [valueAt(y, area.bottom), valueAt(y, area.top)]);
    }
  };
};

// A switch between the linear and the logarithmic vertical axis, where no drawn value is negative.
const logarithmic = (figure, number) => {
  const ranges = figure.single.map((plot) => (plot.drawn.y.log ? null : plot.positive()));
  if (!ranges.length || !ranges.every((range) => range)) return null;
  figure.single.forEach((plot, i) => {
    plot.logarithmic = { ...plot.drawn.y, v0: Math.max(ranges[i][0], ranges[i][1] * 1e-12), v1: ranges[i][1], log: true };
  });
  const toggle = button("Log", `${number}: Log, vertical axis`, () => {
    figure.log = !figure.log;
    toggle.setAttribute("aria-pressed", String(figure.log));
    figure.reset();
  });
  toggle.setAttribute("aria-pressed", "false");
  return toggle;
};

// Regions of the pairs: by a drag, or draw by draw with the arrows.
const choosing = (figure, tools) => {
  for (const plot of figure.plots) {
    const cell = plot.group.closest("[data-column]");
    if (cell) plot.pair = { column: Number(cell.dataset.column), row: Number(cell.dataset.row) };
  }
  let at = -1;
  figure.step = (by) => {
    at = (at + by + draws.length) % draws.length;
    markDraws(figure, [at]);
  };
  figure.note = document.createElement("p");
  figure.note.className = "note";
  figure.note.textContent = "Drag over a region of a pair, or walk from draw to draw with the arrows: draws and their responses in the figures below are marked.";
  tools.after(figure.note);
};

const prepare = (node) => {
  const number = node.querySelector("figcaption b").textContent.replace(". ", "");
  const panels = [...node.querySelectorAll(".panel")];
  const figure = { node, panels, log: false, unmark };
  zooming(figure);
  figure.back = button("Reset", `${number}: Reset the zoom`, () => figure.reset());
  figure.back.disabled = true;
  figure.plots = [...node.querySelectorAll(".drawings svg:not(svg svg)")].flatMap((svg) => explore(svg, figure));
  figure.single = figure.plots.filter((plot) => plot.single && plot.along > 0);
  const tools = document.createElement("div");
  tools.className = "tools";
  tools.setAttribute("role", "group");
  tools.setAttribute("aria-label", `${number}: tools`);
  for (const [kind, make] of Object.entries(saves)) {
    tools.append(button(kind, `${number}: save as ${kind}`, async () => {
      const blob = await make(node);
      node.dataset.saved = `${kind} ${blob.size}`;
      save(blob, `${node.dataset.name}.${kind.toLowerCase()}`);
    }));
  }
  if (figure.plots.some((plot) => plot.zooms)) tools.append(figure.back);
  const log = logarithmic(figure, number);
  if (log) tools.append(log);
  const titles = [...new Set(panels.map(titleOf))].filter((title) => title);
  if (titles.length > 1) tools.append(chooser(titles, number));
  node.prepend(tools);
  figures.push(figure);
  if (isPairs(node)) choosing(figure, tools);
};
document.querySelectorAll("figure.drawn").forEach(prepare);

for (const key of document.querySelectorAll(".legend span.key")) {
  const selector = key.dataset.class.trim().split(" ").slice(0, key.dataset.class.startsWith("line ") ? 2 : 1).join(".");
  key.tabIndex = 0;
  key.setAttribute("role", "switch");
  key.setAttribute("aria-checked", "true");
  const toggle = () => {
    const off = key.classList.toggle("off");
    key.setAttribute("aria-checked", String(!off));
    for (const shape of key.closest("figure").querySelectorAll(`.drawings .${selector}`)) {
      shape.style.display = off ? "none" : "";
    }
  };
  key.addEventListener("click", toggle);
  key.addEventListener("keydown", (event) => {
    if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      toggle();
    }
  });
}

const root = document.documentElement;
const isDark = () => root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
const theme = button("", "switch between light and dark", () => {
  root.dataset.theme = isDark() ? "light" : "dark";
  name();
});
const name = () => { theme.textContent = isDark() ? "Light" : "Dark"; };
theme.className = "theme";
theme.removeAttribute("aria-label");
name();
document.querySelector("header").prepend(theme);
