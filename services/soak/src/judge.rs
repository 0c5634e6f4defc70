//! The bars of a soak that one run went through.

use supervisor::Report;

use crate::bars::Bars;
use crate::look::{Growth, ProcessRecord, SETTLE_S, Steady};
use crate::matrix::Row;
use crate::statistics::Drift;
use crate::verdict::{Available, Bar, SharedMemoryRecord};

/// What there is to judge.
pub(crate) struct Facts<'a> {
    pub(crate) bars: &'a Bars,
    pub(crate) available: &'a Available,
    pub(crate) drift: &'a Drift,
    pub(crate) processes: &'a [ProcessRecord],
    pub(crate) shared: &'a SharedMemoryRecord,
    pub(crate) restarts: u64,
    pub(crate) rows: &'a [Row],
    pub(crate) reports: &'a [Report],
    /// Supervisors that had to end in order and say so in a report.
    pub(crate) ends: usize,
    pub(crate) exit_code: Option<i32>,
    pub(crate) leftovers: &'a [String],
    pub(crate) fell: u64,
    pub(crate) over_budget: u64,
    pub(crate) foreign_pct: Option<f64>,
    pub(crate) events_skipped: u64,
}

impl Facts<'_> {
    /// What must hold of any run: it ends in order and leaves nothing, all parts have their place, no invariant was broken.
    pub(crate) fn common(&self) -> Vec<Bar> {
        let open: u64 = self.reports.iter().flat_map(|report| &report.ledger.hops).map(|hop| hop.open).sum();
        let unclosed = self.reports.iter().filter(|report| !report.ledger.closed).count();
        let missing = self.ends.saturating_sub(self.reports.len());
        let ledger = Bar::none("ledgers not closed", unclosed + missing);
        let note = if missing > 0 { format!("{missing} runs left no report") } else { format!("{open} parts open") };
        vec![
            ledger.noting(note),
            Bar::at_most("exit code of the run", self.exit_code.map(f64::from).or(Some(-1.0)), 0.0, "").noting(
                self.reports.iter().filter_map(|report| report.verdict.failed.clone()).collect::<Vec<_>>().join("; "),
            ),
            Bar::none("left behind at the end", self.leftovers.len()).noting(self.leftovers.join(", ")),
            Bar::none("counts that fell", self.fell as usize),
            Bar::none("restart budgets exceeded", self.over_budget as usize),
            Bar::none("stale answers", self.available.stale as usize),
            Bar::none("events never seen", self.events_skipped as usize),
        ]
    }

    /// A soak without faults.
    pub(crate) fn no_faults(&self) -> Vec<Bar> {
        let bars = &self.bars.no_faults;
        let busy = self.busy();
        let misses = self.available.overall.due - self.available.overall.in_time;
        let mut all = self.common();
        all.push(Bar::at_most("deadline misses", Some(misses as f64), bars.misses as f64, "").unless(busy.as_deref()));
        all.push(Bar::at_most("restarts", Some(self.restarts as f64), bars.restarts as f64, ""));
        all.extend(self.memory(bars.memory_growth_pct));
        all.extend(self.constants());
        all.push(Bar::at_most("drift of p50", self.drift.p50_pct, bars.p50_drift_pct, "%").unless(busy.as_deref()));
        all.push(Bar::at_most("drift of p99", self.drift.p99_pct, bars.p99_drift_pct, "%").unless(busy.as_deref()));
        all
    }

    /// A soak with faults of all kinds.
    pub(crate) fn faults(&self) -> Vec<Bar> {
        let bars = &self.bars.faults;
        let mut all = self.common();
        let after = format!("availability outside {} s after each injection", self.bars.settle_s);
        all.push(Bar::at_least(&after, self.available.after_injections_pct, bars.availability_pct, "%"));
        all.push(Bar::at_least(
            "availability outside faults",
            self.available.outside_faults_pct,
            bars.availability_outside_faults_pct,
            "%",
        ));
        all.push(self.refused());
        all.push(self.invariants());
        all
    }

    /// Each stage killed.
    pub(crate) fn kills(&self) -> Vec<Bar> {
        let bars = &self.bars.kills;
        let mut all = self.common();
        let had = || self.rows.iter().filter(|row| row.refused.is_none());
        let worst = |of: fn(&Row) -> Option<f64>| {
            // Never is longer than anything.
            had()
                .map(|row| of(row).unwrap_or(f64::INFINITY))
                .fold(None, |most: Option<f64>, ms| Some(most.map_or(ms, |most| most.max(ms))))
        };
        let beyond = |of: fn(&Row) -> Option<f64>, bound: f64| {
            let late = had().filter(|row| of(row).is_none_or(|ms| ms > bound)).count();
            format!("{late} of {} took longer", had().count())
        };
        let (detected, back) = (|row: &Row| row.detected_ms, |row: &Row| row.output_again_ms);
        all.push(
            Bar::at_most("longest until detected", worst(detected), bars.detected_ms, "ms")
                .noting(beyond(detected, bars.detected_ms)),
        );
        all.push(
            Bar::at_most("longest until output again", worst(back), bars.output_again_ms, "ms")
                .noting(beyond(back, bars.output_again_ms)),
        );
        let after = format!("availability outside {} s after each kill", self.bars.settle_s);
        all.push(Bar::at_least(&after, self.available.after_injections_pct, bars.availability_pct, "%"));
        all.push(self.refused());
        all.push(self.invariants());
        all
    }

    fn refused(&self) -> Bar {
        let refused: Vec<_> = self.rows.iter().filter_map(|row| row.refused.as_deref()).collect();
        let why = refused.first().map_or(String::new(), |why| format!("the first: {why}"));
        Bar::none("faults that could not be injected", refused.len()).noting(why)
    }

    fn invariants(&self) -> Bar {
        let rows: Vec<_> = self.rows.iter().filter(|row| row.refused.is_none()).collect();
        let broken: Vec<_> = rows.iter().filter(|row| !row.invariants.broken().is_empty()).collect();
        let first = broken.first().map_or(String::new(), |row| {
            let stage = row.stage.as_deref().unwrap_or("the chain");
            format!("the first: {} of {stage} at {:.1} s: {}", row.fault, row.t_s, row.invariants.broken().join(", "))
        });
        Bar::none("faults after which an invariant was broken", broken.len()).noting(first)
    }

    /// Why misses and drift say nothing of the chain, where others had the cores.
    fn busy(&self) -> Option<String> {
        let foreign = self.foreign_pct?;
        (foreign > self.bars.idle_pct)
            .then(|| format!("others took {foreign:.0} % of a core, more than {:.0} %", self.bars.idle_pct))
    }

    /// Memory of all kinds, and what is a process's own. How much of the queues in shared memory is touched depends on who has the
    /// cores; what a process has for itself does not.
    fn memory(&self, most_pct: f64) -> Vec<Bar> {
        let busy = self.busy();
        let all = self.growth("memory", |of| of.memory_kib, most_pct);
        let own = self.growth("memory of its own", |of| of.own_memory_kib, most_pct);
        // Too short is the better reason.
        let judged = |bar: Bar| if bar.passed.is_none() { bar } else { bar.unless(busy.as_deref()) };
        all.into_iter().map(judged).chain(own).collect()
    }

    fn growth(&self, what: &str, of: fn(&ProcessRecord) -> Option<Growth>, most_pct: f64) -> [Bar; 2] {
        let grown: Vec<_> = self.processes.iter().filter_map(|one| Some((&one.process, of(one)?))).collect();
        let worst = grown.iter().max_by(|(_, one), (_, other)| one.growth_pct.total_cmp(&other.growth_pct));
        let short = (grown.len() < self.processes.len() || grown.is_empty())
            .then(|| format!("needs more than {SETTLE_S:.0} s and a few minutes"));
        let value = worst.map(|(_, growth)| growth.growth_pct);
        let growth =
            Bar::at_most(&format!("growth of {what} after {SETTLE_S:.0} s, worst process"), value, most_pct, "%");
        let note = worst.map_or(String::new(), |(process, growth)| {
            format!("{process}: {:.0} to {:.0} KiB", growth.first, growth.last)
        });
        let sloping: Vec<_> = grown.iter().filter(|(_, growth)| !growth.per_hour.may_be_zero()).collect();
        let names = sloping.iter().map(|(process, growth)| format!("{process} {:+.1} KiB/h", growth.per_hour.slope));
        let slopes = Bar::none(&format!("processes whose slope of {what} is not 0 (95 %)"), sloping.len());
        [
            growth.noting(note).unless(short.as_deref()),
            slopes.noting(names.collect::<Vec<_>>().join(", ")).unless(short.as_deref()),
        ]
    }

    /// Objects in shared memory are made at their full length; what is touched of them for the first time takes memory.
    fn touched(&self) -> Bar {
        let growth = self.shared.touched_kib;
        let note = growth.map_or(String::new(), |of| format!("{:.0} to {:.0} KiB", of.first, of.last));
        let short = growth.is_none().then_some("too short a run");
        let value = growth.map(|growth| growth.growth_pct);
        let name = format!("growth of shared memory taken, after {SETTLE_S:.0} s");
        Bar::at_most(&name, value, self.bars.no_faults.shared_memory_growth_pct, "%")
            .noting(note)
            .unless(short.or(self.busy().as_deref()))
    }

    fn constants(&self) -> [Bar; 5] {
        let changed = |of: fn(&ProcessRecord) -> Option<Steady>| {
            let of = self.processes.iter().map(|process| (process, of(process)));
            let (mut most, mut note) = (None, String::new());
            for (process, steady) in of {
                let Some(Steady { first, last, .. }) = steady else { continue };
                let change = first.abs_diff(last);
                if most.is_none_or(|most| change > most) {
                    most = Some(change);
                    note = if change > 0 { format!("{}: {first} to {last}", process.process) } else { String::new() };
                }
            }
            (most.map(|most| most as f64), note)
        };
        let short = |value: Option<f64>| value.is_none().then_some("too short a run");
        let (files, files_note) = changed(|of| of.files);
        let (threads, threads_note) = changed(|of| of.threads);
        let change = |of: Option<Steady>| of.map(|Steady { first, last, .. }| first.abs_diff(last) as f64);
        let (objects, length) = (change(self.shared.objects), change(self.shared.length_kib));
        [
            Bar::at_most("change of file descriptors, the worst process", files, 0.0, "")
                .noting(files_note)
                .unless(short(files)),
            Bar::at_most("change of threads, the worst process", threads, 0.0, "")
                .noting(threads_note)
                .unless(short(threads)),
            Bar::at_most("change of objects in shared memory", objects, 0.0, "").unless(short(objects)),
            Bar::at_most("change of shared memory's length", length, 0.0, "KiB").unless(short(length)),
            self.touched(),
        ]
    }
}
