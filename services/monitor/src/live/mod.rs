//! `encke live`: a running chain for Foxglove, over a WebSocket.

mod account;
mod client;
mod feed;
mod protocol;
mod server;
#[cfg(test)]
mod tests;

use std::io::{self, IsTerminal, Write};

use events::{Event, Reader, Severity};
use foxglove::messages::{Log, Timestamp, log};
use prost::Message;
use runtime::logging::Stderr;
use runtime::{Plan, Shutdown, clock};
use tape::Topic;
use transport::Instance;

use crate::MonitorError;
use crate::attached::Attached;
use crate::process::{be_idle, be_nice};
pub use account::{Account, TopicAccount};
use feed::Feed;
use server::Server;

/// Longest sleep [ns]: a tenth of a tap's queue at 10 Hz.
const IDLE_NS: u64 = 20_000_000;
/// Between two looks at the pages, and two statuses [ns].
const LOOK_NS: u64 = 1_000_000_000;
/// Seconds between two lines where nobody watches them.
const SELDOM: u64 = 5;

/// Whom to serve.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Address to listen on.
    pub bind: String,
    /// Port; 0 is any that is free.
    pub port: u16,
    /// Wait for the next start of the instance when the chain ends.
    pub wait: bool,
    /// Print the account as JSON.
    pub json: bool,
}

/// What the live view asks of whoever knows the supervisor.
pub trait Supervisor {
    /// Whether the instance has one.
    fn runs(&self) -> bool;
    /// The chain's status as JSON, as `encke ctl status --json` gives it; none where it cannot be read.
    fn status(&self) -> Option<Vec<u8>>;
}

/// Serves a running instance until it ends or this process is asked to leave; then prints where the messages went.
///
/// # Errors
/// The instance cannot be attached to, the address cannot be listened on, or standard output fails.
pub fn live(instance: &Instance, settings: &Settings, supervisor: &impl Supervisor) -> Result<(), MonitorError> {
    be_nice();
    let mut live = Live::begin(instance, settings)?;
    // Only now: whoever is told the address finds somebody there.
    be_idle();
    let address = live.server.address();
    let url =
        format!("ws://{address}\nIn Foxglove: Open connection, Foxglove WebSocket, this address. Ctrl-C ends it.\n");
    // JSON stands alone on standard output.
    if settings.json {
        eprint!("{url}")
    } else {
        print(&url)?
    }
    if !live.server.is_local() {
        eprintln!("warning: whoever reaches {address} sees this chain: there is no password and no encryption");
    }
    let served = live.serve(settings, supervisor);
    let account = live.end();
    served?;
    let text =
        if settings.json { serde_json::to_string_pretty(&account).unwrap_or_default() + "\n" } else { account.table() };
    print(&text)
}

struct Live<'a> {
    instance: &'a Instance,
    /// None while no chain of this name runs. The taps before what they are guests of.
    chain: Option<(Feed, Attached)>,
    server: Server,
    /// The log of the chain.
    log: Reader,
    next_look_ns: u64,
    looks: u64,
    /// Of chains that have ended.
    unseen: (u64, u64),
    /// Signals to this process, also while no chain runs.
    shutdown: Shutdown,
}

impl<'a> Live<'a> {
    fn begin(instance: &'a Instance, settings: &Settings) -> Result<Self, MonitorError> {
        let chain = attach(instance)?;
        let server = Server::listen(&settings.bind, settings.port, &name(instance), &session(&chain.1))?;
        let shutdown = Shutdown::install(chain.1.facts.supervisor_pid)?;
        let next_look_ns = clock::now_ns() + LOOK_NS;
        Ok(Self {
            instance,
            chain: Some(chain),
            server,
            log: log(instance),
            next_look_ns,
            looks: 0,
            unseen: (0, 0),
            shutdown,
        })
    }

    fn serve(&mut self, settings: &Settings, supervisor: &impl Supervisor) -> Result<(), MonitorError> {
        while !self.shutdown.asked() {
            self.server.wait(IDLE_NS);
            self.server.turn();
            let mut ended = false;
            if let Some((feed, chain)) = &mut self.chain {
                feed.turn(&mut self.server)?;
                ended = chain.shutdown.orphaned();
            }
            if clock::now_ns() >= self.next_look_ns {
                self.look(supervisor);
            }
            if ended {
                self.server.turn();
                self.unseen = self.all_unseen();
                self.chain = None;
                if !settings.wait {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Once a second: status, events, a word on stderr; or whether the chain runs again.
    fn look(&mut self, supervisor: &impl Supervisor) {
        self.next_look_ns = clock::now_ns() + LOOK_NS;
        self.looks += 1;
        match &self.chain {
            Some((feed, chain)) => {
                let now_ns = feed.sensor_time_ns;
                if self.server.wants(Topic::Status)
                    && let Some(status) = supervisor.status()
                {
                    self.server.offer(Topic::Status, now_ns, |out| {
                        out.extend_from_slice(&status);
                        true
                    });
                }
                let mut told = Vec::new();
                self.log.read(|event| told.push(event));
                if !told.is_empty() {
                    self.server.offer(Topic::Events, now_ns, |out| encode_events(&told, now_ns, out));
                }
                if chain.node.is_left_behind()
                    && let Ok(chain) = attach(self.instance)
                {
                    self.unseen = self.all_unseen();
                    self.chain = Some(chain);
                }
            }
            None if supervisor.runs() => {
                if let Ok(chain) = attach(self.instance) {
                    self.server.renew(&name(self.instance), &session(&chain.1));
                    self.chain = Some(chain);
                    self.log = log(self.instance);
                }
            }
            None => {}
        }
        self.say();
    }

    fn say(&self) {
        let mut account = self.server.account();
        (account.unseen_sweep_parts, account.unseen_detection_parts) = self.all_unseen();
        let line = account.line(self.server.clients());
        // A terminal that has closed is no reason to end by a panic.
        let _ = if io::stderr().is_terminal() {
            write!(Stderr, "\r{line}\x1b[K")
        } else if self.looks.is_multiple_of(SELDOM) {
            writeln!(Stderr, "{line}")
        } else {
            Ok(())
        };
    }

    fn all_unseen(&self) -> (u64, u64) {
        let (sweeps, detections) = self.chain.as_ref().map_or((0, 0), |(feed, _)| feed.unseen());
        (self.unseen.0 + sweeps, self.unseen.1 + detections)
    }

    /// Ends all connections and gives the account.
    fn end(mut self) -> Account {
        if self.looks > 0 && io::stderr().is_terminal() {
            let _ = writeln!(Stderr);
        }
        self.server.end();
        let mut account = self.server.account();
        (account.unseen_sweep_parts, account.unseen_detection_parts) = self.all_unseen();
        account
    }
}

fn attach(instance: &Instance) -> Result<(Feed, Attached), MonitorError> {
    let chain = Attached::to(instance, "live")?;
    Ok((Feed::of(&chain)?, chain))
}

fn name(instance: &Instance) -> String {
    format!("encke {}", instance.name())
}

/// Another supervisor is another session.
fn session(chain: &Attached) -> String {
    format!("{}-{}", chain.facts.instance, chain.facts.supervisor_pid)
}

/// The log from now on.
fn log(instance: &Instance) -> Reader {
    let mut log = Reader::new(&Plan::events_path(instance), 0);
    log.skip();
    log
}

/// One `foxglove.Log` of all that happened since the last look, as grave as the gravest of it.
fn encode_events(events: &[Event], sensor_time_ns: u64, out: &mut Vec<u8>) -> bool {
    let lines: Vec<String> =
        events.iter().map(|event| format!("{} {}: {}", event.stage, event.name, event.text)).collect();
    let level = match events.iter().map(|event| event.severity).max() {
        None | Some(Severity::Info) => log::Level::Info,
        Some(Severity::Warning) => log::Level::Warning,
        Some(Severity::Error) => log::Level::Error,
        Some(Severity::Critical) => log::Level::Fatal,
    };
    let seconds = u32::try_from(sensor_time_ns / 1_000_000_000).unwrap_or(u32::MAX);
    let log = Log {
        timestamp: Timestamp::new_checked(seconds, (sensor_time_ns % 1_000_000_000) as u32),
        level: level as i32,
        message: lines.join("\n"),
        name: "encke".to_owned(),
        ..Log::default()
    };
    log.encode(out).is_ok()
}

fn print(text: &str) -> Result<(), MonitorError> {
    match io::stdout().write_all(text.as_bytes()).and_then(|()| io::stdout().flush()) {
        Err(cause) if cause.kind() != io::ErrorKind::BrokenPipe => Err(MonitorError::Output(cause)),
        _ => Ok(()),
    }
}
