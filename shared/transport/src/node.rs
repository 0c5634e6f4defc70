use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use iceoryx2::config::ConfigCreationError;
use iceoryx2::node::{CleanupState, NodeState, NodeView};
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::{event, publish_subscribe};
use messages::Message;

use crate::wire::{Wire, WireTrace};
use crate::{Inlet, Instance, Outlet, Tap, TransportError};

pub(crate) type Ipc = ipc::Service;
pub(crate) type Topic<T> = publish_subscribe::PortFactory<Ipc, Wire<T>, WireTrace>;
pub(crate) type Wakeups = event::PortFactory<Ipc>;

/// Readers of a topic: the next stage, the tape and two viewers. Each adds its buffer to the shared memory bill.
pub(crate) const MAX_SUBSCRIBERS: usize = 4;
/// Messages that a reader may hold at once.
pub(crate) const MAX_BORROWED: usize = 2;
/// Processes that may have a topic open at once.
const MAX_NODES: usize = 16;

/// This process's place in an instance.
pub struct Node {
    node: iceoryx2::node::Node<Ipc>,
    queue_parts: usize,
    /// The instance's configuration when it was joined, and where that stands.
    joined_by: (PathBuf, Vec<u8>),
}

/// A service held open: as long as one lives the service exists.
pub struct ServiceHold {
    wake: Box<dyn Fn()>,
}

/// A service that is open again, without the right to wake its readers: so many may have that at once, and the dead count
/// until they are cleaned away.
pub struct Reopened {
    hold: Box<dyn FnOnce() -> Result<ServiceHold, TransportError>>,
}

impl Reopened {
    /// Takes the right to wake the readers.
    pub fn hold(self) -> Result<ServiceHold, TransportError> {
        (self.hold)()
    }
}

impl ServiceHold {
    fn new<T: Message>(topic: Topic<T>, wakeups: Wakeups) -> Result<Self, TransportError> {
        let notifier = wakeups.notifier_builder().create();
        let notifier = notifier.map_err(|e| TransportError::new("signal", T::TYPE, e))?;
        let wake = Box::new(move || {
            let _kept = (&topic, &wakeups);
            // A listener that is gone needs no waking.
            let _ = notifier.notify();
        });
        Ok(Self { wake })
    }

    /// Wakes the readers of the topic without a message.
    pub fn wake(&self) {
        (self.wake)();
    }
}

impl Node {
    /// Joins an instance as `name`. `queue_parts` is the number of messages that wait for a slow reader before the
    /// oldest is dropped; all processes of an instance must name the same.
    pub fn join(instance: &Instance, name: &str, queue_parts: usize) -> Result<Self, TransportError> {
        // Dead nodes without details are cleaned with the global configuration, so it must be ours too.
        Self::with_config(instance, name, queue_parts, |path| Config::setup_global_config_from_file(path).cloned())
    }

    /// Joins an instance as [`Node::join`] does, in a process that has joined it before, by the configuration that it has now.
    /// Dead nodes without details are not cleaned any more; they hold nothing, and go with the instance.
    pub fn join_anew(instance: &Instance, name: &str, queue_parts: usize) -> Result<Self, TransportError> {
        Self::with_config(instance, name, queue_parts, Config::from_file)
    }

    /// Visits an instance as a viewer: may only tap, and may visit another one afterwards, whose configuration differs
    /// though its name be the same.
    pub fn visit(instance: &Instance, name: &str, queue_parts: usize) -> Result<Self, TransportError> {
        Self::with_config(instance, name, queue_parts, Config::from_file)
    }

    fn with_config(
        instance: &Instance,
        name: &str,
        queue_parts: usize,
        read: impl FnOnce(&FilePath) -> Result<Config, ConfigCreationError>,
    ) -> Result<Self, TransportError> {
        // A failure is returned and handled once; iceoryx2 would log it at every level it passes.
        set_log_level(LogLevel::Fatal);
        let fail = |cause: &dyn std::fmt::Debug| TransportError::new("join", instance.name(), cause);
        let path = FilePath::new(instance.config_path().as_os_str().as_encoded_bytes()).map_err(|e| fail(&e))?;
        // Where it changes between the two it is joined once more.
        let joined_by = (instance.config_path(), fs::read(instance.config_path()).map_err(|e| fail(&e))?);
        let config = read(&path).map_err(|e| fail(&e))?;
        let name = NodeName::new(name).map_err(|e| fail(&e))?;
        let node = NodeBuilder::new()
            .name(&name)
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Ipc>()
            .map_err(|e| fail(&e))?;
        instance.make_shared_memory_private();
        Ok(Self { node, queue_parts, joined_by })
    }

    /// Whether the chain goes on with other files in shared memory than this process has: a viewer visits it anew.
    pub fn is_left_behind(&self) -> bool {
        let (path, text) = &self.joined_by;
        fs::read(path).is_ok_and(|now| now != *text)
    }

    /// Creates the service of a message type and holds it open. The supervisor's alone.
    pub fn create<T: Message>(&self) -> Result<ServiceHold, TransportError> {
        let fail = |cause: &dyn std::fmt::Debug| TransportError::new("create the service of", T::TYPE, cause);
        let name = service_name::<T>()?;
        let topic: Topic<T> = self
            .node
            .service_builder(&name)
            .publish_subscribe::<Wire<T>>()
            .user_header::<WireTrace>()
            .max_publishers(1)
            .max_subscribers(MAX_SUBSCRIBERS)
            .max_nodes(MAX_NODES)
            .subscriber_max_buffer_size(self.queue_parts)
            .subscriber_max_borrowed_samples(MAX_BORROWED)
            .history_size(0)
            .enable_safe_overflow(true)
            .create()
            .map_err(|e| fail(&e))?;
        let wakeups = self
            .node
            .service_builder(&name)
            .event()
            .max_notifiers(4)
            .max_listeners(MAX_SUBSCRIBERS)
            .max_nodes(MAX_NODES)
            .create()
            .map_err(|e| fail(&e))?;
        ServiceHold::new(topic, wakeups)
    }

    /// Opens the service of a message type that a supervisor before this one created. It is held open from here on, and
    /// can wake readers once [`Reopened::hold`] was called.
    pub fn reopen<T: Message>(&self) -> Result<Reopened, TransportError> {
        let (topic, wakeups) = self.open::<T>()?;
        Ok(Reopened { hold: Box::new(move || ServiceHold::new(topic, wakeups)) })
    }

    /// Opens the writing end of a service.
    pub fn outlet<T: Message>(&self) -> Result<Outlet<T>, TransportError> {
        let (topic, wakeups) = self.open::<T>()?;
        Outlet::new(&topic, &wakeups)
    }

    /// Opens the reading end of a service.
    pub fn inlet<T: Message>(&self) -> Result<Inlet<T>, TransportError> {
        let (topic, wakeups) = self.open::<T>()?;
        Inlet::new(topic, &wakeups, self.queue_parts)
    }

    /// Opens a service to look at what passes, without being woken for it.
    pub fn tap<T: Message>(&self) -> Result<Tap<T>, TransportError> {
        let (topic, _) = self.open::<T>()?;
        Tap::new(&topic, self.queue_parts)
    }

    fn open<T: Message>(&self) -> Result<(Topic<T>, Wakeups), TransportError> {
        let fail = |cause: &dyn std::fmt::Debug| TransportError::new("open the service of", T::TYPE, cause);
        let name = service_name::<T>()?;
        let topic = self
            .node
            .service_builder(&name)
            .publish_subscribe::<Wire<T>>()
            .user_header::<WireTrace>()
            .open()
            .map_err(|e| fail(&e))?;
        let wakeups = self.node.service_builder(&name).event().open().map_err(|e| fail(&e))?;
        Ok((topic, wakeups))
    }

    /// Frees what dead processes held that had joined as `name`; the other dead keep what they sent. Returns how many were
    /// cleaned and how many could not be.
    pub fn clean_dead_of(&self, name: &str) -> (u64, u64) {
        let (mut cleaned, mut uncleaned) = (0, 0);
        let clean = |state| {
            if let NodeState::Dead(dead) = state
                && dead.details().as_ref().is_some_and(|details| details.name().as_str() == name)
            {
                let count = if dead.try_remove_stale_resources().is_ok() { &mut cleaned } else { &mut uncleaned };
                *count += 1;
            }
            CallbackProgression::Continue
        };
        // A list that cannot be read is as good as an empty one: what is left goes with the instance.
        let _ = iceoryx2::node::Node::<Ipc>::list(self.node.config(), clean);
        (cleaned, uncleaned)
    }

    /// Frees what dead processes of the instance held. The supervisor's alone, and only after the readers of a dead
    /// publisher have drained it. Returns how many were cleaned and how many could not be.
    pub fn clean_dead(&self, patience: Duration) -> (u64, u64) {
        let CleanupState { cleanups, failed_cleanups } = self.node.blocking_cleanup_dead_nodes(patience);
        (cleanups, failed_cleanups)
    }
}

fn service_name<T: Message>() -> Result<ServiceName, TransportError> {
    ServiceName::new(T::TYPE).map_err(|e| TransportError::new("name the service of", T::TYPE, e))
}
