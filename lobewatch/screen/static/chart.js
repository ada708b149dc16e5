// A chart that fills its figure; what y is stands in the caption. uPlot is a global of its own script.
export const INK = "#111";
const GRID = { stroke: "#ddd", width: 1 };
const FONT = "13px system-ui, 'DejaVu Sans', sans-serif";

export const line = (stroke, dash) => ({ stroke, dash, width: 2, points: { show: false } });
const axis = (size, label) => ({ label, size, labelSize: 16, labelFont: FONT, font: FONT, stroke: INK, grid: GRID, ticks: GRID });
const isDecade = (v) => v !== null && Math.abs(Math.log10(v) % 1) < 1e-6;
const decade = (values) => values.map((v) => (isDecade(v) ? String(v) : ""));

export function chart(name, { x, range, xRange, series, log = false, draw = () => {}, over = () => {} }) {
  const figure = document.getElementById(name);
  const area = figure.appendChild(Object.assign(document.createElement("div"), { className: "area" }));
  const size = () => ({ width: Math.max(area.clientWidth, 80), height: Math.max(area.clientHeight, 60) });
  const plot = new uPlot(
    {
      ...size(),
      padding: [6, 18, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: { x: { time: false, range: xRange }, y: { distr: log ? 3 : 1, range } },
      axes: [axis(30, x), { ...axis(56), ...(log && { filter: (_, splits) => splits.map((v) => (isDecade(v) ? v : null)), values: (_, v) => decade(v) }) }],
      series: [{}, ...series],
      hooks: { drawClear: [draw], draw: [over] },
    },
    [[], ...series.map(() => [])],
    area,
  );
  new ResizeObserver(() => plot.setSize(size())).observe(area);
  return plot;
}
