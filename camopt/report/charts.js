// Charts as SVG: lines over an axis, limits, marked places, a readout of the values under the pointer, and zoom.
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
function svgNode(name, attributes = {}, words) { // an SVG element
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) if (value !== undefined) node.setAttribute(key, value);
  if (words !== undefined) node.textContent = words;
  return node;
}
function shown(value, digits = 4) { // a number as the page shows it
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (Math.abs(value) < 1e-5) return "0"; // a hundredth of a micrometre, far below what any unit here resolves
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}
function ticks(low, high, most) { // round numbers in a range
  const rough = (high - low) / most || 1, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((d) => d * power).find((s) => s >= rough);
  const values = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n++) values.push(n * step);
  return values;
}
function limitsAt(values, words = "limit") { // limit lines, each named with its value
  return values.map((value) => ({ value, name: `${words} ${shown(value)}` }));
}

class Chart {
  // spec: x {label, low, high}, lines [{name, x, y, look or colour and dashes, dots}], limits [{value, name}],
  // places [x] (vertical marks), include (values that the axis contains), most and least (outermost ends of the axis), caption
  constructor(title, unit, height = 170) {
    Object.assign(this, { title, unit, height, spec: null, zoom: null, dragFrom: null });
    this.svg = svgNode("svg", { role: "img", tabindex: "0" });
    this.words = h("span");
    this.whole = h("button", { type: "button", hidden: true, on: { click: () => this.unzoom() } }, "whole axis");
    this.values = h("p", { class: "values" });
    this.node = h("figure", { class: "chart" }, h("figcaption", {}, this.words, " ", this.whole), this.svg, this.values);
    const listen = { pointermove: this.hover, pointerleave: this.leave, pointerdown: this.beginDrag, pointerup: this.endDrag,
      pointercancel: this.leave, keydown: this.key, blur: this.leave, dblclick: () => this.show(this.spec, null) };
    for (const [event, act] of Object.entries(listen)) this.svg.addEventListener(event, act.bind(this));
    new ResizeObserver(([entry]) => this.resized(entry.contentRect.width)).observe(this.node);
  }
  show(spec, zoom = this.zoom) { // the zoom is kept while the ends of the whole axis stay the same
    const same = this.spec && this.spec.x.low === spec.x.low && this.spec.x.high === spec.x.high;
    this.spec = spec;
    this.zoom = same ? zoom : null;
    this.whole.hidden = !this.zoom;
    this.draw();
  }
  unzoom() { // the button is hidden, so the chart takes over the focus
    this.show(this.spec, null);
    this.svg.focus();
  }
  resized(width) {
    if (this.spec && width !== this.width) this.draw(width);
    this.width = width;
  }
  make(name, attributes, words, inside = this.svg) {
    return inside.appendChild(svgNode(name, attributes, words));
  }
  draw(space = this.width ?? this.node.clientWidth) { // a known width avoids a layout of the page
    const { spec, height } = this, width = Math.max(240, space || 300);
    this.x = this.zoom ?? spec.x;
    const [low, high] = this.levels();
    const box = { left: 52, right: width - 18, top: 8, bottom: height - 34 };
    this.across = (x) => box.left + ((box.right - box.left) * (x - this.x.low)) / (this.x.high - this.x.low);
    this.up = (y) => box.bottom - ((box.bottom - box.top) * (y - low)) / (high - low);
    this.box = box;
    this.svg.replaceChildren();
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.svg.setAttribute("aria-label", `${this.title} [${this.unit}] against ${spec.x.label}. ${spec.caption}`);
    this.words.replaceChildren(h("b", {}, `${this.title} [${this.unit}] `), h("span", {}, spec.caption));
    this.axes(spec, box, low, high, height);
    spec.limits.filter((l) => l.value >= low && l.value <= high).forEach((limit) => this.limit(limit, box));
    for (const x of (spec.places ?? []).filter((x) => x >= this.x.low && x <= this.x.high)) {
      this.make("path", { class: "place", d: `M${this.across(x)} ${box.top}V${box.bottom}` });
    }
    const frame = { x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top };
    const port = this.make("svg", { ...frame, viewBox: Object.values(frame).join(" "), class: "port" });
    spec.lines.forEach((line) => this.line(line, port));
    this.cursor = this.make("path", { class: "cursor" });
    this.dragged = this.make("rect", { class: "dragged", y: box.top, height: box.bottom - box.top, width: 0 });
  }
  levels() { // lower and upper end of the axis
    const { spec } = this, { low: from, high: to } = this.x;
    const inside = (line) => line.y.filter((v, i) => v !== null && Number.isFinite(v) && line.x[i] >= from && line.x[i] <= to);
    const limits = this.zoom ? [] : spec.limits.map((l) => l.value);
    let levels = [...spec.lines.flatMap(inside), ...limits, ...(this.zoom ? [] : spec.include ?? [])];
    if (!levels.length) levels = [0];
    let low = Math.min(...levels), high = Math.max(...levels);
    if (spec.most !== undefined) high = Math.max(low, Math.min(high, spec.most)); // values beyond are cut; the caption says so
    if (spec.least !== undefined) low = Math.min(high, Math.max(low, spec.least));
    const room = 0.12 * (high - low || Math.abs(high) || 1); // includes space for the names of limits
    return [low < 0 || this.zoom || spec.least !== undefined ? low - room : low, high + room];
  }
  axes(spec, box, low, high, height) {
    for (const y of ticks(low, high, 4)) {
      this.make("path", { class: "grid", d: `M${box.left} ${this.up(y)}H${box.right}` });
      this.make("text", { x: box.left - 5, y: this.up(y) + 4, "text-anchor": "end" }, shown(y));
    }
    for (const x of (!this.zoom && spec.x.ticks) || ticks(this.x.low, this.x.high, 5)) {
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
  line(line, port) {
    let path = "", open = false;
    const look = { class: `line ${line.look ?? ""}`, stroke: line.colour, "stroke-dasharray": line.dashes?.join(" ") || undefined };
    line.x.forEach((x, i) => {
      const y = line.y[i], { low, high } = this.x;
      if (y === null || !Number.isFinite(y) || x < low || x > high) { open = false; return; }
      path += `${open ? "L" : "M"}${this.across(x).toFixed(1)} ${this.up(y).toFixed(1)}`;
      open = true;
    });
    this.make("path", { ...look, d: path || "M0 0" }, undefined, port);
    (line.dots ?? []).forEach((full, i) => {
      if (line.y[i] === null || line.x[i] < this.x.low || line.x[i] > this.x.high) return;
      const at = { cx: this.across(line.x[i]), cy: this.up(line.y[i]) };
      this.make("circle", { class: "dots", ...at, r: 3, stroke: line.colour, fill: full ? line.colour : "#fff" }, undefined, port);
    });
  }

  // ---- readout of the values under the pointer, and zoom
  place(event) { // position on the axis under the pointer
    const { left, width } = this.svg.getBoundingClientRect(), { box } = this;
    const pixel = ((event.clientX - left) * this.svg.viewBox.baseVal.width) / width;
    const share = Math.min(1, Math.max(0, (pixel - box.left) / (box.right - box.left)));
    return this.x.low + share * (this.x.high - this.x.low);
  }
  hover(event) {
    if (!this.spec) return;
    const x = this.place(event);
    if (this.dragFrom !== null) {
      const [a, b] = [this.across(this.dragFrom), this.across(x)];
      this.dragged.setAttribute("x", Math.min(a, b));
      this.dragged.setAttribute("width", Math.abs(b - a));
    }
    this.readOut(x);
  }
  readOut(x) {
    const { spec, box } = this;
    const points = spec.lines.filter((line) => line.x.length).map((line) => {
      let best = 0;
      line.x.forEach((v, i) => { if (Math.abs(v - x) < Math.abs(line.x[best] - x)) best = i; });
      return { at: line.x[best], words: `${line.name} ${shown(line.y[best])}` };
    });
    if (!points.length) return;
    this.at = x;
    this.cursor.setAttribute("d", `M${this.across(points[0].at)} ${box.top}V${box.bottom}`);
    this.values.textContent = `${spec.x.label.replace(/ \[.*/, "")} ${shown(points[0].at, 5)}: ${points.map((p) => p.words).join(", ")}`;
  }
  leave() {
    this.dragFrom = null;
    this.dragged?.setAttribute("width", 0);
    this.cursor?.setAttribute("d", "");
    this.values.textContent = "";
  }
  beginDrag(event) {
    if (this.spec && event.button === 0) this.dragFrom = this.place(event);
  }
  endDrag(event) {
    if (this.dragFrom === null) return;
    const [low, high] = [this.dragFrom, this.place(event)].sort((a, b) => a - b);
    this.leave();
    this.zoomTo(low, high, 0.02);
  }
  zoomTo(low, high, least) { // zooms to a part of the axis, unless it is smaller than the share `least` of the visible part
    const whole = this.spec.x;
    if (high - low < least * (this.x.high - this.x.low) || high - low < 1e-3 * (whole.high - whole.low)) return;
    const all = low <= whole.low && high >= whole.high;
    this.show(this.spec, all ? null : { ...whole, low: Math.max(low, whole.low), high: Math.min(high, whole.high) });
  }
  key(event) {
    if (!this.spec || event.ctrlKey || event.altKey || event.metaKey) return;
    const { low, high } = this.x, at = this.at ?? (low + high) / 2, step = (high - low) / 100;
    const half = { "+": 0.25, "-": 1 }[event.key] * (high - low);
    if (half) this.zoomTo(at - half, at + half, 0);
    else if (event.key === "0" || event.key === "Escape") this.show(this.spec, null);
    else if (!event.key.startsWith("Arrow") || event.key.length < 9) return; // left and right
    const to = event.key === "ArrowLeft" ? at - step : event.key === "ArrowRight" ? at + step : at;
    this.readOut(Math.min(this.x.high, Math.max(this.x.low, to)));
    event.preventDefault();
  }
}
