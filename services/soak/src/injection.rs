use events::{CHAIN, Event, EventId};
use faults::{Fault, Lasting, Planned};
use serde::{Deserialize, Serialize};

/// Events that say that a stage is not well.
const HEALTH: [EventId; 5] =
    [EventId::StageDied, EventId::StageHung, EventId::StageSpinning, EventId::StageSilent, EventId::StageFlooding];

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
    /// Of a campaign of `length_s` in which sweeps are `period_s` apart.
    pub(crate) fn of(planned: &Planned, length_s: f64, period_s: f64) -> Self {
        let rest_s = (length_s - planned.at_s).max(0.0);
        let lasts_s = match (planned.for_s, planned.times, planned.fault.entry().lasting) {
            (Some(for_s), ..) => for_s,
            (None, Some(times), _) if is_of_sweeps(planned.fault) => times as f64 * period_s,
            (None, Some(times), _) if times == faults::FOR_EVER => rest_s,
            (None, None, Lasting::Open) => rest_s,
            _ => 0.0,
        };
        Self {
            at_s: planned.at_s,
            fault: planned.fault.name().to_owned(),
            stage: planned.stage.clone(),
            words: planned.command_line(),
            lasts_s: lasts_s.min(rest_s),
            again_ms: None,
        }
    }

    /// Whether the supervisor is to die of it, too.
    pub fn ends_supervisor(&self) -> bool {
        ["kill-supervisor", "kill-all"].contains(&self.fault.as_str())
    }

    /// Whether it is to end or replace processes of stages that are not named.
    pub fn hits_neighbours(&self) -> bool {
        self.stage.is_none() || self.ends_supervisor() || self.fault == "shared-memory-gone"
    }

    /// Whether an event shows that the chain knows of it: the one that the catalogue of faults names, or one of a stage's health.
    pub fn is_sign(&self, event: &Event) -> bool {
        let named = Fault::from_name(&self.fault).and_then(|fault| fault.entry().event);
        let about = self.stage.as_ref().is_none_or(|stage| *stage == event.stage);
        let id = event.event_id();
        (id.is_some() && id == named && (about || event.stage == CHAIN))
            || (about && id.is_some_and(|id| HEALTH.contains(&id)))
    }

    /// Its name in tables.
    pub fn title(&self) -> String {
        let again = if self.again_ms.is_some() { ", again at start-up" } else { "" };
        format!("{}{again}", self.fault)
    }
}

/// Whether a fault is had sweep by sweep.
fn is_of_sweeps(fault: Fault) -> bool {
    (100..200).contains(&(fault as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_lasts_as_long_as_its_sweeps_or_its_time_or_to_the_end() {
        let lasts_s = |fault, stage: Option<&str>| {
            let planned = Planned::usual(fault, 10.0, stage.map(str::to_owned), 1);
            Injection::of(&planned, 60.0, 0.1).lasts_s
        };
        assert_eq!(lasts_s(Fault::Kill, Some("source")), 0.0);
        assert_eq!(lasts_s(Fault::Stop, Some("source")), 0.5);
        assert_eq!(lasts_s(Fault::Dust, None), 1.0);
        assert_eq!(lasts_s(Fault::CrashLoop, Some("extractor")), 50.0);
        let planned = Planned { for_s: None, ..Planned::usual(Fault::Slow, 10.0, Some("source".to_owned()), 1) };
        assert_eq!(Injection::of(&planned, 60.0, 0.1).lasts_s, 50.0);
    }

    #[test]
    fn a_sign_is_about_whom_the_fault_hit() {
        let of = |stage: Option<&str>, fault| {
            Injection::of(&Planned::usual(fault, 0.0, stage.map(str::to_owned), 1), 60.0, 0.1)
        };
        let said = |id: EventId, stage: &str| Event {
            number: 0,
            time_ns: 0,
            utc_ns: 0,
            id: id as u32,
            name: id.entry().name.to_owned(),
            severity: id.severity(),
            stage: stage.to_owned(),
            sweep: 0,
            text: String::new(),
            unsaid: 0,
        };
        let kill = of(Some("extractor"), Fault::Kill);
        assert!(kill.is_sign(&said(EventId::StageDied, "extractor")));
        assert!(
            !kill.is_sign(&said(EventId::StageDied, "source")) && !kill.is_sign(&said(EventId::StepReturned, CHAIN))
        );
        let flood = of(None, Fault::CommandFlood);
        assert!(
            flood.is_sign(&said(EventId::CommandRefused, CHAIN)) && !flood.is_sign(&said(EventId::StepTaken, CHAIN))
        );
    }

    #[test]
    fn who_is_hit_may_lose_its_process() {
        let of = |fault, stage: Option<&str>| {
            Injection::of(&Planned::usual(fault, 0.0, stage.map(str::to_owned), 1), 60.0, 0.1)
        };
        assert!(!of(Fault::Kill, Some("source")).hits_neighbours());
        assert!(of(Fault::KillAll, None).hits_neighbours() && of(Fault::KillSupervisor, None).ends_supervisor());
    }
}
