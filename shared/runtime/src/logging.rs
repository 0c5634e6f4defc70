//! Events of all processes on stderr, one line each. The hot path logs nothing.

use std::io::{self, Write};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::FormatTime;

use crate::clock;

/// Host time in seconds, as in every trace.
struct HostTime;

impl FormatTime for HostTime {
    fn format_time(&self, w: &mut Writer<'_>) -> std::fmt::Result {
        let now_us = clock::now_ns() / 1_000;
        write!(w, "{}.{:06}", now_us / 1_000_000, now_us % 1_000_000)
    }
}

/// Standard error that never makes anybody wait: what a pipe that nobody reads has no room for is left out.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stderr;

/// A pipe that can be written to at all takes so many bytes without waiting (PIPE_BUF, pipe(7)).
const AT_ONCE: usize = 4_096;

impl Write for Stderr {
    /// Writes up to 4,096 bytes, or nothing; says that all of it was written.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let stderr = io::stderr();
        let mut ready = [PollFd::new(&stderr, PollFlags::OUT)];
        let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
        if poll(&mut ready, Some(&at_once)).is_ok_and(|ready| ready > 0) {
            stderr.lock().write_all(&bytes[..bytes.len().min(AT_ONCE)])?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Sends events of `default_level` and above to stderr; `RUST_LOG` overrides the level.
pub fn install(default_level: &str) {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default_level));
    let subscriber = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(|| Stderr)
        .with_ansi(false)
        .with_target(false)
        .with_timer(HostTime)
        // It would say on stderr that stderr is gone, and end a process whose terminal closed.
        .log_internal_errors(false)
        .finish();
    // Only tests install twice; the first stays.
    let _ = tracing::subscriber::set_global_default(subscriber);
}

/// The same for a stage, whose successor waits: the message in one line, and no time spent on a trace of calls. The core file
/// has that.
pub fn abort_at_once_on_panic() {
    std::panic::set_hook(Box::new(|info| {
        // Not to be written is no reason to panic again.
        let _ = Stderr.write(format!("{info}\n").as_bytes());
        std::process::abort();
    }));
}

/// Makes a panic end the process at once, with its message as an event: a half-dead stage helps nobody.
pub fn abort_on_panic() {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        report(info);
        std::process::abort();
    }));
}
