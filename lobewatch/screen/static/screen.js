import { ask, follow } from "./link.js";
import { makePlots, showPlots } from "./plots.js";
import { mute, play, showSound, unlock } from "./sounds.js";
import { at, element, flash, put, showWord } from "./word.js";

const UNDO_KEYS = ["u", "U", "PageUp"];
const STOP_AGAIN_MS = 3000;
const VERDICTS = ["good", "refused"];
const LIGHTS = ["good", "warn", "alarm"];

let state = null;
let stopTimer = null;
let undoing = false;
let over = false;
let aheadOfHit = false;
let mayAlter = false;

function showState(next) {
  const before = state;
  state = next;
  document.title = `${state.word} ${state.good}/${state.wanted}: ${state.title}`;
  put("title", state.title || "lobewatch");
  put("device", state.device);
  put("good", String(state.good));
  put("wanted", String(state.wanted));
  put("reason", state.reason || (state.hit_change?.text ?? ""));
  showWord(state.kind, state.word.replaceAll(", ", "\n"));
  showGuide();
  showMean();
  showLevels();
  if (JSON.stringify(state.hits) !== JSON.stringify(before?.hits)) showHits();
  if (JSON.stringify(state.checks) !== JSON.stringify(before?.checks)) showChecks();
  if (JSON.stringify(state.outcome) !== JSON.stringify(before?.outcome)) showOutcome();
  if (JSON.stringify(state.choices) !== JSON.stringify(before?.choices)) showChoices();
  showAccept();
  over = false;
  const finished = ["done", "failed"].includes(state.kind);
  at("undo").disabled = finished || state.good === 0;
  at("stop").disabled = finished;
  if (before) announce(before);
}

// A verdict arrives as a word and as a new hit, maybe in two states. States in between may be missing.
function announce(before) {
  const changed = state.kind !== before.kind;
  const another = (state.hits.at(-1)?.number ?? 0) > (before.hits.at(-1)?.number ?? 0);
  if (!VERDICTS.includes(state.kind)) {
    aheadOfHit = false;
  } else if (changed || (another && !aheadOfHit)) {
    flash();
    play(state.kind);
    aheadOfHit = !another;
  } else if (another) {
    aheadOfHit = false;
  }
  if (changed && state.kind === "done") play("done");
  if (changed && ["no-device", "failed"].includes(state.kind)) play("lost");
}

// Positions of hammer and sensor, until there is a curve. For a cross tap only the sensor is turned.
function showGuide() {
  const direction = state.direction || "x";
  const across = direction === "xy";
  at("plots").hidden = !(at("guide").hidden = state.has_plots && state.kind !== "move");
  at("guide").dataset.direction = direction;
  put("sensor-along", across ? "y" : direction);
  put("hammer-along", across ? "along x, at a right angle to the sensor" : `opposite the sensor, along ${direction}`);
}

function showMean() {
  const { mean_change: change, good, settled } = state;
  const percent = change === null ? "" : `${(100 * change).toPrecision(2)} %`;
  if (settled) put("change", percent ? `✓ Settled (last change ${percent})` : "✓ Settled");
  else if (percent) put("change", `Last change ${percent}`);
  else put("change", good ? "One good hit, no change yet" : "No good hit yet");
}

// Bars over six decades, 0.001 to 1000 of the unit; without a force sensor that of the response alone.
function showLevels() {
  document.body.classList.toggle("no-force", state.levels ? state.levels[0] === null : document.body.classList.contains("no-force"));
  const units = ["N", "m/s²"];
  ["force", "response"].forEach((name, i) => {
    const value = state.levels?.[i] ?? null;
    put(`${name}-level`, value === null ? "-" : `${value < 100 ? value.toPrecision(2) : value.toFixed(0)} ${units[i]}`);
    const share = value > 0 ? (Math.log10(value) + 3) / 6 : 0;
    at(`${name}-bar`).style.width = `${100 * Math.min(Math.max(share, 0), 1)}%`;
  });
}

function showHits() {
  at("hits").replaceChildren(
    ...state.hits.toReversed().map((hit) => {
      const row = element("li", "", hit.undone ? "undone" : hit.good ? "" : "bad");
      row.append(element("span", `${hit.number}`), element("span", hit.undone ? "" : hit.good ? "✓" : "✗"));
      row.append(element("span", hit.verdict), element("span", hit.peak), decideButton(hit));
      return row;
    }),
  );
}

// Every hit of the list can be accepted or rejected by a person.
function decideButton(hit) {
  const button = element("button", hit.good ? "Reject" : "Accept", "decide");
  button.type = "button";
  button.setAttribute("aria-label", `${button.textContent} hit ${hit.number}`);
  button.addEventListener("click", () => { button.blur(); decide(hit); });
  return button;
}

// The last hit has a large button of its own where it was refused.
function showAccept() {
  const last = state.hits.at(-1);
  const finished = ["done", "failed"].includes(state.kind);
  const refused = Boolean(last) && !last.good && !state.choices.length && !finished;
  at("accept").hidden = !(refused && mayAlter);
  put("accept-text", refused ? `Accept hit ${last.number}` : "");
}

function acceptLast() {
  if (!at("accept").hidden) decide(state.hits.at(-1));
}

async function decide(hit) {
  if (!hit || !mayAlter || ["done", "failed"].includes(state.kind)) return;
  await ask("decide", "POST", { hit: hit.number, accept: !hit.good }).catch((error) => toast(error.message));
}

function showChecks() {
  const failedFirst = state.checks.toSorted((a, b) => a.passed - b.passed);
  put("passed", state.checks.length ? `${state.checks.filter((one) => one.passed).length} of ${state.checks.length} passed` : "");
  at("checks").replaceChildren(
    ...failedFirst.map(({ name, passed, text }) => element("li", `${passed ? "✓" : "✗"} ${name}: ${text}`, passed ? "" : "bad")),
  );
}

function showOutcome() {
  const { outcome } = state;
  at("outcome").hidden = !outcome;
  if (!outcome) return;
  for (const lamp of at("light").children) lamp.classList.toggle("on", lamp.dataset.light === outcome.light);
  at("light").querySelector("[data-light=alarm]").textContent = outcome.is_early ? "✗ EARLY ALARM" : "✗ ALARM";
  at("light").hidden = !LIGHTS.includes(outcome.light);
  at("texts").replaceChildren(...outcome.texts.map((text) => element("li", text)));
  at("programs").replaceChildren(
    ...outcome.programs.map(({ program, word }) => {
      const row = element("li", `${program}: `);
      row.append(element("b", word, word.replaceAll(" ", "-")));
      return row;
    }),
  );
  put("next", outcome.next_step && `Next: ${outcome.next_step}`);
}

// Letters of the choices. Those of the two questions before the first hit differ: two presses answer only one.
const LETTERS = { start: "y", still: "s", x: "x", y: "y" };

// Between two tests the choices replace the buttons of a running test.
function showChoices() {
  const { choices } = state;
  at("choices").replaceChildren(
    ...choices.map(({ key, text }) => {
      const button = element("button", text);
      button.type = "button";
      if (state.kind === "ask") button.prepend(element("kbd", LETTERS[key].toUpperCase()), " ");
      button.addEventListener("click", () => { button.blur(); choose(key); });
      return button;
    }),
  );
  at("tool-form").hidden = true;
  showButtons();
}

function showButtons() {
  const choosing = Boolean(state?.choices.length);
  at("choices").hidden = !(choosing && mayAlter);
  at("undo").hidden = choosing || !mayAlter;
  at("stop").hidden = (choosing && state.kind !== "ask") || !mayAlter;
  document.body.classList.toggle("choosing", choosing);
  document.body.classList.toggle("may-alter", mayAlter && !choosing);
}

async function choose(key, tool = "") {
  if (key === "tool" && !tool) {
    at("tool-form").hidden = !at("tool-form").hidden;
    if (!at("tool-form").hidden) at("tool-name").focus();
    return;
  }
  await ask("choose", "POST", { key, tool }).catch((error) => toast(error.message));
}

// Before the test and while the sensor is moved, the foot switch selects the first choice.
function chooseByKey(key) {
  if (at("choices").hidden) return false;
  const keys = { move: UNDO_KEYS, ask: [...UNDO_KEYS, "Enter"] }[state.kind] ?? [];
  const isFirst = keys.includes(key);
  const chosen = state.choices.find((choice) => isFirst || LETTERS[choice.key] === key.toLowerCase());
  if (!chosen) return false;
  choose(chosen.key);
  return true;
}

// After a normal end of lobewatch the last state stays, or the word tells it.
function showLost(why, ended) {
  over ||= ended;
  const finished = ["done", "failed"].includes(state?.kind);
  if (over && finished) {
    at("choices").hidden = at("tool-form").hidden = true;
    return put("device", "lobewatch has ended. This page shows the last state of the test.");
  }
  showWord("no-connection", over ? "ENDED" : "NO CONNECTION");
  put("reason", over ? "lobewatch has ended. Repeat the command to continue the test with the saved hits." : why);
  document.title = at("text").textContent;
  at("choices").hidden = at("tool-form").hidden = at("accept").hidden = true;
  document.body.classList.remove("may-alter");
  at("undo").disabled = at("stop").disabled = true;
}

function toast(text) {
  put("toast", text);
  at("toast").hidden = false;
  clearTimeout(toast.timer);
  toast.timer = setTimeout(() => { at("toast").hidden = true; }, 4000);
}

async function undo() {
  if (undoing || at("undo").disabled || at("undo").hidden) return;
  undoing = true;
  await ask("undo", "POST").catch((error) => toast(error.message));
  undoing = false;
}

// Twice within three seconds, without a dialog: a hammer handle on the keyboard must not end a test.
async function stop() {
  if (at("stop").disabled || at("stop").hidden) return;
  const again = stopTimer !== null;
  clearTimeout(stopTimer);
  stopTimer = again ? null : setTimeout(() => { stopTimer = null; showStop(); }, STOP_AGAIN_MS);
  showStop();
  if (again) await ask("stop", "POST").catch((error) => toast(error.message));
}

function showStop() {
  at("stop").classList.toggle("armed", stopTimer !== null);
  put("stop-text", stopTimer === null ? "Stop" : "Press again to stop");
}

// The read-only address shows no buttons that alter anything. The server rejects such requests, too.
async function learnWhatIsAllowed() {
  ({ may_alter: mayAlter } = await ask("access"));
  showButtons();
  if (state) showAccept();
}

function onKey(event) {
  unlock();
  showSound();
  if (event.repeat || event.ctrlKey || event.altKey || event.metaKey || event.target === at("tool-name")) return;
  if (chooseByKey(event.key)) event.preventDefault();
  else if (UNDO_KEYS.includes(event.key)) undo();
  else if (event.key.toLowerCase() === "m") mute();
  else if (event.key.toLowerCase() === "a") acceptLast();
  else if (event.key === "Escape") stop();
  else return;
  event.preventDefault();
}

// A button that keeps the focus would be pressed again by the space bar of a foot switch.
function onClick(id, action) {
  at(id).addEventListener("click", () => { at(id).blur(); action(); });
}

at("back").hidden = location.pathname === "/";
onClick("undo", undo);
onClick("accept", acceptLast);
onClick("mute", mute);
onClick("stop", stop);
at("tool-form").addEventListener("submit", (event) => {
  event.preventDefault();
  choose("tool", at("tool-name").value.trim());
});
addEventListener("keydown", onKey);
addEventListener("pointerdown", () => { unlock(); showSound(); });
makePlots();
showSound();
learnWhatIsAllowed().catch(() => {});
follow(showState, showPlots, showLost);
