"use strict";
// Numbers of each figure as a file, and the lobes of every test in turn.
(function () {
  const read = (id) => JSON.parse(document.getElementById(id).textContent);
  // What a spreadsheet takes for a formula, never a number: as in csv_text.py.
  const formula = /^(?![+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?$)[=+\-@\t\r]/;
  const cell = (value) => {
    const text = (value === null ? "" : String(value)).replace(formula, "'$&");
    return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };

  function save(button) {
    const { heads, lines } = read(button.dataset.numbers);
    const text = [heads, ...lines].map((line) => line.map(cell).join(",")).join("\n") + "\n";
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
    link.download = `${button.dataset.name}.csv`;
    link.click();
    URL.revokeObjectURL(link.href);
  }
  for (const button of document.querySelectorAll("button[data-numbers]")) button.addEventListener("click", () => save(button));

  // No line ends within a date: a word joiner stands behind its hyphens.
  const texts = document.createTreeWalker(document.querySelector("main"), NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const { currentNode: node } = texts;
    if (node.parentNode.localName !== "script") node.data = node.data.replace(/(\d{4}-)(\d\d-)(?=\d\d)/g, "$1\u2060$2\u2060");
  }

  // On a narrow screen each row is a card, and each cell says what it is.
  for (const table of document.querySelectorAll("table")) {
    const heads = [...table.querySelectorAll("thead th")].map((head) => head.textContent);
    for (const row of table.tBodies[0].rows) [...row.cells].forEach((cell, i) => { cell.dataset.head = heads[i]; });
    table.classList.add("cards");
  }

  const slider = document.getElementById("lobes-when");
  if (!slider) return;
  document.getElementById("lobes-course").hidden = false;
  const place = document.getElementById("lobes-plot"), said = document.getElementById("lobes-said");
  const { heads, lines } = read(slider.dataset.numbers);
  const columns = heads.map((_, i) => lines.map((line) => line[i]));
  const names = heads.map((head) => head.split(": ")[0]);
  const now = Number(slider.dataset.now);
  const finite = columns.slice(1).flat().filter((depth) => depth !== null);
  const lowest = finite.reduce((least, depth) => Math.min(least, depth), Infinity);
  const top = Number.isFinite(lowest) ? 6 * lowest : 1;
  const clipped = columns.map((column, i) => (i ? column.map((depth) => (depth === null ? top : Math.min(depth, top))) : column));
  const lobes = (chosen) => [clipped[0], clipped[1], clipped[now], clipped[chosen]];
  const heard = slider.dataset.heard ? read(slider.dataset.heard).lines : [];
  const known = () => heard.filter(([from]) => from <= Number(slider.value));
  const SIZE = 6;
  function drawHeard(plot) {
    const { ctx, bbox } = plot, size = SIZE * devicePixelRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.lineWidth = 2.2 * devicePixelRatio;
    for (const [, word, , rpm, depth] of known()) {
      const x = plot.valToPos(rpm, "x", true), y = plot.valToPos(depth, "y", true);
      ctx.strokeStyle = word === "stable" ? "#009E73" : "#A00000";
      ctx.beginPath();
      if (word === "stable") ctx.arc(x, y, size, 0, 2 * Math.PI);
      else for (const side of [-1, 1]) {
        ctx.moveTo(x - size, y - side * size);
        ctx.lineTo(x + size, y + side * size);
      }
      ctx.stroke();
    }
    ctx.restore();
  }
  const plot = new uPlot({
    hooks: { draw: [drawHeard] }, width: place.clientWidth, height: 300, scales: { x: { time: false }, y: { range: [0, top] } },
    axes: [{ label: "spindle speed (rpm)" }, { label: "limiting depth (mm)" }],
    series: [
      { label: "rpm" },
      { label: `first, ${names[1]}`, stroke: "#777777", dash: [6, 4], width: 1.2 },
      { label: `now, ${names[now]}`, stroke: "#0072B2", width: 1.6 },
      { label: "chosen", stroke: "#D55E00", width: 2 },
    ],
  }, lobes(Number(slider.value)), place);
  function choose() {
    const chosen = Number(slider.value);
    const cuts = known().length;
    said.textContent = cuts ? `${names[chosen]}, ${cuts} test cut${cuts > 1 ? "s" : ""}` : names[chosen];
    slider.setAttribute("aria-valuetext", said.textContent);
    plot.setData(lobes(chosen));
  }
  slider.addEventListener("input", choose);
  const fit = () => plot.setSize({ width: place.clientWidth, height: 300 });
  window.addEventListener("resize", fit);
  window.addEventListener("beforeprint", fit);
  choose();
})();
