use events::Reader;
use messages::Tracks;
use runtime::{Plan, Shutdown, clock};
use transport::{Instance, Tap};

use super::model::Model;
use super::view::View;
use crate::MonitorError;
use crate::attached::Attached;
use crate::sample::Sample;

/// Between two looks at the tap [ns]: a tenth of its queue at 10 Hz.
const TAP_NS: u64 = 40_000_000;
/// Between two looks for an instance that ended [ns].
const LOOK_NS: u64 = 500_000_000;

/// An instance being watched, through all its lives.
pub(super) struct Watch {
    instance: Instance,
    interval_ns: u64,
    /// None while no chain of this name runs. The tap before what it is a guest of.
    chain: Option<(Tap<Tracks>, Attached)>,
    /// The log of the chain.
    log: Reader,
    model: Model,
    next_sample_ns: u64,
    /// Signals to this process, also while no chain runs.
    shutdown: Shutdown,
}

impl Watch {
    /// Attaches to a running instance.
    pub(super) fn begin(instance: &Instance, interval_ns: u64) -> Result<Self, MonitorError> {
        let (tap, chain) = attach(instance)?;
        let mut model = Model::new(chain.facts.clone());
        model.sample(Sample::take(&chain));
        let next_sample_ns = clock::now_ns() + interval_ns;
        let shutdown = Shutdown::install(chain.facts.supervisor_pid)?;
        let (instance, log) = (instance.clone(), log(instance));
        let mut watch = Self { instance, interval_ns, chain: Some((tap, chain)), log, model, next_sample_ns, shutdown };
        watch.read_log();
        Ok(watch)
    }

    /// Whether this process was asked to leave.
    pub(super) fn asked(&self) -> bool {
        self.shutdown.asked()
    }

    /// Takes what has come, looks where it is time, notices the end and the start of the instance. Whether there is
    /// something new to show.
    pub(super) fn turn(&mut self, runs: &impl Fn() -> bool) -> Result<bool, MonitorError> {
        let now_ns = clock::now_ns();
        let Some((tap, chain)) = &self.chain else {
            if now_ns < self.next_sample_ns {
                return Ok(false);
            }
            self.next_sample_ns = now_ns + LOOK_NS;
            return Ok(runs() && self.attach_again());
        };
        while let Some(taken) = tap.take()? {
            self.model.part(taken.trace(), taken.message());
        }
        let ended = chain.shutdown.orphaned();
        if now_ns < self.next_sample_ns && !ended {
            return Ok(false);
        }
        self.model.sample(Sample::take(chain));
        let left_behind = chain.node.is_left_behind();
        self.read_log();
        self.next_sample_ns = now_ns + self.interval_ns;
        if left_behind && let Ok(chain) = attach(&self.instance) {
            self.chain = Some(chain);
        }
        if ended {
            self.chain = None;
            self.next_sample_ns = now_ns + LOOK_NS;
            self.model
                .note(Some("the chain has ended; this is how it was last seen, waiting for its next start".into()));
        }
        Ok(true)
    }

    /// A chain that is starting may not be ready yet.
    fn attach_again(&mut self) -> bool {
        let Ok((tap, chain)) = attach(&self.instance) else { return false };
        self.model.renew(chain.facts.clone());
        self.model.sample(Sample::take(&chain));
        self.chain = Some((tap, chain));
        self.log = log(&self.instance);
        self.read_log();
        true
    }

    fn read_log(&mut self) {
        self.log.read(|event| self.model.happened(&event));
    }

    /// What is to be shown now.
    pub(super) fn view(&self) -> View {
        self.model.view()
    }

    /// How long nothing is to be done [ns].
    pub(super) fn patience_ns(&self) -> u64 {
        self.next_sample_ns.saturating_sub(clock::now_ns()).min(TAP_NS)
    }

    /// Watches for two intervals, so that there are rates, and gives what is to be shown then.
    pub(super) fn snapshot(&mut self) -> Result<View, MonitorError> {
        let mut looks = 0;
        while looks < 2 && !self.asked() && self.chain.is_some() {
            clock::sleep_ns(self.patience_ns());
            looks += u32::from(self.turn(&|| false)?);
        }
        Ok(self.view())
    }
}

/// The log from its begin on: what happened before this viewer came is shown, too.
fn log(instance: &Instance) -> Reader {
    Reader::new(&Plan::events_path(instance), 0)
}

fn attach(instance: &Instance) -> Result<(Tap<Tracks>, Attached), MonitorError> {
    let chain = Attached::to(instance, "top")?;
    Ok((chain.node.tap()?, chain))
}
