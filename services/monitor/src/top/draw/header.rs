use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::columns::{hundredths, tenths};
use super::theme;
use crate::top::text::probability;
use crate::top::ui::Ui;
use crate::top::view::{TrackRow, View};

/// Between two things in a line.
const GAP: &str = "   ";

/// The state of the chain in three lines: what, how, how well.
pub(in crate::top) fn header_lines(view: &View) -> [String; 3] {
    let sectors = if view.sectors == 1 { "whole sweeps".to_owned() } else { format!("{} sectors", view.sectors) };
    let up = view.uptime_s.map_or("down".to_owned(), |s| format!("up {}", clock(s)));
    let (paced, name) = (view.pace, &view.instance);
    let first = format!("{name}   {}   {paced}, {sectors}   {up}", short(&view.source));
    [first, progress(view, usize::MAX), latency(view)]
}

/// How the chain goes on, and what is likelier to be met than allowed. Of a line of so many letters that would be cut
/// short, an alert stands at the head.
fn progress(view: &View, width: usize) -> String {
    let line = format!("sweep {}   {:.1} sweeps/s   step {}", view.sweep, view.sweeps_per_s, view.step);
    match alert(view) {
        None => line,
        Some(alert) if line.len() + GAP.len() + alert.len() > width => format!("{alert}{GAP}{line}"),
        Some(alert) => format!("{line}{GAP}{alert}"),
    }
}

/// What is likelier to be met than allowed, where there is such.
fn alert(view: &View) -> Option<String> {
    let first = view.tracks.rows.iter().find(|row| row.alert)?;
    let TrackRow { track, time_s: Some(time_s), collision_probability, .. } = first else { return None };
    let more = match view.tracks.alerts {
        1 => String::new(),
        alerts => format!(" and {} more", alerts - 1),
    };
    Some(format!("ALERT #{track} p {} in {time_s:.1} s{more}", probability(*collision_probability)))
}

/// Latency and margin of the last sweeps in a line.
pub(super) fn latency(view: &View) -> String {
    let found = &view.latency;
    if found.sweeps == 0 {
        return "no sweep answered yet".to_owned();
    }
    let times = [found.p50_ms, found.p99_ms, found.max_ms];
    let named = ["p50", "p99", "max"].into_iter().zip(times);
    let all = named.map(|(word, ms)| format!("{word} {}", three_digits(ms))).collect::<Vec<_>>().join(" ");
    let Some(deadline_ms) = found.deadline_ms else { return format!("latency {all} ms, no deadline") };
    let margins = times.map(|ms| tenths(ms.map(|ms| deadline_ms - ms))).join(" ");
    let misses = if found.missed_in_all == 1 { "1 miss".to_owned() } else { format!("{} misses", found.missed_in_all) };
    format!("latency {all} ms, margin to {deadline_ms:.0}: {margins}, {misses}")
}

fn three_digits(ms: Option<f64>) -> String {
    if ms.is_some_and(|ms| ms >= 100.0) { tenths(ms) } else { hundredths(ms) }
}

pub(super) fn draw(frame: &mut Frame<'_>, area: Rect, view: &View, ui: &Ui) {
    let [first, _, third] = header_lines(view);
    let second = progress(view, area.width.into());
    let mut top = vec![Span::styled("encke top  ", theme::title(true)), Span::styled(first, theme::strong())];
    if ui.paused {
        top.push(Span::styled("  PAUSED ", theme::notice()));
    }
    let second = match &view.notice {
        Some(notice) => Line::styled(format!(" {notice} "), theme::notice()),
        None if view.tracks.alerts > 0 => Line::styled(second, theme::alarm()),
        None if view.step != "nominal" => Line::styled(second, theme::warning()),
        None => Line::from(second),
    };
    let third = if view.latency.missed > 0 { Line::styled(third, theme::alarm()) } else { Line::from(third) };
    // In the fewest lines the last of them is the one to have.
    let lines = match area.height {
        1 if view.notice.is_some() || view.tracks.alerts > 0 => vec![second],
        1 => vec![third],
        _ => vec![Line::from(top), second, third],
    };
    frame.render_widget(Paragraph::new(lines), area);
}

pub(super) fn draw_footer(frame: &mut Frame<'_>, area: Rect, view: &View, ui: &Ui) {
    let keys =
        if ui.zoomed { "q quit  enter all panels  ? help" } else { "q quit  tab panel  enter zoom  p pause  ? help" };
    let seen = match view.tap.missed {
        0 => String::new(),
        missed => format!("   unseen here: {missed} parts ({:.1} %)", view.tap.missed_pct()),
    };
    let cpu = |process: crate::top::view::ProcessView| tenths(process.cpu_pct);
    let own = format!("supervisor {} %, this view {} % cpu{seen}", cpu(view.supervisor), cpu(view.viewer));
    let gap = usize::from(area.width).saturating_sub(keys.chars().count() + own.chars().count());
    let line = if gap > 0 { format!("{keys}{}{own}", " ".repeat(gap)) } else { keys.to_owned() };
    frame.render_widget(Paragraph::new(Line::styled(line, theme::faint())), area);
}

/// The last two members of a path, enough to know it by.
fn short(path: &str) -> &str {
    let mut slashes = path.char_indices().rev().filter(|(_, letter)| *letter == '/').map(|(place, _)| place);
    slashes.nth(1).map_or(path, |place| &path[place + 1..])
}

/// Minutes and seconds, and hours once there are some.
pub(super) fn clock(s: f64) -> String {
    let s = s.max(0.0) as u64;
    let hours = if s < 3_600 { String::new() } else { format!("{}:", s / 3_600) };
    format!("{hours}{:02}:{:02}", s / 60 % 60, s % 60)
}
