//! What is seen of a running chain from outside: pages, `/proc`, shared memory, events. Nothing here writes to the chain or waits
//! for it.

mod answers;
mod csv;
mod observer;
mod pages;
mod processes;
mod record;
mod shared_memory;
mod tail;

pub(crate) use answers::Answers;
pub(crate) use csv::Csv;
pub(crate) use observer::{Looked, Observer};
pub(crate) use pages::Pages;
pub(crate) use processes::{Use, own_cpu_s, processes_of};
pub use record::{Growth, ProcessRecord, Steady};
pub(crate) use record::{Level, Record, SETTLE_S};
pub(crate) use shared_memory::SharedMemory;
pub(crate) use tail::Tail;
