// Tools of the figures, choice of panels, zoom, legends, light and dark.

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
  figure.note.textContent = "Drag over a region of a pair, or walk from draw to draw with the arrows: draws and their responses in the figures below are marked, and the map of residuals shows theirs.";
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
