// Read-outs, zoom and regions of one drawing, by pointer and keyboard.

const box = document.createElement("div");
box.id = "read-out";
const heard = document.createElement("div");
heard.className = "heard";
heard.setAttribute("role", "status");
document.body.append(box, heard);
document.body.classList.add("interactive");

const button = (text, label, act) => {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = text;
  made.setAttribute("aria-label", label);
  made.addEventListener("click", act);
  return made;
};

// The read-out beside a point of the screen, or beside an element for the keyboard.
const say = (text, x, y, aloud) => {
  box.textContent = text;
  box.style.display = "block";
  const room = window.innerWidth - box.offsetWidth - 8;
  box.style.left = `${Math.max(4, x + 16 > room ? Math.min(room, x - box.offsetWidth - 12) : x + 16)}px`;
  box.style.top = `${Math.max(4, Math.min(y + 14, window.innerHeight - box.offsetHeight - 8))}px`;
  if (aloud) heard.textContent = text;
};
const hush = () => { box.style.display = "none"; };

// The curves of a plot at a place, the nearest to the pointer first.
const near = (plot, [x, y]) => {
  const found = [];
  for (const path of plot.curves) {
    let best = null;
    const dots = /s-pair|s-run/.test(path.getAttribute("class"));
    for (const piece of piecesOf(path)) {
      for (const point of dots ? piece.slice(0, 1) : piece) {
        const shown = [plot.x(point[0]), plot.y(point[1])];
        const distance = dots ? Math.hypot(shown[0] - x, shown[1] - y) : Math.abs(shown[0] - x);
        if (!best || distance < best.distance) best = { distance, point, shown, path };
      }
    }
    if (best && best.distance < (dots ? 8 : 14)) found.push(best);
  }
  const off = (spot) => Math.hypot(spot.shown[0] - x, spot.shown[1] - y);
  return found.sort((a, b) => off(a) - off(b));
};
const told = (plot, spot) => {
  const [x, y] = [valueAt(plot.drawn.x, spot.point[0]), valueAt(plot.drawn.y, spot.point[1])];
  return { name: spot.path.dataset.name, x: withUnit(plot.labels.x, readAt(plot.drawn.x, x)), y: withUnit(plot.labels.y, readAt(plot.drawn.y, y)) };
};
const titleOf = (svg) => svg.querySelector(".panel-title")?.textContent || "";
const readOut = (plot, spots, place) => {
  const title = plot.single ? titleOf(plot.svg) : "";
  if (!spots.length) {
    const [x, y] = ["x", "y"].map((k, i) => readAt(plot.drawn[k], valueAt(plot.shown[k], place[i])));
    return [title, withUnit(plot.labels.x, x), withUnit(plot.labels.y, y)].filter((line) => line).join("\n");
  }
  const [first, ...others] = spots.slice(0, 6).map((spot) => told(plot, spot));
  const more = others.map((spot) => `  ${spot.name}: ${spot.y}`);
  return [[title, first.x].filter((part) => part).join(", "), `${first.name}: ${first.y}`, ...more].join("\n");
};

// Marks of a drawing: a line and a dot at what is read out.
const marksOf = () => {
  const hair = element("line", { class: "cross-hair" });
  const spot = element("circle", { class: "spot", r: 3.5 });
  const hide = () => { hair.remove(); spot.remove(); };
  const show = (plot, [x, y]) => {
    for (const [name, value] of Object.entries({ x1: x, x2: x, y1: plot.drawn.y.p0, y2: plot.drawn.y.p1 })) hair.setAttribute(name, value);
    spot.setAttribute("cx", x);
    spot.setAttribute("cy", y);
    plot.group.append(hair, spot);
  };
  return { hide, show, clear: () => { hide(); hush(); } };
};

// Hints of shapes, which the script shows itself, so that keys reach them too.
const hintsOf = (svg) => [...svg.querySelectorAll("rect > title, circle > title, path > title")].map((title) => {
  const hint = { shape: title.parentNode, text: title.textContent };
  hint.shape.hint = hint.text;
  title.remove();
  return hint;
});

// The pointer reads out what is near; a drag chooses a rectangle, which `figure.choose` takes.
const byPointer = (svg, plots, marks, figure) => {
  const frame = element("rect", { class: "brush" });
  const plotAt = (event) => plots.find((plot) => plot.holds(plot.at(event)));
  let start = null;
  const dragged = (event) => {
    const { plot, at: [x0, y0] } = start;
    const [x1, y1] = plot.at(event);
    const { x, y } = plot.drawn;
    const keep = (v, a, b) => Math.max(Math.min(a, b), Math.min(Math.max(a, b), v));
    const [left, right] = [x0, x1].map((v) => keep(v, x.p0, x.p1)).sort((a, b) => a - b);
    const [top, bottom] = [y0, y1].map((v) => keep(v, y.p0, y.p1)).sort((a, b) => a - b);
    return { left, right, top, bottom };
  };
  const look = (event) => {
    marks.hide();
    const plot = plotAt(event);
    if (event.target.hint) say(event.target.hint, event.clientX, event.clientY);
    else if (!plot) hush();
    else {
      const place = plot.at(event);
      const spots = near(plot, place);
      if (spots.length) marks.show(plot, spots[0].shown);
      say(readOut(plot, spots, place), event.clientX, event.clientY);
    }
  };
  svg.addEventListener("pointerdown", (event) => {
    // A finger reads out where it taps; it drags the page, not a rectangle.
    if (event.pointerType === "touch") {
      look(event);
      return;
    }
    const plot = plotAt(event);
    if (!plot || event.button !== 0 || !(plot.zooms || plot.pair)) return;
    start = { plot, at: plot.at(event) };
    svg.setPointerCapture(event.pointerId);
    event.preventDefault();
    svg.focus({ preventScroll: true });
  });
  svg.addEventListener("pointermove", (event) => {
    if (start) {
      const { left, right, top, bottom } = dragged(event);
      for (const [name, value] of Object.entries({ x: left, y: top, width: right - left, height: bottom - top })) frame.setAttribute(name, value);
      start.plot.group.append(frame);
      return;
    }
    look(event);
  });
  svg.addEventListener("pointerup", (event) => {
    if (!start) return;
    const { plot } = start;
    const area = dragged(event);
    start = null;
    frame.remove();
    figure.choose(plot, area.right - area.left > 5 && area.bottom - area.top > 5 ? area : null);
  });
  svg.addEventListener("pointercancel", () => { start = null; frame.remove(); });
  svg.addEventListener("pointerleave", (event) => { if (!start && event.pointerType !== "touch") marks.clear(); });
  svg.addEventListener("dblclick", () => figure.reset());
};

// Arrows walk along a curve and from curve to curve, from mark to mark, or from draw to draw; + and - zoom; 0 and Escape reset.
const byKeyboard = (svg, plots, hints, marks, figure) => {
  let [curve, step, mark] = [0, -1, -1];
  const walk = (by, aside, far) => {
    const plot = plots[0];
    const { curves } = plot;
    if (!curves.length) return;
    if (!aside) curve += by;
    curve = (curve + curves.length) % curves.length;
    const points = piecesOf(curves[curve]).flat();
    step = Math.max(0, Math.min(points.length - 1, aside ? step + by * (far ? 10 : 1) : step));
    const spot = { point: points[step], shown: [plot.x(points[step][0]), plot.y(points[step][1])], path: curves[curve] };
    marks.show(plot, spot.shown);
    const at = new DOMPoint(...spot.shown).matrixTransform(svg.getScreenCTM());
    say(readOut(plot, [spot], spot.shown), at.x, at.y, true);
  };
  svg.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowLeft: -1, ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (event.key === "Escape") {
      marks.clear();
      figure.unmark();
    } else if (event.key === "0") figure.reset();
    else if (event.key === "+" && plots[0]?.zooms) figure.scale(plots[0], 0.5);
    else if (event.key === "-" && plots[0]?.zooms) figure.scale(plots[0], 2);
    else if (by && plots[0]?.pair) figure.step(by);
    else if (by && hints.length) {
      mark = (mark + by + hints.length) % hints.length;
      const at = hints[mark].shape.getBoundingClientRect();
      say(hints[mark].text, at.right, at.top, true);
    } else if (by && plots.length) walk(by, event.key === "ArrowLeft" || event.key === "ArrowRight", event.shiftKey);
    else return;
    event.preventDefault();
  });
  svg.addEventListener("blur", marks.clear);
};

// Makes a drawing explorable; returns its plots.
const explore = (svg, figure) => {
  const plots = [...svg.querySelectorAll(".plot")].map((group) => new Plot(group));
  for (const plot of plots) {
    plot.single = plots.length === 1;
    plot.zooms = plot.single && plot.along > 0 && !svg.querySelector(".bar");
  }
  const hints = hintsOf(svg);
  if (!plots.length && !hints.length) return plots;
  svg.classList.add("explored");
  svg.tabIndex = 0;
  svg.setAttribute("role", "application");
  svg.setAttribute("aria-roledescription", "figure");
  const marks = marksOf();
  byPointer(svg, plots, marks, figure);
  byKeyboard(svg, plots, hints, marks, figure);
  return plots;
};
