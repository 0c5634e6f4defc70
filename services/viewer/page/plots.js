// Two plots over all sweeps of the recording: latency with its deadline, and obstacles by class. A click goes to the sweep.

const LEFT = 46, RIGHT = 8, TOP = 6, LOW = 16;

class Plots {
  constructor(store, classes, jump) {
    Object.assign(this, { store, classes });
    this.shown = new Set([1, 2, 3, 4]);
    this.sheets = new Map();
    this.latency = document.getElementById("latency");
    this.stack = document.getElementById("classes");
    for (const canvas of [this.latency, this.stack]) {
      const place = (event) => this.placeAt(canvas, event.clientX - canvas.getBoundingClientRect().left);
      canvas.addEventListener("click", (event) => jump(place(event)));
      canvas.addEventListener("pointermove", (event) => { this.over = place(event); this.draw(); });
      canvas.addEventListener("pointerleave", () => { this.over = null; this.draw(); });
    }
    this.at = 0;
    this.looks = 0;
    this.look();
  }

  // Takes up what the store has now.
  look() {
    const known = this.store.overview.latency_ms.filter((ms) => ms >= 0).sort();
    this.share = (share) => known[Math.min(known.length - 1, Math.floor(share * known.length))];
    this.known = known.length;
    this.looks += 1;
    this.over = null;
  }

  get sweeps() { return this.store.overview.sweep.length; }

  placeAt(canvas, x) {
    const share = (x - LEFT) / (canvas.clientWidth - LEFT - RIGHT);
    return Math.min(Math.max(Math.floor(share * this.sweeps), 0), this.sweeps - 1);
  }

  // Puts a canvas's plot on it, painted anew only where its size or `key` changed: recordings are long, cursors move often.
  show(canvas, key, paint) {
    const scale = devicePixelRatio, width = canvas.clientWidth, height = canvas.clientHeight;
    const wanted = `${width} ${height} ${scale} ${key}`;
    let sheet = this.sheets.get(canvas);
    if (sheet?.key !== wanted) {
      const paper = document.createElement("canvas");
      paper.width = canvas.width = Math.max(1, Math.round(width * scale));
      paper.height = canvas.height = Math.max(1, Math.round(height * scale));
      const pen = paper.getContext("2d");
      pen.scale(scale, scale);
      sheet = { key: wanted, paper };
      this.sheets.set(canvas, sheet);
      paint(pen, width, height);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.drawImage(sheet.paper, 0, 0);
    pen.scale(scale, scale);
    for (const [place, colour] of [[this.at, "#f0c674"], [this.over, "#ffffff60"]]) {
      if (place === null || place === undefined) continue;
      pen.fillStyle = colour;
      pen.fillRect(this.x(place, width) - 0.75, TOP, 1.5, height - TOP - LOW);
    }
  }

  x(place, width) { return LEFT + (place + 0.5) * (width - LEFT - RIGHT) / this.sweeps; }

  // Axes; gives where a value stands that is `top` at most.
  axes(pen, width, height, top, label) {
    pen.font = "10px system-ui, sans-serif";
    const y = (value) => height - LOW - value / top * (height - LOW - TOP);
    pen.fillStyle = "#93a0ae";
    pen.strokeStyle = "#27303b";
    pen.textAlign = "right";
    for (const value of [0, top / 2, top]) {
      pen.beginPath();
      pen.moveTo(LEFT, y(value));
      pen.lineTo(width - RIGHT, y(value));
      pen.stroke();
      pen.fillText(value === 0 ? "0" : label(value), LEFT - 5, y(value) + 3);
    }
    const time = this.store.overview.time_ms, last = this.sweeps - 1;
    pen.textAlign = "left";
    pen.fillText("0 s", LEFT, height - 3);
    pen.textAlign = "right";
    pen.fillText(`${(time[last] / 1000).toFixed(1)} s`, width - RIGHT, height - 3);
    return y;
  }

  draw() {
    this.drawLatency();
    this.drawStack();
  }

  drawLatency() {
    const { latency_ms } = this.store.overview, deadline = this.store.about.deadline_ms;
    const most = this.known > 0 ? this.share(1) : 1;
    // The deadline is in the picture where that leaves the latencies readable.
    const highest = deadline && deadline < 4 * most ? Math.max(most, deadline) : most;
    this.show(this.latency, this.looks, (pen, width, height) => {
      const y = this.axes(pen, width, height, round(Math.max(highest * 1.08, 0.1)), (ms) => `${short(ms)} ms`);
      const each = (width - LEFT - RIGHT) / this.sweeps, crowded = each < 2;
      const wide = Math.max(Math.min(each - 1, 5), crowded ? 1.5 : 1);
      for (let i = 0; i < this.sweeps; i++) {
        const ms = latency_ms[i];
        if (ms < 0) continue;
        pen.fillStyle = deadline && ms > deadline ? "#ff7a6b" : "#9fb3c8";
        // Bars where there is room for them, else dots: bars of a thousand sweeps would hide all but the worst.
        pen.fillRect(this.x(i, width) - wide / 2, y(ms), wide, crowded ? 1.5 : Math.max(y(0) - y(ms), 1));
      }
      if (!deadline || y(deadline) < TOP) return;
      pen.strokeStyle = "#ff7a6b";
      pen.setLineDash([5, 4]);
      pen.beginPath();
      pen.moveTo(LEFT, y(deadline));
      pen.lineTo(width - RIGHT, y(deadline));
      pen.stroke();
    });
    const place = this.over ?? this.at, ms = latency_ms[place];
    const here = ms >= 0 ? `${ms.toFixed(2)} ms` : "not known";
    const all = this.known > 0 ? `median ${short(this.share(0.5))}, 99 % ${short(this.share(0.99))}, most ${short(most)}` : "";
    document.getElementById("latency-said").textContent = `· ${here} · ${all}${deadline ? ` · deadline ${short(deadline)}` : ""}`;
    this.latency.setAttribute("aria-label", `Latency from last return to last detection in ms. Sweep ${this.store.overview.sweep[place]}: ${here}. ${all}`);
  }

  drawStack() {
    const kinds = this.classes.filter((kind) => kind.number > 0 && this.shown.has(kind.number));
    const { overview, about } = this.store, { step, alerts } = overview, counts = kinds.map((kind) => overview[kind.name]);
    const sum = (i) => counts.reduce((all, values) => all + values[i], 0);
    this.show(this.stack, [...this.shown].sort().join() + ` ${this.looks}`, (pen, width, height) => {
      let most = 1;
      for (let i = 0; i < this.sweeps; i++) most = Math.max(most, sum(i));
      const y = this.axes(pen, width, height, 2 * Math.ceil(most / 2), (value) => value.toFixed(0));
      const each = (width - LEFT - RIGHT) / this.sweeps, wide = Math.max(each * 0.86, 1);
      pen.fillStyle = "#f0c67426";
      for (let i = 0; i < this.sweeps; i++) if (step[i] > 0) pen.fillRect(this.x(i, width) - each / 2, TOP, each, height - TOP - LOW);
      pen.fillStyle = about.alert;
      for (let i = 0; i < this.sweeps; i++) if (alerts[i] > 0) pen.fillRect(this.x(i, width) - wide / 2, TOP - 5, wide, 4);
      for (let i = 0; i < this.sweeps; i++) {
        let low = 0;
        kinds.forEach((kind, k) => {
          pen.fillStyle = kind.colour;
          pen.fillRect(this.x(i, width) - wide / 2, y(low + counts[k][i]), wide, y(low) - y(low + counts[k][i]));
          low += counts[k][i];
        });
      }
    });
    const place = this.over ?? this.at;
    const here = kinds.map((kind, k) => `${counts[k][place]} ${kind.name}`).join(", ");
    document.getElementById("classes-said").textContent =
      `· ${sum(place)} in sweep ${overview.sweep[place]}${alerts[place] > 0 ? ` · ${alerts[place]} on alert` : ""}${step[place] > 0 ? ` · overload (shaded): ${about.steps[step[place]] ?? step[place]}` : ""}`;
    this.stack.setAttribute("aria-label", `Obstacles by class over time. Sweep ${this.store.overview.sweep[place]}: ${here}`);
  }
}

const short = (value) => value >= 100 ? value.toFixed(0) : Number(value.toPrecision(3)).toString();

// The next number above of the form 1, 2, 3, 4, 5, 6, 8 × 10ⁿ.
function round(value) {
  const ten = 10 ** Math.floor(Math.log10(value));
  return ten * ([1, 2, 3, 4, 5, 6, 8].find((step) => step * ten >= value) ?? 10);
}
