// Draws the panels of every <figure data-panels>: hover reads values, dragging zooms in x, a double click zooms out,
// a click on a name in the legend hides a line. No library, no network.
"use strict";
(() => {
  const W = 520, H = 320, L = 62, R = 14, T = 30, B = 44;
  const NS = "http://www.w3.org/2000/svg";
  const make = (name, attributes, parent, text) => {
    const node = document.createElementNS(NS, name);
    for (const key in attributes) node.setAttribute(key, attributes[key]);
    if (text !== undefined) node.textContent = text;
    if (parent) parent.appendChild(node);
    return node;
  };
  const show = (v) => Math.abs(v) >= 1e4 || (v !== 0 && Math.abs(v) < 1e-3) ? v.toExponential(2) : String(+v.toPrecision(4));
  const extent = (values) => {
    let low = Infinity, high = -Infinity;
    for (const v of values) if (v !== null && isFinite(v)) { if (v < low) low = v; if (v > high) high = v; }
    return low > high ? [0, 1] : low === high ? [low - 1, high + 1] : [low, high];
  };
  const ticks = (low, high, log) => {
    if (log) {
      const found = [];
      for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); e++)
        for (const m of [1, 2, 5]) { const v = m * 10 ** e; if (v >= low * 0.999 && v <= high * 1.001) found.push(v); }
      return found.length > 7 ? found.filter((v) => Math.abs(Math.log10(v) % 1) < 1e-9) : found;
    }
    const raw = (high - low) / 5, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
    const found = [];
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) found.push(Math.abs(v) < 1e-9 * step ? 0 : v);
    return found;
  };
  const DASH = { solid: "", dashed: "6 4", dotted: "2 3" };

  function frame(panel, host) {
    const svg = make("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": panel.title }, host);
    make("text", { x: (L + W - R) / 2, y: 18, "text-anchor": "middle", class: "title" }, svg, panel.title);
    make("text", { x: (L + W - R) / 2, y: H - 8, "text-anchor": "middle" }, svg, panel.x_label);
    make("text", { x: 14, y: (T + H - B) / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${(T + H - B) / 2})` }, svg, panel.y_label);
    return svg;
  }
  function axes(svg, panel, xs, ys, toX, toY) {
    const layer = make("g", { class: "axes" }, svg);
    for (const v of ticks(...xs, panel.log_x)) {
      make("line", { x1: toX(v), x2: toX(v), y1: T, y2: H - B, class: "grid" }, layer);
      make("text", { x: toX(v), y: H - B + 15, "text-anchor": "middle" }, layer, show(v));
    }
    for (const v of ticks(...ys)) {
      make("line", { x1: L, x2: W - R, y1: toY(v), y2: toY(v), class: "grid" }, layer);
      make("text", { x: L - 6, y: toY(v) + 4, "text-anchor": "end" }, layer, show(v));
    }
    return layer;
  }
  const readout = (svg, x, lines) => {
    const width = Math.max(...lines.map((line) => line.length)) * 6.2 + 12;
    const left = x + width + 10 > W - R ? x - width - 8 : x + 8;
    const box = make("g", { class: "readout" }, svg);
    make("rect", { x: left, y: T + 4, width, height: 14 * lines.length + 6, rx: 3 }, box);
    lines.forEach((line, i) => make("text", { x: left + 6, y: T + 18 + 14 * i }, box, line));
    return box;
  };
  const at = (svg, event) => {
    const box = svg.getBoundingClientRect();
    return [(event.clientX - box.left) * W / box.width, (event.clientY - box.top) * H / box.height];
  };

  function lines(panel, host) {
    const svg = frame(panel, host), hidden = new Set();
    const all = extent(panel.series.flatMap((s) => s.x)), f = panel.log_x ? Math.log10 : (v) => v;
    let range = all.slice();
    const clip = `c${Math.random().toString(36).slice(2)}`;
    make("rect", { x: L, y: T, width: W - L - R, height: H - T - B }, make("clipPath", { id: clip }, svg));
    let body = null;
    const scale = () => {
      let xs = range, ys;
      if (panel.y_range && range[0] === all[0] && range[1] === all[1]) ys = panel.y_range;
      else {
        const seen = panel.series.filter((s, i) => !hidden.has(i)).flatMap((s) => s.y.filter((_, k) => s.x[k] >= range[0] && s.x[k] <= range[1]));
        ys = extent(seen.concat(range[0] === all[0] && range[1] === all[1] ? panel.levels.map((l) => l.y) : []));
        const pad = 0.05 * (ys[1] - ys[0]); ys = [ys[0] - pad, ys[1] + pad];
      }
      if (panel.equal) {
        const unit = Math.max((xs[1] - xs[0]) / (W - L - R), (ys[1] - ys[0]) / (H - T - B)), middle = (xs[0] + xs[1]) / 2;
        xs = [middle - unit * (W - L - R) / 2, middle + unit * (W - L - R) / 2];
      }
      const a = f(xs[0]), b = f(xs[1]);
      return {
        xs, ys, toX: (v) => L + (f(v) - a) / (b - a) * (W - L - R), toY: (v) => H - B - (v - ys[0]) / (ys[1] - ys[0]) * (H - T - B),
        fromX: (p) => { const v = a + (p - L) / (W - L - R) * (b - a); return panel.log_x ? 10 ** v : v; },
      };
    };
    let now;
    const paint = () => {
      if (body) body.remove();
      now = scale();
      body = make("g", {}, svg);
      const inside = make("g", { "clip-path": `url(#${clip})` }, body);
      for (const s of panel.spans) {
        make("rect", { x: now.toX(s.x0), y: T, width: Math.max(0, now.toX(s.x1) - now.toX(s.x0)), height: H - T - B, class: "span" }, inside);
        make("text", { x: (now.toX(s.x0) + now.toX(s.x1)) / 2, y: T + 13, "text-anchor": "middle", class: "quiet" }, inside, s.name);
      }
      axes(body, panel, now.xs, now.ys, now.toX, now.toY);
      for (const l of panel.levels) {
        make("line", { x1: L, x2: W - R, y1: now.toY(l.y), y2: now.toY(l.y), class: "level" }, inside);
        make("text", { x: W - R - 3, y: now.toY(l.y) - 3, "text-anchor": "end", class: "quiet" }, inside, l.name);
      }
      panel.series.forEach((s, i) => {
        if (hidden.has(i)) return;
        let path = "", pen = false;
        s.x.forEach((x, k) => {
          if (s.y[k] === null) { pen = false; return; }
          path += `${pen ? "L" : "M"}${now.toX(x).toFixed(1)} ${now.toY(s.y[k]).toFixed(1)}`; pen = true;
        });
        make("path", { d: path, fill: "none", stroke: s.colour, "stroke-width": s.width, "stroke-dasharray": DASH[s.dash], "stroke-linejoin": "round" }, inside);
        if (s.marker) s.x.forEach((x, k) => s.y[k] !== null && make("circle", { cx: now.toX(x), cy: now.toY(s.y[k]), r: 3, fill: s.colour }, inside));
      });
    };
    paint();
    const legend = document.createElement("div");
    legend.className = "legend";
    panel.series.forEach((s, i) => {
      if (!s.name) return;
      const item = document.createElement("button");
      item.innerHTML = `<svg width="26" height="8"><line x1="1" x2="25" y1="4" y2="4" stroke="${s.colour}" stroke-width="2.4" stroke-dasharray="${DASH[s.dash]}"/></svg>`;
      item.append(s.name);
      item.onclick = () => { hidden.has(i) ? hidden.delete(i) : hidden.add(i); item.classList.toggle("off"); paint(); };
      legend.append(item);
    });
    host.append(legend);
    let mark = null, drag = null;
    const clear = () => { if (mark) mark.remove(); mark = null; };
    svg.addEventListener("pointerleave", () => { clear(); drag = null; });
    svg.addEventListener("pointermove", (event) => {
      clear();
      const [px] = at(svg, event);
      if (px < L || px > W - R) return;
      const x = now.fromX(px), words = [];
      let near = null;
      panel.series.forEach((s, i) => {
        if (hidden.has(i) || !s.x.length) return;
        let best = 0;
        s.x.forEach((v, k) => { if (Math.abs(f(v) - f(x)) < Math.abs(f(s.x[best]) - f(x))) best = k; });
        if (near === null || Math.abs(f(s.x[best]) - f(x)) < Math.abs(f(near) - f(x))) near = s.x[best];
        if (s.y[best] !== null && s.name !== "" || panel.series.length === 1) words.push(`${s.name ? s.name + ": " : ""}${s.y[best] === null ? "-" : show(s.y[best])}`);
      });
      if (near === null || panel.equal) return;
      mark = readout(svg, px, [`${panel.x_label.replace(/ \[.*/, "")}: ${show(near)}`, ...words]);
      make("line", { x1: px, x2: px, y1: T, y2: H - B, class: "cursor" }, mark);
      if (drag !== null) make("rect", { x: Math.min(px, drag), y: T, width: Math.abs(px - drag), height: H - T - B, class: "drag" }, mark);
    });
    svg.addEventListener("pointerdown", (event) => { drag = at(svg, event)[0]; event.preventDefault(); });
    svg.addEventListener("pointerup", (event) => {
      const px = at(svg, event)[0];
      if (drag !== null && Math.abs(px - drag) > 8 && !panel.equal) { range = [now.fromX(Math.min(px, drag)), now.fromX(Math.max(px, drag))]; clear(); paint(); }
      drag = null;
    });
    svg.addEventListener("dblclick", () => { range = all.slice(); clear(); paint(); });
  }

  function map(panel, host) {
    const svg = frame(panel, host), { x, y } = panel, dx = x[1] - x[0], dy = y[1] - y[0];
    const xs = [x[0] - dx / 2, x[x.length - 1] + dx / 2], ys = [y[0] - dy / 2, y[y.length - 1] + dy / 2];
    const toX = (v) => L + (v - xs[0]) / (xs[1] - xs[0]) * (W - L - R), toY = (v) => H - B - (v - ys[0]) / (ys[1] - ys[0]) * (H - T - B);
    const w = toX(x[1]) - toX(x[0]), h = toY(y[0]) - toY(y[1]);
    y.forEach((b, i) => x.forEach((a, j) => make("rect", { x: toX(a) - w / 2, y: toY(b) - h / 2, width: w + 0.3, height: h + 0.3, fill: panel.colours[panel.classes[i][j]] }, svg)));
    axes(svg, panel, xs, ys, toX, toY);
    let mark = null;
    svg.addEventListener("pointerleave", () => { if (mark) mark.remove(); mark = null; });
    svg.addEventListener("pointermove", (event) => {
      if (mark) mark.remove();
      mark = null;
      const [px, py] = at(svg, event), j = Math.round((px - toX(x[0])) / w), i = Math.round((toY(y[0]) - py) / h);
      if (i < 0 || j < 0 || i >= y.length || j >= x.length) return;
      mark = readout(svg, px, [panel.names[panel.classes[i][j]], `x: ${show(x[j])}`, `y: ${show(y[i])}`]);
    });
    const legend = document.createElement("div");
    legend.className = "legend";
    panel.names.forEach((name, i) => {
      const item = document.createElement("span");
      item.innerHTML = `<i style="background:${panel.colours[i]}"></i>`;
      item.append(name);
      legend.append(item);
    });
    host.append(legend);
  }

  for (const figure of document.querySelectorAll("figure[data-panels]")) {
    const rows = JSON.parse(document.getElementById(figure.dataset.panels).textContent);
    for (const row of rows) {
      const line = document.createElement("div");
      line.className = "row";
      figure.append(line);
      for (const panel of row) {
        const host = document.createElement("div");
        host.className = "panel";
        line.append(host);
        (panel.classes ? map : lines)(panel, host);
      }
    }
  }
})();
