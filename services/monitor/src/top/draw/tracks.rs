use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Widget};

use super::{theme, titled};
use crate::top::text::probability;
use crate::top::ui::{Panel, Ui};
use crate::top::view::{TrackRow, TracksView, View};

/// From this width on state, speed and range have columns of their own.
const WIDE: u16 = 67;

pub(super) fn draw(frame: &mut Frame<'_>, area: Rect, view: &View, ui: &Ui) {
    let chosen = ui.panel == Panel::Tracks;
    let found = &view.tracks;
    let of = match found.sweep {
        Some(sweep) if found.known => format!("of sweep {sweep} "),
        Some(sweep) => format!("of sweep {sweep}: NOT KNOWN "),
        None => "none yet ".to_owned(),
    };
    let style = if found.sweep.is_some() && !found.known { theme::warning() } else { theme::faint() };
    let title = [Span::styled(" tracks ", theme::title(chosen)), Span::styled(of, style)];
    let (block, inner) = titled(area, Line::from_iter(title), chosen);
    block.render(area, frame.buffer_mut());

    let wide = inner.width >= WIDE;
    let head = if wide {
        "    track class       state       m/s range m    t s    d m      p"
    } else {
        "    track class   t s    d m      p"
    };
    let mut lines = vec![counts(found), Line::styled(head, theme::faint())];
    let room = usize::from(inner.height).saturating_sub(lines.len());
    let from = ui.tracks_from.min(found.rows.len().saturating_sub(room));
    lines.extend(found.rows.iter().skip(from).take(room).map(|row| line(row, wide)));
    frame.render_widget(Paragraph::new(lines), inner);
}

fn counts(found: &TracksView) -> Line<'static> {
    let mut words = Vec::new();
    if found.alerts > 0 {
        words.push(Span::styled(format!("ALERT {}  ", found.alerts), theme::alarm()));
    }
    for (state, tracks) in &found.states {
        let short = state.get(..4).unwrap_or(state);
        words.push(Span::raw(format!("{short} ")));
        words.push(Span::styled(format!("{tracks}  "), theme::strong()));
    }
    Line::from(words)
}

fn line(row: &TrackRow, wide: bool) -> Line<'static> {
    let (sign, style) = match row.state {
        _ if row.alert => ("!", theme::alarm()),
        "coasting" => ("~", theme::faint()),
        "tentative" => ("?", theme::faint()),
        _ => (" ", Style::new()),
    };
    let tenths = |value: Option<f32>| value.map_or("-".to_owned(), |value| format!("{value:.1}"));
    let (time, distance) = (tenths(row.time_s), tenths(row.distance_m));
    let danger = format!("{time:>7}{distance:>7}{:>7}", probability(row.collision_probability));
    let (class, numbers) = if wide {
        let TrackRow { state, speed_mps, range_m, .. } = row;
        (format!("{:<12}", row.class), format!("{state:<10}{speed_mps:>5.2}{range_m:>8.1}{danger}"))
    } else {
        (format!("{:<4}", row.class.get(..4).unwrap_or(row.class)), danger)
    };
    let class_style = if row.alert { style } else { theme::class(row.class) };
    Line::from_iter([
        Span::styled(format!("{sign}{:>8} ", row.track), style),
        Span::styled(class, class_style),
        Span::styled(numbers, style),
    ])
}
