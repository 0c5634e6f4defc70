// What stands over the scene: distances on the rings, axes, tracks, names of obstacles, the mark round the one that is picked.

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
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "center";
    const word = (text, at, colour, up = 0) => {
      const p = projected(view.matrix, at, width, height);
      if (!p) return;
      pen.lineWidth = 3;
      pen.strokeStyle = "#0e1116";
      pen.strokeText(text, p[0], p[1] - up);
      pen.fillStyle = colour;
      pen.fillText(text, p[0], p[1] - up);
    };
    drawTracks(pen, tracks, (at) => projected(view.matrix, at, width, height), colourOf, word);
    pen.font = "11px system-ui, sans-serif";
    const side = Math.SQRT1_2;
    for (const radius of scene.rings) word(`${radius} m`, [-radius * side, -radius * side, 0], "#7f8d9c");
    for (const [axis, colour, name] of AXES) word(name, times(axis, scene.axis * 1.25), colour);
    for (const cluster of clusters) {
      if (cluster !== picked) word(`${classes[cluster.kind].name} ${percent(cluster.sure)}`, cluster.solid?.centre ?? cluster.at, classes[cluster.kind].colour, 10);
    }
    if (picked) this.mark(picked, view, width, height, classes[picked.kind]);
  }

  mark(cluster, view, width, height, { name, colour }) {
    const at = cluster.solid?.centre ?? cluster.at;
    const p = projected(view.matrix, at, width, height);
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
    pen.fillStyle = colour;
    pen.font = "600 12px system-ui, sans-serif";
    const track = cluster.track ?? (cluster.id === undefined ? null : cluster);
    const text = cluster.kind > 0 ? `${name} ${percent(cluster.sure)}` : name;
    pen.fillText(track ? `${text} · #${track.id}` : text, p[0], p[1] - radius - 7);
  }
}
