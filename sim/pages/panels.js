/* Panels of a reproduction: lines by Plot, each with its own stretch of x, and maps of classes. */

class Lines extends Plot {
  static make(panel, host) {
    const series = panel.series.map((one) => { const values = (list) => Float64Array.from(list, (v) => v ?? NaN); return { ...one, x: values(one.x), y: values(one.y) }; });
    const all = series.flatMap((one) => Array.from(one.x)).filter(Number.isFinite), whole = { from: Math.min(...all), to: Math.max(...all) };
    const room = panel.equal ? 0 : 0.01 * (whole.to - whole.from);
    const app = {
      view: { from: panel.log_x ? whole.from : whole.from - room, to: whole.to + room }, end: Infinity, t: null, hover: null, drag: null, mode: "overlay", clip: false,
      sources: () => [], events: () => [], horizon: () => null, sane: () => Infinity, limits: () => panel.levels.map((level) => ({ value: level.y, label: level.name })),
      spans: () => panel.spans.map((span) => ({ from: span.x0, to: span.x1, name: span.name })),
      seek() {}, point: () => app.plot.point(), redraw() { app.plot.draw(); app.plot.point(); },
      zoom(from, to) { if (to > from) { app.view = from <= 0 && to === Infinity ? whole : { from, to }; app.redraw(); } },
      scale(factor, about) { const { from, to } = app.view; app.zoom(about - (about - from) * factor, about + (to - about) * factor); },
    };
    app.series = series;
    app.plot = new Lines({ ...panel, name: panel.title, unit: "", lines: [], x: "", x_unit: "", limits: "levels" }, app, host);
    return app;
  }

  lines() {
    return this.app.series.map((one, i) => {
      const source = { t: one.x, name: "", unordered: one.x.some((v, k) => k && v < one.x[k - 1]) };
      return { source, order: 0, x: one.x, y: one.y, line: { key: String(i), label: one.name, colour: one.colour, dash: one.dash === "solid" ? "" : one.dash, width: one.width, marker: one.marker } };
    });
  }

  relabel() {
    super.relabel();
    [...this.legend.children].forEach((item, i) => { item.hidden = !this.labels[i].one.line.label; });
    const names = document.createElement("span"); names.textContent = `${this.panel.y_label} over ${this.panel.x_label}`; names.className = "muted"; this.legend.append(names);
  }
}

class ClassMap {
  constructor(panel, host) {
    this.panel = panel;
    const card = document.createElement("article"), title = document.createElement("h2"), legend = document.createElement("div"), box = document.createElement("div");
    card.className = "card"; box.className = "plot"; legend.className = "legend"; title.textContent = panel.title;
    panel.names.forEach((name, i) => { const item = document.createElement("span"), swatch = document.createElement("i"); swatch.style.borderColor = panel.colours[i]; item.append(swatch, name); legend.append(item); });
    this.value = document.createElement("b"); legend.append(this.value);
    this.canvas = document.createElement("canvas"); this.canvas.setAttribute("role", "img"); this.canvas.setAttribute("aria-label", panel.title);
    box.append(this.canvas); card.append(title, legend, box); host.append(card);
    box.onpointermove = (event) => this.tell(event); box.onpointerleave = () => { this.value.textContent = ""; };
  }

  redraw() {
    const [g, w, h] = sharp(this.canvas), { x, y, classes, colours, x_label, y_label } = this.panel, { left, right, top } = GUTTER, bottom = 32;
    const cw = (w - left - right) / x.length, ch = (h - top - bottom) / y.length;
    this.cell = (px, py) => [Math.floor((px - left) / cw), y.length - 1 - Math.floor((py - top) / ch)];
    classes.forEach((row, i) => row.forEach((one, j) => { g.fillStyle = colours[one]; g.fillRect(left + j * cw, top + (y.length - 1 - i) * ch, cw + 0.5, ch + 0.5); }));
    g.fillStyle = css("muted"); g.font = "11px system-ui, sans-serif"; g.textBaseline = "middle";
    const every = (n, room) => Math.max(1, Math.ceil(n / room));
    g.textAlign = "center"; x.forEach((v, j) => { if (j % every(x.length, w / 60) === 0) g.fillText(number(+v.toPrecision(3)), left + (j + 0.5) * cw, h - 24); });
    g.fillText(`${x_label}; upwards ${y_label}`, w / 2, h - 8);
    g.textAlign = "right"; y.forEach((v, i) => { if (i % every(y.length, h / 24) === 0) g.fillText(number(+v.toPrecision(3)), left - 4, top + (y.length - 0.5 - i) * ch); });
  }

  tell(event) {
    const at = this.canvas.getBoundingClientRect(), [j, i] = this.cell(event.clientX - at.left, event.clientY - at.top), { x, y, names, classes } = this.panel;
    this.value.textContent = i >= 0 && j >= 0 && i < y.length && j < x.length ? `${names[classes[i][j]]} at ${number(x[j])}, ${number(y[i])}` : "";
  }
}

const drawn = [];
for (const figure of document.querySelectorAll("figure[data-panels]")) {
  for (const row of JSON.parse(document.getElementById(figure.dataset.panels).textContent)) {
    const line = document.createElement("div"); line.className = "row"; figure.append(line);
    for (const panel of row) drawn.push(panel.classes ? new ClassMap(panel, line) : Lines.make(panel, line));
  }
}
const paint = () => drawn.forEach((one) => one.redraw());
addEventListener("resize", paint); addEventListener("beforeprint", paint); matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
paint();
window.drawn = drawn;
document.documentElement.dataset.ready = "yes";
