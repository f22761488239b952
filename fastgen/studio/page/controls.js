// Controls of single keys. Each has `element`, `key`, `text()` (its value as YAML), `set(value)` and
// `fail(words)`, and calls `onChange()` whenever the user changes it.

let made = 0;

function node(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

const inputOf = (type, label, properties = {}) => {
  const input = node("input", { type, id: `c${++made}`, ...properties });
  input.setAttribute("aria-label", label);
  return input;
};

const short = (value) => Number(value.toPrecision(4));

// A slider and a number field that follow each other.
function number(spec, label, onChange) {
  const [low, high, step] = spec.slider;
  const slider = inputOf("range", `${label}, slider`, { min: low, max: high, step });
  const field = inputOf("number", label, { min: spec.min, max: spec.max, step: spec.whole ? 1 : "any" });
  slider.addEventListener("input", () => {
    field.value = short(Number(slider.value));
    onChange();
  });
  field.addEventListener("input", () => {
    slider.value = field.value;
    onChange();
  });
  return {
    element: node("div", { className: "number" }, slider, field),
    get: () => (field.value === "" ? NaN : Number(field.value)),
    set: (value) => {
      field.value = short(value);
      slider.value = value;
    },
  };
}

function range(spec, label, onChange) {
  const one = number(spec, label, onChange);
  // an end that is moved past the other one takes it along
  const pair = ["lowest", "highest"].map((end, k) => number(spec, `${label}, ${end}`, () => {
    const [low, high] = pair.map((each) => each.get());
    if (low > high) pair[1 - k].set(pair[k].get());
    onChange();
  }));
  const isPair = inputOf("checkbox", `${label}: draw from a range`);
  const both = node("div", {}, pair[0].element, pair[1].element);
  const show = () => {
    both.hidden = !isPair.checked;
    one.element.hidden = isPair.checked;
  };
  isPair.addEventListener("change", () => {
    if (isPair.checked) pair.forEach((end) => end.set(one.get()));
    else one.set((pair[0].get() + pair[1].get()) / 2);
    if (spec.whole && !isPair.checked) one.set(Math.round(one.get()));
    show();
    onChange();
  });
  return {
    element: node("div", {}, one.element, both,
      node("label", { className: "small" }, isPair, " range")),
    get: () => (isPair.checked ? pair.map((end) => end.get()) : one.get()),
    set: (value) => {
      const [low, high] = Array.isArray(value) ? value : [value, value];
      pair[0].set(low);
      pair[1].set(high);
      one.set(low === high ? low : spec.whole ? Math.round((low + high) / 2) : (low + high) / 2);
      isPair.checked = low !== high;
      show();
    },
  };
}

function choice(spec, label, onChange) {
  const select = node("select", { id: `c${++made}` },
    ...spec.choices.map((name) => node("option", { value: name }, name)));
  select.setAttribute("aria-label", label);
  select.addEventListener("change", onChange);
  return { element: select, get: () => select.value, set: (value) => (select.value = value) };
}

function choices(spec, label, onChange) {
  const boxes = spec.choices.map((name) => {
    const box = inputOf("checkbox", `${label}: ${name}`, { value: name });
    box.addEventListener("change", onChange);
    return box;
  });
  return {
    element: node("div", { className: "choices" },
      ...boxes.map((box) => node("label", { className: "small" }, box, ` ${box.value}`))),
    get: () => boxes.filter((box) => box.checked).map((box) => box.value),
    set: (value) => boxes.forEach((box) => (box.checked = value.includes(box.value))),
  };
}

function weights(spec, label, onChange) {
  const fields = spec.choices.map((name) => {
    const field = inputOf("number", `${label}: weight of ${name}`, { min: 0, max: spec.max, step: "any" });
    field.addEventListener("input", onChange);
    return [name, field];
  });
  const words = (name) => name.replaceAll("_", "_\u200b"); // lines may break after an underscore
  return {
    element: node("div", { className: "weights" },
      ...fields.map(([name, field]) => node("label", { className: "small" }, words(name), field))),
    get: () => Object.fromEntries(
      fields.filter(([, field]) => field.value !== "").map(([name, field]) => [name, Number(field.value)])),
    set: (value) => fields.forEach(([name, field]) => (field.value = value[name] ?? "")),
  };
}

const hex = (text) => `#${text.replace("#", "").toLowerCase()}`;

function color(spec, label, onChange) {
  const input = inputOf("color", label);
  input.addEventListener("input", onChange);
  return { element: input, get: () => input.value, set: (value) => (input.value = hex(value)) };
}

function colors(spec, label, onChange) {
  const list = node("span", { className: "colors" });
  const add = (value) => {
    const input = inputOf("color", `${label}, color ${list.children.length + 1}`, { value: hex(value) });
    input.addEventListener("input", onChange);
    list.append(input);
  };
  const button = (words, title, action) => {
    const made = node("button", { type: "button", title, onclick: () => { action(); onChange(); } }, words);
    made.setAttribute("aria-label", `${label}: ${title}`);
    return made;
  };
  return {
    element: node("div", { className: "colorlist" }, list,
      button("+", "add a color", () => add(list.lastChild?.value ?? "#888888")),
      button("−", "remove the last color", () => list.lastChild?.remove())),
    get: () => [...list.children].map((input) => input.value),
    set: (value) => {
      list.replaceChildren();
      value.forEach(add);
    },
  };
}

// Radio buttons with a picture of each HDRI; the first one leaves the draw to the configuration.
function hdri(spec, label, onChange) {
  const group = `hdri${++made}`;
  let several = [];
  const option = (name, words, ...picture) => {
    const input = node("input", { type: "radio", name: group, value: name });
    input.addEventListener("change", onChange);
    return node("label", { className: "hdri" }, input, ...picture, node("span", {}, words));
  };
  const entries = Object.keys(spec.hdris).map((name) => option(name, name,
    node("img", { src: `hdri/${encodeURIComponent(name)}.jpg`, alt: "", loading: "lazy", width: 96, height: 48 })));
  const element = node("div", { className: "hdris", role: "radiogroup" },
    option("", "as configured"), ...entries);
  element.setAttribute("aria-label", label);
  const inputs = [...element.querySelectorAll("input")];
  return {
    element,
    get: () => {
      const name = inputs.find((input) => input.checked)?.value ?? "";
      return name ? [name] : several;
    },
    set: (value) => {
      several = value.length === 1 ? [] : value;
      const name = value.length === 1 ? value[0] : "";
      inputs.forEach((input) => (input.checked = input.value === name));
    },
  };
}

function yaml(spec, label, onChange) {
  const area = node("textarea", { rows: 2, spellcheck: false, id: `c${++made}` });
  area.setAttribute("aria-label", `${label}, as YAML`);
  area.addEventListener("input", onChange);
  return { element: area, get: () => area.value, set: (value) => (area.value = value) };
}

const KINDS = { number, range, choice, choices, weights, color, colors, hdri, yaml };

// Make the control of one key.
// spec: record of the server's list of controls. label: what the user reads. onChange(control, isReset): called after a change.
// A number field without a number gives null, which the server refuses in words of its own.
export function control(spec, label, onChange) {
  const { key, kind } = spec;
  const body = KINDS[kind](spec, label, () => onChange(self, false));
  const error = node("p", { className: "error", hidden: true });
  error.setAttribute("role", "alert");
  const reset = node("button", { type: "button", className: "reset", hidden: true, title: "Reset" }, "↺");
  reset.setAttribute("aria-label", `Reset ${label}`);
  reset.addEventListener("click", () => onChange(self, true));
  const unit = spec.unit ? [node("small", {}, ` ${spec.unit}`)] : [];
  const element = node("fieldset", { className: "control" },
    node("legend", { title: key }, label, ...unit), reset, body.element, error,
    node("p", { className: "help" }, spec.help));
  element.dataset.key = key;
  const self = {
    key,
    element,
    words: `${key} ${spec.help}`.toLowerCase(),
    text: () => (kind === "yaml" ? body.get() : JSON.stringify(body.get())),
    // text: YAML that `text()` has returned, or undefined for the value of the preset
    set: (text) => {
      const isOwn = text !== undefined;
      if (kind === "yaml" || !isOwn) body.set(isOwn ? text : spec.value);
      else body.set(JSON.parse(text));
      self.mark(isOwn);
    },
    mark: (isChanged) => {
      reset.hidden = !isChanged;
      element.classList.toggle("changed", isChanged);
    },
    fail: (words) => {
      error.textContent = words;
      error.hidden = !words;
      element.classList.toggle("wrong", Boolean(words));
    },
  };
  self.set(undefined);
  return self;
}
