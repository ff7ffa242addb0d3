"use strict";
// Fills the figures with what the reader chose, and keeps to light or dark.

const told = JSON.parse(document.getElementById("told").textContent);
const WORST = "each model's worst case", ALL = "every attack";
const plots = {}; // by the name of their section

const values = (list, pick) => pick.map((i) => list[i]);
const each = (selector, act) => document.querySelectorAll(selector).forEach(act);
const section = (name) => document.getElementById(name);
const source = (name, part) => plots[name].document.get_model_by_name(part);
const who = (name) => (name === "learners" ? "learner" : "model");
const ranked = (name) => Object.keys(told.looks[who(name)]);
const chooser = (name) => document.querySelector(`.chooser[data-who=${who(name)}]`);

// A column whose values come again and again holds each of them once, and where it stands.
for (const table of Object.values(told.tables)) {
  for (const [column, list] of Object.entries(table)) if (!Array.isArray(list)) table[column] = values(list.values, list.at);
}

function chosen(name) {
  if (told.heat[name]) return new Set(ranked(name));
  return new Set([...chooser(name).querySelectorAll("input:checked")].map((box) => box.value));
}

// What the controls of a figure's section let through of its table, column by column.
function picked(name) {
  const table = told.tables[name];
  const names = chosen(name);
  const asked = [...section(name).querySelectorAll("select")].map((select) => [select.dataset.column, select.value]);
  const fits = ([column, value], i) => {
    if (value === "" && name === "curves") return table.condition[i] === told.worst[table.model[i]];
    if (value === WORST || value === "") return table.worst[i];
    return value === ALL || table[column][i] === value;
  };
  const pick = table[who(name)]
    .map((_, i) => i)
    .filter((i) => names.has(table[who(name)][i]) && asked.every((one) => fits(one, i)));
  return Object.fromEntries(Object.entries(table).map(([column, list]) => [column, values(list, pick)]));
}

function look(name, names) {
  const of = (part) => names.map((one) => told.looks[who(name)][one][part]);
  return { colour: of("colour"), dash: of("dash"), mark: of("mark") };
}

// One line for each name, through its rows.
function joined(name, rows, x, y) {
  const names = [...new Set(rows[who(name)])];
  const of = (one, column) => rows[column].filter((_, i) => rows[who(name)][i] === one);
  const { colour, dash } = look(name, names);
  return {
    xs: names.map((one) => of(one, x)), ys: names.map((one) => of(one, y)), [who(name)]: names, colour, dash,
  };
}

// The numbers in the cells of a heat map, light on dark and dark on light.
function numbers(name, rows) {
  const { column, lowest } = told.heat[name];
  return {
    text: rows[column].map((x) => (x === null ? "" : String(Math.round(100 * x)).replace("-", "\u2212"))),
    ink: rows[column].map((x) => (x - lowest < 0.5 * (1 - lowest) ? "#ffffff" : "#000000")),
  };
}

// Sets an axis to what is shown, with a margin; Reset returns there.
function fit(range, shown) {
  const there = shown.flat().filter((x) => x !== null && !Number.isNaN(x));
  if (!there.length) return;
  const [low, high] = [Math.min(...there), Math.max(...there)];
  const margin = Math.max(0.05 * (high - low), 0.01);
  const [start, end] = [low - margin, high + margin];
  range.setv({ start, end, reset_start: start, reset_end: end });
}

const fill = {
  heatmap(rows) {
    const plot = plots.heatmap;
    const overview = section("heatmap").querySelector("select").value === "";
    const column = overview ? rows.condition : rows.attack;
    const columns = [...new Set(column)];
    plot.x_range.factors = columns;
    plot.y_range.factors = ranked("heatmap").filter((model) => rows.model.includes(model)).reverse();
    section("heatmap").querySelector(".figure").style.minWidth = `${220 + 25 * columns.length}px`;
    const { text, ink } = numbers("heatmap", rows);
    const frame = rows.worst.map((worst, i) => (worst && !overview ? ink[i] : "#00000000"));
    source("heatmap", "cells").data = { ...rows, column, text, ink, frame };
  },
  worst_cases(rows) {
    const plot = plots.worst_cases;
    const percent = (share) => `${+(100 * share).toFixed(1)}%`;
    const shares = [...new Set(told.tables.worst_cases.share)].sort((a, b) => a - b);
    const row = rows.track.map((track, i) => `${rows.scenario[i]}, ${track}`);
    plot.x_range.factors = shares.map(percent);
    plot.y_range.factors = [...new Set(row)].reverse();
    source("worst_cases", "cells").data = { ...rows, column: rows.share.map(percent), row, ...numbers("worst_cases", rows) };
  },
  curves(rows) {
    const { colour, dash } = look("curves", rows.model);
    const { model, attack, condition } = rows;
    const all = section("curves").querySelector("[data-column=attack]").value === ALL;
    const wide = rows.worst.map((worst) => (!all ? 2.2 : worst ? 3.2 : 1));
    const strength = rows.worst.map((worst) => (!all || worst ? 1 : 0.4));
    const lines = { xs: rows.rounds, ys: rows.utility };
    source("curves", "lines").data = { ...lines, model, attack, condition, colour, dash, wide, strength };
    fit(plots.curves.x_range, lines.xs);
    fit(plots.curves.y_range, lines.ys);
  },
  breakdown(rows) {
    source("breakdown", "lines").data = joined("breakdown", rows, "share", "score");
    const ends = (sign) => rows.score.map((x, i) => x + sign * (rows.score_half_95[i] ?? 0));
    const { colour, mark } = look("breakdown", rows.model);
    const [low, high] = [ends(-1), ends(1)];
    source("breakdown", "points").data = { ...rows, low, high, colour, mark };
    fit(plots.breakdown.x_range, rows.share);
    fit(plots.breakdown.y_range, [...low, ...high]);
  },
  tradeoff(rows) {
    const { colour, mark } = look("tradeoff", rows.model);
    source("tradeoff", "points").data = { ...rows, size: rows.worst.map((worst) => (worst ? 15 : 7)), colour, mark };
    fit(plots.tradeoff.y_range, rows.damage);
  },
  learners(rows) {
    source("learners", "lines").data = joined("learners", rows, "budget", "share");
    const end = (column) => rows[column].map((x, i) => x ?? rows.share[i]);
    const { colour, mark } = look("learners", rows.learner);
    const [low, high] = [Math.min(...end("share_low_95"), 0), Math.max(...end("share_high_95"), 1)];
    fit(plots.learners.y_range, [Math.max(low, -0.5), high]); // far below honest is as bad
    source("learners", "points").data = { ...rows, low: end("share_low_95"), high: end("share_high_95"), colour, mark };
  },
};

// Whose line is whose, above the figure.
function writeLegend(name, names) {
  const there = new Set(names);
  const labels = [...chooser(name).querySelectorAll("label")];
  section(name).querySelector(".legend").replaceChildren(
    ...labels.filter((label) => there.has(label.querySelector("input").value)).map((label) => {
      const item = document.createElement("li");
      item.append(...[...label.children].slice(1).map((part) => part.cloneNode(true)));
      return item;
    }),
  );
}

function refresh(name) {
  const rows = picked(name);
  fill[name](rows);
  if (!told.heat[name]) writeLegend(name, rows[who(name)]);
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
  Object.values(rows)[0].forEach((_, i) => line(body, "td", columns.map((column) => rows[column][i])));
  place.replaceChildren(table);
}

// The attacks that are there in the chosen condition; the choice stays if it can.
function offerAttacks() {
  const [condition, attack] = section("curves").querySelectorAll("select");
  const table = told.tables.curves;
  const there = new Set(table.attack.filter((_, i) => table.condition[i] === condition.value));
  const before = attack.value;
  attack.replaceChildren(...[WORST, ALL, ...[...there].sort()].map((name) => new Option(name, name)));
  attack.value = before === ALL || there.has(before) ? before : WORST;
}

function paint() {
  const style = getComputedStyle(document.documentElement);
  const [ink, quiet, line] = ["--ink", "--quiet", "--line"].map((name) => style.getPropertyValue(name).trim());
  for (const plot of Object.values(plots)) {
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

async function start() {
  if (told.figures.curves) {
    offerAttacks();
    section("curves").querySelector("select").addEventListener("change", offerAttacks);
  }
  for (const [name, item] of Object.entries(told.figures)) {
    const views = await Bokeh.embed.embed_item(item, section(name).querySelector(".figure"));
    plots[name] = [...views][0].model;
    refresh(name);
    section(name).addEventListener("change", () => refresh(name));
    section(name).querySelector(".numbers").addEventListener("toggle", () => refresh(name));
  }
  paint();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
  each(".chooser", (place) => {
    const mine = Object.keys(plots).filter((name) => !told.heat[name] && who(name) === place.dataset.who);
    place.addEventListener("change", () => mine.forEach(refresh));
    place.querySelectorAll("[data-choose]").forEach((button) => button.addEventListener("click", () => {
      place.querySelectorAll("input").forEach((box, i) => { box.checked = i < Number(button.dataset.choose); });
      mine.forEach(refresh);
    }));
  });
  document.documentElement.dataset.ready = "yes";
}

start();
