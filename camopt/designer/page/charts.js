// Charts as SVG: lines over an axis, limits, a marked place, and the values under the pointer.
const SVG = "http://www.w3.org/2000/svg";

function h(name, attributes = {}, ...children) { // an HTML element
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "on") for (const [event, act] of Object.entries(value)) node.addEventListener(event, act);
    else if (value === true) node.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) node.setAttribute(key, value);
  }
  node.append(...children);
  return node;
}
function shown(value, digits = 4) { // a number as the page writes it
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (Math.abs(value) < 1e-5) return "0"; // a hundredth of a micrometre, far below what any unit here resolves
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}
function ticks(low, high, most) { // round numbers in a range
  const rough = (high - low) / most || 1, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((d) => d * power).find((s) => s >= rough);
  const found = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n++) found.push(n * step);
  return found;
}

class Chart {
  // spec: x {label, low, high}, lines [{name, x, y, look}], limits [{value, name}], places [{x, name}]
  constructor(title, unit, height = 170) {
    Object.assign(this, { title, unit, height, spec: null });
    this.svg = document.createElementNS(SVG, "svg");
    this.svg.setAttribute("role", "img");
    this.words = h("figcaption");
    this.values = h("p", { class: "values", "aria-hidden": "true" });
    this.node = h("figure", { class: "chart" }, this.words, this.svg, this.values);
    this.svg.addEventListener("pointermove", (event) => this.hover(event));
    this.svg.addEventListener("pointerleave", () => this.leave());
    new ResizeObserver(() => this.spec && this.width !== this.node.clientWidth && this.draw()).observe(this.node);
  }
  show(spec) {
    this.spec = spec;
    this.draw();
  }
  make(name, attributes, words) {
    const node = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    if (words !== undefined) node.textContent = words;
    return this.svg.appendChild(node);
  }
  draw() {
    const { spec, height } = this, width = Math.max(240, this.node.clientWidth || 300);
    this.width = this.node.clientWidth;
    const finite = (values) => values.filter((v) => v !== null && Number.isFinite(v));
    const levels = [...spec.lines.flatMap((l) => finite(l.y)), ...spec.limits.map((l) => l.value), ...(spec.include ?? [])];
    let low = Math.min(...levels), high = Math.max(...levels);
    if (spec.most !== undefined) high = Math.min(high, spec.most); // what goes beyond is cut, and said so
    const room = 0.12 * (high - low || Math.abs(high) || 1); // for the names of limits, too
    [low, high] = [low < 0 ? low - room : low, high + room];
    const box = { left: 52, right: width - 18, top: 8, bottom: height - 34 };
    this.across = (x) => box.left + ((box.right - box.left) * (x - spec.x.low)) / (spec.x.high - spec.x.low);
    this.up = (y) => box.bottom - ((box.bottom - box.top) * (y - low)) / (high - low);
    this.box = box;
    this.svg.replaceChildren();
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.svg.setAttribute("aria-label", `${this.title} [${this.unit}] against ${spec.x.label}. ${spec.says}`);
    this.words.replaceChildren(h("b", {}, `${this.title} [${this.unit}] `), h("span", {}, spec.says));
    this.axes(spec, box, low, high, height);
    const clip = { low: low - (high - low), high: high + (high - low) };
    spec.limits.forEach((limit) => this.limit(limit, box));
    for (const place of spec.places ?? []) {
      this.make("path", { class: "place", d: `M${this.across(place.x)} ${box.top}V${box.bottom}` });
    }
    spec.lines.forEach((line) => this.line(line, clip));
    this.cursor = this.make("path", { class: "cursor" });
  }
  axes(spec, box, low, high, height) {
    for (const y of ticks(low, high, 4)) {
      this.make("path", { class: "grid", d: `M${box.left} ${this.up(y)}H${box.right}` });
      this.make("text", { x: box.left - 5, y: this.up(y) + 4, "text-anchor": "end" }, shown(y));
    }
    for (const x of spec.x.ticks ?? ticks(spec.x.low, spec.x.high, 5)) {
      this.make("path", { class: "tick", d: `M${this.across(x)} ${box.bottom}v4` });
      this.make("text", { x: this.across(x), y: box.bottom + 16, "text-anchor": "middle" }, shown(x, 6));
    }
    const middle = (box.left + box.right) / 2;
    this.make("text", { class: "axis", x: middle, y: height - 4, "text-anchor": "middle" }, spec.x.label);
  }
  limit(limit, box) {
    const y = this.up(limit.value);
    this.make("path", { class: "limit", d: `M${box.left} ${y}H${box.right}` });
    const above = limit.value >= 0 ? y - 5 : y + 13;
    this.make("text", { class: "limit-name", x: box.right - 2, y: above, "text-anchor": "end" }, limit.name);
  }
  line(line, clip) {
    let path = "", open = false;
    line.x.forEach((x, i) => {
      const y = line.y[i], { low, high } = this.spec.x;
      if (y === null || !Number.isFinite(y) || x < low || x > high) { open = false; return; }
      const at = `${this.across(x).toFixed(1)} ${this.up(Math.min(clip.high, Math.max(clip.low, y))).toFixed(1)}`;
      path += `${open ? "L" : "M"}${at}`;
      open = true;
    });
    this.make("path", { class: `line ${line.look}`, d: path || "M0 0" });
  }
  hover(event) {
    if (!this.spec) return;
    const { left, width } = this.svg.getBoundingClientRect(), { box, spec } = this;
    const pixel = ((event.clientX - left) * this.svg.viewBox.baseVal.width) / width;
    const share = Math.min(1, Math.max(0, (pixel - box.left) / (box.right - box.left)));
    const x = spec.x.low + share * (spec.x.high - spec.x.low);
    const read = spec.lines.map((line) => {
      let best = 0;
      line.x.forEach((v, i) => { if (Math.abs(v - x) < Math.abs(line.x[best] - x)) best = i; });
      return { at: line.x[best], words: `${line.name} ${shown(line.y[best])}` };
    });
    if (!read.length) return;
    this.cursor.setAttribute("d", `M${this.across(read[0].at)} ${box.top}V${box.bottom}`);
    this.values.textContent = `${spec.x.label.replace(/ \[.*/, "")} ${shown(read[0].at)}: ${read.map((r) => r.words).join(", ")}`;
  }
  leave() {
    this.cursor?.setAttribute("d", "");
    this.values.textContent = "";
  }
}
