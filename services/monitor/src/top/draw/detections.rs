use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Widget};

use super::{theme, titled};
use crate::top::text::size;
use crate::top::ui::{Panel, Ui};
use crate::top::view::{DetectionRow, View};

pub(super) fn draw(frame: &mut Frame<'_>, area: Rect, view: &View, ui: &Ui) {
    let chosen = ui.panel == Panel::Detections;
    let found = &view.detections;
    let of = found.sweep.map_or("none yet ".to_owned(), |sweep| format!("of sweep {sweep} "));
    let part = if found.sweep.is_some() && !found.complete { "(in part) " } else { "" };
    let title = [Span::styled(" obstacles ", theme::title(chosen)), Span::styled(of + part, theme::faint())];
    let (block, inner) = titled(area, Line::from_iter(title), chosen);
    block.render(area, frame.buffer_mut());

    let classes = found.classes.iter().flat_map(|(class, clusters)| {
        let short = class.get(..4).unwrap_or(class);
        [Span::styled(format!("{short} "), theme::class(class)), Span::styled(format!("{clusters}  "), theme::strong())]
    });
    let wide = inner.width >= 58;
    let head = if wide {
        "cluster class         p    range m points  size m"
    } else {
        "cluster class         p  range m points"
    };
    let mut lines = vec![Line::from_iter(classes), Line::styled(head, theme::faint())];
    let room = usize::from(inner.height).saturating_sub(lines.len());
    let from = ui.detections_from.min(found.rows.len().saturating_sub(room));
    lines.extend(found.rows.iter().skip(from).take(room).map(|row| line(row, wide)));
    frame.render_widget(Paragraph::new(lines), inner);
}

fn line(row: &DetectionRow, wide: bool) -> Line<'static> {
    let p = row.p.map_or("-".to_owned(), |p| format!("{p:.2}"));
    let numbers = if wide {
        format!("{p:>5} {:>9.2} {:>6}  {}", row.range_m, row.points, size(row))
    } else {
        format!("{p:>4} {:>8.2} {:>6}", row.range_m, row.points)
    };
    Line::from_iter([
        Span::raw(format!("{:>7} ", row.cluster)),
        Span::styled(format!("{:<12}", row.class), theme::class(row.class)),
        Span::raw(numbers),
    ])
}
