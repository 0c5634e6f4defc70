use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::process::{Pid, test_kill_process};
use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};

use crate::ShellError;

/// Whether this process was asked to stop, by SIGTERM or SIGINT; for viewers also whether the chain's supervisor is gone.
pub struct Shutdown {
    asked: Arc<AtomicBool>,
    supervisor: Option<Pid>,
}

impl Shutdown {
    /// Takes over SIGTERM, and SIGINT for a process that somebody started by hand.
    pub fn install(supervisor: u32) -> Result<Self, ShellError> {
        let asked = Arc::new(AtomicBool::new(false));
        for signal in [SIGTERM, SIGINT] {
            signal_hook::flag::register(signal, Arc::clone(&asked)).map_err(ShellError::Signals)?;
        }
        Ok(Self { asked, supervisor: Pid::from_raw(supervisor as i32) })
    }

    /// Whether SIGTERM or SIGINT came.
    pub fn asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// Whether the supervisor is gone. A stage asks its [`crate::guardian::Guardian`] instead: it waits for a successor.
    pub fn orphaned(&self) -> bool {
        self.supervisor.is_none_or(|supervisor| test_kill_process(supervisor).is_err())
    }
}

/// A file that has grown to the process's limit is an error of that write, as on a full disk. By default the kernel ends the
/// process instead (SIGXFSZ), and a limit on a recorder would take the chain's end with it.
pub fn ignore_file_limit() {
    // Nobody reads the flag: the signal is taken so that it does nothing. Refused nowhere; then all is as by default.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)));
}
