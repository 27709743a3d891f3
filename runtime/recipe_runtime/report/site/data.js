"use strict";
// Loads data files, and makes elements. Text from a dataset enters the page as text only: there is no HTML from it.

const recipe = {
  waiting: new Map(), // key -> promise
  arrived: new Map(), // key -> value
  add(key, text) {
    this.arrived.set(key, JSON.parse(text));
  },
  /** Returns a promise of the data of a key; a data file is a script that calls `recipe.add`. */
  load(key) {
    if (!/^[a-z]+(-\d+)*$/.test(key)) return Promise.reject(new Error("a data file has another name")); // data name others
    if (!this.waiting.has(key)) {
      this.waiting.set(key, new Promise((done, failed) => {
        const script = document.createElement("script");
        script.src = `data/${key}.js`;
        script.onload = () => {
          script.remove();
          if (this.arrived.has(key)) done(this.arrived.get(key));
          else failed(new Error(`${key} has no data`));
        };
        script.onerror = () => failed(new Error(`data/${key}.js cannot be read`));
        document.head.append(script);
      }));
      if (this.waiting.size > 60) this.forget(key);
    }
    return this.waiting.get(key);
  },
  /** Drops the oldest chunks of frames, so that a long film does not fill the memory. */
  forget(newest) {
    for (const key of this.waiting.keys()) {
      if (this.waiting.size <= 40) break;
      if (/-\d+-\d+$/.test(key) && key !== newest && this.arrived.has(key)) {
        this.waiting.delete(key);
        this.arrived.delete(key);
      }
    }
  },
};

const find = (id) => document.getElementById(id);

/** Returns an element with properties and children; children that are text stay text. */
function make(name, properties = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (key.startsWith("aria-") || key === "role") element.setAttribute(key, value);
    else element[key] = value;
  }
  element.append(...children);
  return element;
}

/** Returns the address of a file of the dataset, from its parts; names are encoded, and none leads out of it. */
const address = (...parts) => ["..", ...parts.map((part) => (/^\.*$/.test(part) ? "_" : encodeURIComponent(part)))].join("/");

/** Returns the colour of an object, the same in all frames and sensors: red, green, blue. */
function colourOf(instance) {
  const hue = (instance * 137.508) % 360, part = (n) => {
    const k = (n + hue / 30) % 12;
    return Math.round(255 * (0.64 - 0.32 * Math.max(-1, Math.min(k - 3, 9 - k, 1))));
  };
  return [part(0), part(8), part(4)];
}

const css = ([r, g, b], a = 1) => `rgb(${r} ${g} ${b} / ${a})`;

/** Colours of classes that colour-blind people can tell apart (Okabe and Ito, 2008). */
const HUES = ["#e69f00", "#56b4e9", "#009e73", "#d55e00", "#cc79a7", "#0072b2", "#b8a800", "#8a8a8a", "#7a4fd0"];
