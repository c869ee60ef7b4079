// Saving of the scene or a run folder under a name, in the folder in which the designer was started.
class Saving {
  constructor(name, send, values, done) { // done: called without an argument, or with the error where the server does not answer
    Object.assign(this, { send, values, done });
    this.name = h("input", { id: "camopt-name", type: "text", value: `${name}-edited`, maxlength: 64 });
    this.saved = h("p", { class: "saved", "aria-live": "polite" });
    const button = (words, what) => h("button", { type: "button", on: { click: () => this.save(what) } }, words);
    this.node = h("section", { class: "saving", "aria-label": "Save" }, h("h2", {}, "Save"), h("label", { for: "camopt-name" }, "Name"), this.name,
      h("div", { class: "tools" }, button("Save scene", "scene"), button("Save run folder", "run")), this.saved);
  }
  async save(what) {
    try {
      const reply = await this.send({ kind: "save", what, name: this.name.value, values: this.values() });
      const next = what === "run" ? `camopt report ${reply.saved}` : `camopt optimize ${reply.saved}`;
      this.saved.textContent = `Saved as ${reply.saved} in the folder that the designer was started in. Next: ${next}`;
      this.done();
    } catch (error) {
      if (error.says) this.saved.textContent = error.says;
      else this.done(error);
    }
  }
}
