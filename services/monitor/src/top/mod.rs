//! `encke top`: the running chain in a terminal.

mod draw;
mod model;
mod terminal;
mod text;
mod ui;
mod view;
mod watch;

use std::io::{IsTerminal, Write};

use transport::Instance;

use crate::MonitorError;
use crate::process::be_nice;
pub use view::{
    DetectionRow, DetectionsView, EventView, LatencyView, ProcessView, StageView, TapView, TrackRow, TracksView, View,
};
use watch::Watch;

/// How to look.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Between two looks [ns].
    pub interval_ns: u64,
    /// Print one snapshot as text and leave.
    pub once: bool,
    /// Print one snapshot as JSON and leave.
    pub json: bool,
}

/// Shows a running instance until asked to leave; prints one snapshot where that is asked for or where standard output is
/// no terminal. `runs` says whether the instance has a supervisor: it is asked once the one that was seen is gone.
///
/// # Errors
/// The instance cannot be attached to, or the terminal or standard output fails.
pub fn top(instance: &Instance, settings: Settings, runs: impl Fn() -> bool) -> Result<(), MonitorError> {
    be_nice();
    let mut watch = Watch::begin(instance, settings.interval_ns)?;
    if !settings.once && !settings.json && std::io::stdout().is_terminal() {
        return terminal::show(&mut watch, &runs);
    }
    let view = watch.snapshot()?;
    let text = if settings.json { json(&view) } else { text::snapshot(&view) };
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(cause) if cause.kind() != std::io::ErrorKind::BrokenPipe => Err(MonitorError::Output(cause)),
        _ => Ok(()),
    }
}

fn json(view: &View) -> String {
    // A view is made of numbers and words alone.
    serde_json::to_string_pretty(view).unwrap_or_default() + "\n"
}
