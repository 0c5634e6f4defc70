// A running chain: asks for what is new, and shows the newest sweep as long as it plays.

const LOOK_MS = 200;

async function watch(viewer) {
  const { store } = viewer;
  for (;;) {
    await new Promise((done) => setTimeout(done, document.hidden ? 10 * LOOK_MS : LOOK_MS));
    let overview;
    try {
      overview = await store.fetched("/overview");
    } catch {
      play(viewer, false);
      $("run").textContent += " · the chain has ended";
      signals.ended = "yes";
      return;
    }
    const shown = store.overview.sweep[viewer.kept[viewer.at]];
    store.overview = overview;
    store.about.kept = [...overview.here.keys()].filter((place) => overview.here[place]);
    const { kept } = viewer;
    if (kept.length === 0) continue;
    viewer.plots.look();
    viewer.offerTracks();
    $("slider").max = kept.length - 1;
    const at = kept.findIndex((place) => overview.sweep[place] === shown);
    const newest = kept.length - 1;
    if (viewer.playing && (at !== newest || !viewer.sweep)) await viewer.goTo(newest);
    else viewer.stay(Math.max(at, 0));
  }
}
