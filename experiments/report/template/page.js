"use strict";
// Fills the figures with what the reader chose, sorts and filters the leaderboard, and keeps to light or dark.

const told = JSON.parse(document.getElementById("told").textContent);
const WORST = "each model's worst case";
const plots = {}; // by the name of their section

const values = (list, pick) => pick.map((i) => list[i]);
const each = (selector, act) => document.querySelectorAll(selector).forEach(act);
const section = (name) => document.getElementById(name);
const source = (name, part) => plots[name].document.get_model_by_name(part);
const ranked = Object.keys(told.looks);

function chosenModels() {
  return new Set([...document.querySelectorAll("#models input:checked")].map((box) => box.value));
}

// Places of the rows of a table that the controls of its section let through.
function shown(name) {
  const table = told.tables[name];
  const models = name === "heatmap" ? new Set(ranked) : chosenModels();
  const asked = [...section(name).querySelectorAll("select")].map((select) => [select.dataset.column, select.value]);
  return table.model
    .map((_, i) => i)
    .filter((i) => models.has(table.model[i]))
    .filter((i) => asked.every(([column, value]) => (value === WORST ? table.worst[i] : table[column][i] === value)));
}

const look = (models) => ({
  colour: models.map((model) => told.looks[model].colour),
  dash: models.map((model) => told.looks[model].dash),
  mark: models.map((model) => told.looks[model].mark),
});

function picked(name) {
  const pick = shown(name);
  return Object.fromEntries(Object.entries(told.tables[name]).map(([column, list]) => [column, values(list, pick)]));
}

const fill = {
  heatmap(rows) {
    const plot = plots.heatmap;
    const attacks = [...new Set(rows.attack)];
    plot.x_range.factors = attacks;
    plot.y_range.factors = ranked.filter((model) => rows.model.includes(model)).reverse();
    section("heatmap").querySelector(".figure").style.minWidth = `${220 + 24 * attacks.length}px`;
    const least = Math.min(...told.tables.heatmap.utility.filter((x) => x !== null));
    const mark = rows.worst.map((worst) => (worst ? "●" : ""));
    const ink = rows.utility.map((x) => (x - least < 0.5 * (1 - least) ? "#ffffff" : "#000000"));
    source("heatmap", "cells").data = { ...rows, mark, ink };
  },
  curves(rows) {
    const { colour, dash } = look(rows.model);
    const { model, attack } = rows;
    source("curves", "lines").data = { xs: rows.rounds, ys: rows.utility, model, attack, colour, dash };
  },
  breakdown(rows) {
    const models = [...new Set(rows.model)];
    const of = (model, column) => rows[column].filter((_, i) => rows.model[i] === model);
    const { colour, dash } = look(models);
    source("breakdown", "lines").data = {
      xs: models.map((model) => of(model, "share")),
      ys: models.map((model) => of(model, "utility")),
      model: models, colour, dash,
    };
    const ends = (sign) => rows.utility.map((x, i) => x + sign * (rows.utility_half_95[i] ?? 0));
    const { mark } = look(rows.model);
    source("breakdown", "points").data = {
      ...rows, low: ends(-1), high: ends(1), colour: look(rows.model).colour, mark,
    };
  },
  tradeoff(rows) {
    const { colour, mark } = look(rows.model);
    source("tradeoff", "points").data = { ...rows, colour, mark };
  },
};

function refresh(name) {
  const rows = picked(name);
  fill[name](rows);
  const details = section(name).querySelector(".numbers");
  if (details.open) write(details.querySelector("div"), rows);
}

// The numbers behind a figure, for those who do not see it or want them.
function write(place, rows) {
  const columns = Object.keys(rows);
  const table = document.createElement("table");
  const line = (parent, kind, texts) => {
    const row = parent.insertRow();
    texts.forEach((value) => {
      const cell = document.createElement(kind);
      const flat = Array.isArray(value) ? value.map((x) => x ?? "–").join(" ") : value;
      cell.textContent = flat === null ? "–" : flat === true ? "yes" : flat === false ? "" : flat;
      if (typeof value === "string") cell.className = "text";
      row.append(cell);
    });
  };
  line(table.createTHead(), "th", columns);
  const body = table.createTBody();
  (rows.model ?? []).forEach((_, i) => line(body, "td", columns.map((column) => rows[column][i])));
  place.replaceChildren(table);
}

// The attacks that are there in the chosen condition; the choice stays if it can.
function offerAttacks() {
  const [condition, attack] = section("curves").querySelectorAll("select");
  const table = told.tables.curves;
  const there = new Set(table.attack.filter((_, i) => table.condition[i] === condition.value));
  const before = attack.value;
  attack.replaceChildren(...[WORST, ...[...there].sort()].map((name) => new Option(name, name)));
  attack.value = before === WORST || there.has(before) ? before : WORST;
}

function paint() {
  const style = getComputedStyle(document.documentElement);
  const [ink, quiet, line] = ["--ink", "--quiet", "--line"].map((name) => style.getPropertyValue(name).trim());
  for (const plot of Object.values(plots)) {
    plot.setv({ background_fill_color: null, border_fill_color: null });
    for (const part of [...plot.left, ...plot.right, ...plot.above, ...plot.below]) {
      if (part.type === "ColorBar") {
        part.setv({ title_text_color: ink, major_label_text_color: ink, bar_line_color: null });
      } else if (part.type.endsWith("Axis")) {
        part.setv({
          axis_label_text_color: ink, major_label_text_color: ink, axis_line_color: quiet,
          major_tick_line_color: quiet, minor_tick_line_color: null, axis_label_text_font_style: "normal",
          major_label_text_font_size: "13px", axis_label_text_font_size: "14px",
        });
      }
    }
    for (const grid of plot.center) if (grid.type === "Grid") grid.grid_line_color = line;
  }
}

function sortBoard(heading) {
  const place = heading.cellIndex;
  const down = heading.ariaSort === "ascending" || (heading.ariaSort === "none" && place > 1);
  each("#board thead th", (other) => other.setAttribute("aria-sort", "none"));
  heading.setAttribute("aria-sort", down ? "descending" : "ascending");
  const key = (row) => {
    const cell = row.cells[place];
    return cell.dataset.value === undefined ? cell.textContent : Number(cell.dataset.value);
  };
  const compare = (a, b) => {
    if (typeof a === "string") return down ? b.localeCompare(a) : a.localeCompare(b);
    if (Number.isNaN(a) || Number.isNaN(b)) return Number.isNaN(a) - Number.isNaN(b); // what is undefined is last
    return down ? b - a : a - b;
  };
  const body = document.querySelector("#board tbody");
  body.append(...[...body.rows].sort((a, b) => compare(key(a), key(b))));
}

function filterBoard() {
  const words = section("filter").value.toLowerCase();
  const rows = [...document.querySelectorAll("#board tbody tr")];
  rows.forEach((row) => { row.hidden = !row.dataset.model.toLowerCase().includes(words); });
  section("found").value = words ? `${rows.filter((row) => !row.hidden).length} of ${rows.length} models` : "";
}

async function start() {
  offerAttacks();
  for (const [name, item] of Object.entries(told.figures)) {
    const views = await Bokeh.embed.embed_item(item, section(name).querySelector(".figure"));
    plots[name] = [...views][0].model;
    refresh(name);
    section(name).addEventListener("change", () => refresh(name));
    section(name).querySelector(".numbers").addEventListener("toggle", () => refresh(name));
  }
  paint();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
  const below = Object.keys(plots).filter((name) => name !== "heatmap");
  section("models").addEventListener("change", () => below.forEach(refresh));
  each("[data-choose]", (button) => button.addEventListener("click", () => {
    each("#models input", (box, i) => { box.checked = i < Number(button.dataset.choose); });
    below.forEach(refresh);
  }));
  document.documentElement.dataset.ready = "yes";
}

section("curves").querySelector("select").addEventListener("change", offerAttacks);
section("filter").addEventListener("input", filterBoard);
each("#board thead th", (heading) => heading.querySelector("button").addEventListener("click", () => sortBoard(heading)));
start();
