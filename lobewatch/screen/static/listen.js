import { showCut, showLevel } from "./cut_plots.js";
import { follow } from "./link.js";
import { mute, play, showSound, unlock } from "./sounds.js";
import { at, element, flash, put, showWord } from "./word.js";

const FINISHED = ["stable", "chatter", "flip", "cannot-tell", "failed"];
const STEPS = [
  "1. Move the sensor from the tool to the spindle housing.",
  "2. Run the spindle in air.",
  "3. Cut for a second or longer.",
  "4. Leave the cut. The verdict then appears on this page.",
];
const SOUNDS = { stable: "good", chatter: "refused", flip: "refused", again: "lost", "cannot-tell": "lost", failed: "lost" };

let state = null;
let texts = null;
let over = false;

// A word of two lines has its last word in the second.
const inLines = (word) => word.replace(/ (?=\S+$)/, "\n");

// The number next to the word, and its unit.
function figures({ heard, kind, left, cut_seconds: cut }) {
  if (heard) {
    const speed = heard.speed_rpm === null ? "" : `${heard.speed_rpm.toFixed(0)} rpm`;
    const chatter = heard.chatter_frequency_hz;
    if (kind === "cannot-tell") return ["", ""];
    return chatter === null ? [speed, "speed"] : [`${chatter.toFixed(0)} Hz`, kind === "flip" ? `period 2\n${speed}` : speed];
  }
  if (cut !== null) return [`${cut.toFixed(1)} s`, "recorded"];
  return left === null ? ["", ""] : [`${Math.ceil(left)} s`, "left"];
}

const named = ({ saved }, text) => (saved ? `Saved as ${saved}. ${text}` : text);

function showState(next) {
  const before = state;
  state = next;
  over = false;
  const [figure, unit] = figures(state);
  document.title = `${state.word} ${state.heard ? figure : ""}: ${state.title}`;
  put("title", state.title);
  put("device", named(state, state.device));
  put("figure", figure);
  put("unit", unit);
  put("reason", state.reason);
  put("next", state.heard ? `Next: ${state.heard.next_step}` : "");
  showWord(state.kind, inLines(state.word));
  at("level").hidden = Boolean(state.heard);
  showLevel(state.level);
  put("level-now", state.level === null ? "-" : state.level.toPrecision(2));
  showTexts(state.heard?.texts ?? STEPS);
  if (before && before.kind !== state.kind) {
    flash();
    if (SOUNDS[state.kind]) play(SOUNDS[state.kind]);
  }
}

function showTexts(wanted) {
  if (texts?.join() === wanted.join()) return;
  texts = wanted;
  at("texts").replaceChildren(...texts.map((text) => element("li", text)));
}

// After a normal end of lobewatch the last state stays.
function showLost(why, ended) {
  over ||= ended;
  if (over && FINISHED.includes(state?.kind)) return put("device", named(state, "lobewatch has ended. This page shows the last recorded cut."));
  showWord("no-connection", over ? "ENDED" : "NO\nCONNECTION");
  put("reason", over ? "lobewatch has ended. Repeat the command to record another cut." : why);
  put("figure", "");
  put("unit", "");
  document.title = at("text").textContent;
}

at("mute").addEventListener("click", () => { at("mute").blur(); mute(); });
addEventListener("keydown", (event) => {
  unlock();
  showSound();
  if (event.key.toLowerCase() === "m" && !(event.repeat || event.ctrlKey || event.altKey || event.metaKey)) mute();
});
addEventListener("pointerdown", () => { unlock(); showSound(); });
showSound();
follow(showState, showCut, showLost);
