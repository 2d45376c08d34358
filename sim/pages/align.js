/* Two runs on one axis: by time, by step, or by the gait's clock. */

/* Value at x of the line through (xs, ys), xs rising; beyond its ends it goes on with slope 1. */
function along(xs, ys, x) {
  const n = xs.length; if (!n) return x;
  if (x <= xs[0]) return ys[0] + (x - xs[0]);
  if (x >= xs[n - 1]) return ys[n - 1] + (x - xs[n - 1]);
  const i = before(xs, x), span = xs[i + 1] - xs[i];
  return ys[i] + (span > 0 ? (x - xs[i]) / span : 0) * (ys[i + 1] - ys[i]);
}

const landings = (run) => run.events.filter((e) => e.name === "impact").map((e) => e.t);

/* Times of the second run -> the first run's axis, as two rising lists. */
function aligned(a, b, how) {
  const here = [0, ...landings(a)], there = [0, ...landings(b)], both = Math.min(here.length, there.length);
  if (how === "time") return [[0], [0]];
  if (how === "step") return [there.slice(0, both), here.slice(0, both)];
  const xs = [], ys = [], last = [a, b].map((run) => run.source.t[run.source.t.length - 1]);
  for (let k = 0; k < both; k++) {
    const endA = here[k + 1] ?? last[0], endB = there[k + 1] ?? last[1], clockA = climb(a.source, here[k], endA), clockB = climb(b.source, there[k], endB);
    xs.push(there[k]); ys.push(here[k]);
    for (let s = 0.02; s < 0.99; s += 0.02) {
      const ta = first(clockA, s), tb = first(clockB, s);
      if (ta != null && tb != null && ta > ys[ys.length - 1] && tb > xs[xs.length - 1]) { xs.push(tb); ys.push(ta); }
    }
  }
  return [xs, ys];
}

/* Times of a step and the largest clock reached by then. */
function climb({ t0, t, columns }, from, to) {
  const time = t0 || t, a = before(time, from) + 1, b = before(time, to), out = []; let most = -Infinity;
  for (let i = a; i < b; i++) if (columns.s[i] > most) { most = columns.s[i]; out.push([time[i], most]); }
  return out;
}
const first = (climbed, s) => { const found = climbed.find(([, most]) => most >= s); return found && climbed[0][1] < s ? found[0] : null; };

/* Second minus first at the second's times on the shared axis. */
function gapOf(a, b) {
  const at = Int32Array.from(b.t, (t) => before(a.t, t)), end = a.t[a.t.length - 1], columns = {};
  for (const key of Object.keys(b.columns)) columns[key] = Float32Array.from(b.columns[key], (v, i) => (b.t[i] > end ? NaN : v - a.columns[key][at[i]]));
  return { name: "B − A", t: b.t, columns };
}
