// Display of an answer: charts, areas, trains as built, and the comparison with a pinned design.
const UNSEEN_MS = 400; // while the train is out of view, it is drawn this long after the last new motion
const FORCE_LOOKS = ["first", "second", "third", "fourth"];

class Panels {
  constructor(waiting) { // waiting: the element that shows how long a slow part has taken
    this.charts = {
      lift: new Chart("Cam lift", "mm"),
      acceleration: new Chart("Acceleration", "mm/deg²"),
      jerk: new Chart("Jerk", "mm/deg³"),
      valve: new Chart("Valve lift", "mm"),
      force: new Chart("Contact forces", "N"),
      bounce: new Chart("Bounce over the band", "mm"),
      jump: new Chart("Jump over the band", "mm"),
    };
    this.areas = h("div", { class: "areas" });
    this.trains = h("p", { class: "trains" }, "Yield: not drawn yet.");
    this.compared = h("div", { class: "compared" });
    this.train = h("section", { id: "train", "aria-label": "Animation of the valve train" }, ...trainParts(false));
    this.animate = null;
    const charts = Object.values(this.charts).map((c) => c.node);
    this.node = h("div", { class: "panels" },
      h("section", { class: "chart-grid", "aria-label": "Charts" }, ...charts),
      h("section", { class: "beside", "aria-label": "Area and yield" },
        h("h2", {}, "Area under these limits"), this.areas, h("h2", {}, "Trains as built"), this.trains, waiting, this.compared),
      h("section", { class: "moving" }, h("h2", {}, "The valve train in motion"), this.train));
    new IntersectionObserver((entries) => this.setVisible(entries.at(-1).isIntersecting)).observe(this.node.lastChild);
  }
  show(answer, values, pinned) {
    const c = answer.curves, d = pinned?.answer.curves, x = { label: "cam angle [deg]", low: -110, high: 110, ticks: [-90, -45, 0, 45, 90] };
    const lines = (key) => [...(d ? [{ name: "pinned", x: d.angle_deg, y: d[key], look: "pinned" }] : []),
      { name: "design", x: c.angle_deg, y: c[key], look: "design" }];
    const limit = (...keys) => limitsAt(keys.filter((k) => values[k] !== null && values[k] !== undefined)
      .flatMap((k) => (k === "jerk_max_mm_per_deg3" ? [values[k], -values[k]] : [values[k]])));
    const range = (key) => `from ${shown(Math.min(...c[key]))} to ${shown(Math.max(...c[key]))}`;
    this.charts.lift.show({ x, lines: lines("lift_mm"), limits: limit("max_lift_mm"), include: [0],
      caption: `largest ${shown(answer.max_lift_mm)} mm` });
    this.charts.acceleration.show({ x, lines: lines("acceleration_mm_per_deg2"), caption: range("acceleration_mm_per_deg2"),
      limits: limit("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2") });
    this.charts.jerk.show({ x, lines: lines("jerk_mm_per_deg3"), limits: limit("jerk_max_mm_per_deg3"), caption: range("jerk_mm_per_deg3") });
    this.motion(answer, values, pinned);
  }
  motion(answer, values, pinned) {
    const m = answer.motion;
    this.train.hidden = !m.animation;
    if (!m.animation) {
      for (const chart of [this.charts.valve, this.charts.force]) chart.words.textContent = m.says;
      return;
    }
    const a = m.animation, motion = a.cams[0].motions[0], old = pinned?.answer.motion.animation;
    const angles = motion.force_N[0].map((_, i) => -180 + i * a.step_deg), x = { label: "cam angle [deg]", low: -180, high: 180, ticks: [-180, -90, 0, 90, 180] };
    const mm = (of, seat) => of.separation_um[seat].map((v) => v / 1000);
    const settled = m.periodic ? "" : "; has not settled, one revolution of many";
    this.charts.valve.show({ x, limits: [], caption: `above its seat at ${shown(m.speed_rpm, 5)} r/min${settled}`, lines: [
      ...(old ? [{ name: "pinned", x: angles, y: mm(old.cams[0].motions[0], old.seat), look: "pinned" }] : []),
      { name: "cam less lash", x: angles, y: kinematic(a, values), look: "faint" },
      { name: "valve", x: angles, y: mm(motion, a.seat), look: "design" }] });
    const names = a.contacts.map((e) => a.drawing.elements[e].name);
    const forces = names.map((name, k) => ({ name, x: angles, y: motion.force_N[k], look: FORCE_LOOKS[k % 4] }));
    const tops = motion.force_N.map((row) => Math.max(...row));
    this.charts.force.show({ x, lines: forces, include: [0], caption: names.map((n, k) => `${["━", "╍", "┅", "·"][k % 4]} ${n} up to ${shown(tops[k], 4)} N`).join(", "),
      limits: values.contact_force_max_N ? [{ value: values.contact_force_max_N, name: "limit" }] : [] });
    this.newest = a;
    clearTimeout(this.drawTimer);
    if (this.visible === false) this.drawTimer = setTimeout(() => this.drawTrain(), UNSEEN_MS);
    else this.drawTrain();
  }
  drawTrain() { // draws the newest motion of the train, once
    const { newest } = this;
    this.newest = null;
    if (!newest) return;
    if (this.animate) this.animate(newest);
    else this.animate = trainAnimation(this.train.parentElement, newest);
  }
  setVisible(visible) {
    this.visible = visible;
    if (visible) this.drawTrain();
  }
  markBand(before) { // before: whether the curves over the band are those of earlier numbers
    for (const chart of [this.charts.bounce, this.charts.jump]) chart.node.classList.toggle("before", before);
  }
  markTrains(current) { // current: whether the yield is that of the page's numbers
    this.trains.classList.toggle("before", !current && this.trains.textContent.includes("%"));
  }
  band(band, values, pinned) {
    const x = { label: "crankshaft speed [r/min]", low: band.speeds_rpm[0], high: band.speeds_rpm.at(-1) };
    const places = [Math.min(x.high, Math.max(x.low, values.speed_rpm))];
    for (const [key, chart, limit] of [["bounce_mm", "bounce", values.bounce_max_mm], ["jump_mm", "jump", values.jump_max_mm]]) {
      const y = band.curves[key], most = Math.max(...y.filter((v) => v !== null)), at = band.speeds_rpm[y.indexOf(most)];
      const never = y.some((v) => v === null) ? "; does not seat at some speeds" : "";
      const old = pinned?.band ? [{ name: "pinned", x: pinned.band.speeds_rpm, y: pinned.band.curves[key], look: "pinned" }] : [];
      this.charts[chart].show({ x, places, lines: [...old, { name: "design", x: band.speeds_rpm, y, look: "design" }],
        limits: limit === null || limit === undefined ? [] : limitsAt([limit]),
        caption: `largest ${shown(most, 3)} mm at ${shown(at, 5)} r/min${never}` });
    }
  }
  showAreas(answer, references, pinned) { // references: the bound and the literature's cams
    const rows = [{ label: "Certified bound", area: references.bound, look: "bound" },
      { label: `Design (${answer.program})`, area: answer.area_ratio, look: "design" }];
    if (pinned) rows.push({ label: "Pinned", area: pinned.answer.area_ratio, look: "pinned" });
    for (const b of references.baselines ?? []) rows.push({ label: b.label, area: b.area_ratio, look: "other", says: b.says });
    const most = Math.max(...rows.map((r) => r.area ?? 0));
    this.areas.replaceChildren(h("table", {}, h("tr", {}, h("th", { scope: "col" }, "cam"), h("th", { scope: "col" }, "area ratio"), h("td")),
      ...rows.map((r) => {
        const bar = svgNode("svg", { viewBox: "0 0 100 8", "aria-hidden": "true" });
        bar.append(svgNode("rect", { class: r.look, width: (100 * (r.area ?? 0)) / most, height: 8 }));
        const words = r.area === undefined ? "…" : shown(r.area, 5);
        return h("tr", {}, h("th", { scope: "row", title: r.says ?? "" }, r.label + (r.says ? " *" : "")), h("td", {}, words), h("td", { class: "bar" }, bar));
      })), h("p", { class: "note" }, "The bound and the literature's cams do not consider the motion; the no-jump design keeps contact at the program's speeds."),
      ...rows.filter((r) => r.says).map((r) => h("p", { class: "note" }, `* ${r.label}: ${r.says}`)));
  }
  showTrains(reply, resting) {
    this.trains.textContent = reply.says + (resting || reply.share === undefined ? "" : " Few trains while you drag.");
  }
  compare(answer, band, pinned) {
    if (!pinned) { this.compared.replaceChildren(); return; }
    const rows = [["area ratio", answer.area_ratio, pinned.answer.area_ratio]];
    const names = { bounce_mm: "bounce [mm]", jump_mm: "jump [mm]", seating_velocity_m_per_s: "seating velocity [m/s]", contact_force_max_N: "peak force [N]" };
    for (const [key, label] of Object.entries(names)) rows.push([`${label} here`, answer.motion.metrics?.[key], pinned.answer.motion.metrics?.[key]]);
    const top = (b, key) => (b ? Math.max(...b.curves[key].map((v) => v ?? Infinity)) : null);
    for (const key of ["bounce_mm", "jump_mm"]) rows.push([`${names[key]} over the band`, top(band, key), top(pinned.band, key)]);
    this.compared.replaceChildren(h("h2", {}, "Against the pinned design"), h("table", {},
      h("tr", {}, h("td"), h("th", { scope: "col" }, "design"), h("th", { scope: "col" }, "pinned")),
      ...rows.map(([label, now, then]) => h("tr", {}, h("th", { scope: "row" }, label), h("td", {}, shown(now)), h("td", {}, shown(then))))));
  }
}
function kinematic(animation, values) { // valve lift by the cam lift and the lash alone [mm]
  return animation.cams[0].lift_um.map((um) => Math.max(0, um / 1000 - (values.lash_mm ?? 0)));
}
