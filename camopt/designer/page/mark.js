// The mark beside what is shown: to which numbers it belongs, whether it is complete, and how long the newest answer takes.
const WAIT_MS = 1000; // a longer wait shows a progress bar and can be cancelled
const TICK_MS = 250;
const STEPS = { none: 0, before: 0, first: 1, cam: 2 }; // completed of three steps: first answer, cam at rest, band

class Mark {
  constructor(root, controls, cancel) {
    Object.assign(this, { root, controls });
    this.words = h("p", { class: "mark" });
    this.progress = h("progress", { max: 3, value: 0, "aria-label": "answer", hidden: true });
    this.cancel = h("button", { type: "button", hidden: true, on: { click: cancel } }, "Cancel the answer");
    this.node = h("div", { class: "marked" }, this.words, this.progress, this.cancel);
  }
  // values: the page's numbers; shown: the numbers of what is painted and whether its cam and band are there, or null;
  // refused: the newest numbers have no cam; changedAt: time of the newest numbers [ms]; pending: whether more is to come;
  // cancelled: whether the rest was cancelled
  show(state) {
    clearInterval(this.ticking);
    this.state = state;
    this.draw();
    if (state.pending) this.ticking = setInterval(() => (this.root.isConnected ? this.draw() : clearInterval(this.ticking)), TICK_MS);
  }
  draw() {
    const { pending, cancelled, changedAt } = this.state, kind = this.kind(), waited = performance.now() - changedAt, long = pending && waited > WAIT_MS;
    const since = long ? ` (${Math.floor(waited / 1000)} s)` : "";
    const text = this.sentence(kind) + (pending ? `${this.next(kind)}${since}.` : cancelled && kind !== "settled" ? ". The rest was cancelled: the next change is answered again." : ".");
    if (this.words.textContent !== text) this.words.textContent = text;
    this.words.setAttribute("aria-live", pending ? "off" : "polite"); // a screen reader reads only the final state
    this.root.dataset.mark = kind;
    const focused = document.activeElement === this.cancel;
    this.progress.hidden = this.cancel.hidden = !long;
    this.progress.value = STEPS[kind] ?? 3;
    if (focused && !long) this.root.querySelector("button:not(:disabled)")?.focus(); // a hidden button would lose the focus
  }
  kind() {
    const { shown, values, refused } = this.state;
    if (!shown) return "none";
    if (refused || shown.values !== JSON.stringify(values)) return "before";
    return !shown.cam ? "first" : !shown.band ? "cam" : "settled";
  }
  sentence(kind) {
    if (kind === "none") return "Nothing is shown yet";
    if (kind === "before") return `Result for the previous numbers${this.difference()}`;
    if (kind === "first") return "First result for these numbers: a rough cam, and a motion that may not have settled";
    if (kind === "cam") return "Result for these numbers: the cam, and its motion at the speed shown";
    return "Settled: cam, motion and band of these numbers";
  }
  next(kind) {
    if (kind === "first") return "; the cam is being computed";
    if (kind === "cam") return "; bounce and jump over the band are being computed";
    return kind === "none" ? "; the first cam is being computed" : "; the new ones are being computed";
  }
  difference() { // the numbers in which what is shown differs from the page
    const then = JSON.parse(this.state.shown.values), now = this.state.values;
    const inWords = (v) => (v === null ? "off" : typeof v === "number" ? shown(v, 5) : v === true ? "on" : v === false ? "off" : v);
    const differ = this.controls.filter((c) => then[c.key] !== now[c.key]);
    const listed = differ.slice(0, 2).map((c) => `${c.label} ${inWords(then[c.key])}, not ${inWords(now[c.key])}`);
    const more = differ.length > 2 ? ` and ${differ.length - 2} more` : "";
    return listed.length ? ` (${listed.join("; ")}${more})` : "";
  }
}
