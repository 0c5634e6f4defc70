//! The latest table of tracks, as long as there is a place to tap from.

use messages::{TrackState, TrackTable, Tracks};
use runtime::Plan;
use transport::{Instance, Node, Tap};

use super::look::Look;

/// What is told of a table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Tracked {
    /// Tracks by number of their state.
    pub(super) states: [u64; 3],
    pub(super) alerts: u64,
    /// Of the likeliest collision.
    pub(super) probability: f32,
    /// Of the track that it is likeliest with: when it comes closest, and how near; none where nothing approaches.
    pub(super) approach: Option<(f32, f32)>,
    /// When it was sent, host time [ns].
    pub(super) sent_ns: u64,
}

impl Tracked {
    fn of(table: &TrackTable, sent_ns: u64) -> Self {
        let mut tracked = Self { sent_ns, ..Self::default() };
        for track in &table.tracks {
            tracked.states[track.state as usize] += 1;
            tracked.alerts += u64::from(track.alert != 0);
            let approach = &track.approach;
            if track.state != TrackState::Tentative && approach.collision_probability > tracked.probability {
                tracked.probability = approach.collision_probability;
                tracked.approach = Some((approach.time_s, approach.distance_m));
            }
        }
        tracked
    }
}

/// A tap on the last topic that is emptied at each request: what has overflowed by then is older than what is there.
pub(super) struct Ears<'a> {
    instance: &'a Instance,
    /// Of the chain that is tapped, or could not be.
    supervisor_pid: u32,
    /// The tap before the node whose guest it is.
    tap: Option<(Tap<Tracks>, Node)>,
    latest: Option<Tracked>,
}

impl<'a> Ears<'a> {
    pub(super) fn new(instance: &'a Instance) -> Self {
        Self { instance, supervisor_pid: 0, tap: None, latest: None }
    }

    /// What the tracker of the chain looked at has said last; none where it said that it does not know, nothing yet, or
    /// where all places for viewers are taken. Then it is tried again with the next look.
    pub(super) fn hear(&mut self, look: &Look) -> Option<&Tracked> {
        if look.supervisor_pid != self.supervisor_pid {
            self.leave();
            self.supervisor_pid = look.supervisor_pid;
        }
        // Where the chain goes on with other files in shared memory, it is tapped anew; it may not have made them yet.
        if self.tap.as_ref().is_none_or(|(_, node)| node.is_left_behind())
            && let Some(tap) = self.attach()
        {
            self.tap = Some(tap);
        }
        while let Some((tap, _)) = &self.tap {
            match tap.take() {
                Ok(Some(taken)) if taken.trace().part.is_last() => {
                    let sent_ns = taken.trace().hops().last().map_or(0, |hop| hop.finished_ns);
                    let table = &taken.message().table;
                    self.latest = (table.time_ns > 0).then(|| Tracked::of(table, sent_ns));
                }
                Ok(Some(_)) => {}
                Ok(None) => break,
                Err(_) => self.leave(),
            }
        }
        self.latest.as_ref()
    }

    /// Holds nothing of a chain that has ended.
    pub(super) fn leave(&mut self) {
        (self.supervisor_pid, self.tap, self.latest) = (0, None, None);
    }

    fn attach(&self) -> Option<(Tap<Tracks>, Node)> {
        let plan = Plan::read(self.instance).ok()?;
        let node = Node::visit(self.instance, "metrics", plan.chain.queue_parts()).ok()?;
        Some((node.tap().ok()?, node))
    }
}

#[cfg(test)]
mod tests {
    use messages::{ClosestApproach, Track};
    use zerocopy::FromZeros;

    use super::*;

    #[test]
    fn a_table_is_told_by_states_alerts_and_its_likeliest_collision() {
        let mut table = TrackTable::new_box_zeroed().unwrap();
        assert_eq!(Tracked::of(&table, 7), Tracked { sent_ns: 7, ..Tracked::default() });
        let states = [TrackState::Confirmed, TrackState::Coasting, TrackState::Tentative, TrackState::Confirmed];
        for (place, state) in states.into_iter().enumerate() {
            let approach = ClosestApproach {
                time_s: place as f32,
                distance_m: 2.0 * place as f32,
                collision_probability: 0.125 * place as f32,
                ..ClosestApproach::default()
            };
            let track = Track { state, approach, alert: u8::from(place == 3), ..Track::default() };
            table.tracks.push(track).unwrap();
        }
        let told = Tracked::of(&table, 7);
        assert_eq!((told.states, told.alerts), ([1, 2, 1], 1));
        assert_eq!((told.probability, told.approach), (0.375, Some((3.0, 6.0))));
    }
}
