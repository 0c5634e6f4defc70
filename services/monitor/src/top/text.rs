//! A view as plain text.

use super::draw::{COLUMNS, header_lines};
use super::view::{DetectionRow, View};

/// Obstacles that the text names.
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
    text
}

/// The extents of a solid.
pub(super) fn size(row: &DetectionRow) -> String {
    row.size_m.map_or("-".to_owned(), |[x, y, z]| format!("{x:.2} × {y:.2} × {z:.2}"))
}

fn events(view: &View) -> String {
    let mut text = String::new();
    for event in &view.events {
        text += &format!("{:>8.1} s  sweep {:<7} {:<11}{}\n", event.at_s, event.sweep, event.stage, event.what);
    }
    if text.is_empty() { text } else { format!("\n{text}") }
}
