// The motion: the robot in space with its cables coloured by tension, and its tensions over time.
const motion = { own: null, row: 0, playing: null };
const PALETTE = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"];
const DASHES = ["solid", "dash", "dashdot", "dot"];
const TENSION = [[0, "#7e03a8"], [0.35, "#b73779"], [0.7, "#e8622c"], [1, "#f9a63a"]];
const BODY = "#8a6a58", FAILS = "rgba(204, 26, 26, 0.18)";
const known = new Map();

// The charts over time: their places, quantities and units; that of the position has no cables.
const OVER_TIME = [["tensions", "tension", "tension", "N"], ["speeds", "rate", "cable speed", "m/s"],
  ["lengths", "length", "cable length", "m"], ["position", "path", "position", "m"]];

async function loaded(number) {
  if (!known.has(number)) {
    const given = content.motions[number];
    const names = ["t", "path", "attached", "arcs", "corners", "tension", "rate", "length"].filter((name) => given[name]);
    const arrays = await Promise.all(names.map((name) => unpacked(given[name])));
    known.set(number, { ...given, ...Object.fromEntries(names.map((name, k) => [name, arrays[k]])) });
  }
  return known.get(number);
}

const columnOf = (values, width, k) => Array.from({ length: values.length / width }, (_, i) => values[i * width + k]);

function extremes(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (Number.isFinite(value)) { low = Math.min(low, value); high = Math.max(high, value); }
  }
  return low <= high ? [low, high] : [0, 1];
}

function shade(value, [low, high]) {
  const part = high > low ? Math.min(Math.max((value - low) / (high - low), 0), 1) : 0.5;
  const next = Math.max(1, TENSION.findIndex(([end]) => end >= part));
  const [[a, first], [b, last]] = [TENSION[next - 1], TENSION[next]];
  const hex = (colour, k) => parseInt(colour.slice(1 + 2 * k, 3 + 2 * k), 16);
  const mixed = [0, 1, 2].map((k) => Math.round(hex(first, k) + ((part - a) / (b - a)) * (hex(last, k) - hex(first, k))));
  return value < 0 ? colours().ink : `rgb(${mixed})`;
}

// Numbers of cables; those of spools that stand together are one label, at the first of them.
function spoolNames(base) {
  const size = Math.max(...[0, 1, 2].map((k) => { const [low, high] = extremes(base.map((point) => point[k])); return high - low; }));
  const first = base.map((point) => base.findIndex((other) => Math.hypot(...point.map((x, k) => x - other[k])) <= 0.08 * size));
  return base.map((_, k) => base.map((_, n) => n + 1).filter((n) => first[k] === k && first[n - 1] === k).join(", "));
}

// Coordinates of the traces that move, at one row: cables, edges of the platform, the effector.
function moving(row) {
  // The robot of a table may not be known: then it has no spools.
  const { own, range } = motion, { edges } = own, cables = own.base.length;
  const at = (values, width, k) => [0, 1, 2].map((axis) => values[row * width + 3 * k + axis]);
  const arc = (k) => Array.from({ length: own.onArc }, (_, i) => at(own.arcs, 3 * cables * own.onArc, k * own.onArc + i));
  const lines = Array.from({ length: cables }, (_, k) => [own.base[k], ...arc(k), at(own.attached, 3 * cables, k)]);
  const shape = Array.from({ length: edges }, (_, k) => [at(own.corners, 6 * edges, 2 * k),
    at(own.corners, 6 * edges, 2 * k + 1), [null, null, null]]).flat();
  const place = [[0, 1, 2].map((axis) => own.path[3 * row + axis])];
  const parts = [...lines, shape, place];
  const tension = Array.from({ length: cables }, (_, k) => own.tension[row * cables + k]);
  return {
    x: parts.map((part) => part.map((point) => point[0])), y: parts.map((part) => part.map((point) => point[1])),
    z: parts.map((part) => part.map((point) => point[2])), tension, shades: tension.map((value) => shade(value, range)),
  };
}

function robotTraces() {
  const { own, range } = motion, theme = colours(), now = moving(motion.row);
  const line = (k, extra) => ({ type: "scatter3d", x: now.x[k], y: now.y[k], z: now.z[k], showlegend: false,
    mode: "lines", hoverinfo: "skip", ...extra });
  const count = own.base.length, traces = now.tension.map((value, k) => line(k, { name: own.cables[k],
    hoverinfo: "name", line: { width: 5, color: now.shades[k] } }));
  traces.push(line(count, { line: { width: 7, color: theme.ink } }));
  traces.push(line(count + 1, { mode: "markers",
    marker: { size: own.edges ? 0 : 5, color: theme.ink } }));
  const points = (values, extra) => ({ type: "scatter3d", x: values[0], y: values[1], z: values[2], showlegend: false,
    hoverinfo: "skip", ...extra });
  const path = [0, 1, 2].map((k) => columnOf(own.path, 3, k));
  traces.push(points(path, { mode: "lines", name: "path", showlegend: true, line: { width: 2, color: theme.soft } }));
  const base = [0, 1, 2].map((k) => own.base.map((point) => point[k]));
  traces.push(points(base, { mode: "markers+text", name: "spools", text: spoolNames(own.base),
    textposition: "top center", textfont: { color: theme.ink }, showlegend: count > 0,
    marker: { size: 4, symbol: "square", color: theme.soft } }));
  // Each mark lies within the one before it, so that all are seen where they fall together.
  const ends = own.segments.slice(0, -1).map((part) => Math.max(own.t.findIndex((t) => t >= part.end - 1e-9), 0));
  const marks = [["start", [0], "circle-open", 9], ["way-points", ends.length > 40 ? [] : ends, "square-open", 6],
    ["end", [own.count - 1], "diamond", 3]];
  for (const [name, rows, symbol, size] of marks.filter((mark) => mark[1].length)) {
    traces.push(points([0, 1, 2].map((k) => rows.map((row) => own.path[3 * row + k])), { mode: "markers", name,
      showlegend: true, marker: { size, symbol, color: theme.ink } }));
  }
  if (own.flight) {
    const flight = [0, 1, 2].map((k) => own.flight.map((point) => point[k]));
    traces.push(points(flight, { mode: "lines", name: "flight", showlegend: true, line: { width: 3, dash: "dash", color: theme.mark } }));
  }
  own.bodies.forEach((body, k) => traces.push(...surface(body, k === 0)));
  if (!count) return traces;
  // A trace without points holds the bar of the colours.
  traces.push(points([[null], [null], [null]], { mode: "markers", marker: { size: 0.1, color: [range[0]],
    colorscale: TENSION, cmin: range[0], cmax: range[1], showscale: true,
    colorbar: { title: { text: "tension (N)", side: "right" }, len: 0.75, thickness: 14, outlinewidth: 0 } } }));
  return traces;
}

// An obstacle: its surface, and lines on it.
function surface(body, isFirst) {
  const place = [0, 1, 2].map((k) => body.corners.map((point) => point[k]));
  const [i, j, k] = [0, 1, 2].map((side) => body.triangles.map((corners) => corners[side]));
  const lines = [0, 1, 2].map((axis) => body.lines.flatMap((line) => [...line.map((point) => point[axis]), null]));
  return [{ type: "mesh3d", x: place[0], y: place[1], z: place[2], i, j, k, color: BODY, opacity: 0.45, name: "obstacles",
    text: body.name, hoverinfo: "text", legendgroup: "obstacles", showlegend: isFirst, flatshading: false,
    lighting: { ambient: 0.8, diffuse: 0.3, specular: 0 } },
  { type: "scatter3d", x: lines[0], y: lines[1], z: lines[2], mode: "lines", hoverinfo: "skip", showlegend: false,
    legendgroup: "obstacles", line: { width: 2, color: BODY } }];
}

function box() {
  const { own } = motion, every = [0, 1, 2].map((k) => [...own.base.map((point) => point[k]),
    ...columnOf(own.attached, 3, k), ...columnOf(own.arcs, 3, k), ...columnOf(own.corners, 3, k), ...columnOf(own.path, 3, k),
    ...own.bodies.flatMap((body) => body.corners.map((point) => point[k])), ...(own.flight ?? []).map((point) => point[k])]);
  return withMargin(every.map(extremes));
}

function withMargin(ranges) {
  const margin = 0.04 * Math.max(...ranges.map(([low, high]) => high - low));
  return ranges.map(([low, high]) => [low - margin, high + margin]);
}

function drawRobot() {
  const ranges = box();
  Plotly.react("robot", robotTraces(), layoutOf((_, theme) => spaceOf(ranges, motion.own.isDown, theme, "robot")), CHARTS);
}

// Layout of a box in space, of true proportions, seen from the side with z upward.
function spaceOf(ranges, isDown, theme, uirevision) {
  const signs = isDown ? [1, -1, -1] : [1, 1, 1];
  const sizes = ranges.map(([low, high]) => high - low), parts = sizes.map((size) => size / Math.max(...sizes));
  const own = ["x", "y", "z"].map((name, k) => ({ title: { text: `${name} (m)` }, gridcolor: theme.line,
    zerolinecolor: theme.line, showbackground: false, showspikes: false,
    // Numbers of a short axis would lie upon each other.
    nticks: parts[k] < 0.3 ? 3 : 6, showticklabels: parts[k] > 0.15,
    range: signs[k] > 0 ? ranges[k] : [...ranges[k]].reverse(), autorange: false }));
  const [x, y, z] = sizes.map((size) => 1.9 * size / Math.hypot(...sizes));
  return { margin: { l: 0, r: 0, t: 0, b: 0 }, uirevision,
    legend: { orientation: "h", x: 0.5, xanchor: "center", y: 0, yanchor: "bottom" },
    scene: { xaxis: own[0], yaxis: own[1], zaxis: own[2], aspectmode: "manual", aspectratio: { x, y, z },
      camera: { eye: { x: 1.0, y: -1.4, z: 0.55 }, projection: { type: "orthographic" } } } };
}

const cursor = (theme) => ({ type: "line", yref: "paper", y0: 0, y1: 1, x0: motion.own.t[motion.row],
  x1: motion.own.t[motion.row], line: { color: theme.mark, width: 2 } });

function drawOverTime([place, name, words, unit]) {
  const { own } = motion, t = Array.from(own.t), names = name === "path" ? ["x", "y", "z"] : own.cables;
  const look = (k) => ({ width: 1.8, color: PALETTE[k % PALETTE.length],
    dash: DASHES[(k + Math.floor(k / PALETTE.length)) % DASHES.length] });
  const traces = names.map((label, k) => ({ type: "scatter", mode: "lines", name: label, x: t, line: look(k),
    y: columnOf(own[name], names.length, k), hovertemplate: `%{y:.4g} ${unit}` }));
  const [low, high] = extremes(own[name]), limits = (own.limits[name] ?? [])
    .flatMap((limit) => (name === "rate" ? [limit, { ...limit, value: -limit.value }] : [limit]));
  const near = limits.filter((limit) => Math.abs(limit.value) < 3 * Math.max(-low, high));
  const beyond = limits.filter((limit) => limit.value >= 3 * Math.max(-low, high)).map((limit) => limit.value);
  const above = beyond.length ? `; largest allowed ${shown(Math.min(...beyond), 4)} ${unit}, above the chart` : "";
  const level = (limit) => ({ xref: "paper", x: 0.01, xanchor: "left", y: limit.value,
    yanchor: limit.words[0] === "s" || limit.value < 0 ? "bottom" : "top", showarrow: false,
    text: `${limit.words} ${shown(Math.abs(limit.value), 4)} ${unit}` });
  Plotly.react(place, traces, layoutOf((axis, theme) => ({
    hovermode: "x unified", legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { size: 11 } },
    showlegend: true, margin: { l: 60, r: 30, t: 30, b: 45 },
    modebar: { orientation: "v" },
    xaxis: { ...axis, title: { text: `time (s)${above}` }, hoverformat: ".4g" },
    yaxis: { ...axis, title: { text: `${words} (${unit})` }, rangemode: name === "tension" ? "tozero" : "normal" },
    shapes: [cursor(theme),
      ...own.failingIn[name].map(([x0, x1]) => ({ type: "rect", yref: "paper", y0: 0, y1: 1, x0, x1, layer: "below",
        fillcolor: FAILS, line: { color: FAILS, width: 1 } })),
      ...own.segments.slice(0, -1).map((part) => ({ type: "line", yref: "paper", y0: 0, y1: 1, x0: part.end,
        x1: part.end, line: { color: theme.soft, width: 1, dash: "dot" } })),
      ...near.map((limit) => ({ type: "line", xref: "paper", x0: 0, x1: 1, y0: limit.value, y1: limit.value,
        line: { color: theme.mark, width: 1.5, dash: "dash" } }))],
    annotations: near.map(level),
  })), CHARTS);
}

// Path speeds over the path: from which the end can be reached, of the motion, and what binds it.
function drawPaths() {
  const { paths } = motion.own;
  element("paths").hidden = !paths;
  if (!paths) return;
  const { s, least, largest, actual, allowed, binds, sections } = paths, known = actual.filter((speed) => speed !== null);
  const high = largest.filter((speed) => speed !== null), top = 1.25 * Math.max(...(known.length ? known : high), 1e-9);
  const cut = (values) => values.flatMap((value, k) => (k && sections[k] !== sections[k - 1] ? [null, value] : [value]));
  const along = cut(s), line = (values, extra) => ({ type: "scatter", mode: "lines", x: along, y: cut(values),
    hoverinfo: "skip", ...extra });
  // Around the area of each section: along its largest speeds, and back along its least ones.
  const places = s.map((_, k) => k).filter((k) => least[k] !== null);
  const around = [...new Set(sections)].flatMap((section) => {
    const inside = places.filter((k) => sections[k] === section), back = [...inside].reverse();
    return [...inside.map((k) => ({ s: s[k], speed: Math.min(largest[k], 2 * top) })),
      ...back.map((k) => ({ s: s[k], speed: least[k] })), { s: null, speed: null }];
  });
  const edge = { color: PALETTE[0], width: 1 }, stops = s.filter((_, k) => k && sections[k] !== sections[k - 1]);
  const limit = allowed.some((speed) => speed !== null && speed < top) ? [line(allowed, { name: "limits of speeds",
    line: { color: colours().mark, width: 1.5, dash: "dash" } })] : [];
  const named = [...new Set(binds)].filter((words) => words !== "nothing");
  const behind = (k, words) => binds[k] === words || (k && binds[k - 1] === words && sections[k] === sections[k - 1]);
  const bound = named.map((words, i) => line(actual.map((speed, k) => (behind(k, words) ? speed : null)),
    { name: words, line: { color: PALETTE[(i + 1) % PALETTE.length], width: 3 } }));
  Plotly.react("paths", [
    { type: "scatter", mode: "lines", x: around.map((k) => k.s), y: around.map((k) => k.speed), hoverinfo: "skip", line: edge,
      name: "the end can be reached", fill: "toself", fillcolor: "rgba(0, 114, 178, 0.18)" },
    ...limit, line(actual, { name: "motion", line: { color: colours().ink, width: 1.5 }, hoverinfo: "all", text: cut(binds),
      hovertemplate: "%{y:.4g} m/s; binds: %{text}<extra></extra>" }), ...bound,
  ], layoutOf((axis, theme) => ({
    hovermode: "x", legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { size: 11 } },
    showlegend: true, margin: { l: 60, r: 30, t: 30, b: 45 }, modebar: { orientation: "v" },
    xaxis: { ...axis, title: { text: "path coordinate s (m)" }, hoverformat: ".4g" },
    yaxis: { ...axis, title: { text: "path speed s' (m/s)" }, range: [0, top] },
    shapes: stops.map((x) => ({ type: "line", yref: "paper", y0: 0, y1: 1, x0: x, x1: x,
      line: { color: theme.soft, width: 1, dash: "dot" } })),
  })), CHARTS);
}

const charts = () => OVER_TIME.filter(([, name]) => motion.own[name]);

function tellSegments() {
  const { own } = motion, time = own.t[motion.row];
  const rows = own.segments.map((part, k) => [k + 1, `${shown(part.start, 4)} – ${shown(part.end, 4)} s`,
    part.arcs || "–", part.margin === null ? "–" : shown(part.margin, 4),
    part.isFeasible ? "feasible" : part.verdict]);
  if (rows.length) rowsInto(element("segments"), rows, ["segment", "time", "arcs", "margin (N)", "verdict"]);
  const now = own.segments.findIndex((part) => time <= part.end);
  if (own.segments.length > 1 && now >= 0) element("segments").rows[now + 1].className = "now";
}

function setRow(row) {
  const { own } = motion;
  motion.row = Math.min(Math.max(row, 0), own.count - 1);
  const now = moving(motion.row), which = now.x.map((_, k) => k), theme = colours();
  const shades = [...now.shades, theme.ink, theme.ink];
  Plotly.restyle("robot", { x: now.x, y: now.y, z: now.z, "line.color": shades }, which);
  const time = { "shapes[0].x0": own.t[motion.row], "shapes[0].x1": own.t[motion.row] };
  charts().forEach(([place]) => Plotly.relayout(place, time));
  element("time").value = motion.row;
  element("clock").textContent = `${own.t[motion.row].toFixed(2)} of ${own.t[own.count - 1].toFixed(2)} s`;
  tellSegments();
}

function play(isOn) {
  cancelAnimationFrame(motion.playing);
  motion.playing = null;
  element("play").textContent = isOn ? "❚❚" : "▶";
  element("play").setAttribute("aria-label", isOn ? "pause" : "play");
  if (!isOn) return;
  if (motion.row === motion.own.count - 1) setRow(0);
  let last = performance.now(), time = motion.own.t[motion.row];
  const step = (now) => {
    time += ((now - last) / 1000) * Number(element("speed").value);
    last = now;
    const { own } = motion;
    let row = motion.row;
    while (row < own.count - 1 && own.t[row + 1] <= time) row += 1;
    if (row !== motion.row) setRow(row);
    if (row === own.count - 1) play(false);
    else motion.playing = requestAnimationFrame(step);
  };
  motion.playing = requestAnimationFrame(step);
}

async function showMotion(number) {
  play(false);
  motion.own = await loaded(number);
  motion.range = extremes(motion.own.tension);
  motion.row = 0;
  element("motion-title").textContent = motion.own.title;
  element("time").max = motion.own.count - 1;
  drawMotion();
}

function drawMotion() {
  drawRobot();
  OVER_TIME.forEach(([place, name]) => { element(place).hidden = !motion.own[name]; });
  charts().forEach(drawOverTime);
  drawPaths();
  rowsInto(element("facts"), motion.own.facts);
  setRow(motion.row);
}
