/* What happened when: a row a band, on the plots' axis of time; and what was predicted at the cursor. */

const ROW = 15, NAMES = 176;

class Bands extends Plot {
  constructor(app, host) {
    super({ name: "bands", title: "What happened when", unit: "", x: "", x_unit: "s", lines: [], note: "" }, app, host);
  }

  /* Rows of all runs, each run's on the axis that they share. */
  rows() {
    const many = this.app.runs.length > 1;
    return this.app.runs.flatMap((run, i) => run.bands.map((row) => ({ ...row, run: i, name: many ? `${"AB"[i]}: ${row.name}` : row.name, spans: row.spans.map(([a, b]) => [this.app.onAxis(i, a), this.app.onAxis(i, b)]) })));
  }

  relabel() { this.labels = []; this.legend.textContent = ""; this.value = document.createElement("span"); this.legend.append(this.value); this.made = null; }

  draw() {
    this.made = this.rows(); this.box.style.height = `${ROW * this.made.length + GUTTER.bottom + 4}px`;
    const names = this.made.map((row) => `${row.name}: ${row.spans.length}`).join("; ");
    this.base.setAttribute("aria-label", `${this.panel.title}. Stretches of ${names}`);
    super.draw();
  }

  paint(g, w, h) {
    const names = w < 500 ? 126 : NAMES, rows = this.made || this.rows(), { from, to } = this.app.view;
    const inner = this.inner = { x: names, y: 2, w: w - names - GUTTER.right, h: h - GUTTER.bottom - 4 };
    this.px = (t) => inner.x + ((t - from) / (to - from)) * inner.w;
    this.time = (px) => from + ((px - inner.x) / inner.w) * (to - from);
    g.font = "11px system-ui, sans-serif"; g.textBaseline = "middle"; g.lineWidth = 1;
    const columns = ticks(from, to, Math.max(2, inner.w / 75)); g.textAlign = "center";
    columns.values.forEach((v, i) => {
      const x = Math.round(this.px(v)) + 0.5; g.strokeStyle = css("grid"); g.beginPath(); g.moveTo(x, inner.y); g.lineTo(x, inner.y + inner.h); g.stroke();
      g.fillStyle = css("muted"); g.fillText(v.toFixed(columns.digits).replace("-", "−") + (i === columns.values.length - 1 ? " s" : ""), Math.min(x, w - 16), h - 8);
    });
    rows.forEach((row, i) => {
      const y = inner.y + i * ROW;
      g.textAlign = "right"; g.fillStyle = css("ink"); g.fillText(this.short(row.name, names), inner.x - 6, y + ROW / 2);
      g.fillStyle = css(row.colour);
      for (const [a, b] of row.spans) {
        const x0 = Math.max(inner.x, this.px(a)), x1 = Math.min(inner.x + inner.w, this.px(b));
        if (x1 > inner.x && x0 < inner.x + inner.w) g.fillRect(x0, y + 2, Math.max(1.5, x1 - x0), ROW - 4);
      }
    });
    this.app.runs.forEach((run, i) => {
      if (run.began == null) return;
      const x = this.px(this.app.onAxis(i, run.began)); if (x < inner.x || x > inner.x + inner.w) return;
      g.strokeStyle = css("bad"); g.setLineDash([4, 3]); g.lineWidth = 1.5; g.beginPath(); g.moveTo(x, inner.y); g.lineTo(x, inner.y + inner.h); g.stroke(); g.setLineDash([]);
    });
    this.drawn = true;
  }

  csv() { return lines([["what", "from [s]", "to [s]"], ...this.rows().flatMap((row) => row.spans.map(([a, b]) => [row.name, a.toFixed(3), b.toFixed(3)]))]); }

  short(name, room) { return room < NAMES ? name.replace(" at its torque limit", " at limit").replace(" foot on the ground", " foot").replace("friction row active", "friction row") : name; }

  point() {
    const [g] = sharp(this.top), { inner } = this; if (!inner) return;
    this.cursors(g);
    const t = this.app.hover ?? this.app.t, now = (this.made || []).filter((row) => row.spans.some(([a, b]) => a <= t && t < b)).map((row) => row.name);
    this.value.textContent = `${t.toFixed(3)} s: ${now.join(", ") || "–"}`;
  }
}

/* Predicted against real around the cursor, whatever the rest of the page shows. */
class Ahead extends Plot {
  static make(app, host) {
    const horizon = app.horizon(); if (!horizon || !horizon.t.length) return [];
    const around = Object.create(app, { view: { get() { const length = horizon.stages * horizon.period || 0.1; return { from: app.t - 0.3 * length, to: app.t + 1.1 * length }; } }, hover: { get: () => null }, events: { value: app.events } });
    const pick = (name, title, lines) => ({ ...data.panels.find((one) => one.name === name), name: "ahead-" + name, title, lines });
    const found = [["outputs", "Outputs y, expected and real"], ["normal", "Normal force, expected and real"], ["tangential", "Tangential force, expected and real"]];
    return found.filter(([name]) => data.panels.some((one) => one.name === name)).map(([name, title]) => new Ahead(pick(name, title, data.panels.find((one) => one.name === name).lines), around, host));
  }

  lines() { return super.lines().filter((one) => !one.order); }
  point() { this.draw(); super.point(); }
  listen() {}
}
