// const track = new Track(JSON.parse(text));  colour *= track.scaleAt(seconds);
export class Track {
  constructor({ times_s, factors, gamma }) {
    Object.assign(this, { times: times_s, factors, gamma });
  }
  factorAt(time) { // of the last frame that begins no later; before the first, of the first
    let low = 0, high = this.times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.times[middle] <= time) low = middle; else high = middle - 1;
    }
    return this.factors[low];
  }
  scaleAt(time) { return this.factorAt(time) ** (1 / this.gamma); } // of gamma-encoded values
}
