// What the reader does: buttons, keys, divider; and what follows from it.

const $ = id => document.getElementById(id);
const NEAR = 1; // [s] from a frame with a map, its map is laid over the picture
const NEXT = { full: "ours", ours: "constant", constant: "full" }; // what is right of the divider
const arrayOf = (text, kind) => new kind(Uint8Array.from(atob(text), letter => letter.charCodeAt(0)).buffer);

const data = JSON.parse($("data").textContent);
$("data").remove(); // it may be large
for (const name of ["factors", "loss", "constantLoss", "rate", "power", "constantPower"]) data[name] &&= arrayOf(data[name], Float32Array);
data.times = arrayOf(data.times, Float64Array);
for (const part of [data.picture, data.contrast]) {
  for (const name of ["frames", "times"]) if (part?.[name]) part[name] = arrayOf(part[name], Float64Array);
}
const last = data.times.length - 1;
const state = { frame: 0, pictured: -1, pointed: null, layout: innerWidth > 700 ? "side" : "divider", version: "ours", divider: 0.5, map: -1 };
const panes = Object.fromEntries([...document.querySelectorAll("figure")].map(figure => [figure.dataset.version, {
  figure, name: figure.dataset.name, canvas: figure.querySelector("canvas"), words: figure.querySelector("figcaption"),
}]));

let renderer = null, sheet = null, film = null;
const plots = new Plots($("plots"), data, frame => { state.pointed = frame; tell(); }, seek);

/** Say why there is no picture, and leave out all that is about one. */
function withoutPicture(why) {
  $("trouble").textContent = `No picture: this browser ${why}. The plots below work.`;
  $("trouble").hidden = false;
  for (const id of ["loading", "panes", "choices", "notes"]) $(id).hidden = true;
}

/** Set the picture up; without WebGL or a video that plays, the rest works all the same. */
async function begin() {
  const { width, height, times, url } = data.picture;
  $("panes").style.setProperty("--shape", width / height);
  try {
    renderer = new Renderer(width, height, data.gamma);
    renderer.onReturn(() => { state.map = -1; film.seek(state.frame); });
    for (const { canvas } of Object.values(panes)) Object.assign(canvas, { width, height });
  } catch {
    withoutPicture("does not offer WebGL, which dims it");
  }
  const still = picture => new StillFilm(picture, data.picture, data, shown);
  if (times) {
    const blob = await (await fetch(url)).blob();
    const failed = () => {
      withoutPicture("cannot play the video in this page");
      film = still(null);
      film.seek(state.frame);
    };
    film = new VideoFilm(URL.createObjectURL(blob), data.picture, { shown, changed: follow, failed });
  } else {
    film = still(await pictureOf(url));
    film.seek(0);
  }
  sheet = await pictureOf(data.contrast.url);
  $("map-choice").hidden = !sheet || !renderer;
}

async function pictureOf(url) {
  const image = new Image();
  image.src = url;
  await image.decode();
  return image;
}

/** A picture is there: that of one place in the film, and of one frame of the video. */
function shown(place, image, frame = data.picture.frames[place]) {
  $("loading").hidden = true;
  const covers = () => lastAtMost(data.picture.frames, state.frame) === place;
  if (film.playing || (!covers() && !film.seeking)) state.frame = frame;
  state.pictured = covers() ? state.frame : frame; // of an earlier place while the one that is sought is on its way
  if (image && renderer) renderer.take(image);
  draw();
  follow();
}

function seek(frame) {
  state.frame = Math.min(Math.max(Math.round(frame), 0), last);
  film?.seek(state.frame);
  follow();
}

const colour = () => getComputedStyle(document.documentElement).getPropertyValue("--lost").trim().match(/\w\w/g).map(two => parseInt(two, 16) / 255);

/** Return the place of the map that belongs to the picture, or -1; it is ready to be drawn. */
function mapOfPicture() {
  if (!$("map").checked || !sheet) return -1;
  const place = nearest(data.contrast.frames, state.pictured);
  if (Math.abs(data.times[data.contrast.frames[place]] - data.times[state.pictured]) > NEAR) return -1;
  if (place !== state.map) renderer.take(tileOf(sheet, data.contrast, state.map = place), 1);
  return place;
}

/** Draw the versions of the picture that are shown. */
function draw() {
  if (!renderer || state.pictured < 0) return;
  const reflected = $("reflected").value / data.lightRange, mapped = mapOfPicture();
  const version = name => renderer.draw(name, { full: 1, ours: data.factors[state.pictured], constant: data.constantFactor }[name],
    reflected, mapped >= 0 && colour());
  for (const [name, { canvas, figure }] of Object.entries(panes)) {
    if (figure.hidden) continue;
    const paper = canvas.getContext("2d"), cut = Math.round(state.divider * canvas.width);
    paper.drawImage(version(name), 0, 0);
    if (state.layout === "divider" && cut < canvas.width) {
      const rest = [cut, 0, canvas.width - cut, canvas.height];
      paper.drawImage(version(NEXT[name]), ...rest, ...rest);
    }
    canvas.dataset.frame = state.pictured;
  }
}

/** Bring everything but the picture to the frame of now. */
function follow() {
  const time = data.times[state.frame];
  $("seek").value = state.frame;
  $("seek").setAttribute("aria-valuetext", `${clockTime(time, 2, data.end)}, frame ${state.frame}`);
  $("time").textContent = clockTime(time, 2, data.end);
  $("frame").textContent = state.frame;
  $("play").textContent = film?.playing ? "Pause" : "Play";
  plots.mark(time, !film?.playing);
  tell();
}

/** Write the numbers of the frame under the pointer, or of that of the picture. */
function tell() {
  const frame = state.pointed ?? state.frame;
  $("where").textContent = `${clockTime(data.times[frame], 2, data.end)}, frame ${frame}${state.pointed === null ? "" : ", under the pointer"}`;
  state.numbers = plots.read(frame);
  caption();
}

/** Say below each picture what it shows. */
function caption() {
  const lost = { full: 0, ours: data.loss[state.frame], constant: data.constantLoss[state.frame] };
  const factor = { full: 1, ours: data.factors[state.frame], constant: data.constantFactor };
  const named = name => {
    const words = document.createElement("span");
    words.innerHTML = `<b class="${name}">${panes[name].name}</b> b = ${factor[name].toFixed(3)}, loss ${lost[name].toFixed(1)} %`;
    return words;
  };
  for (const [name, { words }] of Object.entries(panes)) {
    words.replaceChildren(...(state.layout === "divider" ? [name, NEXT[name]] : [name]).map(named));
  }
  if (!$("map").checked || !sheet) return;
  const at = data.contrast.frames[nearest(data.contrast.frames, state.frame)], far = Math.abs(data.times[at] - data.times[state.frame]) > NEAR;
  $("mapped").textContent = `Lost: finest detail only; the loss above counts all sizes of detail. ${far ? "No map here; the nearest is" : "Map"} of the frame at ` +
    `${clockTime(data.times[at], 2, data.end)} (frame ${at}), one of ${data.contrast.frames.length} with a map. `;
}

/** Arrange the pictures as chosen. */
function arrange() {
  $("panes").dataset.layout = state.layout;
  for (const kind of ["layout", "version"]) document.querySelector(`[name=${kind}][value=${state[kind]}]`).checked = true;
  if (state.layout === "side") document.querySelector("[name=version]:checked").checked = false; // all are shown
  for (const [name, { figure }] of Object.entries(panes)) figure.hidden = state.layout !== "side" && name !== state.version;
  $("divider").hidden = state.layout !== "divider";
  const left = state.layout === "divider" ? state.version : "ours";
  $("pair").textContent = `${SAID[left]} | ${SAID[NEXT[left]]}`;
  panes[state.version].figure.querySelector(".screen").append($("divider"));
  $("legend").hidden = !$("map").checked || !sheet;
  $("reflected-value").textContent = `${(+$("reflected").value).toFixed(1)} cd/m²`;
  divide(state.divider);
  follow();
}

function divide(share) {
  state.divider = Math.min(Math.max(share, 0), 1);
  const percent = Math.round(100 * state.divider);
  $("divider").style.left = `${100 * state.divider}%`;
  $("divider").setAttribute("aria-valuenow", percent);
  $("divider").setAttribute("aria-valuetext", `${percent} % ${SAID[state.version]}, ${100 - percent} % ${SAID[NEXT[state.version]]}`);
  draw();
}

function toggle() {
  if (film.playing) film.pause(); else film.play();
  follow();
}

function choose(kind, value) {
  state[kind] = value;
  if (value === "divider") state.version = "ours";
  if (kind === "version" && state.layout === "side") state.layout = "one";
  arrange();
}

/** Show where contrast is lost; if no map is near the picture, go to the nearest. */
function chooseMap() {
  arrange();
  const { frames } = data.contrast;
  if ($("map").checked && mapOfPicture() < 0) seek(frames[nearest(frames, state.frame)]);
}

function goToMap(step) {
  const { frames } = data.contrast, k = lastAtMost(frames, state.frame);
  const place = step > 0 ? (frames[0] > state.frame ? 0 : k + 1) : frames[k] < state.frame ? k : k - 1;
  seek(frames[Math.min(Math.max(place, 0), frames.length - 1)]);
}

function secondOn(sign) {
  const time = data.times[state.frame] + sign;
  seek(sign > 0 ? Math.max(lastAtMost(data.times, time), state.frame + 1) : Math.min(lastAtMost(data.times, time), state.frame - 1));
}

const KEYS = {
  " ": toggle,
  ArrowLeft: event => (event.shiftKey ? secondOn(-1) : seek(state.frame - 1)),
  ArrowRight: event => (event.shiftKey ? secondOn(1) : seek(state.frame + 1)),
  Home: () => seek(0),
  End: () => seek(last),
  1: () => choose("version", "full"),
  2: () => choose("version", "ours"),
  3: () => choose("version", "constant"),
  s: () => choose("layout", "side"),
  d: () => choose("layout", state.layout === "divider" ? "one" : "divider"),
  c: () => { if (!$("map-choice").hidden) $("map").click(); },
  "+": () => plots.zoom(2),
  "=": () => plots.zoom(2),
  "-": () => plots.zoom(0.5),
  0: () => plots.show(...plots.whole),
  n: readOut,
  "?": () => $("keys").showModal(),
};

function readOut() { $("spoken").textContent = `${$("where").textContent}. ${state.numbers}.`; }

addEventListener("keydown", event => {
  if (event.ctrlKey || event.metaKey || event.altKey || $("keys").open) return;
  const own = event.target.closest("button, summary, input[type=checkbox], #divider, #reflected, fieldset"); // their own keys
  const taken = own && (event.key === " " || (event.key.startsWith("Arrow") || event.key === "Home" || event.key === "End") && own.matches("#divider, #reflected, fieldset"));
  const act = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (taken || !act) return;
  event.preventDefault();
  act(event);
});

$("divider").addEventListener("keydown", event => {
  const step = { ArrowLeft: -0.01, ArrowDown: -0.01, ArrowRight: 0.01, ArrowUp: 0.01, PageDown: -0.1, PageUp: 0.1, Home: -1, End: 1 }[event.key];
  if (!step) return;
  event.preventDefault();
  divide(state.divider + step * (event.shiftKey ? 10 : 1));
});
for (const { canvas } of Object.values(panes)) {
  const screen = canvas.parentElement;
  const drag = event => {
    if (state.layout !== "divider" || !(event.buttons & 1)) return;
    const box = canvas.getBoundingClientRect();
    divide((event.clientX - box.left) / box.width);
  };
  screen.addEventListener("pointerdown", event => { screen.setPointerCapture(event.pointerId); drag(event); });
  screen.addEventListener("pointermove", drag);
  screen.addEventListener("click", () => { if (state.layout !== "divider") toggle(); });
}
for (const input of document.querySelectorAll("fieldset input")) input.addEventListener("change", () => choose(input.name, input.value));
$("seek").max = last;
$("end").textContent = clockTime(data.end, 2, data.end);
for (const [id, event, act] of [
  ["play", "click", toggle], ["back", "click", () => seek(state.frame - 1)], ["forward", "click", () => seek(state.frame + 1)],
  ["seek", "input", () => seek(+$("seek").value)], ["map", "change", chooseMap], ["reflected", "input", arrange],
  ["previous-map", "click", () => goToMap(-1)], ["next-map", "click", () => goToMap(1)],
  ["in", "click", () => plots.zoom(2)], ["out", "click", () => plots.zoom(0.5)], ["all", "click", () => plots.show(...plots.whole)],
  ["read", "click", readOut], ["help", "click", () => $("keys").showModal()], ["theme", "click", () => wear(dark() ? "light" : "dark")],
]) $(id).addEventListener(event, act);
$("plots").addEventListener("mouseleave", () => { state.pointed = null; tell(); });

const dark = () => document.documentElement.dataset.theme === "dark";
function wear(theme) {
  document.documentElement.dataset.theme = theme;
  $("theme").textContent = dark() ? "Light theme" : "Dark theme";
  plots.build();
  draw();
}
const wish = matchMedia("(prefers-color-scheme: dark)");
wish.addEventListener("change", () => wear(wish.matches ? "dark" : "light"));
wear(wish.matches ? "dark" : "light");
arrange();
await begin();
follow();
