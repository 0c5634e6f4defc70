//! Clouds, one after the other, as a row of sweeps in time.

use lidar::{Column, Return, SensorModel};
use messages::{Refusal, Sweep};

use super::Cloud;
use super::organise::Organiser;
use super::source::CloudSource;
use crate::error::ReplayError;
use crate::faults::{Fault, Faults};
use crate::intake::{Limits, refuse, take};
use crate::time::{is_turn, nominal_period_ns, slowest_period_ns};
use crate::velodyne::to_frame;

/// Sweeps of clouds.
pub(crate) struct Clouds {
    source: Box<dyn CloudSource + Send>,
    sensor: SensorModel,
    limits: Limits,
    organiser: Organiser,
    /// The sweep to give next, read ahead: its start ends the one before.
    ahead: Cloud,
    is_ahead: bool,
    current: Cloud,
    /// Start of the next sweep where its cloud has no time [ns].
    clock_ns: u64,
    /// Time from the sweep before to this one, where that was a turn [ns].
    before_ns: Option<u64>,
}

impl Clouds {
    /// Reads the first cloud, or the first that can be read.
    pub(crate) fn new(
        source: Box<dyn CloudSource + Send>,
        sensor: &SensorModel,
        limits: Limits,
        faults: &mut Faults,
    ) -> Result<Self, ReplayError> {
        let mut sut = Self {
            source,
            sensor: sensor.clone(),
            limits,
            organiser: Organiser::new(sensor),
            ahead: Cloud::default(),
            is_ahead: false,
            current: Cloud::default(),
            clock_ns: 0,
            before_ns: None,
        };
        if let Some(error) = sut.read_ahead(faults)
            && !sut.is_ahead
        {
            return Err(error);
        }
        let is_empty = sut.source.count() == Some(1) && sut.ahead.is_empty();
        if is_empty || !sut.is_ahead {
            return Err(ReplayError::Empty {
                path: sut.source.place().0.to_owned(),
                what: "holds no points".to_owned(),
            });
        }
        Ok(sut)
    }

    /// Number of clouds where that is known, of which those that can be read are a sweep each.
    pub(crate) fn len(&self) -> Option<u64> {
        self.source.count()
    }

    /// Starts again with the first cloud.
    pub(crate) fn rewind(&mut self, faults: &mut Faults) {
        self.source.rewind();
        let _ = self.read_ahead(faults);
    }

    /// Fills `sweep` with the next cloud; false after the last.
    pub(crate) fn next(&mut self, sweep: &mut Sweep, faults: &mut Faults) -> bool {
        if !self.is_ahead {
            return false;
        }
        std::mem::swap(&mut self.current, &mut self.ahead);
        // Clouds that cannot be read are passed over, counted.
        let _ = self.read_ahead(faults);
        self.check_clock(faults);
        self.fill(sweep);
        true
    }

    /// Reads the next cloud that can be read into `ahead`; the first error on the way.
    fn read_ahead(&mut self, faults: &mut Faults) -> Option<ReplayError> {
        let mut first_error = None;
        self.is_ahead = false;
        while !self.is_ahead {
            self.ahead.clear();
            match self.source.read(&mut self.ahead, faults) {
                Some(Ok(())) => self.is_ahead = true,
                Some(Err(error)) => first_error = first_error.or(Some(error)),
                None => break,
            }
        }
        first_error
    }

    /// Time that goes back from this cloud to the next, or on by more than one and a half turns, is named. Both are
    /// given as they are.
    fn check_clock(&self, faults: &mut Faults) {
        let next_ns = self.ahead.start_ns.filter(|_| self.is_ahead);
        let Some((next_ns, this_ns)) = next_ns.zip(self.current.start_ns) else { return };
        let usual_ns = self.before_ns.unwrap_or_else(|| slowest_period_ns(&self.sensor));
        let (path, place) = self.source.place();
        if next_ns < this_ns {
            faults.note(Fault::ClockStep, 1, path, place, format!("time goes back by {} ns", this_ns - next_ns));
        } else if next_ns - this_ns > usual_ns.saturating_add(usual_ns / 2) {
            faults.note(Fault::ClockStep, 1, path, place, format!("time goes on by {} ns", next_ns - this_ns));
        }
    }

    fn fill(&mut self, sweep: &mut Sweep) {
        let period_ns = self.period_ns();
        let cloud = &self.current;
        let is_organised = self.organiser.organise(cloud, &self.limits);
        let columns = if is_organised { self.organiser.columns() } else { &[] };
        let first_ns = columns.first().and_then(|first| first.time_ns);
        let start_ns = first_ns.or(cloud.start_ns).unwrap_or(self.clock_ns);
        self.clock_ns = start_ns.saturating_add(period_ns);

        let header = &mut sweep.header;
        header.sensor_time_ns = start_ns;
        header.period_ns = period_ns;
        header.complete = u32::from(!cloud.is_torn);
        header.organised = u32::from(is_organised);
        header.range_sigma_m = self.sensor.range_sigma_m() as f32;
        header.reach_m = self.sensor.reach_m()[1] as f32;
        if is_organised {
            let step_rad = self.organiser.step_rad();
            header.column_step_rad = step_rad as f32;
            for &ring in self.sensor.rings() {
                // A model has at most as many rings as a message.
                let _ = sweep.rings.push(ring);
            }
            let each_ns = step_rad / std::f64::consts::TAU * period_ns as f64;
            // The last column whose time is known, and the time from column to column after it.
            let (mut from, mut from_ns, mut step_ns) = (0, 0.0, each_ns);
            for (index, draft) in columns.iter().enumerate() {
                if let Some(time_ns) = draft.time_ns {
                    (from, from_ns) = (index, time_ns.saturating_sub(start_ns) as f64);
                    let next =
                        columns.iter().enumerate().skip(index + 1).find_map(|(at, next)| Some((at, next.time_ns?)));
                    step_ns = next
                        .map_or(each_ns, |(at, next_ns)| next_ns.saturating_sub(time_ns) as f64 / (at - index) as f64);
                }
                let offset_ns = from_ns + step_ns * (index - from) as f64;
                // Organised clouds have no more columns than a message.
                let _ = sweep.columns.push(Column {
                    azimuth_rad: to_frame(-draft.azimuth_rad),
                    offset_ns: offset_ns.round() as u32,
                    valid: u32::from(draft.is_known),
                });
            }
        }
        for (index, point) in cloud.points.iter().enumerate() {
            let (column, ring) = if is_organised { self.organiser.place(index) } else { (0, 0) };
            let at = Return { column, ring, intensity: point.intensity, ..Return::default() };
            take(sweep, &self.limits, point.position_m, at);
        }
        if cloud.beyond > 0 {
            refuse(sweep, Refusal::OverCapacity, cloud.beyond);
        }
    }

    /// Time from this sweep's start to the next where that is a turn, else what its firings take where the cloud has all
    /// of them, else as before, else the sensor's usual period [ns].
    fn period_ns(&mut self) -> u64 {
        let next_ns = self.ahead.start_ns.filter(|_| self.is_ahead);
        let apart_ns = next_ns.zip(self.current.start_ns).and_then(|(next, start)| next.checked_sub(start));
        let lasers = self.sensor.lasers().len();
        let is_dense = !self.current.has_key && self.current.points.len().is_multiple_of(lasers);
        let fired_ns = (self.current.points.len() / lasers) as u64 * u64::from(self.sensor.cycle_ns());
        let apart_ns = apart_ns.filter(|&ns| is_turn(&self.sensor, ns));
        self.before_ns = apart_ns.or(self.before_ns);
        apart_ns
            .or(Some(fired_ns).filter(|&ns| is_dense && is_turn(&self.sensor, ns)))
            .or(self.before_ns)
            .unwrap_or_else(|| nominal_period_ns(&self.sensor))
    }
}
