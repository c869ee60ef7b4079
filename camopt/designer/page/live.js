// The designer: holds the numbers, requests answers (the newest request wins), shows them, and reports errors.
const REST_MS = 150; // the numbers are at rest when they have not changed for this time
const PATIENCE_MS = 500; // a change cancels a first answer that has taken longer than this, and later answers at once
const BEAT_MS = 4000;
const SHAPE_GROUPS = ["Cam", "Ramps", "Limits on the cam"];

class Designer {
  constructor(root, send, beat) {
    Object.assign(this, { root, send, beat, sequence: 0, busy: false, further: {},
      undone: [], redone: [], pinned: null, band: null, answer: null, shown: null, asked: performance.now(), client: String(Math.random()).slice(2) });
  }
  async begin() {
    const start = await this.send({ kind: "start" });
    this.controls = start.controls;
    this.initial = Object.fromEntries(start.controls.map((c) => [c.key, c.value]));
    this.values = { ...this.initial };
    this.committed = JSON.stringify(this.values);
    this.fields = new Fields(start.controls, (key, value, settled) => this.changed(key, value, settled));
    this.slow = new SlowParts(this);
    this.panels = new Panels(this.slow.node);
    this.layout(start);
    this.fields.show(this.values);
    this.ask(true);
    if (this.beat) this.heart = setInterval(() => this.listen(), BEAT_MS);
  }
  layout(start) {
    const button = (id, words, act) => (this[id] = h("button", { type: "button", on: { click: act } }, words));
    const values = () => this.values;
    this.verdict = new Verdict(this.root, (message) => this.told(message), values, start.files);
    this.result = h("p", { class: "result", "aria-live": "polite" });
    this.mark = new Mark(this.root, this.controls, () => this.cancel());
    this.trouble = h("p", { class: "trouble", role: "alert", hidden: true });
    const tools = h("div", { class: "tools" },
      button("undo", "Undo", () => this.back()), button("redo", "Redo", () => this.forth()),
      button("reset", "Reset", () => this.take({ ...this.initial })), button("pin", "Pin to compare", () => this.togglePin()), ...this.verdict.tools);
    const saving = start.files ? new Saving(start.name, this.send, values, (error) => (error ? this.failed(error) : this.alive())).node : "";
    this.root.replaceChildren(h("header", {}, h("h1", {}, start.title), this.verdict.status, tools, this.trouble, this.mark.node, this.result),
      h("div", { class: "columns" }, h("aside", { "aria-label": "Numbers" }, this.fields.node, saving), this.panels.node));
    this.buttons();
    this.verdict.show();
  }

  // ---- values: changed by the user, undone and redone, replaced as a whole
  changed(key, value, settled) {
    const same = this.values[key] === value; // a field that loses the focus reports its number again
    this.values = { ...this.values, [key]: value };
    this.last = key;
    if (settled) this.commit();
    if (!same) this.ask(false);
  }
  commit() {
    const now = JSON.stringify(this.values);
    if (now === this.committed) return;
    this.undone.push(this.committed);
    if (this.undone.length > 200) this.undone.shift();
    this.redone = [];
    this.committed = now;
    this.buttons();
  }
  take(values) {
    this.values = values;
    this.commit();
    this.fields.show(values);
    this.ask(true);
  }
  back() { this.move(this.undone, this.redone); }
  forth() { this.move(this.redone, this.undone); }
  move(from, to) {
    if (!from.length) return;
    to.push(this.committed);
    this.committed = from.pop();
    this.values = JSON.parse(this.committed);
    this.fields.show(this.values);
    this.buttons();
    this.ask(true);
  }
  buttons() {
    const focused = document.activeElement;
    this.undo.disabled = !this.undone.length;
    this.redo.disabled = !this.redone.length;
    if (focused === this.undo && this.undo.disabled) this.redo.focus(); // a disabled button would lose the focus
    if (focused === this.redo && this.redo.disabled) this.undo.focus();
  }
  togglePin() {
    this.pinned = this.pinned ? null : { answer: this.answer, band: this.band };
    this.pin.textContent = this.pinned ? "Unpin" : "Pin to compare";
    this.pin.setAttribute("aria-pressed", Boolean(this.pinned));
    if (this.answer) this.paint(this.answer);
    if (!this.band) return;
    this.panels.band(this.band, this.values, this.pinned);
    this.panels.bandIsOf(!this.shown?.band);
  }

  // ---- requests: one at a time; changes that are made meanwhile are requested in their newest state
  ask(resting) {
    this.sequence += 1;
    this.asked = performance.now();
    this.dirty = true;
    this.resting = false;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => { this.resting = true; this.pump(); }, resting ? 0 : REST_MS);
    this.root.dataset.sequence = this.sequence;
    this.stopped = null;
    this.verdict.show();
    this.pump();
    this.overtake();
    this.marked();
  }
  overtake() { // cancels on the server what is computed for older numbers
    clearTimeout(this.overtaking);
    if (!this.busy || this.running.sequence === this.sequence) return;
    const left = this.running.step === "sketch" ? this.running.begun + PATIENCE_MS - performance.now() : 0;
    if (left > 0) this.overtaking = setTimeout(() => this.overtake(), left);
    else this.drop();
  }
  drop() { // the answer fails with the same error and reports it
    this.send({ kind: "newest", client: this.client, sequence: this.sequence }).catch(() => {});
  }
  cancel() { // stops all computation and restores the numbers of what is shown
    clearTimeout(this.timer);
    this.sequence += 1;
    Object.assign(this, { dirty: false, rested: this.sequence, stopped: this.sequence });
    this.root.dataset.sequence = this.sequence;
    this.drop();
    if (this.shown) {
      this.values = JSON.parse(this.shown.values);
      this.commit();
      this.fields.show(this.values);
      this.fields.faults({}, this.last);
    }
    this.verdict.show();
    this.marked();
  }
  marked() {
    const refused = this.answer === null && this.refusedOf === JSON.stringify(this.values);
    this.mark.show({ values: this.values, shown: this.shown, asked: this.asked, refused,
      waits: this.rested !== this.sequence, cancelled: this.stopped === this.sequence });
    this.panels.trainsAreOf(this.trainsOf === JSON.stringify(this.values));
    this.slow.draw();
  }
  step() { // the next request: a sketch of the newest numbers; at rest their cam, if the sketch was coarse, and the band
    if (this.dirty) return "sketch";
    if (!this.resting || this.rested === this.sequence) return null;
    return this.exact === this.sequence ? "band" : "cam";
  }
  async pump() {
    const step = this.busy ? null : this.step();
    if (!step) return;
    this.busy = true;
    const { sequence, asked } = this, of = JSON.stringify(this.values);
    this.running = { step, sequence, begun: performance.now() };
    this.dirty = false;
    try {
      const answer = await this.request(step, sequence);
      if (answer.state === "ok" && (step === "cam" || (step === "sketch" && !answer.coarse && !answer.says))) this.exact = sequence;
      if (answer.state !== "superseded" && (step === "band" || (step === "cam" && answer.state !== "ok"))) this.rested = sequence;
      this.goOn(); // the server works on the next request while the page shows this answer
      if (this.stopped !== null && sequence < this.stopped) answer.state = "superseded"; // cancelled meanwhile
      if (answer.state !== "superseded" && step !== "band") this.received(answer, asked, of);
      else if (answer.state === "ok") this.receivedBand(answer, asked, of);
    } catch (error) {
      this.failed(error);
      this.rested = sequence; // it is requested again once the server answers
      this.goOn();
    }
    this.marked();
    this.slow.ask();
  }
  goOn() {
    this.busy = false;
    this.pump();
  }
  request(part, sequence) {
    return this.send({ kind: "answer", client: this.client, sequence, part, values: this.values }).then((reply) => {
      this.alive();
      return reply;
    });
  }

  // ---- answers
  received(answer, asked, of) {
    this.fields.faults(answer.faults, this.last);
    this.root.dataset.state = answer.state;
    if (answer.state !== "ok") {
      this.answer = null;
      this.refusedOf = of;
      this.contradicted = answer.state === "no cam";
      const says = answer.says ?? Object.values(answer.faults).join("; ");
      this.result.textContent = answer.state === "no cam" ? `No cam: ${says}` : `These numbers make no scene: ${says}`;
      this.root.classList.add("stale");
      this.painted(answer, asked);
      return;
    }
    this.root.classList.remove("stale");
    this.answer = answer;
    this.shown = { values: of, cam: this.exact === answer.sequence, band: false };
    this.paint(answer);
    this.painted(answer, asked);
  }
  paint(answer) {
    const used = this.shown.band ? this.band : null;
    this.panels.bandIsOf(!used);
    this.panels.show(answer, JSON.parse(this.shown.values), this.pinned); // the limits drawn are those of the answer
    if (JSON.parse(this.furtherShape ?? "null") === null || this.furtherShape !== this.slow.shape()) this.further = {};
    this.panels.showAreas(answer, this.further, this.pinned);
    this.panels.compare(answer, used, this.pinned);
    this.fields.worths(answer, used);
    this.result.textContent = this.sentence(answer);
  }
  sentence(answer) {
    const m = answer.motion.metrics, at = shown(answer.motion.speed_rpm, 5);
    const how = answer.coarse ? "≈ " : "";
    const motion = m ? ` At ${at} r/min: bounce ${shown(m.bounce_mm, 3)} mm, jump ${shown(m.jump_mm, 3)} mm, seating ${shown(m.seating_velocity_m_per_s, 3)} m/s.` : ` ${answer.motion.says}`;
    const broken = answer.broken_by_shape.length ? ` Breaks ${answer.broken_by_shape.join(", ")}.` : "";
    const looked = answer.looked_for.length ? ` A cam that holds ${answer.looked_for.join(", ")} too is still being looked for.` : "";
    return `Area ratio ${how}${shown(answer.area_ratio, 5)} by the ${answer.program} program.${motion}${broken}${looked}${answer.says ? ` ${answer.says}` : ""}`;
  }
  receivedBand(band, asked, of) {
    this.band = band;
    if (this.shown?.values === of) this.shown.band = true;
    this.panels.band(band, JSON.parse(of), this.pinned);
    this.panels.bandIsOf(false);
    this.fields.worths(this.answer, band);
    this.panels.compare(this.answer, band, this.pinned);
    this.painted(band, asked);
  }
  receivedSlow(part, found, shape, of) {
    if (part === "why") {
      if (this.contradicted && found.says) this.result.textContent = `No cam: ${found.says}`;
      return;
    }
    if (part.endsWith("trains")) {
      this.trainsOf = of;
      this.panels.showTrains(found, part === "trains");
      this.marked();
      return;
    }
    if (this.furtherShape !== shape) this.further = {};
    this.furtherShape = shape;
    if (part === "bound") this.further.bound = found.area_ratio_bound;
    else this.further.baselines = found.baselines;
    if (this.answer) this.panels.showAreas(this.answer, this.further, this.pinned);
  }
  painted(answer, asked) { // reports the answer after the frame that shows it
    requestAnimationFrame(() => setTimeout(() => {
      const detail = { part: answer.part, sequence: answer.sequence, latency_ms: performance.now() - asked };
      this.root.dataset[answer.part] = answer.sequence;
      if (this.exact === answer.sequence) this.root.dataset.cam = answer.sequence;
      this.root.dispatchEvent(new CustomEvent("camopt-painted", { detail }));
    }));
  }

  // ---- errors
  async told(message) { // the reply, or null where there is none
    try {
      const found = await this.send(message);
      this.alive();
      return found;
    } catch (error) {
      this.failed(error);
      return null;
    }
  }
  failed(error) {
    this.dead = !error.says;
    this.trouble.hidden = false;
    this.trouble.textContent = error.says ?? "The designer's server does not answer any more. Start `camopt design` again with the same --port: this page keeps its numbers and goes on by itself.";
    this.root.dataset.server = this.dead ? "dead" : "refused";
  }
  alive() {
    if (this.root.dataset.server === "alive") return;
    this.root.dataset.server = "alive";
    this.trouble.hidden = true;
    if (this.dead) {
      this.dead = false;
      this.slow.done = {};
      this.ask(true);
    }
  }
  async listen() {
    if (!this.root.isConnected) { clearInterval(this.heart); return; }
    try {
      await this.beat();
      this.alive();
    } catch (error) {
      this.failed(error);
    }
  }
}
