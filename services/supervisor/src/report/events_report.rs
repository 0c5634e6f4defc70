//! How often what happened, for the report.

use std::collections::BTreeMap;

use events::{DICTIONARY, Log, Severity};
use serde::{Deserialize, Serialize};

/// Events of a run by name.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct EventsReport {
    /// How often each was said.
    #[serde(flatten)]
    pub said: BTreeMap<String, u64>,
    /// Events of all kinds that came too often and were only counted.
    pub unsaid: u64,
    /// Lines that the log or its copy lacks because they could not be written.
    pub unwritten: u64,
}

impl EventsReport {
    pub(crate) fn of(log: &Log) -> Self {
        let said = log.counts().iter().map(|(name, count)| ((*name).to_owned(), *count)).collect();
        Self { said, unsaid: log.unsaid(), unwritten: log.unwritten() }
    }

    /// What was grave, the gravest first, in a line; none where nothing was.
    pub(crate) fn line(&self) -> Option<String> {
        let of = |severity: Severity| {
            let entries = DICTIONARY.iter().filter(move |entry| entry.severity == severity);
            entries.filter_map(|entry| Some(format!("{} {}", entry.name, self.said.get(entry.name)?)))
        };
        let mut words: Vec<String> =
            [Severity::Critical, Severity::Error, Severity::Warning].into_iter().flat_map(of).collect();
        for (count, what) in [(self.unsaid, "more of these unsaid"), (self.unwritten, "not written")] {
            if count > 0 {
                words.push(format!("{count} {what}"));
            }
        }
        (!words.is_empty()).then(|| words.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_grave_stands_in_one_line_and_what_is_as_it_should_be_does_not() {
        let said = [("stage_died", 2), ("run_began", 1), ("parts_dropped", 7)];
        let mut sut = EventsReport { unsaid: 30, ..EventsReport::default() };
        sut.said = said.map(|(name, count)| (name.to_owned(), count)).into();
        assert_eq!(sut.line().unwrap(), "stage_died 2, parts_dropped 7, 30 more of these unsaid");
        assert_eq!(serde_json::to_value(&sut).unwrap()["stage_died"], 2);
        let calm = EventsReport { said: [("run_ends".to_owned(), 1)].into(), ..EventsReport::default() };
        assert_eq!(calm.line(), None);
        let text = serde_json::to_string(&sut).unwrap();
        assert_eq!(serde_json::from_str::<EventsReport>(&text).unwrap(), sut);
    }
}
