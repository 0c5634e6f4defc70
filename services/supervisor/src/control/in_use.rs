//! Whether tables that a chain has accepted are in use by its stages, seen from outside.

use chain::{Mode, SUPERVISOR};
use runtime::page::{Counts, PageView};
use runtime::{Plan, ShellError, clock};
use transport::Instance;

use super::Answer;
use crate::house::Running;

/// How long the stages may take [ns]: some sweeps, however long one takes.
const PATIENCE_NS: u64 = 10_000_000_000;
/// Between two looks at the pages [ns].
const LOOK_NS: u64 = 5_000_000;

/// What the stages have done with the tables of a generation.
#[derive(Debug, Default, PartialEq)]
struct Seen {
    in_use: Vec<String>,
    refused: Vec<String>,
    waiting: Vec<String>,
}

/// Why nobody waits any longer.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Settled,
    StandsStill,
    SupervisorGone,
    Patience,
}

/// Waits until every stage that has parameters uses those of the chain's latest reload, or has refused them; at most 10 s, and
/// not at all while the chain stands still. `accepted` is the supervisor's answer to the reload. What is given back says which
/// stages do what; it is a refusal where a stage goes on with its old parameters.
pub fn await_tables(instance: &Instance, accepted: &Answer) -> Answer {
    let gone = |_| verdict(&accepted.text, &Seen::default(), End::SupervisorGone);
    watch(instance).map_or_else(gone, |(seen, end)| verdict(&accepted.text, &seen, end))
}

fn watch(instance: &Instance) -> Result<(Seen, End), ShellError> {
    let plan = Plan::read(instance)?;
    let open = |stage: &str| Ok((stage.to_owned(), PageView::open(&Plan::page_path(instance, stage))?));
    let with_parameters = plan.stages().filter(|stage| plan.parameters.contains_key(*stage));
    let pages: Vec<_> = with_parameters.map(open).collect::<Result<_, ShellError>>()?;
    let supervisor = PageView::open(&Plan::page_path(instance, SUPERVISOR))?;
    let end_ns = clock::now_ns() + PATIENCE_NS;
    loop {
        let seen = look(plan.generation, pages.iter().map(|(stage, page)| (stage.as_str(), page.counts())));
        let stands_still = plan.source.single_step || Mode::from_number(supervisor.counts().mode) == Mode::Paused;
        let end = match () {
            () if seen.waiting.is_empty() => Some(End::Settled),
            () if stands_still => Some(End::StandsStill),
            () if Running::of(instance).is_none() => Some(End::SupervisorGone),
            () if clock::now_ns() >= end_ns => Some(End::Patience),
            () => None,
        };
        if let Some(end) = end {
            return Ok((seen, end));
        }
        clock::sleep_ns(LOOK_NS);
    }
}

/// A later generation counts, too: who uses it has left this one behind.
fn look<'a>(generation: u64, pages: impl Iterator<Item = (&'a str, Counts)>) -> Seen {
    let mut seen = Seen::default();
    for (stage, counts) in pages {
        let place = match () {
            () if counts.table_active >= generation => &mut seen.in_use,
            () if counts.table_refused >= generation => &mut seen.refused,
            () => &mut seen.waiting,
        };
        place.push(stage.to_owned());
    }
    seen
}

/// The answer for whoever asked, in one line.
fn verdict(accepted: &str, seen: &Seen, end: End) -> Answer {
    let waiting = seen.waiting.join(", ");
    let mut text = accepted.to_owned();
    for (what, stages) in [("in use by", &seen.in_use), ("refused by", &seen.refused)] {
        if !stages.is_empty() {
            text += &format!("; {what} {}", stages.join(", "));
        }
    }
    if !seen.refused.is_empty() {
        text += ", where the old ones stay in use";
    }
    text += &match end {
        End::Settled => String::new(),
        End::StandsStill => format!("; {waiting}: once the chain goes on"),
        End::SupervisorGone if waiting.is_empty() => "; the chain ended before they were in use".to_owned(),
        End::SupervisorGone => format!("; the chain ended before they were in use by {waiting}"),
        End::Patience => format!("; not in use by {waiting} after {} s", PATIENCE_NS / 1_000_000_000),
    };
    let holds = seen.refused.is_empty() && matches!(end, End::Settled | End::StandsStill);
    Answer { accepted: holds, text }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ACCEPTED: &str = "parameters 2 from sweep 9 on";

    fn counts(active: u64, refused: u64) -> Counts {
        Counts { table_active: active, table_refused: refused, ..Counts::default() }
    }

    /// What is said of two stages that are so far.
    fn said(one: Counts, other: Counts, end: End) -> (bool, String) {
        let seen = look(2, [("clusterer", one), ("extractor", other)].into_iter());
        let answer = verdict(ACCEPTED, &seen, end);
        (answer.accepted, answer.text.strip_prefix(ACCEPTED).unwrap().to_owned())
    }

    #[test]
    fn tables_are_in_use_where_every_stage_has_them_or_later_ones() {
        let (holds, text) = said(counts(2, 0), counts(3, 1), End::Settled);
        assert!(holds);
        assert_eq!(text, "; in use by clusterer, extractor");
    }

    #[test]
    fn a_stage_that_refuses_makes_it_a_refusal_that_names_it() {
        let (holds, text) = said(counts(1, 2), counts(2, 0), End::Settled);
        assert!(!holds);
        assert_eq!(text, "; in use by extractor; refused by clusterer, where the old ones stay in use");
    }

    #[test]
    fn who_stands_still_is_not_waited_for_and_who_takes_too_long_is_named() {
        let (holds, text) = said(counts(1, 0), counts(1, 1), End::StandsStill);
        assert!(holds);
        assert_eq!(text, "; clusterer, extractor: once the chain goes on");
        let (holds, text) = said(counts(2, 0), counts(1, 0), End::Patience);
        assert!(!holds);
        assert_eq!(text, "; in use by clusterer; not in use by extractor after 10 s");
        let (holds, text) = said(counts(2, 0), counts(1, 0), End::SupervisorGone);
        assert!(!holds);
        assert_eq!(text, "; in use by clusterer; the chain ended before they were in use by extractor");
        assert!(!verdict(ACCEPTED, &Seen::default(), End::SupervisorGone).accepted);
    }
}
