"use strict";
// Draws labels over a picture: masks, boxes, 3-D boxes, patches; and colours depth and classes with SVG filters.

const draw = {
  /** Returns the runs of a mask in COCO's compressed code: zeros, ones, zeros, ... in columns. */
  runs(text) {
    const found = [];
    for (let at = 0; at < text.length;) {
      let value = 0, shift = 0, more = true;
      while (more && at < text.length) {
        const code = text.charCodeAt(at++) - 48;
        value |= (code & 31) << shift;
        shift += 5;
        more = (code & 32) !== 0;
        if (!more && code & 16) value |= -1 << shift;
      }
      if (found.length > 2) value += found[found.length - 2];
      found.push(value);
    }
    return found;
  },

  /** Calls a function with the index, row by row, of each pixel of a mask. */
  eachPixel(text, width, height, visit) {
    let at = 0;
    this.runs(text).forEach((length, n) => {
      if (n % 2) for (let k = at; k < at + length; k++) visit((k % height) * width + Math.floor(k / height));
      at += length;
    });
  },

  /** Returns which object each pixel shows: its place in the list and 1, 0 for none. */
  owners(objects, view) {
    const found = new Uint16Array(view.width * view.height);
    objects.forEach((object, n) => this.eachPixel(object.counts, view.width, view.height, (k) => { found[k] = n + 1; }));
    return found;
  },

  /** Returns a canvas with the masks of objects, in the colours of a function. */
  masks(objects, owners, view, shown, alpha, edges) {
    const canvas = make("canvas", { width: view.width, height: view.height });
    const pen = canvas.getContext("2d"), picture = pen.createImageData(view.width, view.height), { data } = picture;
    const colours = objects.map((object) => colourOf(object.instance)), visible = objects.map(shown);
    for (let k = 0; k < owners.length; k++) {
      const n = owners[k] - 1;
      if (n < 0 || !visible[n]) continue;
      const edge = edges && (owners[k + 1] !== owners[k] || owners[k + view.width] !== owners[k]);
      data.set(colours[n], 4 * k);
      data[4 * k + 3] = edge ? 255 : alpha;
    }
    pen.putImageData(picture, 0, 0);
    return canvas;
  },

  /** Returns the pixel of a point in the sensor's frame (x forward, y left, z up), null if it is behind the camera. */
  pixel([x, y, z], view) {
    if (x < 0.05) return null;
    const half = view.width / 2, focal = half / Math.tan((view.fov * Math.PI) / 360), [k, cube] = view.lens;
    const u = (-y / x) * focal / half, v = (-z / x) * focal / half;
    let a = u, b = v;
    for (let n = 0; n < 8 && (k || cube); n++) {
      const r = Math.hypot(a, b), by = 1 + k * r * r + cube * r * r * r;
      [a, b] = [u / by, v / by];
    }
    return [half + a * half, view.height / 2 + b * half];
  },

  corners(box) {
    const [w, x, y, z] = box.rotation, [cx, cy, cz] = box.centre, [l, b, h] = box.size.map((v) => v / 2);
    const rows = [
      [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
      [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
      [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ];
    const found = [];
    for (const i of [-1, 1]) for (const j of [-1, 1]) for (const m of [-1, 1]) {
      const p = [i * l, j * b, m * h];
      found.push(rows.map((row, n) => row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + [cx, cy, cz][n]));
    }
    return found;
  },

  line(pen, points, close) {
    pen.beginPath();
    points.forEach((p, n) => (n ? pen.lineTo(...p) : pen.moveTo(...p)));
    if (close) pen.closePath();
    pen.stroke();
  },

  /** Draws a 3-D box; its front, where the actor looks, has a cross. */
  solid(pen, box, view) {
    const at = this.corners(box).map((corner) => this.pixel(corner, view));
    const edges = [[0, 1], [0, 2], [0, 4], [1, 3], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 6], [5, 7], [6, 7], [4, 7], [5, 6]];
    for (const [a, b] of edges) if (at[a] && at[b]) this.line(pen, [at[a], at[b]]);
  },

  label(pen, text, x, y, colour, scale) {
    pen.font = `${12 / scale}px system-ui, sans-serif`;
    const wide = pen.measureText(text).width, high = 15 / scale, left = Math.max(0, x), top = Math.max(0, y - high);
    pen.fillStyle = "rgb(0 0 0 / .65)";
    pen.fillRect(left, top, wide + 6 / scale, high);
    pen.fillStyle = colour;
    pen.textBaseline = "middle";
    pen.fillText(text, left + 3 / scale, top + high / 2);
  },

  /** Draws all overlays of a frame on the canvas of a pane. */
  overlay(canvas, view, frame, patches, options) {
    const dpr = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
    canvas.width = Math.max(1, Math.round(box.width * dpr));
    canvas.height = Math.max(1, Math.round(box.height * dpr));
    if (!frame) return;
    const { on, shown, selected, solid, zoom } = options, objects = frame.objects;
    const pen = canvas.getContext("2d"), scale = (canvas.width / view.width / dpr) * zoom.by;
    pen.scale((canvas.width / view.width) * zoom.by, (canvas.height / view.height) * zoom.by);
    pen.translate(-zoom.x * view.width, -zoom.y * view.height);
    if (solid > 0) {
      pen.fillStyle = `rgb(0 0 0 / ${solid})`;
      pen.fillRect(0, 0, view.width, view.height);
    }
    pen.imageSmoothingEnabled = false;
    if (solid > 0 || on.masks) {
      const alpha = solid > 0 ? Math.round(255 * Math.max(solid, 0.35)) : 90;
      pen.drawImage(this.masks(objects, frame.owners, view, shown, alpha, on.masks), 0, 0);
    }
    for (const object of objects) if (shown(object)) this.object(pen, object, view, scale, on, object.instance === selected);
    if (on.patches) for (const patch of patches || []) this.patch(pen, patch, scale);
  },

  object(pen, object, view, scale, on, selected) {
    const colour = css(colourOf(object.instance)), [x, y, w, h] = object.bbox;
    pen.strokeStyle = colour;
    pen.lineWidth = (selected ? 3 : 1.5) / scale;
    if (on.amodal) {
      pen.setLineDash([5 / scale, 4 / scale]);
      pen.strokeRect(...object.amodal_bbox);
      pen.setLineDash([]);
    }
    if (on.solids && object.box3d) this.solid(pen, object.box3d, view);
    if (on.boxes || selected) pen.strokeRect(x, y, w, h);
    if (on.keypoints && Array.isArray(object.keypoints)) this.points(pen, object.keypoints.flat(), scale, colour);
    if ((on.ids && h * scale > 14) || selected) this.label(pen, page.title(object), x, y, colour, scale);
  },

  /** Draws joints: x, y, visibility of each, one after the other; hollow if it is not visible. */
  points(pen, values, scale, colour) {
    pen.fillStyle = colour;
    for (let n = 0; n + 2 < values.length; n += 3) {
      if (!values[n + 2]) continue;
      pen.beginPath();
      pen.arc(values[n], values[n + 1], 2.5 / scale, 0, 7);
      if (values[n + 2] > 1) pen.fill(); else pen.stroke();
    }
  },

  patch(pen, patch, scale) {
    if (!patch.corners || !patch.area) return;
    pen.strokeStyle = "#ffe14d";
    pen.lineWidth = 2 / scale;
    this.line(pen, patch.corners, true);
    patch.corners.forEach(([x, y], n) => {
      pen.fillStyle = ["#ff4d4d", "#4dff6a", "#4da3ff", "#ffffff"][n];
      pen.beginPath();
      pen.arc(x, y, 4 / scale, 0, 7);
      pen.fill();
    });
    this.label(pen, patch.name, patch.corners[0][0], patch.corners[0][1] - 4 / scale, "#ffe14d", scale);
  },

  VIRIDIS: ["#fde725", "#b5de2b", "#6ece58", "#35b779", "#1f9e89", "#26828e", "#31688e", "#3e4989", "#482878", "#440154"],

  /** Makes the SVG filter that colours the pictures of a modality, and returns its name for CSS. */
  filter(name, modality, far) {
    const id = `colours-${name}`, svg = (tag, attributes, ...children) => {
      const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
      for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
      element.append(...children);
      return element;
    };
    const parts = [], palette = modality.kind === "palette";
    const colours = palette ? modality.colours : this.VIRIDIS.map((c) => [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16)));
    if (!palette) {
      const row = [...modality.weights.map((w) => (255 * w) / far), 0, 0].join(" ");
      parts.push(svg("feColorMatrix", { type: "matrix", values: `${row} ${row} ${row} 0 0 0 0 1` }));
    }
    const tables = [0, 1, 2].map((k) => {
      const values = palette ? Array.from({ length: 256 }, (_, n) => colours[Math.min(n, colours.length - 1)][k]) : colours.map((c) => c[k]);
      const type = palette ? "discrete" : "table";
      return svg(`feFunc${"RGB"[k]}`, { type, tableValues: values.map((v) => (v / 255).toFixed(4)).join(" ") });
    });
    parts.push(svg("feComponentTransfer", {}, ...tables));
    document.getElementById(id)?.remove();
    find("filters").append(svg("filter", { id, "color-interpolation-filters": "sRGB", x: 0, y: 0, width: 1, height: 1 }, ...parts));
    return `url(#${id})`;
  },
};
