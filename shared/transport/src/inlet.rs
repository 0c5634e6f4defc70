use std::time::Duration;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::sample::Sample;
use messages::{Message, Trace};

use crate::TransportError;
use crate::node::{Ipc, Topic, Wakeups};
use crate::wire::{Wire, WireTrace};

/// The reading end of a topic.
pub struct Inlet<T: Message> {
    subscriber: Subscriber<Ipc, Wire<T>, WireTrace>,
    listener: Listener<Ipc>,
}

/// A message in shared memory, read in place. Dropped, it is released.
pub struct Taken<T: Message>(pub(crate) Sample<Ipc, Wire<T>, WireTrace>);

impl<T: Message> Inlet<T> {
    pub(crate) fn new(topic: Topic<T>, wakeups: &Wakeups, queue_parts: usize) -> Result<Self, TransportError> {
        // The listener first: what is sent once the subscriber is known must find somebody to wake.
        let listener = wakeups.listener_builder().create().map_err(|e| TransportError::new("listen to", T::TYPE, e))?;
        let subscriber = topic
            .subscriber_builder()
            .buffer_size(queue_parts)
            .create()
            .map_err(|e| TransportError::new("read", T::TYPE, e))?;
        Ok(Self { subscriber, listener })
    }

    /// Sleeps until somebody signals or `patience` ends or a signal arrives. One wake may stand for many messages, so
    /// take until there is none.
    pub fn wait(&self, patience: Duration) -> Result<(), TransportError> {
        use iceoryx2::port::listener::ListenerWaitError::InterruptSignal;
        match self.listener.timed_wait(|_| {}, patience) {
            Ok(_) | Err(InterruptSignal) => Ok(()),
            Err(cause) => Err(TransportError::new("wait for", T::TYPE, cause)),
        }
    }

    /// The oldest message that waits.
    pub fn take(&self) -> Result<Option<Taken<T>>, TransportError> {
        let sample = self.subscriber.receive().map_err(|e| TransportError::new("receive", T::TYPE, e))?;
        Ok(sample.map(Taken))
    }
}

impl<T: Message> Taken<T> {
    /// The message.
    pub fn message(&self) -> &T {
        &self.0.payload().0
    }

    /// The trace that travels beside it.
    pub fn trace(&self) -> &Trace {
        &self.0.user_header().0
    }
}
