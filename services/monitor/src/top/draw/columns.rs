use crate::top::view::StageView;

/// A column of the table of stages.
pub(in crate::top) struct Column {
    pub(in crate::top) title: &'static str,
    pub(in crate::top) width: u16,
    pub(super) group: usize,
    pub(in crate::top) value: fn(&StageView) -> String,
    pub(super) look: Look,
}

/// When a value is to be seen.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Look {
    Plain,
    /// Anything but 0 is worth a look.
    Warning,
    /// Anything but 0 is a loss.
    Alarm,
    State,
}

/// Groups of columns that are shown together or not at all: times, trouble, ledger, process.
pub(in crate::top) const GROUPS: usize = 4;

const fn column(group: usize, title: &'static str, width: u16, look: Look, value: fn(&StageView) -> String) -> Column {
    Column { title, width, group, value, look }
}

/// All columns beside the stage's name.
pub(in crate::top) const COLUMNS: [Column; 19] = [
    column(0, "state", 9, Look::State, |stage| stage.state.to_owned()),
    column(0, "parts/s", 8, Look::Plain, |stage| format!("{:.1}", stage.parts_per_s)),
    column(0, "busy %", 7, Look::Plain, |stage| tenths(stage.busy_pct)),
    column(0, "p50 ms", 7, Look::Plain, |stage| hundredths(stage.busy_p50_ms)),
    column(0, "p99 ms", 7, Look::Plain, |stage| hundredths(stage.busy_p99_ms)),
    column(0, "queue", 6, Look::Plain, |stage| stage.queue.map_or_else(none, |queue| queue.to_string())),
    column(1, "restarts", 9, Look::Warning, |stage| stage.restarts.to_string()),
    column(1, "over", 5, Look::Warning, |stage| stage.overruns.to_string()),
    column(1, "slips", 6, Look::Plain, |stage| stage.slips.to_string()),
    column(1, "late", 5, Look::Warning, |stage| stage.late.to_string()),
    column(2, "received", 9, Look::Plain, |stage| stage.received.to_string()),
    column(2, "processed", 10, Look::Plain, |stage| stage.processed.to_string()),
    column(2, "rejected", 9, Look::Warning, |stage| stage.rejected.to_string()),
    column(2, "dropped", 8, Look::Alarm, |stage| stage.dropped.to_string()),
    column(2, "lost", 6, Look::Alarm, |stage| stage.lost.to_string()),
    column(3, "sweeps/s", 9, Look::Plain, |stage| format!("{:.1}", stage.sweeps_per_s)),
    column(3, "pid", 9, Look::Plain, |stage| stage.pid.to_string()),
    column(3, "cpu %", 6, Look::Plain, |stage| tenths(stage.process.cpu_pct)),
    column(3, "MiB", 7, Look::Plain, |stage| tenths(stage.process.rss_mib)),
];

fn none() -> String {
    "-".to_owned()
}

pub(super) fn tenths(value: Option<f64>) -> String {
    value.map_or_else(none, |value| format!("{value:.1}"))
}

pub(super) fn hundredths(value: Option<f64>) -> String {
    value.map_or_else(none, |value| format!("{value:.2}"))
}
