// What a return is coloured by. Ramps are dark to bright through blue and yellow (after cividis), so that they read without
// telling red from green.

const RAMP = [[36, 62, 120], [65, 85, 124], [92, 108, 124], [122, 131, 123], [156, 155, 113], [193, 182, 98], [232, 210, 82], [255, 236, 110]];
const NO_CLUSTER = [74, 84, 96];
const RAMPED = { ring: "ring", intensity: "intensity", range: "range m", height: "height m" };

const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));

function ramp(share) {
  const at = Math.min(Math.max(share, 0), 1) * (RAMP.length - 1);
  const low = Math.min(Math.floor(at), RAMP.length - 2);
  return RAMP[low].map((value, i) => Math.round(value + (RAMP[low + 1][i] - value) * (at - low)));
}

// A colour of its own for each cluster number: hues a golden angle apart, in three brightnesses.
function clusterColour(number) {
  const hue = (number * 137.508) % 360, light = [0.72, 0.62, 0.82][number % 3];
  const part = (n) => {
    const k = (n + hue / 30) % 12;
    return Math.round(255 * (light - 0.62 * Math.min(light, 1 - light) * Math.max(-1, Math.min(k - 3, 9 - k, 1))));
  };
  return [part(0), part(8), part(4)];
}

// Ends of a ramp: the second and ninety-eighth hundredth, so that one stray return does not flatten the rest.
function ends(values) {
  if (values.length === 0) return [0, 1];
  const sorted = Float64Array.from(values).sort();
  const at = (share) => sorted[Math.round(share * (sorted.length - 1))];
  const [low, high] = [at(0.02), at(0.98)];
  return high > low ? [low, high] : [low, low + 1];
}

// Red, green, blue and opacity of every return, and the ends of the ramp where one is used.
function pointColours(sweep, by, classes, hidden, picked) {
  const out = new Uint8Array(4 * sweep.count);
  const values = RAMPED[by] ? sweep[by] : null;
  const [low, high] = values ? ends(values) : [0, 1];
  const ofCluster = sweep.clusters.map((cluster) => by === "cluster" ? clusterColour(cluster.number) : classes[cluster.kind].rgb);
  for (let i = 0; i < sweep.count; i++) {
    const number = sweep.cluster[i];
    const cluster = sweep.clusters[number];
    let colour = cluster && !(by === "cluster" && cluster.points < 2) ? ofCluster[number] : NO_CLUSTER;
    if (values) colour = ramp((values[i] - low) / (high - low));
    if (number === picked && cluster) colour = [255, 255, 255];
    out.set(colour, 4 * i);
    out[4 * i + 3] = hidden.has(cluster ? cluster.kind : 0) ? 0 : 255;
  }
  return { colours: out, ends: values ? [low, high] : null };
}
