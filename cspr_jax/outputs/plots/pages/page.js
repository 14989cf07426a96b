// What map and motion share: elements, values, colours of the theme.
const content = JSON.parse(document.getElementById("content").textContent);
const TYPES = { Uint8Array, Uint16Array, Int32Array, Float32Array };
const CHARTS = { displaylogo: false, responsive: true };
const element = (id) => document.getElementById(id);

async function unpacked(given) {
  const bytes = Uint8Array.from(atob(given.data), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new TYPES[given.type](await new Response(stream).arrayBuffer());
}

function made(tag, text, attributes = {}) {
  const node = Object.assign(document.createElement(tag), attributes);
  node.textContent = text;
  return node;
}

function rowsInto(table, rows, heads = null) {
  table.replaceChildren();
  for (const cells of heads ? [heads, ...rows] : rows) {
    const row = table.insertRow();
    const isHead = cells === heads;
    cells.forEach((text, k) => row.append(made(isHead || (!heads && k === 0) ? "th" : "td", text)));
  }
}

// As many digits as a stored number of single precision has, at most.
const shown = (value, digits = 6) => {
  if (Number.isNaN(value)) return "–";
  if (!Number.isFinite(value) || Math.abs(value) > 2e38) return value > 0 ? "∞" : "−∞";
  return String(Number(value.toPrecision(digits)));
};
const withUnit = (text, unit) => (unit && text !== "–" ? text + (unit === "°" ? "" : " ") + unit : text);

function colours() {
  const style = getComputedStyle(document.documentElement);
  const own = (name) => style.getPropertyValue(name).trim();
  return { paper: own("--paper"), ink: own("--ink"), soft: own("--soft"), line: own("--line"), mark: own("--mark") };
}

function layoutOf(extra) {
  const own = colours();
  const axis = { gridcolor: own.line, zerolinecolor: own.line, linecolor: own.line, automargin: true };
  return {
    paper_bgcolor: own.paper, plot_bgcolor: own.paper, font: { color: own.ink, size: 13 },
    margin: { l: 60, r: 10, t: 10, b: 50 }, hoverlabel: { align: "left" }, ...extra(axis, own),
  };
}
