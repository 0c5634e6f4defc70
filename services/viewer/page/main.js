// Ties the parts together: which sweep, how it is coloured, what is picked, when it is drawn.

const $ = (id) => document.getElementById(id);
const signals = document.documentElement.dataset;

function message(text) {
  $("message").textContent = text;
  $("message").hidden = !text;
  if (text) signals.failed = text;
}

// What in another sweep is of the same track; where there is none, the cluster that is where this one was: the nearest whose
// middle moved by less than a metre.
function again(was, sweep) {
  const id = was.track?.id ?? was.id, track = sweep.tracks?.find((track) => track.id === id);
  if (track) return track.cluster ?? track;
  const middle = (cluster) => cluster.solid?.centre ?? cluster.at;
  const moved = (cluster) => Math.hypot(...less(middle(cluster), middle(was)));
  const near = sweep.clusters.filter((cluster) => cluster.points >= LEAST_POINTS && moved(cluster) < 1);
  return near.sort((a, b) => moved(a) - moved(b))[0] ?? null;
}

class Viewer {
  constructor(store, scene) {
    Object.assign(this, { store, scene, at: 0, hidden: new Set(), picked: null, hover: null, playing: false, by: "class" });
    this.classes = [];
    for (const kind of store.about.classes) this.classes[kind.number] = { ...kind, rgb: rgb(kind.colour) };
    this.overlay = new Overlay($("overlay"));
    this.camera = new Camera($("cloud"), () => this.redraw());
    this.plots = new Plots(store, this.classes, (place) => this.goTo(this.nearestKept(place)));
    this.list = new List(this.classes, (cluster) => this.choose(cluster, true));
    this.trackList = new TrackList(this.classes, (picked) => this.choose(picked, true));
    this.listed = "obstacles";
    this.describe();
    this.offerTracks();
    this.legend();
    wire(this);
    new ResizeObserver(() => this.resize()).observe($("view"));
  }

  get kept() { return this.store.about.kept; }

  describe() {
    const { about, overview } = this.store, all = overview.sweep.length;
    document.title = `${about.file ?? "recording"} · Encke`;
    $("file").textContent = about.file ?? "";
    const parts = [about.source, about.sensor, about.pace && `${about.pace} pace`, about.live ? "live" : counted(all, "sweep")];
    if (about.selected < all) parts.push(`${about.selected} selected`);
    if (this.kept.length < about.selected) parts.push(`${this.kept.length} of them in this page, the others left out evenly to keep it small`);
    $("run").textContent = parts.filter(Boolean).join(" · ");
    if (about.damage.length > 0) {
      const note = document.createElement("p");
      note.textContent = `⚠ The file is damaged; what is intact is shown: ${about.damage.join("; ")}`;
      note.style.color = "var(--accent)";
      note.title = note.textContent;
      document.querySelector("header").append(note);
      signals.damaged = about.damage.length;
    }
    $("slider").max = this.kept.length - 1;
  }

  // Tracks are offered where the recording has any.
  offerTracks() {
    this.tracked = this.store.overview.tracks.some((tracks) => tracks >= 0);
    for (const id of ["tracks-offer", "lists"]) $(id).hidden = !this.tracked;
    if (this.tracked) signals.tracked = "yes";
  }

  // Which of the tables is to be seen.
  chooseList(name) {
    this.listed = name;
    $("scroll").hidden = name !== "obstacles";
    $("tracked").hidden = name !== "tracks";
    for (const each of ["obstacles", "tracks"]) $(`list-${each}`).setAttribute("aria-pressed", String(each === name));
    $("counted").textContent = (name === "tracks" ? this.trackList : this.list).counted();
  }

  // Those to be drawn.
  get drawnTracks() {
    return $("tracks").checked ? (this.sweep?.tracks ?? []).filter((track) => !this.hidden.has(track.kind)) : [];
  }

  get coasting() { return coastingBodies(this.drawnTracks, this.hidden); }

  legend() {
    for (const kind of this.store.about.classes) {
      const chip = document.createElement("button"), dot = document.createElement("span");
      dot.className = "dot";
      dot.style.background = kind.colour;
      chip.type = "button";
      const count = kind.count = document.createElement("span");
      count.className = "count";
      chip.append(dot, kind.name, count);
      chip.setAttribute("aria-pressed", "true");
      chip.addEventListener("click", () => {
        const off = !this.hidden.delete(kind.number);
        if (off) this.hidden.add(kind.number);
        chip.setAttribute("aria-pressed", String(!off));
        this.plots.shown[off ? "delete" : "add"](kind.number);
        this.refresh();
      });
      $("legend").append(chip);
    }
  }

  // Shows the sweep at a place among those kept. The latest wish wins.
  async goTo(at) {
    if (this.kept.length === 0) return;
    this.at = Math.min(Math.max(at, 0), this.kept.length - 1);
    $("slider").value = this.at;
    const wish = this.wish = Symbol("wish");
    try {
      const place = this.kept[this.at], number = this.store.overview.sweep[place], sweep = await this.store.sweep(place);
      if (wish !== this.wish) return;
      message("");
      const first = !this.sweep;
      this.sweep = sweep;
      this.number = number;
      if (this.store.about.live) this.at = Math.max(this.kept.findIndex((kept) => this.store.overview.sweep[kept] === number), 0);
      this.picked = this.picked && again(this.picked, sweep);
      this.hover = null;
      $("tip").hidden = true;
      if (first) this.frame();
      this.refresh();
      for (const near of [this.at + 1, this.at - 1]) if (this.kept[near] !== undefined) this.store.sweep(this.kept[near]).catch(() => {});
    } catch (cause) {
      // A live chain's oldest sweeps go.
      if (!this.store.about.live) message(`Sweep ${this.store.overview.sweep[this.kept[this.at]]} cannot be shown: ${cause.message}`);
    }
  }

  // The same sweep, whose place among the others changed.
  stay(at) {
    this.at = at;
    $("slider").value = at;
    this.plots.at = this.kept[at];
    if (this.sweep) this.plots.draw();
  }

  nearestKept(place) {
    let best = 0;
    this.kept.forEach((kept, at) => { if (Math.abs(kept - place) < Math.abs(this.kept[best] - place)) best = at; });
    return best;
  }

  // Fits grid and camera to the first sweep.
  frame() {
    const [, reach] = ends(this.sweep.range);
    this.scene.drawGrid(Math.min(Math.max(reach, 5), 120));
    this.camera.fit(Math.min(Math.max(reach, 3), 80));
    const wanted = new URLSearchParams(location.hash.slice(1)).get("view");
    if (wanted === "top") this.camera.above();
    if (wanted === "side") this.camera.level();
  }

  // Colours, solids, list and plots anew.
  refresh() {
    const { sweep, hidden, picked, by } = this;
    if (!sweep) return;
    const { colours, ends: span } = pointColours(sweep, by, this.classes, hidden, picked?.number);
    this.scene.setPoints(sweep.positions, colours);
    const alarmed = $("tracks").checked;
    const bodyColour = (body) => {
      if (alarmed && (body.alert || body.track?.alert)) return rgb(this.store.about.alert);
      return by === "cluster" && body.number >= 0 ? clusterColour(body.number) : this.classes[body.kind].rgb;
    };
    const solids = sweep.clusters.filter((cluster) => cluster.solid && !hidden.has(cluster.kind) && cluster.kind > 0);
    this.scene.setSolids([...solids, ...this.coasting].map((body) => ({
      ...body.solid, kind: body.kind, strength: (!picked || picked === body ? 1 : 0.45) * (body.id === undefined ? 1 : 0.6), rgb: bodyColour(body),
    })));
    showRamp(span, by);
    this.list.show(sweep, hidden, picked);
    this.trackList.show(sweep.tracks, hidden, picked);
    this.chooseList(this.listed);
    const alerts = this.store.overview.alerts[this.kept[this.at]];
    $("alerts").textContent = alerts > 0 ? `▲ ${alerts}` : "";
    for (const kind of this.store.about.classes) kind.count.textContent = this.store.overview[kind.name][this.kept[this.at]];
    this.plots.at = this.kept[this.at];
    this.plots.draw();
    this.say();
    this.redraw();
  }

  say() {
    const place = this.kept[this.at], { overview, about } = this.store, step = overview.step[place];
    const parts = [`sweep ${overview.sweep[place]}`, `${(overview.time_ms[place] / 1000).toFixed(1)} s`, counted(overview.returns[place], "return")];
    if (this.sweep.count < overview.returns[place]) parts.push(`${this.sweep.count.toLocaleString("en")} shown`);
    if (!overview.complete[place]) parts.push("partial turn");
    if (overview.tracks[place] >= 0) parts.push(counted(overview.tracks[place], "track"));
    if (overview.alerts[place] > 0) parts.push(`${overview.alerts[place]} on alert`);
    if (step > 0) parts.push(`step ${about.steps[step] ?? step}`);
    $("now").value = parts.join(" · ");
    const named = this.store.about.classes.map((kind) => `${overview[kind.name][place]} ${kind.name}`).join(", ");
    $("cloud").setAttribute("aria-label", `Cloud of ${parts.join(", ")}: ${named}`);
  }

  choose(cluster, fly) {
    this.picked = cluster;
    this.refresh();
    if (cluster && fly) {
      this.camera.fly({ target: cluster.solid?.centre ?? cluster.at, distance: Math.max(4 * (cluster.size || 1), 4) });
    }
  }

  resize() {
    for (const id of ["cloud", "overlay"]) {
      const canvas = $(id);
      canvas.width = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio));
      canvas.height = Math.max(1, Math.round(canvas.clientHeight * devicePixelRatio));
    }
    if (this.sweep) this.plots.draw();
    this.redraw();
  }

  redraw() {
    this.asked ??= requestAnimationFrame((now) => {
      this.asked = undefined;
      const flying = this.camera.step(now);
      this.draw();
      if (flying) this.redraw();
    });
  }

  draw() {
    const { sweep, scene } = this, canvas = $("cloud");
    if (!sweep || scene.gl.isContextLost()) return;
    const view = this.view = this.camera.view(canvas.width / canvas.height);
    scene.draw(view, Number($("size").value) * devicePixelRatio, $("solids").checked);
    const named = $("names").checked ? sweep.clusters.filter((cluster) => cluster.kind > 0 && !this.hidden.has(cluster.kind)) : [];
    const colourOf = (track) => track.alert ? this.store.about.alert : this.classes[track.kind].colour;
    this.overlay.draw(scene, view, named, this.picked, this.classes, this.drawnTracks, colourOf);
    if (signals.sweep !== String(this.number)) this.signal();
  }

  // What a test may ask of the page: it cannot see. Pixels are counted once; that takes time.
  signal() {
    if (!signals.lit) Object.assign(signals, this.scene.checked());
    Object.assign(signals, {
      sweep: this.number, sweeps: this.kept.length, points: this.sweep.count,
      clusters: this.sweep.clusters.length, solids: this.scene.count, tracks: this.drawnTracks.length, drawn: "yes",
    });
  }
}

async function main() {
  if (typeof DecompressionStream === "undefined") {
    throw new Error("This browser cannot unpack the sweeps (no DecompressionStream). Any of 2023 or later can.");
  }
  const store = new Store();
  await store.open();
  let scene;
  try {
    scene = new Scene($("cloud"));
  } catch (cause) {
    throw new Error(`This browser does not draw in three dimensions here (${cause.message}). Allow hardware acceleration, or use another.`);
  }
  const viewer = new Viewer(store, scene);
  viewer.resize();
  if (store.about.live) {
    play(viewer, true);
    watch(viewer);
  }
  const wanted = new URLSearchParams(location.hash.slice(1));
  if ([...$("colour").options].some((option) => option.value === wanted.get("colour"))) $("colour").value = viewer.by = wanted.get("colour");
  $("names").checked = wanted.has("names");
  $("tracks").checked = wanted.get("tracks") !== "0";
  if (viewer.tracked && wanted.get("list") === "tracks") viewer.listed = "tracks";
  const sweep = store.about.kept.findIndex((place) => String(store.overview.sweep[place]) === wanted.get("sweep"));
  await viewer.goTo(Math.max(sweep, 0));
  const cluster = viewer.sweep?.clusters[Number(wanted.get("cluster") ?? NaN)];
  const track = viewer.sweep?.tracks?.find((track) => String(track.id) === wanted.get("track"));
  if (cluster) viewer.choose(cluster, true);
  else if (track) viewer.choose(track.cluster ?? track, true);
}
main().catch((cause) => message(cause.message));
