//! Messages as bytes of a file: header, then each vector as its number of items (u64) and the items as they lie in
//! memory, little-endian. What was written reads back to the bit; nothing else is read as a message.

use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout, TryFromBytes};

use crate::{Bounded, Clusters, Descriptors, Detections, Message, Sweep, Trace, TrackTable};

/// A message that recordings hold without loss, under the name of its [`Message::TYPE`].
pub trait Raw: Message {
    /// Appends the message's bytes to `out`.
    fn write_raw(&self, out: &mut Vec<u8>);

    /// Fills an empty message from exactly these bytes. On an error the message holds nothing of use.
    fn read_raw(&mut self, bytes: &[u8]) -> Result<(), RawError>;
}

/// Why bytes are no message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RawError {
    /// The bytes end inside the message.
    Short {
        /// Offset of what could not be read [bytes].
        at: usize,
    },
    /// A vector has more items than its message can hold.
    TooMany {
        /// Offset of the vector [bytes].
        at: usize,
        /// Items that it claims.
        items: u64,
        /// Most it may have.
        most: usize,
    },
    /// An item has a value that it cannot have.
    Value {
        /// Offset of the item [bytes].
        at: usize,
    },
    /// The message ends before the bytes do.
    Trailing {
        /// Offset of its end [bytes].
        at: usize,
    },
}

impl std::fmt::Display for RawError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Short { at } => write!(f, "ends inside the message, at byte {at} of it"),
            Self::TooMany { at, items, most } => {
                write!(f, "a vector at byte {at} of the message has {items} items, must be at most {most}")
            }
            Self::Value { at } => write!(f, "byte {at} of the message holds a value that cannot be"),
            Self::Trailing { at } => write!(f, "goes on after the message's end at byte {at}"),
        }
    }
}

impl std::error::Error for RawError {}

impl Raw for Sweep {
    fn write_raw(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(self.header.as_bytes());
        out.extend_from_slice([self.first_column, self.first_return].as_bytes());
        put(out, &self.rings);
        put(out, &self.columns);
        put(out, &self.returns);
        put(out, &self.recorded_index);
    }

    fn read_raw(&mut self, bytes: &[u8]) -> Result<(), RawError> {
        let mut bytes = Reader { bytes, at: 0 };
        self.header = bytes.one()?;
        [self.first_column, self.first_return] = bytes.one()?;
        bytes.plain(&mut self.rings)?;
        bytes.plain(&mut self.columns)?;
        bytes.plain(&mut self.returns)?;
        bytes.plain(&mut self.recorded_index)?;
        bytes.end()
    }
}

impl Raw for Clusters {
    fn write_raw(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(self.header.as_bytes());
        out.extend_from_slice(self.turn_columns.as_bytes());
        put(out, &self.ring_elevation_rad);
        put(out, &self.clusters);
        put(out, &self.returns);
        put(out, &self.members);
        put(out, &self.cells);
    }

    fn read_raw(&mut self, bytes: &[u8]) -> Result<(), RawError> {
        let mut bytes = Reader { bytes, at: 0 };
        self.header = bytes.one()?;
        self.turn_columns = bytes.one()?;
        bytes.plain(&mut self.ring_elevation_rad)?;
        bytes.plain(&mut self.clusters)?;
        bytes.plain(&mut self.returns)?;
        bytes.plain(&mut self.members)?;
        bytes.checked(&mut self.cells)?;
        bytes.end()
    }
}

impl Raw for Descriptors {
    fn write_raw(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(self.header.as_bytes());
        put(out, &self.descriptors);
        put(out, &self.members);
        put(out, &self.bins);
        put(out, &self.fits);
    }

    fn read_raw(&mut self, bytes: &[u8]) -> Result<(), RawError> {
        let mut bytes = Reader { bytes, at: 0 };
        self.header = bytes.one()?;
        bytes.plain(&mut self.descriptors)?;
        bytes.plain(&mut self.members)?;
        bytes.plain(&mut self.bins)?;
        bytes.plain(&mut self.fits)?;
        bytes.end()
    }
}

impl Raw for Detections {
    fn write_raw(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(self.header.as_bytes());
        put(out, &self.detections);
        put(out, &self.members);
        put(out, &self.solids);
    }

    fn read_raw(&mut self, bytes: &[u8]) -> Result<(), RawError> {
        let mut bytes = Reader { bytes, at: 0 };
        self.header = bytes.one()?;
        bytes.checked(&mut self.detections)?;
        bytes.plain(&mut self.members)?;
        bytes.plain(&mut self.solids)?;
        bytes.end()
    }
}

impl Raw for TrackTable {
    fn write_raw(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(self.time_ns.as_bytes());
        put(out, &self.tracks);
        put(out, &self.keys);
    }

    fn read_raw(&mut self, bytes: &[u8]) -> Result<(), RawError> {
        let mut bytes = Reader { bytes, at: 0 };
        self.time_ns = bytes.one()?;
        bytes.checked(&mut self.tracks)?;
        bytes.plain(&mut self.keys)?;
        bytes.end()
    }
}

impl Trace {
    /// Appends the trace's bytes to `out`.
    pub fn write_raw(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(self.as_bytes());
    }

    /// The trace that `bytes` begin with, and the bytes after it.
    pub fn read_raw(bytes: &[u8]) -> Result<(Self, &[u8]), RawError> {
        let mut reader = Reader { bytes, at: 0 };
        let trace = reader.one()?;
        Ok((trace, &bytes[reader.at..]))
    }
}

fn put<T: IntoBytes + Immutable + Copy, const N: usize>(out: &mut Vec<u8>, items: &Bounded<T, N>) {
    out.extend_from_slice((items.len() as u64).as_bytes());
    out.extend_from_slice(items.item_bytes());
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn take(&mut self, length: usize) -> Result<&'a [u8], RawError> {
        let end = self.at.checked_add(length).ok_or(RawError::Short { at: self.at })?;
        let taken = self.bytes.get(self.at..end).ok_or(RawError::Short { at: self.at })?;
        self.at = end;
        Ok(taken)
    }

    fn one<T: TryFromBytes + KnownLayout>(&mut self) -> Result<T, RawError> {
        let at = self.at;
        T::try_read_from_bytes(self.take(size_of::<T>())?).map_err(|_| RawError::Value { at })
    }

    /// The bytes of a vector's items, and how many there are.
    fn items<T, const N: usize>(&mut self) -> Result<(&'a [u8], usize), RawError> {
        let at = self.at;
        let items: u64 = self.one()?;
        if items > N as u64 {
            return Err(RawError::TooMany { at, items, most: N });
        }
        Ok((self.take(items as usize * size_of::<T>())?, items as usize))
    }

    /// Items of which every byte is good.
    fn plain<T, const N: usize>(&mut self, into: &mut Bounded<T, N>) -> Result<(), RawError>
    where
        T: Copy + FromBytes + IntoBytes + Immutable,
    {
        let (bytes, items) = self.items::<T, N>()?;
        // Within the capacity, as `items` has checked.
        let _ = into.resize_zeroed(items);
        into.as_mut_bytes().copy_from_slice(bytes);
        Ok(())
    }

    fn checked<T, const N: usize>(&mut self, into: &mut Bounded<T, N>) -> Result<(), RawError>
    where
        T: Copy + TryFromBytes + KnownLayout,
    {
        let start = self.at + size_of::<u64>();
        let (bytes, _) = self.items::<T, N>()?;
        into.clear();
        for (place, item) in bytes.chunks_exact(size_of::<T>()).enumerate() {
            let item =
                T::try_read_from_bytes(item).map_err(|_| RawError::Value { at: start + place * size_of::<T>() })?;
            let _ = into.push(item);
        }
        Ok(())
    }

    fn end(&self) -> Result<(), RawError> {
        if self.at == self.bytes.len() { Ok(()) } else { Err(RawError::Trailing { at: self.at }) }
    }
}

#[cfg(test)]
mod tests {
    use lidar::{Column, ObstacleClass, Return, Ring};
    use zerocopy::FromZeros;

    use super::*;
    use crate::{Bin, Cell, CellKind, Cluster, Descriptor, Detection, Fit, Solid, Track, TrackState};

    fn sweep() -> Box<Sweep> {
        let mut sweep = Sweep::new_box_zeroed().unwrap();
        (sweep.header.sensor_time_ns, sweep.header.recorded, sweep.first_return) = (7, 3, 1);
        sweep.rings.push(Ring { elevation_rad: 0.5, offset_ns: 2 }).unwrap();
        sweep.columns.push(Column { azimuth_rad: 1.5, offset_ns: 9, valid: 1 }).unwrap();
        for x in [1.0, f32::NAN] {
            sweep.returns.push(Return { x, column: 3, ..Return::default() }).unwrap();
            sweep.recorded_index.push(5).unwrap();
        }
        sweep
    }

    fn detections() -> Box<Detections> {
        let mut message = Detections::new_box_zeroed().unwrap();
        let detection = Detection { class: ObstacleClass::Conical, posterior: [0.25; 4], ..Detection::default() };
        message.detections.push(detection).unwrap();
        message.members.push(4).unwrap();
        message.solids.push(Solid::default()).unwrap();
        message
    }

    fn bytes(message: &impl Raw) -> Vec<u8> {
        let mut bytes = Vec::new();
        message.write_raw(&mut bytes);
        bytes
    }

    #[test]
    fn a_message_reads_back_to_the_bit() {
        let mut again = Sweep::new_box_zeroed().unwrap();
        again.read_raw(&bytes(&*sweep())).unwrap();
        assert_eq!(bytes(&*again), bytes(&*sweep()));
        let mut again = Detections::new_box_zeroed().unwrap();
        again.read_raw(&bytes(&*detections())).unwrap();
        assert_eq!(bytes(&*again), bytes(&*detections()));
        assert_eq!(again.detections[0].class, ObstacleClass::Conical);
        let mut message = Clusters::new_box_zeroed().unwrap();
        (message.header.period_ns, message.turn_columns) = (5, 7);
        message.ring_elevation_rad.push(0.25).unwrap();
        message.clusters.push(Cluster { cells: 1, ..Cluster::default() }).unwrap();
        message.returns.push(Return { y: 2.0, ..Return::default() }).unwrap();
        message.members.push(9).unwrap();
        message.cells.push(Cell { kind: CellKind::Farther, ..Cell::default() }).unwrap();
        let mut again = Clusters::new_box_zeroed().unwrap();
        again.read_raw(&bytes(&*message)).unwrap();
        assert_eq!((bytes(&*again), again.cells[0].kind), (bytes(&*message), CellKind::Farther));
        let mut message = Descriptors::new_box_zeroed().unwrap();
        message.descriptors.push(Descriptor { bins: 1, ..Descriptor::default() }).unwrap();
        message.members.push(3).unwrap();
        message.bins.push(Bin { index: 4, weight: 1.0 }).unwrap();
        message.fits.push(Fit { hits: 6, ..Fit::default() }).unwrap();
        let mut again = Descriptors::new_box_zeroed().unwrap();
        again.read_raw(&bytes(&*message)).unwrap();
        assert_eq!((bytes(&*again), again.fits[0].hits), (bytes(&*message), 6));
        let mut message = TrackTable::new_box_zeroed().unwrap();
        message.time_ns = 8;
        message.tracks.push(Track { state: TrackState::Coasting, keys: 1, ..Track::default() }).unwrap();
        message.keys.push(17).unwrap();
        let mut again = TrackTable::new_box_zeroed().unwrap();
        again.read_raw(&bytes(&*message)).unwrap();
        assert_eq!((bytes(&*again), again.keys_of(&again.tracks[0])), (bytes(&*message), &[17][..]));
    }

    #[test]
    fn a_message_cut_anywhere_or_followed_by_anything_is_refused() {
        let good = bytes(&*sweep());
        for length in 0..good.len() {
            let mut message = Sweep::new_box_zeroed().unwrap();
            assert!(matches!(message.read_raw(&good[..length]), Err(RawError::Short { .. })), "{length}");
        }
        let mut message = Sweep::new_box_zeroed().unwrap();
        assert_eq!(message.read_raw(&[&good[..], &[0]].concat()), Err(RawError::Trailing { at: good.len() }));
    }

    #[test]
    fn counts_and_values_that_cannot_be_are_refused_by_place() {
        let good = bytes(&*detections());
        let at = size_of::<crate::SweepHeader>();
        let mut many = good.clone();
        many[at..at + 8].copy_from_slice(&u64::MAX.to_le_bytes());
        let mut message = Detections::new_box_zeroed().unwrap();
        let most = crate::MAX_CLUSTERS;
        assert_eq!(message.read_raw(&many), Err(RawError::TooMany { at, items: u64::MAX, most }));
        let class = at + 8 + std::mem::offset_of!(Detection, class);
        let mut odd = good;
        odd[class] = 9;
        assert_eq!(message.read_raw(&odd), Err(RawError::Value { at: at + 8 }));
    }

    #[test]
    fn a_trace_stands_before_what_follows_it() {
        let mut out = Vec::new();
        let trace = Trace { due_ns: 5, ..Trace::default() };
        trace.write_raw(&mut out);
        out.push(1);
        assert_eq!(Trace::read_raw(&out), Ok((trace, &[1][..])));
        assert!(Trace::read_raw(&out[..8]).is_err());
    }
}
