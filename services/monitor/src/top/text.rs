//! A view as plain text.

use super::draw::{COLUMNS, header_lines};
use super::view::{DetectionRow, TrackRow, View};

/// Obstacles that the text names, and tracks.
const ROWS: usize = 20;

/// One snapshot for pipes and files: everything that the screen has, without its graph.
pub(super) fn snapshot(view: &View) -> String {
    let mut text = String::new();
    for line in header_lines(view) {
        text += &(line + "\n");
    }
    text.push('\n');
    text += &format!("{:<11}", "stage");
    for column in COLUMNS.iter() {
        text += &format!("{:>width$}", column.title, width = usize::from(column.width));
    }
    text.push('\n');
    for stage in &view.stages {
        text += &format!("{:<11}", stage.stage);
        for column in COLUMNS.iter() {
            text += &format!("{:>width$}", (column.value)(stage), width = usize::from(column.width));
        }
        text.push('\n');
    }
    text += &detections(view);
    text += &tracks(view);
    text += &events(view);
    text
}

fn detections(view: &View) -> String {
    let found = &view.detections;
    let Some(sweep) = found.sweep else { return "\nno detections seen\n".to_owned() };
    let mut text = format!("\nsweep {sweep}: {} clusters", found.clusters());
    for (class, clusters) in &found.classes {
        text += &format!(", {clusters} {class}");
    }
    text += "\ncluster  class            p   range [m]   points   size [m]\n";
    for row in found.rows.iter().take(ROWS) {
        let p = row.p.map_or("-".to_owned(), |p| format!("{p:.2}"));
        text += &format!(
            "{:>7}  {:<13}{:>5}{:>12.2}{:>9}   {}\n",
            row.cluster,
            row.class,
            p,
            row.range_m,
            row.points,
            size(row)
        );
    }
    text + &more(found.clusters(), "clusters")
}

/// What of so many the text leaves out; nothing where that is nothing.
fn more(all: usize, what: &str) -> String {
    if all > ROWS { format!("   and {} {what} more\n", all - ROWS) } else { String::new() }
}

/// The extents of a solid.
pub(super) fn size(row: &DetectionRow) -> String {
    row.size_m.map_or("-".to_owned(), |[x, y, z]| format!("{x:.2} × {y:.2} × {z:.2}"))
}

fn tracks(view: &View) -> String {
    let found = &view.tracks;
    let Some(sweep) = found.sweep else { return "\nno tracks seen\n".to_owned() };
    if !found.known {
        return format!("\ntracks of sweep {sweep}: not known\n");
    }
    let states = found.states.iter().map(|(state, tracks)| format!("{tracks} {state}")).collect::<Vec<_>>().join(", ");
    let mut text = format!("\ntracks of sweep {sweep}: {states}, {} on alert\n", found.alerts);
    text += "   track  state      class            p   v [m/s]   range [m]   closest [m]   in [s]   collision\n";
    for row in found.rows.iter().take(ROWS) {
        let TrackRow { track, state, class, speed_mps, range_m, .. } = row;
        let hundredths = |value: Option<f32>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
        text += &format!(
            "{track:>8}  {state:<11}{class:<13}{:>5}{speed_mps:>10.2}{range_m:>12.2}{:>14}{:>9}{:>12}{}\n",
            hundredths(row.p),
            hundredths(row.distance_m),
            hundredths(row.time_s),
            probability(row.collision_probability),
            if row.alert { "  ALERT" } else { "" },
        );
    }
    text + &more(found.states.iter().map(|(_, tracks)| tracks).sum(), "tracks")
}

/// A probability to the thousandth; none as a line.
pub(super) fn probability(p: Option<f32>) -> String {
    match p {
        None => "-".to_owned(),
        Some(p) if p > 0.0 && p < 0.001 => "<.001".to_owned(),
        Some(p) => format!("{p:.3}"),
    }
}

fn events(view: &View) -> String {
    let mut text = String::new();
    for event in &view.events {
        text += &format!("{:>8.1} s  sweep {:<7} {:<11}{}\n", event.at_s, event.sweep, event.stage, event.what);
    }
    if text.is_empty() { text } else { format!("\n{text}") }
}
