// What WebGL holds and how it is drawn: grid, returns, solids.

const RINGS_M = [5, 10, 20, 30, 50, 75, 100, 150, 200];
const AXES = [[[1, 0, 0], "#ff9d94", "x"], [[0, 1, 0], "#b5dd85", "y"], [[0, 0, 1], "#a6b8ff", "z"]];
const BACKGROUND = [14 / 255, 17 / 255, 22 / 255];

class Scene {
  constructor(canvas) {
    this.canvas = canvas;
    this.gl = canvas.getContext("webgl2", { antialias: true, alpha: false, powerPreference: "low-power" });
    if (!this.gl) throw new Error("no WebGL 2");
    this.rebuild();
  }

  // All that is lost with the context.
  rebuild() {
    const gl = this.gl;
    this.programs = Object.fromEntries(Object.entries(SHADERS).map(([name, texts]) => [name, program(gl, texts)]));
    this.points = this.layout([[0, 3, gl.FLOAT], [1, 4, gl.UNSIGNED_BYTE]]);
    this.grid = this.layout([[0, 3, gl.FLOAT], [1, 4, gl.UNSIGNED_BYTE]]);
    this.bodies = {};
    for (const [kind, make] of Object.entries(BODIES)) {
      const { faces, edges } = make();
      const bare = [];
      for (let i = 0; i < edges.length; i += 3) bare.push(edges[i], edges[i + 1], edges[i + 2], 0, 0, 1);
      this.bodies[kind] = { faces: this.body(faces), edges: this.body(bare), count: 0 };
    }
    this.count = 0;
    this.drawGrid(50);
  }

  // An array object with one buffer for each attribute [place, parts, type].
  layout(attributes) {
    const gl = this.gl, array = gl.createVertexArray(), buffers = {};
    gl.bindVertexArray(array);
    for (const [place, parts, type] of attributes) {
      buffers[place] = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[place]);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, parts, type, type === gl.UNSIGNED_BYTE, 0, 0);
    }
    return { array, buffers, count: 0 };
  }

  body(vertices) {
    const gl = this.gl, array = gl.createVertexArray(), each = gl.createBuffer();
    gl.bindVertexArray(array);
    this.fill(gl.createBuffer(), new Float32Array(vertices));
    for (const [place, from] of [[0, 0], [1, 12]]) {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 24, from);
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, each);
    for (const [place, parts, from] of [[2, 3, 0], [3, 4, 12], [4, 3, 28], [5, 4, 40]]) {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, parts, gl.FLOAT, false, 56, from);
      gl.vertexAttribDivisor(place, 1);
    }
    return { array, each, vertices: vertices.length / 6 };
  }

  fill(buffer, data) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, data, this.gl.DYNAMIC_DRAW);
  }

  setPoints(positions, colours) {
    this.fill(this.points.buffers[0], positions);
    this.fill(this.points.buffers[1], colours);
    this.points.count = positions.length / 3;
  }

  // Solids as {kind, centre, turn, size, rgb, strength}, each drawn with its kind.
  setSolids(solids) {
    this.count = solids.length;
    for (const [kind, body] of Object.entries(this.bodies)) {
      const own = solids.filter((solid) => solid.kind === Number(kind));
      const data = new Float32Array(14 * own.length);
      own.forEach((solid, i) => {
        const colour = solid.rgb.map((part) => part / 255);
        data.set([...solid.centre, ...solid.turn, ...solid.size, ...colour, solid.strength], 14 * i);
      });
      body.count = own.length;
      this.fill(body.faces.each, data);
      this.fill(body.edges.each, data);
    }
  }

  // Circles on the sensor's plane out to `reach`, and its axes.
  drawGrid(reach) {
    const positions = [], colours = [];
    const line = (from, to, colour, opacity) => {
      positions.push(...from, ...to);
      colours.push(...colour, opacity, ...colour, opacity);
    };
    this.rings = RINGS_M.filter((radius) => radius <= reach * 1.05);
    for (const radius of this.rings) {
      for (let i = 0; i < 128; i++) line(...[i, i + 1].map((k) => times([Math.cos(k * Math.PI / 64), Math.sin(k * Math.PI / 64), 0], radius)), [120, 140, 160], 80);
    }
    const far = this.rings[this.rings.length - 1] ?? reach;
    for (const [x, y] of [[1, 0], [0, 1]]) line([-far * x, -far * y, 0], [far * x, far * y, 0], [120, 140, 160], 45);
    for (const [axis, colour] of AXES) line([0, 0, 0], times(axis, reach / 16), rgb(colour), 255);
    this.fill(this.grid.buffers[0], new Float32Array(positions));
    this.fill(this.grid.buffers[1], new Uint8Array(colours));
    this.grid.count = positions.length / 3;
    this.axis = reach / 16;
  }

  // Draws it all; `size` is that of a return in pixels.
  draw(view, size, solids) {
    const gl = this.gl;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(...BACKGROUND, 1);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    this.use("points", view);
    gl.uniform1f(this.programs.points.places.size, size);
    gl.uniform1f(this.programs.points.places.reach, view.distance);
    this.show(this.points, gl.POINTS);
    gl.depthMask(false);
    this.use("lines", view);
    this.show(this.grid, gl.LINES);
    if (!solids) return;
    const { places } = this.use("solids", view);
    gl.uniform3fv(places.eye, view.eye);
    gl.enable(gl.CULL_FACE);
    for (const side of [gl.FRONT, gl.BACK]) {
      gl.cullFace(side);
      gl.uniform1f(places.edge, 0);
      for (const body of Object.values(this.bodies)) this.instances(body.faces, gl.TRIANGLES, body.count);
    }
    gl.disable(gl.CULL_FACE);
    gl.uniform1f(places.edge, 1);
    for (const body of Object.values(this.bodies)) this.instances(body.edges, gl.LINES, body.count);
  }

  use(name, view) {
    const chosen = this.programs[name];
    this.gl.useProgram(chosen.made);
    this.gl.uniformMatrix4fv(chosen.places.matrix, false, view.matrix);
    return chosen;
  }

  show(layout, mode) {
    this.gl.bindVertexArray(layout.array);
    this.gl.drawArrays(mode, 0, layout.count);
  }

  instances({ array, vertices }, mode, count) {
    if (count === 0) return;
    this.gl.bindVertexArray(array);
    this.gl.drawArraysInstanced(mode, 0, vertices, count);
  }

  // Pixels of the picture just drawn that are not background, and what WebGL complains of (0: nothing).
  checked() {
    const gl = this.gl, { width, height } = this.canvas;
    const pixels = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    const ground = BACKGROUND.map((part) => Math.round(part * 255));
    let lit = 0;
    for (let i = 0; i < pixels.length; i += 4) lit += ground.some((part, k) => Math.abs(pixels[i + k] - part) > 2);
    return { lit, gl: gl.getError() };
  }
}
