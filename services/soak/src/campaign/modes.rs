use std::process::{Child, Stdio};

use chain::{Mode, SUPERVISOR};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use runtime::Plan;
use runtime::page::PageView;
use transport::Instance;

use super::ModeChangesFile;
use super::conduct::{answer, said};
use super::day::Step;
use crate::SoakError;
use crate::run::encke;

/// Changes the chain's mode by `encke ctl`, again and again, and measures each from outside.
///
/// A change begins when the command is started, which includes the process's own start, and ends when the supervisor's page has the
/// mode and counts a change more.
pub(crate) struct ModeChanges {
    file: ModeChangesFile,
    instance: String,
    rng: ChaCha8Rng,
    page: PageView,
    under_way: Option<UnderWay>,
    next_ns: u64,
    /// Changes that are over.
    pub(crate) steps: Vec<Step>,
}

struct UnderWay {
    command: String,
    child: Option<Child>,
    from: Mode,
    changes: u64,
    began_ns: u64,
}

impl ModeChanges {
    /// Of a running chain.
    pub(crate) fn new(file: ModeChangesFile, instance: &Instance, seed: u64, now_ns: u64) -> Result<Self, SoakError> {
        let page = PageView::open(&Plan::page_path(instance, SUPERVISOR)).map_err(SoakError::chain)?;
        Ok(Self {
            file,
            instance: instance.name().to_owned(),
            rng: ChaCha8Rng::seed_from_u64(seed),
            page,
            under_way: None,
            next_ns: now_ns + 1_000_000_000,
            steps: Vec::new(),
        })
    }

    /// Whether there are no more.
    pub(crate) fn is_done(&self) -> bool {
        self.steps.len() >= self.file.times
    }

    /// Changes that took longer than two sweeps, as the supervisor counts them.
    pub(crate) fn took_too_long(&self) -> u64 {
        self.page.counts().modes_late
    }

    /// Looks after the change that is under way, or begins the next.
    pub(crate) fn turn(&mut self, t_s: f64, now_ns: u64) {
        let counts = self.page.counts();
        let mode = Mode::from_number(counts.mode);
        let Some(under_way) = &mut self.under_way else {
            if now_ns >= self.next_ns && !self.is_done() {
                self.begin(mode, counts.mode_changes, now_ns);
            }
            return;
        };
        let took_ms = now_ns.saturating_sub(under_way.began_ns) as f64 / 1e6;
        let mut refused = None;
        if let Some(child) = &mut under_way.child
            && let Ok(Some(status)) = child.try_wait()
        {
            if !status.success() {
                refused = Some(said(child));
            } else if leads_nowhere(&under_way.command, under_way.from, &answer(child)) {
                self.under_way = None;
                self.next_ns = now_ns + (self.file.pause_ms * 1e6) as u64;
                return;
            }
        }
        let changed = mode != under_way.from && counts.mode_changes > under_way.changes;
        if !changed && refused.is_none() && took_ms < self.file.stuck_ms {
            return;
        }
        let note = match (&refused, changed) {
            (Some(refused), _) => refused.clone(),
            (None, true) => String::new(),
            (None, false) => format!("stuck in {} for {took_ms:.0} ms", mode.name()),
        };
        let name = format!("{}: {} to {}", under_way.command, under_way.from.name(), mode.name());
        let passed = changed && refused.is_none();
        self.steps.push(Step { name, t_s, took_ms: Some(took_ms), passed, note });
        if let Some(mut child) = under_way.child.take() {
            let _ = child.wait(); // it has its answer, or is refused it
        }
        self.under_way = None;
        self.next_ns = now_ns + (self.rng.random::<f64>() * self.file.pause_ms * 1e6) as u64;
    }

    fn begin(&mut self, from: Mode, changes: u64, now_ns: u64) {
        let leads_on = |command: &&String| match command.as_str() {
            "resume" => from != Mode::Nominal,
            "pause" => from != Mode::Paused,
            "safe" => from != Mode::Safe && from != Mode::Paused,
            "degrade" => from == Mode::Nominal,
            _ => true,
        };
        let possible: Vec<&String> = self.file.commands.iter().filter(leads_on).collect();
        let place = (self.rng.random::<f64>() * possible.len() as f64) as usize;
        let Some(command) = possible.get(place).map(|command| (*command).clone()) else { return };
        let child = encke(["ctl", command.as_str(), "--instance", self.instance.as_str()])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .ok();
        self.under_way = Some(UnderWay { command, child, from, changes, began_ns: now_ns });
    }
}

/// Whether a chain answers that `resume` leaves it degraded: by its own ladder of overload, which no command takes back. That is
/// no change to be measured.
fn leads_nowhere(command: &str, from: Mode, answer: &str) -> bool {
    command == "resume" && from == Mode::Degraded && answer.starts_with(Mode::Degraded.name())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_the_ladder_holds_down_is_no_change() {
        assert!(leads_nowhere("resume", Mode::Degraded, "degraded (clusters-only)"));
        assert!(!leads_nowhere("resume", Mode::Degraded, "nominal"));
        assert!(!leads_nowhere("resume", Mode::Paused, "degraded (fewer-starts); resume again leads out of that"));
        assert!(!leads_nowhere("degrade", Mode::Degraded, "degraded"));
    }
}
