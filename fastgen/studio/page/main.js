// The page: connects settings, controls, layers and pictures.

import { control } from "./controls.js";
import * as server from "./server.js";
import { Side } from "./side.js";
import { camera } from "./viewer.js";

const get = (id) => document.getElementById(id);
const LAYER_NAMES = { colour: "Colour", ids: "Ids", damage: "Damage", depth: "Depth",
  normals: "Normals", background: "Background containers", boxes: "Boxes and text" };
const BLENDED = { ids: 0.6, damage: 0.7, depth: 0.8, normals: 0.8, background: 0.5 };

const layers = [];
const sides = {};
let active; // the side that the panel edits
let fields = {}; // name of a setting -> {input, fail}
let controls = []; // controls of the active side's preset
let objects = []; // objects in the list below the picture

function node(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

const shownSides = () => (sides.b ? [sides.a, sides.b] : [sides.a]);

function paintAll() {
  for (const side of shownSides()) side.show();
  get("zoom").value = `${Math.round(100 * sides.a.viewer.shownScale)} %`;
}

const hooks = {
  layers: () => layers,
  onMove: paintAll,
  onBusy: () => document.body.classList.add("busy"),
  onPoint: inspect,
  onDrawn: (side) => {
    document.body.classList.remove("busy");
    const { answer } = side;
    get("status").textContent =
      `${answer.quality}: ${Math.round(answer.took)} ms, of which rendering ${answer.ms} ms`;
    paintAll();
    if (side === active) showAnswer();
  },
  onError: (side, error) => {
    document.body.classList.remove("busy");
    get("status").textContent = error.message;
    if (side !== active) return;
    clearErrors();
    // messages begin with the key or the setting that is wrong
    const named = (name) => error.message.startsWith(name) && /^[:.[]/.test(error.message.slice(name.length));
    const [{ key } = {}] = [...controls, ...Object.values(fields)]
      .filter((each) => named(each.key)).sort((a, b) => b.key.length - a.key.length);
    for (const each of [...controls, ...Object.values(fields)]) if (each.key === key) each.fail(error.message);
    if (key) get("status").textContent = `Not drawn: ${error.message}`;
  },
};

function clearErrors() {
  for (const each of [...controls, ...Object.values(fields)]) each.fail("");
}

function showAnswer() {
  clearErrors();
  const { yaml, command, depth } = active.answer;
  get("depth-range").textContent = depth ? depth.map((metres) => metres.toPrecision(3)).join(" to ") + " m" : "";
  get("yaml").value = yaml || "# nothing is changed\n";
  get("command").value = command;
  get("changed-count").textContent = Object.keys(active.changes).length;
  objects = active.answer.objects.filter((item) => item.bbox);
  const list = get("objects");
  const before = list.value;
  list.replaceChildren(node("option", { value: "" }, `${objects.length} visible`), ...objects.map(
    (item) => node("option", { value: `${item.id}` }, `${item.class_name} ${item.text || item.instance}`)));
  list.value = objects.some((item) => `${item.id}` === before) ? before : "";
  choose(objects.find((item) => `${item.id}` === list.value));
}

// ---- the object under the pointer, or chosen in the list

async function inspect(side, pixel) {
  const found = pixel && (await side.at(pixel).catch(() => undefined));
  get("pixel").value = found
    ? `x ${pixel[0]}, y ${pixel[1]}${Number.isFinite(found.depth) ? `, ${found.depth.toFixed(2)} m` : ""}` : "";
  if (side !== active) return;
  const kept = objects.find((item) => `${item.id}` === get("objects").value);
  choose(found?.objects[0] ?? kept, found?.objects.slice(1));
}

function choose(item, behind = []) {
  if (active.viewer.chosen !== item) {
    active.viewer.chosen = item;
    active.viewer.paint();
  }
  const rows = item ? recordOf(item) : [];
  if (behind.length) rows.push(["on", behind.map((each) => `${each.class_name} ${each.instance}`).join(", ")]);
  get("record").replaceChildren(...rows.map(([name, value]) =>
    node("div", {}, node("dt", {}, name), node("dd", {}, value))));
}

function recordOf(item) {
  const words = (value) => (Array.isArray(value) ? value.map((v) => Math.round(v * 10) / 10).join(", ")
    : typeof value === "number" ? `${Number(value.toFixed(3))}` : `${value}`);
  return Object.entries(item)
    .filter(([name, value]) => name !== "color" && value !== "" && value !== null && value !== false)
    .map(([name, value]) => [name.replaceAll("_", " "), words(value)]);
}

// ---- settings of the scene

function setting(key, label, input) {
  const error = node("p", { className: "error", hidden: true });
  error.setAttribute("role", "alert");
  input.id = `set-${key}`;
  input.addEventListener(input.type === "number" ? "input" : "change", async () => {
    active.settings[key] = input.type === "number"
      ? (input.value === "" ? null : Number(input.value)) : input.value;
    try {
      if (key === "preset") await changePreset();
      active.refresh();
    } catch (error) {
      hooks.onError(active, error);
    }
  });
  fields[key] = { key, input, fail: (words) => {
    error.textContent = words;
    error.hidden = !words;
  } };
  return node("div", {}, node("label", { htmlFor: input.id }, label), input, error);
}

const select = (names) => node("select", {}, ...names.map((name) => node("option", { value: name }, name)));

function buildSettings(about) {
  const whole = () => node("input", { type: "number", min: 0, step: 1 });
  get("scene").replaceChildren(
    setting("preset", "Preset", select(about.presets)),
    setting("seed", "Seed", whole()),
    setting("index", "Scene index", whole()),
    setting("camera", "Camera", select([])),
    setting("quality", "Quality", select(about.qualities)),
    setting("material", "Show", select(about.materials)),
  );
  fields.material.input.options[0].textContent = "image";
}

async function changePreset() {
  const about = await server.controlsOf(active.settings.preset);
  active.about = about;
  active.changes = {};
  if (!about.cameras.includes(active.settings.camera)) active.settings.camera = about.cameras[0];
  showSide();
}

// Show the settings and changes of the active side in the panel.
function showSide() {
  const { about, settings, changes } = active;
  fields.camera.input.replaceChildren(...about.cameras.map((name) => node("option", { value: name }, name)));
  for (const [key, { input }] of Object.entries(fields)) input.value = settings[key];
  buildControls(about);
  for (const each of controls) each.set(changes[each.key]);
  search();
  if (active.answer) showAnswer();
}

// ---- controls of the configuration's keys

function onChange(changed, isReset) {
  if (isReset) delete active.changes[changed.key];
  else active.changes[changed.key] = changed.text();
  for (const twin of controls.filter((each) => each.key === changed.key)) {
    if (twin !== changed || isReset) twin.set(active.changes[changed.key]);
    else twin.mark(true);
  }
  active.refresh();
}

// Words of a key without what stands above it. The unit stands beside them, so it is left out.
function labelOf({ key, unit }, above) {
  const words = key.replace(above, "").split(/[._]/);
  if (words.length > 1 && unit.startsWith(words.at(-1))) words.pop();
  return words.join(" ");
}

function buildControls(about) {
  const opened = new Set([...document.querySelectorAll("#controls details[open]")].map((each) => each.dataset.name));
  if (!controls.length) opened.add("most used");
  controls = [];
  const specs = about.controls.map((spec) => ({ ...spec, hdris: about.hdris }));
  const used = about.most_used.map((key) => specs.find((spec) => spec.key === key)).filter(Boolean);
  const groups = new Map([["most used", used]]);
  for (const spec of specs) {
    const name = spec.key.split(".")[0];
    groups.set(name, [...(groups.get(name) ?? []), spec]);
  }
  get("controls").replaceChildren(...[...groups].map(([name, members]) => {
    const above = name === "most used" ? "" : `${name}.`;
    const made = members.map((spec) => control(spec, labelOf(spec, above), onChange));
    controls.push(...made);
    const section = node("details", { open: opened.has(name) },
      node("summary", {}, name[0].toUpperCase() + name.slice(1)), ...made.map((each) => each.element));
    section.dataset.name = name;
    return section;
  }));
}

function search() {
  const words = get("search").value.toLowerCase().split(/\s+/).filter(Boolean);
  const matches = (each) => words.every((word) => each.words.includes(word));
  for (const each of controls) each.element.hidden = !matches(each);
  for (const section of document.querySelectorAll("#controls details")) {
    const isUsed = section.dataset.name === "most used";
    section.hidden = words.length > 0 && (isUsed || !section.querySelector(".control:not([hidden])"));
    if (words.length) section.open = !section.hidden;
  }
  const found = document.querySelectorAll("#controls details:not([hidden]) .control:not([hidden])").length;
  get("found").textContent = words.length ? `${found} keys` : "";
}

// ---- layers

function buildLayers(about) {
  for (const name of [...about.layers, "boxes"]) {
    const layer = { name, on: name === "colour", opacity: BLENDED[name] ?? 1 };
    layers.push(layer);
    const box = node("input", { type: "checkbox", checked: layer.on, id: `layer-${name}` });
    const slider = node("input", { type: "range", min: 0, max: 1, step: 0.05, value: layer.opacity });
    slider.setAttribute("aria-label", `Opacity of ${LAYER_NAMES[name]}`);
    box.addEventListener("change", () => {
      layer.on = box.checked;
      if (layer.on && ["normals", "background"].includes(name)) shownSides().forEach((side) => side.refresh());
      else if (layer.on && name !== "boxes") shownSides().forEach((side) => fetchLayer(side, name));
      else paintAll();
    });
    slider.addEventListener("input", () => {
      layer.opacity = Number(slider.value);
      paintAll();
    });
    const notes = name === "depth" ? [node("small", { id: "depth-range" })] : [];
    get("layers").append(node("div", { className: "layer" },
      node("label", { htmlFor: box.id }, box, ` ${LAYER_NAMES[name]}`, ...notes), slider));
  }
}

async function fetchLayer(side, name) {
  if (!side.answer) return;
  try {
    side.viewer.images[name] = await server.layer(side.answer.number, name, side.about.size);
  } catch (error) {
    if (error.gone) side.refresh();
    else hooks.onError(side, error);
  }
  paintAll();
}

// ---- comparison

function activate(name) {
  active = sides[name];
  document.querySelector(`input[name=side][value=${name}]`).checked = true;
  for (const side of shownSides()) {
    side.viewer.element.classList.toggle("active", Boolean(sides.b) && side === active);
  }
  showSide();
}

function compare() {
  if (sides.b) {
    sides.b.viewer.element.remove();
    delete sides.b;
  } else {
    sides.b = new Side("b", sides.a.about, hooks);
    sides.b.copy(sides.a);
    get("stages").append(sides.b.viewer.element);
    sides.b.refresh();
  }
  const isOn = Boolean(sides.b);
  get("compare").setAttribute("aria-pressed", isOn);
  get("sides").hidden = !isOn;
  get("stages").classList.toggle("two", isOn);
  activate(isOn ? "b" : "a");
}

// ---- start

async function copyText(area, button) {
  area.select();
  await navigator.clipboard.writeText(area.value).catch(() => document.execCommand("copy"));
  const words = button.textContent;
  button.textContent = "Copied";
  setTimeout(() => (button.textContent = words), 1500);
}

function listen() {
  get("fit").onclick = () => sides.a.viewer.look(0);
  get("actual").onclick = () => sides.a.viewer.look(1 / devicePixelRatio);
  get("in").onclick = () => sides.a.viewer.zoom(1.5);
  get("out").onclick = () => sides.a.viewer.zoom(1 / 1.5);
  get("compare").onclick = compare;
  get("copy-side").onclick = () => {
    active.copy(active === sides.a ? sides.b : sides.a);
    showSide();
    active.refresh();
  };
  for (const radio of document.querySelectorAll("input[name=side]")) {
    radio.onchange = () => activate(radio.value);
  }
  get("objects").onchange = () =>
    choose(objects.find((item) => `${item.id}` === get("objects").value));
  get("search").oninput = search;
  get("reset-all").onclick = () => {
    active.changes = {};
    for (const each of controls) each.set(undefined);
    active.refresh();
  };
  get("copy-yaml").onclick = () => copyText(get("yaml"), get("copy-yaml"));
  get("copy-command").onclick = () => copyText(get("command"), get("copy-command"));
  window.addEventListener("resize", paintAll);
}

try {
  const about = await server.controlsOf();
  buildSettings(about);
  buildLayers(about);
  sides.a = new Side("a", about, hooks);
  get("stages").style.setProperty("--shape", `${about.size[0]} / ${about.size[1]}`);
  get("stages").append(sides.a.viewer.element);
  listen();
  activate("a");
  get("status").textContent = "Drawing the first picture. It takes seconds, because light and shaders are prepared.";
  await sides.a.refresh();
} catch (error) {
  get("status").textContent = error.message;
}
