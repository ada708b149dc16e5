import { unbroken } from "./unbroken.js";

// The word in its panel, and the parts of a page by their ids.
export const at = (id) => document.getElementById(id);
export function put(id, text) {
  const whole = unbroken(text);
  if (at(id).textContent !== whole) at(id).textContent = whole;
}

export function element(tag, text, className = "") {
  return Object.assign(document.createElement(tag), { textContent: unbroken(text), className });
}

export function showWord(kind, lines) {
  if (document.body.dataset.kind === kind && at("text").textContent === lines) return;
  document.body.dataset.kind = kind;
  at("symbol").setAttribute("href", `#is-${kind}`);
  put("text", lines);
  fitWord();
}

// As large as the panel allows.
function fitWord() {
  const word = at("word");
  word.style.fontSize = "100px";
  const text = at("text").getBoundingClientRect();
  const width = (99 * word.clientWidth) / (text.right - word.getBoundingClientRect().left);
  word.style.fontSize = `${Math.min(width, (90 * word.clientHeight) / text.height, 0.8 * word.clientHeight)}px`;
}

export function flash() {
  at("now").classList.remove("fresh");
  void at("now").offsetWidth;
  at("now").classList.add("fresh");
}

new ResizeObserver(fitWord).observe(at("now"));
