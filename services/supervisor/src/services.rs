use messages::{Clusters, Descriptors, Detections, Sweep, Truth};
use runtime::Plan;
use transport::{Node, ServiceHold};

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
        for stage in &plan.chain.stages {
            let Some(message) = &stage.writes else { continue };
            written.push(match message.as_str() {
                "Clusters" => node.create::<Clusters>()?,
                "Descriptors" => node.create::<Descriptors>()?,
                "Detections" => node.create::<Detections>()?,
                _ => {
                    return Err(SupervisorError::Message { stage: stage.name.clone(), message: message.clone() });
                }
            });
        }
        Ok(Self { written, _truth: node.create::<Truth>()? })
    }

    /// Wakes the readers of what the stage at `position` writes.
    pub(crate) fn wake_readers_of(&self, position: usize) {
        if let Some(service) = self.written.get(position) {
            service.wake();
        }
    }
}
