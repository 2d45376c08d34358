/* The page's words: who ran and how it ended, tables whose rows jump to their moment. */

const by = (id) => document.getElementById(id);
const element = (tag, text, cls) => { const e = document.createElement(tag); if (text != null) e.textContent = text; if (cls) e.className = cls; return e; };

function header(runs) {
  runs.forEach(({ head }, i) => {
    const box = element("div", null, "run"), title = element(i ? "h2" : "h1");
    const kind = ["completed", "fell"].includes(head.outcome) ? head.outcome : "other";
    title.className = "name";
    title.append(element("span", (runs.length > 1 ? "AB"[i] + ": " : "") + head.name), element("span", head.controller, "tag"), element("span", head.outcome, "tag " + kind), element("small", head.file));
    box.append(title, element("p", head.answer, "answer"));
    if (head.description) box.append(element("p", head.description));
    if (head.damage) box.append(element("p", head.damage, "damage"));
    by("head").append(box);
  });
}

function card(title, table, host = "words") {
  const box = element("article", null, "card"), scroll = element("div", null, "scroll");
  scroll.tabIndex = 0; scroll.setAttribute("role", "region"); scroll.setAttribute("aria-label", title); scroll.append(table);
  box.append(element("h2", title)); if (table.rows) box.append(saveTable(title, table));
  box.append(scroll); by(host).append(box);
  return box;
}

/* moments: time in [s] of each row, which its first cell jumps to. */
function table(rows, head, moments) {
  const out = element("table");
  if (head) { const tr = out.createTHead().insertRow(); head.forEach((text) => { const th = element(text ? "th" : "td", text); if (text) th.scope = "col"; tr.append(th); }); }
  const body = out.createTBody();
  rows.forEach((row, k) => {
    const tr = body.insertRow();
    row.forEach((text, i) => {
      const td = element("td");
      if (moments && !i) { const jump = element("button", text, "jump"); jump.type = "button"; jump.onclick = (event) => { event.stopPropagation(); app.seek(moments[k]); }; td.append(jump); } else td.textContent = text;
      tr.append(td);
    });
    if (moments) { tr.className = "moment"; tr.onclick = () => app.seek(moments[k]); }
  });
  return out;
}

function words(runs) {
  runs.forEach((run, i) => {
    if (!run.steps.length) return;
    const rows = run.steps.map((step) => step.cells), made = table(rows, data.steps, run.steps.map((step) => app.onAxis(i, step.t)));
    card(`Step by step${runs.length > 1 ? " of " + "AB"[i] : ""}`, made, "steps");
    run.rows = [...made.tBodies[0].rows];
  });
  const names = [...new Set(runs.flatMap((run) => run.summary.map(([name]) => name)))];
  const figures = names.map((name) => [name, ...runs.map((run) => (run.summary.find(([other]) => other === name) || ["", "–"])[1])]);
  card("Summary", table(figures, runs.length > 1 ? ["", "A", "B"] : null));
  runs.forEach((run, i) => {
    const of = runs.length > 1 ? " of " + "AB"[i] : "";
    card("Events" + of, table(run.events.map((e) => [e.t.toFixed(3) + " s", e.name, e.message]), null, run.events.map((e) => app.onAxis(i, e.t))));
    if (run.changed.length) card("Unlike the scenario of that name" + of, table(run.changed, ["setting", "there", "here"]));
    if (run.disagreements.length) card("What the controller does not know" + of, table(run.disagreements, ["what", "is", "believed"]));
    card("Scenario" + of, element("pre", run.scenario));
    card("Where it comes from" + of, table(run.provenance));
  });
}

/* Marks the step that the cursor is in. */
function markStep(runs, t) {
  runs.forEach((run, i) => {
    if (!run.rows) return;
    const now = run.steps.filter((step) => app.onAxis(i, step.t) <= t + 1e-6).length - 1;
    if (run.marked === now) return;
    run.rows[run.marked]?.removeAttribute("aria-current"); run.rows[now]?.setAttribute("aria-current", "true"); run.marked = now;
  });
}

function marks(runs) {
  by("marks").textContent = "";
  runs[0].events.forEach((event) => {
    const mark = element("i", null, `${event.name === "push" ? "push" : event.level}`); mark.title = event.message;
    mark.style.left = (100 * event.t) / (app.end || 1) + "%"; by("marks").append(mark);
  });
}
