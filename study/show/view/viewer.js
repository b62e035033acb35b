"use strict";
// Draws what study/view/page.py tells: one case at a time, chosen by force and candidate. Lengths in mm.
const told = JSON.parse(document.getElementById("data").textContent);
const get = (id) => document.getElementById(id);
const state = { ...told.start, yaw: 0.6, pitch: 0.35, zoom: 1 };

// --- arrays ----------------------------------------------------------------------------------------------------------

const cache = new Map();
function unpack(number, Kind) {
  if (!cache.has(number)) {
    const text = atob(told.packs[number]);
    const bytes = Uint8Array.from(text, (c) => c.charCodeAt(0));
    cache.set(number, new Kind(bytes.buffer));
  }
  return cache.get(number);
}
const scaled = (packed) => Float32Array.from(unpack(packed.pack, Int16Array), (v) => v * packed.step);
const surface = {
  x: unpack(told.surface.x, Float32Array),
  normal: Float32Array.from(unpack(told.surface.normal, Int8Array), (v) => v / 127),
  cell: unpack(told.surface.cell, Int32Array),
};

const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const size = (a) => Math.hypot(a[0], a[1], a[2]);
const unit = (a) => scale(a, 1 / (size(a) || 1));

// --- colours ---------------------------------------------------------------------------------------------------------

const hex = (text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16) / 255);
function colour(stops, share) {
  const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
  const k = Math.min(Math.floor(at), stops.length - 2);
  return stops[k].map((v, i) => (v + (at - k) * (stops[k + 1][i] - v)) / 255);
}
const gradient = (stops) => `linear-gradient(to right, ${stops.map((s) => `rgb(${s.join(",")})`).join(",")})`;
const number = (v) => (v === null || v === undefined || !isFinite(v) ? "–" : String(Number(Number(v).toPrecision(3))));
const quantity = () => told.quantities.find((q) => q.name === state.quantity);

function cellColours() {
  const map = quantity();
  return told.candidates.map((_, c) => {
    const status = told.state[state.force][c];
    if (status !== 1) return hex(status === 2 ? told.colours.failed : told.colours.open);
    const value = map ? map.values[state.force][c] : null;
    return value === null ? hex(told.colours.none) : colour(map.stops, (value - map.low) / (map.high - map.low));
  });
}

// --- what a case shows -----------------------------------------------------------------------------------------------

const here = () => told.cases[`${state.force} ${state.candidate}`] || {};

function places() {
  const wall = here().wall;
  if (!wall || told.surface.around === undefined) return surface.x;
  const rows = 48, columns = scaled(wall).length / 3 / rows, u = scaled(wall), x = surface.x.slice();
  const around = unpack(told.surface.around, Float32Array), along = unpack(told.surface.along, Float32Array);
  for (let n = 0; n < around.length; n++) {
    if (around[n] < 0) continue; // not on the wall
    const a = around[n] - (wall.angle * rows) / (2 * Math.PI), s = along[n];
    const i = Math.floor(a), j = Math.min(Math.floor(s), columns - 2), p = a - i, q = s - j;
    const one = ((i % rows) + rows) % rows, two = (one + 1) % rows;
    for (let k = 0; k < 3; k++) {
      const v = (r, c) => u[3 * (r * columns + c) + k];
      x[3 * n + k] += (1 - p) * ((1 - q) * v(one, j) + q * v(one, j + 1)) + p * ((1 - q) * v(two, j) + q * v(two, j + 1));
    }
  }
  return x;
}

class Soup { // loose triangles or segments: positions, normals, colours
  constructor() { this.x = []; this.n = []; this.c = []; }
  put(x, n, c) { this.x.push(...x); this.n.push(...n); this.c.push(...c); }
  flat(points, c, n = [0, 0, 0]) { for (const p of points) this.put(p, n, c); }
}

function padPoints(pad) {
  const R = pad.rotation, o = pad.position, local = scaled(pad.front), back = pad.back, found = [];
  const placed = (a, k) => [0, 1, 2].map((i) => R[3 * i] * a[k] + R[3 * i + 1] * a[k + 1] + R[3 * i + 2] * a[k + 2] + o[i]);
  for (let k = 0; k < local.length; k += 3) found.push(placed(local, k));
  return { front: found, back: [0, 3, 6, 9].map((k) => placed(back, k)) };
}

function drawPads(solid, glass, lines) {
  const both = here().pads || [], pressures = both.map((p) => (p.pressure ? scaled(p.pressure) : []));
  const top = Math.max(0, ...pressures.map((p) => p.reduce((a, b) => Math.max(a, b), 0)));
  both.forEach((pad, finger) => {
    const [rows, columns] = pad.grid, { front, back } = padPoints(pad);
    const approach = [2, 5, 8].map((k) => pad.rotation[k]), at = (i, j) => front[i * columns + j];
    const grey = hex(told.colours.pad), rim = [];
    for (let i = 0; i < rows - 1; i++) rim.push(at(i, 0));
    for (let j = 0; j < columns - 1; j++) rim.push(at(rows - 1, j));
    for (let i = rows - 1; i > 0; i--) rim.push(at(i, columns - 1));
    for (let j = columns - 1; j > 0; j--) rim.push(at(0, j));
    const counts = [rows - 1, columns - 1, rows - 1, columns - 1], behind = [];
    counts.forEach((n, k) => { for (let m = 0; m < n; m++) behind.push(add(back[k], add(back[(k + 1) % 4], back[k], -1), m / n)); });
    rim.forEach((p, k) => {
      const next = (k + 1) % rim.length, q = rim[next], r = behind[next], s = behind[k];
      glass.flat([p, q, r, p, r, s], grey);
      lines.flat([p, q], grey);
    });
    glass.flat([back[0], back[1], back[2], back[0], back[2], back[3]], grey);
    const corners = [at(0, 0), at(rows - 1, 0), at(rows - 1, columns - 1), at(0, columns - 1)];
    for (let k = 0; k < 4; k++) { lines.flat([back[k], back[(k + 1) % 4]], grey); lines.flat([corners[k], back[k]], grey); }
    if (top > 0 && pad.pressure) drawFront(solid, pad, pressures[finger], top, at, approach);
  });
  return top;
}

function drawFront(solid, pad, pressure, top, at, approach) {
  const [rows, columns] = pad.grid, step = Math.ceil(Math.max(rows - 1, columns - 1) / 14), first = Math.floor(step / 2);
  const lift = scale(approach, -pad.lift), axes = [0, 3, 6].map((k) => pad.frame.slice(k, k + 3)), forces = [];
  let strongest = 0;
  for (let i = 0; i < rows - 1; i++) for (let j = 0; j < columns - 1; j++) {
    const p = pressure[i * (columns - 1) + j];
    if (!(p > 1e-6 * top)) continue;
    const quad = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)].map((x) => add(x, lift));
    const shade = colour(told.colours.pressure, p / top);
    solid.flat([quad[0], quad[1], quad[2], quad[0], quad[2], quad[3]], shade);
    if (i % step !== first || j % step !== first) continue;
    const middle = scale(quad.reduce((a, b) => add(a, b)), 0.25);
    const turned = cross(add(quad[2], quad[0], -1), add(quad[3], quad[1], -1)), n = unit(turned);
    let v = state.motion === "turn" ? cross(axes[2], add(middle, pad.origin, -1)) : axes[state.motion === "x" ? 0 : 1];
    v = add(v, n, -dot(v, n)); // every face resists in its own plane
    if (size(v) < 1e-9) continue;
    const load = 0.5 * p * size(turned);
    strongest = Math.max(strongest, load);
    forces.push([middle, unit(v), load]);
  }
  for (const [from, e, load] of forces) dart(solid, add(from, add(lift, approach, -0.4)), e, (6 * load) / strongest);
}

function dart(solid, from, e, length) {
  const side = unit(cross(e, Math.abs(e[0]) < 0.6 ? [1, 0, 0] : [0, 1, 0])), other = cross(e, side);
  const base = [side, other, scale(side, -1), scale(other, -1)].map((a) => add(from, a, 0.13 * length));
  const tip = add(from, e, length), shade = hex(told.colours.force);
  for (let k = 0; k < 4; k++) solid.flat([base[k], base[(k + 1) % 4], tip], shade);
}

// --- drawing ---------------------------------------------------------------------------------------------------------

const canvas = get("scene");
const gl = canvas.getContext("webgl", { alpha: false, antialias: true, preserveDrawingBuffer: true });
if (!gl) get("note").textContent = "This browser offers no WebGL; 'softjaw view FILE --screenshot p.png' draws without it. ";
const VERTEX = `attribute vec3 x, n, c; uniform mat3 turn; uniform vec3 middle, fit; varying vec3 shade;
void main() { vec3 p = turn * (x - middle); vec3 m = turn * n; float lit = dot(n, n) < 0.5 ? 1.0 : 0.62 + 0.38 * abs(m.z);
shade = c * lit; gl_Position = vec4(p.x * fit.x, p.y * fit.y, -p.z * fit.z, 1.0); }`;
const FRAGMENT = "precision mediump float; varying vec3 shade; uniform float cover; void main() { gl_FragColor = vec4(shade, cover); }";

function program() {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  gl.useProgram(made);
  return made;
}
const used = gl && program();
const layers = {};

function load(name, x, n, c) {
  const layer = layers[name] || (layers[name] = { x: gl.createBuffer(), n: gl.createBuffer(), c: gl.createBuffer() });
  for (const [key, values] of [["x", x], ["n", n], ["c", c]]) {
    gl.bindBuffer(gl.ARRAY_BUFFER, layer[key]);
    gl.bufferData(gl.ARRAY_BUFFER, values instanceof Float32Array ? values : new Float32Array(values), gl.DYNAMIC_DRAW);
  }
  layer.count = x.length / 3;
}

let shown = surface.x, middle = [0, 0, 0], reach = 1;
function measure(points) {
  const low = [Infinity, Infinity, Infinity], high = low.map((v) => -v);
  for (let k = 0; k < points.length; k++) {
    low[k % 3] = Math.min(low[k % 3], points[k]);
    high[k % 3] = Math.max(high[k % 3], points[k]);
  }
  if (!isFinite(low[0])) return;
  middle = low.map((v, k) => 0.5 * (v + high[k]));
  reach = 0.5 * Math.hypot(...low.map((v, k) => high[k] - v)) || 1;
}

function turn() { // rows: right, up, towards the viewer; z of the object is up
  const [s, c, t, d] = [Math.sin(state.yaw), Math.cos(state.yaw), Math.sin(state.pitch), Math.cos(state.pitch)];
  return [[-s, c, 0], [-t * c, -t * s, d], [d * c, d * s, t]];
}

function paint() {
  if (!gl) return;
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clearColor(1, 1, 1, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  const R = turn(), k = state.zoom / reach, aspect = canvas.width / canvas.height;
  const fit = aspect > 1 ? [k / aspect, k, 0.2 / reach] : [k, k * aspect, 0.2 / reach];
  gl.uniformMatrix3fv(gl.getUniformLocation(used, "turn"), false, [0, 1, 2].flatMap((j) => R.map((row) => row[j])));
  gl.uniform3fv(gl.getUniformLocation(used, "middle"), middle);
  gl.uniform3fv(gl.getUniformLocation(used, "fit"), fit);
  const draw = (name, mode, cover) => {
    if (!layers[name] || !layers[name].count) return;
    gl.uniform1f(gl.getUniformLocation(used, "cover"), cover);
    for (const key of ["x", "n", "c"]) {
      const place = gl.getAttribLocation(used, key);
      gl.bindBuffer(gl.ARRAY_BUFFER, layers[name][key]);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    }
    gl.drawArrays(mode, 0, layers[name].count);
  };
  draw("object", gl.TRIANGLES, 1);
  draw("solid", gl.TRIANGLES, 1);
  draw("lines", gl.LINES, 1);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  gl.depthMask(false); // what is behind glass is drawn before
  draw("glass", gl.TRIANGLES, 0.16);
  gl.depthMask(true);
  gl.disable(gl.BLEND);
}

function rebuild() {
  shown = places();
  const shades = cellColours(), none = hex(told.colours.none), c = new Float32Array(shown.length);
  for (let t = 0; t < surface.cell.length; t++) {
    const shade = surface.cell[t] < 0 ? none : shades[surface.cell[t]];
    for (let k = 0; k < 3; k++) c.set(shade, 9 * t + 3 * k);
  }
  const solid = new Soup(), glass = new Soup(), lines = new Soup();
  const top = drawPads(solid, glass, lines);
  for (const [candidate, x] of Object.entries(told.surface.crosses)) {
    if (told.state[state.force][candidate] !== 2) continue;
    for (let k = 0; k < x.length; k += 3) lines.put(x.slice(k, k + 3), [0, 0, 0], hex(told.colours.cross));
  }
  if (gl) {
    load("object", shown, surface.normal, c);
    for (const [name, soup] of Object.entries({ solid, glass, lines })) load(name, soup.x, soup.n, soup.c);
  }
  get("pressurebar").hidden = !(top > 0);
  get("top").textContent = number(top);
  tell();
  drawBody();
  paint();
}

// --- the limit surface, drawn flat: few faces, the farthest first ----------------------------------------------------

function drawBody() {
  const panel = get("body"), pen = panel.getContext("2d"), limit = here().limit, ratio = window.devicePixelRatio || 1;
  panel.hidden = !limit;
  panel.width = panel.clientWidth * ratio;
  panel.height = panel.clientHeight * ratio;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, panel.clientWidth, panel.clientHeight);
  get("bodyname").textContent = limit
    ? `Limit surface of finger ${limit.finger + 1}: the loads that it carries without slipping (${limit.fitted}).`
    : "No limit surface is stored for this case.";
  if (!limit) return;
  const { rows, columns } = told.limit, packed = unpack(limit.radius, Uint16Array), points = [];
  for (let i = 0; i < rows; i++) for (let j = 0; j < columns; j++) {
    const t = (Math.PI * i) / (rows - 1), phi = (2 * Math.PI * j) / columns, r = (packed[i * columns + j] / 65535) * told.limit.radius;
    points.push([r * Math.sin(t) * Math.cos(phi), r * Math.sin(t) * Math.sin(phi), r * Math.cos(t)]);
  }
  const most = [0, 1, 2].map((k) => Math.max(...points.map((p) => Math.abs(p[k]))));
  const right = unit([0.8, 0.6, 0]), away = unit([0.55, -0.73, 0.4]), up = cross(away, right);
  const factor = 0.27 * Math.min(panel.clientWidth, panel.clientHeight);
  const flat = (p) => [0.5 * panel.clientWidth + factor * dot(p, right), 0.52 * panel.clientHeight - factor * dot(p, up), dot(p, away)];
  const seen = points.map((p) => flat(p.map((v, k) => v / most[k]))), faces = [];
  for (let i = 0; i < rows - 1; i++) for (let j = 0; j < columns; j++) {
    const n = (j + 1) % columns, face = [i * columns + j, (i + 1) * columns + j, (i + 1) * columns + n, i * columns + n].map((k) => seen[k]);
    faces.push([face.reduce((a, p) => a + p[2], 0), face]);
  }
  faces.sort((a, b) => a[0] - b[0]);
  pen.lineWidth = 0.5;
  for (const [depth, face] of faces) {
    pen.beginPath();
    face.forEach((p, k) => (k ? pen.lineTo(p[0], p[1]) : pen.moveTo(p[0], p[1])));
    pen.closePath();
    const light = Math.round(165 + 14 * depth);
    pen.fillStyle = `rgb(${light - 45},${light - 12},${light + 12})`;
    pen.strokeStyle = "#54728c";
    pen.fill();
    pen.stroke();
  }
  pen.font = "12px system-ui, sans-serif";
  ["f_x", "f_y", "tau_z"].forEach((name, k) => {
    const tip = flat([0, 1, 2].map((i) => (i === k ? 1.35 : 0))), near = flat([0, 1, 2].map((i) => (i === k ? 1 : 0)));
    pen.strokeStyle = pen.fillStyle = "#1d2429";
    pen.beginPath();
    pen.moveTo(near[0], near[1]);
    pen.lineTo(tip[0], tip[1]);
    pen.stroke();
    pen.textAlign = k === 2 ? "center" : "left";
    pen.fillText(`${name} ${number(most[k] * limit.unit[k])} ${k === 2 ? "N mm" : "N"}`, tip[0] + (k === 2 ? 0 : 4), tip[1] + (k === 2 ? -4 : k === 0 ? 12 : 0));
  });
}

// --- words and controls ----------------------------------------------------------------------------------------------

function tell() {
  const map = quantity(), status = told.state[state.force][state.candidate];
  get("newton").textContent = `${number(told.forces[state.force])} N`;
  get("force").setAttribute("aria-valuetext", `${told.forces[state.force]} newton`);
  for (const id of ["force", "candidate", "quantity", "motion"]) get(id).value = state[id];
  if (map) {
    get("barname").textContent = map.label + (map.unit ? ` [${map.unit}]` : "");
    get("bar").style.background = gradient(map.stops);
    get("low").textContent = number(map.low);
    get("high").textContent = number(map.high);
  }
  get("remark").textContent = status === 0 ? "not solved yet" : told.remarks[`${state.force} ${state.candidate}`] || "";
  get("values").replaceChildren(...(status === 1 ? told.quantities : []).map((q) => {
    const row = document.createElement("tr"), name = document.createElement("th"), value = document.createElement("td");
    name.scope = "row";
    name.textContent = q.label;
    value.textContent = `${number(q.values[state.force][state.candidate])} ${q.unit}`;
    row.append(name, value);
    return row;
  }));
  const hash = `#force=${state.force}&candidate=${state.candidate}&quantity=${state.quantity}&motion=${state.motion}`;
  if (location.hash !== hash) history.replaceState(null, "", hash);
}

function set(changes) {
  Object.assign(state, changes);
  rebuild();
}

function frontView() { // finger 1 seen obliquely from behind
  const pad = (here().pads || [])[0];
  if (pad) state.yaw = Math.atan2(-pad.rotation[5], -pad.rotation[2]) + 0.7;
}

function pick(event) {
  const box = canvas.getBoundingClientRect(), aspect = box.width / box.height, R = turn(), k = state.zoom / reach;
  const x = ((event.clientX - box.left) / box.width) * 2 - 1, y = 1 - ((event.clientY - box.top) / box.height) * 2;
  const fit = aspect > 1 ? [k / aspect, k] : [k, k * aspect], at = [x / fit[0], y / fit[1]];
  let best = -Infinity, found = -1;
  for (let t = 0; t < surface.cell.length; t++) {
    const p = [0, 3, 6].map((o) => [0, 1, 2].map((i) => shown[9 * t + o + i] - middle[i]));
    const [a, b, c] = p.map((q) => [dot(R[0], q) - at[0], dot(R[1], q) - at[1], dot(R[2], q)]);
    const u = b[0] * c[1] - b[1] * c[0], v = c[0] * a[1] - c[1] * a[0], w = a[0] * b[1] - a[1] * b[0], all = u + v + w;
    if (!all || u * all < 0 || v * all < 0 || w * all < 0) continue;
    const depth = (u * a[2] + v * b[2] + w * c[2]) / all;
    if (depth > best) { best = depth; found = surface.cell[t]; }
  }
  if (found >= 0) set({ candidate: found });
}

function controls() {
  get("title").textContent = document.title = told.title;
  get("force").max = told.forces.length - 1;
  const option = (value, text) => Object.assign(document.createElement("option"), { value, textContent: text });
  get("candidate").append(...told.candidates.map((name, c) => option(c, `${told.first + c}: ${name}`)));
  get("quantity").append(...told.quantities.map((q) => option(q.name, q.label)));
  get("pressure").style.background = gradient(told.colours.pressure);
  get("force").addEventListener("input", (e) => set({ force: Number(e.target.value) }));
  get("candidate").addEventListener("change", (e) => {
    state.candidate = Number(e.target.value);
    frontView();
    rebuild();
  });
  get("quantity").addEventListener("change", (e) => set({ quantity: e.target.value }));
  get("motion").addEventListener("change", (e) => set({ motion: e.target.value }));
  const grey = told.poses ? "Balls: where the fingers of a pose first touch." : "Light grey: no candidate there.";
  get("note").textContent += [`${grey} Darker grey: not solved; crossed out: failed. Darts: friction of the pads' faces, each in its own plane. `
    + "Walls are deformed as computed, pads have straight sides. Drag to turn, wheel or pinch to zoom, arrow keys turn too.", ...told.notes].join(" ");
  let from = null, moved = false, apart = 0;
  const touches = new Map();
  canvas.addEventListener("pointerdown", (e) => {
    touches.set(e.pointerId, e);
    canvas.setPointerCapture(e.pointerId);
    from = [e.clientX, e.clientY];
    moved = false;
    apart = 0;
  });
  canvas.addEventListener("pointermove", (e) => {
    if (!touches.has(e.pointerId)) return;
    touches.set(e.pointerId, e);
    if (touches.size > 1) {
      const [a, b] = [...touches.values()], now = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
      if (apart) state.zoom *= now / apart;
      apart = now;
      moved = true;
    } else {
      if (Math.hypot(e.clientX - from[0], e.clientY - from[1]) < 4 && !moved) return;
      moved = true;
      state.yaw -= 0.008 * (e.clientX - from[0]);
      state.pitch = Math.min(1.5, Math.max(-1.5, state.pitch + 0.008 * (e.clientY - from[1])));
      from = [e.clientX, e.clientY];
    }
    paint();
  });
  const end = (e) => {
    if (touches.delete(e.pointerId) && e.type === "pointerup" && !moved) pick(e);
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    state.zoom = Math.min(20, Math.max(0.2, state.zoom * Math.exp(-0.0012 * e.deltaY)));
    paint();
  }, { passive: false });
  canvas.addEventListener("keydown", (e) => {
    const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[e.key];
    if (!step) return;
    e.preventDefault();
    state.yaw += step[0];
    state.pitch = Math.min(1.5, Math.max(-1.5, state.pitch + step[1]));
    paint();
  });
  window.addEventListener("resize", () => { drawBody(); paint(); });
}

function fromAddress() { // #force=1&candidate=4 opens a case; anything that is not there is passed over
  const asked = new URLSearchParams(location.hash.slice(1));
  const force = Number(asked.get("force") ?? NaN), candidate = Number(asked.get("candidate") ?? NaN);
  if (told.forces[force] !== undefined) state.force = force;
  if (told.candidates[candidate] !== undefined) state.candidate = candidate;
  if (told.quantities.some((q) => q.name === asked.get("quantity"))) state.quantity = asked.get("quantity");
  if (["x", "y", "turn"].includes(asked.get("motion"))) state.motion = asked.get("motion");
}

controls();
fromAddress();
const everything = [...surface.x];
for (const pad of here().pads || []) for (const p of Object.values(padPoints(pad)).flat()) everything.push(...p);
measure(everything);
frontView();
rebuild();
