// The designer: holds the numbers, requests answers (the newest request wins), shows them, and reports errors.
const REST_MS = 150; // the numbers are at rest when they have not changed for this time
const PATIENCE_MS = 500; // a change cancels a first answer that has taken longer than this, and later answers at once
const BEAT_MS = 4000;
const SHAPE_GROUPS = ["Cam", "Ramps", "Limits on the cam"];

class Designer {
  constructor(root, send, beat) {
    Object.assign(this, { root, send, beat, sequence: 0, busy: false, references: {},
      undone: [], redone: [], pinned: null, band: null, answer: null, shown: null, changedAt: performance.now(), client: String(Math.random()).slice(2) });
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
    this.verdict = new Verdict(this.root, (message) => this.trySend(message), values, start.files);
    this.result = h("p", { class: "result", "aria-live": "polite" });
    this.mark = new Mark(this.root, this.controls, () => this.cancel());
    this.trouble = h("p", { class: "trouble", role: "alert", hidden: true });
    const tools = h("div", { class: "tools" },
      button("undo", "Undo", () => this.back()), button("redo", "Redo", () => this.forth()),
      button("reset", "Reset", () => this.setValues({ ...this.initial })), button("pin", "Pin to compare", () => this.togglePin()), ...this.verdict.tools);
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
  setValues(values) {
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
    this.panels.markBand(!this.shown?.band);
  }

  // ---- requests: one at a time; changes that are made meanwhile are requested in their newest state
  ask(resting) {
    this.sequence += 1;
    this.changedAt = performance.now();
    this.dirty = true;
    this.resting = false;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => { this.resting = true; this.sendNext(); }, resting ? 0 : REST_MS);
    this.root.dataset.sequence = this.sequence;
    this.cancelled = null;
    this.verdict.show();
    this.sendNext();
    this.cancelOutdated();
    this.showMark();
  }
  cancelOutdated() { // cancels on the server what is computed for older numbers
    clearTimeout(this.cancelTimer);
    if (!this.busy || this.running.sequence === this.sequence) return;
    const left = this.running.step === "sketch" ? this.running.begun + PATIENCE_MS - performance.now() : 0;
    if (left > 0) this.cancelTimer = setTimeout(() => this.cancelOutdated(), left);
    else this.sendNewest();
  }
  sendNewest() { // the answer fails with the same error and reports it
    this.send({ kind: "newest", client: this.client, sequence: this.sequence }).catch(() => {});
  }
  cancel() { // stops all computation and restores the numbers of what is shown
    clearTimeout(this.timer);
    this.sequence += 1;
    Object.assign(this, { dirty: false, completed: this.sequence, cancelled: this.sequence });
    this.root.dataset.sequence = this.sequence;
    this.sendNewest();
    if (this.shown) {
      this.values = JSON.parse(this.shown.values);
      this.commit();
      this.fields.show(this.values);
      this.fields.faults({}, this.last);
    }
    this.verdict.show();
    this.showMark();
  }
  showMark() {
    const refused = this.answer === null && this.refusedNumbers === JSON.stringify(this.values);
    this.mark.show({ values: this.values, shown: this.shown, changedAt: this.changedAt, refused,
      pending: this.completed !== this.sequence, cancelled: this.cancelled === this.sequence });
    this.panels.markTrains(this.trainsNumbers === JSON.stringify(this.values));
    this.slow.draw();
  }
  nextStep() { // the next request: a sketch of the newest numbers; at rest their cam, if the sketch was coarse, and the band
    if (this.dirty) return "sketch";
    if (!this.resting || this.completed === this.sequence) return null;
    return this.exactCam === this.sequence ? "band" : "cam";
  }
  async sendNext() {
    const step = this.busy ? null : this.nextStep();
    if (!step) return;
    this.busy = true;
    const { sequence, changedAt } = this, numbers = JSON.stringify(this.values);
    this.running = { step, sequence, begun: performance.now() };
    this.dirty = false;
    try {
      const answer = await this.request(step, sequence);
      if (answer.state === "ok" && (step === "cam" || (step === "sketch" && !answer.coarse && !answer.says))) this.exactCam = sequence;
      if (answer.state !== "superseded" && (step === "band" || (step === "cam" && answer.state !== "ok"))) this.completed = sequence;
      this.proceed(); // the server works on the next request while the page shows this answer
      if (this.cancelled !== null && sequence < this.cancelled) answer.state = "superseded"; // cancelled meanwhile
      if (answer.state !== "superseded" && step !== "band") this.received(answer, changedAt, numbers);
      else if (answer.state === "ok") this.receivedBand(answer, changedAt, numbers);
    } catch (error) {
      this.failed(error);
      this.completed = sequence; // it is requested again once the server answers
      this.proceed();
    }
    this.showMark();
    this.slow.requestNext();
  }
  proceed() {
    this.busy = false;
    this.sendNext();
  }
  request(part, sequence) {
    return this.send({ kind: "answer", client: this.client, sequence, part, values: this.values }).then((reply) => {
      this.alive();
      return reply;
    });
  }

  // ---- answers
  received(answer, changedAt, numbers) {
    this.fields.faults(answer.faults, this.last);
    this.root.dataset.state = answer.state;
    if (answer.state !== "ok") {
      this.answer = null;
      this.refusedNumbers = numbers;
      this.contradicted = answer.state === "no cam";
      const says = answer.says ?? Object.values(answer.faults).join("; ");
      this.result.textContent = answer.state === "no cam" ? `No cam: ${says}` : `These numbers are not a valid scene: ${says}`;
      this.root.classList.add("stale");
      this.reportPainted(answer, changedAt);
      return;
    }
    this.root.classList.remove("stale");
    this.answer = answer;
    this.shown = { values: numbers, cam: this.exactCam === answer.sequence, band: false };
    this.paint(answer);
    this.reportPainted(answer, changedAt);
  }
  paint(answer) {
    const used = this.shown.band ? this.band : null;
    this.panels.markBand(!used);
    this.panels.show(answer, JSON.parse(this.shown.values), this.pinned); // the limits drawn are those of the answer
    if (this.referencesShape !== this.slow.shape()) this.references = {};
    this.panels.showAreas(answer, this.references, this.pinned);
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
  receivedBand(band, changedAt, numbers) {
    this.band = band;
    if (this.shown?.values === numbers) this.shown.band = true;
    this.panels.band(band, JSON.parse(numbers), this.pinned);
    this.panels.markBand(false);
    this.fields.worths(this.answer, band);
    this.panels.compare(this.answer, band, this.pinned);
    this.reportPainted(band, changedAt);
  }
  receivedSlow(part, reply, shape, numbers) {
    if (part === "why") {
      if (this.contradicted && reply.says) this.result.textContent = `No cam: ${reply.says}`;
      return;
    }
    if (part.endsWith("trains")) {
      this.trainsNumbers = numbers;
      this.panels.showTrains(reply, part === "trains");
      this.showMark();
      return;
    }
    if (this.referencesShape !== shape) this.references = {};
    this.referencesShape = shape;
    if (part === "bound") this.references.bound = reply.area_ratio_bound;
    else this.references.baselines = reply.baselines;
    if (this.answer) this.panels.showAreas(this.answer, this.references, this.pinned);
  }
  reportPainted(answer, changedAt) { // reports the answer after the frame that shows it
    requestAnimationFrame(() => setTimeout(() => {
      const detail = { part: answer.part, sequence: answer.sequence, latency_ms: performance.now() - changedAt };
      this.root.dataset[answer.part] = answer.sequence;
      if (this.exactCam === answer.sequence) this.root.dataset.cam = answer.sequence;
      this.root.dispatchEvent(new CustomEvent("camopt-painted", { detail }));
    }));
  }

  // ---- errors
  async trySend(message) { // the reply, or null where there is none
    try {
      const reply = await this.send(message);
      this.alive();
      return reply;
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
