// The four solids at full extents 1, each as triangles with normals and as lines. A cone's apex is up.

const ROUND = 40;

const onCircle = (i, z, r = 0.5) => [r * Math.cos(2 * Math.PI * i / ROUND), r * Math.sin(2 * Math.PI * i / ROUND), z];

function boxBody() {
  const faces = [], edges = [];
  for (let axis = 0; axis < 3; axis++) {
    for (const side of [-0.5, 0.5]) {
      const corner = (u, v) => { const p = [0, 0, 0]; p[axis] = side; p[(axis + 1) % 3] = u; p[(axis + 2) % 3] = v; return p; };
      const normal = [0, 0, 0];
      normal[axis] = 2 * side;
      const around = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(([u, v]) => corner(u, v));
      if (side < 0) around.reverse();
      for (const i of [0, 1, 2, 0, 2, 3]) faces.push(...around[i], ...normal);
    }
    for (const u of [-0.5, 0.5]) {
      for (const v of [-0.5, 0.5]) {
        for (const end of [-0.5, 0.5]) { const p = [0, 0, 0]; p[axis] = end; p[(axis + 1) % 3] = u; p[(axis + 2) % 3] = v; edges.push(...p); }
      }
    }
  }
  return { faces, edges };
}

function ellipsoidBody() {
  const faces = [], edges = [], bands = ROUND / 2;
  const at = (i, j) => { const t = Math.PI * (j / bands - 0.5); return onCircle(i, 0.5 * Math.sin(t), 0.5 * Math.cos(t)); };
  for (let j = 0; j < bands; j++) {
    for (let i = 0; i < ROUND; i++) {
      for (const p of [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)]) faces.push(...p, ...times(p, 2));
    }
  }
  for (let i = 0; i < ROUND; i++) {
    for (const [x, y, z] of [onCircle(i, 0), onCircle(i + 1, 0)]) edges.push(x, y, z);
    for (const [x, y, z] of [onCircle(i, 0), onCircle(i + 1, 0)]) edges.push(x, z, y);
    for (const [x, y, z] of [onCircle(i, 0), onCircle(i + 1, 0)]) edges.push(z, x, y);
  }
  return { faces, edges };
}

// Cylinder (top 0.5) and cone (top 0): a mantle from circle to circle, and the ends.
function roundBody(top) {
  const faces = [], edges = [], rise = 0.5 - top;
  for (let i = 0; i < ROUND; i++) {
    const normal = (k) => unit([...onCircle(k, 0, 1).slice(0, 2), rise]);
    const low = (k) => [...onCircle(k, -0.5), ...normal(k)], high = (k) => [...onCircle(k, 0.5, top), ...normal(k)];
    faces.push(...low(i), ...low(i + 1), ...high(i + 1), ...low(i), ...high(i + 1), ...high(i));
    for (const [z, r, up] of [[-0.5, 0.5, -1], [0.5, top, 1]]) {
      const fan = [[0, 0, z], onCircle(i, z, r), onCircle(i + 1, z, r)];
      if (up < 0) fan.reverse();
      if (r > 0) for (const p of fan) faces.push(...p, 0, 0, up);
      if (r > 0) edges.push(...onCircle(i, z, r), ...onCircle(i + 1, z, r));
    }
    if (i % (ROUND / 8) === 0) edges.push(...onCircle(i, -0.5), ...onCircle(i, 0.5, top));
  }
  return { faces, edges };
}

// By class number: rectangular, ellipsoidal, cylindrical, conical.
const BODIES = { 1: boxBody, 2: ellipsoidBody, 3: () => roundBody(0.5), 4: () => roundBody(0) };
