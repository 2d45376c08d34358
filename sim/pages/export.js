/* Plots as SVG, PNG and CSV, tables as CSV. */

/* The name of SVG, from the browser: no address stands in the page. */
const SVG = document.createRange().createContextualFragment("<svg></svg>").firstChild.namespaceURI;

/* What a plot draws on a canvas, kept as SVG: the part of CanvasRenderingContext2D that plots use. */
class Paper {
  constructor(width, height) {
    Object.assign(this, { width, height, out: [], stack: [], d: "", dash: [], globalAlpha: 1, lineWidth: 1, lineCap: "butt", lineJoin: "miter", font: "11px sans-serif", textAlign: "left", textBaseline: "alphabetic", fillStyle: "#000", strokeStyle: "#000", open: 0 });
  }

  static escape(text) { return String(text).replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]); }
  static n(v) { return +v.toFixed(2); }
  add(tag, attributes, text) {
    const words = Object.entries(attributes).filter(([, v]) => v != null && v !== "").map(([k, v]) => `${k}="${Paper.escape(v)}"`).join(" ");
    this.out.push(text == null ? `<${tag} ${words}/>` : `<${tag} ${words}>${Paper.escape(text)}</${tag}>`);
  }
  get alpha() { return this.globalAlpha < 1 ? this.globalAlpha : null; }
  beginPath() { this.d = ""; }
  moveTo(x, y) { this.d += `M${Paper.n(x)} ${Paper.n(y)}`; }
  lineTo(x, y) { this.d += `L${Paper.n(x)} ${Paper.n(y)}`; }
  rect(x, y, w, h) { this.d += `M${Paper.n(x)} ${Paper.n(y)}h${Paper.n(w)}v${Paper.n(h)}h${Paper.n(-w)}z`; }
  arc(x, y, r) { this.d += `M${Paper.n(x - r)} ${Paper.n(y)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`; }
  stroke() { if (this.d) this.add("path", { d: this.d, fill: "none", stroke: this.strokeStyle, "stroke-width": this.lineWidth, "stroke-dasharray": this.dash.join(" "), "stroke-linecap": this.lineCap, "stroke-linejoin": this.lineJoin, opacity: this.alpha }); }
  fill() { if (this.d) this.add("path", { d: this.d, fill: this.fillStyle, opacity: this.alpha }); }
  fillRect(x, y, width, height) { this.add("rect", { x: Paper.n(x), y: Paper.n(y), width: Paper.n(width), height: Paper.n(height), fill: this.fillStyle, opacity: this.alpha }); }
  fillText(text, x, y) {
    const [, bold, size] = /(bold )?(\d+)px/.exec(this.font), shift = { middle: 0.35, top: 0.8, bottom: -0.2 }[this.textBaseline] || 0;
    this.add("text", { x: Paper.n(x), y: Paper.n(y + shift * size), fill: this.fillStyle, "font-size": size, "font-weight": bold ? "bold" : null, "text-anchor": { center: "middle", right: "end" }[this.textAlign] }, text);
  }
  measureText(text) { return { width: 6 * text.length }; }
  setLineDash(dash) { this.dash = dash; }
  save() { const { dash, globalAlpha, lineWidth, lineCap, lineJoin, font, textAlign, textBaseline, fillStyle, strokeStyle } = this; this.stack.push([{ dash, globalAlpha, lineWidth, lineCap, lineJoin, font, textAlign, textBaseline, fillStyle, strokeStyle }, this.open]); this.open = 0; }
  restore() { const [state, open] = this.stack.pop(); this.out.push("</g>".repeat(this.open)); Object.assign(this, state, { open }); }
  clip() { const id = `c${Paper.count = (Paper.count || 0) + 1}`; this.out.push(`<clipPath id="${id}"><path d="${this.d}"/></clipPath><g clip-path="url${`(#${id})`}">`); this.open += 1; }
  translate(x, y) { this.out.push(`<g transform="translate(${Paper.n(x)} ${Paper.n(y)})">`); this.open += 1; }
  text(title) { return `<svg xmlns="${SVG}" viewBox="0 0 ${this.width} ${this.height}" width="${this.width}" height="${this.height}" font-family="system-ui, sans-serif" role="img"><title>${Paper.escape(title)}</title>${this.out.join("")}</svg>`; }
}

const HEAD = 40;

/* A plot with its title and the names of its lines on anything that draws. */
function compose(plot, g, width, height) {
  g.fillStyle = css("card"); g.fillRect(0, 0, width, height + HEAD);
  g.fillStyle = css("ink"); g.font = "bold 13px system-ui, sans-serif"; g.textAlign = "left"; g.textBaseline = "top";
  g.fillText(plot.panel.title + (plot.panel.unit ? ` [${plot.panel.unit}]` : ""), 6, 4);
  g.font = "11px system-ui, sans-serif";
  let x = 6;
  for (const { one, id } of plot.labels || []) {
    if (plot.hidden.has(id)) continue;
    const name = one.line.label + (plot.app.sources().length > 1 ? " " + one.source.name : "");
    g.strokeStyle = css(one.line.colour); g.lineWidth = 3; g.setLineDash(one.order ? [4, 3] : []); g.beginPath(); g.moveTo(x, 30); g.lineTo(x + 14, 30); g.stroke(); g.setLineDash([]);
    g.fillStyle = css("ink"); g.fillText(name, x + 19, 24); x += 34 + g.measureText(name).width;
  }
  g.save(); g.translate(0, HEAD); plot.paint(g, width, height); g.restore();
}

function svgOf(plot) {
  const width = plot.base.clientWidth || 430, height = plot.base.clientHeight || 172, paper = new Paper(width, height + HEAD);
  compose(plot, paper, width, height);
  return paper.text(plot.panel.title);
}

function pngOf(plot) {
  const width = plot.base.clientWidth, height = plot.base.clientHeight, canvas = document.createElement("canvas");
  canvas.width = 2 * width; canvas.height = 2 * (height + HEAD);
  const g = canvas.getContext("2d"); g.scale(2, 2); compose(plot, g, width, height);
  return new Promise((done) => canvas.toBlob(done, "image/png"));
}

const cell = (text) => (/[",\n]/.test(text) ? `"${String(text).replaceAll('"', '""')}"` : String(text));
const lines = (rows) => rows.map((row) => row.map(cell).join(",")).join("\r\n") + "\r\n";

const after = (times, t) => { const i = before(times, t); return times[i] < t ? i + 1 : i; };

/* Every tick in view of every line that is shown; each run has a time of its own. */
function csvOf(plot) {
  const { from, to } = plot.app.view, many = plot.app.sources().length > 1, columns = [];
  for (const source of plot.app.sources()) {
    const its = plot.shown().filter((one) => one.source === source), a = after(source.t, from - 1e-6), b = before(source.t, to + 1e-6), name = many ? " " + source.name : "";
    if (!its.length) continue;
    const add = (head, values) => columns.push([head, ...Array.from(values.slice(a, b + 1), (v) => (Number.isFinite(v) ? String(v) : ""))]);
    add(`t${name} [s]`, Array.from(source.t, (t) => +t.toFixed(6)));
    if (plot.panel.x) add(`${plot.panel.x}${name} [${plot.panel.x_unit}]`, source.columns[plot.panel.x]);
    for (const one of its) add(`${one.line.label}${name}${plot.panel.unit ? ` [${plot.panel.unit}]` : ""}`, one.y);
  }
  const longest = Math.max(0, ...columns.map((column) => column.length));
  return lines(Array.from({ length: longest }, (_, i) => columns.map((column) => column[i] ?? "")));
}

function download(name, content, type) {
  const link = document.createElement("a"), blob = content instanceof Blob ? content : new Blob([content], { type });
  link.href = URL.createObjectURL(blob); link.download = name.replace(/[^\w.-]+/g, "-"); link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/* A small menu that saves what stands in a card. */
function saver(title, kinds) {
  const menu = document.createElement("details"), head = document.createElement("summary"); menu.className = "save";
  head.textContent = "save"; head.setAttribute("aria-label", "Save " + title); menu.append(head);
  for (const [kind, make] of Object.entries(kinds)) {
    const button = document.createElement("button"); button.type = "button"; button.textContent = kind; button.setAttribute("aria-label", `${title} as ${kind}`);
    button.onclick = async () => { download(`${title}.${kind.toLowerCase()}`, await make(), { SVG: "image/svg+xml", CSV: "text/csv" }[kind]); menu.open = false; };
    menu.append(button);
  }
  return menu;
}

const savePlot = (plot) => saver(plot.panel.title, { SVG: () => svgOf(plot), PNG: () => pngOf(plot), CSV: () => (plot.csv ? plot.csv() : csvOf(plot)) });
const saveTable = (title, table) => saver(title, { CSV: () => lines([...table.rows].map((row) => [...row.cells].map((one) => one.textContent))) });
