// A sparkline: the change of a frequency over time, and the limit below it.
const WIDTH = 120;
const HEIGHT = 36;
const EDGE = 3;

export function drawCourse(svg, { points, limits, fall, change }) {
  if (!points.length) return;
  const limit = -(limits.find((one) => fall === null || fall < one) ?? limits.at(-1));
  const low = Math.min(limit, ...points.map(([, percent]) => percent));
  const high = Math.max(0, ...points.map(([, percent]) => percent));
  const [first, last] = [points[0][0], points.at(-1)[0]];
  const x = (day) => (last > first ? EDGE + ((WIDTH - 2 * EDGE) * (day - first)) / (last - first) : WIDTH / 2);
  const y = (percent) => EDGE + ((HEIGHT - 2 * EDGE) * (high - percent)) / (high - low);
  const part = (name, settings) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(settings)) made.setAttribute(key, value);
    svg.append(made);
  };
  part("line", { x1: 0, x2: WIDTH, y1: y(limit), y2: y(limit) });
  const at = points.map(([day, percent]) => `${x(day).toFixed(1)} ${y(percent).toFixed(1)}`);
  const line = at.length > 1 ? at.join("L") : `${WIDTH / 2 - EDGE} ${y(points[0][1])}h${2 * EDGE}`;
  part("path", { d: `M${line}` });
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", `frequency change since the first tests: ${change}, limit ${limit} %`);
}
