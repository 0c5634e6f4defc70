use std::path::Path;

use crate::error::Place;

/// What was found wrong in a recording and left out, while the rest is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(usize)]
#[non_exhaustive]
pub enum Fault {
    /// A capture ends inside a record, or a record's length cannot be: the rest of the file is not read.
    TornCapture,
    /// A record whose frame cannot be taken apart, or that the snap length cut off.
    BadFrame,
    /// A data packet in which no block begins with the block flag.
    NoBlock,
    /// A block without its flag, or with an impossible azimuth, between good ones: its columns are unknown.
    BadBlock,
    /// Data packets that never arrived, by the stamps: their columns are unknown.
    LostPacket,
    /// A data packet that came twice or late.
    LatePacket,
    /// A data packet whose stamp is out of range or jumps.
    BadStamp,
    /// The sensor's clock or the recording jumps: the sweep ends there, incomplete.
    Break,
    /// A row or line that cannot be read; it keeps its place as a return that is not finite.
    BadRow,
    /// A file ends before the points that it promises, or inside one.
    TornCloud,
    /// An MCAP file ends inside a record, or goes on as none can: the rest of the file is not read.
    TornMcap,
    /// A chunk of an MCAP file that cannot be unpacked, or whose checksum is wrong: it is passed over.
    BadChunk,
    /// A message that is not what its channel says; it is passed over.
    BadMessage,
    /// The time of a sweep goes back, or on by more than one and a half turns, or between two packets by some milliseconds;
    /// it is given as it is.
    ClockStep,
    /// A value of intensity outside 0 to 255, clamped.
    Intensity,
    /// A column of a table with a name that means nothing here.
    UnknownColumn,
    /// A file of a folder that cannot be read; it is passed over.
    BadFile,
    /// A file of a folder that is no recording.
    OtherFile,
    /// A datagram to a live sensor's port that is no data packet by its length.
    OtherLength,
    /// A datagram of a sender that is not accepted.
    OtherSender,
    /// A data packet of another kind of sensor than the one supposed.
    OtherProduct,
    /// Live data packets as far apart as only another kind of sensor's are.
    OtherSpacing,
    /// A live sensor's packet that came while the ring was full.
    RingFull,
    /// Datagrams that the kernel dropped before they could be taken.
    KernelDrop,
}

impl Fault {
    /// All kinds.
    pub const ALL: [Self; 24] = [
        Self::TornCapture,
        Self::BadFrame,
        Self::NoBlock,
        Self::BadBlock,
        Self::LostPacket,
        Self::LatePacket,
        Self::BadStamp,
        Self::Break,
        Self::BadRow,
        Self::TornCloud,
        Self::TornMcap,
        Self::BadChunk,
        Self::BadMessage,
        Self::ClockStep,
        Self::Intensity,
        Self::UnknownColumn,
        Self::BadFile,
        Self::OtherFile,
        Self::OtherLength,
        Self::OtherSender,
        Self::OtherProduct,
        Self::OtherSpacing,
        Self::RingFull,
        Self::KernelDrop,
    ];

    /// The kind's word in logs and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::TornCapture => "torn_capture",
            Self::BadFrame => "bad_frame",
            Self::NoBlock => "no_block",
            Self::BadBlock => "bad_block",
            Self::LostPacket => "lost_packet",
            Self::LatePacket => "late_packet",
            Self::BadStamp => "bad_stamp",
            Self::Break => "break",
            Self::BadRow => "bad_row",
            Self::TornCloud => "torn_cloud",
            Self::TornMcap => "torn_mcap",
            Self::BadChunk => "bad_chunk",
            Self::BadMessage => "bad_message",
            Self::ClockStep => "clock_step",
            Self::Intensity => "intensity",
            Self::UnknownColumn => "unknown_column",
            Self::BadFile => "bad_file",
            Self::OtherFile => "other_file",
            Self::OtherLength => "other_length",
            Self::OtherSender => "other_sender",
            Self::OtherProduct => "other_product",
            Self::OtherSpacing => "other_spacing",
            Self::RingFull => "ring_full",
            Self::KernelDrop => "kernel_drop",
        }
    }
}

/// Counts of each [`Fault`]; the first of a kind is also logged, with file and place.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    counts: [u64; Fault::ALL.len()],
    /// After the first pass of a looped recording nothing new can be found.
    closed: bool,
}

impl Faults {
    /// How often `fault` was found.
    pub fn count(&self, fault: Fault) -> u64 {
        self.counts[fault as usize]
    }

    /// The kinds found, with their counts.
    pub fn found(&self) -> impl Iterator<Item = (Fault, u64)> + '_ {
        Fault::ALL.into_iter().map(|fault| (fault, self.count(fault))).filter(|&(_, count)| count > 0)
    }

    /// Counts and logs nothing.
    pub(crate) fn muted() -> Self {
        Self { closed: true, ..Self::default() }
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.closed
    }

    pub(crate) fn close(&mut self) {
        self.closed = true;
    }

    /// Counts `times` of `fault`.
    pub(crate) fn note(&mut self, fault: Fault, times: u64, file: &Path, place: Place, what: impl std::fmt::Display) {
        if self.closed {
            return;
        }
        let count = &mut self.counts[fault as usize];
        if *count == 0 {
            let (file, fault) = (file.display(), fault.name());
            tracing::warn!(%file, %place, fault, %what, "recording is not intact; further ones of this kind are only counted");
        }
        *count = count.saturating_add(times);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_stands_at_its_own_index_and_is_counted_there() {
        let mut sut = Faults::default();
        for (index, fault) in Fault::ALL.into_iter().enumerate() {
            assert_eq!(fault as usize, index);
            sut.note(fault, 2, Path::new("f"), Place::Byte(0), "x");
        }
        sut.close();
        sut.note(Fault::BadRow, 1, Path::new("f"), Place::Line(1), "x");
        assert!(sut.found().all(|(_, count)| count == 2));
        assert_eq!(sut.found().count(), Fault::ALL.len());
    }
}
