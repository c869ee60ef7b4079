// The verdict on request: its buttons, its progress, and the sentence on the state of the cam.
const POLL_MS = 400;

class Verdict {
  constructor(root, send, values, verifies) { // send: sends a message and returns the reply or null; values: returns the page's numbers
    Object.assign(this, { root, send, values, state: { state: "none" }, verified: null, tools: [] });
    this.status = h("p", { class: "status" });
    if (!verifies) return;
    const button = (words, act) => h("button", { type: "button", on: { click: act } }, words);
    this.verify = button("Verify", () => this.begin());
    this.cancel = button("Cancel", () => this.follow({ kind: "cancel" }));
    this.progress = h("progress", { max: 1, value: 0, "aria-label": "verdict" });
    this.tools = [this.verify, this.cancel, this.progress];
  }
  subject() { return JSON.stringify({ ...this.values(), speed_rpm: null }); }
  async begin() {
    this.verified = this.subject();
    await this.follow({ kind: "verify", values: this.values() });
  }
  async follow(message) { // sends the message and polls until the verdict has ended
    const state = await this.send(message);
    if (!state) return;
    this.state = state;
    this.show();
    if (state.state === "running") setTimeout(() => this.follow({ kind: "verification" }), POLL_MS);
  }
  sentence(current) { // current: whether the verdict is that of the page's numbers
    const v = this.state, doubt = "event-exact only, not confirmed";
    if (v.state === "done" && current) return v.verdict === "confirmed" ? "✓ confirmed by independent methods" : `✗ ${v.verdict}. ${v.reason}`;
    const stage = v.verdict ? ` So far: ${v.verdict}.` : "";
    const further = {
      running: `; verdict running, stage ${v.stage ?? 1} of ${v.stages}: ${v.says ?? ""}, ${Math.round(v.seconds ?? 0)} s.${stage}`,
      failed: `; the verdict failed: ${v.says}`,
      cancelled: "; the verdict was cancelled",
      done: "; the last verdict was of other numbers",
    };
    return doubt + (further[v.state] ?? "");
  }
  show() {
    const v = this.state, current = this.verified === this.subject(), ended = v.state === "done" && current;
    this.status.textContent = this.sentence(current);
    this.status.setAttribute("aria-live", v.state === "running" ? "off" : "polite"); // the seconds are not read aloud
    this.status.className = `status ${!ended ? "doubt" : v.verdict === "confirmed" ? "good" : "bad"}`;
    this.root.dataset.verdict = ended ? v.verdict : v.state;
    if (!this.progress) return;
    const running = v.state === "running", focused = document.activeElement;
    this.cancel.hidden = this.progress.hidden = !running;
    this.verify.hidden = running;
    if (running) this.progress.value = ((v.stage ?? 1) - 0.5) / v.stages;
    if (focused === this.verify && running) this.cancel.focus(); // a hidden button would lose the focus
    if (focused === this.cancel && !running) this.verify.focus();
  }
}
