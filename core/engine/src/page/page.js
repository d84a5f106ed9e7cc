"use strict";
// Read-outs and switches for the figures. The page says everything without them.
(() => {
  const box = document.createElement("div");
  box.id = "read-out";
  document.body.append(box);
  document.body.classList.add("interactive");

  const numbers = (text) => text.split(" ").map(Number);
  const value = (place, [p0, p1, v0, v1]) => v0 + ((place - p0) / (p1 - p0)) * (v1 - v0);
  const write = (v) => String(Number(v.toPrecision(5)));

  // The points of a path made of M and l steps, in the drawing's coordinates.
  const points = (path) => {
    if (path.points) return path.points;
    path.points = [];
    let at = [0, 0];
    for (const step of path.getAttribute("d").match(/[Ml][^Mlz]*/g) || []) {
      const [dx, dy] = step.match(/-?(?:\d+\.?\d*|\.\d+)/g).map(Number);
      at = step[0] === "M" ? [dx, dy] : [at[0] + dx, at[1] + dy];
      path.points.push(at);
    }
    return path.points;
  };

  const nearest = (path, x) => {
    let best = null;
    for (const p of points(path)) {
      if (!best || Math.abs(p[0] - x) < Math.abs(best[0] - x)) best = p;
    }
    return best;
  };

  for (const plot of document.querySelectorAll(".plot")) {
    const [across, along] = [numbers(plot.dataset.x), numbers(plot.dataset.y)];
    const hair = document.createElementNS("http://www.w3.org/2000/svg", "line");
    hair.setAttribute("class", "cross-hair");
    plot.addEventListener("mousemove", (event) => {
      const svg = plot.ownerSVGElement;
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      hair.setAttribute("x1", at.x);
      hair.setAttribute("x2", at.x);
      hair.setAttribute("y1", along[0]);
      hair.setAttribute("y2", along[1]);
      plot.append(hair);
      const lines = [`${plot.dataset.xLabel}: ${write(value(at.x, across))}`];
      lines.push(`${plot.dataset.yLabel}: ${write(value(at.y, along))}`);
      for (const path of plot.querySelectorAll("path[data-name]")) {
        const point = path.style.display === "none" ? null : nearest(path, at.x);
        if (point && Math.abs(point[0] - at.x) < 8) {
          lines.push(`  ${path.dataset.name}: ${write(value(point[1], along))}`);
        }
      }
      box.textContent = lines.join("\n");
      box.style.display = "block";
      const left = event.clientX + 16;
      const room = window.innerWidth - box.offsetWidth - 8;
      box.style.left = `${left > room ? event.clientX - box.offsetWidth - 12 : left}px`;
      box.style.top = `${Math.min(event.clientY + 14, window.innerHeight - box.offsetHeight - 8)}px`;
    });
    plot.addEventListener("mouseleave", () => {
      hair.remove();
      box.style.display = "none";
    });
  }

  for (const key of document.querySelectorAll(".key")) {
    const selector = key.dataset.class.trim().split(" ")[0];
    key.tabIndex = 0;
    key.setAttribute("role", "switch");
    key.setAttribute("aria-checked", "true");
    const toggle = () => {
      const off = key.classList.toggle("off");
      key.setAttribute("aria-checked", String(!off));
      for (const shape of key.closest("figure").querySelectorAll(`.scroll .${selector}`)) {
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
})();
