//! Files that hold one cloud each.

use std::path::{Path, PathBuf};

use super::source::CloudSource;
use super::{Cloud, csv, kitti, nuscenes, pcd, ply};
use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};
use crate::format::Format;

/// Clouds of a folder in name order, or of one file.
pub(crate) struct CloudFiles {
    files: Vec<PathBuf>,
    format: Format,
    /// Next file to read.
    file: usize,
    line: Vec<u8>,
    pcd: pcd::Memory,
    ply: ply::Memory,
}

impl CloudFiles {
    pub(crate) fn new(files: Vec<PathBuf>, format: Format) -> Self {
        Self { files, format, file: 0, line: Vec::new(), pcd: pcd::Memory::default(), ply: ply::Memory::default() }
    }
}

impl CloudSource for CloudFiles {
    fn read(&mut self, cloud: &mut Cloud, faults: &mut Faults) -> Option<Result<(), ReplayError>> {
        let path = self.files.get(self.file)?;
        self.file += 1;
        let read = match self.format {
            Format::Csv => csv::read(path, cloud, &mut self.line, faults),
            Format::Pcd => pcd::read(path, cloud, &mut self.pcd, faults),
            Format::Ply => ply::read(path, cloud, &mut self.ply, faults),
            Format::Kitti => kitti::read(path, cloud, faults),
            Format::NuScenes | Format::Pcap | Format::Mcap => nuscenes::read(path, cloud, faults),
        };
        if let Err(error) = &read
            && self.files.len() > 1
        {
            faults.note(Fault::BadFile, 1, path, Place::Byte(0), error);
        }
        Some(read)
    }

    fn rewind(&mut self) {
        self.file = 0;
    }

    fn count(&self) -> Option<u64> {
        Some(self.files.len() as u64)
    }

    /// Reads the next file that can be read into `ahead`; the first error on the way.
    fn read_ahead(&mut self, faults: &mut Faults) -> Option<ReplayError> {
        let mut first_error = None;
        self.is_ahead = false;
        while let Some(path) = self.files.get(self.file).filter(|_| !self.is_ahead) {
            self.ahead.clear();
            let read = match self.format {
                Format::Csv => csv::read(path, &mut self.ahead, &mut self.line, faults),
                Format::Pcd => pcd::read(path, &mut self.ahead, &mut self.memory, faults),
                Format::NuScenes | Format::Pcap | Format::Mcap => nuscenes::read(path, &mut self.ahead, faults),
            };
            match read {
                Ok(()) => self.is_ahead = true,
                Err(error) => {
                    if self.files.len() > 1 {
                        faults.note(Fault::BadFile, 1, path, Place::Byte(0), &error);
                    }
                    first_error = first_error.or(Some(error));
                }
            }
            self.file += 1;
        }
        first_error
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
        let apart_ns = next_ns.zip(self.current.start_ns).map(|(next, start)| next.saturating_sub(start));
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
