// Parts that take seconds, computed by another process: the bound, the literature's cams, trains as built, why there is no cam.
const SLOW = {
  why: "The cause is being determined", bound: "The bound is being computed", baselines: "The literature's cams are being computed",
  "few trains": "Trains are being drawn", trains: "Trains are being drawn",
};

class SlowParts {
  constructor(page) { // page: the Designer, for whose numbers the parts are computed
    Object.assign(this, { page, done: {}, running: null, cancelled: null });
    this.words = h("p", { class: "note" });
    this.progress = h("progress", { "aria-label": "slow part" });
    this.cancel = h("button", { type: "button", on: { click: () => this.stop() } }, "Cancel this part");
    this.node = h("div", { class: "marked", hidden: true }, this.words, this.progress, this.cancel);
  }
  shape() { // the numbers on which the bound and the baselines depend
    const { controls, values } = this.page, keys = controls.filter((c) => SHAPE_GROUPS.includes(c.group)).map((c) => c.key);
    return JSON.stringify(keys.filter((k) => k !== "program" && k !== "margin_N").map((k) => values[k]));
  }
  nextPart() { // the part to request next
    const { page, done } = this, { sequence } = page, rests = page.completed === sequence;
    if (page.cancelled === sequence || this.cancelled === sequence) return null;
    if (!page.answer) return page.contradicted && rests && done.why !== sequence ? "why" : null;
    const needed = { "few trains": sequence, bound: this.shape(), baselines: this.shape(), trains: sequence };
    const parts = page.resting && rests ? Object.keys(needed) : page.dirty || page.busy ? [] : ["few trains"];
    return parts.find((part) => done[part] !== needed[part] && !(part === "few trains" && done.trains === sequence));
  }
  async requestNext() {
    const part = this.nextPart();
    if (this.running || !part) return;
    const { page } = this, { sequence } = page, shape = this.shape(), numbers = JSON.stringify(page.values);
    this.running = part;
    this.begun = performance.now();
    this.ticking = setInterval(() => this.draw(), TICK_MS);
    try {
      const reply = await page.request(part, sequence);
      this.done[part] = part === "bound" || part === "baselines" ? shape : sequence;
      if (reply.state === "ok" && (!["trains", "why"].includes(part) || sequence === page.sequence)) page.receivedSlow(part, reply, shape, numbers);
    } catch (error) {
      this.done[part] = sequence;
      page.failed(error);
    }
    clearInterval(this.ticking);
    this.running = null;
    this.draw();
    this.requestNext();
  }
  stop() { // stops the part; no further part is requested for these numbers
    this.cancelled = this.page.sequence;
    this.page.trySend({ kind: "stop" });
  }
  draw() {
    if (!this.page.root.isConnected) clearInterval(this.ticking);
    const waited = performance.now() - this.begun, long = this.running && waited > WAIT_MS, cancelled = this.cancelled === this.page.sequence;
    this.node.hidden = !long && !cancelled;
    this.progress.hidden = this.cancel.hidden = !long;
    this.words.textContent = long ? `${SLOW[this.running]} (${Math.floor(waited / 1000)} s).` : cancelled ? "Cancelled: the next change is answered again." : "";
  }
}
