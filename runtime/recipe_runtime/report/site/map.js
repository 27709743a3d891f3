"use strict";
// The town from above: actors, their paths, and the fields of view of the variant's cameras at the current frame.

const map = {
  view: null, // x, y of the centre, metres; metres across
  ground: null,
  drawn: null, // what was drawn last, for zooming

  fit(box) {
    this.view = { x: (box[0] + box[2]) / 2, y: (box[1] + box[3]) / 2, across: Math.max(box[2] - box[0], box[3] - box[1]) };
  },

  /** Shows a frame: `poses` are those of all cameras of the variant, `now` and `trail` the actors at frames. */
  show(scene, number, now, trail, cameras, selected) {
    if (!this.ground || this.number !== number) {
      this.number = number;
      this.ground = new Image();
      this.ground.onload = () => this.draw();
      this.ground.src = `data/scene-${number}.png`;
      this.fit(scene.box);
    }
    this.drawn = { scene, now, trail, cameras, selected };
    this.draw();
  },

  draw() {
    if (!this.drawn) return;
    const canvas = find("map"), dpr = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
    if (!box.width) return;
    canvas.width = box.width * dpr;
    canvas.height = box.height * dpr;
    const pen = canvas.getContext("2d"), { scene, now, trail, cameras, selected } = this.drawn;
    this.scale = Math.min(canvas.width, canvas.height) / this.view.across;
    pen.fillStyle = "#dfe8d2";
    pen.fillRect(0, 0, canvas.width, canvas.height);
    const at = (x, y) => [canvas.width / 2 + (x - this.view.x) * this.scale, canvas.height / 2 - (y - this.view.y) * this.scale];
    if (this.ground.complete && this.ground.naturalWidth) {
      const [x, y] = at(scene.box[0], scene.box[3]);
      pen.drawImage(this.ground, x, y, (scene.box[2] - scene.box[0]) * this.scale, (scene.box[3] - scene.box[1]) * this.scale);
    }
    pen.lineWidth = 1.2 * dpr;
    scene.actors.forEach(([, instance], n) => {
      const chosen = instance === selected;
      this.way(pen, scene.paths[n], at, css(colourOf(instance), chosen ? 1 : 0.35), chosen);
      this.way(pen, trail.map((row) => row[n] || null), at, css(colourOf(instance)), chosen);
    });
    for (const camera of cameras) this.camera(pen, camera, at, dpr);
    scene.actors.forEach((actor, n) => now[n] && this.actor(pen, actor, now[n], at, actor[1] === selected, dpr));
    this.bar(pen, canvas, dpr);
  },

  way(pen, points, at, colour, chosen) {
    pen.strokeStyle = colour;
    pen.save();
    if (chosen) pen.lineWidth *= 2;
    pen.beginPath();
    let open = false;
    for (const point of points) {
      if (point) pen[open ? "lineTo" : "moveTo"](...at(point[0], point[1]));
      open = point !== null;
    }
    pen.stroke();
    pen.restore();
  },

  actor(pen, [, instance, length, width], [x, y, yaw], at, chosen, dpr) {
    const [px, py] = at(x, y);
    pen.save();
    pen.translate(px, py);
    pen.rotate((-yaw * Math.PI) / 180);
    const l = Math.max(length * this.scale, 7 * dpr), w = Math.max(width * this.scale, 5 * dpr);
    pen.fillStyle = css(colourOf(instance));
    pen.strokeStyle = chosen ? "#d00000" : "#1d2126";
    pen.lineWidth = (chosen ? 3 : 1) * dpr;
    pen.beginPath();
    pen.moveTo(l / 2, 0);
    for (const [a, b] of [[l / 4, w / 2], [-l / 2, w / 2], [-l / 2, -w / 2], [l / 4, -w / 2]]) pen.lineTo(a, b);
    pen.closePath();
    pen.fill();
    pen.stroke();
    pen.restore();
  },

  camera(pen, { pose: [x, y, , yaw], fov, name, current }, at, dpr) {
    const [px, py] = at(x, y), reach = (current ? 25 : 12) * this.scale, half = (Math.min(fov, 179) * Math.PI) / 360, to = (-yaw * Math.PI) / 180;
    pen.beginPath();
    pen.moveTo(px, py);
    pen.arc(px, py, reach, to - half, to + half);
    pen.closePath();
    pen.fillStyle = current ? "rgb(122 42 155 / .25)" : "rgb(122 42 155 / .1)";
    pen.fill();
    pen.strokeStyle = "#7a2a9b";
    pen.lineWidth = 1.5 * dpr;
    pen.stroke();
    pen.font = `${12 * dpr}px system-ui, sans-serif`;
    pen.textBaseline = "alphabetic";
    pen.strokeStyle = "#fff";
    pen.lineWidth = 3 * dpr;
    pen.strokeText(name, px + 6 * dpr, py - 6 * dpr);
    pen.fillStyle = "#5b1a78";
    pen.fillText(name, px + 6 * dpr, py - 6 * dpr);
  },

  bar(pen, canvas, dpr) {
    const length = [1, 2, 5, 10, 20, 50, 100, 200].find((m) => m * this.scale > 60 * dpr) || 500;
    const y = canvas.height - 12 * dpr;
    pen.fillStyle = "#1d2126";
    pen.fillRect(12 * dpr, y, length * this.scale, 3 * dpr);
    pen.font = `${12 * dpr}px system-ui, sans-serif`;
    pen.textBaseline = "alphabetic";
    pen.fillText(`${length} m`, 12 * dpr, y - 4 * dpr);
  },

  /** Returns the actor nearest to a place on the canvas, within 2 m or 12 pixels: its instance value. */
  actorAt(event) {
    if (!this.drawn || !this.scale) return null;
    const box = find("map").getBoundingClientRect(), dpr = window.devicePixelRatio || 1;
    const x = this.view.x + ((event.clientX - box.left - box.width / 2) * dpr) / this.scale;
    const y = this.view.y - ((event.clientY - box.top - box.height / 2) * dpr) / this.scale;
    let best = null, least = Math.max(2, (12 * dpr) / this.scale);
    this.drawn.scene.actors.forEach((actor, n) => {
      const here = this.drawn.now[n], far = here ? Math.hypot(here[0] - x, here[1] - y) : Infinity;
      if (far < least) [best, least] = [actor[1], far];
    });
    return best;
  },

  /** Zooms with the wheel, moves with a drag, and selects with a click. */
  listen(select) {
    const canvas = find("map");
    let from = null, moved = false;
    canvas.addEventListener("wheel", (event) => {
      if (!this.view) return;
      event.preventDefault();
      this.view.across = Math.min(2000, Math.max(8, this.view.across * (event.deltaY > 0 ? 1.2 : 1 / 1.2)));
      this.draw();
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => { from = [event.clientX, event.clientY]; moved = false; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointermove", (event) => {
      if (!from || !this.view) return;
      const dpr = window.devicePixelRatio || 1, dx = event.clientX - from[0], dy = event.clientY - from[1];
      if (!moved && Math.hypot(dx, dy) < 4) return;
      moved = true;
      this.view.x -= (dx * dpr) / this.scale;
      this.view.y += (dy * dpr) / this.scale;
      from = [event.clientX, event.clientY];
      this.draw();
    });
    canvas.addEventListener("pointerup", (event) => {
      if (from && !moved) select(this.actorAt(event));
      from = null;
    });
  },
};
