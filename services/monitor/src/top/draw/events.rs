use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Widget};

use super::header::clock;
use super::{theme, titled};
use crate::top::ui::{Panel, Ui};
use crate::top::view::{EventView, View};

pub(super) fn draw(frame: &mut Frame<'_>, area: Rect, view: &View, ui: &Ui) {
    let chosen = ui.panel == Panel::Events;
    let (block, inner) = titled(area, Line::styled(" events ", theme::title(chosen)), chosen);
    block.render(area, frame.buffer_mut());
    let room = usize::from(inner.height);
    let end = view.events.len() - ui.events_back.min(view.events.len().saturating_sub(room));
    let lines: Vec<Line<'_>> = if view.events.is_empty() {
        vec![Line::styled("none", theme::faint())]
    } else {
        view.events[end.saturating_sub(room)..end].iter().map(line).collect()
    };
    frame.render_widget(Paragraph::new(lines), inner);
}

fn line(event: &EventView) -> Line<'_> {
    let (sign, style) = if event.grave { ("! ", theme::alarm()) } else { ("  ", ratatui::style::Style::new()) };
    // What is the whole chain's says so by itself.
    let stage = if event.stage == "chain" { String::new() } else { format!("{} ", event.stage) };
    Line::from_iter([
        Span::styled(clock(event.at_s), theme::faint()),
        Span::styled(format!(" {sign}"), style),
        Span::styled(stage, theme::strong()),
        Span::styled(event.what.as_str(), style),
    ])
}
