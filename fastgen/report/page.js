// The sections of the report, in the order of the page.

const report = JSON.parse(document.getElementById("content").textContent);
const COLORS = report.splits.map((split) => `var(--${split})`);
const main = document.getElementById("page");
const nav = el("nav", { "aria-label": "Sections" });

const title = (index) => report.classes[index].name;
// Both tasks label the same containers.
const repeated = ({ name, task }) => name === "container" && task === "damage" && report.tasks.includes("imdg");
const occurring = report.listed.filter((index) =>
  sum(report.counts[index]) > 0 && !repeated(report.classes[index]));
const choices = occurring.map((index) => [index, title(index)]);

function section(id, heading, words, ...children) {
  nav.append(el("a", { href: `#${id}` }, heading));
  main.append(el("section", { id }, el("h2", {}, heading), words ? el("p", { class: "soft" }, words) : null,
    ...children));
}

function head() {
  const { images, counted, opened } = report.scope;
  const sampled = counted < images;
  const numbers = [[count(images), "images"], ...report.splits.map((split, i) =>
    [count(report.images[i]), `in ${split}`])];
  main.append(
    el("header", {}, el("h1", {}, report.title), el("p", { class: "soft" },
      `Labels are those of ${sampled ? `${count(counted)} images, spread evenly over the dataset` : "all images"}. `
      + `Pictures and measurements of pixels are from ${count(opened)} images.`), nav,
    el("div", { class: "numbers" }, numbers.map(([value, words]) => el("div", {}, el("b", {}, value), words)))));
}

function advice() {
  const boxes = report.advice.map(({ finding, advice: words }) =>
    el("div", { class: "advice" }, el("b", {}, finding), words));
  section("advice", "What to look at", boxes.length ? "" : "Nothing conspicuous was found.", boxes);
}

function sheet() {
  const names = [...new Set(report.sheet.flatMap((image) => image.boxes.map((box) => box.name)))].sort();
  const off = new Set();
  const refresh = () => document.querySelectorAll("[data-class]").forEach((box) => {
    box.style.display = off.has(box.dataset.class) ? "none" : "";
  });
  const ticks = names.map((name) => tick(name, true, (on) => {
    if (on) off.delete(name); else off.add(name);
    refresh();
  }, report.colors[name]));
  const all = (on) => () => ticks.forEach((each) => {
    const box = each.querySelector("input");
    if (box.checked !== on) box.click();
  });
  const dialog = el("dialog", { "aria-label": "Image with its labels" });
  let at = 0;
  const open = (index) => {
    at = (index + report.sheet.length) % report.sheet.length;
    const image = report.sheet[at];
    dialog.replaceChildren(
      el("div", { class: "controls" },
        el("button", { onclick: () => open(at - 1) }, "Previous"),
        el("button", { onclick: () => open(at + 1) }, "Next"),
        el("button", { onclick: () => dialog.close() }, "Close"),
        el("span", { class: "soft" }, about(image))),
      shot(image),
      table(["class", "text", "visible", "size"], image.boxes.map((box) => [
        box.name, box.text, percent(box.visible),
        `${box.box[2] - box.box[0]} x ${box.box[3] - box.box[1]} px${box.ignored ? ", ignored" : ""}`,
      ]), "words"));
    refresh();
    if (!dialog.open) dialog.showModal();
  };
  dialog.addEventListener("keydown", (event) => {
    if (event.key === "ArrowLeft") open(at - 1);
    if (event.key === "ArrowRight") open(at + 1);
  });
  section("images", "Images", "Choose an image to see it larger, with a list of its labels. "
    + "Dashed boxes are ignored labels, of which too little is visible.",
  el("div", { class: "controls small" }, el("button", { onclick: all(true) }, "All boxes"),
    el("button", { onclick: all(false) }, "No boxes"), ticks),
  el("div", { class: "sheet" }, report.sheet.map((image, index) =>
    el("button", { class: "tile", onclick: () => open(index) }, shot(image),
      el("span", { class: "small soft" }, about(image))))), dialog);
}

const about = (image) => `${image.stem}, ${image.split}, ${image.environment}`;

function shot(image) {
  const [width, height] = image.size;
  return el("span", { class: "shot" }, el("img", { src: image.source, alt: image.stem }),
    el("svg", { viewBox: `0 0 ${width} ${height}`, preserveAspectRatio: "none" },
      image.boxes.map((box) => el("rect", {
        class: box.ignored ? "ignored" : "", "data-class": box.name,
        x: box.box[0], y: box.box[1], width: box.box[2] - box.box[0], height: box.box[3] - box.box[1],
        style: { stroke: report.colors[box.name] },
      }, el("title", {}, [box.name, box.text, `${percent(box.visible)} visible`].filter(Boolean).join(", "))))));
}

function balance() {
  const parts = report.tasks.map((task) => {
    const chart = el("div");
    const rows = report.listed.filter((index) => report.classes[index].task === task).map((index) => ({
      name: report.classes[index].name, color: report.colors[report.classes[index].name],
      parts: report.counts[index],
    }));
    const draw = (on) => chart.replaceChildren(bars(rows, report.splits, COLORS, on));
    draw(false);
    return el("div", {}, el("h3", {}, `Labels of the task ${task}`),
      tick("logarithmic scale", false, draw), chart);
  });
  const damaged = report.damaged && el("div", {}, el("h3", {}, "Images without and with visible damage"),
    bars([{ name: "without", parts: report.damaged.without }, { name: "with", parts: report.damaged.with }],
      report.splits, COLORS, false));
  section("classes", "Class balance", "Number of labels of each class, by split. Ignored labels are not counted.",
    legend(report.splits, COLORS), damaged, el("div", { class: "pair" }, parts));
}

function sizes() {
  const { edges, quantiles, bins, rows, small_px: small } = report.sizes;
  const place = el("div");
  const limit = (at) => `${edges[at]}${at + 1 < edges.length ? ` to ${edges[at + 1]}` : " or more"}`;
  const show = (chosen) => {
    const indices = occurring.filter((index) => chosen === String(index)
      || (report.classes[index].target && chosen === report.classes[index].task));
    const grid = new Array(edges.length ** 2).fill(0);
    for (const index of indices) {
      for (const [wide, tall, value] of bins[index]) {
        grid[(edges.length - 1 - tall) * edges.length + wide] += value;
      }
    }
    const { canvas, note } = heat(grid, edges.length, edges.length, (column, row, value) =>
      `${limit(column)} px wide, ${limit(edges.length - 1 - row)} px high: ${count(value)} boxes`);
    place.replaceChildren(canvas, note);
  };
  const groups = { damage: "all damages", imdg: "all markers" };
  const shown = report.tasks.filter((task) =>
    occurring.some((index) => report.classes[index].target && report.classes[index].task === task));
  const control = picker("Class", [...shown.map((task) => [task, groups[task]]), ...choices], show);
  const of = (values) => values.map((value) => (100 * value).toFixed(1)).join(" / ");
  section("sizes", "Box sizes", `Width runs to the right and height upwards, from 1 px to ${edges.at(-1)} px or `
    + "more in steps of a factor of 1.4. The table has widths and heights in percent of the image's, at the "
    + `quantiles ${quantiles.join(" / ")}.`,
  el("div", { class: "pair small" }, el("div", {}, control, place),
    table(["class", "width, %", "height, %", `under ${small} px`], occurring.map((index) => [
      title(index), of(rows[index].width), of(rows[index].height), percent(rows[index].small)]))));
}

function places() {
  const { grid, cameras, all, cells } = report.maps;
  const place = el("div");
  const most = occurring.filter((each) => report.classes[each].target)
    .sort((a, b) => sum(report.counts[b]) - sum(report.counts[a]))[0] ?? occurring[0];
  let [index, camera] = [String(most), "all"];
  const draw = () => {
    const found = camera === "all" ? all[index]
      : (cells.find(([a, b]) => String(a) === index && String(b) === camera) || [0, 0, new Array(grid * grid).fill(0)])[2];
    const { canvas, note } = heat(found, grid, grid, (column, row, value) =>
      `column ${column + 1}, row ${row + 1} of ${grid}: ${count(value)} boxes`);
    place.replaceChildren(canvas, note);
  };
  const controls = el("div", { class: "controls" },
    picker("Class", choices, (value) => { index = value; draw(); }, most),
    picker("Camera", [["all", "all"], ...Object.entries(cameras)], (value) => { camera = value; draw(); }));
  section("places", "Where classes appear", "Number of boxes that reach into each part of the image.", controls, place);
}

function visible() {
  const names = Object.keys(report.visible);
  if (!names.length) return;
  const place = el("div");
  const control = picker("Class", names.map((name) => [name, name]), (name) => place.replaceChildren(
    histogram(report.visible[name], 0, 1, `visible fractions of ${name}`)));
  section("visible", "Visible fraction", "Share of each object that is in the image and not hidden. "
    + "Objects that are not visible at all are left out, ignored ones are included.", control, place);
}

function exposure() {
  const part = (rows, heading) => el("div", {}, el("h3", {}, heading),
    spans(rows.map((row) => ({ name: row.name, values: row.stops, note: `${count(row.images)} images` })), "stops"),
    table(["", "images", "clipped pixels", "black pixels"], rows.map((row) =>
      [row.name, count(row.images), percent(row.clipped), percent(row.black)])));
  section("exposure", "Brightness and exposure", "Mean luminance of the images in stops above mid grey "
    + "(18 %): the line covers 90 % of them, the bar half, the tick is the median.",
  el("div", { class: "pair" }, part(report.exposure.cameras, "By camera"),
    part(report.exposure.environments, "By HDRI")));
}

function together() {
  const shown = occurring;
  const note = hint();
  const cell = (row, column) => {
    const share = report.together[row][column] / report.together[row][row];
    const words = `${percent(share)} of the images with ${title(row)} also show ${title(column)}`;
    const read = () => { note.textContent = words; };
    return el("td", { title: words, style: { background: shade(share) }, "aria-label": words, onpointerover: read });
  };
  const matrix = el("table", { class: "matrix" },
    el("thead", {}, el("tr", {}, el("td"), shown.map((index) => el("th", { scope: "col" }, title(index))))),
    el("tbody", {}, shown.map((row) => el("tr", {}, el("th", { scope: "row" }, title(row)),
      shown.map((column) => cell(row, column))))));
  section("together", "Classes that appear together", "Share of the images with the class of the row that also "
    + "show the class of the column. Columns are in the order of rows.", el("div", { class: "scroll" }, matrix), note);
}

function texts() {
  if (!report.crops.length) return;
  section("texts", "Text crops", "Legible identifiers with the text of their label.",
    el("div", { class: "crops" }, report.crops.map((crop) => el("figure", { title: crop.stem },
      el("img", { src: crop.source, alt: crop.text }), el("figcaption", {}, crop.text)))));
}

function made() {
  const parts = report.origins.map((each) => el("div", {},
    table(["setting", "value"], each.facts, "words"),
    el("h3", {}, each.rows.length ? `Configuration: preset ${each.preset}, except` : `Configuration: preset ${each.preset}`),
    each.rows.length ? table(["key", "preset", "this dataset"], each.rows, "words") : null,
    each.more ? el("p", { class: "soft" }, `and ${count(each.more)} more`) : null));
  section("made", "What made it", "", parts);
}

head();
advice();
sheet();
if (report.tasks.length) balance();
if (occurring.length) [sizes, places].forEach((show) => show());
visible();
if (report.scope.opened) exposure();
if (occurring.length) together();
texts();
made();
