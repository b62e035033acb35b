"use strict";
// Draws every figure of the page when a reader comes near it; a figure with "object3d" in its meta gets controls.
const CONFIG = {responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d"]};
const drawn = (div) => {
  if (div.dataset.drawn) return null;
  div.dataset.drawn = "yes";
  const figure = JSON.parse(div.querySelector("script").textContent);
  return Plotly.newPlot(div, figure.data, figure.layout, CONFIG)
    .then(() => figure.layout.meta && figure.layout.meta.object3d && object3d(div, figure.layout.meta.object3d));
};
const near = new IntersectionObserver((seen) => seen.filter((s) => s.isIntersecting).forEach((s) => drawn(s.target)),
  {rootMargin: "600px"});
const plots = [...document.querySelectorAll(".plot")];
plots.forEach((div) => near.observe(div));
addEventListener("beforeprint", () => plots.forEach(drawn));

function object3d(div, all) {
  const bytes = (s) => Uint8Array.from(atob(s), (c) => c.charCodeAt(0)).buffer;
  const floats = (s) => new Float32Array(bytes(s || "")), whole = (s) => new Int32Array(bytes(s || ""));
  const part = (a, k, n = 3) => a.filter((_, i) => i % n === k);
  const [points, corners, owner] = [floats(all.points), whole(all.triangles), whole(all.owner)];
  const [around, along] = [floats(all.around), floats(all.along)];
  const at = {...all.start};
  const quantity = () => all.quantities.find((q) => q.name === at.quantity);

  // where the wall of a case puts the points: bilinear between the places of the file's grid, which closes round the axis
  function moved(one) {
    if (!one || !one.wall || !around.length) return points;
    const u = floats(one.wall), [m, n] = all.grid, found = points.slice();
    for (let p = 0; p < owner.length; p++) {
      if (around[p] < -1e8) continue;
      const a = around[p] - one.angle * m / (2 * Math.PI), i = Math.floor(a), j = Math.min(Math.floor(along[p]), n - 2);
      const s = a - i, t = along[p] - j, of = (k, l, c) => u[3 * (((k % m) + m) % m * n + l) + c];
      for (let c = 0; c < 3; c++) found[3 * p + c] += (1 - s) * ((1 - t) * of(i, j, c) + t * of(i, j + 1, c))
        + s * ((1 - t) * of(i + 1, j, c) + t * of(i + 1, j + 1, c));
    }
    return found;
  }

  const state = (c) => all.states[at.force][c];

  function tooltip(c) {
    if (c < 0) return "no candidate";
    const q = quantity(), v = q && q.values[at.force][c], key = `${at.force} ${c}`;
    return `${all.names[c]}<br>` + (v == null ? "" : `${q.label}: ${+v.toPrecision(4)}<br>`) + (all.notes[key] || "");
  }

  function segments(s) {  // pairs of points as one broken line
    const a = floats(s), found = [[], [], []];
    for (let k = 0; k < a.length; k += 6) for (let c = 0; c < 3; c++) found[c].push(a[k + c], a[k + 3 + c], null);
    return {x: found[0], y: found[1], z: found[2]};
  }

  function surface(place) {
    const q = quantity(), shown = [[], [], [], []], rest = [[], [], [], []];
    for (let t = 0; t < corners.length; t += 3) {
      const c = owner[corners[t]], v = c < 0 || !q ? null : q.values[at.force][c], into = v == null ? rest : shown;
      for (let k = 0; k < 3; k++) into[k].push(corners[t + k]);
      into[3].push(v == null ? all.colours[[1, 0, 2][state(c)] ?? 0] : v);
    }
    const names = Array.from(owner, tooltip), base = {x: part(place, 0), y: part(place, 1), z: part(place, 2), text: names};
    const [cmin, cmax] = q ? q.limits[at.force] : [], scale = q ? {cmin, cmax, colorscale: q.scale} : {}, [one, other] = div.data;
    Object.assign(one, base, {i: shown[0], j: shown[1], k: shown[2], intensity: shown[3], visible: shown[3].length > 0}, scale);
    Object.assign(other, base, {i: rest[0], j: rest[1], k: rest[2], facecolor: rest[3], visible: rest[3].length > 0});
    one.colorbar = {...one.colorbar, title: {text: q ? q.label : "", side: "right"}};
  }

  function contact(one) {
    const [pressed, blocks, lines, arrows, tips] = div.data.slice(2), limit = div.data.find((t) => t.type === "surface");
    const quads = (s) => {
      const a = Float32Array.from(new Int16Array(bytes(s || "")), (v) => v * one.step), i = [], j = [], k = [];
      for (let f = 0; f < a.length / 3; f += 4) { i.push(f, f); j.push(f + 1, f + 2); k.push(f + 2, f + 3); }
      return {x: part(a, 0), y: part(a, 1), z: part(a, 2), i, j, k, visible: a.length > 0};
    };
    const p = floats(one && one.pressure), value = [];
    p.forEach((v) => value.push(v, v));
    Object.assign(pressed, quads(one && one.faces), {intensity: value, cmin: 0, cmax: p.reduce((m, v) => Math.max(m, v), 0)});
    Object.assign(blocks, quads(one && one.sides));
    Object.assign(lines, segments(one && one.lines));
    Object.assign(arrows, segments(one && one.arrows));
    const ends = (v) => v.filter((_, n) => n % 3 === 1);
    Object.assign(tips, {x: ends(arrows.x), y: ends(arrows.y), z: ends(arrows.z)});
    if (!limit) return;
    const s = floats(one && one.limit), wide = one && one.limit ? s.length / 3 / one.rows : 0;
    const rows = (c) => Array.from({length: wide ? one.rows : 0}, (_, r) => part(s.slice(3 * r * wide, 3 * (r + 1) * wide), c));
    Object.assign(limit, {x: rows(0), y: rows(1), z: rows(2), visible: wide > 0});
  }

  function paint() {
    const key = `${at.force} ${at.candidate}`, one = all.cases[key];
    surface(moved(one));
    contact(one);
    said.textContent = all.words[key].join(" · ")
      + (one || all.states[at.force][at.candidate] !== 1 ? "" : " · its pads are not in this page: softjaw view shows them");
    newtons.textContent = `${all.forces[at.force]} N`;
    return Plotly.react(div, div.data, div.layout, CONFIG);
  }

  const make = (tag, into, more = {}) => into.appendChild(Object.assign(document.createElement(tag), more));
  const controls = document.createElement("div");
  controls.className = "controls";
  const choice = make("select", make("label", controls, {textContent: "quantity "}));
  for (const q of all.quantities) make("option", choice, {value: q.name, textContent: q.title, selected: q.name === at.quantity});
  const slid = make("label", controls, {textContent: "normal force "});
  const force = make("input", slid, {type: "range", min: 0, max: all.forces.length - 1, value: at.force});
  const newtons = make("output", slid), said = make("p", controls, {className: "note", ariaLive: "polite"});
  div.closest("figure").prepend(controls);
  choice.addEventListener("change", () => { at.quantity = choice.value; paint(); });
  force.addEventListener("input", () => { at.force = +force.value; paint(); });
  div.on("plotly_click", (event) => {
    const p = event.points[0], of = owner[p.pointNumber];
    if (p.curveNumber < 2 && of >= 0) { at.candidate = of; paint(); }
  });
  // the bars at the left keep clear of the object on a narrow screen, too
  const {domain} = div.layout.scene, high = domain && domain.x ? domain.x[1] : 1;
  div.layout.scene.domain = {...domain, x: [Math.min(0.3 * high, 95 / div.clientWidth), high]};
  return paint();
}
