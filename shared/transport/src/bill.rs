use std::alloc::Layout;

use iceoryx2::service::header::publish_subscribe::Header;
use messages::Message;

use crate::node::{MAX_BORROWED, MAX_SUBSCRIBERS};
use crate::wire::{Wire, WireTrace};

/// What the writer of one topic lays out in shared memory. The file is sparse: memory is used only where a message was
/// written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Places for messages: what all readers allowed may hold and let wait, and the one being written.
    pub slots: u64,
    /// A place, header and trace included [bytes].
    pub slot_bytes: u64,
    /// Places in use at most when the chain's own reader alone is connected.
    pub slots_of_one_reader: u64,
}

impl Segment {
    /// The segment of messages `T` with queues of `queue_parts`.
    pub fn of<T: Message>(queue_parts: usize) -> Self {
        let one_reader = (queue_parts + MAX_BORROWED) as u64;
        Self {
            slots: one_reader * MAX_SUBSCRIBERS as u64 + 1,
            slot_bytes: slot_bytes::<T>(),
            slots_of_one_reader: one_reader + 1,
        }
    }

    /// Address space that the writer and each reader map, and the length of the file [bytes].
    pub fn virtual_bytes(&self) -> u64 {
        self.slots * self.slot_bytes
    }

    /// Memory in use when every place that the chain's own reader needs was filled to the brim [bytes].
    pub fn touched_bytes(&self) -> u64 {
        self.slots_of_one_reader * self.slot_bytes
    }
}

/// iceoryx2's header, the trace and the message, one after the other, each aligned.
fn slot_bytes<T: Message>() -> u64 {
    let parts = [Layout::new::<WireTrace>(), Layout::new::<Wire<T>>()];
    let slot = parts.into_iter().try_fold(Layout::new::<Header>(), |slot, part| Some(slot.extend(part).ok()?.0));
    slot.map_or(0, |slot| slot.pad_to_align().size() as u64)
}
