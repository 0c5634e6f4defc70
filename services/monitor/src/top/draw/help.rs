use ratatui::Frame;
use ratatui::layout::{Constraint, Flex, Layout, Rect};
use ratatui::text::Line;
use ratatui::widgets::{Block, Clear, Paragraph};

use super::theme;

const HELP: [&str; 18] = [
    "q, Ctrl-C    leave; the chain goes on",
    "tab          next panel; shift-tab the one before",
    "enter, z     the chosen panel alone, and back",
    "up, down     scroll obstacles, tracks or events",
    "left, right  other columns of the stages",
    "p            pause what is shown; nothing is missed",
    "?            this",
    "",
    "busy   share of the time at work on parts",
    "p50    work on one sweep, of the last 100",
    "over   sweeps beyond the stage's budget",
    "slips  parts that waited while it was busy",
    "late   sweeps that left it after the deadline",
    "▲      late      × not answered",
    "t, d, p  closest approach: when, how near, how likely",
    "!  on alert      ~  coasting      ?  tentative",
    "A margin is what the deadline leaves at p50,",
    "p99 and the longest of the last 100 sweeps.",
];

pub(super) fn draw(frame: &mut Frame<'_>, area: Rect) {
    let [row] = Layout::vertical([Constraint::Length(HELP.len() as u16 + 2)]).flex(Flex::Center).areas(area);
    let [window] = Layout::horizontal([Constraint::Length(56)]).flex(Flex::Center).areas(row);
    let block = Block::bordered().border_style(theme::rule(true)).title(Line::styled(" help ", theme::title(true)));
    frame.render_widget(Clear, window);
    frame.render_widget(Paragraph::new(HELP.map(Line::from).to_vec()).block(block), window);
}
