// Buttons, slider, keys and pointer; playing.

function wire(viewer) {
  const cloud = $("cloud"), stop = () => play(viewer, false);
  const step = (by) => { stop(); viewer.goTo(viewer.at + by); };
  $("slider").addEventListener("input", () => { stop(); viewer.goTo(Number($("slider").value)); });
  $("back").addEventListener("click", () => step(-1));
  $("on").addEventListener("click", () => step(1));
  $("play").addEventListener("click", () => play(viewer, !viewer.playing));
  const colour = (by) => { $("colour").value = viewer.by = by; viewer.refresh(); };
  $("colour").addEventListener("change", () => colour($("colour").value));
  for (const id of ["size", "solids", "names"]) $(id).addEventListener("input", () => viewer.redraw());
  $("tracks").addEventListener("input", () => viewer.refresh());
  for (const name of ["obstacles", "tracks"]) $(`list-${name}`).addEventListener("click", () => viewer.chooseList(name));
  $("fit").addEventListener("click", () => viewer.camera.fit(viewer.camera.reach));
  $("top").addEventListener("click", () => viewer.camera.above());
  $("side-on").addEventListener("click", () => viewer.camera.level());
  const help = () => { $("keys").hidden = !$("keys").hidden; $("help").setAttribute("aria-expanded", String(!$("keys").hidden)); };
  $("help").addEventListener("click", help);
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || ["SELECT", "INPUT"].includes(event.target.tagName)) return;
    if (event.key === " " && event.target.tagName === "BUTTON") return;
    const far = event.shiftKey ? 10 : 1, options = [...$("colour").options].map((option) => option.value);
    const keys = {
      " ": () => play(viewer, !viewer.playing), ArrowLeft: () => step(-far), ArrowRight: () => step(far),
      Home: () => step(-Infinity), End: () => step(Infinity), "?": help, Escape: () => viewer.choose(null),
      k: () => { if (viewer.tracked) { $("tracks").checked = !$("tracks").checked; viewer.refresh(); } },
      c: () => colour(options[(options.indexOf(viewer.by) + 1) % options.length]),
    };
    if (keys[event.key]) keys[event.key]();
    else if (!viewer.camera.key(event)) return;
    event.preventDefault();
  });
  cloud.addEventListener("pointermove", (event) => hover(viewer, event));
  cloud.addEventListener("pointerleave", () => { $("tip").hidden = true; });
  cloud.addEventListener("click", () => { if (viewer.camera.dragged < 5) viewer.choose(viewer.hover?.cluster ?? null); });
  cloud.addEventListener("dblclick", () => { if (viewer.hover?.cluster) viewer.choose(viewer.hover.cluster, true); });
  cloud.addEventListener("webglcontextlost", (event) => event.preventDefault());
  cloud.addEventListener("webglcontextrestored", () => { viewer.scene.rebuild(); viewer.frame(); viewer.refresh(); });
}

// At the recording's own pace times the speed chosen; a sweep that comes late is waited for.
async function play(viewer, on) {
  if (viewer.playing === on) return;
  viewer.playing = on;
  $("play").textContent = on ? "❚❚" : "▶";
  $("play").setAttribute("aria-label", on ? "Pause" : "Play");
  // A live chain comes by itself; see `watch`.
  if (viewer.store.about.live) return;
  if (on && viewer.at === viewer.kept.length - 1) await viewer.goTo(0);
  while (viewer.playing && viewer.at < viewer.kept.length - 1) {
    const time = viewer.store.overview.time_ms, [now, next] = [viewer.kept[viewer.at], viewer.kept[viewer.at + 1]];
    const wait = Math.min(Math.max(time[next] - time[now], 20), 2000) / Number($("speed").value);
    const started = performance.now(), from = viewer.at;
    await new Promise((done) => setTimeout(done, wait));
    if (!viewer.playing || viewer.at !== from) continue;
    const late = Math.floor((performance.now() - started) / wait);
    await viewer.goTo(viewer.at + Math.min(Math.max(late, 1), 5));
  }
  if (viewer.playing) play(viewer, false);
}

function hover(viewer, event) {
  const { sweep, view } = viewer, cloud = $("cloud"), tip = $("tip");
  if (!sweep || !view || event.buttons !== 0) {
    tip.hidden = true;
    return;
  }
  const box = cloud.getBoundingClientRect(), [x, y] = [event.clientX - box.left, event.clientY - box.top];
  viewer.hover = pick(sweep, view, x, y, box.width, box.height, viewer.hidden, $("solids").checked, viewer.coasting);
  tip.hidden = !viewer.hover;
  if (!viewer.hover) return;
  const [title, ...lines] = said(sweep, viewer.hover, viewer.classes), head = document.createElement("b");
  head.textContent = title;
  if (viewer.hover.cluster) head.style.color = viewer.classes[viewer.hover.cluster.kind].colour;
  tip.replaceChildren(head, lines.join("\n"));
  tip.style.left = `${Math.max(4, Math.min(x + 14, box.width - tip.offsetWidth - 6))}px`;
  tip.style.top = `${Math.max(4, Math.min(y + 14, box.height - tip.offsetHeight - 6))}px`;
}

function showRamp(span, by) {
  $("ramp").hidden = !span;
  if (!span) return;
  const bar = $("ramp-bar").getContext("2d");
  for (let x = 0; x < 120; x++) {
    bar.fillStyle = `rgb(${ramp(x / 119).join()})`;
    bar.fillRect(x, 0, 1, 1);
  }
  const text = (value) => Number.isInteger(value) ? String(value) : value.toFixed(1);
  $("ramp-low").textContent = `${RAMPED[by]} ${text(span[0])}`;
  $("ramp-high").textContent = text(span[1]);
}
