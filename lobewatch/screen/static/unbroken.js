// No line ends within a date (a word joiner behind its hyphens), within a number, or before a unit.
export function unbroken(text) {
  const dates = text?.replace(/(\d{4}-)(\d\d-)(?=\d\d)/g, "$1\u2060$2\u2060");
  return dates?.replace(/(?<=\d) (?=\d{3}\b|%|±|mm\b|rpm\b|Hz\b|N\b)|(?<=±) /g, "\u00a0");
}
