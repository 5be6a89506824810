// The track over time: four panels on one axis, which zoom and move together.

const FEWEST_FRAMES = 8; // in view
const SAID = { full: "full", ours: "track", constant: "constant" }; // what a reader calls each version
const MOST_STEPS = 20000; // beyond, steps take long to draw and look like lines

/** Return the panels: heading, axis range, decimals, and their lines (name, values, whether dashed). */
function panelsOf(data) {
  const constant = new Float32Array(data.times.length).fill(data.constantFactor);
  const watt = data.power && Math.max(...extremes(data.power, data.constantPower)) < 10 ? 3 : 1;
  const pair = (ours, other) => [["ours", ours], ["constant", other]];
  return [
    { name: "Brightness factor b", unit: "", digits: 3, lines: pair(data.factors, constant) },
    { name: "Contrast loss [%]", unit: " %", digits: 2, lines: pair(data.loss, data.constantLoss), low: 0 },
    { name: "Rate of change / limit ΔL [%]", unit: " %", digits: 1, lines: [["ours", data.rate]], limit: 100 },
    ...(data.power ? [{ name: "Power [W]", unit: " W", digits: watt, lines: pair(data.power, data.constantPower) }] : []),
  ];
}

/** Return the least and the greatest of some arrays of numbers. */
function extremes(...arrays) {
  let low = Infinity, high = -Infinity;
  for (const values of arrays) for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high];
}

/** Return the range of a panel's axis, with room around its lines. */
function rangeOf({ lines, low, limit }) {
  let [least, most] = extremes(...lines.map(line => line[1]));
  if (limit) [least, most] = [Math.min(-limit, least), Math.max(limit, most)];
  const room = Math.max(0.08 * (most - least), 0.02 * Math.abs(most), 1e-3);
  return [low === undefined ? least - room : low, most + room];
}

/** Return a moment of a video as people read it: seconds, or minutes and seconds from five minutes on. */
function clockTime(time, digits = 2, longest = time) {
  if (longest < 300) return `${time.toFixed(digits)} s`;
  const whole = Math.floor(time), two = n => String(n).padStart(2, "0");
  const hours = Math.floor(whole / 3600), minutes = Math.floor(whole / 60) % 60;
  const seconds = `${two(whole % 60)}${digits ? (time - whole).toFixed(digits).slice(1) : ""}`;
  return longest >= 3600 ? `${hours}:${two(minutes)}:${seconds}` : `${minutes}:${seconds}`;
}

/** The panels in an element; `pointed(frame)` tells which frame the pointer is at (null: none), `sought` a click. */
class Plots {
  constructor(element, data, pointed, sought) {
    Object.assign(this, { element, data, pointed, sought, panels: panelsOf(data), time: 0 });
    this.whole = this.range = [data.times[0], data.end];
    for (const panel of this.panels) this.#frame(panel);
    this.build();
    new ResizeObserver(() => this.#fit()).observe(element);
  }
  #frame(panel) {
    const heading = document.createElement("h2"), plot = document.createElement("div");
    panel.numbers = panel.lines.map(([name], k) => {
      const words = document.createElement("span");
      words.innerHTML = `<i class="swatch ${k ? "dashed " : ""}${name}"></i>${SAID[name]} <data></data>`;
      return words;
    });
    heading.append(panel.name, ...panel.numbers);
    const [low, high] = extremes(panel.lines[0][1]);
    plot.setAttribute("role", "img");
    plot.setAttribute("aria-label", `${panel.name} over time: the track from ${low.toFixed(panel.digits)} to ` +
      `${high.toFixed(panel.digits)}${panel.unit}`);
    this.element.append(heading, plot);
    panel.plot = plot;
  }
  /** Draw the panels anew, in the colours and the type size of now. */
  build() {
    this.type = parseFloat(getComputedStyle(document.documentElement).fontSize);
    for (const panel of this.panels) {
      panel.chart?.destroy();
      panel.chart = new uPlot(this.#options(panel), [this.data.times, ...panel.lines.map(line => line[1])], panel.plot);
      panel.now = Object.assign(document.createElement("div"), { className: "now" });
      panel.chart.over.append(panel.now);
      panel.chart.over.addEventListener("click", () => this.sought(this.#frameAt(panel.chart)));
      panel.chart.over.addEventListener("wheel", event => this.#wheel(panel.chart, event), { passive: false });
    }
    this.show(...this.range);
  }
  #size(panel) {
    const high = Math.min(Math.max(0.08 * innerHeight, 4.8 * this.type), 12 * this.type);
    return { width: this.element.clientWidth, height: Math.round(high + (this.#isLast(panel) ? 2.6 * this.type : 0)) };
  }
  #isLast(panel) { return panel === this.panels.at(-1); }
  #options(panel) {
    const colour = name => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
    const [ink, grid, type] = [colour("muted"), colour("grid"), 0.8 * this.type];
    const axis = { stroke: ink, grid: { stroke: grid, width: 1 }, ticks: { stroke: grid, width: 1 }, font: `${type}px system-ui, sans-serif` };
    const time = {
      ...axis, space: 6 * type, size: this.#isLast(panel) ? 1.7 * type : 4, label: this.#isLast(panel) ? "time" : undefined,
      labelSize: 1.8 * type, labelFont: axis.font, labelGap: type / 4, gap: 3,
      incrs: [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 18000, 36000],
      values: (_, marks, __, ___, step) =>
        marks.map(mark => (this.#isLast(panel) ? clockTime(mark, step < 0.1 ? 2 : step < 1 ? 1 : 0, this.data.end) : "")),
    };
    return {
      ...this.#size(panel), legend: { show: false }, padding: [type / 2, 2.4 * type, 0, 0],
      scales: { x: { time: false, auto: false }, y: { range: rangeOf(panel) } },
      axes: [time, { ...axis, size: 4 * type, space: 1.4 * type, gap: 3 }],
      series: [{}, ...panel.lines.map(([name], k) => ({
        stroke: colour(k ? "constant-line" : "ours"), width: type / 7, dash: k ? [type / 2, type / 3] : undefined, points: { show: false },
        paths: this.data.times.length > MOST_STEPS ? undefined : uPlot.paths.stepped({ align: 1 }),
      }))],
      cursor: {
        y: false, sync: { key: "evenlight" }, drag: { x: true, y: false, setScale: false }, points: { show: false },
        bind: { mousedown: (chart, _, usual) => event => { if (event.shiftKey) this.#move(chart, event); else usual(event); },
          dblclick: () => () => null },
      },
      hooks: {
        setCursor: [chart => chart.cursor.event && this.pointed(chart.cursor.left >= 0 ? this.#frameAt(chart) : null)],
        setSelect: [chart => this.#select(chart)],
        drawAxes: panel.limit ? [chart => this.#drawLimit(chart, panel.limit, colour("limit"))] : [],
      },
    };
  }
  #drawLimit(chart, limit, colour) {
    const { ctx, bbox } = chart;
    ctx.save();
    ctx.fillStyle = colour;
    for (const [from, to] of [[limit, chart.scales.y.max], [chart.scales.y.min, -limit]]) {
      const [bottom, top] = [from, to].map(value => chart.valToPos(value, "y", true));
      ctx.globalAlpha = 0.18;
      ctx.fillRect(bbox.left, top, bbox.width, bottom - top);
      ctx.globalAlpha = 1;
      ctx.fillRect(bbox.left, (to > 0 ? bottom : top) - 1, bbox.width, 2 * devicePixelRatio);
    }
    ctx.restore();
  }
  #frameAt(chart) { return lastAtMost(this.data.times, chart.posToVal(chart.cursor.left, "x")); }
  #fit() {
    if (parseFloat(getComputedStyle(document.documentElement).fontSize) !== this.type) return this.build();
    for (const panel of this.panels) panel.chart.setSize(this.#size(panel));
    this.mark(this.time);
  }
  #select(chart) {
    const { left, width } = chart.select;
    if (width < 5) return;
    this.show(chart.posToVal(left, "x"), chart.posToVal(left + width, "x"));
    for (const { chart: each } of this.panels) each.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  }
  #move(chart, { clientX }) {
    const [from, to] = this.range, scale = (to - from) / chart.over.clientWidth;
    const follow = event => this.show(from - scale * (event.clientX - clientX), to - scale * (event.clientX - clientX));
    const stop = () => { removeEventListener("mousemove", follow); removeEventListener("mouseup", stop); };
    addEventListener("mousemove", follow);
    addEventListener("mouseup", stop);
  }
  #wheel(chart, event) {
    if (!event.ctrlKey && !event.metaKey) return; // else the page could not be scrolled
    event.preventDefault();
    this.zoom(2 ** (-event.deltaY / 200), chart.posToVal(event.clientX - chart.over.getBoundingClientRect().left, "x"));
  }
  /** Show a range of time [s], cut to the video, at least a few frames of it. */
  show(from, to) {
    const [first, last] = this.whole, least = FEWEST_FRAMES * (last - first) / this.data.times.length;
    const long = Math.min(Math.max(to - from, least), last - first);
    const start = Math.min(Math.max(from + (to - from - long) / 2, first), last - long);
    this.range = [start, start + long];
    for (const { chart } of this.panels) chart.setScale("x", { min: start, max: start + long });
    this.mark(this.time);
  }
  /** Show a part of the range in view, or more of it, around a moment. */
  zoom(times, around = this.time) {
    const [from, to] = this.range;
    this.show(around - (around - from) / times, around + (to - around) / times);
  }
  /** Mark the moment of the picture; the range in view follows it if it was `sought`, or in view before. */
  mark(time, sought = false) {
    const [from, to] = this.range, inView = moment => moment >= from && moment <= to;
    const follows = time !== this.time && !inView(time) && (sought || inView(this.time));
    this.time = time;
    if (follows) return this.show(...(time > to ? [time, time + to - from] : [time - to + from, time]));
    for (const { now } of this.panels) {
      now.hidden = !inView(time);
      now.style.left = `${(time - from) / (to - from) * 100}%`;
    }
  }
  /** Write the numbers of a frame into the headings, and return them as text. */
  read(frame) {
    return this.panels.map(panel => panel.name + ": " + panel.lines.map(([name, values], k) => {
      const words = values[frame].toFixed(panel.digits) + panel.unit;
      panel.numbers[k].lastChild.textContent = words;
      return `${SAID[name]} ${words}`;
    }).join(", ")).join("; ");
  }
}
