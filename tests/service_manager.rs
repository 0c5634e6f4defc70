//! What a service manager is told: ready, how it goes, and its watchdog only while every stage is well.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::os::unix::net::UnixDatagram;
use std::process::Command;
use std::time::Duration;

use support::Run;

/// A service manager that listens.
struct Manager {
    socket: UnixDatagram,
    path: std::path::PathBuf,
}

impl Manager {
    fn beside(run: &Run) -> Self {
        let path = run.dir.path().join("notify");
        let socket = UnixDatagram::bind(&path).unwrap();
        socket.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        Self { socket, path }
    }

    /// Starts the run as this manager's service.
    fn start(&self, run: &Run, adopt: bool) -> std::process::Child {
        run.start_with(|mut encke: Command| {
            encke.env("NOTIFY_SOCKET", &self.path).env("WATCHDOG_USEC", "400000").env_remove("WATCHDOG_PID");
            if adopt {
                encke.arg("--adopt");
            }
            encke
        })
    }

    /// The next message.
    fn hear(&self) -> String {
        let mut bytes = [0; 4096];
        let length = self.socket.recv(&mut bytes).expect("the supervisor says something within 30 s");
        support::text(&bytes[..length])
    }

    /// Waits for a message with this in it; gives those until then, itself included.
    fn hear_until(&self, wanted: &str) -> Vec<String> {
        let mut heard = Vec::new();
        while !heard.last().is_some_and(|message: &String| message.contains(wanted)) {
            heard.push(self.hear());
            assert!(heard.len() < 1_000, "{wanted:?} never came: {heard:?}");
        }
        heard
    }

    /// Waits for two words on how it goes without a watchdog's message between them.
    fn hear_that_it_is_held(&self) {
        let mut status_before = false;
        for _ in 0..1_000 {
            let is_status = self.hear().contains("STATUS=");
            if is_status && status_before {
                return;
            }
            status_before = is_status;
        }
        panic!("the watchdog is always fed");
    }
}

#[test]
fn the_watchdog_is_fed_only_while_every_stage_is_well() {
    let run = Run::new(&["--duration", "forever"]);
    let manager = Manager::beside(&run);
    let child = manager.start(&run, false);
    let first = manager.hear_until("STATUS=");
    assert!(first.last().unwrap().starts_with("READY=1\nSTATUS=nominal, sweep "), "{first:?}");
    manager.hear_until("WATCHDOG=1");

    // Whatever is done about it, there are moments in which it is not well; then it is again.
    std::thread::scope(|scope| {
        scope.spawn(|| run.inject(&["stop", "extractor", "--for", "5s"]));
        manager.hear_that_it_is_held();
        manager.hear_until("WATCHDOG=1");
    });
    let instance = transport::Instance::named(&run.instance).unwrap();
    let events = std::fs::read_to_string(runtime::Plan::events_path(&instance)).unwrap();
    assert!(events.contains("watchdog_held"), "{events}");

    let stop = support::encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
    manager.hear_until("STOPPING=1");
    run.collect(child).expect_code(0);
}

#[test]
fn a_successor_is_ready_once_it_has_adopted() {
    let run = Run::new(&["--duration", "forever"]);
    let manager = Manager::beside(&run);
    let mut child = manager.start(&run, false);
    manager.hear_until("READY=1");
    child.kill().unwrap();
    child.wait().unwrap();
    let child = manager.start(&run, true);
    manager.hear_until("READY=1");
    manager.hear_until("WATCHDOG=1");
    let stop = support::encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
    run.collect(child).expect_code(0);
}
