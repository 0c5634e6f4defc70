// The tracks of a sweep as a table: in the order of danger, or sorted by a head; picked by a row.

class TrackList {
  constructor(classes, pick) {
    Object.assign(this, { classes, pick, sort: "rank", down: false, rows: document.getElementById("track-rows") });
    this.heads = [...document.querySelectorAll("#tracked th button")];
    for (const head of this.heads) {
      head.addEventListener("click", () => {
        this.down = this.sort === head.dataset.sort ? !this.down : head.dataset.sort === "speed";
        this.sort = head.dataset.sort;
        this.show(this.tracks, this.hidden, this.picked);
      });
    }
  }

  show(tracks, hidden, picked) {
    Object.assign(this, { tracks, hidden, picked });
    for (const head of this.heads) {
      if (head.dataset.sort === this.sort) head.setAttribute("aria-sort", this.down ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    }
    const shown = (tracks ?? []).filter((track) => !hidden.has(track.kind));
    // What a tentative track's approach would be is not known: it comes last.
    const judged = (track) => track.state === "tentative" ? Infinity : track[this.sort];
    const key = (track) => ["time", "near"].includes(this.sort) ? judged(track) : this.sort === "state" ? STATES.indexOf(track.state) : track[this.sort];
    const order = (a, b) => key(a) === key(b) ? a.rank - b.rank : (key(a) < key(b) ? -1 : 1) * (this.down ? -1 : 1);
    shown.sort(order);
    this.rows.replaceChildren(...shown.slice(0, MOST_ROWS).map((track) => this.row(track)));
  }

  // What stands below the table.
  counted() {
    if (!this.tracks) return "tracks not known in this sweep";
    const count = (state) => this.tracks.filter((track) => track.state === state).length;
    const alerts = this.tracks.filter((track) => track.alert).length;
    return `${count("confirmed")} confirmed, ${count("coasting")} coasting, ${count("tentative")} tentative${alerts > 0 ? `; ${alerts} on alert` : ""}`;
  }

  row(track) {
    const row = document.createElement("tr"), go = document.createElement("button"), dot = document.createElement("span");
    dot.className = "dot";
    dot.style.background = this.classes[track.kind].colour;
    go.append(dot, `${track.alert ? "▲ " : ""}#${track.id}`);
    go.type = "button";
    go.setAttribute("aria-label", `Go to track ${track.id}, ${this.classes[track.kind].name}${track.alert ? ", on alert" : ""}`);
    row.insertCell().append(go);
    const judged = track.state !== "tentative";
    const state = track.state === "coasting" ? `coasting ${track.seen}` : track.state;
    const danger = judged ? [track.near.toFixed(1), track.time.toFixed(1), met(track.met)] : ["", "", ""];
    for (const text of [state, track.speed.toFixed(2), ...danger]) row.insertCell().textContent = text;
    row.className = track.alert ? "alert" : track.state;
    row.setAttribute("aria-selected", track === this.picked || Boolean(this.picked?.tracks?.includes(track)));
    row.addEventListener("click", () => this.pick(track.cluster ?? track));
    return row;
  }
}
