// Obstacles through time: what the columns say of them, and how they are drawn over the scene.

const STATES = ["tentative", "confirmed", "coasting"];
const STRENGTH = { tentative: 0.4, confirmed: 1, coasting: 0.7 };
// Time that an arrow spans [s].
const ARROW_S = 2;

// Tracks of a sweep in the order of danger, their clusters joined to them; null where they are not known.
function tracksOf(columns, clusters) {
  if (!columns.t_low) return null;
  let from = 0;
  return Array.from(columns.t_low, (low, i) => {
    const of = (...names) => names.map((name) => columns[name][i]);
    const size = of("t_a", "t_b", "t_c"), at = of("t_x", "t_y", "t_z"), velocity = of("t_u", "t_v", "t_w");
    const end = from + columns.t_trail[i], trail = [];
    for (; from < end; from++) trail.push([columns.r_x[from], columns.r_y[from], columns.r_z[from]]);
    const cluster = clusters[columns.t_cluster[i]] ?? null;
    const track = {
      id: columns.t_high[i] * 2 ** 24 + low, rank: i, number: -1, state: STATES[columns.t_state[i]], kind: columns.t_class[i],
      sure: columns.t_p[i], alert: columns.t_alert[i] > 0, age: columns.t_age[i], seen: columns.t_seen[i],
      at, velocity, speed: Math.hypot(...velocity), range: Math.hypot(...at), sigma: columns.t_sigma[i], speedSigma: columns.t_speed_sigma[i],
      time: columns.t_time[i], near: columns.t_near[i], nearSigma: columns.t_near_sigma[i], met: columns.t_met[i],
      size: Math.max(...size), solid: null, cluster, trail,
    };
    if (track.size > 0) track.solid = { centre: at, turn: of("t_qw", "t_qx", "t_qy", "t_qz"), size, sigma: track.sigma };
    // Several may be seen as one cluster: the most dangerous stands for it.
    if (cluster) {
      cluster.track ??= track;
      (cluster.tracks ??= []).push(track);
    }
    return track;
  });
}

const met = (p) => p > 0 && p < 0.001 ? "<0.001" : p.toFixed(3);

// The lines of a label.
function trackSaid(track) {
  const seen = track.state === "coasting" ? `, not seen for ${counted(track.seen, "sweep")}` : "";
  const lines = [`track ${track.id} · ${track.state}${seen} · ${counted(track.age, "sweep")} old`];
  lines.push(`${track.speed.toFixed(2)} ± ${track.speedSigma.toFixed(2)} m/s`);
  if (track.state === "tentative") return lines;
  const alert = track.alert ? "ALERT: " : "";
  lines.push(`${alert}closest ${track.near.toFixed(1)} ± ${track.nearSigma.toFixed(1)} m in ${track.time.toFixed(1)} s, met with p ${met(track.met)}`);
  return lines;
}

// Bodies of what was not seen in this sweep, for the scene.
function coastingBodies(tracks, hidden) {
  return tracks.filter((track) => track.solid && track.state === "coasting" && track.kind > 0 && !hidden.has(track.kind));
}

// Trails, arrows and rings; the most dangerous last, over all others. `place` gives where a place falls, or null.
function drawTracks(pen, tracks, place, colourOf) {
  pen.lineCap = pen.lineJoin = "round";
  for (const track of [...tracks].reverse()) {
    const strength = STRENGTH[track.state];
    pen.strokeStyle = pen.fillStyle = colourOf(track);
    drawTrail(pen, [track.at, ...track.trail].map(place), strength);
    pen.globalAlpha = strength;
    drawArrow(pen, place(track.at), place(add(track.at, times(track.velocity, ARROW_S))), track.state);
    if (track.alert) drawAlert(pen, place(track.at));
    pen.globalAlpha = 1;
  }
  pen.lineCap = "butt";
}

// Their numbers, the most dangerous first: an alert is always said, another number only where it covers nothing.
function nameTracks(pen, tracks, place, colourOf, words) {
  for (const track of tracks) {
    const sign = { tentative: "?", confirmed: "", coasting: "~" }[track.state];
    const danger = track.alert ? ` ALERT ${track.time.toFixed(1)} s, p ${met(track.met)}` : "";
    pen.font = track.alert ? "600 12px system-ui, sans-serif" : "11px system-ui, sans-serif";
    pen.globalAlpha = track.alert ? 1 : Math.max(STRENGTH[track.state], 0.6);
    words.put(`${sign}#${track.id}${danger}`, place(track.at), colourOf(track), track.alert ? [30, -20, 44, -34, 58, 72] : [20, -10, 33, -23], track.alert);
  }
  pen.globalAlpha = 1;
}

function drawTrail(pen, points, strength) {
  pen.lineWidth = 1.6;
  for (let i = 0; i + 1 < points.length; i++) {
    if (!points[i] || !points[i + 1]) continue;
    pen.globalAlpha = strength * (1 - i / points.length);
    pen.beginPath();
    pen.moveTo(points[i][0], points[i][1]);
    pen.lineTo(points[i + 1][0], points[i + 1][1]);
    pen.stroke();
  }
}

function drawArrow(pen, from, to, state) {
  if (!from || !to) return;
  const [x, y] = [to[0] - from[0], to[1] - from[1]], length = Math.hypot(x, y);
  if (length < 3) return;
  const [u, v] = [x / length, y / length], head = Math.min(7, length);
  pen.lineWidth = 2;
  pen.setLineDash(state === "coasting" ? [4, 4] : []);
  pen.beginPath();
  pen.moveTo(from[0], from[1]);
  pen.lineTo(to[0] - u * head, to[1] - v * head);
  pen.stroke();
  pen.setLineDash([]);
  pen.beginPath();
  pen.moveTo(to[0], to[1]);
  for (const side of [-1, 1]) pen.lineTo(to[0] - u * head - side * v * head * 0.45, to[1] - v * head + side * u * head * 0.45);
  pen.fill();
}

function drawAlert(pen, at) {
  if (!at) return;
  pen.lineWidth = 2.5;
  pen.beginPath();
  pen.arc(at[0], at[1], 15, 0, 2 * Math.PI);
  pen.stroke();
}
