"use strict";
// The parts beside the frames: variants as a grid, histograms, events, and how to build the dataset again.

const charts = {
  hidden: new Set(), // classes that are not shown, in histograms, lists and overlays

  /** Returns the values of axes of a variant's name, `a=b,c=d`; null if it has another form. */
  axes(name) {
    const pairs = name.split(",").map((part) => part.split(/=(.*)/s));
    return pairs.every((pair) => pair.length > 1) ? new Map(pairs) : null;
  },

  colour(name) {
    const names = Object.values(page.data.categories);
    return HUES[Math.max(0, names.indexOf(name)) % HUES.length];
  },

  /** Fills a group with a button for each class, which shows and hides it everywhere. */
  classes(group, changed) {
    group.replaceChildren(...Object.keys(page.data.statistics.classes).map((name) => {
      const swatch = make("span", { className: "swatch" });
      swatch.style.background = this.colour(name);
      const button = make("button", { type: "button", "aria-pressed": String(!this.hidden.has(name)) }, swatch, name);
      button.addEventListener("click", () => {
        if (!this.hidden.delete(name)) this.hidden.add(name);
        changed();
      });
      return button;
    }));
  },

  histograms(show) {
    const { statistics, quantities, examples } = page.data;
    const classes = Object.entries(statistics.classes).filter(([name]) => !this.hidden.has(name));
    const byClass = this.chart("Annotations by class", classes.map(([name]) => name), classes.map(([name, c]) => [[name, c.annotations]]), "", () => {});
    const rest = Object.entries(quantities).map(([key, { title, unit }]) => {
      const bounds = statistics.bins[key];
      const bins = bounds.map((_, n) => classes.map(([name, c]) => [name, c.histograms[key][n]]));
      const names = bounds.map((low, n) => (n + 1 < bounds.length || low === 1 ? "" : "≥") + (low >= 10000 ? `${low / 1000}k` : low));
      return this.chart(title + (unit && `, ${unit}`), names, bins, `${title} ${unit}`, (n) => {
        const places = classes.flatMap(([name]) => (examples[name] || []).filter(([q, bin]) => q === key && bin === n).flatMap(([, , p]) => p.map((place) => [name, place])));
        const high = n + 1 < bounds.length ? `${bounds[n]} to ${bounds[n + 1]}` : `${bounds[n]} and more`;
        this.examples(`${title}: ${high} ${unit}`, places, show);
      });
    });
    find("charts").replaceChildren(byClass, ...rest);
  },

  /** Returns a histogram: `bins` has, for each bar, rows of class and count. */
  chart(title, names, bins, what, chosen) {
    const totals = bins.map((rows) => rows.reduce((sum, [, count]) => sum + count, 0)), most = Math.max(1, ...totals);
    const columns = bins.map((rows, n) => {
      const column = make("button", { type: "button", className: "column", title: `${what} ${names[n]}: ${totals[n].toLocaleString("en")}\n${rows.filter((r) => r[1]).map((r) => `${r[0]} ${r[1]}`).join("\n")}` });
      for (const [name, count] of rows) {
        const part = make("div");
        part.style.background = this.colour(name);
        part.style.height = `${(100 * count) / most}%`;
        column.append(part);
      }
      column.setAttribute("aria-label", `${title} ${names[n]}: ${totals[n]}`);
      column.addEventListener("click", () => chosen(n));
      return column;
    });
    const top = make("span", {}, `up to ${most.toLocaleString("en")}`);
    return make("div", { className: "chart" },
      make("div", { className: "head" }, make("h2", {}, title), top),
      make("div", { className: "bars" }, ...columns),
      make("div", { className: "ticks", "aria-hidden": "true" }, ...names.map((name) => make("span", {}, name))));
  },

  examples(title, places, show) {
    const buttons = places.slice(0, 24).map(([name, [view, frame, instance]]) => {
      const button = make("button", { type: "button" }, `${name} ${instance % 1000}, ${page.data.views[view].sensor}, frame ${frame}`);
      button.addEventListener("click", () => show(view, frame, instance));
      return button;
    });
    find("examples").replaceChildren(make("strong", {}, title), ...(buttons.length ? buttons : ["none"]));
    find("examples").scrollIntoView({ block: "nearest" });
  },

  events(rows, show) {
    const wanted = find("event-filter").value.trim().toLowerCase();
    const found = rows.filter((row) => !wanted || row.join(" ").toLowerCase().includes(wanted));
    const limit = 2000;
    find("event-count").textContent = `${found.length.toLocaleString("en")} events${found.length > limit ? `, the first ${limit} are shown` : ""}`;
    find("event-rows").tBodies[0].replaceChildren(...found.slice(0, limit).map((row) => {
      const [event, first, last, sensor, subject, object, value] = row;
      const line = make("tr", { tabIndex: 0 }, ...[event, `${first}–${last}`, subject, object, sensor, value].map((text) => make("td", {}, String(text))));
      line.addEventListener("click", () => show(first, subject, sensor));
      line.addEventListener("keydown", (e) => { if (e.key === "Enter") show(first, subject, sensor); });
      return line;
    }));
  },

  /** Fills the list of axes for the rows of the grid. */
  listAxes() {
    const axes = this.axes(page.data.variants[0].name);
    find("rows").replaceChildren(...[...(axes ? axes.keys() : []), ""].map((name) => make("option", { value: name }, name || "none")));
  },

  /** Shows a picture of every variant at the current frame; rows have one value of an axis each. */
  grid(choose) {
    const axis = find("rows").value, rows = new Map();
    page.data.variants.forEach((variant, n) => {
      const axes = axis ? this.axes(variant.name) : null, key = axes && axes.has(axis) ? `${axis}=${axes.get(axis)}` : "";
      if (!rows.has(key)) rows.set(key, []);
      rows.get(key).push([variant, n]);
    });
    const parts = [];
    for (const [key, variants] of rows) {
      if (key) parts.push(make("h3", {}, key));
      parts.push(make("div", { className: "row" }, ...variants.map(([variant, n]) => this.cell(variant, n, key, choose))));
    }
    find("cells").replaceChildren(...parts);
  },

  cell(variant, n, key, choose) {
    const { view } = page.sensorOf(variant), picture = make("img", { loading: "lazy", decoding: "async", alt: variant.name });
    picture.width = view.width;
    picture.height = view.height;
    picture.style.height = "auto";
    page.paint(picture, variant, view, page.base(view, true));
    const button = make("button", { type: "button", className: "cell", title: variant.name }, picture, make("span", {}, variant.name.split(",").filter((part) => part !== key).join(", ") || variant.name));
    button.setAttribute("aria-pressed", String(n === page.state.variant || n === page.state.compare));
    button.addEventListener("click", (event) => choose(n, event.shiftKey));
    return button;
  },

  about() {
    const { plan, identity, commands, statistics } = page.data, rows = [];
    const add = (name, value) => rows.push(make("dt", {}, name), make("dd", {}, value));
    add("identity", identity);
    add("plan", `sha256:${plan.plan}`);
    for (const key of ["variants", "scenes", "frames", "seconds"]) add(key, plan[key].toLocaleString("en"));
    add("sensors", plan.sensors.join(", "));
    add("towns", plan.towns.join(", "));
    add("pictures", Object.entries(plan.pictures).map(([name, count]) => `${name} ${count.toLocaleString("en")}`).join(", "));
    add("actors", Object.entries(plan.actors).map(([name, count]) => `${name} ${count}`).join(", "));
    add("annotations", `${statistics.annotations.toLocaleString("en")} in ${statistics.annotated_frames.toLocaleString("en")} frames, ${statistics.empty_frames.toLocaleString("en")} without any`);
    find("about").replaceChildren(
      make("h2", {}, "Verify this folder, and build it again"),
      make("p", {}, "With Dataset Recipe of the version that manifest.json names, in the folder of the dataset:"),
      make("pre", {}, commands.join("\n")),
      make("h2", {}, "Cite"),
      make("p", {}, "The identity covers plans, motion, pixels and labels. Whoever builds the recipe again gets the same line:"),
      make("pre", {}, identity),
      make("h2", {}, "Content"),
      make("dl", {}, ...rows));
  },
};
