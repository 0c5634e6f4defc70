use serde::{Deserialize, Serialize};

/// A fault to come: when, and what `encke inject` is told.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Injection {
    /// When, from the first sweep looked at [s].
    pub at_s: f64,
    /// The fault's name.
    pub fault: String,
    /// Whom it hits; none where that is the chain or the machine.
    pub stage: Option<String>,
    /// The words after `encke inject`.
    pub words: Vec<String>,
    /// How long it lasts [s].
    pub lasts_s: f64,
    /// The same once more, so long after the first: while the successor starts [ms].
    pub again_ms: Option<f64>,
}

impl Injection {
    /// Whether the supervisor is to die of it, too.
    pub fn ends_supervisor(&self) -> bool {
        ["kill-supervisor", "kill-all"].contains(&self.fault.as_str())
    }

    /// Whether it is to end or replace processes of stages that are not named.
    pub fn hits_neighbours(&self) -> bool {
        self.stage.is_none() || self.ends_supervisor() || self.fault == "shared-memory-gone"
    }

    /// Its name in tables.
    pub fn title(&self) -> String {
        let again = if self.again_ms.is_some() { ", again at start-up" } else { "" };
        format!("{}{again}", self.fault)
    }
}
