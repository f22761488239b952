"use strict";
// Elements and charts of the report. Values of a dataset become text nodes, never HTML.

const SVG = "http://www.w3.org/2000/svg";

// Returns an element with attributes and children; a string child is text.
function el(name, attributes = {}, ...children) {
  const svg = ["svg", "rect", "line", "text", "title", "g"].includes(name);
  const made = svg ? document.createElementNS(SVG, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "style") Object.assign(made.style, value);
    else if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value !== false && value !== null) made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined));
  return made;
}

const count = (value) => Math.round(value).toLocaleString("en");
const percent = (value) => `${(100 * value).toFixed(value < 0.1 ? 1 : 0)} %`;
const sum = (values) => values.reduce((total, value) => total + value, 0);

// A select with a label. `choices` are pairs of value and text; `show` gets the chosen value.
function picker(words, choices, show, chosen = choices[0][0]) {
  const select = el("select", { onchange: () => show(select.value) },
    choices.map(([value, text]) => el("option", { value, selected: value === chosen }, text)));
  show(select.value);
  return el("label", {}, words, select);
}

function tick(words, on, change, color) {
  const box = el("input", { type: "checkbox", checked: on, onchange: () => change(box.checked) });
  return el("label", {}, box, color ? swatch(color) : null, words);
}

const swatch = (color) => el("span", { class: "swatch", style: { background: color } });

function legend(names, colors) {
  return el("p", { class: "controls small" },
    names.map((name, i) => el("span", { class: "controls" }, swatch(colors[i]), name)));
}

function table(head, rows, kind = "") {
  return el("div", { class: "scroll" }, el("table", { class: kind },
    el("thead", {}, el("tr", {}, head.map((word) => el("th", { scope: "col" }, word)))),
    el("tbody", {}, rows.map((row) => el("tr", {},
      row.map((cell, i) => el("td", { "data-column": head[i] }, cell)))))));
}

// Horizontal bars of stacked parts. Each row is { name, color, parts }.
function bars(rows, names, colors, logarithmic) {
  const most = Math.max(1, ...rows.map((row) => sum(row.parts)));
  const length = (total) => 100 * (logarithmic ? Math.log1p(total) / Math.log1p(most) : total / most);
  return el("div", { class: "bars" }, rows.map((row) => {
    const total = sum(row.parts);
    const words = names.map((name, i) => `${name} ${count(row.parts[i])}`).join(", ");
    return [
      el("span", { class: "controls" }, row.color ? swatch(row.color) : null, row.name),
      el("span", { class: "bar", title: words, role: "img", "aria-label": `${row.name}: ${words}` },
        row.parts.map((part, i) => el("i", {
          style: { background: colors[i], width: `${total ? length(total) * part / total : 0}%` },
        }))),
      el("span", { class: "value" }, count(total)),
    ];
  }));
}

// Width of charts in px. They are scaled down where they do not fit, so that a narrow window would make letters tiny.
const WIDE = Math.min(640, document.documentElement.clientWidth - 66);

// A histogram of counts between `low` and `high`.
function histogram(counts, low, high, words) {
  const [width, height, left, right, bottom] = [WIDE, 190, 46, 12, 22];
  const most = Math.max(1, ...counts);
  const step = (width - left - right) / counts.length;
  const tall = (value) => (height - bottom - 12) * value / most;
  const chart = el("svg", { class: "chart", viewBox: `0 0 ${width} ${height}`, role: "img",
    "aria-label": words });
  const edge = (i) => (low + (high - low) * i / counts.length).toFixed(1);
  const number = (i) => el("text", { x: left + i * step, y: height - 6, "text-anchor": "middle" }, edge(i));
  counts.forEach((value, i) => {
    chart.append(
      el("rect", { x: left + i * step + 1, width: step - 2, y: height - bottom - tall(value),
        height: tall(value), style: { fill: "var(--train)" } },
      el("title", {}, `${edge(i)} to ${edge(i + 1)}: ${count(value)}`)),
      number(i));
  });
  chart.append(
    number(counts.length),
    el("line", { class: "grid", x1: left, x2: width - right, y1: height - bottom, y2: height - bottom }),
    el("text", { x: left - 6, y: 16, "text-anchor": "end" }, count(most)));
  return chart;
}

// Rows of quantiles: a thin line from the first to the last, a bar between the middle ones.
function spans(rows, unit) {
  const values = rows.flatMap((row) => row.values);
  const [low, high] = [Math.floor(Math.min(...values)), Math.ceil(Math.max(...values) + 1e-9)];
  const [width, left, step] = [WIDE, Math.min(190, 0.34 * WIDE), 22];
  const letters = Math.floor(left / 7.3);
  const height = rows.length * step + 26;
  const at = (value) => left + (width - left - 14) * (value - low) / Math.max(high - low, 1);
  const chart = el("svg", { class: "chart", viewBox: `0 0 ${width} ${height}`, role: "img",
    "aria-label": `quantiles in ${unit}` });
  const every = Math.ceil((high - low) / 8) || 1;
  for (let value = low; value <= high; value += every) {
    chart.append(
      el("line", { class: "grid", x1: at(value), x2: at(value), y1: 0, y2: height - 20 }),
      el("text", { x: at(value), y: height - 5, "text-anchor": "middle" }, String(value)));
  }
  rows.forEach((row, i) => {
    const y = i * step + step / 2;
    const [first, second, middle, fourth, last] = row.values;
    const name = row.name.length > letters ? `${row.name.slice(0, letters - 1)}…` : row.name;
    chart.append(el("g", {},
      el("title", {}, `${row.name}, ${row.note}: median ${middle.toFixed(2)} ${unit}`),
      el("text", { x: left - 8, y: y + 4, "text-anchor": "end" }, name),
      el("rect", { x: at(first), width: Math.max(at(last) - at(first), 1), y: y - 1, height: 2,
        style: { fill: "var(--soft)" } }),
      el("rect", { x: at(second), width: Math.max(at(fourth) - at(second), 2), y: y - 6,
        height: 12, rx: 2, style: { fill: "var(--train)" } }),
      el("rect", { x: at(middle) - 1, width: 2, y: y - 8, height: 16,
        style: { fill: "var(--ink)" } })));
  });
  return chart;
}

// The line below a chart that describes the cell under the pointer.
const hint = () => el("p", { class: "small soft" }, "Point at a cell to read its value.");

// A picture of a grid of numbers, row by row from the top. `words(column, row, value)` describes
// the cell under the pointer.
function heat(values, columns, rows, words) {
  const side = Math.max(4, Math.floor(440 / Math.max(columns, rows)));
  const canvas = el("canvas", { width: columns * side, height: rows * side, role: "img" });
  const note = hint();
  const most = Math.max(1, ...values);
  const pen = canvas.getContext("2d");
  values.forEach((value, i) => {
    pen.fillStyle = shade(value / most);
    pen.fillRect((i % columns) * side, Math.floor(i / columns) * side, side, side);
  });
  const read = (event) => {
    const frame = canvas.getBoundingClientRect();
    const column = Math.floor((event.clientX - frame.left) / frame.width * columns);
    const row = Math.floor((event.clientY - frame.top) / frame.height * rows);
    if (column >= 0 && column < columns && row >= 0 && row < rows) {
      note.textContent = words(column, row, values[row * columns + column]);
    }
  };
  canvas.addEventListener("pointermove", read);
  canvas.addEventListener("pointerdown", read);  // a touch without movement
  return { canvas, note };
}

// Colour of a share 0..1, from nearly black over red and orange to pale yellow.
function shade(share) {
  if (share <= 0) return "#15151c";
  const x = Math.sqrt(share);
  return `hsl(${10 + 42 * x} 85% ${14 + 66 * x}%)`;
}
