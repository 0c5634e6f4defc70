use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::prelude::BackpressureStrategy;
use iceoryx2::sample_mut::SampleMut;
use messages::{Message, Trace};

use crate::TransportError;
use crate::node::{Ipc, Topic, Wakeups};
use crate::wire::{Wire, WireTrace};

/// The writing end of a topic.
pub struct Outlet<T: Message> {
    publisher: Publisher<Ipc, Wire<T>, WireTrace>,
    notifier: Notifier<Ipc>,
}

/// A message being written in shared memory. Dropped unsent, it returns to the pool.
pub struct Loan<'a, T: Message> {
    sample: SampleMut<Ipc, Wire<T>, WireTrace>,
    notifier: &'a Notifier<Ipc>,
}

impl<T: Message> Outlet<T> {
    pub(crate) fn new(topic: &Topic<T>, wakeups: &Wakeups) -> Result<Self, TransportError> {
        let publisher = topic
            .publisher_builder()
            .max_loaned_samples(1)
            // Waiting for a reader that is stopped or dead would stop us too.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| TransportError::new("write", T::TYPE, e))?;
        let notifier = wakeups.notifier_builder().create().map_err(|e| TransportError::new("signal", T::TYPE, e))?;
        Ok(Self { publisher, notifier })
    }

    /// An empty message in shared memory. Costs one small heap allocation (iceoryx2's own).
    pub fn loan(&self) -> Result<Loan<'_, T>, TransportError> {
        let sample = self.publisher.loan_uninit().map_err(|e| TransportError::new("loan", T::TYPE, e))?;
        // SAFETY: the slot is shared memory of this publisher alone: zero bytes at first, later an earlier `Wire<T>`.
        // `T: FromZeros`, so either is a valid `T`; its items are read only up to lengths that `clear` sets to zero.
        #[expect(unsafe_code, reason = "a message of megabytes is laid over memory, never built")]
        let mut sample = unsafe { sample.assume_init() };
        sample.payload_mut().0.clear();
        Ok(Loan { sample, notifier: &self.notifier })
    }
}

impl<T: Message> Loan<'_, T> {
    /// The message.
    pub fn message_mut(&mut self) -> &mut T {
        &mut self.sample.payload_mut().0
    }

    /// The trace that travels beside it.
    pub fn trace_mut(&mut self) -> &mut Trace {
        &mut self.sample.user_header_mut().0
    }

    /// Hands the message to the readers and wakes them.
    pub fn send(self) -> Result<(), TransportError> {
        self.sample.send().map_err(|e| TransportError::new("send", T::TYPE, e))?;
        self.notifier.notify().map_err(|e| TransportError::new("signal", T::TYPE, e))?;
        Ok(())
    }
}
