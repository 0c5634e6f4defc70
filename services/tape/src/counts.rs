//! What a recording holds and what it lacks.

use serde::{Deserialize, Serialize};

use crate::Topic;
use crate::topic::TOPICS;

/// A number for each topic.
pub(crate) type Tally = [u64; TOPICS];

/// Adds `from` to `to`.
pub(crate) fn add(to: &mut Tally, from: &Tally) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += from;
    }
}

/// Messages of one topic.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TopicCounts {
    /// The channel's name.
    pub topic: String,
    /// Messages in the files that are there.
    pub messages: u64,
    /// Messages in files that were removed for the quota.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub removed: u64,
    /// Messages that should be there and never came, or could not be written.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub lost: u64,
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// What one life of a recording has done.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Topics that were asked for, by their number.
    pub topics: Vec<TopicCounts>,
    /// Files that were begun.
    pub files: u64,
    /// Files that were removed for the quota, those of earlier lives included.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub removed_files: u64,
    /// Bytes of all files that were begun.
    pub bytes: u64,
    /// Parts of sweeps that came again and were not written again.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub doubles: u64,
    /// What the latest write error said, where there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

impl Counts {
    /// Counts of a topic; none where it was not asked for.
    pub fn of(&self, topic: Topic) -> Option<&TopicCounts> {
        self.topics.iter().find(|counts| counts.topic == topic.name())
    }

    /// Messages of all topics that are lost.
    pub fn lost(&self) -> u64 {
        self.topics.iter().map(|counts| counts.lost).sum()
    }

    /// Adds what another life of the same recording has done.
    pub fn add(&mut self, other: &Self) {
        for theirs in &other.topics {
            match self.topics.iter_mut().find(|ours| ours.topic == theirs.topic) {
                Some(ours) => {
                    ours.messages += theirs.messages;
                    ours.removed += theirs.removed;
                    ours.lost += theirs.lost;
                }
                None => self.topics.push(theirs.clone()),
            }
        }
        self.files += other.files;
        self.removed_files += other.removed_files;
        self.bytes += other.bytes;
        self.doubles += other.doubles;
        if other.failure.is_some() {
            self.failure.clone_from(&other.failure);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lives_add_up_and_read_back_from_json() {
        let counts = |messages, lost, failure: Option<&str>| Counts {
            topics: vec![TopicCounts { topic: "/encke/sweep".into(), messages, removed: 0, lost }],
            files: 1,
            bytes: 10,
            failure: failure.map(Into::into),
            ..Counts::default()
        };
        let mut sum = counts(5, 0, Some("full"));
        sum.add(&counts(3, 2, None));
        assert_eq!(sum, Counts { files: 2, bytes: 20, ..counts(8, 2, Some("full")) });
        assert_eq!((sum.of(Topic::Sweep).map(|of| of.messages), sum.of(Topic::Truth), sum.lost()), (Some(8), None, 2));
        let text = serde_json::to_string(&sum).unwrap();
        assert_eq!(serde_json::from_str::<Counts>(&text).unwrap(), sum);
    }
}
