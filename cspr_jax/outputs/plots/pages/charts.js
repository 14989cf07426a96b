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

function drawLines({ place, t, lines, names, unit, axis: words, levels, intervals, isPaired }) {
  const time = Array.from(t), count = time.length;
  const traces = names.map((name, k) => {
    const cable = isPaired ? Math.floor(k / 2) : k, cycle = Math.floor(cable / PALETTE.length);
    const isPlanned = isPaired && k % 2 === 1;
    return { type: "scatter", mode: "lines", name, x: time, y: Array.from(lines.subarray(k * count, (k + 1) * count)),
      hovertemplate: `%{y:.4g} ${unit}`, connectgaps: false, showlegend: !isPlanned, legendgroup: `${cable}`,
      line: { width: isPlanned ? 1.2 : 1.8, color: PALETTE[cable % PALETTE.length],
        dash: isPlanned ? "dot" : DASHES[cycle % DASHES.length] } };
  });
  Plotly.react(place, traces, layoutOf((axis, theme) => ({
    hovermode: "x unified", showlegend: names.length > 1,
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { size: 11 } },
    margin: { l: 60, r: 30, t: 30, b: 45 }, modebar: { orientation: "v" },
    xaxis: { ...axis, title: { text: "time (s)" }, hoverformat: ".4g" },
    yaxis: { ...axis, title: { text: words }, rangemode: "tozero" },
    shapes: [
      ...intervals.map(({ start, end }) => ({ type: "rect", yref: "paper", y0: 0, y1: 1, x0: start, x1: end,
        layer: "below", fillcolor: FAILS, line: { color: FAILS, width: 1 } })),
      ...levels.map(({ value }) => ({ type: "line", xref: "paper", x0: 0, x1: 1, y0: value, y1: value,
        line: { color: theme.mark, width: 1.5, dash: "dash" } }))],
    annotations: [
      ...intervals.map(({ words: text, start, end }) => ({ x: (start + end) / 2, yref: "paper", y: 0.99,
        yanchor: "top", showarrow: false, font: { size: 11 }, text })),
      ...levels.map(({ words: text, value }) => ({ xref: "paper", x: 0.99, xanchor: "right", y: value,
        yanchor: "bottom", showarrow: false, text: `${text} ${shown(value, 4)} ${unit}` }))],
  })), CHARTS);
}
