/* The page: reads the data, builds plots and tables, moves time. */

const data = JSON.parse(document.getElementById("data").textContent);
const by = (id) => document.getElementById(id);
const element = (tag, text, cls) => { const e = document.createElement(tag); if (text != null) e.textContent = text; if (cls) e.className = cls; return e; };

const source = async (raw, name) => { const [t] = await unpacked(raw.t), rest = await unpacked(raw.numbers); return { name, t, columns: Object.fromEntries(raw.keys.map((key, i) => [key, rest[i]])) }; };
const read = async (run, i) => {
  const [t, ...rows] = await unpacked(run.frames.numbers), [when, ...pushes] = run.frames.pushes.numbers ? await unpacked(run.frames.pushes.numbers) : [[]];
  const ahead = run.horizon && (await unpacked(run.horizon.numbers));
  return { ...run, source: await source(run.data, "AB"[i]), frames: { t, rows, pushes: { t: when, rows: pushes } }, horizon: ahead && { ...run.horizon, t: (await unpacked(run.horizon.t))[0], values: ahead } };
};

const app = {
  runs: [], t: 0, hover: null, drag: null, playing: false, speed: 1, mode: "overlay", clip: true, plots: [],
  end: Math.max(...data.runs.map((run) => run.end)),
  view: { from: 0, to: 1 },
  sources: () => (app.mode === "difference" ? [gap] : runs.map((run) => run.source)),
  events: () => runs[0].events,
  sane: (order) => (app.mode === "difference" ? Math.min(...runs.map((run) => run.began ?? Infinity)) : runs[order]?.began ?? Infinity) + 0.1,
  spans: () => runs[0].spans,
  limits: (name) => (name && runs[0].limits[name]) || [],
  horizon: () => runs[0].horizon,

  seek(t) {
    app.t = Math.min(app.end, Math.max(0, t));
    by("scrub").value = app.t; by("clock").value = `${app.t.toFixed(3)} / ${app.end.toFixed(3)} s`;
    app.figure.draw(); app.point();
  },
  point() { for (const plot of app.plots) if (plot.seen) plot.point(); },
  redraw() { for (const plot of app.plots) { plot.drawn = false; if (plot.seen) { plot.draw(); plot.point(); } } app.figure.draw(); },
  zoom(from, to) {
    const least = 0.005; if (to - from < least) to = from + least;
    app.view = { from: Math.max(0, from), to: Math.min(app.end || 1, to) }; app.redraw();
  },
  scale(factor, about) { const { from, to } = app.view; app.zoom(about - (about - from) * factor, about + (to - about) * factor); },
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
  theme(name) { app.chosen = document.documentElement.dataset.theme = name; app.plots.forEach((plot) => plot.relabel()); app.redraw(); },
  setMode(mode) {
    app.mode = mode; by("mode").setAttribute("aria-pressed", mode === "difference");
    app.plots.forEach((plot) => plot.relabel()); app.redraw();
  },
};

function header() {
  runs.forEach(({ head }, i) => {
    const box = element("div", null, "run"), title = element("h1");
    const kind = ["completed", "fell"].includes(head.outcome) ? head.outcome : "other";
    title.append(element("span", (runs.length > 1 ? "AB"[i] + ": " : "") + head.name), element("span", head.controller, "tag"), element("span", head.outcome, "tag " + kind), element("small", head.file));
    box.append(title, element("p", head.answer, "answer"));
    if (head.description) box.append(element("p", head.description));
    if (head.damage) box.append(element("p", head.damage, "damage"));
    by("head").append(box);
  });
}

function card(title, ...parts) { const box = element("article", null, "card"); box.append(element("h2", title), ...parts); by("words").append(box); return box; }

function table(rows, head) {
  const out = element("table");
  if (head) { const tr = element("tr"); head.forEach((text) => tr.append(element("th", text))); out.append(tr); }
  rows.forEach((row) => { const tr = element("tr"); row.forEach((text) => tr.append(element("td", text))); out.append(tr); });
  return out;
}

function words() {
  const names = [...new Set(runs.flatMap((run) => run.summary.map(([name]) => name)))];
  const figures = names.map((name) => [name, ...runs.map((run) => (run.summary.find(([other]) => other === name) || ["", "–"])[1])]);
  card("Summary", table(figures, runs.length > 1 ? ["", "A", "B"] : null));
  runs.forEach((run, i) => {
    const of = runs.length > 1 ? " of " + "AB"[i] : "", scroll = element("div", null, "scroll");
    const list = table(run.events.map((e) => [e.t.toFixed(3) + " s", e.name, e.message]));
    [...list.rows].forEach((row, k) => { row.className = "jump"; row.onclick = () => app.seek(run.events[k].t); });
    scroll.append(list); card("Events" + of, scroll);
    if (run.changed.length) card("Unlike the scenario of that name" + of, table(run.changed, ["setting", "there", "here"]));
    const text = element("div", null, "scroll"); text.append(element("pre", run.scenario)); card("Scenario" + of, text);
    card("Where it comes from" + (of && ", " + "AB"[i]), table(run.provenance));
  });
}

function marks() {
  app.events().forEach((event) => {
    const mark = element("i", null, `${event.name === "push" ? "push" : event.level}`); mark.title = event.message;
    mark.style.left = (100 * event.t) / (app.end || 1) + "%"; by("marks").append(mark);
  });
}

function controls() {
  by("scrub").max = app.end; by("scrub").oninput = (event) => { app.play(false); app.seek(+event.target.value); };
  by("play").onclick = () => app.play(!app.playing);
  by("speed").onchange = (event) => { app.speed = +event.target.value; };
  by("reset").onclick = () => app.zoom(0, app.end);
  by("clip").onclick = () => { app.clip = !app.clip; by("clip").setAttribute("aria-pressed", !app.clip); app.redraw(); };
  by("theme").onclick = () => app.theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  by("help").onclick = () => by("keys").showModal();
  by("mode").hidden = !gap; by("mode").onclick = () => gap && app.setMode(app.mode === "overlay" ? "difference" : "overlay");
  const presses = { " ": "play", r: "reset", p: "clip", d: "theme", "?": "help", b: "mode" };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || by("keys").open || /^(select|textarea)$/i.test(event.target.tagName)) return;
    const size = event.shiftKey ? 0.001 : event.altKey ? 0.1 : 0.01;
    const moves = {
      ArrowLeft: () => app.seek(app.t - size), ArrowRight: () => app.seek(app.t + size), Home: () => app.seek(0), End: () => app.seek(app.end),
      "[": () => app.jump(-1), "]": () => app.jump(1), "+": () => app.scale(0.7, app.t), "=": () => app.scale(0.7, app.t), "-": () => app.scale(1 / 0.7, app.t),
    };
    if (moves[event.key]) { app.play(false); moves[event.key](); }
    else if (presses[event.key]) by(presses[event.key]).click();
    else return;
    event.preventDefault();
  });
}

let runs = [], gap = null;

async function start() {
  runs = app.runs = await Promise.all(data.runs.map(read));
  gap = data.difference && (await source(data.difference, "B − A"));
  const asked = new URLSearchParams(location.hash.slice(1));
  app.chosen = document.documentElement.dataset.theme = asked.get("theme") || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  app.view = { from: 0, to: app.end || 1 };
  header(); words(); marks(); controls();
  app.figure = new Figure(by("figure"), app);
  app.plots = data.panels.map((panel) => new Plot(panel, app, by("plots")));
  const watch = new IntersectionObserver((entries) => entries.forEach((entry) => {
    const plot = app.plots.find((one) => one.card === entry.target); plot.seen = entry.isIntersecting;
    if (plot.seen) { if (!plot.drawn) plot.draw(); plot.point(); }
  }), { rootMargin: "200px" });
  app.plots.forEach((plot) => watch.observe(plot.card));
  const resized = new ResizeObserver(() => app.redraw());
  resized.observe(by("plots")); resized.observe(by("figure"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (event) => app.theme(event.matches ? "dark" : "light"));
  const printed = (on) => { document.documentElement.dataset.theme = on ? "light" : app.chosen; app.plots.forEach((plot) => { plot.seen = true; }); app.redraw(); };
  addEventListener("beforeprint", () => printed(true)); addEventListener("afterprint", () => printed(false));
  app.seek(+(asked.get("t") ?? runs[0].began ?? 0));
  document.documentElement.dataset.ready = "yes";
}

window.cmpc = app;
start();
