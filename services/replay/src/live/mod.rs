//! A live sensor: its data packets from a UDP socket, cut into sweeps as those of captures are.
//!
//! A thread of its own takes datagrams into a ring that is as large as it will ever be. Whatever does not fit, comes from
//! somebody else or is no data packet is counted by reason and left out; no packet can do more than that.

mod address;
mod drops;
mod intake;

use std::fmt;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use lidar::SensorModel;
use messages::{Message, Sweep, Truth};
use stage::{Next, Source, SourceError};
use zerocopy::FromZeros;

pub use address::{LiveAddress, LiveAddressError};
pub(crate) use intake::Intake;
pub use intake::Traffic;

use crate::capture::Capture;
use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};
use crate::format::Format;
use crate::intake::Limits;
use crate::recording::{Options, SensorLookup};
use crate::velodyne::{Packet, Probe, Progress, Sweeps, name_of};

/// Waits of 20 ms without a packet after which a sensor is silent.
const SILENT_WAITS: u32 = 10;

/// Sweeps of a live sensor.
///
/// There is no end: where nothing comes, [`Source::next`] gives [`Next::Nothing`] within 50 ms. A sweep is given when the
/// next one has begun, or when the sensor has been silent for two of its slowest turns.
pub struct Live {
    sweeps: Sweeps,
    /// The sweep being gathered: between two calls it must not be touched.
    gathered: Box<Sweep>,
    sensor: SensorModel,
    local: SocketAddr,
    traffic: Arc<Traffic>,
    /// Of `traffic`, what is among the faults already.
    noted: [u64; TRAFFIC_FAULTS.len()],
    faults: Faults,
    patience: Duration,
}

type Count = fn(&Traffic) -> u64;

const OTHER: &str = "data packets of another kind of sensor; name the right one with --sensor";

/// A fault of the traffic with what was seen. Worded only where it is said.
struct Seen<'a> {
    fault: Fault,
    what: &'static str,
    sensor: &'a str,
    other_id: u8,
    /// What the packets are apart, and what they should be [µs].
    spacing_us: Option<(u64, u64)>,
}

impl fmt::Display for Seen<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { fault, what, sensor, other_id, spacing_us } = self;
        match (fault, spacing_us) {
            (Fault::OtherProduct, _) => write!(
                f,
                "data packets of {}, read as {sensor}; name the right sensor with --sensor",
                name_of(*other_id)
            ),
            (Fault::OtherSpacing, Some((found_us, expected_us))) => write!(
                f,
                "data packets that are {found_us} us apart, those of {sensor} {expected_us} us; name the right sensor \
                 with --sensor"
            ),
            _ => f.write_str(what),
        }
    }
}

/// What of the traffic is a fault, and how that is said.
const TRAFFIC_FAULTS: [(Fault, Count, &str); 6] = [
    (Fault::OtherLength, Traffic::other_length, "a datagram that is not as long as a data packet"),
    (Fault::OtherSender, Traffic::other_sender, "a datagram of a sender that is not accepted; see --from"),
    (Fault::OtherProduct, Traffic::other_product, OTHER),
    (Fault::OtherSpacing, Traffic::other_spacing, OTHER),
    (Fault::RingFull, Traffic::ring_full, "a packet came while the ring was full"),
    (Fault::KernelDrop, Traffic::kernel_drops, "the kernel dropped datagrams; raise net.core.rmem_max"),
];

/// Listens to a live sensor: `hdl-32e` unless `options` names another. `wall_ns` is the host's clock [ns since 1970],
/// which gives the hour that packets do not say. Format and repetition mean nothing here.
///
/// # Errors
/// The sensor is not known or has no such packets, the range limits contradict each other, or the socket cannot be had.
pub fn listen(
    address: &LiveAddress,
    options: &Options,
    sensors: SensorLookup<'_>,
    wall_ns: fn() -> u64,
) -> Result<Live, ReplayError> {
    let name = options.sensor.as_deref().unwrap_or(Format::Pcap.sensor());
    let sensor = sensors(name).map_err(|source| ReplayError::Sensor { name: name.to_owned(), source })?;
    let [near_m, far_m] = sensor.accepted_range_m();
    let limits = Limits::checked(options.min_range_m.unwrap_or(near_m), options.max_range_m.unwrap_or(far_m))?;
    let socket = |source| ReplayError::Socket { address: address.to_string(), source };
    let gathered = Sweep::new_box_zeroed().map_err(|_| socket(std::io::ErrorKind::OutOfMemory.into()))?;
    let intake = Intake::open(address, &sensor, wall_ns).map_err(socket)?;
    let (local, traffic) = (intake.local(), Arc::clone(intake.traffic()));
    let sweeps = Sweeps::new(Capture::Live(Box::new(intake)), &sensor, limits, options.both_returns)?;
    Ok(Live {
        sweeps,
        gathered,
        patience: Duration::from_secs_f64(2.0 / sensor.rotation_hz()[0]),
        sensor,
        local,
        traffic,
        noted: [0; TRAFFIC_FAULTS.len()],
        faults: Faults::default(),
    })
}

impl Live {
    /// Where it listens; the port is the system's choice where the address said 0.
    pub fn local_addr(&self) -> SocketAddr {
        self.local
    }

    /// Name of the sensor model that packets are read with.
    pub fn sensor_name(&self) -> &str {
        self.sensor.name()
    }

    /// Looks at the first packets, for a caller who would rather not begin with the wrong sensor model: a tenth of a second's,
    /// which are gone then. A sensor that is silent for 0.2 s is not waited for; what comes later is looked at as it comes.
    ///
    /// # Errors
    /// They are another kind of sensor's, by their factory byte or by the time between them.
    pub fn check_sensor(&mut self) -> Result<(), ReplayError> {
        let Some(intake) = self.intake() else { return Ok(()) };
        let path = intake.path().to_owned();
        let mut waits = 0;
        let next = |packet: &mut Packet| {
            while waits < SILENT_WAITS {
                if let Some((received, _)) = intake.receive() {
                    *packet = received;
                    return Ok(true);
                }
                waits += 1;
            }
            Ok(false)
        };
        match Probe::look(path.clone(), next)? {
            Some(probe) => probe.check_rate(&self.sensor),
            None if self.traffic.other_product() > 0 => {
                let (sensor, found) = (self.sensor.name().to_owned(), name_of(self.traffic.other_id()));
                Err(ReplayError::OtherProduct { path, sensor, found })
            }
            None => Ok(()),
        }
    }

    /// What was found wrong so far.
    pub fn faults(&self) -> &Faults {
        &self.faults
    }

    /// Counts of what arrived, readable from any thread.
    pub fn traffic(&self) -> &Arc<Traffic> {
        &self.traffic
    }

    fn intake(&mut self) -> Option<&mut Intake> {
        match self.sweeps.capture() {
            Capture::Live(intake) => Some(intake),
            Capture::Files(_) => None,
        }
    }

    /// Adds what arrived since the last call to the faults.
    fn note_traffic(&mut self, number: u64) {
        let spacing_us = self.intake().and_then(|intake| intake.another_us());
        for ((fault, count, what), noted) in TRAFFIC_FAULTS.into_iter().zip(&mut self.noted) {
            let count = count(&self.traffic);
            if count > *noted {
                let (sensor, other_id) = (self.sensor.name(), self.traffic.other_id());
                let what = Seen { fault, what, sensor, other_id, spacing_us };
                let path = self.sweeps.capture().path();
                self.faults.note(fault, count - *noted, path, Place::Packet(number), what);
                *noted = count;
            }
        }
    }

    /// Hands the sweep gathered over.
    fn give(&mut self, sweep: &mut Sweep) -> Next {
        let gathered = &mut self.gathered;
        sweep.header = gathered.header;
        // As large as each other.
        let _ = sweep.rings.extend_from_slice(&gathered.rings);
        let _ = sweep.columns.extend_from_slice(&gathered.columns);
        let _ = sweep.returns.extend_from_slice(&gathered.returns);
        let _ = sweep.recorded_index.extend_from_slice(&gathered.recorded_index);
        gathered.clear();
        Next::Sweep
    }
}

impl Source for Live {
    /// Fills `sweep` with the next one, or says within 50 ms that there is none yet. `truth` stays empty.
    fn next(&mut self, sweep: &mut Sweep, _truth: &mut Truth) -> Result<Next, SourceError> {
        let (mut number, mut is_silent) = (0, false);
        let patience = self.patience;
        if let Some(intake) = self.intake() {
            if intake.has_failed() {
                let name = intake.path().display();
                return Err(SourceError(format!("{name}: the socket gives nothing but errors; start again")));
            }
            intake.renew();
            (number, is_silent) = (intake.number(), intake.silence() >= patience);
        }
        self.note_traffic(number);
        let failed = |error: ReplayError| SourceError(error.to_string());
        let progress = self.sweeps.next(&mut self.gathered, &mut self.faults).map_err(failed)?;
        if self.intake().is_some_and(Intake::take_change) {
            // It began with another kind of sensor's packets.
            self.sweeps.discard(&mut self.gathered);
            return Ok(Next::Nothing);
        }
        match progress {
            Progress::Sweep => Ok(self.give(sweep)),
            Progress::Nothing if is_silent && self.sweeps.flush(&mut self.gathered) => Ok(self.give(sweep)),
            Progress::Nothing => Ok(Next::Nothing),
            Progress::End => Ok(Next::End),
        }
    }

    /// A live sensor's sweeps are not those that a predecessor sent.
    fn skip(&mut self, _sweeps: u64, _sweep: &mut Sweep, _truth: &mut Truth) -> Result<(), SourceError> {
        Ok(())
    }

    /// Drops the packets that wait and the sweep being gathered; the next one begins with what comes then.
    fn discard(&mut self) {
        if let Some(intake) = self.intake() {
            intake.discard();
        }
        self.sweeps.discard(&mut self.gathered);
    }

    fn is_live(&self) -> bool {
        true
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        if self.faults.found().next().is_some() {
            let found: Vec<String> =
                self.faults.found().map(|(fault, count)| format!("{} {count}", fault.name())).collect();
            let from = self.sweeps.capture().path().display();
            tracing::warn!(%from, found = found.join(", "), "live sensor has ended; left out of it");
        }
    }
}
