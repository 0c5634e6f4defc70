use chain::SUPERVISOR;
use messages::{Clusters, Descriptors, Detections, Sweep, Tracks, Truth};
use runtime::Plan;
use transport::{Node, Reopened, ServiceHold};

use crate::SupervisorError;

/// The services of a chain, held open as long as the supervisor lives.
pub(crate) struct Services {
    /// By the stage that writes, in flow order.
    written: Vec<ServiceHold>,
    _truth: ServiceHold,
}

impl Services {
    /// Creates every service before any stage starts: a process killed while it creates one can break it for good.
    pub(crate) fn create(node: &Node, plan: &Plan) -> Result<Self, SupervisorError> {
        let mut written = vec![node.create::<Sweep>()?];
        for (stage, message) in messages_of(plan) {
            written.push(match message {
                "Clusters" => node.create::<Clusters>()?,
                "Descriptors" => node.create::<Descriptors>()?,
                "Detections" => node.create::<Detections>()?,
                "Tracks" => node.create::<Tracks>()?,
                _ => return Err(unknown(stage, message)),
            });
        }
        Ok(Self { written, _truth: node.create::<Truth>()? })
    }

    /// Opens every service that a supervisor created which is dead now, and cleans up after it.
    pub(crate) fn reopen(node: &Node, plan: &Plan) -> Result<Self, SupervisorError> {
        let mut written = vec![node.reopen::<Sweep>()?];
        for (stage, message) in messages_of(plan) {
            written.push(match message {
                "Clusters" => node.reopen::<Clusters>()?,
                "Descriptors" => node.reopen::<Descriptors>()?,
                "Detections" => node.reopen::<Detections>()?,
                "Tracks" => node.reopen::<Tracks>()?,
                _ => return Err(unknown(stage, message)),
            });
        }
        let truth = node.reopen::<Truth>()?;
        // All are held open by now, so none can go with the dead. Dead stages stay: their readers have not drained them.
        let (cleaned, uncleaned) = node.clean_dead_of(SUPERVISOR);
        tracing::debug!(cleaned, uncleaned, "cleaned up after dead supervisors");
        let written = written.into_iter().map(Reopened::hold).collect::<Result<_, _>>()?;
        Ok(Self { written, _truth: truth.hold()? })
    }

    /// Wakes the readers of what the stage at `position` writes.
    pub(crate) fn wake_readers_of(&self, position: usize) {
        if let Some(service) = self.written.get(position) {
            service.wake();
        }
    }
}

/// What each stage writes, by the stage's name.
fn messages_of(plan: &Plan) -> impl Iterator<Item = (&str, &str)> {
    plan.chain.stages.iter().filter_map(|stage| Some((stage.name.as_str(), stage.writes.as_deref()?)))
}

fn unknown(stage: &str, message: &str) -> SupervisorError {
    SupervisorError::Message { stage: stage.to_owned(), message: message.to_owned() }
}
