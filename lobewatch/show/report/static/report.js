"use strict";
// Save numbers as CSV, show the numbers under the pointer, and draw the chosen curve.
(function () {
  const read = (id) => JSON.parse(document.getElementById(id).textContent);
  // A text that a spreadsheet reads as a formula, never a number: as in csv_text.py.
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

  // Word joiners behind its hyphens keep a date on one line.
  const texts = document.createTreeWalker(document.querySelector("main"), NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const { currentNode: node } = texts;
    if (node.parentNode.localName !== "script") node.data = node.data.replace(/(\d{4}-)(\d\d-)(?=\d\d)/g, "$1\u2060$2\u2060");
  }

  // Where a table is too wide for the screen, each row is a card with the column heads before its cells.
  for (const table of document.querySelectorAll("table")) {
    const heads = [...table.querySelectorAll("thead th")].map((head) => head.textContent);
    for (const row of table.tBodies[0].rows) [...row.cells].forEach((cell, i) => { cell.dataset.head = heads[i]; });
    const isWide = heads.length > 7, narrow = matchMedia(`screen and (max-width: ${isWide ? 62 : 40}rem)`);
    const turn = () => { table.classList.toggle("cards", narrow.matches); table.classList.toggle("many", isWide); };
    narrow.addEventListener("change", turn);
    turn();
  }

  function link(figure) {
    const { heads, lines } = read(figure.dataset.numbers);
    const area = figure.querySelector(".area"), output = figure.querySelector("output"), slider = figure.querySelector("input");
    const { x, y, width, height } = area.viewBox.baseVal;
    area.innerHTML = `<path class="chosen"/><path class="cursor"/><rect x="${x}" y="${y}" width="${width}" height="${height}"/>`;
    const [curve, cursor, rect] = area.children;
    const day = heads.indexOf("date");
    const places = lines.map((line) => (day < 0 ? line[0] : Date.parse(line[day]) / 864e5));
    const choices = slider ? heads.length - Number(slider.max) : heads.length;
    let chosen = heads.length, shown = -1;
    const named = (head, value) => {
      const [name] = head.split(/: | \(/), [, unit] = head.match(/\(([^()]*)\)+$/) ?? [];
      return typeof value === "string" ? value : [name, value, unit].filter((part) => part !== undefined).join(" ");
    };
    const isSeen = (value, i) => value !== null && value !== "" && (i < choices || i === chosen);
    function show(index) {
      if (!lines[index]) return;
      shown = index;
      cursor.setAttribute("d", `M${places[index]} ${y}v${height}`);
      output.textContent = lines[index].map((value, i) => (isSeen(value, i) ? named(heads[i], value) : "")).filter(Boolean).join(", ");
    }
    rect.addEventListener("pointermove", (event) => {
      const box = rect.getBoundingClientRect(), at = x + (width * (event.clientX - box.left)) / box.width;
      show(places.reduce((best, place, i) => (Math.abs(place - at) < Math.abs(places[best] - at) ? i : best), 0));
    });
    figure.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (event.target === figure && step) show(shown + step);
    });
    if (!slider) return;
    function choose() {
      chosen = choices + Number(slider.value) - 1;
      const name = heads[chosen].split(": ")[0];
      slider.previousElementSibling.textContent = name;
      slider.setAttribute("aria-valuetext", name);
      curve.setAttribute("d", `M${lines.map((line) => `${line[0]} ${line[chosen] === null ? 2 * y : -line[chosen]}`).join("L")}`);
      show(shown);
    }
    slider.addEventListener("input", choose);
    slider.parentElement.hidden = false;
    choose();
  }
  for (const figure of document.querySelectorAll("figure[data-numbers]")) link(figure);
  document.documentElement.dataset.ready = "";
})();
