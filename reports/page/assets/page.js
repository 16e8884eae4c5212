// The page around the player: colour scheme, matrix by keyboard, details of a cell, deep links.
"use strict";

const pick = (selector, root = document) => root.querySelector(selector);
const data = JSON.parse(pick("#cells").textContent);
const scenes = JSON.parse(pick("#scenes").textContent);

function paint(scheme) {
  if (scheme === "auto") delete document.documentElement.dataset.scheme;
  else document.documentElement.dataset.scheme = scheme;
  window.touchstone.player?.theme();
}

// Fill the dialog with all that the run knows of one cell.
function open(id) {
  const cell = data.cells[id];
  if (!cell) return;
  const dialog = pick("#cell");
  pick("h3", dialog).textContent = `${cell.scene} · ${cell.engine} ${cell.profile}`;
  const list = pick("dl", dialog);
  list.replaceChildren();
  for (const [name, value] of cell.facts) {
    const term = document.createElement("dt"), fact = document.createElement("dd");
    term.textContent = name;
    fact.textContent = value;
    list.append(term, fact);
  }
  pick("code", dialog).textContent = cell.command;
  const watch = pick("[data-do=watch]", dialog);
  watch.hidden = !(cell.scene in scenes);
  watch.onclick = () => {
    dialog.close();
    show(cell.scene, null, cell.engine);
  };
  pick("[data-do=copy]", dialog).onclick = (event) => copy(cell.command, event.target);
  if (!dialog.open) dialog.showModal();
  history.replaceState(null, "", `#cell=${encodeURIComponent(id)}`);
}

function copy(text, button) {
  const area = document.createElement("textarea");
  area.value = text;
  (pick("dialog[open]") ?? document.body).append(area);
  area.select();
  document.execCommand("copy");
  area.remove();
  button.textContent = "Copied";
  setTimeout(() => (button.textContent = "Copy"), 1500);
}

async function show(scene, frame, engine) {
  const { player } = window.touchstone;
  if (!player || !(scene in scenes)) return;
  pick("[name=scene]").value = scene;
  await player.open(scene, frame ?? 0);
  if (frame === null && engine) {
    const worst = player.scene.engines.find((one) => one.engine === engine);
    if (worst) player.seek(worst.worst);
  }
  pick("#playback").scrollIntoView({ block: "start" });
}

// A link to a fold opens it, and those around it.
function unfold(id) {
  const target = id && document.getElementById(id);
  if (!target) return;
  for (let fold = target.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
  target.scrollIntoView({ block: "start" });
}

function follow() {
  unfold(location.hash.slice(1));
  const link = new URLSearchParams(location.hash.slice(1));
  if (link.has("cell")) open(link.get("cell"));
  if (link.has("play")) show(link.get("play"), Number(link.get("frame") ?? 0));
}

// A box for each name; what is ticked is shown, and one at least is.
function ticks(title, names, ticked, show) {
  const choice = document.createElement("fieldset"), boxes = [];
  choice.append(Object.assign(document.createElement("legend"), { textContent: title }));
  names.forEach((name, k) => {
    const label = document.createElement("label"), box = document.createElement("input");
    Object.assign(box, { type: "checkbox", checked: ticked(k) });
    label.append(box, ` ${name}`);
    choice.append(label);
    boxes.push(box);
  });
  choice.addEventListener("change", (event) => {
    if (!boxes.some((box) => box.checked)) event.target.checked = true;
    show();
  });
  return { choice, boxes };
}

// Columns of the matrix by ticking: each engine has one in every group of figures. The table of the worst has its row,
// the player its panel. Groups that make too wide a table are not ticked at first.
const WIDE = 25, CROWDED = 6;
function columns(table) {
  const [groups, heads] = table.tHead.rows, count = groups.cells[1].colSpan, names = [...groups.cells].slice(1);
  const engines = [...heads.cells].slice(1, count + 1).map((head) => head.textContent);
  const worst = [...document.querySelectorAll(".worst tbody tr")];
  table.classList.toggle("crowded", count > CROWDED);
  const show = () => {
    const shown = columned.boxes.map((box) => box.checked), kinds = figures.boxes.map((box) => box.checked);
    for (const row of [heads, ...table.tBodies[0].rows])
      [...row.cells].slice(1).forEach((cell, k) => (cell.hidden = !shown[k % count] || !kinds[Math.floor(k / count)]));
    names.forEach((group, k) => Object.assign(group, { hidden: !kinds[k], colSpan: shown.filter(Boolean).length }));
    worst.forEach((row, k) => (row.hidden = !shown[k]));
    const names_of = (on) => engines.filter((_, k) => shown[k] === on).map((name) => name.split(" ")[0]);
    window.touchstone.hidden = new Set(names_of(false).filter((name) => !names_of(true).includes(name)));
    window.touchstone.player?.choose();
  };
  const columned = ticks("Engines", engines, () => true, show);
  const figures = ticks("Figures", names.map((group) => group.textContent), (k) => !k || (k + 1) * count <= WIDE, show);
  const bar = pick(".choice");
  if (count > 1) bar.append(columned.choice);
  bar.append(figures.choice);
  show();
}

// Rows by the figures of a column, the largest first, and back: a head is a button. "16/18" counts as 2.
function sorts(table) {
  const body = table.tBodies[0], first = [...body.rows];
  const figure = (row, k) => {
    const text = row.cells[k].querySelector(".value")?.textContent ?? "";
    const [met, of] = text.split("/").map(Number);
    const found = of === undefined ? parseFloat(text.replace("<", "")) : of - met;
    return Number.isNaN(found) ? -Infinity : found;
  };
  [...[...table.tHead.rows].at(-1).cells].forEach((head, k) => {
    if (!k) return;
    Object.assign(head, { tabIndex: 0, title: `${head.title} sorts by this column`.trim() });
    const sort = () => {
      const back = head.ariaSort === "descending";
      table.querySelectorAll("[aria-sort]").forEach((other) => other.removeAttribute("aria-sort"));
      if (!back) head.ariaSort = "descending";
      body.append(...(back ? first : [...first].sort((a, b) => figure(b, k) - figure(a, k) || 0)));
    };
    head.addEventListener("click", sort);
    head.addEventListener("keydown", (event) => event.key === "Enter" && sort());
  });
}

function matrix(table) {
  if (table.tHead.rows.length > 1) columns(table);
  sorts(table);
  table.querySelectorAll("tbody button").forEach((cell, k) => (cell.tabIndex = k ? -1 : 0));
  table.addEventListener("click", (event) => {
    const cell = event.target.closest("button[data-cell]");
    if (cell) open(cell.dataset.cell);
  });
  table.addEventListener("keydown", (event) => {
    const cells = [...table.querySelectorAll("tbody tr:not([hidden]) td:not([hidden]) button")];
    const at = cells.indexOf(document.activeElement);
    const row = document.activeElement.closest("tr");
    if (at < 0 || !row) return;
    const wide = row.querySelectorAll("td:not([hidden]) button").length;
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, ArrowDown: at + wide, ArrowUp: at - wide }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    const next = cells[Math.min(cells.length - 1, Math.max(0, to))];
    cells[at].tabIndex = -1;
    next.tabIndex = 0;
    next.focus();
  });
}

// Vega writes what a mark shows into its label; a hover shows it to everybody.
function tips() {
  const tip = pick("#tip");
  document.addEventListener("pointermove", (event) => {
    const mark = event.target.closest?.(".chart [aria-label][role='graphics-symbol']");
    tip.hidden = !mark;
    if (!mark) return;
    tip.textContent = mark.getAttribute("aria-label").replaceAll("; ", "\n");
    tip.style.left = `${Math.min(event.clientX + 14, innerWidth - tip.offsetWidth - 8)}px`;
    tip.style.top = `${event.clientY + 16}px`;
  });
}

window.touchstone = {};
window.addEventListener("hashchange", follow);
document.addEventListener("click", (event) => {
  const link = event.target.closest?.("a[href^='#']");
  if (link && link.hash === location.hash) unfold(link.hash.slice(1));
});
document.querySelectorAll("table.matrix").forEach(matrix);
pick("[name=scheme]").addEventListener("change", (event) => paint(event.target.value));
document.querySelectorAll("[name=shown]").forEach((choice) =>
  choice.addEventListener("change", () => (document.body.dataset.shown = choice.value)));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => window.touchstone.player?.theme());
tips();
for (const button of document.querySelectorAll("[data-play]")) button.addEventListener("click", () => show(button.dataset.play, 0));
const first = Object.keys(scenes)[0];
const ready = () => {
  if (first) {
    const player = new Player(pick("#playback"), scenes, data.colors);
    window.touchstone.player = player;
    pick("[name=scene]").addEventListener("change", (event) => player.open(event.target.value, 0));
    if (!location.hash.includes("play=")) player.open(first, 0);
  }
  follow();
};
requestAnimationFrame(() => setTimeout(ready, 0));
