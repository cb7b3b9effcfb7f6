"use strict";
// Figures of curves: switch curves, zoom by dragging, read values. The paths hold the data, in steps of the axes.
(() => {
  const STEPS = 4000;
  const SVG = "http://www.w3.org/2000/svg";
  const numbers = (text) => text.trim().split(/\s+/).map(Number);
  const shown = (value, digits) => value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1").replace("-", "\u2212");

  function decode(path) { // -> [[step across, step up], ...]
    const out = [];
    let x = 0, y = 0;
    for (const [, start, moves] of path.getAttribute("d").matchAll(/M([^lhM]*)(?:l([^M]*)|h0)/g)) {
      [x, y] = numbers(start);
      out.push([x, STEPS - y]);
      const steps = (moves || "").match(/-?\d+/g) || [];
      for (let i = 0; i + 1 < steps.length; i += 2) {
        x += Number(steps[i]);
        y += Number(steps[i + 1]);
        out.push([x, STEPS - y]);
      }
    }
    return out;
  }

  function ticks(low, high, count) { // two at least, for a single one tells no scale
    const rough = (high - low) / count, ten = 10 ** Math.floor(Math.log10(rough));
    const inside = (step) => Math.floor(high / step + 1e-9) - Math.ceil(low / step - 1e-9) + 1;
    const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10].map((k) => k * ten);
    let at = steps.findIndex((step) => step >= 0.999 * rough);
    while (at > 0 && inside(steps[at]) < 2) at -= 1;
    const step = steps[at];
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), out = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
      out.push([k * step, shown(k * step, digits)]);
    }
    return out;
  }

  function element(name, attributes, text) {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text) made.textContent = text;
    return made;
  }

  class Panel {
    constructor(svg) {
      this.svg = svg;
      this.plot = svg.querySelector(".plot");
      this.words = svg.querySelector(".words");
      [this.x, this.y] = [numbers(svg.dataset.x), numbers(svg.dataset.y)];
      this.lines = [...svg.querySelectorAll("path.line")];
      this.drawn = [...svg.querySelectorAll("path.line, path.each, path.band")];
      this.cursor = this.plot.appendChild(element("path", { class: "cursor off" }));
      this.drag = this.plot.appendChild(element("rect", { class: "drag off", y: -9 * STEPS, height: 19 * STEPS }));
      this.view = [0, STEPS];
    }

    data(line) {
      if (!line.points) line.points = decode(line);
      return line.points;
    }

    show(view) { // a part of the steps across; up follows what is seen
      this.view = view;
      let [low, high] = [0, STEPS];
      if (view[1] - view[0] < STEPS) {
        const seen = this.drawn.filter((line) => !line.classList.contains("off"))
          .flatMap((line) => this.data(line).filter(([x]) => x >= view[0] && x <= view[1]).map(([, y]) => y));
        if (seen.length) {
          [low, high] = [seen.reduce((a, b) => Math.min(a, b)), seen.reduce((a, b) => Math.max(a, b))];
          const room = Math.max(0.06 * (high - low), 20);
          [low, high] = [Math.max(low - room, -STEPS), Math.min(high + room, 2 * STEPS)];
        }
      }
      this.up = [low, high];
      this.plot.setAttribute("viewBox", `${view[0]} ${STEPS - high} ${view[1] - view[0]} ${high - low}`);
      this.label();
    }

    label() {
      const value = ([a, b], step) => a + ((b - a) * step) / STEPS;
      const box = ["x", "y", "width", "height"].map((key) => Number(this.plot.getAttribute(key)));
      const [x0, x1] = this.view.map((step) => value(this.x, step));
      const [y0, y1] = this.up.map((step) => value(this.y, step));
      const old = [...this.words.querySelectorAll("text.x")], numbered = old.length > 0;
      for (const one of [...old, ...this.words.querySelectorAll("text[text-anchor=end]")]) one.remove();
      const write = (attributes, text) => this.words.append(element("text", attributes, text));
      for (const [at, text] of ticks(y0, y1, box[3] > 60 ? 3 : 2)) {
        const y = box[1] + box[3] * (1 - (at - y0) / (y1 - y0)) + 3;
        write({ x: box[0] - 4, y, "text-anchor": "end" }, text);
      }
      let grid = "";
      for (const [at, text] of ticks(x0, x1, 6)) {
        const share = (at - x0) / (x1 - x0);
        grid += `M${this.view[0] + share * (this.view[1] - this.view[0])} ${-9 * STEPS}v${19 * STEPS}`;
        const x = box[0] + box[2] * share;
        if (numbered) write({ class: "x", x, y: box[1] + box[3] + 12, "text-anchor": "middle" }, text);
      }
      this.plot.querySelector(".grid").setAttribute("d", grid);
    }

    step(event) { // where the pointer is, in steps across
      const box = this.plot.getBoundingClientRect();
      const share = Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
      return this.view[0] + share * (this.view[1] - this.view[0]);
    }

    point(step) {
      this.cursor.classList.toggle("off", step === null);
      if (step !== null) this.cursor.setAttribute("d", `M${step.toFixed(1)} ${-9 * STEPS}v${19 * STEPS}`);
    }

    read(step) {
      const digits = Math.max(0, Math.min(4, 3 - Math.floor(Math.log10(this.y[1] - this.y[0]) + 0.5)));
      const told = this.lines.filter((line) => !line.classList.contains("off")).map((line) => {
        const points = this.data(line);
        const far = (p) => Math.abs(p[0] - step);
        const near = points.reduce((best, p) => (far(p) < far(best) ? p : best), points[0]);
        if (!near || far(near) > STEPS / 40) return `${line.dataset.name} \u2013`;
        return `${line.dataset.name} ${shown(this.y[0] + ((this.y[1] - this.y[0]) * near[1]) / STEPS, digits)}`;
      });
      return `${this.svg.dataset.title}: ${told.join(", ")}`;
    }
  }

  function drawing(root) { // the figure as it is seen, in one SVG with its own style
    const frame = root.getBoundingClientRect(), size = { width: frame.width, height: frame.height };
    const look = { "font-family": "sans-serif", "font-size": "10.5px" };
    const whole = element("svg", { viewBox: `0 0 ${size.width} ${size.height}`, ...size, ...look });
    const rules = [...document.styleSheets].flatMap((sheet) => [...sheet.cssRules]);
    const own = rules.filter((rule) => /^\.(plot|panel text|panel \.title|swatch path)/.test(rule.selectorText || ""));
    whole.append(element("style", {}, own.map((rule) => rule.cssText).join(" ")));
    for (const one of root.querySelectorAll(".panel, .legend svg")) {
      const box = one.getBoundingClientRect(), made = one.cloneNode(true);
      const place = { x: box.left - frame.left, y: box.top - frame.top, width: box.width, height: box.height };
      for (const [key, value] of Object.entries(place)) made.setAttribute(key, value);
      whole.append(made);
      const word = one.parentElement.dataset.name;
      if (word) whole.append(element("text", { x: place.x + place.width + 5, y: place.y + place.height }, word));
    }
    whole.querySelectorAll(".cursor, .drag").forEach((one) => one.remove());
    return new XMLSerializer().serializeToString(whole);
  }

  function table(panels) { // the curves that are shown, as CSV
    const value = ([a, b], step) => (a + ((b - a) * step) / STEPS).toPrecision(6);
    const row = (panel, line) => ([x, y]) =>
      `"${panel.svg.dataset.title}","${line.dataset.name}",${value(panel.x, x)},${value(panel.y, y)}`;
    const lines = panels.flatMap((panel) => panel.lines.filter((line) => !line.classList.contains("off"))
      .flatMap((line) => panel.data(line).map(row(panel, line))));
    return ["panel,curve,along,value", ...lines, ""].join("\n");
  }

  function save(text, type, name) {
    const link = document.createElement("a");
    [link.href, link.download] = [URL.createObjectURL(new Blob([text], { type })), name.replace(/[^\w.]+/g, "_")];
    link.click();
  }

  function figure(root, k) {
    const panels = [...root.querySelectorAll(".panel")].map((svg) => new Panel(svg));
    const cells = [...root.querySelectorAll(".cell")].map((cell) => panels.filter((p) => cell.contains(p.svg)));
    const reading = root.querySelector(".reading");
    const [low, high] = panels[0].x, trial = root.dataset.trial || "";
    let at = null;
    root.classList.add("live");
    if (k === 0) reading.textContent = "Point to read values; drag to zoom; double click to see all.";

    const zoom = document.createElement("span");
    zoom.className = "zoom";
    const show = (view) => panels.forEach((panel) => panel.show(view));
    const button = (text, about, work) => {
      const made = document.createElement("button");
      [made.type, made.textContent] = ["button", text];
      made.setAttribute("aria-label", about);
      made.addEventListener("click", work);
      zoom.append(made, " ");
    };
    const narrow = (factor) => {
      const [a, b] = panels[0].view, middle = at === null || at < a || at > b ? (a + b) / 2 : at;
      const half = Math.min(STEPS, Math.max(40, (b - a) * factor)) / 2;
      const start = Math.min(STEPS - 2 * half, Math.max(0, middle - half));
      show([start, start + 2 * half]);
    };
    if (root.dataset.view) show(numbers(root.dataset.view));
    button("+", "zoom in", () => narrow(0.5));
    button("\u2212", "zoom out", () => narrow(2));
    button("all", "show all", () => show([0, STEPS]));
    const called = `${document.title} ${root.getAttribute("aria-label")}`;
    button("SVG", "save the figure as SVG", () => save(drawing(root), "image/svg+xml", `${called}.svg`));
    button("CSV", "save its values as CSV", () => save(table(panels), "text/csv", `${called}.csv`));
    root.querySelector(".legend").append(zoom);

    const point = (step, cell, told) => {
      at = step;
      panels.forEach((panel) => panel.point(step));
      if (step === null) return;
      const time = low + ((high - low) * step) / STEPS;
      const value = shown(time, high - low < 5 ? 3 : 2);
      reading.textContent = [value, ...(cell || cells[0]).map((panel) => panel.read(step))].join("  \u00b7  ");
      if (told) document.dispatchEvent(new CustomEvent("biodance:time", { detail: { trial, time, from: root } }));
    };
    if (trial) document.addEventListener("biodance:time", ({ detail }) => {
      if (detail.trial !== trial || detail.from === root || root.offsetParent === null) return;
      point(Math.min(STEPS, Math.max(0, (STEPS * (detail.time - low)) / (high - low))), null, false);
    });

    for (const cell of cells) for (const panel of cell) {
      let start = null;
      const plot = panel.svg;
      plot.setAttribute("tabindex", "0");
      plot.addEventListener("pointerdown", (event) => {
        if (event.button === 0 && event.pointerType === "mouse") start = panel.step(event);
      });
      plot.addEventListener("pointermove", (event) => {
        const step = panel.step(event);
        point(step, cell, true);
        if (start === null) return;
        panel.drag.classList.remove("off");
        panel.drag.setAttribute("x", Math.min(start, step));
        panel.drag.setAttribute("width", Math.abs(step - start));
      });
      addEventListener("pointerup", (event) => {
        if (start === null) return;
        const ends = [start, panel.step(event)].sort((a, b) => a - b);
        panel.drag.classList.add("off");
        start = null;
        if (ends[1] - ends[0] > 0.02 * (panel.view[1] - panel.view[0])) show(ends);
      });
      plot.addEventListener("dblclick", () => show([0, STEPS]));
      plot.addEventListener("keydown", (event) => {
        const move = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
        const size = { "+": 0.5, "-": 2, "0": 1e9 }[event.key];
        if (!move && !size) return;
        event.preventDefault();
        const [a, b] = panel.view;
        const from = at === null ? (a + b) / 2 : at;
        if (move) point(Math.min(b, Math.max(a, from + (move * (b - a)) / 100)), cell, true);
        else narrow(size);
      });
    }

    for (const switched of root.querySelectorAll(".legend button[data-name]")) {
      switched.addEventListener("click", () => {
        const on = switched.getAttribute("aria-pressed") !== "true";
        switched.setAttribute("aria-pressed", String(on));
        for (const mark of root.querySelectorAll(".plot [data-name]")) {
          if (mark.dataset.name === switched.dataset.name) mark.classList.toggle("off", !on);
        }
        show(panels[0].view);
      });
    }
  }

  document.querySelectorAll(".curves").forEach((root, k) => {
    if (root.querySelector(".legend")) figure(root, k); // else points by trial: nothing to zoom or to switch off
  });
})();
