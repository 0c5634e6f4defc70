// What lies under the pointer: a return within a few pixels, else the nearest solid that the ray meets.

const NEAR_PX = 5;

function pick(sweep, view, x, y, width, height, hidden, solids, coasting) {
  const point = nearestReturn(sweep, view.matrix, x, y, width, height, hidden);
  if (point >= 0) return { point, cluster: sweep.clusters[sweep.cluster[point]] ?? null };
  const tan = Math.tan(FOV / 2), u = (2 * x / width - 1) * tan * view.aspect, v = (1 - 2 * y / height) * tan;
  const ray = unit(add(view.forward, add(times(view.right, u), times(view.up, v))));
  let best = null, nearest = Infinity;
  // Also what coasts, where tracks are drawn.
  for (const cluster of solids ? [...sweep.clusters, ...coasting] : []) {
    if (!cluster.solid || hidden.has(cluster.kind)) continue;
    const met = boxMet(cluster.solid, view.eye, ray);
    if (met < nearest) [best, nearest] = [cluster, met];
  }
  return best ? { point: -1, cluster: best } : null;
}

function nearestReturn(sweep, m, x, y, width, height, hidden) {
  const p = sweep.positions;
  let best = -1, nearest = NEAR_PX ** 2, depth = Infinity;
  for (let i = 0; i < sweep.count; i++) {
    const [a, b, c] = [p[3 * i], p[3 * i + 1], p[3 * i + 2]];
    const w = m[3] * a + m[7] * b + m[11] * c + m[15];
    if (w <= 0) continue;
    const dx = ((m[0] * a + m[4] * b + m[8] * c + m[12]) / w + 1) * width / 2 - x;
    const dy = (1 - (m[1] * a + m[5] * b + m[9] * c + m[13]) / w) * height / 2 - y;
    const far = dx * dx + dy * dy;
    if (far > nearest || (far === nearest && w > depth)) continue;
    if (hidden.has(sweep.clusters[sweep.cluster[i]]?.kind ?? 0)) continue;
    [best, nearest, depth] = [i, far, w];
  }
  return best;
}

// Distance at which a ray meets a solid's box; Infinity where it does not.
function boxMet({ centre, turn, size }, eye, ray) {
  const from = turned(turn, less(eye, centre), true), along = turned(turn, ray, true);
  let enter = 0, leave = Infinity;
  for (let axis = 0; axis < 3; axis++) {
    const ends = [-1, 1].map((side) => (side * size[axis] / 2 - from[axis]) / along[axis]);
    enter = Math.max(enter, Math.min(...ends));
    leave = Math.min(leave, Math.max(...ends));
  }
  return enter <= leave ? enter : Infinity;
}

// The lines of a label: the first is its title.
function said(sweep, { point, cluster }, classes) {
  const lines = [];
  if (cluster?.id !== undefined) {
    const { kind, sure, range, solid } = cluster;
    lines.push(kind > 0 ? `${classes[kind].name} ${percent(sure)}` : classes[0].name, ...trackSaid(cluster));
    lines.push(`${range.toFixed(2)} m away`, `${sizeOf(solid)} m, centre ± ${solid.sigma.toFixed(2)} m`);
  } else if (cluster) {
    const { kind, posterior, solid } = cluster;
    lines.push(kind > 0 ? `${classes[kind].name} ${percent(cluster.sure)}` : classes[0].name);
    if (kind > 0) {
      const others = posterior.map((p, i) => [p, i + 1]).filter(([p, i]) => i !== kind && p >= 0.005).sort((a, b) => b[0] - a[0]);
      if (others.length > 0) lines.push(others.map(([p, i]) => `${classes[i].name} ${percent(p)}`).join(", "));
    }
    lines.push(`cluster ${cluster.number} · ${counted(cluster.points, "return")}${cluster.rings > 0 ? ` on ${counted(cluster.rings, "ring")}` : ""}`);
    lines.push(`${cluster.range.toFixed(2)} m away`);
    if (solid) lines.push(`${sizeOf(solid)} m, centre ± ${solid.sigma.toFixed(2)} m`);
    for (const track of cluster.tracks ?? []) lines.push(...trackSaid(track));
  } else {
    lines.push("in no cluster");
  }
  if (point >= 0) {
    const p = sweep.positions.subarray(3 * point, 3 * point + 3);
    lines.push(`return ${Array.from(p, (value) => value.toFixed(2)).join(", ")} m`);
    lines.push(`ring ${sweep.ring[point]} · intensity ${sweep.intensity[point]}`);
  }
  return lines;
}

const percent = (share) => `${Math.round(100 * share)} %`;
const counted = (n, what) => `${n.toLocaleString("en")} ${what}${n === 1 ? "" : "s"}`;
const sizeOf = ({ size }) => size.map((value) => value.toFixed(2)).join(" × ");
