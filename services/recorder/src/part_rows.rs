use messages::{Detection, Detections, MAX_CLUSTERS, MAX_FITS, Part, Solid, SweepHeader, Trace};

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
}

impl PartRows {
    /// Reserves room for the largest part, so that filling never allocates.
    pub(crate) fn reserved(members: bool) -> Self {
        Self {
            part: Part::default(),
            header: SweepHeader::default(),
            rejected: false,
            settles: true,
            detections: Vec::with_capacity(MAX_CLUSTERS),
            members: Vec::with_capacity(if members { MAX_CLUSTERS } else { 0 }),
            solids: Vec::with_capacity(MAX_FITS),
        }
    }

    pub(crate) fn fill(&mut self, trace: &Trace, input: &Detections, members: bool) {
        self.part = trace.part;
        self.header = input.header;
        self.rejected = is_rejected(trace);
        self.settles = true;
        self.detections.clear();
        self.detections.extend_from_slice(&input.detections);
        self.members.clear();
        if members {
            self.members.extend_from_slice(&input.members);
        }
        self.solids.clear();
        self.solids.extend_from_slice(&input.solids);
    }

    /// A part of which nothing is used but that it came.
    pub(crate) fn fill_refused(&mut self, trace: &Trace, header: &SweepHeader) {
        (self.part, self.header) = (trace.part, *header);
        (self.rejected, self.settles) = (true, false);
        self.detections.clear();
        self.members.clear();
        self.solids.clear();
    }
}

/// Whether a stage of the chain rejected the part.
pub(crate) fn is_rejected(trace: &Trace) -> bool {
    trace.hops().iter().any(|hop| hop.verdict.is_rejected())
}

/// Whether a message does not contradict itself: every cluster's places lie in `members`, its solids are one each of
/// those that have one, in their order, and the members of a whole sweep are as many as its accepted returns and lie
/// among its recorded ones. A rejected part promises nothing of its members; those of a sector can be judged only with
/// the sweep (see [`crate::assemble`]).
pub(crate) fn is_coherent(trace: &Trace, input: &Detections) -> bool {
    let members = input.members.len() as u64;
    let in_place = |d: &Detection| {
        d.summary.points > 0 && u64::from(d.summary.first_member) + u64::from(d.summary.points) <= members
    };
    if !input.detections.iter().all(in_place) || !solids_in_place(input) {
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
