use messages::{
    Detection, Detections, MAX_CLUSTERS, MAX_FITS, MAX_TRACK_KEYS, MAX_TRACKS, Part, Solid, SweepHeader, Trace, Track,
    TrackTable, Tracks,
};

/// Which files are written, and so what is copied of each part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Wanted {
    pub(crate) members: bool,
    pub(crate) tracks: bool,
}

/// What the writer needs of one part, copied out of shared memory into a buffer made at the start.
pub(crate) struct PartRows {
    pub(crate) part: Part,
    pub(crate) header: SweepHeader,
    /// Whether a stage rejected the part: its output is empty and says nothing of its returns.
    pub(crate) rejected: bool,
    /// Whether the part counts as settled when it is written; one that was refused counts as that.
    pub(crate) settles: bool,
    pub(crate) detections: Vec<Detection>,
    /// Empty where no labels are written.
    pub(crate) members: Vec<u32>,
    pub(crate) solids: Vec<Solid>,
    /// Time of the tracks; 0 where there are none. All three as in the message's table.
    pub(crate) tracks_ns: u64,
    pub(crate) tracks: Vec<Track>,
    pub(crate) keys: Vec<u32>,
}

impl PartRows {
    /// Reserves room for the largest part, so that filling never allocates.
    pub(crate) fn reserved(wanted: Wanted) -> Self {
        Self {
            part: Part::default(),
            header: SweepHeader::default(),
            rejected: false,
            settles: true,
            detections: Vec::with_capacity(MAX_CLUSTERS),
            members: Vec::with_capacity(if wanted.members { MAX_CLUSTERS } else { 0 }),
            solids: Vec::with_capacity(MAX_FITS),
            tracks_ns: 0,
            tracks: Vec::with_capacity(if wanted.tracks { MAX_TRACKS } else { 0 }),
            keys: Vec::with_capacity(if wanted.tracks { MAX_TRACK_KEYS } else { 0 }),
        }
    }

    pub(crate) fn fill(&mut self, trace: &Trace, Tracks { detections: input, table }: &Tracks, wanted: Wanted) {
        self.part = trace.part;
        self.header = input.header;
        self.rejected = is_rejected(trace);
        self.settles = true;
        self.detections.clear();
        self.detections.extend_from_slice(&input.detections);
        self.members.clear();
        if wanted.members {
            self.members.extend_from_slice(&input.members);
        }
        self.solids.clear();
        self.solids.extend_from_slice(&input.solids);
        self.clear_tracks();
        if wanted.tracks {
            self.tracks_ns = table.time_ns;
            self.tracks.extend_from_slice(&table.tracks);
            self.keys.extend_from_slice(&table.keys);
        }
    }

    fn clear_tracks(&mut self) {
        self.tracks_ns = 0;
        self.tracks.clear();
        self.keys.clear();
    }

    /// A part of which nothing is used but that it came.
    pub(crate) fn fill_refused(&mut self, trace: &Trace, header: &SweepHeader) {
        (self.part, self.header) = (trace.part, *header);
        (self.rejected, self.settles) = (true, false);
        self.detections.clear();
        self.members.clear();
        self.solids.clear();
        self.clear_tracks();
    }
}

/// Whether a stage of the chain rejected the part.
pub(crate) fn is_rejected(trace: &Trace) -> bool {
    trace.hops().iter().any(|hop| hop.verdict.is_rejected())
}

/// Whether a message does not contradict itself: every cluster's places lie in `members`, its solids are one each of
/// those that have one, in their order, and the members of a whole sweep are as many as its accepted returns and lie
/// among its recorded ones. A rejected part promises nothing of its members; those of a sector can be judged only with
/// the sweep (see [`crate::assemble`]). Tracks have their clusters' keys one after the other.
pub(crate) fn is_coherent(trace: &Trace, Tracks { detections: input, table }: &Tracks) -> bool {
    let members = input.members.len() as u64;
    let in_place = |d: &Detection| {
        d.summary.points > 0 && u64::from(d.summary.first_member) + u64::from(d.summary.points) <= members
    };
    if !input.detections.iter().all(in_place) || !solids_in_place(input) || !keys_in_place(table) {
        return false;
    }
    if trace.part.sectors > 1 || is_rejected(trace) {
        return true;
    }
    let points = input.detections.iter().map(|detection| u64::from(detection.summary.points)).sum::<u64>();
    points == members
        && members == u64::from(input.header.accepted())
        && input.members.iter().all(|&index| index < input.header.recorded)
}

/// Whether the detections part the solids among them, in order, at most one each.
fn solids_in_place(input: &Detections) -> bool {
    let mut next: u64 = 0;
    for detection in &input.detections {
        if detection.solids > 1 || (detection.solids == 1 && u64::from(detection.first_solid) != next) {
            return false;
        }
        next += u64::from(detection.solids);
    }
    next == input.solids.len() as u64
}

/// Whether the tracks part the keys among them, in order.
fn keys_in_place(table: &TrackTable) -> bool {
    let mut next: u64 = 0;
    for track in &table.tracks {
        if u64::from(track.first_key) != next {
            return false;
        }
        next += u64::from(track.keys);
    }
    next == table.keys.len() as u64
}
