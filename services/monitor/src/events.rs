//! What happened, from the log of the run, for people.

use std::collections::VecDeque;

use events::{CHAIN, Event, Severity};

use crate::top::EventView;

/// Events that are remembered.
const MOST: usize = 200;
/// The same at the same stage within this time is one event with a larger number [s].
const MERGE_S: f64 = 5.0;

#[derive(Clone, Debug)]
struct Line {
    at_s: f64,
    sweep: u64,
    stage: String,
    /// Its number in the dictionary; 0 for what this viewer says itself.
    id: u32,
    grave: bool,
    count: u64,
    text: String,
}

/// The latest events.
#[derive(Default)]
pub(crate) struct Events {
    lines: VecDeque<Line>,
}

impl Events {
    /// Adds an event of the log, `at_s` after the supervisor's start. What happens again soon is one line with a larger
    /// number, and the latest words.
    pub(crate) fn add(&mut self, at_s: f64, event: &Event) {
        let count = event.unsaid.saturating_add(1);
        let same = |line: &&mut Line| line.stage == event.stage && line.id == event.id && at_s - line.at_s < MERGE_S;
        let repeats = event.severity == Severity::Warning;
        if let Some(line) = self.lines.iter_mut().rev().find(same).filter(|_| repeats) {
            line.count = line.count.saturating_add(count);
            line.text = words(event);
            return;
        }
        self.push(Line {
            at_s,
            sweep: event.sweep,
            stage: event.stage.clone(),
            id: event.id,
            grave: event.severity >= Severity::Warning,
            count,
            text: words(event),
        });
    }

    /// The instance runs again.
    pub(crate) fn add_renewal(&mut self) {
        let text = "the instance was started anew".to_owned();
        self.push(Line { at_s: 0.0, sweep: 0, stage: CHAIN.to_owned(), id: 0, grave: false, count: 1, text });
    }

    fn push(&mut self, line: Line) {
        self.lines.push_back(line);
        if self.lines.len() > MOST {
            self.lines.pop_front();
        }
    }

    /// For people, oldest first.
    pub(crate) fn views(&self) -> Vec<EventView> {
        self.lines.iter().map(Line::view).collect()
    }
}

fn words(event: &Event) -> String {
    let name = event.name.replace('_', " ");
    if event.text.is_empty() { name } else { format!("{name}: {}", event.text) }
}

impl Line {
    fn view(&self) -> EventView {
        let Self { at_s, sweep, grave, .. } = *self;
        let what = match self.count {
            1 => self.text.clone(),
            count => format!("{} ({count} times)", self.text),
        };
        EventView { at_s, sweep, stage: self.stage.clone(), what, grave }
    }
}
