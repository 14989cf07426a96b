// The map: a plane of cells, sliders over the other axes, a cell that mouse and keys choose.
const map = { index: [], cell: [0, 0], quantity: 0, values: [], reasons: null };

const sizeOf = (axes) => axes.reduce((all, own) => all * own, 1);
const sliceStart = () => {
  const { shape } = content.map;
  return map.index.reduce((sum, own, k) => sum * shape[k] + own, 0) * sizeOf(shape.slice(-2));
};
const flatCell = () => sliceStart() + map.cell[0] * content.map.shape.at(-1) + map.cell[1];

function hasValue(quantity, value) {
  if (quantity.words) return true;
  return quantity.isCount ? value > 0 : !Number.isNaN(value);
}

// What has no place on the scale, or what other conditions exclude than a margin tells: there the reason is shown.
function isHidden(quantity, value, flat) {
  if (!map.reasons || quantity.words) return false;
  return value < -2e38 || (quantity.isMargin && value > 0 && !reasonOf(flat).isInside);
}

function textOf(k, flat) {
  const quantity = content.map.quantities[k], value = map.values[k][flat];
  if (quantity.words) return quantity.words[value];
  if (!hasValue(quantity, value)) return quantity.isCount ? "none" : "–";
  return withUnit(shown(value), quantity.unit);
}

const reasonOf = (flat) => (map.reasons ? content.map.reasons.entries[map.reasons[flat]] : null);

function coordinates(row, column) {
  const { axes, shape } = content.map;
  const places = [...map.index, row, column];
  return axes.map((axis, k) => [axis.name, axis.words[places[k]].replace(/^.*? = /, ""), shape[k]]);
}

// What a cell says beside its coordinates: all that there is.
function facts(flat) {
  const rows = content.map.quantities.filter((q) => q.name !== "verdict")
    .map((q) => [q.label.replace(/ \([^)]*\)$/, ""), textOf(content.map.quantities.indexOf(q), flat)]);
  const reason = reasonOf(flat);
  return reason ? [["verdict", reason.text], ...rows] : rows;
}

function hoverOf(row, column, flat) {
  const places = coordinates(row, column).filter((own) => own[2] > 1).map((own) => `${own[0]} = ${own[1]}`);
  const most = facts(flat).slice(0, 6).map((own) => `${own[0]}: ${own[1]}`);
  const motion = content.cells[flat] === undefined ? [] : ["click: its motion"];
  return [places.join(", "), ...most, ...motion].join("\n");
}

// Of the cell below the pointer alone: texts of all would take longer than the picture.
function hover({ points, event }) {
  const [row, column] = placeOf(points[0]), tip = element("tip");
  if (row < 0 || column < 0) return;
  tip.textContent = hoverOf(row, column, sliceStart() + row * content.map.shape.at(-1) + column);
  tip.hidden = false;
  const box = tip.getBoundingClientRect();
  const left = event.clientX + 16 + box.width < innerWidth ? event.clientX + 16 : event.clientX - 16 - box.width;
  tip.style.left = `${left + scrollX}px`;
  tip.style.top = `${event.clientY + 12 + scrollY}px`;
}

function placeOf(point) {
  const find = (axis, value) => axis.values.findIndex((own) => own === value);
  const [y, x] = content.map.axes.slice(-2);
  return [find(y, point.y), find(x, point.x)];
}

function stepped(scale) {
  const count = scale.shades.length;
  if (!scale.stepped) return scale.shades.map((shade, k) => [k / (count - 1), shade]);
  return scale.shades.flatMap((shade, k) => [[k / count, shade], [(k + 1) / count, shade]]);
}

function planes() {
  const { shape, quantities } = content.map;
  const [rows, columns] = shape.slice(-2), start = sliceStart();
  const quantity = quantities[map.quantity], values = map.values[map.quantity];
  const z = [], reason = [];
  for (let i = 0; i < rows; i++) {
    z.push([]); reason.push([]);
    for (let j = 0; j < columns; j++) {
      const flat = start + i * columns + j, has = hasValue(quantity, values[flat]) && !isHidden(quantity, values[flat], flat);
      z[i].push(has ? values[flat] : null);
      reason[i].push(has || !map.reasons ? null : map.reasons[flat]);
    }
  }
  return { z, reason };
}

function motionMarks() {
  const { shape, axes } = content.map;
  const columns = shape.at(-1), start = sliceStart(), size = sizeOf(shape.slice(-2));
  const own = Object.keys(content.cells).map(Number).filter((flat) => flat >= start && flat < start + size);
  const places = own.map((flat) => [Math.floor((flat - start) / columns), (flat - start) % columns]);
  return { x: places.map((own) => axes.at(-1).values[own[1]]), y: places.map((own) => axes.at(-2).values[own[0]]) };
}

// Edges of cells between what is inside of a workspace and what is not.
function outline(reason) {
  const [rows, columns] = content.map.shape.slice(-2), [y, x] = content.map.axes.slice(-2);
  const inside = (i, j) => Boolean(content.map.reasons.entries[reason[i]?.[j] ?? -1]?.isInside);
  const edges = (values) => {
    const mean = values.slice(1).map((value, k) => (value + values[k]) / 2), last = values.length - 1;
    if (!last) return [values[0] - 0.5, values[0] + 0.5];
    return [2 * values[0] - mean[0], ...mean, 2 * values[last] - mean[last - 1]];
  };
  const [across, upward] = [edges(x.values), edges(y.values)], line = { x: [], y: [] };
  const add = (x0, y0, x1, y1) => { line.x.push(x0, x1, null); line.y.push(y0, y1, null); };
  for (let i = 0; i <= rows; i++) {
    for (let j = 0; j <= columns; j++) {
      if (inside(i, j) !== inside(i, j - 1)) add(across[j], upward[i], across[j], upward[i + 1]);
      if (inside(i, j) !== inside(i - 1, j)) add(across[j], upward[i], across[j + 1], upward[i]);
    }
  }
  return line;
}

// Obstacles of this plane: what it cuts of them filled, the outline of those beside it dashed.
function obstaclesHere() {
  const own = content.map.obstacles;
  return (own ? own.bodies : []).map((body) => {
    const place = own.axis === null ? 0 : [...map.index, ...map.cell][own.axis], cut = body.cuts[place];
    return cut?.up.length ? { isCut: true, ...cut } : { isCut: false, ...body.shadow };
  });
}

function obstacleTraces() {
  const color = content.map.obstacles?.colour;
  return obstaclesHere().map(({ isCut, up, across }) => ({ type: "scatter", mode: "lines", hoverinfo: "skip", showlegend: false,
    x: across, y: up, fill: isCut ? "toself" : "none", fillcolor: color,
    line: { color: isCut ? "white" : color, width: 1.2, dash: isCut ? "solid" : "dash" } }));
}

// Verdicts of the cells that are shown, in rows.
function reasonsHere() {
  const [rows, columns] = content.map.shape.slice(-2), start = sliceStart();
  return Array.from({ length: rows }, (_, i) => Array.from(map.reasons.slice(start + i * columns, start + (i + 1) * columns)));
}

function drawMap() {
  const { axes, quantities, reasons, isDown, isEqual } = content.map;
  const quantity = quantities[map.quantity], scale = quantity.scale, own = planes();
  const [y, x] = axes.slice(-2), theme = colours();
  const common = { type: "heatmap", x: x.values, y: y.values, hoverinfo: "none" };
  const bar = { title: { text: quantity.label + (scale.beyond ? `<br>${scale.beyond}` : ""), side: "right" },
    tickvals: scale.ticks?.values, ticktext: scale.ticks?.texts, outlinewidth: 0 };
  const traces = [{ ...common, z: own.z, zmin: scale.bounds[0], zmax: scale.bounds[1],
    colorscale: stepped(scale), colorbar: bar, hoverongaps: false }];
  if (reasons) {
    const count = reasons.entries.length, shades = reasons.entries.map((entry) => entry.colour);
    traces.push({ ...common, z: own.reason, zmin: -0.5, zmax: count - 0.5, showscale: false, opacity: 0.55,
      colorscale: stepped({ stepped: true, shades }), hoverongaps: false });
  }
  traces.push(...obstacleTraces());
  if (content.map.spools) {
    const [up, over] = [content.map.spools.up, content.map.spools.across];
    traces.push({ type: "scatter", mode: "lines", hoverinfo: "skip", showlegend: false, ...outline(reasonsHere()),
      line: { color: theme.ink, width: 2 } });
    traces.push({ type: "scatter", mode: "markers+text", hoverinfo: "skip", showlegend: false, x: over, y: up,
      text: over.map((_, k) => `${k + 1}`), textposition: "top center", cliponaxis: false,
      marker: { symbol: "square", size: 8, color: theme.ink } });
  }
  traces.push({ type: "scatter", mode: "markers", hoverinfo: "skip", showlegend: false, ...motionMarks(),
    marker: { symbol: "circle", size: 7, color: "white", line: { color: "black", width: 1.2 } } });
  traces.push({ type: "scatter", mode: "markers", hoverinfo: "skip", showlegend: false,
    x: [x.values[map.cell[1]]], y: [y.values[map.cell[0]]],
    marker: { symbol: "square-open", size: 15, color: theme.mark, line: { width: 3 } } });
  Plotly.react("map", traces, layoutOf((axis) => ({
    uirevision: "same", xaxis: { ...axis, title: { text: x.label }, constrain: "domain" },
    yaxis: { ...axis, title: { text: y.label }, constrain: "domain", autorange: isDown ? "reversed" : true,
      visible: y.values.length > 1, ...(isEqual && y.values.length > 1 ? { scaleanchor: "x" } : {}) },
  })), CHARTS);
  drawLegend(own.reason);
  tellCell();
}

function drawLegend(reason) {
  const node = element("legend");
  node.replaceChildren();
  if (!content.map.reasons) return;
  const used = [...new Set(reason.flat().filter((own) => own !== null))].map((own) => content.map.reasons.entries[own]);
  const words = new Map(used.map((entry) => [entry.word, entry.colour]));
  for (const [word, colour] of words) {
    const one = made("span", word);
    one.style.setProperty("--own", colour);
    node.append(one);
  }
  const obstacles = obstaclesHere(), colour = content.map.obstacles?.colour;
  for (const [isCut, word] of [[true, "obstacle"], [false, "obstacle beside this section"]]) {
    if (!obstacles.some((own) => own.isCut === isCut)) continue;
    const one = made("span", word, { className: isCut ? "" : "dashed" });
    one.style.setProperty("--own", colour);
    node.append(one);
  }
  if (!content.map.spools) return;
  node.append(made("span", "outline of the workspace", { className: "line" }));
  node.append(made("span", "spools, by number", { className: "square" }));
}

function tellCell() {
  const flat = flatCell(), reason = reasonOf(flat);
  const rows = coordinates(...map.cell).map((own) => own.slice(0, 2)).concat(facts(flat));
  for (const sentence of reason ? reason.sentences : []) rows.push(["", sentence]);
  if (content.motions.length) rows.push(["motion", content.cells[flat] === undefined ? "not computed for this cell" : "Enter or click shows it"]);
  rowsInto(element("cell"), rows);
}

function chooseCell(row, column, open = false) {
  const [rows, columns] = content.map.shape.slice(-2);
  map.cell = [Math.min(Math.max(row, 0), rows - 1), Math.min(Math.max(column, 0), columns - 1)];
  const [y, x] = content.map.axes.slice(-2), last = element("map").data.length - 1;
  Plotly.restyle("map", { x: [[x.values[map.cell[1]]]], y: [[y.values[map.cell[0]]]] }, [last]);
  tellCell();
  if (open) openCell();
}

function openCell() {
  const number = content.cells[flatCell()];
  if (number !== undefined) showMotion(number);
}

function nextMotion() {
  const every = Object.keys(content.cells).map(Number).sort((a, b) => a - b);
  if (!every.length) return;
  const flat = every.find((own) => own > flatCell()) ?? every[0];
  const { shape } = content.map, places = [];
  let rest = flat;
  for (let k = shape.length - 1; k >= 0; k--) { places.unshift(rest % shape[k]); rest = Math.floor(rest / shape[k]); }
  map.cell = places.slice(-2);
  map.index = places.slice(0, -2);
  document.querySelectorAll("#sliders input").forEach((node) => { node.value = map.index[Number(node.dataset.axis)]; });
  tellSliders();
  drawMap();
  openCell();
}

function tellSliders() {
  document.querySelectorAll("#sliders .slider").forEach((node) => {
    const k = Number(node.querySelector("input").dataset.axis);
    node.querySelector("output").textContent = content.map.axes[k].words[map.index[k]];
  });
}

function moveSlider(step) {
  const node = document.querySelector("#sliders input");
  if (!node) return;
  node.value = Number(node.value) + step;
  node.dispatchEvent(new Event("input"));
}

function addSliders() {
  content.map.shape.slice(0, -2).forEach((count, k) => {
    if (count < 2) return;
    const node = made("label", "", { className: "slider" });
    const input = made("input", "", { type: "range", min: 0, max: count - 1, value: map.index[k] });
    input.dataset.axis = k;
    input.setAttribute("aria-label", content.map.axes[k].name);
    input.addEventListener("input", () => { map.index[k] = Number(input.value); tellSliders(); drawMap(); drawSolid(); });
    node.append(input, made("output", ""));
    element("sliders").append(node);
  });
  tellSliders();
}

const MAP_KEYS = {
  ArrowLeft: () => chooseCell(map.cell[0], map.cell[1] - 1),
  ArrowRight: () => chooseCell(map.cell[0], map.cell[1] + 1),
  ArrowUp: () => chooseCell(map.cell[0] + (content.map.isDown ? -1 : 1), map.cell[1]),
  ArrowDown: () => chooseCell(map.cell[0] + (content.map.isDown ? 1 : -1), map.cell[1]),
  PageUp: () => moveSlider(1), PageDown: () => moveSlider(-1),
  Enter: openCell, n: nextMotion,
};

async function startMap() {
  const { quantities, reasons, shape, notes, first } = content.map;
  element("map-side").hidden = false;
  // Of a map over one axis the plane is a strip.
  if (shape.at(-2) === 1) element("map").style.height = "280px";
  element("notes").textContent = notes.join(", ");
  map.values = await Promise.all(quantities.map((own) => unpacked(own.values)));
  map.reasons = reasons ? await unpacked(reasons.values) : null;
  map.index = first.slice(0, -2);
  map.cell = first.slice(-2);
  quantities.forEach((own, k) => element("quantity").append(made("option", own.label, { value: k })));
  element("quantity").addEventListener("change", (event) => { map.quantity = Number(event.target.value); drawMap(); });
  addSliders();
  element("slice-keys").hidden = !shape.slice(0, -2).some((count) => count > 1);
  drawMap();
  element("map").on("plotly_click", ({ points }) => {
    const [row, column] = placeOf(points[0]);
    if (row >= 0 && column >= 0) chooseCell(row, column, true);
  });
  element("map").on("plotly_hover", hover);
  element("map").on("plotly_unhover", () => { element("tip").hidden = true; });
  element("map").addEventListener("keydown", (event) => {
    const act = MAP_KEYS[event.key];
    if (act) { event.preventDefault(); act(); }
  });
}
