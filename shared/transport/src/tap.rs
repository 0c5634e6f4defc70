use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use messages::Message;

use crate::TransportError;
use crate::inlet::Taken;
use crate::node::{Ipc, MAX_SUBSCRIBERS, Topic};
use crate::wire::{Wire, WireTrace};

/// A reading end for those who only look: the writer does not wake it, so that it costs the chain no system call. What it
/// does not take in time is dropped, the oldest first; the gap in [`Hop::sequence`](messages::Hop::sequence) tells.
pub struct Tap<T: Message> {
    subscriber: Subscriber<Ipc, Wire<T>, WireTrace>,
}

impl<T: Message> Tap<T> {
    pub(crate) fn new(topic: &Topic<T>, queue_parts: usize) -> Result<Self, TransportError> {
        let created = topic.subscriber_builder().buffer_size(queue_parts).create();
        let subscriber = created.map_err(|cause| match cause {
            SubscriberCreateError::ExceedsMaxSupportedSubscribers => TransportError::new(
                "tap",
                T::TYPE,
                format_args!("{} are attached beside the next stage already; end one", MAX_SUBSCRIBERS - 1),
            ),
            cause => TransportError::new("tap", T::TYPE, cause),
        })?;
        Ok(Self { subscriber })
    }

    /// The oldest message that waits.
    pub fn take(&self) -> Result<Option<Taken<T>>, TransportError> {
        let sample = self.subscriber.receive().map_err(|e| TransportError::new("receive", T::TYPE, e))?;
        Ok(sample.map(Taken))
    }
}
