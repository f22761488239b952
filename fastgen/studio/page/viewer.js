// One picture: a canvas that blends layers, zooms and pans, and reports the object at a pixel.

const LARGEST_ZOOM = 64;

// Zoom and position that all pictures share: `scale` screen pixels per picture pixel (0: fit), and
// the picture point `x`, `y` in the middle of the canvas, as fractions of the picture.
export const camera = { scale: 0, x: 0.5, y: 0.5 };

const colorOf = (item) => (item.background ? "#969696" : item.color);

// Black or white, whichever has more contrast with a colour #rrggbb: the relative luminance of WCAG 2.2, with the
// transfer curve of sRGB as a power of 2.2.
function inkOn(color) {
  const [r, g, b] = [1, 3, 5].map((at) => (parseInt(color.slice(at, at + 2), 16) / 255) ** 2.2);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.179 ? "#000" : "#fff";
}

export class Viewer {
  // onMove: called after zoom or position has changed; onPoint(x, y): called with the picture pixel
  // under the pointer, or with undefined when the pointer leaves.
  constructor(side, size, onMove, onPoint) {
    this.size = size;
    this.images = {}; // layer name -> ImageBitmap
    this.layers = []; // {name, on, opacity} from bottom to top
    this.objects = [];
    this.chosen = undefined; // object whose box is emphasised
    this.onMove = onMove;
    this.element = document.createElement("figure");
    this.element.className = "stage";
    this.canvas = document.createElement("canvas");
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "img");
    this.caption = document.createElement("figcaption");
    this.element.append(this.canvas, this.caption);
    this.name = side.toUpperCase();
    this.pointers = new Map();
    this.listen(onPoint);
    new ResizeObserver(() => this.paint()).observe(this.canvas);
  }

  get shownScale() {
    const { clientWidth, clientHeight } = this.canvas;
    const fit = Math.min(clientWidth / this.size[0], clientHeight / this.size[1]);
    return camera.scale || fit;
  }

  // Screen position of the picture's upper left corner.
  get corner() {
    const scale = this.shownScale;
    return [
      this.canvas.clientWidth / 2 - camera.x * this.size[0] * scale,
      this.canvas.clientHeight / 2 - camera.y * this.size[1] * scale,
    ];
  }

  zoom(factor, at) {
    const old = this.shownScale;
    const scale = Math.min(Math.max(old * factor, 0.1), LARGEST_ZOOM);
    const [x, y] = at || [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2];
    const [left, top] = this.corner;
    // the picture point under `at` stays there
    const [u, v] = [(x - left) / old, (y - top) / old];
    camera.scale = scale;
    camera.x = (u + (this.canvas.clientWidth / 2 - x) / scale) / this.size[0];
    camera.y = (v + (this.canvas.clientHeight / 2 - y) / scale) / this.size[1];
    this.moved();
  }

  pan(dx, dy) {
    const scale = this.shownScale;
    camera.scale = scale;
    camera.x -= dx / scale / this.size[0];
    camera.y -= dy / scale / this.size[1];
    this.moved();
  }

  // scale 0 fits the picture into the canvas.
  look(scale) {
    Object.assign(camera, { scale, x: 0.5, y: 0.5 });
    this.moved();
  }

  moved() {
    camera.x = Math.min(Math.max(camera.x, 0), 1);
    camera.y = Math.min(Math.max(camera.y, 0), 1);
    this.onMove();
  }

  pixelAt(x, y) {
    const [left, top] = this.corner;
    const place = [Math.floor((x - left) / this.shownScale), Math.floor((y - top) / this.shownScale)];
    return place.every((v, k) => v >= 0 && v < this.size[k]) ? place : undefined;
  }

  listen(onPoint) {
    const { canvas, pointers } = this;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY / 300), [event.offsetX, event.offsetY]);
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
    }
    canvas.addEventListener("pointermove", (event) => {
      const now = [event.offsetX, event.offsetY];
      if (pointers.has(event.pointerId)) this.drag(event.pointerId, now);
      onPoint(this.pixelAt(...now));
    });
    canvas.addEventListener("pointerleave", () => onPoint(undefined));
    canvas.addEventListener("dblclick", () => this.look(0));
    canvas.addEventListener("keydown", (event) => {
      const step = 40;
      const actions = {
        ArrowLeft: () => this.pan(step, 0),
        ArrowRight: () => this.pan(-step, 0),
        ArrowUp: () => this.pan(0, step),
        ArrowDown: () => this.pan(0, -step),
        "+": () => this.zoom(1.25),
        "=": () => this.zoom(1.25),
        "-": () => this.zoom(0.8),
        0: () => this.look(0),
        1: () => this.look(1 / devicePixelRatio),
      };
      if (event.ctrlKey || event.metaKey || event.altKey || !(event.key in actions)) return;
      event.preventDefault();
      actions[event.key]();
    });
  }

  // One pointer pans, two pointers zoom about their middle.
  drag(id, now) {
    const before = this.pointers.get(id);
    const other = [...this.pointers].find(([key]) => key !== id)?.[1];
    this.pointers.set(id, now);
    if (!other) {
      this.pan(now[0] - before[0], now[1] - before[1]);
      return;
    }
    const apart = (point) => Math.hypot(point[0] - other[0], point[1] - other[1]);
    const middle = [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2];
    this.zoom(apart(now) / Math.max(apart(before), 1), middle);
  }

  paint() {
    const { canvas } = this;
    const ratio = devicePixelRatio;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((v) => Math.round(v * ratio));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const pen = canvas.getContext("2d");
    const scale = this.shownScale * ratio;
    const [left, top] = this.corner.map((v) => Math.round(v * ratio));
    pen.clearRect(0, 0, width, height);
    pen.imageSmoothingEnabled = scale < 2;
    pen.imageSmoothingQuality = "high";
    const frame = [left, top, scale, ratio];
    const others = this.objects.filter((item) => item !== this.chosen);
    const captions = []; // places [x, y, width]
    for (const { name, on, opacity } of this.layers) {
      pen.globalAlpha = opacity;
      const image = this.images[name];
      if (on && image) pen.drawImage(image, left, top, this.size[0] * scale, this.size[1] * scale);
      if (on && name === "boxes") this.paintBoxes(pen, others, frame, captions);
    }
    pen.globalAlpha = 1;
    if (this.chosen) this.paintBoxes(pen, [this.chosen], frame, captions);
  }

  // Draw the boxes of objects that are in sight, then their captions, whose places are added to `captions`.
  paintBoxes(pen, objects, [left, top, scale, ratio], captions) {
    pen.font = `${11 * ratio}px system-ui, sans-serif`;
    const boxes = objects.filter((item) => item.bbox).map((item) => {
      const [x0, y0, x1, y1] = item.bbox.map((v, k) => (k % 2 ? top : left) + v * scale);
      return { item, x0, y0, x1, y1, area: (x1 - x0) * (y1 - y0), isChosen: item === this.chosen };
    }).filter(({ x0, y0, x1, y1 }) => x1 > 0 && y1 > 0 && x0 < this.canvas.width && y0 < this.canvas.height);
    for (const { item, x0, y0, x1, y1, isChosen } of boxes) {
      pen.lineWidth = (isChosen ? 3 : 1.5) * ratio;
      pen.strokeStyle = colorOf(item);
      pen.strokeRect(x0, y0, x1 - x0, y1 - y0);
    }
    // small boxes have the least choice
    for (const box of boxes.sort((a, b) => a.area - b.area)) {
      if (box.isChosen || !box.item.background) captions.push(this.paintCaption(pen, box, captions, ratio));
    }
  }

  // Draw a caption beside its box where it covers the least of earlier ones; return its place.
  paintCaption(pen, { item, x0, y0, x1, y1 }, captions, ratio) {
    const words = item.text ? `${item.class_name} ${item.text}` : `${item.class_name} ${item.instance}`;
    const [wide, tall] = [pen.measureText(words).width + 6 * ratio, 14 * ratio];
    const inside = (v, most) => Math.min(Math.max(v, 0), most);
    const beside = [[x0, y0 - tall], [x0, y1], [x1 - wide, y0 - tall], [x1 - wide, y1], [x1, y0], [x0 - wide, y0]]
      .map(([x, y]) => [inside(x, this.canvas.width - wide), inside(y, this.canvas.height - tall), wide]);
    const shared = ([x, y]) => captions.reduce((sum, [x2, y2, wide2]) => sum
      + Math.max(Math.min(x + wide, x2 + wide2) - Math.max(x, x2), 0) * Math.max(tall - Math.abs(y - y2), 0), 0);
    const place = beside.reduce((best, each) => (shared(each) < shared(best) ? each : best));
    pen.fillStyle = colorOf(item);
    pen.fillRect(place[0], place[1], wide, tall);
    pen.fillStyle = inkOn(pen.fillStyle);
    pen.fillText(words, place[0] + 3 * ratio, place[1] + 11 * ratio);
    return place;
  }
}
