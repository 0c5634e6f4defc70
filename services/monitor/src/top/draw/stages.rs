use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Widget};

use super::columns::{COLUMNS, Column, GROUPS, Look};
use super::{theme, titled};
use crate::top::ui::{Panel, Ui};
use crate::top::view::{StageView, View};

/// Width of the stages' names.
const NAME: u16 = 11;

/// The groups of columns for each table of this width, beginning after `first` groups: as many tables as it takes to show
/// all of them.
pub(super) fn tables(width: u16, first: usize) -> Vec<Vec<usize>> {
    let mut tables: Vec<Vec<usize>> = Vec::new();
    let mut used = u16::MAX;
    for group in (0..GROUPS).map(|place| (place + first) % GROUPS) {
        let wide: u16 = COLUMNS.iter().filter(|column| column.group == group).map(|column| column.width).sum();
        if used.saturating_add(wide) > width {
            tables.push(Vec::new());
            used = NAME;
        }
        if let Some(table) = tables.last_mut() {
            table.push(group);
        }
        used = used.saturating_add(wide);
    }
    // Whole turns of what fits are shown in their usual order.
    tables.iter_mut().for_each(|table| table.sort_unstable());
    tables
}

pub(super) fn draw(frame: &mut Frame<'_>, area: Rect, view: &View, ui: &Ui) {
    let chosen = ui.panel == Panel::Stages;
    let tables = tables(area.width, ui.columns);
    let height = view.stages.len() as u16 + 2;
    let shown = ((area.height / height.max(1)) as usize).clamp(1, tables.len());
    for (place, groups) in tables.iter().take(shown).enumerate() {
        let y = area.y + place as u16 * height;
        let part = Rect { y, height: height.min(area.bottom().saturating_sub(y)), ..area };
        let mut title = vec![Span::styled(" stages ", theme::title(chosen))];
        if place > 0 {
            title = Vec::new();
        } else if shown < tables.len() {
            title.push(Span::styled("← → more columns ", theme::faint()));
        }
        let (block, inner) = titled(part, Line::from(title), chosen);
        block.render(part, frame.buffer_mut());
        frame.render_widget(Paragraph::new(lines(view, groups)), inner);
    }
}

fn lines<'a>(view: &'a View, groups: &[usize]) -> Vec<Line<'a>> {
    let columns: Vec<&Column> = COLUMNS.iter().filter(|column| groups.contains(&column.group)).collect();
    let mut head = vec![Span::styled(format!("{:<11}", "stage"), theme::faint())];
    head.extend(columns.iter().map(|column| cell(column, column.title.to_owned(), theme::faint())));
    let mut lines = vec![Line::from(head)];
    for stage in &view.stages {
        let mut line = vec![Span::styled(format!("{:<11}", stage.stage), theme::strong())];
        line.extend(columns.iter().map(|column| cell(column, (column.value)(stage), style(column, stage))));
        lines.push(Line::from(line));
    }
    lines
}

fn cell<'a>(column: &Column, text: String, style: Style) -> Span<'a> {
    Span::styled(format!("{text:>width$}", width = usize::from(column.width)), style)
}

fn style(column: &Column, stage: &StageView) -> Style {
    let is_zero = || (column.value)(stage) == "0";
    match column.look {
        Look::State if stage.state == "died" => theme::alarm(),
        Look::State if stage.state != "running" => theme::warning(),
        Look::Warning if !is_zero() => theme::warning(),
        Look::Alarm if !is_zero() => theme::alarm(),
        Look::Warning | Look::Alarm => theme::faint(),
        _ => Style::new(),
    }
}
