// The report's charts: lift laws of the cams, the motion at a speed, bounce, jump and forces over the band, and the search.
const CHART_HEIGHT = 210;

class ReportCharts {
  constructor(root, data, moving) {
    Object.assign(this, { root, data, moving, drawn: [] });
    this.on = new Set(data.cams.filter((c) => c.place !== "beyond").map((c) => c.name));
    this.switches();
    this.laws();
    this.motion();
    this.phases();
    this.band();
    this.search();
    this.show();
    root.documentElement.classList.add("live");
    new ResizeObserver(() => this.reachable()).observe(root.body);
  }
  reachable() { // makes boxes that scroll sideways at this width reachable by the keyboard
    for (const box of this.root.querySelectorAll(".scroll")) {
      if (box.scrollWidth > box.clientWidth) box.setAttribute("tabindex", "0");
      else box.removeAttribute("tabindex");
    }
  }
  shown() { return this.data.cams.filter((c) => this.on.has(c.name)); }
  leading() { // names of the cams for which the axes are scaled: a rejected cam would flatten the other curves
    const cams = this.shown(), leading = cams.filter((c) => c.place === "design" || (c.place === "within" && c.verdict === "confirmed"));
    return new Set((leading.length ? leading : cams).map((c) => c.name));
  }
  limits(key) { return this.data.quantities.find((q) => q.key === key).limits; }
  speeds() { return [...new Set(this.moving.cams.flatMap((c) => c.motions.map((m) => m.speed_rpm)))].sort((a, b) => a - b); }
  at(id) { return this.root.getElementById(id); }
  place(id, title, unit, specNow) { // adds a chart that is drawn again whenever the shown cams or the speed change
    const chart = new Chart(title, unit, CHART_HEIGHT);
    this.at(id).append(chart.node);
    this.drawn.push(() => {
      const spec = specNow();
      chart.node.hidden = !spec;
      if (spec) chart.show(spec);
    });
  }
  show() { this.drawn.forEach((draw) => draw()); }

  // ---- which cams are shown
  switches() {
    const groups = [["design", "The design"], ["within", "Under the same limits"], ["beyond", "Beyond limits on the cam"]];
    for (const [place, words] of groups) {
      const members = this.data.cams.filter((c) => c.place === place);
      if (members.length) this.at("cam-switches").append(h("div", {}, h("span", {}, words), ...members.map((c) => this.switch(c))));
    }
  }
  switch(cam) {
    const swatch = svgNode("svg", { viewBox: "0 0 34 8", "aria-hidden": "true" });
    swatch.append(svgNode("path", { d: "M0 4H34", stroke: cam.colour, "stroke-width": 2.5, "stroke-dasharray": cam.dashes.join(" ") }));
    const box = h("input", { type: "checkbox", on: { change: () => this.toggle(cam.name, box.checked) } });
    box.checked = this.on.has(cam.name);
    const verdict = cam.verdict === "confirmed" ? "" : ` (${cam.verdict})`;
    return h("label", {}, box, swatch, cam.name + verdict);
  }
  toggle(name, on) {
    if (on) this.on.add(name);
    else this.on.delete(name);
    this.show();
  }

  // ---- lines over an axis that is scaled for the leading cams; the caption names the cams that are cut
  lines(x, values, x_of = null) {
    return this.shown().filter(values).map((c) => ({ name: c.name, x: x_of ? x_of(c) : x, y: values(c), colour: c.colour, dashes: c.dashes }));
  }
  spec(axis, lines, limits, { include = [0], sign = false, far = 3 } = {}) {
    if (!lines.length) return null;
    const top = (line) => Math.max(...line.y.filter((v) => v !== null));
    const leading = this.leading(), led = lines.filter((l) => leading.has(l.name)), largest = Math.max(...(led.length ? led : lines).map(top));
    const near = limits.filter((v) => v <= far * largest || largest <= 0), most = 1.15 * Math.max(largest, ...near, ...include);
    const beyond = lines.filter((l) => top(l) > most).map((l) => `${l.name} to ${shown(top(l), 3)}`);
    const main = lines.find((l) => l.name === "design") ?? lines[0];
    const caption = `${main.name}: largest ${shown(top(main))}` + (sign ? `, least ${shown(Math.min(...main.y.filter((v) => v !== null)))}` : "");
    return { x: axis, lines, include, most: beyond.length ? most : undefined,
      limits: limitsAt(near),
      caption: caption + (beyond.length ? `; beyond this axis: ${beyond.join(", ")}` : "") };
  }
  laws() {
    const { data } = this;
    const n = data.cams[0].lift_mm.length, angles = Array.from({ length: n }, (_, i) => data.from_deg + i * data.step_deg);
    const x = { label: "cam angle [deg]", low: angles[0], high: angles.at(-1) };
    const places = [-1, 1].map((s) => (s * data.duration_deg) / 2);
    for (const law of data.laws) {
      this.place("charts-cams", law.title, law.unit, () => {
        const spec = this.spec(x, this.lines(angles, (c) => c[law.key]), law.limits, { sign: law.key !== "lift_mm" });
        return spec && { ...spec, places, include: [0, ...law.limits] };
      });
    }
  }

  // ---- the motion at one speed
  motion() {
    const speeds = this.speeds();
    const chosen = h("select", { on: { change: () => this.show() } }, ...speeds.map((s) => h("option", { value: s }, `${s} r/min`)));
    chosen.value = speeds.at(-1);
    this.at("motion-speed").append(h("label", {}, "speed ", chosen));
    const motionOf = (cam) => this.moving.cams.find((c) => c.name === cam.name)?.motions.find((m) => String(m.speed_rpm) === chosen.value);
    const n = Math.round(360 / this.moving.step_deg) + 1, angles = Array.from({ length: n }, (_, i) => -180 + i * this.moving.step_deg);
    const x = { label: "cam angle [deg]", low: this.data.from_deg, high: -this.data.from_deg }, half = this.data.duration_deg / 2;
    const places = [-half, half];
    const valve = (cam) => motionOf(cam)?.separation_um[this.moving.seat].map((um) => um / 1000);
    const chart = (title, unit, axis, values, limits, settings) => this.place("charts-motion", title, unit, () => {
      const spec = this.spec(axis, this.lines(angles, values), limits, settings);
      return spec && { ...spec, places };
    });
    chart("Valve lift", "mm", x, valve, []);
    const bounce = this.limits("bounce_mm");
    const closing = { label: "cam angle [deg], closing", low: half - 8, high: Math.min(180, half + 40) };
    this.place("charts-motion", "Valve above its seat, closing", "mm", () => {
      const top = 4 * (bounce[0] || 0.02), lines = this.lines(angles, valve);
      return lines.length ? { x: closing, lines, include: [0, top], most: top, places, caption: `up to ${shown(top)} mm`,
        limits: limitsAt(bounce, "bounce limit") } : null;
    });
    this.phasePlane(motionOf, bounce[0]);
    const force = this.limits("contact_force_max_N");
    this.moving.contacts.forEach((e, k) => {
      if (k !== this.moving.seat) chart(`Force of ${this.moving.drawing.elements[e].name}`, "N", x, (c) => motionOf(c)?.force_N[k], force);
    });
  }

  // ---- phases of the motion: the phase plane at one speed, and the angles of opening and closing over the speeds
  leadingSpec({ x, lines, caption, ...spec }) { // scales the axis for the leading cams; the caption names the cams that are cut
    if (!lines.length) return null;
    const leading = this.leading();
    const inside = (line) => line.y.filter((v, i) => v !== null && line.x[i] >= x.low && line.x[i] <= x.high);
    const levels = lines.filter((l) => leading.has(l.cam)).flatMap(inside), least = Math.min(...levels), most = Math.max(...levels);
    if (!levels.length) return { x, lines, limits: [], caption, ...spec };
    const cut = new Set(lines.filter((l) => inside(l).some((v) => v < least || v > most)).map((l) => l.cam));
    return { x, lines, limits: [], least, most, caption: caption + (cut.size ? `; cut at this axis: ${[...cut].join(", ")}` : ""), ...spec };
  }
  phasePlane(motionOf, bounce) {
    const { seat, cams } = this.moving, near = 4 * (bounce || 0.02);
    const most = Math.max(...cams.flatMap((c) => c.motions.flatMap((m) => m.separation_um[seat]))) / 1000;
    for (const [title, high] of [["Phase plane", 1.02 * most], ["Phase plane, close to the seat", near]]) {
      const x = { label: "valve above its seat [mm]", low: 0, high };
      this.place("charts-motion", `${title}: velocity of the valve`, "m/s", () => this.leadingSpec({ x, include: [0],
        caption: "opening above zero, closing below; a loop at the seat is a bounce",
        lines: this.shown().filter(motionOf).map((c) => ({ name: c.name, cam: c.name, colour: c.colour, dashes: c.dashes,
          x: motionOf(c).separation_um[seat].map((um) => um / 1000), y: motionOf(c).valve_mm_per_s.map((v) => v / 1000) })) }));
    }
  }
  phases() {
    const { step_deg: step, seat, cams } = this.moving, speeds = cams.flatMap((c) => c.motions.map((m) => m.speed_rpm));
    const low = Math.min(...speeds), high = Math.max(...speeds), room = 0.03 * (high - low);
    if (!room) return;
    const x = { label: "crankshaft speed [r/min]", low: low - room, high: high + room };
    const events = new Map(cams.map((c) => [c.name, c.motions.map((m) => ({ speed: m.speed_rpm, ...valveEvents(m.separation_um[seat], step) }))]));
    const line = (c, key, name, dashes) => ({ name, cam: c.name, colour: c.colour, dashes, x: events.get(c.name).map((at) => at.speed),
      y: events.get(c.name).map((at) => at[key]), dots: events.get(c.name).map(() => key !== "rests") });
    const place = (title, caption, lines) => this.place("charts-band", title, "deg", () => this.leadingSpec({ x, caption,
      lines: this.shown().filter((c) => events.has(c.name)).flatMap(lines) }));
    place("Cam angle at which the valve opens", "at the listed speeds", (c) => [line(c, "opens", c.name, c.dashes)]);
    place("Cam angle at which the valve touches its seat, and rests there", "dotted: after its last bounce",
      (c) => [line(c, "touches", `${c.name} touches`, c.dashes), line(c, "rests", `${c.name} rests`, [1, 4])]);
  }

  // ---- over the band
  band() {
    const x_of = (c) => c.band.speed_rpm, all = this.data.cams.filter((c) => c.band).flatMap(x_of);
    if (!all.length) return;
    const x = { label: "crankshaft speed [r/min]", low: Math.min(...all), high: Math.max(...all) };
    const places = this.speeds();
    for (const q of this.data.quantities) {
      this.place("charts-band", q.title, q.unit, () => {
        const spec = this.spec(x, this.lines(null, (c) => c.band?.[q.key], x_of), q.limits, { far: q.unit === "mm" ? Infinity : 3, sign: q.least });
        return spec && { ...spec, places };
      });
    }
  }

  // ---- the search
  search() {
    const { search } = this.data, steps = search.area_ratio.map((_, i) => i + 1);
    if (steps.length < 2) return;
    const x = { label: "step of the search", low: 0.5, high: steps.length + 0.5 };
    const places = steps.filter((i) => i > 1 && search.stage[i - 1] !== search.stage[i - 2]).map((i) => i - 0.5);
    const line = (y, more = {}) => ({ x: steps, y, colour: "#0072B2", ...more });
    const stages = [...new Set(search.stage)].join(", ");
    this.place("charts-search", "Area ratio", "–", () => ({ x, places, limits: [],
      lines: [line(search.area_ratio, { name: "step", dots: search.confirmed, dashes: [2, 3] }), line(search.best_area_ratio, { name: "best that holds" })],
      caption: `delivered ${shown(search.delivered)}${search.bound === null ? "" : `; certified bound ${shown(search.bound)}, beyond this axis`}; stages: ${stages}` }));
    const bounce = this.limits("bounce_mm");
    this.place("charts-search", "Worst bounce", "mm", () => ({ x, places, include: [0, ...bounce], limits: limitsAt(bounce),
      lines: [line(search.worst_bounce_mm, { name: "step", dots: search.confirmed, dashes: [2, 3] })], caption: "filled: every limit holds at the searched speeds" }));
  }
}

function valveEvents(separation, step) { // cam angles [deg] at which the valve opens, first touches its seat, and comes to rest on it; null: never
  const top = separation.indexOf(Math.max(...separation)), end = separation.length - 1;
  if (!(separation[top] > 0)) return { opens: null, touches: null, rests: null };
  const crossed = (open, inside) => { // end of the closed interval next to the open sample `open`, extrapolated from it and the next open sample
    const slope = separation[open + inside] - separation[open];
    return open - inside * Math.min(1, slope > 0 ? separation[open] / slope : 1);
  };
  let first = top, last = top, final = end;
  while (first > 0 && separation[first - 1] > 0) first -= 1;
  while (last < end && separation[last + 1] > 0) last += 1;
  while (final > last && !(separation[final] > 0)) final -= 1;
  const angle = (i) => -180 + step * i;
  return { opens: angle(crossed(first, 1)), touches: last === end ? null : angle(crossed(last, -1)), rests: final === end ? null : angle(crossed(final, -1)) };
}
