// What the page was given: about.json, all sweeps in numbers, and the clouds of some, within the page or from its server.

class Store {
  constructor() {
    this.about = JSON.parse(document.getElementById("about").textContent);
    this.near = new Map();
  }

  async open() {
    const text = document.getElementById("overview").textContent;
    this.overview = columnsOf(await inflated(bytesOf(text)));
  }

  // The sweep at a place in the overview; the last few are kept, by number.
  sweep(place) {
    const number = this.overview.sweep[place];
    let sweep = this.near.get(number);
    this.near.delete(number);
    sweep ??= this.read(number).then(arranged);
    this.near.set(number, sweep);
    if (this.near.size > 12) this.near.delete(this.near.keys().next().value);
    sweep.catch(() => this.near.delete(number));
    return sweep;
  }

  async read(number) {
    if (this.about.served) return this.fetched(`/sweep/${number}`);
    return columnsOf(await inflated(bytesOf(document.getElementById(`sweep-${number}`).textContent)));
  }

  async fetched(path) {
    const answer = await fetch(path);
    if (!answer.ok) throw new Error((await answer.text()).trim() || `the server answered ${answer.status}`);
    return columnsOf(await inflated(new Uint8Array(await answer.arrayBuffer())));
  }
}

// Columns as the scene wants them: positions side by side, clusters with their solids and tracks.
function arranged(columns) {
  const x = column(columns, "x"), y = column(columns, "y"), z = column(columns, "z");
  const positions = new Float32Array(3 * x.length);
  const range = new Float32Array(x.length);
  for (let i = 0; i < x.length; i++) {
    positions.set([x[i], y[i], z[i]], 3 * i);
    range[i] = Math.hypot(x[i], y[i], z[i]);
  }
  const kinds = column(columns, "class");
  const clusters = Array.from(kinds, (kind, i) => ({
    number: i, kind, points: columns.points[i], rings: columns.rings[i],
    at: [columns.cx[i], columns.cy[i], columns.cz[i]],
    range: Math.hypot(columns.cx[i], columns.cy[i], columns.cz[i]),
    posterior: [columns.p0[i], columns.p1[i], columns.p2[i], columns.p3[i]],
    sure: kind > 0 ? columns[`p${kind - 1}`][i] : 0,
    solid: null, size: 0, track: null,
  }));
  column(columns, "of").forEach((of, i) => {
    const size = [columns.a[i], columns.b[i], columns.c[i]];
    const solid = {
      cluster: clusters[of], size, sigma: columns.sigma[i],
      centre: [columns.sx[i], columns.sy[i], columns.sz[i]],
      turn: [columns.qw[i], columns.qx[i], columns.qy[i], columns.qz[i]],
    };
    clusters[of].solid = solid;
    clusters[of].size = Math.max(...size);
  });
  return {
    tracks: tracksOf(columns, clusters), positions, range, height: z, count: x.length, clusters,
    cluster: column(columns, "cluster"), ring: column(columns, "ring"), intensity: column(columns, "intensity"),
  };
}
