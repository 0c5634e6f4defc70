//! What belongs to a moment rather than to a sweep, and waits for the first sweep to learn the sensor's time.

use crate::Topic;
use crate::words::{Event, Level, put_event};

/// Most that wait.
const MOST: usize = 256;

/// An event or a state, at a host time.
pub(crate) struct Moment<'a> {
    pub(crate) topic: Topic,
    /// The host's UTC [ns].
    pub(crate) utc_ns: u64,
    pub(crate) what: What<'a>,
}

/// What is said.
pub(crate) enum What<'a> {
    Event(Event<'a>),
    /// JSON.
    Status(&'a [u8]),
}

impl Moment<'_> {
    /// Appends the message, stamped with the sensor's time [ns].
    pub(crate) fn put(&self, sensor_time_ns: u64, out: &mut Vec<u8>) {
        match &self.what {
            What::Event(event) => put_event(event, sensor_time_ns, out),
            What::Status(json) => out.extend_from_slice(json),
        }
    }
}

/// A moment that is kept.
pub(crate) struct Kept {
    topic: Topic,
    utc_ns: u64,
    /// Of an event.
    level: Option<Level>,
    name: String,
    word: String,
    number: u64,
    /// An event's message, or JSON.
    bytes: Vec<u8>,
}

impl Kept {
    /// As it came.
    pub(crate) fn moment(&self) -> Moment<'_> {
        let what = match self.level {
            // Came as a string.
            Some(level) => {
                let message = std::str::from_utf8(&self.bytes).unwrap_or_default();
                What::Event(Event { level, name: &self.name, word: &self.word, number: self.number, message })
            }
            None => What::Status(&self.bytes),
        };
        Moment { topic: self.topic, utc_ns: self.utc_ns, what }
    }
}

/// Moments before the first sweep.
#[derive(Default)]
pub(crate) struct Early {
    kept: Vec<Kept>,
}

impl Early {
    /// Keeps a moment; false where too many wait.
    pub(crate) fn keep(&mut self, moment: &Moment<'_>) -> bool {
        if self.kept.len() >= MOST {
            return false;
        }
        let (topic, utc_ns) = (moment.topic, moment.utc_ns);
        self.kept.push(match moment.what {
            What::Event(Event { level, name, word, number, message }) => {
                let (name, word, bytes) = (name.to_owned(), word.to_owned(), message.as_bytes().to_vec());
                Kept { topic, utc_ns, level: Some(level), name, word, number, bytes }
            }
            What::Status(json) => {
                let (name, word, bytes) = (String::new(), String::new(), json.to_vec());
                Kept { topic, utc_ns, level: None, name, word, number: 0, bytes }
            }
        });
        true
    }

    /// All that were kept, in the order in which they came.
    pub(crate) fn take(&mut self) -> Vec<Kept> {
        std::mem::take(&mut self.kept)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bounded_number_of_moments_comes_out_as_it_came() {
        let mut sut = Early::default();
        let event = Event { level: Level::Error, name: "replay", word: "torn", number: 3, message: "at byte 7" };
        assert!(sut.keep(&Moment { topic: Topic::Events, utc_ns: 5, what: What::Event(event) }));
        assert!(sut.keep(&Moment { topic: Topic::Status, utc_ns: 6, what: What::Status(b"{}") }));
        let kept = sut.take();
        assert!(matches!(kept[0].moment(), Moment { utc_ns: 5, what: What::Event(of), .. } if of == event));
        assert!(matches!(kept[1].moment(), Moment { utc_ns: 6, what: What::Status(b"{}"), .. }));
        for place in 0..=MOST {
            let moment = Moment { topic: Topic::Status, utc_ns: 0, what: What::Status(b"") };
            assert_eq!(sut.keep(&moment), place < MOST);
        }
    }
}
