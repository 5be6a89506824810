// The picture: dimmed in linear light by a shader, with the room's reflected light and the map of lost contrast.

const VERTEX = `
attribute vec2 corner;
varying vec2 place;
void main() { place = vec2(corner.x, 1.0 - corner.y); gl_Position = vec4(2.0 * corner - 1.0, 0.0, 1.0); }`;

const FRAGMENT = `
precision highp float;
varying vec2 place;
uniform sampler2D frame, map;
uniform float gamma, factor, reflected;  // reflected light as a share of the display's range
uniform vec2 lost;  // which channel of the map is laid over the picture
uniform vec3 tint;
void main() {
  vec3 light = factor * pow(texture2D(frame, place).rgb, vec3(gamma));
  vec3 shown = pow((light + reflected) / (1.0 + reflected), vec3(1.0 / gamma));
  gl_FragColor = vec4(mix(shown, tint, 0.85 * dot(texture2D(map, place).rg, lost)), 1.0);
}`;

const CHANNEL = { full: [0, 0], ours: [1, 0], constant: [0, 1] };

/** Draws versions of a frame into `canvas`. */
class Renderer {
  constructor(width, height, gamma) {
    this.canvas = Object.assign(document.createElement("canvas"), { width, height });
    this.gamma = gamma;
    const options = { alpha: false, antialias: false, depth: false };
    this.gl = this.canvas.getContext("webgl2", options) || this.canvas.getContext("webgl", options);
    if (!this.gl) throw new Error("no WebGL");
    this.canvas.addEventListener("webglcontextlost", event => event.preventDefault());
    this.#prepare();
  }
  /** Call `ready` once the graphics card is back, should it be lost. */
  onReturn(ready) {
    this.canvas.addEventListener("webglcontextrestored", () => { this.#prepare(); ready(); });
  }
  #prepare() {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([0, 0, 1, 0, 0, 1, 1, 1]), gl.STATIC_DRAW);
    const corner = gl.getAttribLocation(program, "corner");
    gl.enableVertexAttribArray(corner);
    gl.vertexAttribPointer(corner, 2, gl.FLOAT, false, 0, 0);
    this.at = name => gl.getUniformLocation(program, name);
    this.textures = [gl.createTexture(), gl.createTexture()];
    this.textures.forEach((texture, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
      for (const size of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, size, gl.LINEAR);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    });
    gl.uniform1i(this.at("frame"), 0);
    gl.uniform1i(this.at("map"), 1);
    gl.uniform1f(this.at("gamma"), this.gamma);
  }
  /** Take a picture (unit 0), or a map of lost contrast (unit 1), that the next drawings use. */
  take(image, unit = 0) {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
  }
  /** Draw a version of the frame; the map of what it loses is laid over it in the colour `tint`, if given. */
  draw(version, factor, reflected, tint) {
    const gl = this.gl;
    gl.uniform1f(this.at("factor"), factor);
    gl.uniform1f(this.at("reflected"), reflected);
    gl.uniform2fv(this.at("lost"), tint ? CHANNEL[version] : [0, 0]);
    gl.uniform3fv(this.at("tint"), tint || [0, 0, 0]);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    return this.canvas;
  }
}
