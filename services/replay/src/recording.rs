use std::path::{Path, PathBuf};

use lidar::SensorModel;
use messages::{Sweep, Truth};
use stage::{Next, Source, SourceError};

use crate::capture::{self, Capture};
use crate::cloud::files::CloudFiles;
use crate::cloud::sweeps::Clouds;
use crate::error::ReplayError;
use crate::faults::Faults;
use crate::files;
use crate::format::Format;
use crate::intake::Limits;
use crate::mcap::{Kind, MessageClouds, Messages, RawSweeps};
use crate::velodyne::{Probe, Progress, Sweeps};

/// What the caller may say of a recording. Everything else is found in it.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The format, where its content does not tell or a folder holds several.
    pub format: Option<Format>,
    /// Name of the sensor model; if none, that of the packets' factory byte, `hdl-64e` for KITTI, and `hdl-32e` elsewhere.
    pub sensor: Option<String>,
    /// The topic of an MCAP file to read, where it has several that hold sweeps.
    pub topic: Option<String>,
    /// Nearest accepted range [m]; the sensor model's if none, 1 m for nuScenes.
    pub min_range_m: Option<f64>,
    /// Farthest accepted range [m]; the sensor model's if none.
    pub max_range_m: Option<f64>,
    /// Start again after the end; sensor time goes on rising.
    pub repeat: bool,
    /// Keep both returns of a firing in dual-return mode instead of the strongest.
    pub both_returns: bool,
}

/// Gives a sensor model by the stem of its file in `config/sensors/`, or says why not.
pub type SensorLookup<'a> = &'a dyn Fn(&str) -> Result<SensorModel, Box<dyn std::error::Error + Send + Sync>>;

/// Recorded data as a source of sweeps.
pub struct Recording {
    reader: Reader,
    format: Format,
    sensor_name: String,
    faults: Faults,
    repeat: bool,
    /// Added to sensor times: what earlier passes took [ns].
    shift_ns: u64,
    /// Sensor time of this pass's first sweep and of the end of its last [ns].
    pass_ns: Option<(u64, u64)>,
}

enum Reader {
    Packets(Box<Sweeps>),
    Clouds(Box<Clouds>),
    Raw(Box<RawSweeps>),
}

/// Opens a recording: a file, or the files of a folder or of a pattern in name order. The format is found by content.
///
/// Packets and messages are read as they are needed; of clouds one is read ahead.
///
/// # Errors
/// One line that names file, place and remedy: [`ReplayError`].
pub fn open(path: &Path, options: &Options, sensors: SensorLookup<'_>) -> Result<Recording, ReplayError> {
    let mut faults = Faults::default();
    let (files, format) = files::find(path, options.format, &mut faults)?;
    let packets = open_packets(&files, format)?;
    let found = packets.as_ref().and_then(|(_, probe)| probe.sensor());
    let name = options.sensor.as_deref().or(found).unwrap_or(format.sensor());
    let sensor = sensors(name).map_err(|source| ReplayError::Sensor { name: name.to_owned(), source })?;
    let [near_m, far_m] = sensor.accepted_range_m();
    let near_m = options.min_range_m.or(format.near_m()).unwrap_or(near_m);
    let limits = Limits::checked(near_m, options.max_range_m.unwrap_or(far_m))?;
    let reader = match packets {
        Some((capture, probe)) => {
            probe.check_rate(&sensor)?;
            let mut sweeps = Sweeps::new(capture, &sensor, limits, options.both_returns)?;
            sweeps.look_for_gap()?;
            Reader::Packets(Box::new(sweeps))
        }
        None if format == Format::Mcap => {
            let messages = Messages::open(files, options.topic.as_deref())?;
            match messages.kind() {
                Kind::Raw => {
                    // As recorded, whatever the sensor model says: only what the caller asks for is refused.
                    let asked = (options.min_range_m, options.max_range_m);
                    let (near_m, far_m) = (asked.0.unwrap_or(0.0), asked.1.unwrap_or(f64::from(f32::MAX)));
                    let limits = Limits::checked(near_m, far_m)?;
                    Reader::Raw(Box::new(RawSweeps::new(messages, (asked != (None, None)).then_some(limits))?))
                }
                Kind::PointCloud2 | Kind::PointCloud2Ros1 | Kind::Foxglove => {
                    let source = Box::new(MessageClouds::new(messages));
                    Reader::Clouds(Box::new(Clouds::new(source, &sensor, limits, &mut faults)?))
                }
            }
        }
        None => {
            let source = Box::new(CloudFiles::new(files, format));
            Reader::Clouds(Box::new(Clouds::new(source, &sensor, limits, &mut faults)?))
        }
    };
    Ok(Recording {
        reader,
        format,
        sensor_name: sensor.name().to_owned(),
        faults,
        repeat: options.repeat,
        shift_ns: 0,
        pass_ns: None,
    })
}

/// The source of data packets and what its first ones say, for formats that have them.
fn open_packets(files: &[PathBuf], format: Format) -> Result<Option<(Capture, Probe)>, ReplayError> {
    let mut capture = match format {
        Format::Pcap => Capture::pcap(files.to_vec()),
        Format::Mcap if has_packets(files)? => Capture::mcap(files.to_vec()),
        _ => return Ok(None),
    };
    let probe = Probe::of(&mut capture)?;
    Ok(Some((capture, probe)))
}

fn has_packets(files: &[PathBuf]) -> Result<bool, ReplayError> {
    for path in files {
        if capture::mcap::has_packets(path).map_err(|source| ReplayError::Io { path: path.clone(), source })? {
            return Ok(true);
        }
    }
    Ok(false)
}

impl Recording {
    /// The recording's format.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Name of the sensor model that it is read with.
    pub fn sensor_name(&self) -> &str {
        &self.sensor_name
    }

    /// Sweeps in one pass, where that is known before reading: one a file. Files that cannot be read count too.
    pub fn sweeps(&self) -> Option<u64> {
        match &self.reader {
            Reader::Packets(_) | Reader::Raw(_) => None,
            Reader::Clouds(clouds) => clouds.len(),
        }
    }

    /// What was found wrong so far; complete after the end of the first pass.
    pub fn faults(&self) -> &Faults {
        &self.faults
    }

    fn next_of_pass(&mut self, sweep: &mut Sweep) -> Result<bool, ReplayError> {
        match &mut self.reader {
            Reader::Packets(sweeps) => Ok(sweeps.next(sweep, &mut self.faults)? == Progress::Sweep),
            Reader::Clouds(clouds) => Ok(clouds.next(sweep, &mut self.faults)),
            Reader::Raw(sweeps) => Ok(sweeps.next(sweep, &mut self.faults)),
        }
    }

    /// Goes back to the start. One period is put between the last sweep and the first.
    fn rewind(&mut self) {
        if let Some((from_ns, to_ns)) = self.pass_ns.take() {
            self.shift_ns = self.shift_ns.saturating_add(to_ns.saturating_sub(from_ns));
        }
        self.faults.close();
        match &mut self.reader {
            Reader::Packets(sweeps) => sweeps.rewind(),
            Reader::Clouds(clouds) => clouds.rewind(&mut self.faults),
            Reader::Raw(sweeps) => sweeps.rewind(),
        }
    }

    fn give(&mut self, sweep: &mut Sweep) {
        let header = &mut sweep.header;
        let end_ns = header.sensor_time_ns.saturating_add(header.period_ns);
        let (from_ns, to_ns) = self.pass_ns.unwrap_or((header.sensor_time_ns, end_ns));
        self.pass_ns = Some((from_ns.min(header.sensor_time_ns), to_ns.max(end_ns)));
        header.sensor_time_ns = header.sensor_time_ns.saturating_add(self.shift_ns);
    }
}

impl Source for Recording {
    /// Fills `sweep` with the next one, organised where it is true to the sensor. `truth` stays empty: nobody knows it.
    fn next(&mut self, sweep: &mut Sweep, _truth: &mut Truth) -> Result<Next, SourceError> {
        let failed = |error: ReplayError| SourceError(error.to_string());
        let mut is_given = self.next_of_pass(sweep).map_err(failed)?;
        if !is_given && self.repeat && self.pass_ns.is_some() {
            self.rewind();
            is_given = self.next_of_pass(sweep).map_err(failed)?;
        }
        if !is_given {
            if !self.faults.is_closed() && self.faults.found().next().is_some() {
                let found: Vec<String> =
                    self.faults.found().map(|(fault, count)| format!("{} {count}", fault.name())).collect();
                tracing::warn!(found = found.join(", "), "recording has ended; left out of it");
            }
            self.faults.close();
            return Ok(Next::End);
        }
        self.give(sweep);
        Ok(Next::Sweep)
    }
}
