"use strict";
// The page asks for the state, draws the sheet, and sends what its controls say; it keeps no state of the twin itself.

const PERIOD = 80; // ms between two questions
const SCALE = [[68, 1, 84], [65, 68, 135], [42, 120, 142], [34, 168, 132], [122, 209, 81], [253, 231, 37]];
const view = { azimuth: -2.2, elevation: 0.5, zoom: 1.0 };
const canvas = document.getElementById("sheet");
const at = (id) => document.getElementById(id);
let state = null;
let chosen = null; // [layer, i, j] of the clicked node
let screen = []; // places of the nodes on the canvas

function colour(height, length, shade) {
  const place = Math.min(Math.max((height / length + 0.5) * 5, 0), 4.999);
  const k = Math.floor(place);
  const mix = SCALE[k].map((c, n) => Math.round(shade * (c + (place - k) * (SCALE[k + 1][n] - c))));
  return `rgb(${mix.join(",")})`;
}

function project(point, centre, size) {
  const [x, y, z] = point.map((value, k) => value - centre[k]);
  const [ca, sa, ce, se] = [Math.cos(view.azimuth), Math.sin(view.azimuth), Math.cos(view.elevation), Math.sin(view.elevation)];
  const depth = -(ca * x + sa * y) * ce - se * z; // away from the eye
  return [canvas.width / 2 + size * (-sa * x + ca * y), canvas.height / 2 - size * (ce * z - se * (ca * x + sa * y)), depth];
}

function draw() {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = canvas.clientWidth * ratio;
  canvas.height = canvas.clientHeight * ratio;
  const pen = canvas.getContext("2d");
  if (!state || !state.nodes) return;
  const [nx, ny] = state.nodes;
  const length = state.length;
  const size = view.zoom * 0.62 * Math.min(canvas.width, canvas.height) / length;
  const centre = [length / 2, 0, 0.1 * length];
  screen = state.position.map((point) => (point ? project(point, centre, size) : null));
  const faces = [];
  const node = (layer, i, j) => (layer * nx + i) * ny + j;
  const add = (corners, shade) => {
    if (corners.some((k) => !state.position[k])) return;
    const mean = (pick) => corners.reduce((sum, k) => sum + pick(k), 0) / corners.length;
    faces.push({ corners, depth: mean((k) => screen[k][2]), fill: colour(mean((k) => state.position[k][2]), length, shade) });
  };
  for (let i = 0; i + 1 < nx; i++) {
    for (let j = 0; j + 1 < ny; j++) {
      add([node(1, i, j), node(1, i + 1, j), node(1, i + 1, j + 1), node(1, i, j + 1)], 1.0);
      add([node(0, i, j), node(0, i + 1, j), node(0, i + 1, j + 1), node(0, i, j + 1)], 0.72);
    }
    for (const j of [0, ny - 1]) add([node(0, i, j), node(0, i + 1, j), node(1, i + 1, j), node(1, i, j)], 0.6);
  }
  for (let j = 0; j + 1 < ny; j++) for (const i of [0, nx - 1]) add([node(0, i, j), node(0, i, j + 1), node(1, i, j + 1), node(1, i, j)], 0.6);
  faces.sort((a, b) => b.depth - a.depth);
  pen.lineWidth = ratio * 0.6;
  for (const face of faces) {
    pen.beginPath();
    face.corners.forEach((k, n) => (n ? pen.lineTo(screen[k][0], screen[k][1]) : pen.moveTo(screen[k][0], screen[k][1])));
    pen.closePath();
    pen.fillStyle = face.fill;
    pen.fill();
    pen.strokeStyle = "rgba(255,255,255,0.6)";
    pen.stroke();
  }
  pen.font = `${13 * ratio}px system-ui, sans-serif`;
  for (const [name, point] of Object.entries(state.points)) {
    const [x, y] = project(point, centre, size);
    dot(pen, x, y, 4 * ratio, "#0072b2");
    pen.lineWidth = 3 * ratio;
    pen.strokeText(name, x + 7 * ratio, y - 5 * ratio);
    pen.fillStyle = "#222";
    pen.fillText(name, x + 7 * ratio, y - 5 * ratio);
    pen.lineWidth = ratio;
  }
  if (chosen && screen[node(...chosen)]) {
    const [x, y] = screen[node(...chosen)];
    dot(pen, x, y, 6 * ratio, "#b2182b");
  }
}

function dot(pen, x, y, radius, fill) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = fill;
  pen.fill();
  pen.strokeStyle = "white";
  pen.stroke();
}

async function send(request) {
  try {
    const answer = await fetch("command", {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(request),
    });
    const told = await answer.json();
    tell(told.message, !told.done);
  } catch (error) {
    tell(`no answer: ${error.message}`, true);
  }
}

function tell(text, refused) {
  at("told").textContent = text;
  at("told").className = refused ? "refused" : "";
}

function fillArms() {
  const names = state.arms.map((arm) => arm.name).join();
  if (at("arms").dataset.names !== names) {
    at("arms").dataset.names = names;
    at("arms").replaceChildren(...state.arms.map((arm) => {
      const label = document.createElement("label");
      const slider = document.createElement("input");
      Object.assign(slider, { type: "range", min: arm.least, max: arm.most, step: (arm.most - arm.least) / 400, value: arm.commanded, id: `arm_${arm.name}` });
      slider.addEventListener("input", () => send({ do: "drive", arm: arm.name, value: Number(slider.value) }));
      label.append(`${arm.name} `, document.createElement("span"), slider);
      return label;
    }));
  }
  state.arms.forEach((arm, k) => {
    const label = at("arms").children[k];
    const measured = arm.measured === null ? "" : `, measured ${arm.measured.toFixed(arm.digits)}`;
    label.querySelector("span").textContent = `${arm.commanded.toFixed(arm.digits)} ${arm.unit}${measured}`;
    const slider = label.querySelector("input");
    if (document.activeElement !== slider) slider.value = arm.commanded;
  });
}

function fillNumbers() {
  const rows = [["time", `${state.time.toFixed(2)} s`], ...Object.entries(state.points).map(([name, p]) =>
    [name, p.map((value) => (1000 * value).toFixed(1)).join("  ") + " mm"]), ...Object.entries(state.status)];
  at("numbers").replaceChildren(...rows.map(([name, value]) => {
    const row = document.createElement("tr");
    for (const text of [name, value]) row.appendChild(document.createElement("td")).textContent = text;
    return row;
  }));
  at("title").textContent = state.title;
  at("record").textContent = state.recording ? "stop recording" : "record";
  at("bag").textContent = state.recording || "";
  at("low").textContent = `${(-500 * state.length).toFixed(0)} mm`;
  at("high").textContent = `+${(500 * state.length).toFixed(0)} mm`;
}

async function ask() {
  try {
    const answer = await (await fetch("state")).json();
    if (answer.nodes) {
      state = answer;
      fillArms();
      fillNumbers();
      draw();
    } else {
      at("title").textContent = answer.title;
    }
  } catch (error) {
    tell("the panel's program has ended; start it again", true);
  }
  setTimeout(ask, PERIOD);
}

let press = null;
canvas.addEventListener("pointerdown", (event) => { press = { x: event.clientX, y: event.clientY, moved: false }; });
window.addEventListener("pointermove", (event) => {
  if (!press) return;
  const [dx, dy] = [event.clientX - press.x, event.clientY - press.y];
  if (Math.hypot(dx, dy) > 3) press.moved = true;
  if (!press.moved) return;
  view.azimuth -= 0.008 * dx;
  view.elevation = Math.min(Math.max(view.elevation + 0.008 * dy, -1.5), 1.5);
  Object.assign(press, { x: event.clientX, y: event.clientY });
  draw();
});
window.addEventListener("pointerup", (event) => {
  if (press && !press.moved && state) choose(event);
  press = null;
});
canvas.addEventListener("wheel", (event) => { view.zoom *= Math.exp(-0.001 * event.deltaY); draw(); }, { passive: true });

function choose(event) {
  const ratio = window.devicePixelRatio || 1;
  const [nx, ny] = state.nodes;
  let best = Infinity;
  for (let i = 0; i < nx; i++) {
    for (let j = 0; j < ny; j++) {
      const place = screen[(nx + i) * ny + j];
      const apart = place ? Math.hypot(place[0] - ratio * event.offsetX, place[1] - ratio * event.offsetY) : Infinity;
      if (apart < best) [best, chosen] = [apart, [1, i, j]];
    }
  }
  at("place").textContent = `node_top_${chosen[1]}_${chosen[2]}`;
  draw();
}

for (const name of ["pause", "resume", "step", "reset", "rearm"]) at(name).addEventListener("click", () => send({ do: name }));
at("zero").addEventListener("click", () => send({ do: "zero" }));
at("record").addEventListener("click", () => send({ do: "record", on: !(state && state.recording) }));
at("push").addEventListener("click", () => {
  if (!chosen) return tell("click the sheet to choose a place", true);
  const force = ["fx", "fy", "fz"].map((id) => Number(at(id).value));
  return send({ do: "push", point: at("place").textContent, force, duration: Number(at("seconds").value) });
});
window.addEventListener("resize", draw);
ask();
