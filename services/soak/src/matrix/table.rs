use std::collections::BTreeMap;
use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::Row;
use crate::statistics::median;

/// All faults of a soak, by fault and stage.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Matrix {
    /// One line for each fault and stage, by name.
    pub lines: Vec<Line>,
}

/// All faults of one kind that hit one stage.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Line {
    /// The fault.
    pub fault: String,
    /// Whom it hit.
    pub stage: Option<String>,
    /// How often.
    pub count: usize,
    /// How often it could not be injected; those count nowhere else.
    pub refused: usize,
    /// How often the chain gave no sign that it knew.
    pub unseen: usize,
    /// Until the first sign [ms]: median and worst.
    pub detected_ms: Option<[f64; 2]>,
    /// Until there was output again [ms]: median and worst.
    pub output_again_ms: Option<[f64; 2]>,
    /// How often there was none before the next fault.
    pub still_silent: usize,
    /// Sweeps late, broken or not answered: median and worst.
    pub missed_sweeps: [u64; 2],
    /// Parts lost: median and worst.
    pub lost: [u64; 2],
    /// Parts dropped: median and worst.
    pub dropped: [u64; 2],
    /// Parts rejected: median and worst.
    pub rejected: [u64; 2],
    /// Events about it, the most frequent first.
    pub action: Vec<String>,
    /// What did not hold, and how often.
    pub broken: BTreeMap<String, usize>,
}

impl Matrix {
    /// Of all rows.
    pub fn of(rows: &[Row]) -> Self {
        let mut kinds: BTreeMap<(String, Option<String>), Vec<&Row>> = BTreeMap::new();
        for row in rows {
            kinds.entry((row.fault.clone(), row.stage.clone())).or_default().push(row);
        }
        Self { lines: kinds.into_iter().map(|((fault, stage), rows)| line(fault, stage, &rows)).collect() }
    }

    /// As a table in Markdown.
    pub fn to_markdown(&self) -> String {
        let mut text = "| fault | of | times | detected after [ms] | action | output again after [ms] | sweeps missed | parts lost | dropped | rejected | invariants |\n\
                        |---|---|---|---|---|---|---|---|---|---|---|\n"
            .to_owned();
        for line in &self.lines {
            let _ = writeln!(
                text,
                "| {} | {} | {}{} | {}{} | {} | {}{} | {} | {} | {} | {} | {} |",
                line.fault,
                line.stage.as_deref().unwrap_or("–"),
                line.count,
                if line.refused > 0 { format!(", {} refused", line.refused) } else { String::new() },
                pair_ms(line.detected_ms),
                if line.unseen > 0 { format!(", {} unseen", line.unseen) } else { String::new() },
                if line.action.is_empty() { "–".to_owned() } else { line.action.join(", ") },
                pair_ms(line.output_again_ms),
                if line.still_silent > 0 { format!(", {} silent", line.still_silent) } else { String::new() },
                pair(line.missed_sweeps),
                pair(line.lost),
                pair(line.dropped),
                pair(line.rejected),
                held(&line.broken),
            );
        }
        text
    }
}

fn held(broken: &BTreeMap<String, usize>) -> String {
    if broken.is_empty() {
        return "hold".to_owned();
    }
    broken.iter().map(|(name, times)| format!("**{name} {times}×**")).collect::<Vec<_>>().join(", ")
}

fn pair_ms(values: Option<[f64; 2]>) -> String {
    values.map_or("–".to_owned(), |[middle, worst]| format!("{middle:.0} / {worst:.0}"))
}

fn pair([middle, worst]: [u64; 2]) -> String {
    if worst == 0 { "0".to_owned() } else { format!("{middle} / {worst}") }
}

fn line(fault: String, stage: Option<String>, rows: &[&Row]) -> Line {
    let had: Vec<&Row> = rows.iter().copied().filter(|row| row.refused.is_none()).collect();
    let times = |of: fn(&Row) -> Option<f64>| {
        let values: Vec<f64> = had.iter().filter_map(|row| of(row)).collect();
        let worst = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        median(values).map(|middle| [middle, worst])
    };
    let counts = |of: fn(&Row) -> u64| {
        let values: Vec<f64> = had.iter().map(|row| of(row) as f64).collect();
        let worst = had.iter().map(|row| of(row)).max().unwrap_or(0);
        [median(values).unwrap_or(0.0) as u64, worst]
    };
    let (mut events, mut broken) = (BTreeMap::<&str, usize>::new(), BTreeMap::new());
    for row in &had {
        row.action.iter().for_each(|event| *events.entry(event).or_default() += 1);
        row.invariants.broken().into_iter().for_each(|name| *broken.entry(name.to_owned()).or_default() += 1);
    }
    let mut events: Vec<_> = events.into_iter().collect();
    events.sort_by_key(|(_, times)| std::cmp::Reverse(*times));
    Line {
        fault,
        stage,
        count: had.len(),
        refused: rows.len() - had.len(),
        unseen: had.iter().filter(|row| row.detected_ms.is_none()).count(),
        detected_ms: times(|row| row.detected_ms),
        output_again_ms: times(|row| row.output_again_ms),
        still_silent: had.iter().filter(|row| row.output_again_ms.is_none()).count(),
        missed_sweeps: counts(|row| row.missed_sweeps),
        lost: counts(|row| row.lost),
        dropped: counts(|row| row.dropped),
        rejected: counts(|row| row.rejected),
        action: events.into_iter().map(|(name, _)| name.to_owned()).collect(),
        broken,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::Invariants;

    const ALL_HOLD: Invariants = Invariants {
        sequence_rises: true,
        within_budget: true,
        neighbours_kept: true,
        none_stale: true,
        files_back: true,
        shared_memory_back: true,
    };

    fn row(stage: &str, detected_ms: f64, again_ms: Option<f64>, lost: u64) -> Row {
        Row {
            fault: "kill".to_owned(),
            stage: Some(stage.to_owned()),
            detected_ms: Some(detected_ms),
            output_again_ms: again_ms,
            lost,
            action: vec!["stage_died".to_owned(), "stage_restarted".to_owned()],
            invariants: ALL_HOLD,
            ..Row::default()
        }
    }

    #[test]
    fn lines_are_by_fault_and_stage_with_the_middle_and_the_worst() {
        let mut rows = vec![row("source", 3.0, Some(300.0), 0), row("clusterer", 5.0, Some(200.0), 2)];
        rows.extend([row("clusterer", 9.0, Some(400.0), 4), row("clusterer", 7.0, None, 40)]);
        rows[1].invariants.files_back = false;
        rows.push(Row { refused: Some("no process".to_owned()), ..row("source", 1.0, None, 99) });
        let sut = Matrix::of(&rows);
        assert_eq!(sut.lines.len(), 2);
        let line = &sut.lines[0];
        assert_eq!((line.stage.as_deref(), line.count, line.detected_ms), (Some("clusterer"), 3, Some([7.0, 9.0])));
        assert_eq!((line.output_again_ms, line.still_silent), (Some([300.0, 400.0]), 1));
        assert_eq!((line.lost, line.broken["files not back"]), ([4, 40], 1));
        assert_eq!((sut.lines[1].count, sut.lines[1].refused), (1, 1));
        let text = sut.to_markdown();
        assert!(text.contains("| kill | clusterer | 3 | 7 / 9 | stage_died, stage_restarted |"), "{text}");
        assert!(text.contains("**files not back 1×**"), "{text}");
    }
}
