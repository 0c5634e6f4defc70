//! What a chain has used and done, gathered while it runs and told at its end.

use recorder::Snapshot;
use runtime::page::Page;
use runtime::{Plan, clock};

use crate::modes::overload::OverloadReport;
use crate::processes::usage::{ProcessReport, SETTLE_NS, SETTLE_SWEEPS};
use crate::report::events_report::EventsReport;
use crate::report::ledger;
use crate::report::timeline_report::TimelineReport;
use crate::report::{Facts, Report};
use crate::watch::Watch;

impl Watch<'_> {
    /// Looks at what each process uses, and who has the cores.
    pub(crate) fn sample(&mut self) {
        let settled = clock::now_ns() - self.started_ns >= SETTLE_NS
            && self.stages[0].page.published.get() >= SETTLE_SWEEPS * u64::from(self.plan.chain.sectors);
        for stage in self.stages.iter_mut().chain(self.tape.as_mut().map(|tape| &mut tape.process)) {
            if let Some(pid) = stage.pid() {
                stage.usage.update(pid.as_raw_nonzero().get() as u32, settled);
            }
        }
        self.usage.update(std::process::id(), settled);
        let processes = || self.stages.iter().chain(self.tape.iter().map(|tape| &tape.process));
        let own_cpu_s = processes().map(|process| process.usage.cpu_s()).sum::<f64>() + self.usage.cpu_s();
        let now_ns = clock::now_ns();
        let machine = self.machine.look(now_ns, own_cpu_s);
        let usages = processes().map(|process| &process.usage).chain([&self.usage]);
        self.timeline.look(now_ns, usages, machine, self.noise.take_latest_ns());
    }

    fn overload_report(&mut self) -> OverloadReport {
        let mut report = std::mem::take(&mut self.overload);
        for stage in &self.stages {
            report.overruns.insert(stage.name.clone(), stage.page.overruns.get());
            report.slips.insert(stage.name.clone(), stage.page.slips.get());
        }
        report
    }

    pub(crate) fn report(mut self) -> Report {
        self.end_log();
        let overload = self.overload_report();
        let duration_s = (clock::now_ns() - self.started_ns) as f64 / 1e9;
        self.usage.update(std::process::id(), true);
        let pages: Vec<(&str, &Page)> = self.stages.iter().map(|stage| (stage.name.as_str(), &*stage.page)).collect();
        let beside = self.tape.iter().map(|tape| &tape.process);
        let mut processes: Vec<_> =
            self.stages.iter().chain(beside).map(|stage| ProcessReport::of_stage(stage, duration_s)).collect();
        processes.push(ProcessReport::of_supervisor(&self.usage, duration_s));
        let snapshot = self.snapshot();
        let stages: Vec<&str> = snapshot.stages.iter().map(|stage| stage.stage.as_str()).collect();
        let names: Vec<&str> = processes.iter().map(|process| process.stage.as_str()).collect();
        let timeline = TimelineReport::of(&self.timeline, &snapshot.timeline, &stages, &names);
        Report::of(Facts {
            plan: &self.plan,
            timeline,
            snapshot,
            ledger: ledger::account(&pages, self.plan.chain.sectors),
            published: self.stages[0].page.next_ordinal_out.get(),
            duration_s,
            processes,
            overload,
            machine_load: self.machine.load(),
            noise_ms: self.noise.finish(),
            realtime_refused: std::mem::take(&mut self.refused),
            stopped: self.failed.clone(),
            events: EventsReport::of(&self.log),
            mode: self.modes.mode(),
            modes: self.modes.report,
            safe_entered: self.safe_entered.clone(),
            commands: self.commands_report(),
            recording: self.tape.as_ref().map(|tape| tape.report(self.instance, &self.plan)),
        })
    }

    /// The sink's statistics of all its lives.
    fn snapshot(&self) -> Snapshot {
        let mut all = Snapshot::default();
        let lives = self.stages.last().map_or(0, |sink| sink.page.incarnation.get());
        for life in 1..=lives {
            let path = Plan::snapshot_path(self.instance, life as u32);
            // A life that ended before its first checkpoint left none.
            if !path.exists() {
                continue;
            }
            if let Err(error) = Snapshot::read(&path).and_then(|snapshot| all.merge(&snapshot)) {
                tracing::error!(%error, "statistics of one life of the sink are missing");
            }
        }
        all
    }
}
