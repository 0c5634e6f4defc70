use messages::{Detections, Raw, RawError, Sweep, Trace, Track, TrackState, TrackTable};

/// Classes, `Unclassified` at 0.
const CLASSES: usize = 5;

/// Where a message lies: offset of its top-level record in the file, and its place among that record's messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Spot {
    pub(crate) record: u64,
    pub(crate) message: usize,
}

/// What is known of a sweep without drawing it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// Number of the sweep in its run.
    pub sweep: u32,
    /// Sensor time of its first firing [ns].
    pub sensor_time_ns: u64,
    /// Accepted returns; 0 where the recording lost the sweep.
    pub returns: u32,
    /// Obstacles by class, as `ObstacleClass` numbers them.
    pub classes: [u32; CLASSES],
    /// Last return to last detection [ns]; none where the recording lost the detections.
    pub latency_ns: Option<u64>,
    /// Number of the step of degradation at which it was made.
    pub step: u32,
    /// Whether the whole turn was seen.
    pub complete: bool,
    /// Tracks believed in (confirmed and coasting), and those on alert; none where they are not known.
    pub tracks: Option<(u32, u32)>,
    pub(crate) cloud: Option<Spot>,
    pub(crate) found: Option<Spot>,
    pub(crate) table: Option<Spot>,
}

/// Takes up a sweep from its message.
pub(crate) fn read_sweep(bytes: &[u8], spot: Spot, sweep: &mut Sweep, row: &mut Row) -> Result<(), RawError> {
    sweep.read_raw(bytes)?;
    note_sweep(sweep, row);
    row.cloud = Some(spot);
    Ok(())
}

/// Takes up the detections of a sweep from their message.
pub(crate) fn read_found(bytes: &[u8], spot: Spot, found: &mut Detections, row: &mut Row) -> Result<(), RawError> {
    let (trace, bytes) = Trace::read_raw(bytes)?;
    found.read_raw(bytes)?;
    note_detections(&trace, found, row.cloud.is_some(), row);
    row.found = Some(spot);
    Ok(())
}

/// Takes up the tracks of a sweep from their message; none where the tracker could not answer.
pub(crate) fn read_tracks(bytes: &[u8], spot: Spot, table: &mut TrackTable, row: &mut Row) -> Result<(), RawError> {
    let (trace, bytes) = Trace::read_raw(bytes)?;
    table.read_raw(bytes)?;
    note_tracks(table, row);
    row.table = row.tracks.map(|_| spot);
    if row.cloud.or(row.found).is_none() {
        row.sensor_time_ns = trace.part.sensor_time_ns;
    }
    Ok(())
}

/// Puts down what is known of a whole sweep.
pub(crate) fn note_sweep(sweep: &Sweep, row: &mut Row) {
    row.sensor_time_ns = sweep.header.sensor_time_ns;
    row.complete = sweep.header.is_complete();
    row.returns = sweep.returns.len() as u32;
}

/// Puts down what was found in a whole sweep; what the sweep itself says of it where that is not known.
pub(crate) fn note_detections(trace: &Trace, found: &Detections, has_sweep: bool, row: &mut Row) {
    if !has_sweep {
        row.sensor_time_ns = found.header.sensor_time_ns;
        row.complete = found.header.is_complete();
    }
    row.classes = [0; CLASSES];
    for detection in &found.detections {
        row.classes[detection.class as usize] += 1;
    }
    row.latency_ns = trace.hops().last().map(|hop| hop.finished_ns.saturating_sub(trace.due_ns));
    row.step = trace.part.step;
}

/// Puts down how many tracks there are, where there is a table.
pub(crate) fn note_tracks(table: &TrackTable, row: &mut Row) {
    let count = |is: fn(&Track) -> bool| table.tracks.iter().filter(|track| is(track)).count() as u32;
    let counts = (count(|track| track.state != TrackState::Tentative), count(|track| track.alert != 0));
    row.tracks = (table.time_ns > 0).then_some(counts);
}
