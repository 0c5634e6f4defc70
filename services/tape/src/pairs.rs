//! A sweep and its detections, brought together in whatever order they come.

use lidar::Return;
use messages::{Detection, Detections, Sweep};

use crate::cloud::{Clouds, Clustered};
use crate::hold::Hold;

/// What of a sweep waits for its detections.
#[derive(Default)]
struct Echoes {
    sensor_time_ns: u64,
    returns: Vec<Return>,
    recorded_index: Vec<u32>,
}

/// What of a sweep's detections waits for its returns.
#[derive(Default)]
struct Verdicts {
    detections: Vec<Detection>,
    members: Vec<u32>,
}

/// Halves that wait, a bounded number of each.
pub(crate) struct Pairs {
    echoes: Hold<Echoes>,
    verdicts: Hold<Verdicts>,
    /// Sweeps that have found their detections.
    pub(crate) paired: u64,
}

impl Pairs {
    /// At most `most` sweeps wait for their detections, and as many detections for their sweeps.
    pub(crate) fn new(most: usize) -> Self {
        Self { echoes: Hold::new(most), verdicts: Hold::new(most), paired: 0 }
    }

    /// Takes a sweep. True where its detections were there: their cloud then is all of `out`. Else it waits for them,
    /// unless they are settled without having come.
    pub(crate) fn sweep(
        &mut self,
        number: u64,
        whole: &Sweep,
        settled: bool,
        clouds: &mut Clouds,
        out: &mut Vec<u8>,
    ) -> bool {
        let (returns, recorded_index) = (&whole.returns[..], &whole.recorded_index[..]);
        let sensor_time_ns = whole.header.sensor_time_ns;
        if let Some(Verdicts { detections, members }) = self.verdicts.get(number) {
            let of = Clustered { sensor_time_ns, returns, recorded_index, detections, members };
            return pair(&of, &mut self.paired, clouds, out);
        }
        if !settled {
            let echoes = self.echoes.put(number);
            echoes.sensor_time_ns = sensor_time_ns;
            refill(&mut echoes.returns, returns);
            refill(&mut echoes.recorded_index, recorded_index);
        }
        false
    }

    /// Takes a sweep's detections, as [`Pairs::sweep`] takes the sweep.
    pub(crate) fn detections(
        &mut self,
        number: u64,
        whole: &Detections,
        settled: bool,
        clouds: &mut Clouds,
        out: &mut Vec<u8>,
    ) -> bool {
        let (detections, members) = (&whole.detections[..], &whole.members[..]);
        if let Some(Echoes { sensor_time_ns, returns, recorded_index }) = self.echoes.get(number) {
            let of = Clustered { sensor_time_ns: *sensor_time_ns, returns, recorded_index, detections, members };
            return pair(&of, &mut self.paired, clouds, out);
        }
        if !settled {
            let verdicts = self.verdicts.put(number);
            refill(&mut verdicts.detections, detections);
            refill(&mut verdicts.members, members);
        }
        false
    }
}

fn pair(of: &Clustered<'_>, paired: &mut u64, clouds: &mut Clouds, out: &mut Vec<u8>) -> bool {
    out.clear();
    let sound = clouds.clusters(of, out);
    *paired += u64::from(sound);
    sound
}

fn refill<T: Copy>(to: &mut Vec<T>, from: &[T]) {
    to.clear();
    to.extend_from_slice(from);
}
