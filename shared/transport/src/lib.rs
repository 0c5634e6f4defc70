//! Messages through shared memory: the only crate that names iceoryx2.
//!
//! A *service* is a topic: a publish-subscribe pair of one message type with [`Trace`](messages::Trace) as its header,
//! and an event of the same name that wakes the reader. Services are created by one process, the supervisor, before any
//! stage starts, and held open by it; stages only open them. Cleaning up after a dead process is the supervisor's too.
//! (A process that dies while it creates a service can make the service unusable for good.)
//!
//! Overflow drops the oldest message in silence; a reader knows from [`Hop::sequence`](messages::Hop::sequence).

mod bill;
mod error;
mod inlet;
mod instance;
mod node;
mod outlet;
mod tap;
mod wire;

pub use bill::Segment;
pub use error::TransportError;
pub use inlet::{Inlet, Taken};
pub use instance::{Instance, InstanceError, MAX_NAME_LEN};
pub use node::{Node, Reopened, ServiceHold};
pub use outlet::{Loan, Outlet};
pub use tap::Tap;
