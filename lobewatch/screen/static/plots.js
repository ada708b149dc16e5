// The curves of the last hit and of the mean; what y is stands in the caption.
import { chart, INK, line } from "./chart.js";

const MEAN = "#0072b2";
const LAST = "#d55e00";
const COHERENCE_LIMIT = 0.8;
const LOWEST_SHARE = 0.05;
const FORCE_LIMIT_DB = -20;
const MICRO = 1e6;

let curves = { band: null };
let shown = { pulse: [0, 1], frequency: [0, 1], receptance: [0.001, 1] };
const charts = {};

function level(plot, value) {
  const { left, width } = plot.bbox;
  const y = plot.valToPos(value, "y", true);
  plot.ctx.save();
  plot.ctx.setLineDash([8, 6]);
  plot.ctx.lineWidth = 2;
  plot.ctx.strokeStyle = INK;
  plot.ctx.beginPath();
  plot.ctx.moveTo(left, y);
  plot.ctx.lineTo(left + width, y);
  plot.ctx.stroke();
  plot.ctx.restore();
}

function shadeBand(plot) {
  if (!curves.band) return;
  const { left, top, width, height } = plot.bbox;
  const [low, high] = curves.band.map((f) => Math.min(Math.max(plot.valToPos(f, "x", true), left), left + width));
  plot.ctx.save();
  plot.ctx.fillStyle = "#cfe8f8";
  plot.ctx.fillRect(low, top, high - low, height);
  plot.ctx.restore();
}

const whole = (_, low, high) => (low === high ? [low - 1, high + 1] : uPlot.rangeNum(low, high, 0.05, true));

// Whole decades about the lines that can be trusted: near 0 Hz an accelerometer shows noise over the square of f.
function decades({ frequency, mean, last, coherence, band }) {
  const trusted = (f, i) => (coherence ? coherence[i] >= COHERENCE_LIMIT : f >= LOWEST_SHARE * shown.frequency[1]);
  const inBand = (f, i) => f <= (band?.[1] ?? Infinity) && trusted(f, i);
  const values = (mean ?? last ?? []).filter((v, i) => v > 0 && inBand(frequency[i], i)).map((v) => v * MICRO);
  if (!values.length) return [0.001, 1];
  const top = Math.ceil(Math.log10(Math.max(...values)));
  const bottom = Math.max(Math.floor(Math.log10(Math.min(...values))), top - 4);
  return [10 ** Math.min(bottom, top - 1), 10 ** top];
}

export function makePlots() {
  const frequency = () => shown.frequency;
  charts.force = chart("force", { x: "time (ms)", range: whole, xRange: () => shown.pulse, series: [line(INK)] });
  charts.response = chart("response", { x: "time (ms)", range: whole, series: [line(INK)] });
  charts.frf = chart("frf", {
    x: "frequency (Hz)", range: () => shown.receptance, xRange: frequency, log: true,
    series: [line(LAST, [6, 4]), line(MEAN)],
  });
  charts.coherence = chart("coherence", {
    x: "frequency (Hz)", range: () => [0, 1.02], xRange: frequency, series: [line(MEAN)],
    draw: (plot) => level(plot, COHERENCE_LIMIT),
  });
  charts.spectrum = chart("spectrum", {
    x: "frequency (Hz)", range: () => [-60, 5], xRange: frequency, series: [line(INK)],
    draw: (plot) => { shadeBand(plot); level(plot, FORCE_LIMIT_DB); },
  });
}

export function showPlots(latest) {
  curves = latest;
  const none = curves.frequency.map(() => null);
  const time = curves.time.map((t) => t * 1000);
  const micro = (values) => values?.map((v) => (v > 0 ? v * MICRO : null)) ?? none;
  shown = { pulse: curves.force ? aroundPulse(time, curves.force) : [0, 1], frequency: [0, top(curves)] };
  shown.receptance = decades(curves);
  charts.force.setData([time, curves.force ?? time.map(() => null)]);
  charts.response.setData([time, curves.acceleration]);
  charts.frf.setData([curves.frequency, micro(curves.last), micro(curves.mean)]);
  charts.coherence.setData([curves.frequency, curves.coherence ?? none]);
  charts.spectrum.setData([curves.frequency, curves.force_spectrum ?? none]);
}

// From before the pulse to after the last sample above 5 % of it: a second touch is in the picture too.
function aroundPulse(time, force) {
  const limit = 0.05 * Math.max(...force);
  const first = force.findIndex((f) => f > limit);
  const last = force.findLastIndex((f) => f > limit);
  if (!(limit > 0) || first < 0) return [time[0], time.at(-1)];
  const margin = Math.max(time[last] - time[first], 2);
  return [time[first] - margin / 2, time[last] + margin];
}

// A half more than the usable band, in round figures, so that the axes stand still from hit to hit.
function top({ band, frequency }) {
  const highest = frequency.at(-1);
  if (!band) return highest;
  const step = 10 ** Math.floor(Math.log10(1.5 * band[1]));
  return Math.min(Math.ceil((1.5 * band[1]) / step) * step, highest);
}
