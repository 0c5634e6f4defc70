// What stands over the scene: distances on the rings, axes, tracks, names of obstacles, the mark round the one that is picked.

// Height that a line of words takes [px].
const WORD_PX = 13;

// Words that do not cover each other: who comes first has the better place.
class Words {
  constructor(pen, width) {
    Object.assign(this, { pen, width, taken: [] });
  }

  // Writes at the first of these distances below a place [px] where there is room; nowhere if there is none, unless it must.
  put(text, at, colour, below, must = false) {
    if (!at) return;
    const { pen, taken } = this, half = pen.measureText(text).width / 2 + 2;
    const x = must ? Math.max(half, Math.min(at[0], this.width - half)) : at[0];
    const boxes = below.map((down) => [x - half, at[1] + down - WORD_PX, x + half, at[1] + down + 2]);
    const free = boxes.findIndex((a) => taken.every((b) => a[2] <= b[0] || a[0] >= b[2] || a[3] <= b[1] || a[1] >= b[3]));
    if (free < 0 && !must) return;
    taken.push(boxes[Math.max(free, 0)]);
    const y = at[1] + below[Math.max(free, 0)];
    pen.lineWidth = 3;
    pen.strokeStyle = "#0e1116";
    pen.strokeText(text, x, y);
    pen.fillStyle = colour;
    pen.fillText(text, x, y);
  }
}

class Overlay {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
  }

  // `tracks` are those to be drawn, `colourOf` says in which colour.
  draw(scene, view, clusters, picked, classes, tracks, colourOf) {
    const { pen, canvas } = this, scale = devicePixelRatio;
    const [width, height] = [canvas.width / scale, canvas.height / scale];
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.textAlign = "center";
    const words = new Words(pen, width), place = (at) => projected(view.matrix, at, width, height);
    drawTracks(pen, tracks, place, colourOf);
    nameTracks(pen, tracks.filter((track) => track.alert), place, colourOf, words);
    if (picked) this.mark(picked, place, height, classes[picked.kind], words);
    nameTracks(pen, tracks.filter((track) => !track.alert), place, colourOf, words);
    pen.font = "11px system-ui, sans-serif";
    for (const cluster of clusters) {
      if (cluster === picked) continue;
      words.put(`${classes[cluster.kind].name} ${percent(cluster.sure)}`, place(cluster.solid?.centre ?? cluster.at), classes[cluster.kind].colour, [-10, -23, 30]);
    }
    const side = Math.SQRT1_2;
    for (const radius of scene.rings) words.put(`${radius} m`, place([-radius * side, -radius * side, 0]), "#7f8d9c", [0]);
    for (const [axis, colour, name] of AXES) words.put(name, place(times(axis, scene.axis * 1.25)), colour, [0]);
  }

  mark(cluster, place, height, { name, colour }, words) {
    const p = place(cluster.solid?.centre ?? cluster.at);
    if (!p) return;
    const radius = Math.max(12, 0.7 * (cluster.size || 0.5) * height / (2 * Math.tan(FOV / 2) * p[2]));
    const { pen } = this;
    pen.strokeStyle = "#ffffffc0";
    pen.lineWidth = 1.5;
    pen.setLineDash([5, 4]);
    pen.beginPath();
    pen.arc(p[0], p[1], radius, 0, 2 * Math.PI);
    pen.stroke();
    pen.setLineDash([]);
    pen.font = "600 12px system-ui, sans-serif";
    const tracks = cluster.tracks ?? (cluster.id === undefined ? [] : [cluster]);
    const text = cluster.kind > 0 ? `${name} ${percent(cluster.sure)}` : name;
    words.put([text, ...tracks.map((track) => `#${track.id}`)].join(" · "), p, colour, [-radius - 7], true);
  }
}
