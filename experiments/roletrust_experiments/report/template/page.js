"use strict";
// Sort the tables and filter the leaderboard.

const each = (selector, act) => document.querySelectorAll(selector).forEach(act);
const section = (name) => document.getElementById(name);

function sortTable(heading) {
  const place = heading.cellIndex;
  const table = heading.closest("table");
  const name = table.querySelector("tbody th").cellIndex; // numbers behind the name begin with the largest
  const down = heading.ariaSort === "ascending" || (heading.ariaSort === "none" && place > name);
  table.querySelectorAll("thead th").forEach((other) => other.setAttribute("aria-sort", "none"));
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
  const body = table.tBodies[0];
  body.append(...[...body.rows].sort((a, b) => compare(key(a), key(b))));
}

function filterBoard() {
  const words = section("filter").value.toLowerCase();
  const rows = [...document.querySelectorAll(".models tbody tr")];
  rows.forEach((row) => { row.hidden = !row.dataset.name.toLowerCase().includes(words); });
  section("found").value = words ? `${rows.filter((row) => !row.hidden).length} of ${rows.length} models` : "";
}

section("filter")?.addEventListener("input", filterBoard);
each(".board thead th", (heading) => heading.querySelector("button").addEventListener("click", () => sortTable(heading)));
