// Tells the values of a map's cell under the pointer, a finger or the keyboard, as they stand in the table of all cases.
"use strict";
(() => {
  const table = document.getElementById("all-cases");
  if (!table) return;
  const names = [...table.tHead.rows[0].cells].map((cell) => cell.textContent);
  const told = document.body.appendChild(document.createElement("output"));
  told.id = "told";
  told.hidden = true;
  const spots = [];
  let shown = null; // the cell that is told of: its spot, row and column
  let kept = null; // the cell that keyboard, click or finger chose

  function add(parent, tag, text, kind) {
    const made = parent.appendChild(document.createElement(tag));
    if (text) made.textContent = text;
    if (kind) made.className = kind;
    return made;
  }

  function tell(row) {
    told.replaceChildren();
    add(told, "strong", row.cells[0].textContent);
    const list = add(told, "dl");
    names.forEach((name, k) => {
      const text = row.cells[k].textContent;
      if (!k || text === "–" || !text) return;
      add(list, "dt", name);
      add(list, "dd", text, text.length > 24 ? "long" : "");
    });
  }

  function mark(spot, at) {
    spot.cell.hidden = !at;
    if (!at) return;
    const [i, j] = at;
    const box = { left: spot.x[j], top: spot.y[i], width: spot.x[j + 1] - spot.x[j], height: spot.y[i + 1] - spot.y[i] };
    for (const key in box) spot.cell.style[key] = `${100 * box[key]}%`;
  }

  function place() {
    if (!shown) return;
    const cell = shown.spot.cell.getBoundingClientRect();
    const { width, height } = told.getBoundingClientRect();
    const right = cell.right + 12;
    const left = right + width < innerWidth ? right : Math.max(4, cell.left - width - 12);
    told.style.left = `${left}px`;
    told.style.top = `${Math.min(Math.max(4, cell.top - 8), innerHeight - height - 4)}px`;
  }

  function show(spot, at) {
    shown = at && { spot, at };
    const number = at && spot.cases[at[0]][at[1]];
    const row = at && document.getElementById(`case-${number}`);
    for (const each of spots) mark(each, row ? each.where.get(number) : null);
    told.hidden = !row;
    if (!row) return;
    tell(row);
    place();
  }

  const between = (edges, value) => {
    const k = edges.findIndex((edge, i) => i && value < edge) - 1;
    return k < 0 ? edges.length - 2 : k;
  };

  function under(spot, event) {
    const box = spot.frame.getBoundingClientRect();
    return [between(spot.y, (event.clientY - box.top) / box.height), between(spot.x, (event.clientX - box.left) / box.width)];
  }

  function keep(spot, at) {
    kept = { spot, at };
    show(spot, at);
  }

  const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };

  function key(spot, event) {
    if (event.key === "Escape") return spot.area.blur();
    const last = [spot.cases.length - 1, spot.cases[0].length - 1];
    const [i, j] = kept ? kept.at : [0, 0];
    const ends = { Home: [i, 0], End: [i, last[1]] };
    const step = steps[event.key];
    if (!step && !ends[event.key]) return;
    event.preventDefault();
    const to = ends[event.key] || [i + step[0], j + step[1]];
    keep(spot, to.map((k, n) => Math.min(Math.max(k, 0), last[n])));
  }

  function add_spot(frame, spot) {
    spot.frame = frame;
    spot.where = new Map(spot.cases.flatMap((row, i) => row.map((number, j) => [number, [i, j]])));
    spot.area = add(frame, "div", "", "spot");
    spot.cell = add(frame, "div", "", "cell");
    spot.cell.hidden = true;
    const [left, top] = [spot.x[0], spot.y[0]];
    const size = { left, top, width: spot.x[spot.x.length - 1] - left, height: spot.y[spot.y.length - 1] - top };
    for (const name in size) spot.area.style[name] = `${100 * size[name]}%`;
    spot.area.tabIndex = 0;
    spot.area.setAttribute("role", "application");
    spot.area.setAttribute("aria-label", `${spot.label}: the arrow keys go from cell to cell and tell its values`);
    spot.area.addEventListener("pointermove", (event) => event.pointerType === "mouse" && show(spot, under(spot, event)));
    spot.area.addEventListener("pointerdown", (event) => keep(spot, under(spot, event)));
    spot.area.addEventListener("pointerleave", (event) => {
      if (event.pointerType === "mouse") kept ? show(kept.spot, kept.at) : show(spot, null);
    });
    spot.area.addEventListener("keydown", (event) => key(spot, event));
    spot.area.addEventListener("focus", () => {
      if (!kept || kept.spot !== spot) keep(spot, spot.where.get(best) || [0, 0]);
    });
    spot.area.addEventListener("blur", () => {
      kept = null;
      show(spot, null);
    });
    spots.push(spot);
  }

  const best = Number(table.dataset.best);
  for (const frame of document.querySelectorAll("[data-spots]")) {
    for (const spot of JSON.parse(frame.dataset.spots)) add_spot(frame, spot);
  }
  addEventListener("scroll", place, { passive: true, capture: true });
  addEventListener("resize", place);
})();
