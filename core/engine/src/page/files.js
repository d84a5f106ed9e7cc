// A figure as a file: SVG, PNG or CSV.

// Style of drawings without variables, for files.
const styleText = () => {
  const dark = document.documentElement.dataset.theme
    ? document.documentElement.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  const whole = document.querySelector("style").textContent;
  let text = whole.slice(whole.indexOf("svg text {"));
  for (const [, name, light, night] of whole.matchAll(/(--[a-z0-9-]+): light-dark\(([^,]+), ([^)]+)\)/g)) {
    text = text.replaceAll(`var(${name})`, dark ? night : light);
  }
  return text.replaceAll("var(--sans)", "Helvetica, Arial, sans-serif");
};

// The figure as it is shown now, as one SVG: legend above, drawings in rows below.
const composed = (figure) => {
  const width = 1044;
  const parts = [];
  let [x, y, row] = [0, 0, 0];
  for (const key of figure.querySelectorAll("span.key:not(.off)")) {
    const long = 44 + 6.8 * key.textContent.length;
    if (x > 0 && x + long > width) [x, y] = [0, y + 20];
    const group = element("g", { transform: `translate(${x} ${y})` });
    group.append(key.querySelector("svg").firstElementChild.cloneNode(true), element("text", { x: 36, y: 12 }, key.textContent));
    parts.push(group);
    x += long + 16;
  }
  if (x > 0) [x, y] = [0, y + 28];
  for (const svg of figure.querySelectorAll(".drawings svg[viewBox][width]:not(svg svg)")) {
    if (!svg.getClientRects().length) continue;
    const [, , own, high] = svg.getAttribute("viewBox").split(" ").map(Number);
    if (x > 0 && x + own > width) [x, y, row] = [0, y + row + 12, 0];
    const copy = svg.cloneNode(true);
    for (const name of ["role", "tabindex", "class", "aria-roledescription"]) copy.removeAttribute(name);
    for (const part of copy.querySelectorAll(".cross-hair, .spot")) part.remove();
    copy.setAttribute("x", x);
    copy.setAttribute("y", y);
    parts.push(copy);
    row = Math.max(row, high);
    x += own + 12;
  }
  const [w, h] = [width + 20, y + row + 20];
  const all = element("svg", { viewBox: `-10 -10 ${w} ${h}`, width: w, height: h });
  all.append(element("title", {}, figure.querySelector("figcaption").textContent), element("style", {}, styleText()),
    element("rect", { class: "paper", x: -10, y: -10, width: w, height: h }), ...parts);
  return { text: new XMLSerializer().serializeToString(all), w, h };
};

const save = (blob, name) => {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
};
const unpacked = (text) => {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw")));
};
const picture = ({ text, w, h }) => new Promise((resolve, reject) => {
  const image = new Image();
  image.onload = () => {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [2 * w, 2 * h];
    canvas.getContext("2d").drawImage(image, 0, 0, 2 * w, 2 * h);
    canvas.toBlob(resolve, "image/png");
  };
  image.onerror = () => reject(new Error("the figure cannot be drawn as a picture"));
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`;
});
const saves = {
  SVG: async (figure) => new Blob([composed(figure).text], { type: "image/svg+xml" }),
  PNG: async (figure) => picture(composed(figure)),
  CSV: async (figure) => new Blob([await unpacked(figure.querySelector(".values").textContent).arrayBuffer()], { type: "text/csv" }),
};

