"use strict";
// The controls of the page: they change `page.state`, and have it drawn. Starts the page.

Object.assign(page, {
  filters() {
    for (const [name, modality] of Object.entries(this.data.modalities)) if (modality.kind === "palette" || modality.kind === "value") draw.filter(name, modality, this.state.far);
  },

  /** Sets all controls to the state. */
  controls() {
    const { state, data, variant } = this;
    this.filters();
    find("variant").value = state.variant;
    find("compare").value = state.compare;
    find("sensor").replaceChildren(...variant.views.map((n, k) => make("option", { value: k }, data.views[n].sensor)));
    find("sensor").value = state.sensor;
    const { view } = this.sensorOf(variant), base = this.base(view);
    const layers = view.capture.map((name, n) => {
      const there = data.modalities[name].kind !== "file";
      const button = make("button", { type: "button", "aria-pressed": String(name === base), disabled: !there, title: there ? `key ${n + 1}` : `stored as .${data.modalities[name].ending}, which browsers do not show` }, name);
      button.dataset.layer = name;
      button.addEventListener("click", () => this.set({ base: name }));
      return button;
    });
    const mix = make("input", { type: "range", min: 0, max: 1, step: 0.05, value: state.mix, id: "mix" });
    mix.addEventListener("input", () => { state.mix = Number(mix.value); this.refresh(); });
    const photo = !data.modalities[base] || data.modalities[base].kind === "picture";
    find("layers").replaceChildren(...layers, make("label", { hidden: photo }, "opacity ", mix));
    find("toggles").replaceChildren(...this.TOGGLES.map(([key, text, letter]) => {
      const button = make("button", { type: "button", "aria-pressed": String(this.on[key]), title: `key ${letter}` }, text);
      button.dataset.toggle = key;
      button.hidden = key === "patches" ? !variant.patches : key === "keypoints" && !this.joints;
      button.addEventListener("click", () => this.toggle(key));
      return button;
    }));
    this.classes();
  },

  classes() {
    const changed = () => { this.classes(); charts.histograms((...place) => this.showExample(...place)); this.refresh(); };
    charts.classes(find("classes"), changed);
    charts.classes(find("chosen"), changed);
  },

  /** Changes the state, and draws everything that follows from it. */
  set(values) {
    Object.assign(this.state, values);
    const { view } = this.sensorOf(this.variant);
    this.state.sensor = Math.min(this.state.sensor, this.variant.views.length - 1);
    this.state.frame = Math.max(0, Math.min(this.state.frame, (view.frames - 1) * view.interval));
    this.controls();
    return this.refresh();
  },

  move(frames) {
    const { view } = this.sensorOf(this.variant), place = Math.max(0, Math.min(view.frames - 1, this.placeIn(view) + frames));
    this.state.frame = place * view.interval;
    return this.refresh();
  },

  toggle(key) {
    this.on[key] = !this.on[key];
    this.controls();
    this.refresh();
  },

  select(instance) {
    this.state.selected = instance === this.state.selected ? 0 : instance || 0;
    this.refresh();
  },

  /** Shows another variant, or compares it; the sensor stays the same if the variant has it. */
  choose(number, compare) {
    if (compare) this.state.compare = number;
    else this.setVariant(number);
    this.openTab("frames");
    this.set({});
  },

  setVariant(number) {
    const { place } = this.sensorOf(this.data.variants[number]);
    Object.assign(this.state, { variant: number, sensor: place });
  },

  showExample(view, frame, instance) {
    const number = this.variant.views.includes(view) ? this.state.variant : this.data.variants.findIndex((v) => v.views.includes(view));
    Object.assign(this.state, { variant: number, frame, selected: instance });
    this.state.sensor = this.variant.views.indexOf(view);
    this.openTab("frames");
    this.set({});
  },

  async listEvents() {
    const rows = await recipe.load(`events-${this.variant.events}`), { actors } = await recipe.load(`scene-${this.variant.scene}`);
    charts.events(rows, (frame, subject, sensor) => {
      const place = this.variant.views.findIndex((n) => this.data.views[n].sensor === sensor), actor = actors.find(([name]) => name === subject);
      this.openTab("frames");
      this.set({ frame, selected: actor ? actor[1] : 0, ...(place >= 0 ? { sensor: place } : {}) });
    });
  },

  openTab(name) {
    this.state.tab = name;
    for (const section of document.querySelectorAll("main > section")) section.hidden = section.id !== name;
    for (const tab of find("tabs").children) tab.setAttribute("aria-selected", String(tab.dataset.tab === name));
    if (name === "statistics") charts.histograms((...place) => this.showExample(...place));
  },

  async play() {
    this.playing = !this.playing;
    find("play").textContent = this.playing ? "Pause" : "Play";
    while (this.playing) {
      const { view } = this.sensorOf(this.variant), wait = (1000 * view.interval) / this.data.scenes[this.variant.scene].fps, start = performance.now();
      const end = this.placeIn(view) === view.frames - 1;
      await this.move(end ? -view.frames : 1);
      await find("pane-a").querySelector(".over").decode().catch(() => {});
      await new Promise((done) => setTimeout(done, Math.max(0, wait - (performance.now() - start))));
    }
  },

  notice(text) {
    find("notice").textContent = text;
    find("notice").hidden = false;
  },

  readHash() {
    const given = new URLSearchParams(location.hash.slice(1)), { state, data } = this;
    const number = (key, most) => Math.max(0, Math.min(most, Math.floor(Number(given.get(key))) || 0));
    state.variant = number("variant", data.variants.length - 1);
    state.sensor = number("sensor", this.variant.views.length - 1);
    state.frame = number("frame", data.scenes[this.variant.scene].frames - 1);
    state.selected = number("object", 1e6);
    state.compare = given.has("compare") ? number("compare", data.variants.length - 1) : -1;
    if (Object.hasOwn(data.modalities, given.get("show") || "")) state.base = given.get("show");
    if ([...find("tabs").children].some((tab) => tab.dataset.tab === given.get("tab"))) state.tab = given.get("tab");
  },

  writeHash() {
    const { state } = this, parts = { tab: state.tab, variant: state.variant, sensor: state.sensor, frame: state.frame };
    if (state.selected) parts.object = state.selected;
    if (state.compare >= 0) parts.compare = state.compare;
    if (state.base) parts.show = state.base;
    history.replaceState(null, "", `#${new URLSearchParams(parts)}`);
  },

  objectAt(event) {
    const { view } = this.sensorOf(this.variant), box = find("stage").getBoundingClientRect(), frame = this.shownFrame;
    const { zoom } = this, inside = (at, from, length) => (at - from) / length / zoom.by;
    const x = Math.floor((zoom.x + inside(event.clientX, box.left, box.width)) * view.width);
    const y = Math.floor((zoom.y + inside(event.clientY, box.top, box.height)) * view.height);
    return frame && frame.objects[frame.owners[y * view.width + x] - 1];
  },

  listen() {
    const on = (id, event, act) => find(id).addEventListener(event, act);
    on("variant", "change", (e) => { this.setVariant(Number(e.target.value)); this.set({}); });
    on("sensor", "change", (e) => this.set({ sensor: Number(e.target.value) }));
    on("compare", "change", (e) => this.set({ compare: Number(e.target.value) }));
    on("split", "input", (e) => { this.state.split = Number(e.target.value); this.splitAt(); });
    on("frame", "input", (e) => { this.state.frame = Number(e.target.value); this.refresh(); });
    on("first", "click", () => this.move(-1e9));
    on("back", "click", () => this.move(-1));
    on("forth", "click", () => this.move(1));
    on("play", "click", () => this.play());
    for (const id of ["filter", "least"]) on(id, "input", () => this.refresh());
    on("event-filter", "input", () => this.listEvents());
    on("rows", "change", () => this.refresh());
    on("fit", "click", () => { if (map.drawn) { map.fit(map.drawn.scene.box); map.draw(); } });
    on("near", "click", () => {
      const camera = (this.cameras || []).find((c) => c.current);
      if (camera) { map.view = { x: camera.pose[0], y: camera.pose[1], across: 50 }; map.draw(); }
    });
    on("copy", "click", () => navigator.clipboard?.writeText(this.data.identity).then(() => { find("copy").textContent = "Copied"; }, () => {}));
    on("strip", "click", (e) => { const { view } = this.sensorOf(this.variant); this.state.frame = Math.floor((e.offsetX / e.target.clientWidth) * view.frames) * view.interval; this.refresh(); });
    this.listenToStage(on);
    on("stage", "pointermove", (e) => { const object = this.objectAt(e); find("stage").title = object ? `${this.title(object)} · ${object.actor}` : ""; });
    for (const tab of find("tabs").children) tab.addEventListener("click", () => { this.openTab(tab.dataset.tab); this.refresh(); });
    map.listen((instance) => this.select(instance));
    window.addEventListener("resize", () => this.refresh());
    document.addEventListener("keydown", (event) => this.key(event));
    find("pane-a").querySelector(".over").addEventListener("error", (e) => { if (e.target.getAttribute("src")) this.notice("A picture cannot be read. Was the dataset copied as a whole?"); });
  },

  /** A click selects, a double click enlarges, a drag moves what is enlarged. */
  listenToStage(on) {
    let from = null, moved = false;
    const share = (e) => { const box = find("stage").getBoundingClientRect(); return [(e.clientX - box.left) / box.width, (e.clientY - box.top) / box.height]; };
    on("stage", "click", (e) => { if (!moved && e.detail < 2) this.select(this.objectAt(e)?.instance); });
    on("stage", "dblclick", (e) => this.zoomBy(e.shiftKey ? 0.5 : 2, ...share(e)));
    on("stage", "pointerdown", (e) => { from = share(e); moved = false; });
    on("stage", "pointermove", (e) => {
      if (!from || this.zoom.by === 1 || !(e.buttons & 1)) return;
      const to = share(e);
      if (!moved && Math.hypot(to[0] - from[0], to[1] - from[1]) < 0.01) return;
      moved = true;
      this.pan(to[0] - from[0], to[1] - from[1]);
      from = to;
    });
    on("stage", "pointerup", () => { from = null; });
  },

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input, select")) {
      if (event.key === "Escape") event.target.blur();
      if (event.target.type !== "range" || event.ctrlKey || event.metaKey || event.altKey || event.key.startsWith("Arrow") || event.key === "Home" || event.key === "End") return;
    }
    const { variants } = this.data, turn = (n) => { this.setVariant((this.state.variant + n + variants.length) % variants.length); this.set({}); };
    const toggle = this.TOGGLES.find(([, , letter]) => letter === event.key), layer = find("layers").querySelectorAll("button")[Number(event.key) - 1];
    const keys = {
      ArrowLeft: () => this.move(event.shiftKey ? -10 : -1),
      ArrowRight: () => this.move(event.shiftKey ? 10 : 1),
      Home: () => this.move(-1e9),
      End: () => this.move(1e9),
      " ": () => this.play(),
      "[": () => turn(-1),
      "]": () => turn(1),
      c: () => this.set({ compare: this.state.compare < 0 ? (this.state.variant + 1) % variants.length : -1 }),
      "+": () => this.zoomBy(2),
      "-": () => this.zoomBy(0.5),
      "/": () => find(this.state.tab === "events" ? "event-filter" : "filter").focus(),
      Escape: () => this.select(0),
    };
    if (event.key === " " && event.target.closest("button")) return;
    const act = Object.hasOwn(keys, event.key) ? keys[event.key] : toggle ? () => this.toggle(toggle[0]) : layer && !layer.disabled ? () => layer.click() : null;
    if (!act) return;
    event.preventDefault();
    act();
  },
});

page.start().catch((error) => page.notice(`The page cannot be shown: ${error.message}. Was the dataset copied as a whole?`));
