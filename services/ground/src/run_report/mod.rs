//! One page from a run's report or recording: `encke report`.

mod budget_plots;
mod detection_plots;
mod figures;
mod latency_plots;
mod ledger_table;
mod page;
mod parts;
mod plot;
mod read;
mod recording;
mod tables;
mod tally;
#[cfg(test)]
mod tests;
mod usage_plots;
mod verdict;
mod worst_plot;

pub use figures::RunFigures;
pub use read::RunReportError;
