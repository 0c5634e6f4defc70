// Columns of numbers as the recording's reader packed them (src/columns.rs): deflated; a head in JSON; byte planes of folded
// differences.

function bytesOf(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function columnsOf(bytes) {
  const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(0, true);
  const heads = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
  const columns = {};
  let at = 4 + length;
  for (const { name, n, bytes: planes, unit } of heads) {
    const values = new Float64Array(n);
    let sum = 0;
    for (let i = 0; i < n; i++) {
      let folded = 0;
      for (let plane = 0; plane < planes; plane++) folded |= bytes[at + plane * n + i] << (8 * plane);
      sum = (sum + ((folded >>> 1) ^ -(folded & 1))) | 0;
      values[i] = sum * unit;
    }
    columns[name] = values;
    at += n * planes;
  }
  return columns;
}

// A column that the recording did not have counts as empty.
function column(columns, name) {
  return columns[name] ?? new Float64Array(0);
}
