//! What the executive orders is carried out.

use chain::executive::Action;
use events::EventId;

use crate::executive::Order;
use crate::watch::Watch;

impl Watch<'_> {
    /// Carries an order out.
    pub(crate) fn obey(&mut self, order: &Order) {
        let (Action::RestartStage, Some(place)) = (order.action, order.stage) else { return };
        let name = self.name_at(place);
        self.say(EventId::StageKilled, &name, &order.reason);
        // Its end is found and settled like any other.
        match (self.stages.get(place), &self.tape) {
            (Some(stage), _) => stage.kill(),
            (None, Some(tape)) => tape.process.kill(),
            (None, None) => {}
        }
    }
}
