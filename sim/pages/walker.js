/* The walker as a stick figure on its ground, with the forces on it. */

const CONTACT_SCALE = 1 / 1000, PUSH_SCALE = 1 / 80; /* m/N, as in the log's /forces */
const Q = { left_hip: 0, right_hip: 1, left_knee: 2, right_knee: 3, torso: 4, x: 5, z: 6, force: 7, stance: 11 };

class Figure {
  constructor(canvas, app) {
    this.canvas = canvas; this.app = app;
  }

  /* Frame of a run at time t, between two rows. */
  frame(run, t) {
    const { t: times, rows } = run.frames, i = before(times, t), j = Math.min(i + 1, times.length - 1);
    const span = times[j] - times[i], part = span > 0 ? Math.min(1, Math.max(0, (t - times[i]) / span)) : 0, out = new Array(rows.length);
    for (let c = 0; c < rows.length; c++) {
      const a = rows[c][i], b = rows[c][j];
      out[c] = c === Q.stance ? a : a + part * (b - a);
    }
    return out;
  }

  joints(run, f) {
    const lengths = run.geometry, hip = [f[Q.x], f[Q.z]];
    const on = ([x, z], length, phi) => [x - length * Math.sin(phi), z + length * Math.cos(phi)];
    const leg = (side) => {
      const upper = f[Q.torso] + f[Q[side + "_hip"]], knee = on(hip, lengths[side + "_femur"], upper);
      return { knee, foot: on(knee, lengths[side + "_tibia"], upper + f[Q[side + "_knee"]]) };
    };
    return { hip, head: on(hip, lengths.torso, f[Q.torso]), left: leg("left"), right: leg("right") };
  }

  draw() {
    const [g, w, h] = sharp(this.canvas), app = this.app, first = app.runs[0];
    const f = this.frame(first, app.t);
    if (!f.every(Number.isFinite)) return;
    const scale = Math.min(h / 1.85, w / 1.2), x0 = f[Q.x], level = this.under(first, x0).z;
    const X = (x) => w * 0.5 + (x - x0) * scale, Z = (z) => h * 0.86 - (z - level) * scale;
    this.ground(g, w, X, Z, x0, scale, first);
    app.runs.slice(1).forEach((run, i) => {
      const t = app.ofRun(i + 1, app.t);
      if (t <= run.end + 1e-3) { g.globalAlpha = 0.4; this.walker(g, X, Z, run, this.frame(run, t), scale); g.globalAlpha = 1; }
    });
    this.trail(g, X, Z, first);
    this.walker(g, X, Z, first, f, scale);
    this.forces(g, X, Z, first, f);
    this.caption(g, w, first);
  }

  /* Height and inclination of the ground at x. */
  under(run, x) {
    const points = run.geometry.ground;
    let low = 0, high = points.length - 1;
    while (high - low > 1) { const mid = (low + high) >> 1; if (points[mid][0] <= x) low = mid; else high = mid; }
    const [[x0, z0], [x1, z1]] = [points[low], points[high]], rise = x1 > x0 ? (z1 - z0) / (x1 - x0) : 0;
    return { z: z0 + rise * (x - x0), angle: Math.atan(rise) };
  }

  ground(g, w, X, Z, x0, scale, run) {
    const reach = w / scale, a = x0 - reach, b = x0 + reach, inside = run.geometry.ground.filter(([x]) => x > a && x < b);
    g.strokeStyle = css("ground"); g.lineWidth = 2; g.beginPath(); g.moveTo(X(a), Z(this.under(run, a).z));
    inside.forEach(([x, z]) => g.lineTo(X(x), Z(z)));
    g.lineTo(X(b), Z(this.under(run, b).z)); g.stroke();
    g.fillStyle = css("muted"); g.font = "11px system-ui, sans-serif"; g.textAlign = "center"; g.textBaseline = "top"; g.lineWidth = 1;
    for (let n = Math.ceil(a * 5); n <= b * 5; n++) {
      const x = n / 5, y = Z(this.under(run, x).z), whole = n % 5 === 0;
      g.beginPath(); g.moveTo(X(x), y); g.lineTo(X(x) - (whole ? 0 : 4), y + (whole ? 8 : 5)); g.stroke();
      if (whole) g.fillText(`${x} m`.replace("-", "−"), X(x), y + 9);
    }
  }

  walker(g, X, Z, run, f, scale) {
    const j = this.joints(run, f), wide = Math.max(3, 0.035 * scale);
    const bar = (points, colour, width) => {
      g.strokeStyle = css(colour); g.lineWidth = width; g.lineCap = g.lineJoin = "round"; g.beginPath();
      points.forEach(([x, z], i) => (i ? g.lineTo(X(x), Z(z)) : g.moveTo(X(x), Z(z)))); g.stroke();
    };
    const dot = ([x, z], colour, radius) => { g.fillStyle = css(colour); g.beginPath(); g.arc(X(x), Z(z), radius, 0, TAU); g.fill(); };
    bar([j.hip, j.right.knee, j.right.foot], "right", wide); dot(j.right.knee, "card", wide * 0.28);
    bar([j.hip, j.head], "ink", wide * 1.5);
    bar([j.hip, j.left.knee, j.left.foot], "left", wide); dot(j.left.knee, "card", wide * 0.28);
    dot(j.hip, "card", wide * 0.4);
    const stance = f[Q.stance] ? j.right.foot : j.left.foot; dot(stance, f[Q.stance] ? "right" : "left", wide * 0.85);
    g.lineCap = "butt";
  }

  /* Paths of the feet over the last second. */
  trail(g, X, Z, run) {
    g.lineWidth = 1; g.globalAlpha = 0.55;
    for (const side of ["left", "right"]) {
      g.strokeStyle = css(side); g.setLineDash([2, 3]); g.beginPath();
      for (let i = 50; i >= 0; i--) {
        const t = this.app.t - i * 0.02; if (t < 0) continue;
        const [x, z] = this.joints(run, this.frame(run, t))[side].foot; g.lineTo(X(x), Z(z));
      }
      g.stroke();
    }
    g.setLineDash([]); g.globalAlpha = 1;
  }

  arrow(g, from, to, colour, label) {
    const dx = to[0] - from[0], dy = to[1] - from[1], length = Math.hypot(dx, dy);
    if (length < 4) return;
    const [ux, uy] = [dx / length, dy / length], head = Math.min(10, length * 0.5);
    g.strokeStyle = g.fillStyle = css(colour); g.lineWidth = 3; g.beginPath(); g.moveTo(...from); g.lineTo(to[0] - ux * head, to[1] - uy * head); g.stroke();
    g.beginPath(); g.moveTo(...to); g.lineTo(to[0] - ux * head - uy * head * 0.5, to[1] - uy * head + ux * head * 0.5);
    g.lineTo(to[0] - ux * head + uy * head * 0.5, to[1] - uy * head - ux * head * 0.5); g.fill();
    if (label) { g.font = "bold 12px system-ui, sans-serif"; g.textAlign = "center"; g.textBaseline = "bottom"; g.fillText(label, (from[0] + to[0]) / 2, Math.min(from[1], to[1]) - 5); }
  }

  forces(g, X, Z, run, f) {
    const j = this.joints(run, f);
    ["left", "right"].forEach((side, i) => {
      const t = f[Q.force + 2 * i], n = f[Q.force + 2 * i + 1], [x, z] = j[side].foot;
      const angle = this.under(run, x).angle, [s, c] = [Math.sin(angle), Math.cos(angle)];
      const fx = t * c - n * s, fz = t * s + n * c, k = CONTACT_SCALE * Math.min(1, 1500 / Math.hypot(fx, fz, 1e-9));
      this.arrow(g, [X(x), Z(z)], [X(x + fx * k), Z(z + fz * k)], "contact");
    });
    const p = run.frames.pushes, k = before(p.t, this.app.t);
    for (let i = k; i >= 0 && p.t.length && p.t[i] === p.t[k] && Math.abs(this.app.t - p.t[k]) < 0.02; i--) {
      const [x, z, fx, fz] = p.rows.map((row) => row[i]), size = Math.hypot(fx, fz), most = Math.min(1, 1.2 / (size * PUSH_SCALE));
      const tip = [x + fx * PUSH_SCALE, z + fz * PUSH_SCALE], tail = [tip[0] - fx * PUSH_SCALE * most, tip[1] - fz * PUSH_SCALE * most];
      this.arrow(g, [X(tail[0]), Z(tail[1])], [X(tip[0]), Z(tip[1])], "push", `${Math.round(size)} N`);
    }
  }

  caption(g, w, run) {
    const steps = run.events.filter((e) => e.name === "impact" && e.t <= this.app.t).length;
    g.fillStyle = css("muted"); g.font = "12px system-ui, sans-serif"; g.textBaseline = "top"; g.textAlign = "left";
    g.fillText(`step ${steps + 1}`, 10, 8);
    const last = run.events.filter((e) => e.t <= this.app.t + 1e-6).pop();
    g.textAlign = "right";
    if (last && this.app.t - last.t < 0.8 && last.name !== "run") g.fillText(last.message.slice(0, Math.floor(w / 9)), w - 10, 8);
  }
}
