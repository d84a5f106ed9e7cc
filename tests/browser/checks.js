// Checks of a report in a browser: what is wrong is written, line by line, into an element that the test reads.
(async () => {
  const wrong = [];
  const note = (text) => { if (wrong.length < 40) wrong.push(text.replace(/\s+/g, " ")); };
  const name = (node) => `${node.tagName.toLowerCase()}.${node.getAttribute("class") || ""} "${node.textContent.trim().slice(0, 40)}"`;
  const visible = (node) => node.getClientRects().length > 0 && node.checkVisibility({ contentVisibilityAuto: true, visibilityProperty: true });
  const frame = (count) => new Promise((done) => { const next = () => (count-- > 0 ? setTimeout(next, 20) : done()); next(); });

  // No overflow of the page; only figures and tables may scroll, and those can be reached by the keyboard.
  const root = document.documentElement;
  if (root.scrollWidth > root.clientWidth) note(`the page is ${root.scrollWidth} wide in a window of ${root.clientWidth}`);
  for (const node of document.querySelectorAll("main *")) {
    const box = node.getBoundingClientRect();
    if (visible(node) && !node.closest(".scroll, svg, .heard") && box.right > root.clientWidth + 1) note(`${name(node)} ends at ${box.right}`);
  }
  for (const node of document.querySelectorAll(".scroll")) {
    if (node.scrollWidth > node.clientWidth + 1 && node.tabIndex < 0) note(`${name(node)} scrolls, and no key reaches it`);
  }

  // Every figure is drawn, says what it shows, and has letters that can be read.
  const figures = [...document.querySelectorAll("figure.drawn")];
  if (figures.length === 0) note("no figures");
  let letters = Infinity;
  for (const figure of figures) {
    const drawings = [...figure.querySelectorAll(".drawings svg:not(svg svg)")].filter(visible);
    if (drawings.length === 0) note(`${figure.dataset.name} shows no drawing`);
    for (const svg of drawings) {
      const box = svg.getBoundingClientRect();
      if (box.width < 100 || box.height < 30) note(`${figure.dataset.name}: a drawing of ${box.width} x ${box.height}`);
      if (!svg.querySelector("path, rect, circle, line")) note(`${figure.dataset.name}: an empty drawing`);
      if ((svg.getAttribute("aria-label") || "").length < 20) note(`${figure.dataset.name}: no description`);
      for (const text of svg.querySelectorAll("text")) {
        if (!text.textContent.trim() || !visible(text)) continue;
        const size = parseFloat(getComputedStyle(text).fontSize) * Math.hypot(text.getScreenCTM().a, text.getScreenCTM().b);
        letters = Math.min(letters, size);
        if (size < 11) note(`${figure.dataset.name}: "${text.textContent}" has letters of ${size.toFixed(2)} px`);
      }
    }
    for (const kind of ["SVG", "PNG", "CSV"]) {
      if (![...figure.querySelectorAll(".tools button")].some((button) => button.textContent === kind)) note(`${figure.dataset.name}: no ${kind}`);
    }
  }

  // Contrast of texts (WCAG 2.2, 1.4.3): 4.5, or 3 for large ones.
  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const colour = (text) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = text;
    canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data];
  };
  const light = (rgb) => rgb.slice(0, 3).map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const contrast = (a, b) => { const [x, y] = [light(a), light(b)].sort((u, v) => v - u); return (x + 0.05) / (y + 0.05); };
  const ground = (node) => {
    for (let at = node; at; at = at.parentElement) {
      const found = colour(getComputedStyle(at).backgroundColor);
      if (found[3] > 250) return found;
    }
    return [255, 255, 255, 255];
  };
  const seen = new Set();
  for (const node of document.querySelectorAll("body *")) {
    const own = [...node.childNodes].some((child) => child.nodeType === 3 && child.textContent.trim());
    if (!own || !visible(node) || node.closest("script, .key.off, [disabled]")) continue;
    const style = getComputedStyle(node);
    const inDrawing = node.namespaceURI.endsWith("svg");
    // Numbers in coloured cells stand on the cell, which comes right before them.
    const cell = inDrawing && /cell-(light|dark)/.test(node.getAttribute("class") || "") ? node.previousElementSibling : null;
    const below = cell ? colour(getComputedStyle(cell).fill) : ground(inDrawing ? node.closest("figure") || node.closest("section") || document.body : node);
    const ink = colour(inDrawing ? style.fill : style.color);
    const key = `${ink} on ${below}`;
    if (seen.has(key)) continue;
    seen.add(key);
    const large = parseFloat(style.fontSize) >= 24 || (parseFloat(style.fontSize) >= 18.6 && Number(style.fontWeight) >= 700);
    const found = contrast(ink, below);
    if (found < (large ? 3 : 4.5)) note(`${name(node)} has a contrast of ${found.toFixed(2)}: ${key}`);
  }

  // Names of what can be used, and single ids.
  for (const node of document.querySelectorAll("button, input, summary, svg[role], [role=group], [role=switch], a[href]")) {
    const label = node.getAttribute("aria-label") || node.textContent.trim() || node.closest("label")?.textContent.trim();
    if (!label) note(`${name(node)} has no name`);
  }
  const ids = [...document.querySelectorAll("[id]")].map((node) => node.id);
  for (const id of ids.filter((id, i) => ids.indexOf(id) !== i)) note(`the id ${id} is there twice`);

  // Exploring: keys read out and zoom; a button makes each kind of file; choosing hides a panel; a region is marked.
  const key = (node, text) => node.dispatchEvent(new KeyboardEvent("keydown", { key: text, bubbles: true, cancelable: true }));
  const box = document.getElementById("read-out");
  const panel = [...document.querySelectorAll("figure.drawn .panel svg.explored")].find((svg) => visible(svg) && svg.querySelector("path[data-name]"));
  if (panel) {
    const figure = panel.closest("figure");
    panel.focus();
    key(panel, "ArrowRight");
    if (box.style.display !== "block" || !/\d/.test(box.textContent)) note("no read-out by the keyboard");
    const labels = () => [...panel.querySelectorAll(".x-ticks text")].map((text) => text.textContent).join(" ");
    const before = labels();
    key(panel, "+");
    if (labels() === before) note(`the ticks stay ${before} after a zoom`);
    key(panel, "0");
    if (labels() !== before) note(`the ticks are ${labels()} after a reset, and were ${before}`);
    panel.blur();
    for (const kind of ["SVG", "PNG", "CSV"]) {
      delete figure.dataset.saved;
      [...figure.querySelectorAll(".tools button")].find((button) => button.textContent === kind).click();
      for (let i = 0; i < 100 && !figure.dataset.saved; i += 1) await frame(1);
      const [saved, size] = (figure.dataset.saved || "").split(" ");
      if (saved !== kind || !(Number(size) > 100)) note(`${figure.dataset.name}: ${kind} gives "${figure.dataset.saved}"`);
    }
    const choice = figure.querySelector(".choice input");
    if (choice) {
      const shown = () => [...figure.querySelectorAll(".panel")].filter(visible).length;
      const all = shown();
      choice.click();
      if (shown() !== all - 1) note("an unchosen panel is still shown");
      choice.click();
      if (shown() !== all) note("a chosen panel is not shown");
    }
  }
  const pairs = document.querySelector('figure.drawn[data-name="pairs"]');
  if (pairs && document.getElementById("draws")) {
    const svg = pairs.querySelector("svg.explored");
    svg.scrollIntoView();
    const area = svg.querySelector("[data-column] .hit").getBoundingClientRect();
    const at = (share, type) => svg.dispatchEvent(new PointerEvent(type, { pointerId: 1, pointerType: "mouse", button: 0, bubbles: true, cancelable: true,
      clientX: area.left + share * area.width, clientY: area.top + share * area.height }));
    svg.setPointerCapture = () => {};
    at(0.02, "pointerdown");
    at(0.5, "pointermove");
    at(0.98, "pointerup");
    for (const figure of ["posterior-draws", "validation"]) {
      const marked = document.querySelectorAll(`figure[data-name="${figure}"] path.brushed`).length;
      if (marked === 0) note(`a region of the pairs marks no response in ${figure}`);
    }
    const residuals = document.querySelector('figure[data-name="residuals"]');
    const shaded = () => residuals ? residuals.querySelectorAll("rect.of-draws").length : 0;
    if (residuals && !shaded()) note("a region of the pairs changes no residual");
    key(svg, "Escape");
    if (document.querySelectorAll(".brushed").length || shaded()) note("Escape leaves marks");
  }
  if (window.axe) {
    const found = await window.axe.run(document, { resultTypes: ["violations"] });
    for (const violation of found.violations) note(`axe ${violation.id}: ${violation.help}; ${violation.nodes.length} x ${violation.nodes[0].html.slice(0, 160)}`);
  }
  const said = document.createElement("pre");
  said.id = "checks";
  said.textContent = JSON.stringify({ wrong, figures: figures.length, letters, width: root.clientWidth, axe: Boolean(window.axe) });
  document.body.append(said);
  parent.postMessage(said.textContent, "*");
})();
