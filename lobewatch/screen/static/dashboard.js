import { ask } from "./link.js";
import { drawCourse } from "./course.js";
import { unbroken } from "./unbroken.js";

const REFRESH_MS = 5000;
const WORDS = { alarm: "✗ ALARM", unknown: "? UNKNOWN", warn: "! WARNING", good: "✓ GOOD" };
const FILTERS = { all: "All", ...WORDS, due: "Test due" };
const at = (id) => document.getElementById(id);
const isDue = ({ days_left: left }) => left === null || left < 0;
const made = (tag, settings) => Object.assign(document.createElement(tag), settings);

const shown = new Map(); // by machine: its row and its element
const failed = new Map(); // by machine: error of its buttons
let list = { version: "", machines: [], may_alter: false };
let filter = sessionStorage.getItem("filter") in FILTERS ? sessionStorage.getItem("filter") : "all";

function fail(text) {
  at("error").textContent = text;
  at("error").hidden = !text;
}

function fallText({ series, finding }) {
  return series && `${series}: ${finding}`;
}

// The frequency change with a bar whose end is the last limit, so that 0.15 % looks different from 10 %.
function showSize(place, { fall, change, limits }) {
  if (!change.endsWith("%")) return;
  place.textContent = `${change.split(" ")[0]} %`; // its interval is in the text below
  place.style.setProperty("--share", Math.min(Math.max(fall / limits.at(-1), 0), 1.25));
  place.title = `frequency change since the first tests (alarm at -${limits.at(-1)} %)`;
}

function dueText({ last_tap: last, days_left: left }) {
  if (!last) return "";
  const days = left < 0 ? Math.ceil(-left) : Math.floor(left);
  const many = `${days} day${days === 1 ? "" : "s"}`;
  if (left < 0) return `overdue by ${many}`;
  return days ? `due in ${many}` : "due today";
}

// Opens the address that the server returns. An error is shown next to the button.
async function go(button, key, path, body) {
  const say = (text) => {
    failed.set(key, text);
    const place = shown.get(key).element.querySelector(".failed");
    place.textContent = text;
    place.hidden = !text;
  };
  say("");
  button.disabled = true;
  await ask(path, "POST", body).then(({ url }) => location.assign(url), (error) => say(error.message));
  button.disabled = false;
}

function addStarts(item, machine, path) {
  const { key, running, interrupted } = machine;
  for (const button of item.querySelectorAll(".start")) {
    const { direction } = button.dataset;
    if (running) button.textContent = "Watch test";
    const offered = running ? direction === "x" : list.may_alter && machine.has_port;
    button.hidden = !offered || (direction === "xy" && !("xy" in interrupted));
    if (running) button.addEventListener("click", () => location.assign(`/tap/${encodeURIComponent(key)}/`));
    else button.addEventListener("click", () => go(button, key, `${path}/start`, { direction }));
  }
  for (const [direction, count] of Object.entries(running || !list.may_alter || !machine.has_port ? {} : interrupted)) {
    const restart = made("button", { type: "button", className: "restart", textContent: `Restart ${direction}` });
    restart.addEventListener("click", () => go(restart, key, `${path}/start`, { direction, resume: false }));
    item.querySelector(`.start[data-direction=${direction}]`).after(restart);
    item.querySelector(".port").append(` START ${direction} continues the interrupted test with ${count} saved hit${count === 1 ? "" : "s"}.`);
  }
}

function row(machine) {
  const item = at("machine").content.cloneNode(true).firstElementChild;
  const part = (name) => item.querySelector(`.${name}`);
  const { key } = machine;
  const path = `/machines/${encodeURIComponent(key)}`;
  item.dataset.key = key;
  part("light").dataset.light = machine.light;
  part("light").classList.toggle("early", machine.is_early);
  part("light").textContent = machine.word;
  showSize(part("size"), machine);
  part("name").textContent = machine.name;
  part("reason").textContent = unbroken(machine.note || fallText(machine));
  part("fall").textContent = unbroken(fallText(machine));
  part("note").textContent = unbroken(machine.note);
  part("next").textContent = unbroken(machine.next_step);
  part("port").textContent = machine.has_port || machine.light === "unknown" ? "" : "START needs the DAQ port. Set port in [daq] of machine.toml.";
  part("limit").textContent = machine.limit;
  part("due").textContent = dueText(machine);
  part("due").classList.toggle("overdue", isDue(machine));
  part("due").title = machine.last_tap
    ? `last tap test ${machine.last_tap.slice(0, 10)}, ${machine.tap_age_days} d ago`
    : "";
  drawCourse(part("course"), machine);
  part("report").disabled = !machine.last_tap;
  part("report").addEventListener("click", ({ target }) => go(target, key, `${path}/report`));
  part("failed").textContent = failed.get(key) ?? "";
  part("failed").hidden = !failed.get(key);
  addStarts(item, machine, path);
  return item;
}

// An answer holds all machines, or those that have changed, each with its place in the new list, in order of these.
function take({ version, may_alter, machines, changed, gone }) {
  if (!machines) {
    const others = new Set([...gone, ...changed.map(([, { key }]) => key)]);
    machines = list.machines.filter(({ key }) => !others.has(key));
    for (const [place, machine] of changed) machines.splice(place, 0, machine);
  }
  const keys = new Set(machines.map(({ key }) => key));
  for (const key of shown.keys()) if (!keys.has(key)) shown.delete(key);
  list = { version, may_alter, machines };
}

// Only changed rows are rebuilt, so that an open or focused row stays.
function show() {
  for (const machine of list.machines) {
    const old = shown.get(machine.key);
    if (old?.machine === machine) continue;
    const element = row(machine);
    element.querySelector("details").open = old?.element.querySelector("details").open ?? false;
    shown.set(machine.key, { machine, element });
  }
  const wanted = list.machines.filter((one) => filter === "all" || one.light === filter || (filter === "due" && isDue(one)));
  const elements = new Set(wanted.map(({ key }) => shown.get(key).element));
  for (const element of [...at("machines").children]) if (!elements.has(element)) element.remove();
  let next = at("machines").firstElementChild;
  for (const element of elements) {
    if (element === next) next = next.nextElementSibling;
    else at("machines").insertBefore(element, next);
  }
  at("phone").hidden = !list.may_alter;
  at("none").hidden = !list.machines.length || elements.size > 0;
  showFilter();
}

function showFilter() {
  const count = (name) => list.machines.filter((one) => name === "all" || one.light === name || (name === "due" && isDue(one))).length;
  for (const [name, word] of Object.entries(FILTERS)) {
    const id = `filter-${name}`;
    if (!at(id)) {
      const button = made("button", { type: "button", id });
      button.addEventListener("click", () => {
        filter = name;
        sessionStorage.setItem("filter", name);
        show();
      });
      at("filter").append(button);
    }
    at(id).textContent = `${word} ${count(name)}`;
    at(id).setAttribute("aria-pressed", String(filter === name));
  }
}

async function refresh() {
  try {
    const answer = await ask(`machines?known=${list.version}`);
    take(answer);
    show();
    if (at("error").dataset.lost) fail("");
    delete at("error").dataset.lost;
  } catch (error) {
    fail(error.message);
    at("error").dataset.lost = "yes";
  }
  setTimeout(refresh, REFRESH_MS);
}

refresh();
