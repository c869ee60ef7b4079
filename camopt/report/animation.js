// Animation of the valve train from the data of camopt/report/motion.py; it loads nothing from outside.
"use strict";
function trainParts(chosen) { // the elements that trainAnimation fills; chosen: whether the reader selects cam and speed
  const option = (value, words, selected) => h("option", { value, selected }, words);
  const drawing = (id, label) => svgNode("svg", { id, role: "img", "aria-label": label });
  const head = (words) => h("th", { scope: "col", class: words === "state" ? "text" : null }, words);
  const keys = h("p", { class: "source screen-only" }, "Arrow keys move the slider, space plays and pauses.");
  return [
    h("div", { class: "controls" },
      h("label", { hidden: !chosen }, "cam ", h("select", { id: "train-cam" })),
      h("label", { hidden: !chosen }, "speed ", h("select", { id: "train-speed" })),
      h("label", {}, "gaps drawn ", h("select", { id: "train-gaps" }, option(1, "true size"), option(10, "10 times"),
        option(50, "50 times", true), option(200, "200 times"))),
      h("label", {}, "pace ", h("select", { id: "train-pace" }, option(6, "6 deg/s"), option(20, "20 deg/s", true),
        option(60, "60 deg/s"))),
      h("button", { type: "button", id: "train-play", "aria-pressed": "false" }, "Play")),
    h("p", { id: "train-caption" }),
    h("div", { class: "stage" }, drawing("train-drawing", "Cam, masses, springs and contacts at the chosen angle"),
      h("div", {}, drawing("train-chart", "Valve lift against cam angle, and where each contact is open"),
        h("input", { type: "range", id: "train-angle", min: 0, step: 1, "aria-label": "cam angle" }), ...(chosen ? [keys] : []),
        h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Contacts at the chosen angle" },
          h("table", { id: "train-numbers" }, h("tr", {}, ...["contact", "state", "force [N]", "separation [mm]"].map(head))))))];
}
function trainAnimation(page, first) { // page: container of the elements; returns a function that replaces the data
  const $ = (id) => page.querySelector(`#${id}`);
  let data, drawing, step, scale, steps; // scale: pixels per millimetre
  const ROOM = 16; // largest widening of a drawn gap [px]
  const STUB = 7; // distance from a contact's face to its mass [px]
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const state = { index: 0, playing: false, last: 0, fraction: 0 }; // last: time of the last frame [ms]; fraction: of a step
  let cam, motion, masses, parts, rows;

  const make = (parent, ...what) => parent.appendChild(svgNode(...what));
  const number = (value, digits) => value.toFixed(digits).replace("-", "−");
  const angle = () => -180 + state.index * step;
  const shift = (mass) => (mass < 0 ? 0 : (scale * motion.position_um[mass][state.index]) / 1000);
  const separation = (k) => motion.separation_um[k][state.index] / 1000; // mm
  const isOpen = (k, i = state.index) => motion.separation_um[k][i] > 0 || motion.force_N[k][i] === 0;
  const line = (x1, y1, x2, y2) => `M${x1} ${y1}L${x2} ${y2}`;

  function coil(x, top, bottom, wide) {
    const turns = 5, lead = 4, pitch = (bottom - top - 2 * lead) / (2 * turns);
    let path = `M${x} ${top}V${top + lead}`;
    for (let i = 0; i < 2 * turns; i++) path += `L${x + (i % 2 ? -wide : wide)} ${top + lead + (i + 0.5) * pitch}`;
    return `${path}L${x} ${bottom - lead}V${bottom}`;
  }
  function ground(x, y, side) { // side -1: the ground is above
    let path = line(x - 15, y, x + 15, y);
    for (let i = -12; i <= 12; i += 6) path += line(x + i, y, x + i + 4 * side, y + 6 * side);
    return path;
  }

  // ---- the train: its parts are created once, and `place` moves them
  function build() {
    const svg = $("train-drawing");
    svg.replaceChildren();
    svg.setAttribute("viewBox", `0 0 ${Math.ceil(drawing.width)} ${Math.ceil(drawing.height)}`);
    svg.style.maxWidth = `${Math.ceil(1.15 * drawing.width)}px`;
    const layer = { cam: make(svg, "g"), lines: make(svg, "g"), masses: make(svg, "g") };
    masses = drawing.masses.map((m) => builtMass(layer, m));
    parts = drawing.elements.map((e, index) => builtPart(layer, e, index));
  }
  function builtMass(layer, m) {
    const group = make(layer.masses, "g");
    make(group, "title", {}, m.name);
    const name = m.name.length > 14 ? `${m.name.slice(0, 13)}…` : m.name;
    const y = m.y - m.height / 2, attributes = { class: `mass ${m.kind}` };
    if (m.kind === "hub") {
      make(group, "path", { ...attributes, d: line(m.left, m.y, m.right, m.y) });
      make(group, "circle", { ...attributes, cx: m.x, cy: m.y, r: 6 });
    } else if (m.kind === "valve") {
      const d = `M${m.left} ${y + m.height}L${m.left + 9} ${y}H${m.right - 9}L${m.right} ${y + m.height}Z`;
      make(group, "path", { ...attributes, d });
    } else {
      make(group, "rect", { ...attributes, x: m.left, y, width: m.right - m.left, height: m.height, rx: 3 });
    }
    const inside = m.kind === "mass" || m.kind === "valve";
    const place = inside ? { x: (m.left + m.right) / 2, "text-anchor": "middle" } : { x: m.right + 5 };
    make(group, "text", { ...place, y: m.y + 4, class: inside ? "name" : "name small" }, name);
    return group;
  }
  function builtPart(layer, e, index) {
    const k = data.contacts.indexOf(index); // -1: a bilateral spring
    const group = make(layer.lines, "g");
    make(group, "title", {}, e.name);
    const part = { ...e, k };
    if (k >= 0) part.light = make(group, "rect", { class: "light", width: 36, x: e.x - 18, rx: 5 });
    part.body = make(group, "path", { class: e.look });
    if (e.look === "cam" && data.follower === "roller") {
      part.roller = make(group, "circle", { class: "mass", cx: e.x, r: scale * data.roller_radius_mm });
    }
    if (k >= 0) {
      const anchor = e.words < 0 ? "end" : "start";
      part.word = make(group, "text", { class: "open", x: e.x + 22 * e.words, "text-anchor": anchor }, "open");
    }
    for (const [y, side] of [[e.top, -1], [e.bottom, 1]]) {
      if (y === null || (e.look === "cam" && side < 0)) continue;
      make(group, "path", { class: "ground", d: ground(e.x, y, side) });
    }
    if (e.look === "cam") {
      part.wheel = make(layer.cam, "g");
      part.contour = make(part.wheel, "path", { class: "contour" });
      const nose = data.arm?.centre ?? [0, 1], long = (0.6 * scale * data.base_radius_mm) / Math.hypot(...nose);
      make(part.wheel, "path", { class: "nose", d: line(0, 0, long * nose[0], long * nose[1]) });
      if (e.a < 0) make(part.wheel, "circle", { class: "mass", r: 6 });
      if (data.arm) part.arm = swingingArm(group, data.arm, e.x, e.a < 0 ? e.top : drawing.masses[e.a].y);
    }
    return part;
  }

  function drawnGap(k, magnification) {
    const gap = scale * separation(k);
    return Math.min(magnification * gap, gap + ROOM);
  }
  function place(part, magnification) {
    const { x, k, look } = part, m = drawing.masses;
    const above = part.a < 0 ? part.top : m[part.a].y + shift(part.a);
    const below = part.b < 0 ? part.bottom : m[part.b].y - m[part.b].height / 2 + shift(part.b);
    const gap = k < 0 ? 0 : drawnGap(k, magnification);
    let top = part.a < 0 || look === "cam" ? above : above + m[part.a].height / 2;
    let face = below;
    if (look === "cam") {
      part.wheel.setAttribute("transform", `translate(${x} ${above}) rotate(${data.turn * angle()})`);
      if (part.arm) return swing(part, gap, below);
      top = above + scale * (data.base_radius_mm + cam.lift_um[state.index] / 1000);
      face = top + gap;
      part.body.setAttribute("d", follower(part, x, face, below));
    } else if (k < 0) {
      part.body.setAttribute("d", look === "coil" ? coil(x, top, below, 12) : line(x, top, x, below));
    } else {
      face = below - STUB;
      const body = look === "coil" ? coil(x, top, face - gap, 12) : line(x, top, x, face - gap);
      const plate = (y) => line(x - 13, y, x + 13, y);
      part.body.setAttribute("d", body + plate(face - gap - 1.5) + plate(face + 1.5) + line(x, face, x, below));
      top = face - gap;
    }
    if (k >= 0) showOpen(part, top, face);
  }
  function showOpen(part, top, face) {
    const open = isOpen(part.k);
    part.light.setAttribute("y", top - 6);
    part.light.setAttribute("height", Math.max(12, face - top + 12));
    part.light.classList.toggle("on", open);
    part.word.setAttribute("y", (top + face) / 2 + 4);
    part.word.style.display = open ? "" : "none";
  }
  function follower(part, x, face, below) {
    if (data.follower === "flat") return line(x - 30, face, x + 30, face) + line(x, face, x, below);
    const tip = face + 9;
    if (data.follower === "point") return `M${x - 6} ${tip}L${x} ${face}L${x + 6} ${tip}M${x} ${face}V${below}`;
    const centre = face + scale * data.roller_radius_mm;
    part.roller.setAttribute("cy", centre);
    return line(x, centre, x, below);
  }

  // ---- a finger or rocker: a body that is drawn with the valve shut and turns about its pivot with the valve's lift
  function turned([x, y], by) {
    return [x * Math.cos(by) - y * Math.sin(by), x * Math.sin(by) + y * Math.cos(by)];
  }
  function swingingArm(group, arm, x, y) {
    const [pivot, centre, valve] = [arm.pivot, arm.centre, arm.valve].map((at) => at.map((mm) => scale * mm));
    const radius = scale * arm.radius, toCam = centre.map((c) => (-c * radius) / Math.hypot(...centre));
    const rim = (by, share = 1) => turned(toCam, by).map((v, i) => centre[i] + share * v);
    const held = make(group, "g", { transform: `translate(${x} ${y})` }), body = make(held, "g");
    make(held, "path", { class: "ground", d: ground(pivot[0], pivot[1] + 12, 1) + `M${pivot}v12` });
    make(body, "path", { class: "arm", d: `M${pivot}L${arm.rolls ? centre : rim(0, 1 - 5 / radius)}L${valve}` });
    if (arm.rolls) make(body, "circle", { class: "mass", cx: centre[0], cy: centre[1], r: radius });
    else make(body, "path", { class: "pad", d: `M${rim(-0.5)}A${radius} ${radius} 0 0 1 ${rim(0.5)}` });
    for (const at of [pivot, valve]) make(body, "circle", { class: "mass", cx: at[0], cy: at[1], r: 5 });
    return { ...arm, body, pivot, centre, valve, radius, x, y };
  }
  function swing({ arm, body, light, word, words, k }, gap, below) {
    const shut = (arm.shut_deg * Math.PI) / 180, lift = cam.lift_um[state.index] / 1000 + gap / scale;
    const by = arm.side * (Math.asin(Math.min(1, Math.sin(shut) + lift / arm.valve_arm_mm)) - shut);
    const moved = (at) => turned(at.map((v, i) => v - arm.pivot[i]), by).map((v, i) => v + arm.pivot[i]);
    arm.body.setAttribute("transform", `rotate(${(by * 180) / Math.PI} ${arm.pivot})`);
    const centre = moved(arm.centre), reach = 1 - arm.radius / Math.hypot(...centre);
    const tip = arm.x + arm.valve[0], tipY = arm.y + moved(arm.valve)[1] + 5, y = arm.y + reach * centre[1];
    body.setAttribute("d", line(tip - 10, tipY, tip + 10, tipY) + line(tip, tipY, tip, below));
    light.setAttribute("x", arm.x + reach * centre[0] - 18);
    word.setAttribute("x", arm.x + reach * centre[0] + 22 * words);
    showOpen({ light, word, k }, y, y);
  }

  // ---- the chart above the slider: valve lift, and the intervals in which each contact is open
  const chart = $("train-chart");
  const LEFT = 40, RIGHT = 10, TOP = 16, HIGH = 110, ROW = 30;
  let cursor, across, drawnWidth;
  function drawChart() { // a known width avoids a layout of the page
    const width = Math.max(280, drawnWidth ?? chart.parentElement.clientWidth), n = data.contacts.length;
    const bottom = TOP + HIGH, end = bottom + 8 + n * ROW;
    chart.replaceChildren();
    chart.setAttribute("viewBox", `0 0 ${width} ${end + 34}`);
    across = (i) => LEFT + ((width - LEFT - RIGHT) * i) / steps;
    const lifts = motion.separation_um[data.seat];
    const tops = data.cams.flatMap((c) => c.motions.map((q) => Math.max(...q.separation_um[data.seat])));
    const most = Math.max(1, Math.ceil(Math.max(...tops) / 1000)); // one axis for all cams and speeds
    const up = (um) => bottom - (HIGH * um) / 1000 / most;
    for (let mm = 0; mm <= most; mm += most > 5 ? 2 : 1) {
      make(chart, "path", { class: "grid", d: line(LEFT, up(1000 * mm), width - RIGHT, up(1000 * mm)) });
      make(chart, "text", { x: LEFT - 5, y: up(1000 * mm) + 4, "text-anchor": "end" }, mm);
    }
    make(chart, "text", { x: 2, y: 10 }, "valve lift above the seat [mm]");
    const points = lifts.map((v, i) => `${across(i).toFixed(1)} ${up(v).toFixed(1)}`).join("L");
    const dashes = cam.dashes.join(" ");
    make(chart, "path", { class: "curve", d: `M${points}`, stroke: cam.colour, "stroke-dasharray": dashes });
    data.contacts.forEach((element, k) => openSpans(k, drawing.elements[element].name, bottom + 8 + k * ROW, width));
    for (let deg = -180; deg <= 180; deg += 90) {
      const anchor = { "-180": "start", 180: "end" }[deg] ?? "middle";
      make(chart, "text", { x: across((deg + 180) / step), y: end + 14, "text-anchor": anchor }, number(deg, 0));
    }
    make(chart, "text", { x: (LEFT + width - RIGHT) / 2, y: end + 29, "text-anchor": "middle" }, "cam angle [deg]");
    cursor = make(chart, "path", { class: "cursor" });
    cursor.dataset.end = end;
  }
  function openSpans(k, name, y, width) {
    make(chart, "text", { x: LEFT, y: y + 11 }, `${name}: open`);
    make(chart, "path", { class: "grid", d: line(LEFT, y + 20, width - RIGHT, y + 20) });
    for (let i = 0, begin = -1; i <= steps + 1; i++) {
      const open = i <= steps && isOpen(k, i);
      if (open && begin < 0) begin = i;
      if (!open && begin >= 0) {
        const long = Math.max(1.5, across(i - 1) - across(begin));
        make(chart, "rect", { class: "light on", x: across(begin), y: y + 15, width: long, height: 10 });
        begin = -1;
      }
    }
  }

  // ---- numbers, controls
  function buildRows() {
    const table = $("train-numbers");
    while (table.rows.length > 1) table.deleteRow(1);
    rows = data.contacts.map((element) => {
      const row = table.insertRow();
      row.insertCell().textContent = drawing.elements[element].name;
      return [row.insertCell(), row.insertCell(), row.insertCell()];
    });
  }
  function show() {
    const magnification = Number($("train-gaps").value);
    masses.forEach((group, i) => group.setAttribute("transform", `translate(0 ${shift(i)})`));
    parts.forEach((part) => place(part, magnification));
    rows.forEach(([word, force, apart], k) => {
      word.textContent = isOpen(k) ? "open" : "closed";
      word.className = isOpen(k) ? "text lit" : "text";
      force.textContent = number(motion.force_N[k][state.index], 1);
      apart.textContent = number(separation(k), 4);
    });
    cursor.setAttribute("d", line(across(state.index), TOP, across(state.index), cursor.dataset.end));
    const lift = `valve ${number(separation(data.seat), 3)} mm above its seat`;
    const at = `cam angle ${number(angle(), 1)} deg`;
    $("train-angle").value = state.index;
    $("train-angle").setAttribute("aria-valuetext", `${at}, ${lift}`);
    $("train-caption").textContent = `${cam.name} at ${motion.speed_rpm} r/min, ${at}: cam lift ` +
      `${number(cam.lift_um[state.index] / 1000, 3)} mm, ${lift}. Gaps drawn ${magnification} times.` +
      (motion.periodic ? "" : " This motion has not settled: one revolution of many that differ.");
  }
  function choose() {
    cam = data.cams[$("train-cam").value];
    const wanted = $("train-speed").value;
    $("train-speed").replaceChildren(...cam.motions.map((m) => new Option(`${m.speed_rpm} r/min`, m.speed_rpm)));
    motion = cam.motions.find((m) => String(m.speed_rpm) === wanted) ?? cam.motions.at(-1);
    $("train-speed").value = motion.speed_rpm;
    const points = cam.contour_mm.map(([x, y]) => `${(scale * x).toFixed(2)} ${(scale * y).toFixed(2)}`);
    const contour = `M${points.join("L")}Z`;
    for (const part of parts.filter((p) => p.contour)) {
      part.contour.setAttribute("d", contour);
      part.contour.setAttribute("stroke", cam.colour);
      part.contour.setAttribute("fill", cam.colour);
    }
    drawChart();
    show();
  }
  function play(on) {
    state.playing = on;
    state.last = 0;
    $("train-play").textContent = on ? "Pause" : "Play";
    $("train-play").setAttribute("aria-pressed", on);
    if (on) requestAnimationFrame(frame);
  }
  function frame(now) {
    if (!state.playing) return;
    const pause = still.matches ? 500 : 0; // two frames per second where reduced motion is requested
    if (!state.last || now - state.last >= pause) {
      const degrees = state.last ? still.matches ? 5 : ((now - state.last) / 1000) * Number($("train-pace").value) : 0;
      state.fraction += degrees / step;
      const whole = Math.floor(state.fraction);
      state.fraction -= whole;
      state.index = (state.index + whole) % steps;
      state.last = now;
      show();
    }
    requestAnimationFrame(frame);
  }
  function setData(newData) {
    const angleBefore = data ? angle() : -40;
    data = newData;
    ({ drawing, step_deg: step } = data);
    scale = drawing.scale;
    steps = Math.round(360 / step);
    state.index = Math.round((angleBefore + 180) / step);
    const chosen = $("train-cam").value;
    $("train-cam").replaceChildren(...data.cams.map((c, i) => new Option(c.name, i)));
    $("train-cam").value = chosen in data.cams ? chosen : 0;
    $("train-angle").max = steps;
    build();
    buildRows();
    choose();
  }
  $("train-cam").addEventListener("change", choose);
  $("train-speed").addEventListener("change", choose);
  $("train-gaps").addEventListener("change", show);
  $("train-play").addEventListener("click", () => play(!state.playing));
  $("train-angle").addEventListener("input", (event) => {
    play(false);
    state.index = Number(event.target.value);
    show();
  });
  $("train").addEventListener("keydown", (event) => { // buttons and lists use the space key themselves
    if (event.key !== " " || ["BUTTON", "SELECT"].includes(event.target.tagName)) return;
    event.preventDefault();
    play(!state.playing);
  });
  setData(first);
  new ResizeObserver(([entry]) => {
    if (entry.contentRect.width === drawnWidth) return;
    drawnWidth = entry.contentRect.width;
    drawChart();
    show();
  }).observe(chart.parentElement);
  return setData;
}
