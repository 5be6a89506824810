// What is shown and when: a video or still pictures, frame by frame.

/** Return the place of the last entry of a rising list that is at most x; 0 if there is none. */
function lastAtMost(list, x) {
  let low = 0, high = list.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (list[middle] <= x) low = middle; else high = middle;
  }
  return low;
}

/** Return the entry of a rising list that is nearest to x. */
function nearest(list, x) {
  const k = lastAtMost(list, x);
  return k + 1 < list.length && list[k + 1] - x < x - list[k] ? k + 1 : k;
}

const SLACK = 5e-4; // [s] the browser may round a frame's time by this

/** A video whose frames are known by their times in its file: `shown(place, image)` is called for each,
 * `changed()` when it starts or stops, `failed()` if it cannot be played. */
class VideoFilm {
  constructor(url, picture, { shown, changed, failed }) {
    this.picture = picture;
    this.shown = shown;
    this.wanted = null;
    const video = this.video = document.createElement("video");
    video.muted = video.playsInline = true;
    video.preload = "auto";
    video.addEventListener("error", failed);
    for (const event of ["play", "pause", "ended"]) video.addEventListener(event, changed);
    const told = "requestVideoFrameCallback" in video; // of each frame when it is there; else the clock has to do
    video.addEventListener("seeked", () => {
      if (this.wanted !== null) this.#go(); else if (this.#placeAt(video.currentTime) === this.place) this.#present(video.currentTime);
    });
    const next = (_, frame) => {
      if (told) this.#present(frame.mediaTime); else if (!this.seeking) this.#present(video.currentTime);
      told ? video.requestVideoFrameCallback(next) : requestAnimationFrame(next);
    };
    if (told) video.requestVideoFrameCallback(next); else video.addEventListener("loadeddata", () => requestAnimationFrame(next));
    video.src = url;
  }
  get playing() { return !this.video.paused && !this.video.ended; }
  get seeking() { return this.video.seeking; }
  play() { this.video.play().catch(() => {}); } // refused where it is paused before it began
  pause() { this.video.pause(); }
  seek(frame) {
    this.wanted = frame;
    if (!this.video.seeking) this.#go();
  }
  #go() {
    const { frames, times } = this.picture, k = lastAtMost(frames, this.wanted);
    const after = k + 1 < times.length ? times[k + 1] : times[k] + (times[k] - (times[k - 1] ?? times[k]));
    this.wanted = null;
    this.video.currentTime = (times[k] + after) / 2;
  }
  #placeAt(time) { return lastAtMost(this.picture.times, time + SLACK); }
  #present(time) { this.shown(this.place = this.#placeAt(time), this.video); }
}

/** Still pictures of some frames on one sheet, in the place of a video; without a sheet, time alone. */
class StillFilm {
  constructor(sheet, picture, clock, shown) {
    Object.assign(this, { sheet, picture, clock, shown, frame: 0, began: null });
  }
  get playing() { return this.began !== null; }
  play() {
    const { times, end } = this.clock;
    const from = this.frame + 1 < times.length ? times[this.frame] : times[0];
    this.began = performance.now() - 1000 * from;
    const next = now => {
      if (!this.playing) return;
      const time = (now - this.began) / 1000;
      this.frame = lastAtMost(times, time);
      if (time >= end) this.began = null;
      this.#present();
      requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }
  pause() { this.began = null; }
  seek(frame) {
    this.frame = frame;
    if (this.playing) this.play();
    this.#present();
  }
  #present() {
    const place = lastAtMost(this.picture.frames, this.frame);
    this.shown(place, this.sheet && tileOf(this.sheet, this.picture, place), this.frame);
  }
}

/** Return one picture of a sheet, as a canvas. */
function tileOf(sheet, { width, height, columns }, place) {
  const canvas = Object.assign(document.createElement("canvas"), { width, height });
  const left = (place % columns) * width, top = Math.floor(place / columns) * height;
  canvas.getContext("2d").drawImage(sheet, left, top, width, height, 0, 0, width, height);
  return canvas;
}
