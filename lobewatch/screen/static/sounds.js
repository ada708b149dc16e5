import { at, put } from "./word.js";

// A sound per verdict: [frequency (Hz), length (s)] one after the other.
const SOUNDS = {
  good: [[1320, 0.15]],
  refused: [[220, 0.18], [220, 0.25]],
  done: [[660, 0.14], [880, 0.14], [1320, 0.3]],
  lost: [[160, 0.7]],
};
const GAP_S = 0.06;

let context = null;
let muted = localStorage.getItem("muted") === "yes";

// Browsers allow sound only after a key or a touch.
export function unlock() {
  context ??= new AudioContext();
  if (context.state === "suspended") context.resume();
}

function status() {
  if (muted) return "Sound off";
  return navigator.userActivation?.hasBeenActive ?? context ? "Sound on" : "Sound: press any key";
}

// On the button.
export function showSound() {
  put("sound", status());
  at("mute").setAttribute("aria-pressed", String(muted));
}

export function mute() {
  muted = !muted;
  localStorage.setItem("muted", muted ? "yes" : "no");
  showSound();
}

export function play(name) {
  if (muted || !context) return;
  let at = context.currentTime + 0.01;
  for (const [frequency, length] of SOUNDS[name]) {
    const tone = context.createOscillator();
    const gain = context.createGain();
    tone.type = "triangle";
    tone.frequency.value = frequency;
    gain.gain.setValueAtTime(0, at);
    gain.gain.linearRampToValueAtTime(0.8, at + 0.01);
    gain.gain.setValueAtTime(0.8, at + length - 0.03);
    gain.gain.linearRampToValueAtTime(0, at + length);
    tone.connect(gain).connect(context.destination);
    tone.start(at);
    tone.stop(at + length);
    at += length + GAP_S;
  }
}
