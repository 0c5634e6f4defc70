use zerocopy::FromZeros;

use crate::{Message, Part, Sweep};

/// Joins the sectors of sweeps again: what [`crate::Cutter`] has cut comes out to the bit.
pub struct Joiner {
    whole: Box<Sweep>,
    /// Sweep and sector that come next; none while nothing is open.
    next: Option<(u64, u32)>,
}

impl Joiner {
    /// With room for one sweep; none where there is no memory for it.
    pub fn new() -> Option<Self> {
        Some(Self { whole: Sweep::new_box_zeroed().ok()?, next: None })
    }

    /// Adds a part. Gives the sweep with its last part, where every part came in order; a sweep of which one is missing
    /// is left out. The first sector begins anew, also of the same sweep.
    pub fn add(&mut self, part: &Part, piece: &Sweep) -> Option<&Sweep> {
        if part.sector == 0 {
            self.whole.clear();
            self.next = Some((part.sweep, 0));
        }
        if self.next.take() != Some((part.sweep, part.sector)) || !self.append(piece) {
            return None;
        }
        if part.is_last() {
            return Some(&self.whole);
        }
        self.next = Some((part.sweep, part.sector + 1));
        None
    }

    /// Whether the piece fits.
    fn append(&mut self, piece: &Sweep) -> bool {
        let whole = &mut *self.whole;
        let recorded = whole.header.recorded;
        whole.header = piece.header;
        whole.header.recorded = recorded.saturating_add(piece.header.recorded);
        whole.rings.clear();
        whole.rings.extend_from_slice(&piece.rings).is_ok()
            && whole.columns.extend_from_slice(&piece.columns).is_ok()
            && whole.returns.extend_from_slice(&piece.returns).is_ok()
            && whole.recorded_index.extend_from_slice(&piece.recorded_index).is_ok()
    }
}
