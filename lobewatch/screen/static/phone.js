import { ask } from "./link.js";
import { unbroken } from "./unbroken.js";

const MAX_MB = 50;
const STORED = ["teeth", "speed_rpm", "depth_mm", "low_rpm", "high_rpm"];
const WORDS = { stable: "STABLE", chatter: "CHATTER", flip: "FLIP CHATTER", "cannot tell": "CANNOT TELL" };
const at = (id) => document.getElementById(id);
const put = (id, text) => { at(id).textContent = unbroken(text); };
const element = (tag, text) => Object.assign(document.createElement(tag), { textContent: unbroken(text) });

let recording = null;

for (const id of STORED) at(id).value = localStorage.getItem(id) ?? "";

for (const [id, other] of [["record", "choose"], ["choose", "record"]]) {
  at(id).addEventListener("change", () => {
    [recording] = at(id).files;
    at(other).value = "";
    put("chosen", recording ? `${recording.name}, ${(recording.size / 1e6).toFixed(1)} MB` : "No recording yet");
  });
}

let programs = [];
let unit = { name: "mm", mm: 1 };

const option = (name, text = name) => Object.assign(document.createElement("option"), { value: name, textContent: text });

ask("machines").then(({ machines }) => {
  at("machine").append(...machines.map((name) => option(name)));
  at("keep").hidden = !machines.length;
}).catch(() => {});

at("machine").addEventListener("change", async () => {
  const machine = at("machine").value;
  try {
    const answer = machine ? await ask(`machines/${encodeURIComponent(machine)}`) : { programs: [], units: "metric" };
    programs = answer.programs;
    useUnit(answer.units === "inch" ? { name: "in", mm: 25.4 } : { name: "mm", mm: 1 });
  } catch (error) {
    programs = [];
    fail(error.message);
  }
  at("program").replaceChildren(...programs.map(({ name }) => option(name)));
  at("program").disabled = !programs.length;
  enterProgram();
});

// A depth in the shown unit that is never deeper.
const shownDepth = (mm) => (unit.mm === 1 ? mm : Math.floor((mm / unit.mm) * 1e4 + 1e-6) / 1e4);
const depthInMm = () => Number(at("depth_mm").value) * unit.mm;

function useUnit(next) {
  const depth = at("depth_mm").value && depthInMm();
  unit = next;
  put("unit", unit.name);
  if (depth) at("depth_mm").value = shownDepth(depth);
}

// Enters what machine.toml says of the program.
function enterProgram() {
  const chosen = programs.find(({ name }) => name === at("program").value) ?? {};
  for (const id of ["teeth", "speed_rpm"]) if (chosen[id] != null) at(id).value = chosen[id];
  if (chosen.depth_mm != null) at("depth_mm").value = shownDepth(chosen.depth_mm);
}

at("program").addEventListener("change", enterProgram);

function show(id) {
  for (const part of ["error", "busy", "result"]) at(part).hidden = part !== id;
  at(id).scrollIntoView();
}

function fail(text) {
  put("error", text);
  show("error");
}

// Counts the seconds, as the duration is unknown.
function startClock() {
  const begin = performance.now();
  const tick = () => put("doing", `Sending and evaluating: ${Math.round((performance.now() - begin) / 1000)} s`);
  tick();
  show("busy");
  return setInterval(tick, 1000);
}

const grouped = (value) => Math.round(value).toLocaleString("en").replaceAll(",", " ");

function expectation({ depth_mm: depth, relative_depth: gain, window_rpm: [low, high] }) {
  const deeper = `about ${gain < 10 ? gain.toFixed(1) : "10 or more"} times as deep as at this speed`;
  return `${depth === null ? "" : `try ${shownDepth(depth)} ${unit.name}, `}${deeper}, best from ${grouped(low)} to ${grouped(high)} rpm`;
}

function speedItem(next) {
  const button = Object.assign(document.createElement("button"), { type: "button" });
  button.append(element("b", `${grouped(next.speed_rpm)} rpm`), element("span", expectation(next)));
  button.addEventListener("click", () => {
    at("speed_rpm").value = Math.round(next.speed_rpm);
    if (next.depth_mm !== null) at("depth_mm").value = shownDepth(next.depth_mm);
    at("form").scrollIntoView();
  });
  const item = document.createElement("li");
  item.append(button);
  return item;
}

function showResult(answer) {
  const hz = answer.chatter_frequency_hz;
  at("now").dataset.kind = answer.word.replace(" ", "-");
  put("word", WORDS[answer.word]);
  put("figure", hz === null ? "" : `${hz.toFixed(0)} Hz`);
  put("reason", answer.finding);
  put("kept", answer.saved ? `Kept in the journal of ${at("machine").value} as ${answer.saved.join(", ")}` : "");
  at("kept").hidden = !answer.saved;
  at("speeds").replaceChildren(...answer.next_speeds.map(speedItem));
  put("next-text", answer.next_text);
  at("texts").replaceChildren(...answer.texts.map((text) => element("li", text)));
  document.title = `${WORDS[answer.word]}: lobewatch`;
  show("result");
}

at("form").addEventListener("submit", async (event) => {
  event.preventDefault();
  if (!recording) return fail("No recording yet. Record a cut or choose a file.");
  if (recording.size > MAX_MB * 1e6) return fail(`The recording is larger than ${MAX_MB} MB. Send a shorter recording.`);
  const depth = at("depth_mm").value && depthInMm();
  const entered = (id) => (id === "depth_mm" ? depth : at(id).value);
  const values = [...STORED, "machine", "program"].map((id) => [id, entered(id)]).filter(([, value]) => value);
  for (const id of STORED) localStorage.setItem(id, entered(id));
  const clock = startClock();
  at("send").disabled = true;
  await ask(`recording?${new URLSearchParams(values)}`, "POST", recording).then(showResult).catch((error) => fail(error.message));
  clearInterval(clock);
  at("send").disabled = false;
});
