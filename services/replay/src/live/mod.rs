//! A live sensor: its data packets from a UDP socket, cut into sweeps as those of captures are.
//!
//! A thread of its own takes datagrams into a ring that is as large as it will ever be. Whatever does not fit, comes from
//! somebody else or is no data packet is counted by reason and left out; no packet can do more than that.

mod address;
mod drops;
mod intake;

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

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
use crate::velodyne::{Progress, Sweeps};

/// Sweeps of a live sensor.
///
/// There is no end: where nothing comes, [`Source::next`] gives [`Next::Nothing`] within 50 ms. A sweep is given when the
/// next one has begun, or when the sensor has been silent for two of its slowest turns.
pub struct Live {
    sweeps: Sweeps,
    /// The sweep being gathered: between two calls it must not be touched.
    gathered: Box<Sweep>,
    sensor_name: String,
    local: SocketAddr,
    traffic: Arc<Traffic>,
    /// Of `traffic`, what is among the faults already.
    noted: [u64; TRAFFIC_FAULTS.len()],
    faults: Faults,
    patience: Duration,
}

type Count = fn(&Traffic) -> u64;

/// What of the traffic is a fault.
const TRAFFIC_FAULTS: [(Fault, Count, &str); 5] = [
    (Fault::OtherLength, Traffic::other_length, "a datagram that is not as long as a data packet"),
    (Fault::OtherSender, Traffic::other_sender, "a datagram of a sender that is not accepted; see --from"),
    (Fault::OtherProduct, Traffic::other_product, "a data packet of another kind of sensor; name it with --sensor"),
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
    let intake = Intake::open(address, sensor.product_id(), wall_ns).map_err(socket)?;
    let (local, traffic) = (intake.local(), Arc::clone(intake.traffic()));
    let sweeps = Sweeps::new(Capture::Live(Box::new(intake)), &sensor, limits, options.both_returns)?;
    Ok(Live {
        sweeps,
        gathered,
        sensor_name: sensor.name().to_owned(),
        local,
        traffic,
        noted: [0; TRAFFIC_FAULTS.len()],
        faults: Faults::default(),
        patience: Duration::from_secs_f64(2.0 / sensor.rotation_hz()[0]),
    })
}

impl Live {
    /// Where it listens; the port is the system's choice where the address said 0.
    pub fn local_addr(&self) -> SocketAddr {
        self.local
    }

    /// Name of the sensor model that packets are read with.
    pub fn sensor_name(&self) -> &str {
        &self.sensor_name
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
        for ((fault, count, what), noted) in TRAFFIC_FAULTS.into_iter().zip(&mut self.noted) {
            let count = count(&self.traffic);
            if count > *noted {
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
        match self.sweeps.next(&mut self.gathered, &mut self.faults).map_err(failed)? {
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
