// Sliders with number fields, one for each control, with the worth of its limit and the fault of its value.
class Field {
  constructor(control, changed) {
    Object.assign(this, { control, changed, invalid: "" });
    const id = `camopt-${control.key.replace(/[^\w-]/g, "_")}`;
    this.worth = h("span", { class: "worth" });
    this.fault = h("p", { class: "fault", id: `${id}-fault` });
    const unit = control.unit ? ` [${control.unit}]` : "";
    const name = control.label + unit;
    if (control.choices.length) this.parts(id, name, this.choice(id));
    else if (typeof control.value === "boolean") this.parts(id, name, this.flag(id));
    else this.parts(id, name, ...this.numbers(id, name));
  }
  parts(id, name, ...inputs) {
    const label = h("label", { for: id }, name);
    this.node = h("div", { class: "field", "data-key": this.control.key }, label, ...inputs, this.worth, this.fault);
  }
  choice(id) {
    this.main = h("select", { id }, ...this.control.choices.map((c) => h("option", { value: c }, c)));
    this.main.addEventListener("change", () => this.setValue(this.main.value, true));
    return this.main;
  }
  flag(id) {
    this.main = h("input", { id, type: "checkbox" });
    this.main.addEventListener("change", () => this.setValue(this.main.checked, true));
    return this.main;
  }
  numbers(id, name) {
    const { low, high, step, optional, usual } = this.control;
    this.slider = h("input", { type: "range", min: low, max: high, step, "aria-label": `${name}, slider` });
    this.main = h("input", { id, type: "number", step: "any", "aria-describedby": `${id}-fault` });
    this.slider.addEventListener("input", () => this.setValue(Number(this.slider.value), false));
    this.slider.addEventListener("change", () => this.setValue(Number(this.slider.value), true));
    this.main.addEventListener("input", () => this.typed(false));
    this.main.addEventListener("change", () => this.typed(true));
    if (!optional) return [this.slider, this.main];
    this.switch = h("input", { type: "checkbox", "aria-label": `${this.control.label}: on` });
    this.switch.addEventListener("change", () => this.setValue(this.switch.checked ? this.last ?? usual : null, true));
    return [h("span", { class: "switched" }, this.switch, this.slider), this.main];
  }
  typed(settled) {
    const text = this.main.value.trim();
    if (text === "" || !Number.isFinite(Number(text))) {
      this.invalid = "expected a number"; // stays shown, whatever the answer to the last valid number is
      this.showFault(this.invalid);
      return;
    }
    this.setValue(Number(text), settled);
  }
  setValue(value, settled) {
    this.invalid = "";
    this.showFault("");
    this.show(value, document.activeElement);
    this.changed(this.control.key, value, settled);
  }
  show(value, keep = null) { // `keep`: the field that the user is editing stays unchanged
    if (this.control.choices.length) this.main.value = value;
    else if (typeof this.control.value === "boolean") this.main.checked = value;
    else this.showNumber(value, keep);
  }
  showNumber(value, keep) {
    if (value !== null) this.last = value;
    if (this.switch) this.switch.checked = value !== null;
    this.slider.disabled = this.main.disabled = value === null;
    if (value === null) {
      this.main.value = "";
      return;
    }
    this.slider.min = Math.min(this.control.low, value); // a typed number may lie beyond the slider's range
    this.slider.max = Math.max(this.control.high, value);
    if (keep !== this.slider) this.slider.value = value;
    if (keep !== this.main) this.main.value = Number(value.toPrecision(12));
  }
  showFault(sentence) {
    this.fault.textContent = sentence;
    if (sentence) this.main.setAttribute("aria-invalid", "true");
    else this.main.removeAttribute("aria-invalid");
  }
}

class Fields {
  constructor(controls, changed) {
    this.byKey = Object.fromEntries(controls.map((c) => [c.key, new Field(c, changed)]));
    const groups = new Map();
    for (const c of controls) groups.set(c.group, [...(groups.get(c.group) ?? []), c]);
    this.node = h("form", { class: "fields", "aria-label": "Numbers of the scene", autocomplete: "off" });
    this.node.addEventListener("submit", (event) => event.preventDefault());
    for (const [name, members] of groups) {
      const narrow = matchMedia("(max-width: 52rem)").matches;
      const open = narrow ? name === "Cam" : name !== "Tolerances" && name !== "Ramps";
      this.node.append(h("details", { open }, h("summary", {}, name), ...members.map((c) => this.byKey[c.key].node)));
    }
  }
  show(values) {
    for (const [key, field] of Object.entries(this.byKey)) field.show(values[key]);
  }
  faults(byKey, lastKey) { // a sentence that belongs to no single field is shown beside the field that was changed last
    for (const [key, field] of Object.entries(this.byKey)) field.showFault(field.invalid || (byKey?.[key] ?? ""));
    const general = byKey?.[""];
    if (general && lastKey) this.byKey[lastKey].showFault(general);
    for (const key of Object.keys(byKey ?? {})) this.byKey[key || lastKey]?.node.closest("details").setAttribute("open", "");
  }
  worths(answer, band) { // shows the worth of each limit and its used share
    for (const [key, field] of Object.entries(this.byKey)) {
      const worth = answer.worth[key], used = band?.worst[key] ?? null, here = answer.motion.used?.[key];
      let words = "";
      if (worth !== undefined) words = Math.abs(worth) > 1e-6 ? `▲ active: 1 % more gives ${shown(worth, 2)} % more area` : "not active";
      if (here !== undefined) words += `${words && "; "}${Math.round(100 * here)} % used here`;
      if (used) words += `, ${Math.round(100 * used.used)} % at ${shown(used.speed_rpm, 5)} r/min`;
      if (key === "margin_N" && answer.margin_price) words = `1 N less gives ${shown(-100 * answer.margin_price / answer.area_ratio, 2)} % more area`;
      const most = Math.max(here ?? 0, used?.used ?? 0);
      if (most > 1) words = `✗ broken: ${words}`;
      if (field.worth.textContent !== words) field.worth.textContent = words; // avoids a layout of the page
      field.node.classList.toggle("broken", most > 1);
      field.node.classList.toggle("active", Math.abs(worth ?? 0) > 1e-6);
    }
  }
}
