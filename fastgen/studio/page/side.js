// One side of the comparison: its settings, its picture, and the requests that keep it up to date.

import * as server from "./server.js";
import { Viewer } from "./viewer.js";

const REFINE_AFTER_MS = 250;

export class Side {
  // about: answer of server.controlsOf. hooks: onMove, onPoint, onDrawn(side, answer),
  // onError(side, error), onBusy(side), layers() -> [{name, on, opacity}].
  constructor(name, about, hooks) {
    this.name = name;
    this.about = about;
    this.hooks = hooks;
    this.settings = {
      preset: about.preset,
      seed: about.seed,
      index: 0,
      camera: about.cameras[0],
      quality: about.quality,
      material: "all",
    };
    this.changes = {}; // key -> YAML text
    this.answer = undefined;
    this.values = undefined; // label values of the picture, fetched when a pointer asks for them
    this.viewer = new Viewer(name, about.size, hooks.onMove, (pixel) => hooks.onPoint(this, pixel));
    this.running = false;
    this.again = false;
  }

  // Take over the settings of another side.
  copy(other) {
    this.about = other.about;
    this.settings = { ...other.settings };
    this.changes = { ...other.changes };
  }

  // Draw a draft now, and the chosen quality when nothing has changed for a while.
  async refresh() {
    clearTimeout(this.timer);
    this.again = true;
    if (this.running) return;
    this.running = true;
    let isShown = false;
    while (this.again) {
      this.again = false;
      isShown = await this.render("draft");
    }
    this.running = false;
    if (isShown && this.settings.quality !== "draft") {
      this.timer = setTimeout(() => this.refine(), REFINE_AFTER_MS);
    }
  }

  async refine() {
    if (this.running) return;
    this.running = true;
    await this.render(this.settings.quality);
    this.running = false;
    if (this.again) this.refresh();
  }

  // Draw and show the picture; return whether that succeeded.
  async render(quality) {
    const layers = this.hooks.layers();
    const isOn = (name) => layers.some((layer) => layer.name === name && layer.on);
    this.hooks.onBusy(this);
    const start = performance.now();
    try {
      const answer = await server.draw({
        ...this.settings,
        side: this.name,
        changes: this.changes,
        quality,
        refined: this.settings.quality,
        normals: isOn("normals"),
        background: isOn("background"),
      });
      const images = await this.imagesOf(answer.number);
      Object.assign(this, { answer: { ...answer, quality }, values: undefined });
      Object.assign(this.viewer, { images, objects: answer.objects, chosen: undefined });
      this.answer.took = performance.now() - start;
      this.show();
      this.hooks.onDrawn(this);
      return true;
    } catch (error) {
      if (!error.superseded && !error.gone) this.hooks.onError(this, error);
      return false;
    }
  }

  async imagesOf(number) {
    const wanted = this.hooks.layers().filter((layer) => layer.on && layer.name !== "boxes");
    const images = await Promise.all(
      wanted.map(async ({ name }) => [name, await server.layer(number, name, this.about.size).catch((error) => {
        if (error.refused) return undefined; // this picture has no such layer
        throw error;
      })]),
    );
    return Object.fromEntries(images);
  }

  show() {
    this.viewer.layers = this.hooks.layers();
    const { answer, settings, viewer } = this;
    if (answer) {
      const words = `${viewer.name}: scene ${settings.index}, camera ${answer.camera}, ${answer.environment}`;
      viewer.caption.textContent = `${words}, ${answer.quality}`;
      viewer.canvas.setAttribute("aria-label", `Picture ${words}`);
    }
    viewer.paint();
  }

  // Objects at a pixel, the front-most first, with its depth in metres.
  async at([x, y]) {
    if (!this.answer) return undefined;
    const [width, height] = this.about.size;
    this.values ??= server.pixels(this.answer.number, width * height);
    const { answer } = this;
    const { ids, damage, background, depth } = await this.values;
    if (answer !== this.answer) return undefined; // replaced meanwhile
    const at = y * width + x;
    const find = (test) => answer.objects.find(test);
    const found = [
      damage[at] && find((item) => item.id === damage[at] && item.severity_mm > 0),
      ids[at] && find((item) => item.id === ids[at] && !item.background && !item.severity_mm),
      background[at] && find((item) => item.background && item.id === answer.background_id + background[at]),
    ].filter(Boolean);
    return { objects: found, depth: depth[at] };
  }
}
