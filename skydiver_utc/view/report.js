// SPDX-License-Identifier: Apache-2.0
// Charts with one cursor, which is the time of the bodies in 3-D, too. Texts are only ever set as textContent.
"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const make = (kind, parent, className = "", text = "") => {
  const made = parent.appendChild(document.createElement(kind));
  if (className) made.className = className;
  made.textContent = text;
  return made;
};
const numbers = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
const dark = matchMedia("(prefers-color-scheme: dark)");
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const shown = (value) => !Number.isFinite(value) ? "–"
  : value !== 0 && (Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3) ? value.toExponential(2)
  : String(Number(value.toPrecision(4)));
const LEFT = 52, RIGHT = 16, BELOW = 20, TOP = 6;
const view = { begin: data.begin, end: data.end };

// The index of the last sample at or before a time, -1 before the first.
function before(times, t) {
  let low = -1, high = times.length;
  while (high - low > 1) { const middle = (low + high) >> 1; if (times[middle] <= t) low = middle; else high = middle; }
  return low;
}

function ticks(low, high, most) {
  const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((n) => n * power >= raw) * power, found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) found.push(Number((i * step).toPrecision(12)));
  return found;
}

class Chart {
  constructor(spec, parent) {
    this.spec = spec;
    const figure = make("figure", parent), caption = make("figcaption", figure);
    make("b", caption, "", spec.unit === "1" ? spec.title : `${spec.title} [${spec.unit}]`);
    let value = 0;
    this.curves = spec.curves.map((curve) => {
      const ink = curve.role === "reference" ? "reference" : curve.role === "command" ? "command"
        : curve.role === "band" ? "command" : `c${(data.several ? curve.run : value++) % 4}`;
      const key = make("span", caption, "key"), swatch = make("i", key);
      make("em", key, "", curve.name).style.fontStyle = "normal";
      swatch.style.background = `var(--${ink})`;
      if (curve.role === "band") swatch.style.opacity = 0.45;
      return { ...curve, ink, t: numbers(curve.t), y: numbers(curve.y), value: make("span", key) };
    });
    this.plot = make("div", figure, spec.section === "Tracking" ? "plot tall" : "plot");
    this.canvas = make("canvas", this.plot);
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${spec.title} over time`);
    this.line = make("div", this.plot, "cursor");
    this.listen();
    new ResizeObserver(() => { this.draw(); this.point(cursor); }).observe(this.plot);
  }

  x(t) { return LEFT + (this.plot.clientWidth - LEFT - RIGHT) * (t - view.begin) / (view.end - view.begin); }
  time(event) {
    const box = this.plot.getBoundingClientRect();
    const share = (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT);
    return view.begin + Math.min(1, Math.max(0, share)) * (view.end - view.begin);
  }

  // Smallest and largest value in view; whole: without the seconds before `since`.
  range() {
    let low = Infinity, high = -Infinity;
    const { limits, since, reach, section } = this.spec, whole = view.begin === data.begin && view.end === data.end;
    const from = whole && since < view.end ? Math.max(since, view.begin) : view.begin;
    for (const { t, y, role } of this.curves) {
      if (role === "band" && limits) continue;
      for (let i = Math.max(0, before(t, from)), offset = y.length - t.length; i < t.length && t[i] <= view.end; i++) {
        if (t[i] < from && i + 1 < t.length && t[i + 1] <= from) continue;
        for (const value of offset ? [y[i], y[i + offset]] : [y[i]]) {
          if (value < low) low = value;
          if (value > high) high = value;
        }
      }
    }
    if (limits) for (const edge of limits) if (edge !== null) { low = Math.min(low, edge); high = Math.max(high, edge); }
    if (reach) { low = Math.max(low, -reach); high = Math.min(high, reach); }
    if (!(low <= high)) [low, high] = [0, 1];
    const margin = 0.07 * (high - low) || 0.1 * Math.abs(high) || 1;
    return [low - margin, high + margin];
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.plot, scale = devicePixelRatio || 1;
    if (!width) return;
    this.canvas.width = width * scale; this.canvas.height = height * scale;
    const pen = this.canvas.getContext("2d"), [low, high] = this.range(), bottom = height - BELOW;
    const y = (value) => bottom - (bottom - TOP) * (value - low) / (high - low);
    pen.scale(scale, scale);
    pen.font = "11px system-ui, sans-serif"; pen.fillStyle = colour("soft"); pen.strokeStyle = colour("line"); pen.lineWidth = 1;
    pen.textAlign = "right"; pen.textBaseline = "middle";
    for (const value of ticks(low, high, Math.max(2, height / 45))) {
      const at = Math.round(y(value)) + 0.5;
      pen.beginPath(); pen.moveTo(LEFT, at); pen.lineTo(width - RIGHT, at); pen.stroke();
      pen.fillText(shown(value), LEFT - 6, at);
    }
    pen.textAlign = "center"; pen.textBaseline = "top";
    for (const t of ticks(view.begin, view.end, Math.max(2, width / 90))) pen.fillText(`${shown(t)} s`, this.x(t), bottom + 5);
    pen.save();
    pen.beginPath(); pen.rect(LEFT, TOP - 2, width - LEFT - RIGHT, bottom - TOP + 4); pen.clip();
    this.shade(pen, y, bottom, width);
    for (const curve of this.curves) curve.role === "band" ? this.band(pen, curve, y) : this.curve(pen, curve, y);
    pen.restore();
  }

  shade(pen, y, bottom, width) {
    const { limits, since, section } = this.spec;
    pen.fillStyle = colour("panel");
    if (since > data.begin) pen.fillRect(LEFT, TOP, Math.max(0, this.x(since) - LEFT), bottom - TOP);
    pen.fillStyle = colour("command"); pen.globalAlpha = 0.3;
    for (const [from, to] of data.holes) pen.fillRect(this.x(from), TOP, Math.max(1, this.x(to) - this.x(from)), bottom - TOP);
    pen.globalAlpha = 1;
    if (!limits) return;
    if (section === "Tracking") {
      pen.fillStyle = colour("c2"); pen.globalAlpha = 0.16;
      pen.fillRect(LEFT, y(limits[1]), width - LEFT - RIGHT, y(limits[0]) - y(limits[1]));
      pen.globalAlpha = 1;
      return;
    }
    pen.strokeStyle = colour("soft"); pen.setLineDash([5, 4]);
    for (const edge of limits) if (edge !== null) { pen.beginPath(); pen.moveTo(LEFT, y(edge)); pen.lineTo(width - RIGHT, y(edge)); pen.stroke(); }
    pen.setLineDash([]);
  }

  // Calls each(x, index, fresh) for the samples in view and one beyond on each side; fresh after a hole.
  samples({ t, y }, each) {
    let fresh = true;
    for (let i = Math.max(0, before(t, view.begin)); i < t.length; i++) {
      if (Number.isFinite(y[i])) { each(this.x(t[i]), i, fresh); fresh = false; } else fresh = true;
      if (t[i] > view.end) break;
    }
  }

  curve(pen, curve, y) {
    pen.strokeStyle = colour(curve.ink);
    pen.lineWidth = curve.role === "reference" ? 4 : curve.role === "command" ? 1 : 1.6;
    pen.lineJoin = "round"; pen.globalAlpha = curve.role === "reference" ? 0.7 : 1;
    pen.beginPath();
    let last = 0;
    this.samples(curve, (x, i, fresh) => {
      if (fresh) pen.moveTo(x, y(curve.y[i]));
      else { if (curve.held) pen.lineTo(x, last); pen.lineTo(x, y(curve.y[i])); }
      last = y(curve.y[i]);
    });
    pen.stroke();
    pen.globalAlpha = 1;
  }

  band(pen, curve, y) {
    const count = curve.t.length, lower = [];
    const close = () => { for (const [x, edge] of lower.reverse()) pen.lineTo(x, edge); lower.length = 0; };
    pen.fillStyle = colour("command"); pen.globalAlpha = 0.28; pen.beginPath();
    this.samples(curve, (x, i, fresh) => {
      if (fresh) { close(); pen.moveTo(x, y(curve.y[count + i])); } else pen.lineTo(x, y(curve.y[count + i]));
      lower.push([x, y(curve.y[i])]);
    });
    close(); pen.fill(); pen.globalAlpha = 1;
  }

  point(t) {
    const x = this.x(t), count = (curve) => curve.t.length;
    this.line.style.transform = `translateX(${x}px)`;
    this.line.hidden = t < view.begin || t > view.end;
    for (const curve of this.curves) {
      const i = before(curve.t, t + 1e-6);
      curve.value.textContent = i < 0 ? "–" : curve.role !== "band" ? shown(curve.y[i])
        : `± ${shown((curve.y[count(curve) + i] - curve.y[i]) / 2)}`;
    }
  }

  listen() {
    let from = null, drag = null;
    this.plot.addEventListener("pointermove", (event) => {
      setCursor(this.time(event)); hovered = true;
      if (from === null || Math.abs(event.clientX - from.x) < 5) return;
      drag = drag || make("div", this.plot, "drag");
      const a = this.x(from.t), b = this.x(this.time(event));
      drag.style.left = `${Math.min(a, b)}px`; drag.style.width = `${Math.abs(b - a)}px`;
    });
    this.plot.addEventListener("pointerdown", (event) => {
      if (event.pointerType !== "mouse") return;
      from = { x: event.clientX, t: this.time(event) };
      this.plot.setPointerCapture(event.pointerId);
    });
    this.plot.addEventListener("pointerup", (event) => {
      const t = this.time(event);
      if (drag) zoom(Math.min(from.t, t), Math.max(from.t, t)); else seek(t);
      drag?.remove(); from = drag = null;
    });
    this.plot.addEventListener("pointerleave", () => { hovered = false; });
    this.plot.addEventListener("dblclick", () => zoom(data.begin, data.end));
  }
}

// The clock: viser's player where there are bodies, else one of its own.
const frame = document.getElementById("bodies"), scene = document.getElementById("scene");
let cursor = data.begin, hovered = false, playing = false, last = 0;
const inside = (selector) => frame?.contentDocument?.querySelector(selector);
function playerTime() {
  const now = inside('[role="slider"]')?.getAttribute("aria-valuenow");
  return now === null || now === undefined ? null : data.begin + Number(now);
}
function seek(t) {
  setCursor(t); last = t; hovered = false;
  const field = inside('input[inputmode]');
  if (!field) return;
  const own = Object.getOwnPropertyDescriptor(frame.contentWindow.HTMLInputElement.prototype, "value");
  own.set.call(field, String(Number((t - data.begin).toFixed(4))));
  field.dispatchEvent(new frame.contentWindow.Event("input", { bubbles: true }));
  field.blur(); // it takes the focus, and would take the next keys
}
function toggle() {
  if (frame) frame.contentWindow.dispatchEvent(new KeyboardEvent("keydown", { code: "Space" }));
  else playing = !playing;
}
function setCursor(t) {
  cursor = Math.min(data.end, Math.max(data.begin, t));
  document.getElementById("time").textContent = `${cursor.toFixed(3)} s`;
  for (const chart of charts) chart.point(cursor);
}
function zoom(begin, end) {
  if (end - begin < 1e-4 * (data.end - data.begin)) return;
  Object.assign(view, { begin, end });
  document.getElementById("whole").hidden = begin === data.begin && end === data.end;
  for (const chart of charts) { chart.draw(); chart.point(cursor); }
}
function keys(event) {
  if (event.ctrlKey || event.altKey || event.metaKey || !event.isTrusted || /^(INPUT|TEXTAREA)$/.test(event.target.tagName)) return;
  const step = (view.end - view.begin) / (event.shiftKey ? 20 : 200);
  const act = { ArrowLeft: () => seek(cursor - step), ArrowRight: () => seek(cursor + step), Home: () => seek(view.begin),
    End: () => seek(view.end), " ": toggle, Escape: () => zoom(data.begin, data.end) }[event.key];
  if (!act || (event.key === " " && /^(BUTTON|SUMMARY)$/.test(event.target.tagName))) return;
  event.preventDefault(); event.stopPropagation();
  act();
}
function load() {
  if (!frame) return;
  const page = JSON.parse(scene.textContent);
  frame.srcdoc = dark.matches ? page.replace("darkMode:false", "darkMode:true") : page;
}

const charts = [], parent = document.getElementById("charts");
let section = "";
for (const spec of data.charts) {
  if (spec.section !== section) make("h2", parent, "", section = spec.section);
  charts.push(new Chart(spec, parent));
}
setCursor(data.begin);
document.addEventListener("keydown", keys);
frame?.addEventListener("load", () => {
  frame.contentWindow.addEventListener("keydown", keys, true);
  // A note on a missing graphics card would cover the bodies.
  make("style", frame.contentDocument.head, "", ".mantine-Notifications-root { display: none }");
});
document.getElementById("play").addEventListener("click", toggle);
document.getElementById("whole").addEventListener("click", () => zoom(data.begin, data.end));
for (const still of document.querySelectorAll("[data-time]")) still.addEventListener("click", () => seek(Number(still.dataset.time)));
dark.addEventListener("change", () => { for (const chart of charts) chart.draw(); load(); });
setTimeout(load);
let past = performance.now(), calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
requestAnimationFrame(function tick(now) {
  const t = frame ? playerTime() : playing ? (cursor + (now - past) / 1000 > data.end ? data.begin : cursor + (now - past) / 1000) : null;
  past = now;
  if (t !== null && t !== last && !hovered) setCursor(t);
  if (t !== null) last = t;
  if (t !== null && calm) { calm = false; seek(data.begin); } // a jump pauses
  requestAnimationFrame(tick);
});
