// The obstacles of a sweep as a table: sorted by a head, picked by a row.

const MOST_ROWS = 400;
const LEAST_POINTS = 5;

class List {
  constructor(classes, pick) {
    Object.assign(this, { classes, pick, sort: "range", down: false, rows: document.getElementById("rows") });
    this.heads = [...document.querySelectorAll("#scroll th button")];
    for (const head of this.heads) {
      head.addEventListener("click", () => {
        this.down = this.sort === head.dataset.sort ? !this.down : ["points", "size", "sure"].includes(head.dataset.sort);
        this.sort = head.dataset.sort;
        this.show(this.sweep, this.hidden, this.picked);
      });
    }
  }

  show(sweep, hidden, picked) {
    Object.assign(this, { sweep, hidden, picked });
    for (const head of this.heads) {
      if (head.dataset.sort === this.sort) head.setAttribute("aria-sort", this.down ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    }
    const key = (cluster) => this.sort === "class" ? (cluster.kind || 9) : cluster[this.sort];
    const large = sweep.clusters.filter((cluster) => cluster.points >= LEAST_POINTS && !hidden.has(cluster.kind));
    large.sort((a, b) => (key(a) - key(b) || a.range - b.range) * (this.down ? -1 : 1));
    this.rows.replaceChildren(...large.slice(0, MOST_ROWS).map((cluster) => this.row(cluster)));
    const small = sweep.clusters.length - sweep.clusters.filter((cluster) => cluster.points >= LEAST_POINTS).length;
    const more = large.length > MOST_ROWS ? `, ${large.length - MOST_ROWS} more not listed` : "";
    const text = `${counted(large.length, "obstacle")}${more}`;
    this.text = small > 0 ? `${text}; ${counted(small, "cluster")} under ${LEAST_POINTS} returns` : text;
  }

  // What stands below the table.
  counted() { return this.text; }

  row(cluster) {
    const row = document.createElement("tr");
    const go = document.createElement("button"), dot = document.createElement("span");
    dot.className = "dot";
    dot.style.background = this.classes[cluster.kind].colour;
    go.append(dot, this.classes[cluster.kind].name);
    go.type = "button";
    go.setAttribute("aria-label", `Go to cluster ${cluster.number}, ${this.classes[cluster.kind].name}`);
    row.insertCell().append(go);
    const size = cluster.solid ? cluster.solid.size.map((value) => value.toFixed(1)).join("×") : "";
    for (const text of [cluster.kind > 0 ? percent(cluster.sure) : "", cluster.points, cluster.range.toFixed(1), size]) row.insertCell().textContent = text;
    row.dataset.cluster = cluster.number;
    row.setAttribute("aria-selected", cluster === this.picked);
    row.addEventListener("click", () => this.pick(cluster));
    return row;
  }
}
