//! A view → a frame. Everything shown is in the view; nothing is remembered from frame to frame.

mod columns;
mod detections;
mod events;
mod graph;
mod header;
mod help;
mod stages;
#[cfg(test)]
mod tests;
mod theme;
mod tracks;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::Line;
use ratatui::widgets::{Block, Borders};

use super::ui::{Panel, Ui};
use super::view::View;
pub(super) use columns::{COLUMNS, GROUPS};
pub(super) use header::header_lines;

/// Below this the chosen panel alone is drawn.
const LEAST_HEIGHT: u16 = 20;
const LEAST_WIDTH: u16 = 64;
/// From this on obstacles and tracks stand beside latency and events, with all of their columns.
const WIDE: u16 = 150;

/// Draws a view.
pub(super) fn draw(frame: &mut Frame<'_>, view: &View, ui: &Ui) {
    let area = frame.area();
    if area.is_empty() {
        return;
    }
    if area.height < 5 {
        header::draw(frame, area, view, ui);
        return;
    }
    let [head, body, foot] =
        Layout::vertical([Constraint::Length(3), Constraint::Min(0), Constraint::Length(1)]).areas(area);
    header::draw(frame, head, view, ui);
    header::draw_footer(frame, foot, view, ui);
    if ui.zoomed || area.height < LEAST_HEIGHT || area.width < LEAST_WIDTH {
        panel(frame, body, view, ui, ui.panel);
    } else {
        all(frame, body, view, ui);
    }
    if ui.help {
        help::draw(frame, area);
    }
}

fn all(frame: &mut Frame<'_>, body: Rect, view: &View, ui: &Ui) {
    let tables = stages::tables(body.width, ui.columns);
    let table = view.stages.len() as u16 + 2;
    // All columns, in tables one below the other, where there is room for them and for what stands below.
    let fits = tables.len() as u16 * table + LEAST_HEIGHT <= body.height + 6;
    let height = if fits { tables.len() as u16 * table } else { table };
    let [top, rest] = Layout::vertical([Constraint::Length(height), Constraint::Min(0)]).areas(body);
    panel(frame, top, view, ui, Panel::Stages);
    if body.width >= WIDE {
        let [left, right] = Layout::horizontal([Constraint::Percentage(55), Constraint::Percentage(45)]).areas(rest);
        // The signs of tracks begin where words of events end.
        let left = Rect { width: left.width.saturating_sub(1), ..left };
        let [latency, events] = Layout::vertical([Constraint::Percentage(55), Constraint::Percentage(45)]).areas(left);
        panel(frame, latency, view, ui, Panel::Latency);
        panel(frame, events, view, ui, Panel::Events);
        let [detections, tracks] = Layout::vertical([Constraint::Percentage(50); 2]).areas(right);
        panel(frame, detections, view, ui, Panel::Detections);
        panel(frame, tracks, view, ui, Panel::Tracks);
        return;
    }
    let [high, low] = Layout::vertical([Constraint::Percentage(45), Constraint::Percentage(55)]).areas(rest);
    // The detections' columns are as wide as they are; tracks and events use what is left.
    let left = (body.width * 5 / 9).clamp(44, 62);
    let halves = Layout::horizontal([Constraint::Length(left), Constraint::Min(0)]);
    let ([latency, events], [detections, tracks]) = (halves.areas(high), halves.areas(low));
    panel(frame, latency, view, ui, Panel::Latency);
    panel(frame, events, view, ui, Panel::Events);
    panel(frame, detections, view, ui, Panel::Detections);
    panel(frame, tracks, view, ui, Panel::Tracks);
}

fn panel(frame: &mut Frame<'_>, area: Rect, view: &View, ui: &Ui, which: Panel) {
    match which {
        Panel::Stages => stages::draw(frame, area, view, ui),
        Panel::Latency => graph::draw(frame, area, view, ui),
        Panel::Detections => detections::draw(frame, area, view, ui),
        Panel::Tracks => tracks::draw(frame, area, view, ui),
        Panel::Events => events::draw(frame, area, view, ui),
    }
}

/// The line above a panel; where it is drawn, what is below it.
fn titled<'a>(area: Rect, title: impl Into<Line<'a>>, chosen: bool) -> (Block<'a>, Rect) {
    let block = Block::new().borders(Borders::TOP).border_style(theme::rule(chosen)).title(title);
    let inner = block.inner(area);
    (block, inner)
}
