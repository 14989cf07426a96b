// Charts of lines over time alone, as of a recorded log, and what is worth saying above them.
async function startCharts() {
  element("charts-side").hidden = !content.charts;
  if (!content.charts) return;
  element("findings").replaceChildren(...content.facts.map((text) => made("li", text)));
  content.drawn = await Promise.all(content.charts.map(async (chart, k) => {
    const place = made("div", "", { id: `chart-${k}` });
    element("lines").append(made("h3", chart.title), place);
    return { ...chart, place, t: await unpacked(chart.t), lines: await unpacked(chart.lines) };
  }));
  drawCharts();
}

function drawCharts() {
  for (const chart of content.drawn ?? []) drawLines(chart);
}

function drawLines({ place, t, lines, names, unit, title, levels, bands, isPaired }) {
  const time = Array.from(t), count = time.length;
  const traces = names.map((name, k) => {
    const colour = isPaired ? Math.floor(k / 2) : k;
    return { type: "scatter", mode: "lines", name, x: time, y: Array.from(lines.subarray(k * count, (k + 1) * count)),
      hovertemplate: `%{y:.4g} ${unit}`, connectgaps: false, line: { width: isPaired && k % 2 ? 1.2 : 1.8,
        color: PALETTE[colour % PALETTE.length], dash: isPaired ? (k % 2 ? "dot" : "solid")
          : DASHES[Math.floor(colour / PALETTE.length) % DASHES.length] } };
  });
  Plotly.react(place, traces, layoutOf((axis, theme) => ({
    hovermode: "x unified", showlegend: names.length > 1,
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { size: 11 } },
    margin: { l: 60, r: 30, t: 30, b: 45 }, modebar: { orientation: "v" },
    xaxis: { ...axis, title: { text: "time (s)" }, hoverformat: ".4g" },
    yaxis: { ...axis, title: { text: `${title} (${unit})` }, rangemode: "tozero" },
    shapes: [
      ...bands.map(([x0, x1]) => ({ type: "rect", yref: "paper", y0: 0, y1: 1, x0, x1, layer: "below",
        fillcolor: FAILS, line: { color: FAILS, width: 1 } })),
      ...levels.map(({ value }) => ({ type: "line", xref: "paper", x0: 0, x1: 1, y0: value, y1: value,
        line: { color: theme.mark, width: 1.5, dash: "dash" } }))],
    annotations: levels.map(({ words, value }) => ({ xref: "paper", x: 0.01, xanchor: "left", y: value,
      yanchor: "bottom", showarrow: false, text: `${words} ${shown(value, 4)} ${unit}` })),
  })), CHARTS);
}
