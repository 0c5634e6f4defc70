// A camera that goes round a target with z up: mouse, touch and keys.

const FOV = 0.85;
const STEEPEST = Math.PI / 2 - 0.001;

class Camera {
  constructor(canvas, changed) {
    this.canvas = canvas;
    this.changed = changed;
    this.still = matchMedia("(prefers-reduced-motion: reduce)");
    this.pointers = new Map();
    this.pose = { target: [0, 0, 0], yaw: -2.2, pitch: 0.6, distance: 60 };
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.nearer(Math.exp(event.deltaY * (event.deltaMode ? 0.04 : 0.0012)));
    }, { passive: false });
  }

  // Looks at a field of this radius from afar.
  fit(reach, pose = {}) {
    this.reach ??= reach;
    const aspect = this.canvas.clientWidth / this.canvas.clientHeight || 1;
    const distance = Math.max(0.8, 1.05 / aspect) * reach / Math.tan(FOV / 2);
    this.fly({ target: [0, 0, 0], yaw: -2.2, pitch: 0.6, distance, ...pose });
  }

  // Goes to a pose, within 0.4 s; at once where motion is not wanted.
  fly(to, at_once = false) {
    const from = { ...this.pose }, end = { ...this.pose, ...to };
    this.flight = null;
    if (at_once || this.still.matches || !this.flown) {
      this.flown = true;
      this.pose = end;
      this.changed();
      return;
    }
    end.yaw = from.yaw + Math.atan2(Math.sin(end.yaw - from.yaw), Math.cos(end.yaw - from.yaw));
    this.flight = { from, end, start: performance.now() };
    this.changed();
  }

  // Moves on in a flight; says whether it goes on.
  step(now) {
    if (!this.flight) return false;
    const { from, end, start } = this.flight;
    const share = Math.min((now - start) / 400, 1), s = share * share * (3 - 2 * share);
    const between = (a, b) => a + (b - a) * s;
    this.pose = {
      target: from.target.map((value, i) => between(value, end.target[i])),
      yaw: between(from.yaw, end.yaw), pitch: between(from.pitch, end.pitch),
      distance: Math.exp(between(Math.log(from.distance), Math.log(end.distance))),
    };
    if (share === 1) this.flight = null;
    return share < 1;
  }

  // Matrix, eye and what else drawing needs, for a picture of these proportions.
  view(aspect) {
    const { target, yaw, pitch, distance } = this.pose;
    const back = [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
    const eye = add(target, times(back, distance));
    const matrix = product(perspective(FOV, aspect, Math.max(distance / 500, 0.05), distance * 4 + 400), looking(eye, target, [0, 0, 1]));
    const right = unit(cross([0, 0, 1], back)), up = cross(back, right);
    return { matrix, eye, right, up, forward: times(back, -1), aspect, distance };
  }

  turn(yaw, pitch) {
    this.flight = null;
    this.pose.yaw += yaw;
    this.pose.pitch = Math.min(Math.max(this.pose.pitch + pitch, -STEEPEST), STEEPEST);
    this.changed();
  }

  nearer(factor) {
    this.flight = null;
    this.pose.distance = Math.min(Math.max(this.pose.distance * factor, 0.3), 2000);
    this.changed();
  }

  pan(x, y) {
    this.flight = null;
    const { right, up } = this.view(1), scale = 2 * Math.tan(FOV / 2) * this.pose.distance / this.canvas.clientHeight;
    this.pose.target = add(this.pose.target, add(times(right, -x * scale), times(up, y * scale)));
    this.changed();
  }

  down(event) {
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    this.dragged = 0;
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY], [x, y] = [now[0] - before[0], now[1] - before[1]];
    this.dragged += Math.abs(x) + Math.abs(y);
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId);
    if (others.length > 0) {
      const [, other] = others[0];
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      this.nearer(apart(before) / apart(now));
      this.pan(x / 2, y / 2);
    } else if (event.shiftKey || (event.buttons & 6) !== 0) {
      this.pan(x, y);
    } else {
      this.turn(-x * 0.006, y * 0.006);
    }
    this.pointers.set(event.pointerId, now);
  }

  // Says whether the key was one of the camera's.
  key(event) {
    const step = 0.08;
    const moves = {
      a: () => this.turn(-step, 0), d: () => this.turn(step, 0), w: () => this.turn(0, step), s: () => this.turn(0, -step),
      "+": () => this.nearer(0.85), "=": () => this.nearer(0.85), "-": () => this.nearer(1 / 0.85),
      r: () => this.fit(this.reach), t: () => this.above(), f: () => this.level(),
    };
    moves[event.key.toLowerCase()]?.();
    return event.key.toLowerCase() in moves;
  }

  above() {
    this.fit(this.reach * 1.2, { yaw: -Math.PI / 2, pitch: STEEPEST });
  }

  level() {
    this.fit(this.reach, { yaw: -Math.PI / 2, pitch: 0.03 });
  }
}
