//! The latency of sweep after sweep as bars over a logarithmic scale, so that milliseconds and a deadline of a hundred both
//! show.

use ratatui::Frame;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;

use super::{header, theme, titled};
use crate::top::ui::{Panel, Ui};
use crate::top::view::{LatencyView, View};

/// Room for the scale.
const SCALE: u16 = 8;
/// Width of the whole title.
const TITLE: u16 = 56;
const BARS: [&str; 9] = [" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"];
/// What the scale's foot is of its deadline, and its top.
const FOOT: f64 = 1e-2;
const TOP: f64 = 2.0;

pub(super) fn draw(frame: &mut Frame<'_>, area: Rect, view: &View, ui: &Ui) {
    let chosen = ui.panel == Panel::Latency;
    let found = &view.latency;
    let mut title = vec![Span::styled(" latency ", theme::title(chosen))];
    if ui.zoomed {
        title.push(Span::raw(header::latency(view)));
    } else {
        let missed = if found.missed > 0 { theme::alarm() } else { theme::faint() };
        let of = if area.width < TITLE { "" } else { "of the last sweeps: " };
        title.push(Span::styled(format!("{of}{} answered, {} missed ", found.sweeps, found.missed), missed));
    }
    let (block, inner) = titled(area, Line::from(title), chosen);
    block.render(area, frame.buffer_mut());
    if inner.height > 0 && inner.width > SCALE {
        bars(frame.buffer_mut(), inner, found);
    }
}

/// A logarithmic scale over so many rows.
struct Scale {
    foot_ms: f64,
    top_ms: f64,
    rows: u16,
}

impl Scale {
    fn of(found: &LatencyView, rows: u16) -> Self {
        let longest_ms = found.recent_ms.iter().flatten().copied().fold(0.0, f64::max);
        let deadline_ms = found.deadline_ms.unwrap_or(longest_ms.max(1.0));
        Self { foot_ms: deadline_ms * FOOT, top_ms: (deadline_ms * TOP).max(longest_ms * 1.2), rows }
    }

    /// Eighths of a row from the foot.
    fn eighths(&self, ms: f64) -> u16 {
        let share = (ms.max(self.foot_ms) / self.foot_ms).ln() / (self.top_ms / self.foot_ms).ln();
        (share.clamp(0.0, 1.0) * f64::from(self.rows) * 8.0).round() as u16
    }

    /// Row from the foot in which a value ends.
    fn row(&self, ms: f64) -> u16 {
        (self.eighths(ms).max(1) - 1) / 8
    }
}

fn bars(buffer: &mut Buffer, area: Rect, found: &LatencyView) {
    let scale = Scale::of(found, area.height);
    let line = found.deadline_ms.map(|ms| scale.row(ms));
    let y = |row: u16| area.bottom() - 1 - row;
    let marks = [found.deadline_ms, Some(1.0), Some(10.0), Some(100.0), Some(1_000.0)];
    let mut free = vec![true; usize::from(area.height)];
    for (place, ms) in marks.into_iter().enumerate().filter_map(|(place, ms)| Some((place, ms?))) {
        let inside = ms > scale.foot_ms && ms < scale.top_ms;
        let row = scale.row(ms);
        if inside && std::mem::take(&mut free[usize::from(row)]) {
            let style = if place == 0 { theme::warning() } else { theme::faint() };
            buffer.set_string(area.x, y(row), format!("{ms:>4.0} ms "), style);
        }
    }
    let left = area.x + SCALE;
    if let Some(row) = line {
        buffer.set_string(left, y(row), "╌".repeat(usize::from(area.right() - left)), theme::warning());
    }
    let room = usize::from(area.right() - left);
    let recent = &found.recent_ms[found.recent_ms.len().saturating_sub(room)..];
    let first = area.right() - recent.len() as u16;
    for (x, latency_ms) in (first..).zip(recent) {
        match latency_ms {
            Some(ms) => {
                bar(buffer, x, area, scale.eighths(*ms).max(1), found.deadline_ms.is_some_and(|limit| *ms > limit))
            }
            None => buffer.set_string(x, y(0), "×", theme::alarm()),
        }
    }
}

/// A bar of so many eighths; one that is late has a sign on top, for those who see no colour.
fn bar(buffer: &mut Buffer, x: u16, area: Rect, eighths: u16, late: bool) {
    let style = if late { theme::alarm() } else { theme::bar() };
    for row in 0..area.height {
        let filled = eighths.saturating_sub(row * 8).min(8);
        let y = area.bottom() - 1 - row;
        if filled > 0 {
            buffer.set_string(x, y, BARS[usize::from(filled)], style);
        } else if late && row * 8 >= eighths {
            buffer.set_string(x, y, "▲", style);
            return;
        }
    }
}
