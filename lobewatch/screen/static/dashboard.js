import { ask } from "./link.js";

const REFRESH_MS = 5000;
const WORDS = { good: "✓ GOOD", warn: "! WARNING", alarm: "✗ ALARM", unknown: "? UNKNOWN" };
const at = (id) => document.getElementById(id);

function fail(text) {
  at("error").textContent = text;
  at("error").hidden = !text;
}

function fallText({ fall, fall_std: std, series }) {
  if (fall === null) return series;
  if (std === 0) return `${series}: first test, nothing to compare it with yet`;
  const digits = std === null ? 2 : Math.min(Math.max(1 - Math.floor(Math.log10(std)), 1), 4);
  const error = std === null ? "" : ` ± ${std.toFixed(digits)}`;
  return `${series}: frequency ${fall >= 0 ? "fallen" : "risen"} by ${Math.abs(fall).toFixed(digits)}${error} % since the first test`;
}

function dueText({ last_tap: last, days_left: left }) {
  if (!last) return ["", ""];
  const days = left < 0 ? Math.ceil(-left) : Math.round(left);
  const many = `${days} day${days === 1 ? "" : "s"}`;
  return [`last tap test ${last.slice(0, 10)}`, left < 0 ? `overdue by ${many}` : `next due in ${many}`];
}

// The address that an action leads to is opened; what went wrong stands on the page.
async function go(button, path, body) {
  fail("");
  button.disabled = true;
  await ask(path, "POST", body).then(({ url }) => location.assign(url), (error) => fail(error.message));
  button.disabled = false;
}

function row(machine, mayAlter) {
  const item = at("machine").content.cloneNode(true).firstElementChild;
  const part = (name) => item.querySelector(`.${name}`);
  const path = `/machines/${encodeURIComponent(machine.key)}`;
  item.dataset.key = machine.key;
  part("light").dataset.light = machine.light;
  part("light").textContent = WORDS[machine.light];
  part("name").textContent = machine.name;
  part("fall").textContent = fallText(machine);
  part("note").textContent = machine.note;
  part("next").textContent = machine.next_step;
  const [last, due] = dueText(machine);
  part("dates").append(last, document.createElement("br"), Object.assign(document.createElement("span"), { textContent: due, className: machine.days_left < 0 ? "overdue" : "" }));
  part("report").disabled = !machine.last_tap;
  part("report").addEventListener("click", ({ target }) => go(target, `${path}/report`));
  for (const button of item.querySelectorAll(".start")) {
    if (machine.running) button.textContent = "Watch the test";
    button.hidden = machine.running ? button.dataset.direction === "y" : !mayAlter;
    if (mayAlter) button.addEventListener("click", ({ target }) => go(target, `${path}/start`, { direction: target.dataset.direction }));
    else button.addEventListener("click", () => location.assign(`/tap/${encodeURIComponent(machine.key)}/`));
  }
  for (const [direction, count] of Object.entries(machine.running || !mayAlter ? {} : machine.interrupted)) {
    const anew = Object.assign(document.createElement("button"), { type: "button", className: "anew", textContent: `Begin ${direction} anew` });
    anew.addEventListener("click", () => go(anew, `${path}/start`, { direction, resume: false }));
    item.querySelector(`.start[data-direction=${direction}]`).after(anew);
    part("next").append(` An interrupted test in ${direction} has ${count} hit${count === 1 ? "" : "s"}: START ${direction} goes on with it.`);
  }
  return item;
}

let shown = "";

async function refresh() {
  try {
    const { machines, may_alter: mayAlter } = await ask("machines");
    const text = JSON.stringify(machines.map((one) => ({ ...one, days_left: Math.round(one.days_left) })));
    if (text !== shown) at("machines").replaceChildren(...machines.map((one) => row(one, mayAlter)));
    shown = text;
    if (at("error").dataset.lost) fail("");
    delete at("error").dataset.lost;
  } catch (error) {
    fail(error.message);
    at("error").dataset.lost = "yes";
  }
  setTimeout(refresh, REFRESH_MS);
}

refresh();
