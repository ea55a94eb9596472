"use strict";
// Tables sort by a click on their heading; series of a figure switch off; a link or a print opens what is folded.
(function () {
  function key(cell) {
    const raw = cell.dataset.sort !== undefined ? cell.dataset.sort : cell.textContent.trim();
    const number = Number(raw);
    return raw !== "" && Number.isFinite(number) ? number : raw.toLowerCase();
  }

  function compare(a, b) {
    if (typeof a === "number" && typeof b === "number") return a - b;
    if (a === "" || b === "") return (a === "") - (b === ""); // empty cells go last
    if (typeof a !== typeof b) return typeof a === "number" ? -1 : 1;
    return a.localeCompare(b, "en");
  }

  document.querySelectorAll("table.sortable").forEach(function (table) {
    const body = table.tBodies[0];
    if (body.rows.length < 2) return;
    const original = Array.from(body.rows);
    Array.from(table.tHead.rows[0].cells).forEach(function (heading, column) {
      const button = document.createElement("button");
      button.type = "button";
      while (heading.firstChild) button.appendChild(heading.firstChild);
      heading.appendChild(button);
      button.addEventListener("click", function () {
        const state = heading.getAttribute("aria-sort");
        const next = state === "ascending" ? "descending" : state === "descending" ? null : "ascending";
        table.querySelectorAll("th[aria-sort]").forEach(function (other) { other.removeAttribute("aria-sort"); });
        let rows = original;
        if (next) {
          heading.setAttribute("aria-sort", next);
          const sign = next === "ascending" ? 1 : -1;
          rows = original.slice().sort(function (first, second) {
            const a = key(first.cells[column]), b = key(second.cells[column]);
            return a === "" || b === "" ? compare(a, b) : sign * compare(a, b);
          });
        }
        rows.forEach(function (row) { body.appendChild(row); });
      });
    });
  });

  document.querySelectorAll("figure.drawing .switches").forEach(function (bar) {
    const figure = bar.closest("figure");
    bar.hidden = false;
    bar.addEventListener("click", function (event) {
      const button = event.target.closest("button");
      if (!button) return;
      const shown = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", String(shown));
      figure.querySelectorAll('[id*="series--' + button.dataset.series + '--"]').forEach(function (part) {
        part.style.display = shown ? "" : "none";
      });
    });
  });

  function reveal() {
    const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (let part = target && target.parentElement; part; part = part.parentElement) {
      if (part.tagName === "DETAILS") part.open = true;
    }
    if (target) target.querySelectorAll(":scope > details.long").forEach(function (part) { part.open = true; });
  }
  window.addEventListener("hashchange", reveal);
  reveal();

  function reach() {  // what can be scrolled is reached by the keyboard
    document.querySelectorAll(".canvas").forEach(function (part) {
      if (part.scrollWidth > part.clientWidth) part.tabIndex = 0; else part.removeAttribute("tabindex");
    });
  }
  window.addEventListener("resize", reach);
  reach();

  window.addEventListener("beforeprint", function () {
    document.querySelectorAll("details.alt, details.long").forEach(function (part) { part.open = true; });
  });
})();
