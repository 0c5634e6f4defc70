//! What the service manager (systemd) is told, where one started the supervisor: `sd_notify(3)` and its watchdog.

use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};

use chain::executive::Condition;
use events::{CHAIN, EventId};
use runtime::clock;
use runtime::page::State;

use crate::watch::Watch;

/// Between two messages at most [ns].
const PERIOD_NS: u64 = 1_000_000_000;
/// The watchdog's hunger is an event when so many messages in a row were withheld.
const SAID_AT: u32 = 2;
/// A process whose last progress is older than this is not well [ns].
const WELL_NS: u64 = 2_000_000_000;

/// The way to the service manager; leads nowhere where there is none.
#[derive(Debug, Default)]
pub(crate) struct Manager {
    socket: Option<UnixDatagram>,
    /// Whether it wants to be told that all is well; else it restarts this process.
    watchdog: bool,
    period_ns: u64,
    next_ns: u64,
    ready: bool,
    stopping: bool,
    /// Messages in a row by which the watchdog was not fed.
    held: u32,
}

impl Manager {
    /// The manager that `NOTIFY_SOCKET`, `WATCHDOG_USEC` and `WATCHDOG_PID` name.
    pub(crate) fn of_environment() -> Self {
        let Some(socket) = std::env::var("NOTIFY_SOCKET").ok().and_then(|name| connect(&name)) else {
            return Self::default();
        };
        let number = |name: &str| std::env::var(name).ok()?.parse::<u64>().ok();
        let watchdog_ns = number("WATCHDOG_USEC").map(|us| us.saturating_mul(1_000));
        let is_mine = number("WATCHDOG_PID").is_none_or(|pid| pid == u64::from(std::process::id()));
        let watchdog_ns = watchdog_ns.filter(|ns| is_mine && *ns > 0);
        Self {
            socket: Some(socket),
            watchdog: watchdog_ns.is_some(),
            // Twice in the time allowed is the rule; one message may be late.
            period_ns: watchdog_ns.map_or(PERIOD_NS, |ns| (ns / 4).clamp(1_000_000, PERIOD_NS)),
            ..Self::default()
        }
    }

    fn is_due(&mut self, now_ns: u64) -> bool {
        let is_due = self.socket.is_some() && now_ns >= self.next_ns;
        if is_due {
            self.next_ns = now_ns + self.period_ns;
        }
        is_due
    }

    /// Whether the message is on its way. A manager that does not read is no reason to stop a chain.
    fn tell(&self, text: &str) -> bool {
        self.socket.as_ref().is_some_and(|socket| socket.send(text.as_bytes()).is_ok())
    }
}

/// A socket by its path, or by its abstract name, which begins with `@`. It never waits.
fn connect(name: &str) -> Option<UnixDatagram> {
    let address = match name.strip_prefix('@') {
        Some(name) => SocketAddr::from_abstract_name(name),
        None => SocketAddr::from_pathname(name),
    };
    let socket = UnixDatagram::unbound().ok()?;
    socket.connect_addr(&address.ok()?).ok()?;
    socket.set_nonblocking(true).ok()?;
    Some(socket)
}

impl Watch<'_> {
    /// Tells the service manager, when it is time for that, how the chain is. Its watchdog is fed only while all is proven to
    /// be well, or the chain is ending.
    pub(crate) fn tell_manager(&mut self) {
        let now_ns = clock::now_ns();
        let stopping = self.stop_asked || self.failed.is_some() || (self.stages[0].told && !self.renewing);
        // What has to be known is said again until there is room for it.
        if stopping && !self.manager.stopping {
            self.manager.stopping = self.manager.tell("STOPPING=1\nSTATUS=stopping: each stage drains its input\n");
        }
        let begins = self.begun && !self.manager.ready;
        if !self.manager.is_due(now_ns) && !begins {
            return;
        }
        if self.begun && !stopping {
            let sweep = self.stages[0].page.next_ordinal_out.get() / u64::from(self.plan.chain.sectors.max(1));
            self.manager.ready = true;
            let ready = if begins { "READY=1\n" } else { "" };
            self.manager.tell(&format!("{ready}STATUS={}, sweep {sweep}\n", self.mode_name()));
        }
        // Until all are up, the manager's limit for starts holds.
        let well = stopping || !self.begun || self.is_well();
        if !self.manager.watchdog {
            return;
        }
        self.manager.held = if well { 0 } else { self.manager.held.saturating_add(1) };
        match self.manager.held {
            0 => {
                self.manager.tell("WATCHDOG=1\n");
            }
            // A restart may fall upon one message.
            SAID_AT => self.say(EventId::WatchdogHeld, CHAIN, &format!("not well: {}", self.unwell().join(", "))),
            _ => {}
        }
    }

    fn mode_name(&self) -> &'static str {
        chain::Mode::from_number(self.page.mode.get()).name()
    }

    /// Whether every stage is connected and shows progress, and none is given up.
    pub(crate) fn is_well(&self) -> bool {
        self.unwell().is_empty()
    }

    /// Names of the stages that are not well.
    fn unwell(&self) -> Vec<&str> {
        let now_ns = clock::now_ns();
        let unwell = self.stages.iter().enumerate().filter(|(place, stage)| {
            let page = &stage.page;
            let is_alive = now_ns.saturating_sub(page.heartbeat_ns.get()) < WELL_NS && page.state() != State::Stopped;
            // A sensor may be silent; slowness and floods are the executive's to answer.
            let is_ill = self.executive.condition(*place).is_some_and(|condition| match condition {
                Condition::Dead | Condition::Hung | Condition::Spinning => true,
                Condition::Silent => *place > 0,
                Condition::Slow | Condition::Flooding => false,
            });
            !stage.is_up() || stage.told || !is_alive || is_ill
        });
        unwell.map(|(_, stage)| stage.name.as_str()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_manager_that_does_not_read_holds_nobody_up() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("notify");
        let reader = UnixDatagram::bind(&path).unwrap();
        let socket = connect(path.to_str().unwrap());
        let sut = Manager { socket, ..Manager::default() };
        for _ in 0..1_000 {
            sut.tell("WATCHDOG=1\n");
        }
        let mut bytes = [0; 64];
        let length = reader.recv(&mut bytes).unwrap();
        assert_eq!(&bytes[..length], b"WATCHDOG=1\n");
    }

    #[test]
    fn abstract_names_are_names_too() {
        let name = format!("encke-test-{}", std::process::id());
        let reader = UnixDatagram::bind_addr(&SocketAddr::from_abstract_name(&name).unwrap()).unwrap();
        let sut = Manager { socket: connect(&format!("@{name}")), ..Manager::default() };
        sut.tell("READY=1\n");
        let mut bytes = [0; 64];
        assert_eq!(reader.recv(&mut bytes).unwrap(), 8);
    }

    #[test]
    fn without_a_manager_nothing_is_due() {
        assert!(!Manager::default().is_due(u64::MAX));
        assert!(connect("/nowhere/at/all").is_none());
    }
}
