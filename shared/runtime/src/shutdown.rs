use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::process::{Pid, test_kill_process};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};

use crate::ShellError;

/// Whether this process was asked to stop, by one of [`stop_signals`]; for viewers also whether the chain's supervisor is gone.
pub struct Shutdown {
    asked: Arc<AtomicBool>,
    supervisor: Option<Pid>,
}

impl Shutdown {
    /// Takes over the signals that ask a process to stop.
    pub fn install(supervisor: u32) -> Result<Self, ShellError> {
        let asked = Arc::new(AtomicBool::new(false));
        for signal in stop_signals() {
            signal_hook::flag::register(signal, Arc::clone(&asked)).map_err(ShellError::Signals)?;
        }
        Ok(Self { asked, supervisor: Pid::from_raw(supervisor as i32) })
    }

    /// Whether one of the signals came.
    pub fn asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// Whether the supervisor is gone. A stage asks its [`crate::guardian::Guardian`] instead: it waits for a successor.
    pub fn orphaned(&self) -> bool {
        self.supervisor.is_none_or(|supervisor| test_kill_process(supervisor).is_err())
    }
}

/// Signals that ask a process to stop: SIGTERM, SIGINT, and SIGHUP (its terminal is gone), unless that was ignored when the
/// process started, as nohup(1) has it: then it stays ignored. To be asked before a handler is set.
pub fn stop_signals() -> impl Iterator<Item = i32> {
    // Without /proc nobody knows: as by default.
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let hangup = (!ignores(&status, SIGHUP)).then_some(SIGHUP);
    [SIGTERM, SIGINT].into_iter().chain(hangup)
}

/// Whether a process of this status (proc_pid_status(5)) ignores a signal.
fn ignores(status: &str, signal: i32) -> bool {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}

/// A file that has grown to the process's limit is an error of that write, as on a full disk. By default the kernel ends the
/// process instead (SIGXFSZ), and a limit on a recorder would take the chain's end with it.
pub fn ignore_file_limit() {
    // Nobody reads the flag: the signal is taken so that it does nothing. Refused nowhere; then all is as by default.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_is_ignored_where_its_bit_says_so() {
        let status = "Name:\tencke\nSigBlk:\tffffffffffffffff\nSigIgn:\t0000000000001001\nSigCgt:\t0000000000004002\n";
        assert!(ignores(status, SIGHUP) && ignores(status, 13));
        assert!(!ignores(status, SIGINT) && !ignores(status, SIGTERM));
        assert!(!ignores("", SIGHUP) && !ignores("SigIgn:\tnone\n", SIGHUP));
    }
}
