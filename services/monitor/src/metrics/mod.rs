//! `encke metrics`: a running chain's counters for Prometheus, over HTTP.

mod ears;
mod http;
mod look;
mod text;

use std::io::{self, Write};
use std::net::SocketAddr;

use events::Reader;
use runtime::{Plan, Shutdown};
use transport::Instance;

use crate::MonitorError;
use crate::process::be_nice;
use ears::Ears;
use http::Server;
use look::{Look, Told};

/// How to serve.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Address to listen on; port 0 is any that is free.
    pub listen: SocketAddr,
}

/// Longest sleep between two looks at the signals [ns].
const IDLE_NS: u64 = 200_000_000;

/// Serves an instance until this process is asked to leave: through all its lives, and while there is none. Each request is
/// answered from the pages as they are then, and from the latest table of tracks. `runs` says whether the instance has a supervisor.
///
/// # Errors
/// The address cannot be listened on, the instance has no plan, or standard output fails.
pub fn metrics(instance: &Instance, settings: &Settings, runs: impl Fn() -> bool) -> Result<(), MonitorError> {
    be_nice();
    let shutdown = Shutdown::install(Plan::read(instance)?.supervisor_pid)?;
    let listen = |cause| MonitorError::Metrics { address: settings.listen.to_string(), cause };
    let server = Server::listen(settings.listen).map_err(listen)?;
    let address = server.address().map_err(listen)?;
    if !address.ip().is_loopback() {
        eprintln!("warning: whoever reaches {address} sees this chain: there is no password and no encryption");
    }
    let told = format!("http://{address}/metrics\n");
    match io::stdout().write_all(told.as_bytes()).and_then(|()| io::stdout().flush()) {
        Err(cause) if cause.kind() != io::ErrorKind::BrokenPipe => return Err(MonitorError::Output(cause)),
        _ => {}
    }
    let (mut log, mut ears) = (Log::new(instance), Ears::new(instance));
    let look = || if runs() { Look::take(instance) } else { None };
    // The first answer is to have tracks, too.
    if let Some(look) = look() {
        ears.hear(&look);
    }
    while !shutdown.asked() {
        server.turn(IDLE_NS, || match look() {
            Some(look) => text::page(Some((&look, log.read(&look), ears.hear(&look)))),
            None => {
                ears.leave();
                text::page(None)
            }
        });
    }
    Ok(())
}

/// What the log of the chain's present life has told.
struct Log<'a> {
    instance: &'a Instance,
    reader: Reader,
    supervisor_pid: u32,
    told: Told,
}

impl<'a> Log<'a> {
    fn new(instance: &'a Instance) -> Self {
        let reader = Reader::new(&Plan::events_path(instance), 0);
        Self { instance, reader, supervisor_pid: 0, told: Told::default() }
    }

    fn read(&mut self, look: &Look) -> &Told {
        if look.supervisor_pid != self.supervisor_pid {
            *self = Self { supervisor_pid: look.supervisor_pid, ..Self::new(self.instance) };
        }
        self.reader.read(|event| self.told.add(&event));
        &self.told
    }
}
