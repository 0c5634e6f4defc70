//! What a recording has done so far.

use super::Tape;
use crate::counts::{Counts, TopicCounts};
use crate::topic::Topic;

impl Tape {
    /// All sweeps below this number are in the system's hands with all that is written of a sweep, or were given up.
    /// Truth and raw parts in between do not count. Rises with [`Tape::checkpoint`], and where a chunk has ended.
    pub fn done_sweeps(&mut self) -> u64 {
        if !self.reels.is_open() {
            self.done_sweeps = self.settled();
        }
        self.done_sweeps
    }

    pub(super) fn settled(&self) -> u64 {
        let has = |topics: &[Topic]| topics.iter().any(|&topic| self.reels.settings().has(topic));
        let sweeps = has(&[Topic::RawSweep, Topic::Sweep, Topic::Clusters]).then_some(self.sweeps.next());
        let detections =
            has(&[Topic::RawDetections, Topic::Detections, Topic::Clusters]).then_some(self.detections.next());
        let tracks = has(&[Topic::RawTracks, Topic::Tracks]).then_some(self.tracks.next());
        [sweeps, detections, tracks].into_iter().flatten().min().unwrap_or(u64::MAX)
    }

    /// What is in the files and what is lost, as of the latest commit; what is in an open chunk is in neither.
    pub fn counts(&self) -> Counts {
        let reels = &self.reels;
        let (messages, paired_below) = (reels.messages(), self.sweeps.next().min(self.detections.next()));
        let count = |&topic: &Topic| {
            let never_came = match topic {
                Topic::Sweep | Topic::RawSweep => self.sweeps.lost(),
                Topic::Detections | Topic::RawDetections => self.detections.lost(),
                Topic::Clusters => (paired_below - self.first_sweep).saturating_sub(self.pairs.paired),
                Topic::Tracks | Topic::RawTracks => self.tracks.lost(),
                Topic::Truth => self.truths.lost(),
                Topic::RawClusters => self.raw_clusters.lost(),
                Topic::RawDescriptors => self.raw_descriptors.lost(),
                Topic::Events | Topic::Status => 0,
            };
            TopicCounts {
                topic: topic.name().into(),
                messages: messages[topic as usize],
                removed: reels.kept.removed[topic as usize],
                lost: reels.lost[topic as usize] + never_came,
            }
        };
        // Tracks come in the parts of the detections.
        let streams = [&self.sweeps, &self.detections, &self.truths, &self.raw_clusters, &self.raw_descriptors];
        Counts {
            topics: reels.settings().topics().iter().map(count).collect(),
            files: reels.files,
            removed_files: reels.kept.removed_files,
            bytes: reels.bytes(),
            doubles: streams.iter().map(|stream| stream.doubles()).sum(),
            failure: reels.failure.clone(),
        }
    }
}
