use crate::columns::Columns;
use crate::row::Row;

/// What sensor times and latencies are rounded to [ms].
const TIME_UNIT_MS: f64 = 0.1;
const LATENCY_UNIT_MS: f64 = 0.001;

/// All sweeps as the page's plots need them: columns `sweep time_ms returns latency_ms step complete` and
/// `unclassified rectangular ellipsoidal cylindrical conical`. Times count from the first sweep; a latency that is not known
/// is −1. `tracks` (those believed in; −1 where they are not known) and `alerts` (those on alert). With `here`, a column of that name says which of them can be had.
pub(crate) fn encode(rows: &[Row], here: Option<&[bool]>) -> std::io::Result<Vec<u8>> {
    let first_ns = rows.first().map_or(0, |row| row.sensor_time_ns);
    let mut columns = Columns::default();
    columns.integers("sweep", rows.iter().map(|row| row.sweep as i32));
    let since_ms = |time_ns: u64| (i128::from(time_ns) - i128::from(first_ns)) as f64 * 1e-6;
    columns.reals("time_ms", TIME_UNIT_MS, rows.iter().map(|row| since_ms(row.sensor_time_ns)));
    columns.integers("returns", rows.iter().map(|row| row.returns as i32));
    let latency_ms = |latency: Option<u64>| latency.map_or(-1.0, |latency_ns| latency_ns as f64 * 1e-6);
    columns.reals("latency_ms", LATENCY_UNIT_MS, rows.iter().map(|row| latency_ms(row.latency_ns)));
    columns.integers("step", rows.iter().map(|row| row.step as i32));
    columns.integers("complete", rows.iter().map(|row| row.complete.into()));
    let classes = ["unclassified", "rectangular", "ellipsoidal", "cylindrical", "conical"];
    for (class, name) in classes.into_iter().enumerate() {
        columns.integers(name, rows.iter().map(|row| row.classes[class] as i32));
    }
    let tracks = |row: &Row| row.tracks.map_or(-1, |(tracks, _)| tracks as i32);
    columns.integers("tracks", rows.iter().map(tracks));
    columns.integers("alerts", rows.iter().map(|row| row.tracks.map_or(0, |(_, alerts)| alerts as i32)));
    if let Some(here) = here {
        columns.integers("here", here.iter().map(|&here| here.into()));
    }
    columns.finish()
}
