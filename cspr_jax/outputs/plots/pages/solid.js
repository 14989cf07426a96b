// The boundary of a workspace in space, with its robot, for the points of the other axes that the sliders choose.
const SURFACE = "#56b4e9", END_OF_GRID = "#9a9a9a", CABLE = "#d55e00";
const solid = { own: [], shown: null };

async function startSolid() {
  if (!content.solid) return;
  solid.own = await Promise.all(content.solid.solids.map(async (own) => (own === null ? null
    : { ...own, corners: await unpacked(own.corners), pieces: await unpacked(own.pieces), isEnd: await unpacked(own.isEnd) })));
  drawSolid();
}

function drawSolid() {
  if (!solid.own.length) return;
  const { axes, counts, isDown, bodies } = content.solid, places = [...map.index, ...map.cell];
  const own = solid.own[axes.reduce((sum, k, i) => sum * counts[i] + places[k], 0)];
  element("solid-title").textContent = own ? `in space: ${own.volume}` : "in space: nothing is inside";
  element("solid").hidden = !own;
  if (!own) return;
  const corners = [0, 1, 2].map((k) => columnOf(own.corners, 3, k)), theme = colours();
  const part = (isEnd, name, color) => {
    const pieces = Array.from(own.isEnd, (_, n) => n).filter((n) => Boolean(own.isEnd[n]) === isEnd);
    const [i, j, k] = [0, 1, 2].map((side) => pieces.map((n) => own.pieces[3 * n + side]));
    return { type: "mesh3d", x: corners[0], y: corners[1], z: corners[2], i, j, k, color, opacity: 0.4, name,
      hoverinfo: "skip", showlegend: pieces.length > 0, visible: pieces.length > 0, flatshading: false };
  };
  const lines = (groups, extra) => {
    const [x, y, z] = [0, 1, 2].map((k) => groups.flatMap((line) => [...line.map((point) => point[k]), null]));
    return { type: "scatter3d", mode: "lines", x, y, z, hoverinfo: "skip", ...extra };
  };
  const base = own.ways.map((way) => way[0]);
  const points = (k) => [...corners[k], ...own.ways.flat().map((point) => point[k]),
    ...bodies.flatMap((body) => body.corners.map((point) => point[k]))];
  const ranges = withMargin([0, 1, 2].map((k) => extremes(points(k))));
  const traces = [part(false, "workspace", SURFACE), part(true, "end of the grid", END_OF_GRID),
    lines(own.ways, { name: "cables", line: { width: 3, color: CABLE } }),
    lines(own.edges, { name: "platform", showlegend: false, line: { width: 5, color: theme.ink } }),
    { type: "scatter3d", mode: "markers+text", name: "spools", hoverinfo: "skip", x: base.map((point) => point[0]),
      y: base.map((point) => point[1]), z: base.map((point) => point[2]), text: spoolNames(base),
      textposition: "top center", textfont: { color: theme.ink }, marker: { size: 4, symbol: "square", color: theme.soft } },
    ...bodies.flatMap((body, k) => surface(body, k === 0)), ...sectionHere(ranges, places, lines, theme)];
  Plotly.react("solid", traces, layoutOf((_, own) => spaceOf(ranges, isDown, own, "solid")), CHARTS);
}

// The plane of the map beside it.
function sectionHere(ranges, places, lines, theme) {
  const { section, plane } = content.solid;
  if (section === null) return [];
  const { values } = content.map.axes[section], third = [0, 1, 2].find((k) => !plane.includes(k));
  const corner = (a, b) => [0, 1, 2].map((k) => (k === third ? values[places[section]] : ranges[k][k === plane[0] ? a : b]));
  const around = [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0), corner(0, 0)];
  return [lines([around], { name: "section of the map", line: { width: 3, color: theme.soft, dash: "dash" } })];
}
