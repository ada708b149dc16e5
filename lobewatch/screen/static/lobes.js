import { ask } from "./link.js";
import { unbroken } from "./unbroken.js";

const STORED = ["modes", "modes_y", "teeth", "material", "diameter_mm", "radial_depth_mm", "direction", "speeds", "speed_rpm", "depth_mm"];
const VERDICTS = { stable: "STABLE", "not stable": "NOT STABLE", doubtful: "DOUBTFUL", unknown: "UNKNOWN" };
const at = (id) => document.getElementById(id);
const element = (tag, text) => Object.assign(document.createElement(tag), { textContent: unbroken(text) });
const grouped = (value) => Math.round(value).toLocaleString("en").replaceAll(",", " ");

for (const id of STORED) at(id).value = localStorage.getItem(`lobes-${id}`) ?? at(id).value;

function show(id) {
  for (const part of ["error", "busy", "result"]) at(part).hidden = part !== id;
  at("answer").scrollIntoView();
}

function entered() {
  const values = Object.fromEntries(STORED.map((id) => [id, at(id).value.trim()]).filter(([, value]) => value));
  for (const id of ["modes", "modes_y"]) if (values[id]) values[id] = values[id].split("\n").filter((line) => line.trim());
  return values;
}

function pocketRow(pocket) {
  const row = document.createElement("tr");
  const [low, high] = pocket.window_rpm;
  const cells = [grouped(pocket.speed_rpm), `${grouped(low)} to ${grouped(high)}`, pocket.depth_mm.toFixed(2)];
  row.append(...cells.map((text) => element("td", text)));
  return row;
}

function showResult(answer) {
  const [program] = answer.programs;
  at("verdict").textContent = program ? VERDICTS[program.verdict] : "";
  at("verdict").dataset.kind = program?.verdict.replace(" ", "-") ?? "";
  at("verdict").hidden = !program;
  URL.revokeObjectURL(at("figure").src);
  at("figure").src = URL.createObjectURL(new Blob([answer.svg], { type: "image/svg+xml" }));
  at("pockets").hidden = !answer.pockets.length;
  at("pockets").tBodies[0].replaceChildren(...answer.pockets.map(pocketRow));
  const remarks = [...answer.remarks, ...(program?.remarks ?? [])];
  at("texts").replaceChildren(...remarks.map(({ text, cure }) => element("li", cure ? `${text}. ${cure}.` : `${text}.`)));
  show("result");
}

at("form").addEventListener("submit", async (event) => {
  event.preventDefault();
  for (const id of STORED) localStorage.setItem(`lobes-${id}`, at(id).value);
  show("busy");
  at("send").disabled = true;
  await ask("chart", "POST", entered()).then(showResult).catch((error) => {
    at("error").textContent = unbroken(error.message);
    show("error");
  });
  at("send").disabled = false;
});
