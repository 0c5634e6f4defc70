use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::process::{Pid, getppid, test_kill_process};
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::ShellError;

/// Whether this process was asked to stop: by SIGTERM or SIGINT, or by the death of its supervisor.
pub struct Shutdown {
    asked: Arc<AtomicBool>,
    supervisor: Option<Pid>,
    is_child: bool,
}

impl Shutdown {
    /// Takes over SIGTERM, and SIGINT for a stage that somebody started by hand.
    pub fn install(supervisor: u32) -> Result<Self, ShellError> {
        let asked = Arc::new(AtomicBool::new(false));
        for signal in [SIGTERM, SIGINT] {
            signal_hook::flag::register(signal, Arc::clone(&asked)).map_err(ShellError::Signals)?;
        }
        let supervisor = Pid::from_raw(supervisor as i32);
        Ok(Self { asked, supervisor, is_child: getppid() == supervisor })
    }

    /// Whether SIGTERM or SIGINT came.
    pub fn asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// Whether the supervisor is gone.
    pub fn orphaned(&self) -> bool {
        if self.is_child {
            // A dead parent that nobody has waited for still answers signals; its children have a new parent at once.
            getppid() != self.supervisor
        } else {
            self.supervisor.is_none_or(|supervisor| test_kill_process(supervisor).is_err())
        }
    }
}
