"use strict";
/* One plot: lines on a canvas below, cursor and dots on a canvas above. Knows nothing of runs or playing.
   Ours and not a library's: of a run of 60 s (16 plots, 45 lines, every tick) Bokeh 3.9 made a page of 14.7 MB, first painted after
   3.6 s, and a step of a zoom took 1.0 to 2.7 s; ours has 3.5 MB, paints after 0.2 s, has all after 2.6 s, and a step takes 0.1 to
   1.0 s (headless Chromium on two cores, both busy with six other programs). */

const TAU = 2 * Math.PI;
const INK = "#1a1a1a"; /* sim.pages.palette.BLACK: the page's ink, light or dark */
const css = (name) => name[0] === "#" && name !== INK ? name : getComputedStyle(document.documentElement).getPropertyValue("--" + (name === INK ? "ink" : name)).trim();
const DASHES = { dashed: [6, 4], dotted: [2, 3] };

/* Rows of numbers that sim.pages.packing made small, as Float32Arrays. */
async function unpacked({ rows, length, drop, data }) {
  const raw = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
  const bytes = new Uint8Array(await new Response(new Blob([raw]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer());
  return Array.from({ length: rows }, (_, row) => {
    const out = new Float32Array(length), bits = new Uint32Array(out.buffer), base = 4 * row * length;
    for (let i = 0, whole = 0; i < length; i++) {
      const at = base + i, step = bytes[at] + 256 * (bytes[at + length] + 256 * (bytes[at + 2 * length] + 256 * bytes[at + 3 * length]));
      whole += step % 2 ? -(step + 1) / 2 : step / 2;
      bits[i] = whole * 2 ** drop;
    }
    return out;
  });
}

/* Index of the last time at or before t; 0 if there is none. */
function before(times, t) {
  let low = 0, high = times.length;
  while (low < high) { const mid = (low + high) >> 1; if (times[mid] <= t) low = mid + 1; else high = mid; }
  return Math.max(0, low - 1);
}

function number(value) {
  if (!Number.isFinite(value)) return "–";
  if (Number.isInteger(value) && Math.abs(value) < 1e6) return String(value).replace("-", "−");
  const size = Math.abs(value);
  if (size >= 1e5 || (size < 1e-3 && size > 0)) return value.toExponential(2).replaceAll("-", "−").replace("e+", "e");
  return value.toFixed(size >= 100 ? 1 : size >= 10 ? 2 : size >= 1 ? 3 : 4).replace("-", "−");
}

function ticks(low, high, wanted) {
  const raw = (high - low) / Math.max(1, wanted), power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw) || raw, out = [];
  for (let v = Math.ceil(low / step) * step; v <= high + step * 1e-6 && out.length < 50; v += step) out.push(Math.abs(v) < step * 1e-6 ? 0 : v);
  return { values: out, digits: Math.min(8, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))) };
}

/* A canvas in CSS pixels, sharp on any screen. */
function sharp(canvas) {
  const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
  if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
    canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio);
  }
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0); g.clearRect(0, 0, w, h);
  return [g, w, h];
}

const GUTTER = { left: 46, right: 8, top: 6, bottom: 18 };

class Plot {
  /* panel: see sim/review/panels.py; app: time, view, sources, events, spans, limits, horizon, sane. */
  constructor(panel, app, host) {
    this.panel = panel; this.app = app; this.hidden = new Set();
    const card = document.createElement("article"); card.className = "card"; card.id = "plot-" + panel.name; card.title = panel.note || "";
    const title = document.createElement("h2"); title.textContent = panel.title + " ";
    if (panel.unit) { const unit = document.createElement("span"); unit.textContent = "[" + panel.unit + "]"; title.append(unit); }
    this.legend = document.createElement("div"); this.legend.className = "legend";
    this.box = document.createElement("div"); this.box.className = "plot";
    this.base = document.createElement("canvas"); this.top = document.createElement("canvas");
    this.base.setAttribute("role", "img"); this.base.setAttribute("aria-label", panel.title);
    this.box.append(this.base, this.top); card.append(title, this.legend, this.box); host.append(card);
    this.card = card; this.relabel(); this.listen();
  }

  /* Lines of all sources: {source, line, x, y}. */
  lines() {
    const out = [];
    this.app.sources().forEach((source, order) => this.panel.lines.forEach((line) => {
      const y = source.columns[line.key];
      if (y) out.push({ source, order, line, x: this.panel.x ? source.columns[this.panel.x] : source.t, y });
    }));
    return out;
  }

  relabel() {
    this.legend.textContent = ""; this.labels = [];
    const many = this.app.sources().length > 1;
    for (const one of this.lines()) {
      const id = one.order + one.line.key, item = document.createElement("button"); item.type = "button";
      const swatch = document.createElement("i"), value = document.createElement("b");
      swatch.style.borderColor = css(one.line.colour); if (one.order || one.line.dash) swatch.className = "second";
      item.append(swatch, one.line.label + (many ? " " + one.source.name : ""), value);
      item.classList.toggle("off", this.hidden.has(id));
      item.onclick = () => { if (!this.hidden.delete(id)) this.hidden.add(id); item.classList.toggle("off"); this.draw(); this.point(); };
      this.legend.append(item); this.labels.push({ one, value, id });
    }
  }

  shown() { return this.lines().filter((one) => !this.hidden.has(one.order + one.line.key)); }

  /* First and last sample of a line in a stretch of time; all of one that runs back and forth. */
  stretch({ source, y }, from, to) {
    return source.unordered ? [0, y.length - 1] : [before(source.t, from), Math.min(y.length - 1, before(source.t, to) + 1)];
  }

  /* Least and largest value of one source in view, and some of all values, sorted. */
  values(lines, order) {
    const { from, to } = this.app.view, some = [];
    let low = Infinity, high = -Infinity;
    for (const one of lines.filter((one) => one.order === order)) {
      const { y } = one, sane = this.app.clip ? this.app.sane(order) : Infinity; /* once it falls, anything goes */
      const [a, b] = this.stretch(one, from, sane > from ? Math.min(to, sane) : to), every = Math.max(1, Math.floor((b - a) / 3000));
      for (let i = a; i <= b; i++) { const v = y[i]; if (v < low && v > -Infinity) low = v; if (v > high && v < Infinity) high = v; }
      for (let i = a; i <= b; i += every) if (Number.isFinite(y[i])) some.push(y[i]);
    }
    return { low, high, some: Float32Array.from(some).sort() };
  }

  /* Range of the vertical axis. Clipped, rare peaks leave it, and a second run that blows up does not flatten the first. */
  range(lines) {
    const clip = this.panel.clip && this.app.clip;
    let low = Infinity, high = -Infinity;
    for (const order of [0, 1]) {
      const found = this.values(lines, order), all = found.some;
      if (!all.length) continue;
      let [a, b] = [found.low, found.high];
      if (clip) {
        const [p, q] = [all[Math.floor(0.01 * all.length)], all[Math.ceil(0.99 * (all.length - 1))]], room = 0.35 * (q - p);
        [a, b] = [Math.max(a, p - room), Math.min(b, q + room)];
        if (order && high > low) [a, b] = [Math.max(a, 2 * low - high), Math.min(b, 2 * high - low)];
      }
      [low, high] = [Math.min(low, a), Math.max(high, b)];
    }
    if (this.panel.y_range) return this.panel.y_range;
    if (!(high >= low)) return [0, 1];
    const bound = clip && this.panel.limits !== "friction" && this.limits().length ? 4 * Math.abs(this.limits()[0].value) : Infinity;
    [low, high] = [Math.max(low, -bound), Math.min(high, bound)];
    for (const limit of this.limits()) if (this.panel.limits === "friction" || Math.max(-low, high) > 0.5 * Math.abs(limit.value)) {
      low = Math.min(low, 1.06 * limit.value); high = Math.max(high, 1.06 * limit.value);
    }
    if (this.panel.log) return [Math.max(low, high * 1e-6, 1e-6) * 0.8, high * 1.25];
    if (this.panel.limits === "friction") low = 0;
    const room = 0.05 * (high - low) || 0.05 * Math.abs(high) || 1;
    return [low - room, high + room];
  }

  limits() { return this.app.mode === "difference" ? [] : this.app.limits(this.panel.limits); }

  draw() { this.paint(...sharp(this.base)); }

  /* Everything but cursors, on a canvas or anything that draws like one. */
  paint(g, w, h) {
    const lines = this.shown(), { left, right, top, bottom } = GUTTER;
    let [y0, y1] = this.range(lines);
    const inner = { x: left, y: top, w: w - left - right, h: h - top - bottom };
    let [x0, x1] = [this.app.view.from, this.app.view.to];
    if (this.panel.x) {
      const from = x0, to = x1;
      [x0, x1] = [Infinity, -Infinity];
      for (const { source, x } of lines) for (let i = before(source.t, from); i <= before(source.t, to); i++) { if (x[i] < x0) x0 = x[i]; if (x[i] > x1) x1 = x[i]; }
      if (!(x1 > x0)) [x0, x1] = [x0 - 1 || 0, x0 + 1 || 1];
      const room = 0.04 * (x1 - x0); x0 -= room; x1 += room;
    }
    if (this.panel.equal) {
      const unit = Math.max((x1 - x0) / inner.w, (y1 - y0) / inner.h), around = (a, b, size) => [(a + b - unit * size) / 2, (a + b + unit * size) / 2];
      [x0, x1] = around(x0, x1, inner.w); [y0, y1] = around(y0, y1, inner.h);
    }
    const log = this.panel.log, f = log ? Math.log10 : (v) => v, [u0, u1] = [f(y0), f(y1)];
    const e = this.panel.log_x ? Math.log10 : (v) => v, [v0, v1] = [e(x0), e(x1)];
    this.px = (x) => inner.x + ((e(x) - v0) / (v1 - v0)) * inner.w;
    this.py = (y) => inner.y + inner.h - ((f(y) - u0) / (u1 - u0)) * inner.h;
    this.time = (px) => { const v = v0 + ((px - inner.x) / inner.w) * (v1 - v0); return this.panel.log_x ? 10 ** v : v; };
    this.inner = inner;
    g.font = "11px system-ui, sans-serif"; g.lineWidth = 1; g.textBaseline = "middle";
    const rows = log
      ? { values: Array.from({ length: 42 }, (_, i) => [1, 2, 5][i % 3] * 10 ** (Math.floor(i / 3) - 7)).filter((v) => v >= y0 && v <= y1 && (y1 / y0 < 300 || /^0?\.?0*1/.test(v))) }
      : ticks(y0, y1, Math.max(2, inner.h / 34));
    if (!this.panel.x) for (const span of this.app.spans()) {
      const a = Math.max(inner.x, this.px(span.from)), b = Math.min(inner.x + inner.w, this.px(span.to));
      if (b <= a) continue;
      g.fillStyle = css(span.colour || "muted"); g.globalAlpha = 0.13; g.fillRect(a, inner.y, b - a, inner.h); g.globalAlpha = 1;
      if (span.name) { g.textAlign = "center"; g.fillStyle = css("muted"); g.fillText(span.name, (a + b) / 2, inner.y + 8); }
    }
    g.textAlign = "right";
    for (const v of rows.values) {
      const y = Math.round(this.py(v)) + 0.5;
      g.strokeStyle = css(v === 0 ? "rule" : "grid"); g.beginPath(); g.moveTo(inner.x, y); g.lineTo(inner.x + inner.w, y); g.stroke();
      g.fillStyle = css("muted"); g.fillText((log ? String(+v.toPrecision(2)) : Math.abs(v) >= 1e5 ? v.toExponential(0) : v.toFixed(rows.digits)).replace("-", "−"), inner.x - 5, y);
    }
    const decades = () => { const found = []; for (let k = Math.floor(v0); k <= v1; k++) for (const m of [1, 2, 5]) if (m * 10 ** k >= x0 && m * 10 ** k <= x1) found.push(m * 10 ** k); return { values: found, digits: Math.max(0, -Math.floor(v0)) }; };
    const columns = this.panel.log_x ? decades() : ticks(x0, x1, Math.max(2, inner.w / 75)); g.textAlign = "center";
    columns.values.forEach((v, i) => {
      const x = Math.round(this.px(v)) + 0.5; g.strokeStyle = css("grid"); g.beginPath(); g.moveTo(x, inner.y); g.lineTo(x, inner.y + inner.h); g.stroke();
      const last = i === columns.values.length - 1 && x < inner.x + inner.w - 4;
      g.fillStyle = css("muted"); g.fillText(v.toFixed(columns.digits).replace("-", "−") + (last ? " " + this.panel.x_unit : ""), Math.min(x, w - 16), h - 8);
    });
    g.save(); g.beginPath(); g.rect(inner.x, inner.y, inner.w, inner.h); g.clip();
    if (!this.panel.x) this.app.events().forEach((event) => {
      const x = Math.round(this.px(event.t)) + 0.5;
      g.strokeStyle = css(event.name === "push" ? "push" : event.level === "info" ? "rule" : "warn"); g.setLineDash(event.name === "impact" ? [] : [3, 3]);
      g.beginPath(); g.moveTo(x, inner.y); g.lineTo(x, inner.y + inner.h); g.stroke();
    });
    g.setLineDash([7, 4]); g.strokeStyle = css("bad"); g.fillStyle = css("bad"); g.textAlign = "right"; g.font = "10px system-ui, sans-serif";
    for (const limit of this.limits()) {
      const y = this.py(limit.value); g.globalAlpha = 0.8; g.beginPath(); g.moveTo(inner.x, y); g.lineTo(inner.x + inner.w, y); g.stroke();
      if (limit.label) g.fillText(limit.label + " " + limit.value, inner.x + inner.w - 3, y < inner.y + 14 ? y + 8 : y - 7);
    }
    g.setLineDash([]); g.globalAlpha = 1; g.lineJoin = "round";
    for (const one of lines) this.stroke(g, one, this.panel.x ? 0.55 : 1);
    g.restore();
    this.drawn = true;
  }

  stroke(g, { source, order, line, x, y }, alpha) {
    const [a, b] = this.stretch({ source, y }, this.app.view.from, this.app.view.to);
    g.strokeStyle = css(line.colour); g.lineWidth = line.width || (order ? 1.1 : 1.5); g.setLineDash(DASHES[line.dash] || (order ? [4, 3] : [])); g.globalAlpha = alpha;
    g.beginPath();
    if (!this.panel.x && !this.panel.log_x && !source.unordered && b - a > 4 * this.inner.w) { this.solid(g, source.t, y, a, b); g.globalAlpha = 1; g.setLineDash([]); return; }
    let pen = false;
    for (let i = a; i <= b; i++) {
      if (!Number.isFinite(y[i]) || !Number.isFinite(x[i])) { pen = false; continue; }
      const px = this.px(x[i]), py = Math.max(-1e4, Math.min(1e4, this.py(y[i])));
      if (pen && this.panel.x && Math.abs(x[i] - x[i - 1]) > 0.2) pen = false; /* the clock starts over at an impact */
      if (pen) g.lineTo(px, py); else g.moveTo(px, py);
      pen = true;
      if (line.marker) { g.fillStyle = g.strokeStyle; g.fillRect(px - 2, py - 2, 4, 4); }
    }
    g.stroke(); g.globalAlpha = 1; g.setLineDash([]);
  }

  /* A line of many ticks a pixel: in each column of pixels its first, least, largest and last value. */
  solid(g, t, y, a, b) {
    let column = -1, first = NaN, low = Infinity, high = -Infinity, last = NaN, pen = false;
    const at = (v) => Math.max(-1e4, Math.min(1e4, this.py(v)));
    const start = this.px(t[a]), scale = (this.px(t[b]) - start) / (t[b] - t[a] || 1); /* the axis is linear */
    const put = () => {
      if (!(high >= low)) { pen = false; return; }
      for (const v of [first, low, high, last]) { if (pen) g.lineTo(column, at(v)); else g.moveTo(column, at(v)); pen = true; }
    };
    for (let i = a; i <= b; i++) {
      const x = Math.round(start + (t[i] - t[a]) * scale), v = y[i];
      if (x !== column) { put(); column = x; first = v; low = Infinity; high = -Infinity; }
      if (v < low) low = v;
      if (v > high) high = v;
      if (!Number.isFinite(first)) first = v;
      last = Number.isFinite(v) ? v : last;
    }
    put(); g.stroke();
  }

  /* Cursor, dots and values at the time the pointer or the player is at. */
  point() {
    const [g] = sharp(this.top), t = this.app.hover ?? this.app.t, { inner } = this;
    if (!inner) return;
    if (!this.panel.x) { this.cursors(g); this.ahead(g, t); }
    g.save(); g.beginPath(); g.rect(inner.x - 4, inner.y - 4, inner.w + 8, inner.h + 8); g.clip();
    for (const { one, value, id } of this.labels) {
      if (one.source.unordered) continue;
      const i = before(one.source.t, t), there = t <= one.source.t[one.source.t.length - 1] + 1e-3;
      value.textContent = there ? number(one.y[i]) + (this.panel.unit && Number.isFinite(one.y[i]) ? " " + this.panel.unit : "") : "–";
      if (this.hidden.has(id) || !there || !Number.isFinite(one.y[i]) || !Number.isFinite(one.x[i])) continue;
      if (this.panel.x) this.trail(g, one, i);
      g.fillStyle = css(one.line.colour); g.beginPath(); g.arc(this.px(one.x[i]), this.py(one.y[i]), this.panel.x ? 5 : 2.8, 0, TAU); g.fill();
    }
    g.restore();
  }

  cursors(g) {
    const { inner, app } = this;
    for (const [at, colour] of [[app.t, "ink"], [app.hover, "muted"]]) if (at != null && at >= app.view.from && at <= app.view.to) {
      g.strokeStyle = css(colour); g.lineWidth = 1; g.beginPath(); g.moveTo(this.px(at), inner.y); g.lineTo(this.px(at), inner.y + inner.h); g.stroke();
    }
    if (app.drag && app.drag.wide) {
      const [a, b] = [app.drag.from, app.drag.to].map(this.px); g.fillStyle = css("c1"); g.globalAlpha = 0.15;
      g.fillRect(Math.min(a, b), inner.y, Math.abs(b - a), inner.h); g.globalAlpha = 1;
    }
  }

  /* The last half second of a phase portrait. */
  trail(g, one, end) {
    g.strokeStyle = css("mpc"); g.lineWidth = 2.2; g.beginPath();
    for (let i = before(one.source.t, one.source.t[end] - 0.5), pen = false; i <= end; i++) {
      if (pen && Math.abs(one.x[i] - one.x[i - 1]) > 0.2) pen = false;
      if (pen) g.lineTo(this.px(one.x[i]), this.py(one.y[i])); else g.moveTo(this.px(one.x[i]), this.py(one.y[i]));
      pen = true;
    }
    g.stroke();
  }

  /* What the MPC expected at the cursor. */
  ahead(g, t) {
    const h = this.app.mode === "difference" ? null : this.app.horizon();
    if (!h || !h.t.length || t < h.t[0] - 0.05) return;
    const k = before(h.t, t), { inner } = this;
    if (t - h.t[k] > 0.05) return;
    g.save(); g.beginPath(); g.rect(inner.x, inner.y, inner.w, inner.h); g.clip(); g.setLineDash([1.5, 3]); g.lineWidth = 2; g.lineCap = "round";
    for (const line of this.panel.lines) {
      const row = h.series.indexOf(line.horizon);
      if (row < 0 || this.hidden.has("0" + line.key)) continue;
      g.strokeStyle = css(line.colour); g.beginPath();
      for (let s = 0, pen = false; s < h.stages; s++) {
        const v = h.values[row * h.stages + s][k]; if (!Number.isFinite(v)) { pen = false; continue; }
        const px = this.px(h.t[k] + s * h.period), py = Math.max(-1e4, Math.min(1e4, this.py(v)));
        if (pen) g.lineTo(px, py); else g.moveTo(px, py);
        pen = true;
      }
      g.stroke();
    }
    g.restore();
  }

  listen() {
    const box = this.box, app = this.app;
    const at = (event) => Math.min(app.end, Math.max(0, this.time(event.clientX - box.getBoundingClientRect().left)));
    if (this.panel.x || this.panel.equal) return;
    box.onpointerdown = (event) => {
      if (event.button) return;
      box.setPointerCapture(event.pointerId); app.drag = { from: at(event), to: at(event), x: event.clientX, wide: false };
      if (event.pointerType !== "mouse") app.seek(at(event));
    };
    box.onpointermove = (event) => {
      if (app.drag && event.pointerType !== "mouse") { app.seek(at(event)); return; }
      if (app.drag) { app.drag.to = at(event); app.drag.wide = app.drag.wide || Math.abs(event.clientX - app.drag.x) > 5; }
      app.hover = at(event); app.point();
    };
    box.onpointerup = (event) => {
      const drag = app.drag; app.drag = null;
      if (drag && drag.wide && event.pointerType === "mouse") app.zoom(Math.min(drag.from, drag.to), Math.max(drag.from, drag.to));
      else app.seek(at(event));
    };
    box.onpointercancel = () => { app.drag = null; app.point(); };
    box.onpointerleave = () => { app.hover = null; app.point(); };
    box.ondblclick = () => app.zoom(0, app.end);
    box.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault(); app.scale(Math.exp(event.deltaY / 300), at(event));
    }, { passive: false });
  }
}
