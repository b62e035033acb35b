"use strict";
// A click on the head of a column sorts the objects by it: numbers from the largest, texts from A; again: the other way.
for (const table of document.querySelectorAll("table.objects")) {
  const body = table.tBodies[0];
  table.querySelectorAll("thead button").forEach((button, k) => button.addEventListener("click", () => {
    const head = button.parentElement, down = head.getAttribute("aria-sort") !== "descending";
    table.querySelectorAll("th").forEach((th) => th.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const value = (row) => row.cells[k + 1].dataset.value, number = head.className === "n";
    const rows = [...body.rows].sort((a, b) => {
      const [u, v] = [value(a), value(b)];
      if (number && (u === "" || v === "")) return (u === "") - (v === "");  // what has no value comes last either way
      return (number ? v - u : u.localeCompare(v)) * (down ? 1 : -1);
    });
    body.append(...rows);
  }));
}
