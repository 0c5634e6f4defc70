// The scene's three programs: discs, instanced solids (faces and edges), lines.

const SHADERS = {
  points: [`#version 300 es
    uniform mat4 matrix; uniform float size, reach;
    layout(location=0) in vec3 position; layout(location=1) in vec4 colour;
    out vec3 tint;
    void main() {
      gl_Position = matrix * vec4(position, 1.0);
      if (colour.a < 0.5) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
      gl_PointSize = max(size * clamp(reach / gl_Position.w, 0.6, 2.2), 1.0);
      tint = colour.rgb;
    }`, `#version 300 es
    precision mediump float;
    in vec3 tint; out vec4 pixel;
    void main() {
      vec2 from = gl_PointCoord - 0.5;
      if (dot(from, from) > 0.25) discard;
      pixel = vec4(tint, 1.0);
    }`],
  solids: [`#version 300 es
    uniform mat4 matrix; uniform vec3 eye; uniform float edge;
    layout(location=0) in vec3 position; layout(location=1) in vec3 normal;
    layout(location=2) in vec3 centre; layout(location=3) in vec4 turn; layout(location=4) in vec3 size;
    layout(location=5) in vec4 colour;
    out vec4 tint;
    vec3 turned(vec3 v) { vec3 t = 2.0 * cross(turn.yzw, v); return v + turn.x * t + cross(turn.yzw, t); }
    void main() {
      vec3 at = centre + turned(position * size);
      gl_Position = matrix * vec4(at, 1.0);
      vec3 n = normalize(turned(normal / max(size, vec3(1e-3))));
      float facing = abs(dot(n, normalize(eye - at)));
      float sun = 0.5 + 0.5 * dot(n, normalize(vec3(0.4, 0.3, 0.85)));
      vec3 shaded = colour.rgb * (0.45 + 0.35 * sun + 0.2 * facing);
      vec4 face = vec4(shaded, mix(0.52, 0.24, facing) * colour.a);
      vec4 line = vec4(mix(colour.rgb, vec3(1.0), 0.25), 0.9 * colour.a);
      tint = edge > 0.5 ? line : face;
    }`, `#version 300 es
    precision mediump float;
    in vec4 tint; out vec4 pixel;
    void main() { pixel = tint; }`],
  lines: [`#version 300 es
    uniform mat4 matrix;
    layout(location=0) in vec3 position; layout(location=1) in vec4 colour;
    out vec4 tint;
    void main() { gl_Position = matrix * vec4(position, 1.0); tint = colour; }`, `#version 300 es
    precision mediump float;
    in vec4 tint; out vec4 pixel;
    void main() { pixel = tint; }`],
};

function program(gl, [vertex, fragment]) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(made));
  const places = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(made, i);
    places[name] = gl.getUniformLocation(made, name);
  }
  return { made, places };
}
