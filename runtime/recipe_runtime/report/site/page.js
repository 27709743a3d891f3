"use strict";
// The state of the page, and what is drawn of it. Everything follows from `page.state` and the loaded data.

const page = {
  data: null,
  state: { variant: 0, sensor: 0, frame: 0, compare: -1, base: "", mix: 1, far: 50, split: 50, selected: 0, tab: "frames" },
  zoom: { by: 1, x: 0, y: 0 }, // factor; left and top of what is shown, as shares of the picture
  on: { boxes: true, masks: false, ids: true, solids: false, amodal: false, patches: true, keypoints: true },
  shownFrame: null, // labels of the current frame in pane A
  turn: 0, // counts drawings, so that a late one is dropped

  TOGGLES: [["boxes", "Boxes", "b"], ["masks", "Masks", "m"], ["ids", "Ids", "i"], ["solids", "3-D boxes", "d"], ["amodal", "Amodal boxes", "a"], ["patches", "Patches", "p"], ["keypoints", "Joints", "j"]],

  async start() {
    this.data = await recipe.load("index");
    const { data } = this;
    document.title = data.recipe;
    find("name").textContent = data.recipe;
    find("description").textContent = data.description;
    find("identity").textContent = data.identity;
    find("variant").replaceChildren(...data.variants.map((v, n) => make("option", { value: n }, v.name)));
    find("compare").replaceChildren(make("option", { value: -1 }, "nothing"), ...data.variants.map((v, n) => make("option", { value: n }, v.name)));
    charts.listAxes();
    charts.about();
    this.readHash();
    this.listen();
    this.controls();
    this.openTab(this.state.tab);
    await this.refresh();
  },

  // What is shown

  get variant() { return this.data.variants[this.state.variant]; },

  /** Returns the view of the current sensor in a variant, and its number; the first one if the variant lacks it. */
  sensorOf(variant) {
    const wanted = this.data.views[this.variant.views[this.state.sensor]]?.sensor;
    const number = variant.views.find((n) => this.data.views[n].sensor === wanted) ?? variant.views[0];
    return { number, view: this.data.views[number], place: variant.views.indexOf(number) };
  },

  /** Returns the place among the frames that a sensor takes of the current frame of the clip. */
  placeIn(view) { return Math.min(Math.round(this.state.frame / view.interval), view.frames - 1); },

  /** Returns the modality to show: the chosen one if the sensor has it; `picture`: one with a file. */
  base(view, picture = false) {
    const { modalities } = this.data;
    const fits = (name) => view.capture.includes(name) && modalities[name].kind !== "file" && !(picture && modalities[name].kind === "masks");
    return fits(this.state.base) ? this.state.base : view.capture.find(fits) || "";
  },

  /** Shows the file of a modality in an image, coloured; hides the image if there is none. */
  paint(image, variant, view, name) {
    const modality = this.data.modalities[name];
    if (!modality || modality.kind === "masks" || modality.kind === "file") {
      image.hidden = true;
      image.removeAttribute("src");
      return;
    }
    image.hidden = false;
    const file = `${String(this.placeIn(view) * view.interval).padStart(6, "0")}.${modality.ending}`;
    const source = address(variant.folder, view.folder, name, file);
    if (image.getAttribute("src") !== source) image.src = source;
    const coloured = modality.kind === "palette" || modality.kind === "value";
    image.style.filter = coloured ? `url(#colours-${name})` : "";
    image.classList.toggle("coloured", coloured); // colours between two classes or depths are of neither
  },

  async labels(variant) {
    const { number, view } = this.sensorOf(variant), place = this.placeIn(view), first = place - (place % this.data.chunk);
    const chunk = await recipe.load(`view-${number}-${first}`), frame = chunk[place - first];
    if (frame && !frame.owners) frame.owners = draw.owners(frame.objects, view);
    return frame;
  },

  async patchesOf(variant) {
    if (!variant.patches) return [];
    const { view, place: sensor } = this.sensorOf(variant), place = this.placeIn(view), first = place - (place % this.data.chunk);
    const chunk = await recipe.load(`patches-${this.data.variants.indexOf(variant)}-${sensor}-${first}`);
    return chunk[place - first];
  },

  category(object) { return this.data.categories[Math.floor(object.instance / 1000)] || "other"; },

  title(object) { return `${this.category(object)} ${object.instance % 1000}`; },

  shown(object) {
    if (object.area < Number(find("least").value || 0) || charts.hidden.has(this.category(object))) return false;
    const wanted = find("filter").value.trim().toLowerCase();
    return !wanted || `${this.title(object)} ${object.actor} ${object.instance}`.toLowerCase().includes(wanted);
  },

  // Drawing

  async refresh() {
    const turn = ++this.turn, { variant } = this, { view, number } = this.sensorOf(variant);
    this.writeHash();
    const last = (view.frames - 1) * view.interval, range = find("frame");
    Object.assign(range, { min: 0, max: last, step: view.interval });
    range.value = this.placeIn(view) * view.interval;
    find("now").textContent = `frame ${range.value} of 0–${last}, ${(range.value / this.data.scenes[variant.scene].fps).toFixed(2)} s`;
    find("stage").style.aspectRatio = `${view.width} / ${view.height}`;
    find("stage").style.maxWidth = `calc(66vh * ${view.width / view.height})`;
    const other = this.data.variants[this.state.compare];
    for (const id of ["pane-b", "divider", "split-label"]) find(id).hidden = !other;
    try {
      await Promise.all([this.pane("a", variant, turn), other && this.pane("b", other, turn), this.drawMap(variant, turn), this.drawStrip(number, turn)]);
    } catch (error) {
      this.notice(`Some data cannot be read: ${error.message}. Was the dataset copied as a whole?`);
    }
    if (turn !== this.turn) return;
    if (!this.joints && this.shownFrame?.objects.some((object) => object.keypoints)) {
      this.joints = true;
      this.controls();
    }
    this.splitAt();
    this.place();
    this.list();
    this.legend(view);
    this.ahead(variant, view);
    if (this.state.tab === "grid") charts.grid((n, compare) => this.choose(n, compare));
    if (this.state.tab === "events") await this.listEvents();
    this.drawn = turn; // for tests: everything of this turn is shown
  },

  async pane(which, variant, turn) {
    const pane = find(`pane-${which}`), { view } = this.sensorOf(variant), name = this.base(view), mix = Number(this.state.mix);
    const masks = this.data.modalities[name]?.kind === "masks", first = view.capture.find((m) => this.data.modalities[m].kind === "picture");
    this.paint(pane.querySelector(".under"), variant, view, mix < 1 || masks ? first : "");
    const over = pane.querySelector(".over");
    this.paint(over, variant, view, name);
    over.style.opacity = mix;
    const [frame, patches] = await Promise.all([this.labels(variant), this.patchesOf(variant)]);
    if (turn !== this.turn) return;
    if (which === "a") [this.shownFrame, this.shownPatches] = [frame, patches];
    draw.overlay(pane.querySelector("canvas"), view, frame, patches, { on: this.on, shown: (o) => this.shown(o), selected: this.state.selected, solid: masks ? mix : 0, zoom: this.zoom });
  },

  /** Enlarges around a place, given in shares of the stage; `by` 0: the whole picture. */
  zoomBy(by, fx = 0.5, fy = 0.5) {
    const { zoom } = this, next = Math.max(1, Math.min(16, zoom.by * by)), within = (v) => Math.max(0, Math.min(1 - 1 / next, v));
    Object.assign(zoom, { by: next, x: within(zoom.x + fx / zoom.by - fx / next), y: within(zoom.y + fy / zoom.by - fy / next) });
    this.refresh();
  },

  pan(dx, dy) {
    const { zoom } = this, within = (v) => Math.max(0, Math.min(1 - 1 / zoom.by, v));
    Object.assign(zoom, { x: within(zoom.x - dx / zoom.by), y: within(zoom.y - dy / zoom.by) });
    this.refresh();
  },

  /** Moves the pictures of both panes to what is shown. */
  place() {
    const { by, x, y } = this.zoom;
    for (const image of document.querySelectorAll(".pane img")) {
      image.style.transform = by > 1 ? `scale(${by}) translate(${-100 * x}%, ${-100 * y}%)` : "";
      image.classList.toggle("near", by > 3);
    }
    find("stage").classList.toggle("near", by > 1);
  },

  splitAt() {
    const { split, compare } = this.state;
    find("pane-b").style.clipPath = `inset(0 0 0 ${split}%)`;
    find("divider").style.left = `${split}%`;
    find("split-label").title = compare < 0 ? "" : `left: ${this.variant.name}; right: ${this.data.variants[compare].name}`;
  },

  async drawMap(variant, turn) {
    const { chunk } = this.data, { frame } = this.state, { number: current } = this.sensorOf(variant), first = frame - (frame % chunk);
    const [scene, rows, ...views] = await Promise.all([recipe.load(`scene-${variant.scene}`), recipe.load(`scene-${variant.scene}-${first}`), ...variant.views.map((n) => recipe.load(`view-${n}`))]);
    const before = first > 0 ? await recipe.load(`scene-${variant.scene}-${first - chunk}`) : [];
    if (turn !== this.turn) return;
    const cameras = variant.views.map((n, k) => {
      const view = this.data.views[n], { poses } = views[k];
      return { pose: poses[poses.length > 1 ? this.placeIn(view) : 0], fov: view.fov, name: view.sensor, current: n === current };
    });
    const trail = [...before, ...rows.slice(0, frame - first + 1)].slice(-25);
    this.cameras = cameras;
    map.show(scene, variant.scene, rows[frame - first] || [], trail, cameras, this.state.selected);
  },

  /** Draws the number of objects of each frame, collisions, and the current frame, below the slider. */
  async drawStrip(number, turn) {
    const [{ counts }, events] = await Promise.all([recipe.load(`view-${number}`), recipe.load(`events-${this.variant.events}`)]);
    if (turn !== this.turn) return;
    const canvas = find("strip"), dpr = window.devicePixelRatio || 1, view = this.data.views[number], high = 36 * dpr;
    canvas.width = Math.max(1, canvas.clientWidth * dpr);
    canvas.height = high;
    const pen = canvas.getContext("2d"), most = Math.max(1, ...counts), style = getComputedStyle(document.body);
    const x = (place) => ((place + 0.5) / counts.length) * canvas.width;
    pen.fillStyle = style.getPropertyValue("--line");
    for (let pixel = 0; pixel < canvas.width; pixel++) {
      const count = counts[Math.min(counts.length - 1, Math.floor((pixel / canvas.width) * counts.length))];
      pen.fillRect(pixel, high - (count / most) * (high - 4), 1, (count / most) * (high - 4));
    }
    pen.fillStyle = "#d64545";
    for (const [event, first] of events) if (event === "collision") pen.fillRect(x(first / view.interval) - dpr, 0, 2 * dpr, high);
    pen.fillStyle = style.getPropertyValue("--accent");
    pen.fillRect(x(this.placeIn(view)) - dpr, 0, 2 * dpr, high);
  },

  list() {
    const objects = this.shownFrame ? this.shownFrame.objects : [], shown = objects.filter((object) => this.shown(object));
    find("count").textContent = shown.length === objects.length ? String(objects.length) : `${shown.length} of ${objects.length}`;
    find("objects").tBodies[0].replaceChildren(...shown.map((object) => {
      const swatch = make("span", { className: "swatch" });
      swatch.style.background = css(colourOf(object.instance));
      const cells = [object.distance.toFixed(1), object.area.toLocaleString("en"), `${Math.round(100 * object.visible_fraction)} %`];
      const row = make("tr", { tabIndex: 0, "aria-selected": String(object.instance === this.state.selected) },
        make("td", {}, swatch, `${this.title(object)} · ${object.actor}`), ...cells.map((text) => make("td", {}, text)));
      row.addEventListener("click", () => this.select(object.instance));
      row.addEventListener("keydown", (event) => { if (event.key === "Enter") this.select(object.instance); });
      return row;
    }));
    const chosen = objects.find((object) => object.instance === this.state.selected), rows = [];
    const hidden = new Set(["counts", "box3d"]);
    for (const [key, value] of Object.entries(chosen || {})) {
      const text = typeof value === "string" ? value : JSON.stringify(value);
      if (!hidden.has(key) && text.length < 400) rows.push(make("dt", {}, key), make("dd", {}, text));
    }
    find("details").replaceChildren(...rows);
  },

  legend(view) {
    const name = this.base(view), modality = this.data.modalities[name], parts = [];
    if (modality?.kind === "value") {
      const scale = make("canvas", { width: 200, height: 12 }), pen = scale.getContext("2d"), colours = pen.createLinearGradient(0, 0, 200, 0);
      draw.VIRIDIS.forEach((colour, n) => colours.addColorStop(n / (draw.VIRIDIS.length - 1), colour));
      pen.fillStyle = colours;
      pen.fillRect(0, 0, 200, 12);
      const far = make("select", { id: "far" }, ...[25, 50, 100, 200, 1000].map((m) => make("option", { value: m, selected: m === this.state.far }, `${m} ${modality.unit}`)));
      far.addEventListener("change", () => { this.state.far = Number(far.value); this.filters(); this.refresh(); });
      parts.push("0 m", scale, make("label", {}, "up to ", far));
    } else if (modality?.kind === "palette") {
      modality.names.forEach((text, n) => {
        const swatch = make("span", { className: "swatch" });
        swatch.style.background = css(modality.colours[n]);
        parts.push(make("span", {}, swatch, text));
      });
    }
    find("legend").replaceChildren(...parts);
  },

  /** Reads the next pictures before they are needed. */
  ahead(variant, view) {
    const name = this.base(view, true), modality = this.data.modalities[name];
    if (!modality || modality.kind === "file") return;
    this.next = [1, 2].map((n) => this.placeIn(view) + n).filter((place) => place < view.frames).map((place) => {
      const image = new Image();
      image.src = address(variant.folder, view.folder, name, `${String(place * view.interval).padStart(6, "0")}.${modality.ending}`);
      return image;
    });
  },
};
