// The level while a cut is awaited, and the spectrum of the recorded cut with its lines.
import { chart, INK, line } from "./chart.js";

const SECONDS = 30;
const SHOWN = 1e-4;
const GREY = "#999";
// How lines are marked: colour, and strokes within a square of half a side 1; an arc is a circle.
const MARKS = {
  turns: ["#444", [[0, -1, 0, 1]]],
  tooth: ["#0072b2", "circle"],
  air: ["#6b3a5a", [[-1, -1, 1, 1], [-1, 1, 1, -1]]],
  chatter: ["#d55e00", [[0, -1, 1, 0], [1, 0, 0, 1], [0, 1, -1, 0], [-1, 0, 0, -1]]],
};
const MODES = { x: [2, 4], y: [8, 5] };
const MODE_COLOUR = "#00795a";
const SIDE = 5;

let times = [];
let levels = [];
let cut = {};
let top = 1;

const decades = (_, low, high) => (low > 0 ? [10 ** Math.floor(Math.log10(low)), 10 ** Math.ceil(Math.log10(1.3 * high))] : [0.1, 1]);
const level = chart("level", { x: "time (s)", range: decades, xRange: () => [-SECONDS, 0], log: true, series: [line("#0072b2")] });
const spectrum = chart("spectrum", {
  x: "frequency (Hz)", range: () => [SHOWN * top, 3 * top], log: true, xRange: () => [0, cut.frequency?.at(-1) ?? 1],
  series: [{ ...line(GREY), width: 1 }], draw: drawModes, over: drawLines,
});

export function showLevel(value) {
  if (!(value > 0)) return;
  const now = performance.now() / 1000;
  times.push(now);
  levels.push(value);
  const first = times.findIndex((time) => time > now - SECONDS);
  times = times.slice(first);
  levels = levels.slice(first);
  level.setData([times.map((time) => time - now), levels]);
}

export function showCut(curves) {
  cut = curves;
  const figure = document.getElementById("spectrum");
  figure.hidden = !cut.frequency;
  if (figure.hidden) return;
  top = cut.amplitude.reduce((most, one) => Math.max(most, one), 0);
  for (const name of figure.querySelectorAll("[data-lines]")) name.hidden = !cut[name.dataset.lines]?.length;
  spectrum.setData([cut.frequency, cut.amplitude]);
}

function inside(plot, draw) {
  const { left, top: upper, width, height } = plot.bbox;
  plot.ctx.save();
  plot.ctx.beginPath();
  plot.ctx.rect(left, upper, width, height);
  plot.ctx.clip();
  draw(plot.ctx, plot.bbox);
  plot.ctx.restore();
}

function drawModes(plot) {
  inside(plot, (ctx, { top: upper, height }) => {
    ctx.strokeStyle = MODE_COLOUR;
    ctx.lineWidth = 2 * devicePixelRatio;
    for (const [name, dashes] of Object.entries(MODES)) {
      ctx.setLineDash(dashes.map((one) => one * devicePixelRatio));
      for (const frequency of cut[name] ?? []) {
        const x = plot.valToPos(frequency, "x", true);
        ctx.beginPath();
        ctx.moveTo(x, upper);
        ctx.lineTo(x, upper + height);
        ctx.stroke();
      }
    }
  });
}

function drawLines(plot) {
  inside(plot, (ctx) => {
    ctx.lineWidth = 2 * devicePixelRatio;
    for (const [name, [colour, strokes]] of Object.entries(MARKS)) {
      ctx.strokeStyle = colour;
      (cut[name] ?? []).forEach((frequency, i) => {
        const [x, y] = [plot.valToPos(frequency, "x", true), plot.valToPos(cut[`${name}_amplitude`][i], "y", true)];
        mark(ctx, x, y, strokes, SIDE * devicePixelRatio);
      });
    }
  });
}

function mark(ctx, x, y, strokes, side) {
  ctx.beginPath();
  if (strokes === "circle") ctx.arc(x, y, side, 0, 2 * Math.PI);
  else for (const [x0, y0, x1, y1] of strokes) {
    ctx.moveTo(x + side * x0, y + side * y0);
    ctx.lineTo(x + side * x1, y + side * y1);
  }
  ctx.stroke();
}
