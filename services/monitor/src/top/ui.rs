use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

/// A part of the screen that can be chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Panel {
    #[default]
    Stages,
    Latency,
    Detections,
    Tracks,
    Events,
}

impl Panel {
    pub(crate) const ALL: [Self; 5] = [Self::Stages, Self::Latency, Self::Detections, Self::Tracks, Self::Events];
}

/// What the person at the terminal has chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Ui {
    pub(crate) panel: Panel,
    /// The chosen panel has the whole screen.
    pub(crate) zoomed: bool,
    /// Groups of columns that the table of stages begins after.
    pub(crate) columns: usize,
    /// First row of the detections and of the tracks, and events above the latest.
    pub(crate) detections_from: usize,
    pub(crate) tracks_from: usize,
    pub(crate) events_back: usize,
    pub(crate) paused: bool,
    pub(crate) help: bool,
}

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Asked {
    Nothing,
    Redraw,
    Leave,
}

impl Ui {
    /// Handles a key. Scrolling stops at 0 here and at the end when it is drawn.
    pub(crate) fn key(&mut self, key: KeyEvent) -> Asked {
        if key.kind == KeyEventKind::Release {
            return Asked::Nothing;
        }
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        match key.code {
            KeyCode::Char('c') if control => return Asked::Leave,
            KeyCode::Char('q') => return Asked::Leave,
            KeyCode::Char('?' | 'h') => self.help = !self.help,
            KeyCode::Esc if self.help => self.help = false,
            KeyCode::Esc => self.zoomed = false,
            KeyCode::Char('p' | ' ') => self.paused = !self.paused,
            KeyCode::Enter | KeyCode::Char('z') => self.zoomed = !self.zoomed,
            KeyCode::Tab => self.choose(1),
            KeyCode::BackTab => self.choose(Panel::ALL.len() - 1),
            KeyCode::Left => self.columns = (self.columns + super::draw::GROUPS - 1) % super::draw::GROUPS,
            KeyCode::Right => self.columns = (self.columns + 1) % super::draw::GROUPS,
            KeyCode::Down => self.scroll(1),
            KeyCode::Up => self.scroll(-1),
            KeyCode::PageDown => self.scroll(10),
            KeyCode::PageUp => self.scroll(-10),
            KeyCode::Home => (self.detections_from, self.tracks_from, self.events_back) = (0, 0, 0),
            _ => return Asked::Nothing,
        }
        Asked::Redraw
    }

    fn choose(&mut self, steps: usize) {
        let place = Panel::ALL.iter().position(|panel| *panel == self.panel).unwrap_or(0);
        self.panel = Panel::ALL[(place + steps) % Panel::ALL.len()];
    }

    fn scroll(&mut self, rows: isize) {
        match self.panel {
            Panel::Detections => self.detections_from = self.detections_from.saturating_add_signed(rows),
            Panel::Tracks => self.tracks_from = self.tracks_from.saturating_add_signed(rows),
            // The latest event is at the bottom.
            Panel::Events => self.events_back = self.events_back.saturating_add_signed(-rows),
            Panel::Stages | Panel::Latency => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(ui: &mut Ui, code: KeyCode) -> Asked {
        ui.key(KeyEvent::new(code, KeyModifiers::NONE))
    }

    #[test]
    fn tab_goes_round_the_panels_and_back() {
        let mut sut = Ui::default();
        for panel in [Panel::Latency, Panel::Detections, Panel::Tracks, Panel::Events, Panel::Stages] {
            assert_eq!(press(&mut sut, KeyCode::Tab), Asked::Redraw);
            assert_eq!(sut.panel, panel);
        }
        press(&mut sut, KeyCode::BackTab);
        assert_eq!(sut.panel, Panel::Events);
    }

    #[test]
    fn arrows_scroll_the_chosen_panel_alone_and_never_before_its_start() {
        let mut sut = Ui { panel: Panel::Detections, ..Ui::default() };
        press(&mut sut, KeyCode::Up);
        press(&mut sut, KeyCode::Down);
        press(&mut sut, KeyCode::Down);
        assert_eq!((sut.detections_from, sut.events_back), (2, 0));
        sut.panel = Panel::Events;
        press(&mut sut, KeyCode::Up);
        assert_eq!((sut.detections_from, sut.events_back), (2, 1));
        sut.panel = Panel::Tracks;
        press(&mut sut, KeyCode::PageDown);
        press(&mut sut, KeyCode::Up);
        assert_eq!((sut.detections_from, sut.tracks_from, sut.events_back), (2, 9, 1));
    }

    #[test]
    fn q_and_control_c_leave_and_a_plain_c_does_not() {
        let mut sut = Ui::default();
        assert_eq!(press(&mut sut, KeyCode::Char('q')), Asked::Leave);
        assert_eq!(sut.key(KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL)), Asked::Leave);
        assert_eq!(press(&mut sut, KeyCode::Char('c')), Asked::Nothing);
    }
}
