//! The time between data packets: it tells kinds of sensors apart where the factory byte cannot, as early VLP-16 carry the
//! HDL-32E's.

use lidar::SensorModel;

use super::packet::{BLOCKS, HOUR_US, Packet};

/// Steps that say enough.
const ENOUGH: usize = 100;
/// Fewer of them say nothing.
const FEW: usize = 8;
/// A live sensor's packets that are farther apart than this many times their spacing say nothing: it sees little of its turn.
const MOST_TIMES: u64 = 8;

/// Time between a sensor's packets [µs].
pub(super) fn expected_us(sensor: &SensorModel, is_dual: bool) -> u64 {
    let cycles = BLOCKS as u64 * u64::from(sensor.cycles_per_block()) / if is_dual { 2 } else { 1 };
    (cycles * u64::from(sensor.cycle_ns()) + 500) / 1_000
}

/// Whether packets so far apart [µs] are not those of a sensor with this spacing.
pub(super) fn is_another(found_us: u64, expected_us: u64) -> bool {
    found_us.abs_diff(expected_us) * 5 > expected_us
}

/// Where a packet stands among those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// So far behind the latest one [µs].
    After(u64),
    /// As late as the latest one, or earlier: packets may come twice, on two ways say.
    Before,
    /// It has no block, and no say.
    Nowhere,
}

fn place(latest_us: &mut Option<u64>, packet: &Packet) -> Place {
    if !(0..BLOCKS).any(|block| packet.is_block(block)) {
        return Place::Nowhere;
    }
    let stamp_us = packet.stamp_us() % HOUR_US;
    let step_us = (stamp_us + HOUR_US - latest_us.unwrap_or(stamp_us)) % HOUR_US;
    if step_us >= HOUR_US / 2 {
        return Place::Before;
    }
    *latest_us = Some(stamp_us);
    if step_us == 0 { Place::Before } else { Place::After(step_us) }
}

/// Times from packet to packet, of the first packets of a recording.
#[derive(Clone, Debug, Default)]
pub(super) struct Spacing {
    steps_us: Vec<u64>,
    latest_us: Option<u64>,
}

impl Spacing {
    /// Takes a packet in; false where it has no block.
    pub(super) fn add(&mut self, packet: &Packet) -> bool {
        let place = place(&mut self.latest_us, packet);
        if let Place::After(step_us) = place {
            self.steps_us.push(step_us);
        }
        place != Place::Nowhere
    }

    pub(super) fn is_enough(&self) -> bool {
        self.steps_us.len() >= ENOUGH
    }

    /// The usual step [µs]; none where there are too few.
    pub(super) fn usual_us(mut self) -> Option<u64> {
        self.steps_us.sort_unstable();
        (self.steps_us.len() >= FEW).then(|| self.steps_us[self.steps_us.len() / 2])
    }
}

/// Watches the packets of a live sensor for those of another kind.
///
/// A verdict needs eight steps in a row of one length, and stands until the next one. Packets that are lost make steps of two or
/// three lengths, so these count for none.
#[derive(Clone, Debug)]
pub(crate) struct SpacingWatch {
    /// In single and dual-return mode [µs].
    expected_us: [u64; 2],
    is_dual: bool,
    latest_us: Option<u64>,
    /// The latest step, and how many in a row were as long.
    step_us: u64,
    alike: usize,
    /// Packets in a row before the latest one: another sensor's, or the clock was set.
    before: usize,
    another_us: Option<u64>,
}

impl SpacingWatch {
    pub(crate) fn of(sensor: &SensorModel) -> Self {
        Self::expecting([false, true].map(|is_dual| expected_us(sensor, is_dual)))
    }

    fn expecting(expected_us: [u64; 2]) -> Self {
        Self { expected_us, is_dual: false, latest_us: None, step_us: 0, alike: 0, before: 0, another_us: None }
    }

    /// What the sensor's packets should be apart [µs].
    pub(crate) fn expected_us(&self) -> u64 {
        self.expected_us[usize::from(self.is_dual)]
    }

    /// What the packets are apart [µs], where they are of another kind of sensor.
    pub(crate) fn another_us(&self) -> Option<u64> {
        self.another_us
    }

    /// Looks at the next packet.
    pub(crate) fn look(&mut self, packet: &Packet) {
        match place(&mut self.latest_us, packet) {
            Place::Nowhere => return,
            Place::Before => {
                self.before += 1;
                if self.before > FEW {
                    (self.before, self.latest_us) = (0, None);
                }
                return;
            }
            Place::After(step_us) => {
                let is_dual = packet.is_dual();
                let is_alike = step_us.abs_diff(self.step_us) * 20 <= step_us && is_dual == self.is_dual;
                self.alike = if is_alike { self.alike + 1 } else { 1 };
                (self.step_us, self.is_dual, self.before) = (step_us, is_dual, 0);
            }
        }
        if self.alike < FEW {
            return;
        }
        let (found_us, expected_us) = (self.step_us, self.expected_us());
        let times = (found_us + expected_us / 2) / expected_us.max(1);
        let are_lost = times >= 2 && found_us.abs_diff(times * expected_us) * 50 <= found_us;
        let says_so = is_another(found_us, expected_us) && !are_lost && times < MOST_TIMES;
        self.another_us = says_so.then_some(found_us);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(stamp_us: u64) -> Packet {
        let mut packet = Packet::default();
        packet.set_block(0, super::super::packet::BLOCK_FLAG, 0);
        packet.set_end((stamp_us % HOUR_US) as u32, super::super::packet::STRONGEST, 0x21);
        packet
    }

    /// An HDL-32E's.
    fn watch() -> SpacingWatch {
        SpacingWatch::expecting([553, 276])
    }

    /// Lets it look at packets with these steps between them, from this stamp on; the stamp after them.
    fn look(sut: &mut SpacingWatch, mut stamp_us: u64, steps_us: impl IntoIterator<Item = u64>) -> u64 {
        sut.look(&packet(stamp_us));
        for step_us in steps_us {
            stamp_us += step_us;
            sut.look(&packet(stamp_us));
        }
        stamp_us
    }

    #[test]
    fn another_kind_is_known_after_nine_packets_and_its_own_again_as_soon() {
        let mut sut = watch();
        let stamp_us = look(&mut sut, HOUR_US - 3_000, [1_327; 7]);
        assert_eq!(sut.another_us(), None);
        let stamp_us = look(&mut sut, stamp_us, [1_328]);
        assert_eq!(sut.another_us(), Some(1_328));
        look(&mut sut, stamp_us + 50_000, [553, 552].into_iter().cycle().take(30));
        assert_eq!(sut.another_us(), None);
    }

    #[test]
    fn a_sensor_whose_clock_is_behind_the_one_before_is_known_too() {
        let mut sut = watch();
        look(&mut sut, 1_000_000_000, [553; 50]);
        look(&mut sut, 7_000, [1_327; 30]);
        assert_eq!(sut.another_us(), Some(1_327));
    }

    #[test]
    fn losses_repetitions_and_a_narrow_field_of_view_are_no_other_sensor() {
        for steps_us in [
            &[553, 553, 1_106, 553, 1_659][..],
            &[1_106],                      // each second one is lost
            &[553, 0],                     // each comes twice
            &[553, 553, 553, 553, 80_000], // what is left of its turn
            &[99_000],                     // a packet a turn
            &[300, 900, 2_000],            // two sensors at once
        ] {
            let mut sut = watch();
            look(&mut sut, 0, steps_us.iter().copied().cycle().take(500));
            assert_eq!(sut.another_us(), None, "{steps_us:?}");
        }
    }
}
