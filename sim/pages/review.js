/* The page: reads the data, builds plots and tables, moves time. */

const data = JSON.parse(by("data").textContent);

const source = async (raw, name) => { const [t] = await unpacked(raw.t), rest = await unpacked(raw.numbers); return { name, t, t0: t, columns: Object.fromEntries(raw.keys.map((key, i) => [key, rest[i]])) }; };
const read = async (run, i) => {
  const [t, ...rows] = await unpacked(run.frames.numbers), [when, ...pushes] = run.frames.pushes.numbers ? await unpacked(run.frames.pushes.numbers) : [[]];
  const ahead = run.horizon && (await unpacked(run.horizon.numbers));
  return { ...run, source: await source(run.data, "AB"[i]), frames: { t, rows, pushes: { t: when, rows: pushes } }, horizon: ahead && { ...run.horizon, t: (await unpacked(run.horizon.t))[0], values: ahead } };
};

const app = {
  runs: [], t: 0, hover: null, drag: null, playing: false, speed: 1, mode: "overlay", clip: true, plots: [], align: "time", map: [[0], [0]],
  end: Math.max(...data.runs.map((run) => run.end)),
  view: { from: 0, to: 1 },
  sources: () => (app.mode === "difference" ? [gap] : app.runs.map((run) => run.source)),
  events: () => app.runs[0].events,
  sane: (order) => { const began = app.runs.map((run, i) => (run.began == null ? Infinity : app.onAxis(i, run.began))); return (app.mode === "difference" ? Math.min(...began) : began[order] ?? Infinity) + 0.1; },
  spans: () => app.runs[0].spans,
  limits: (name) => (name && app.runs[0].limits[name]) || [],
  horizon: () => app.runs[0].horizon,
  onAxis: (i, t) => (i ? along(app.map[0], app.map[1], t) : t),
  ofRun: (i, t) => (i ? along(app.map[1], app.map[0], t) : t),

  seek(t) {
    app.t = Math.min(app.end, Math.max(0, t));
    by("scrub").value = app.t; by("scrub").setAttribute("aria-valuetext", `${app.t.toFixed(3)} seconds`); by("clock").value = `${app.t.toFixed(3)} / ${app.end.toFixed(3)} s`;
    app.figure.draw(); app.point(); markStep(app.runs, app.t); app.remember();
  },
  point() { for (const plot of app.plots) if (plot.seen) plot.point(); },
  redraw() { for (const plot of app.plots) { plot.drawn = false; if (plot.seen) { plot.draw(); plot.point(); } } app.figure.draw(); app.tellScale(); },
  zoom(from, to) {
    const least = 0.005; if (to - from < least) to = from + least;
    app.view = { from: Math.max(0, from), to: Math.min(app.end || 1, to) }; app.redraw(); app.remember();
  },
  scale(factor, about) { const { from, to } = app.view; app.zoom(about - (about - from) * factor, about + (to - about) * factor); },
  pan(share) { const { from, to } = app.view, by = Math.max(-from, Math.min(app.end - to, share * (to - from))); app.zoom(from + by, to + by); },
  /* What of the ticks a plot shows. */
  tellScale() {
    const { from, to } = app.view, { t } = app.runs[0].source, kept = t.length, all = app.runs[0].ticks;
    const seen = before(t, to) - before(t, from) + 1, wide = app.plots.find((plot) => plot.seen && plot.inner)?.inner.w || 1, each = seen / wide;
    const thinned = kept < all ? `; of ${all} ticks the page keeps ${kept}, the least and largest of every ${Math.round((2 * all) / kept)}` : "";
    by("scale").textContent = `${from.toFixed(3)} to ${to.toFixed(3)} s: ${each > 4 ? `${each.toFixed(0)} ticks a pixel, drawn from least to largest; zoom in for every tick` : "every tick is drawn"}${thinned}`;
  },
  address() {
    const parts = new URLSearchParams({ t: app.t.toFixed(3) }), whole = app.view.from <= 0 && app.view.to >= app.end;
    if (!whole) { parts.set("from", app.view.from.toFixed(3)); parts.set("to", app.view.to.toFixed(3)); }
    if (app.mode !== "overlay") parts.set("mode", app.mode);
    if (app.align !== "time") parts.set("align", app.align);
    if (!app.clip) parts.set("peaks", "1");
    if (app.asked) parts.set("theme", app.asked);
    return "#" + parts;
  },
  remember() { if (app.ready && !app.waits) app.waits = setTimeout(() => { app.waits = 0; history.replaceState(null, "", app.address()); }, 200); },
  async copy() {
    history.replaceState(null, "", app.address());
    try { await navigator.clipboard.writeText(location.href); } catch { const box = element("textarea", location.href); document.body.append(box); box.select(); document.execCommand("copy"); box.remove(); }
    by("link").textContent = "Copied"; setTimeout(() => { by("link").textContent = "Copy link"; }, 1500);
  },
  play(on) {
    app.playing = on; by("play").textContent = on ? "❚❚" : "▶"; by("play").setAttribute("aria-label", on ? "Pause" : "Play");
    if (!on) return;
    if (app.t >= app.end - 1e-6) app.seek(0);
    let last = performance.now();
    const step = (now) => {
      if (!app.playing) return;
      app.seek(app.t + (app.speed * (now - last)) / 1000); last = now;
      if (app.t >= app.end) app.play(false); else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  },
  jump(direction) {
    const times = app.events().map((e) => e.t), next = direction > 0 ? times.find((t) => t > app.t + 1e-4) : times.filter((t) => t < app.t - 1e-4).pop();
    if (next != null) app.seek(next);
  },
  began: () => Math.min(...app.runs.map((run, i) => (run.began == null ? Infinity : app.onAxis(i, run.began)))),
  theme(name) { app.chosen = document.documentElement.dataset.theme = name; app.plots.forEach((plot) => plot.relabel()); app.redraw(); },
  setMode(mode) {
    app.mode = mode; by("mode").setAttribute("aria-pressed", mode === "difference");
    app.plots.forEach((plot) => plot.relabel()); app.redraw(); app.remember();
  },
  setAlign(how) {
    const [a, b] = app.runs;
    app.align = by("align").value = how; app.map = aligned(a, b, how);
    b.source.t = how === "time" ? b.source.t0 : Float32Array.from(b.source.t0, (t) => along(...app.map, t));
    gap = how === "time" ? plain : gapOf(a.source, b.source);
    app.end = Math.max(a.end, app.onAxis(1, b.end)); by("scrub").max = app.end; marks(app.runs);
    by("words").textContent = by("steps").textContent = ""; words(app.runs); app.zoom(0, app.end); app.seek(app.t);
    app.plots.forEach((plot) => plot.relabel()); app.redraw();
  },
};

function controls() {
  by("scrub").max = app.end; by("scrub").oninput = (event) => { app.play(false); app.seek(+event.target.value); };
  by("play").onclick = () => app.play(!app.playing);
  by("speed").onchange = (event) => { app.speed = +event.target.value; };
  by("reset").onclick = () => app.zoom(0, app.end);
  by("onset").hidden = app.began() === Infinity; by("onset").onclick = () => app.began() < Infinity && app.seek(app.began());
  by("clip").onclick = () => { app.clip = !app.clip; by("clip").setAttribute("aria-pressed", !app.clip); app.redraw(); app.remember(); };
  by("theme").onclick = () => { app.asked = document.documentElement.dataset.theme === "dark" ? "light" : "dark"; app.theme(app.asked); app.remember(); };
  by("help").onclick = () => by("keys").showModal();
  by("link").onclick = () => app.copy();
  by("mode").hidden = by("align").hidden = !gap; by("mode").onclick = () => gap && app.setMode(app.mode === "overlay" ? "difference" : "overlay");
  by("align").onchange = (event) => gap && app.setAlign(event.target.value);
  const presses = { " ": "play", r: "reset", p: "clip", d: "theme", "?": "help", b: "mode", f: "onset", l: "link" }, ways = ["time", "step", "clock"];
  document.addEventListener("keydown", (event) => {
    const { target } = event, own = /^(button|summary)$/i.test(target.tagName) && /^( |Enter)$/.test(event.key);
    if (event.ctrlKey || event.metaKey || by("keys").open || own || /^(select|textarea)$/i.test(target.tagName)) return;
    const size = event.shiftKey ? 0.001 : event.altKey ? 0.1 : 0.01;
    const moves = {
      ArrowLeft: () => app.seek(app.t - size), ArrowRight: () => app.seek(app.t + size), Home: () => app.seek(0), End: () => app.seek(app.end),
      "[": () => app.jump(-1), "]": () => app.jump(1), "+": () => app.scale(0.7, app.t), "=": () => app.scale(0.7, app.t), "-": () => app.scale(1 / 0.7, app.t),
      ",": () => app.pan(-0.25), ".": () => app.pan(0.25), a: () => gap && app.setAlign(ways[(ways.indexOf(app.align) + 1) % 3]),
    };
    if (moves[event.key]) { app.play(false); moves[event.key](); }
    else if (presses[event.key]) by(presses[event.key]).click();
    else return;
    event.preventDefault();
  });
}

/* Paper takes plots as SVG, in light colours and as wide as they are on the screen. */
function printed(on) {
  document.documentElement.dataset.theme = on ? "light" : app.chosen;
  app.plots.forEach((plot) => { plot.seen = true; });
  app.redraw();
  for (const plot of app.plots) { plot.sheet?.remove(); plot.sheet = null; if (on) { plot.sheet = element("div", null, "sheet"); plot.sheet.innerHTML = svgOf(plot); plot.card.append(plot.sheet); } }
}

let gap = null, plain = null;

/* The address's moment and view. */
function follow(asked) {
  if (app.runs[1] && ["step", "clock"].includes(asked.get("align"))) app.setAlign(asked.get("align"));
  if (gap && asked.get("mode") === "difference") app.setMode("difference");
  if (asked.get("peaks")) { app.clip = false; by("clip").setAttribute("aria-pressed", true); }
  const [from, to] = ["from", "to"].map((name) => parseFloat(asked.get(name)));
  if (to > from) app.zoom(from, to);
  const t = parseFloat(asked.get("t")), began = app.began();
  app.seek(Number.isFinite(t) ? t : began < Infinity ? began : 0);
}

async function start() {
  app.runs = await Promise.all(data.runs.map(read));
  gap = plain = data.difference && (await source(data.difference, "B − A"));
  const asked = new URLSearchParams(location.hash.slice(1)), theme = ["light", "dark"].includes(asked.get("theme")) ? asked.get("theme") : null;
  app.asked = theme; app.chosen = document.documentElement.dataset.theme = theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  app.view = { from: 0, to: app.end || 1 };
  header(app.runs); words(app.runs); marks(app.runs); controls();
  app.figure = new Figure(by("figure"), app);
  app.plots = [new Bands(app, by("bands")), ...Ahead.make(app, by("ahead")), ...data.panels.map((panel) => new Plot(panel, app, by("plots")))];
  app.plots.forEach((plot) => plot.card.querySelector("h2").after(savePlot(plot)));
  const watch = new IntersectionObserver((entries) => entries.forEach((entry) => {
    const plot = app.plots.find((one) => one.card === entry.target); plot.seen = entry.isIntersecting;
    if (plot.seen) { if (!plot.drawn) plot.draw(); plot.point(); }
  }), { rootMargin: "200px" });
  app.plots.forEach((plot) => watch.observe(plot.card));
  const resized = new ResizeObserver(() => app.redraw());
  resized.observe(by("plots")); resized.observe(by("figure"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (event) => app.theme(event.matches ? "dark" : "light"));
  addEventListener("beforeprint", () => printed(true)); addEventListener("afterprint", () => printed(false));
  addEventListener("hashchange", () => follow(new URLSearchParams(location.hash.slice(1))));
  follow(asked); app.ready = true; app.tellScale();
  document.documentElement.dataset.ready = "yes";
}

window.cmpc = app;
start();
