use std::sync::Arc;

use events::{Danger, EventId};
use messages::{Trace, Verdict};
use stage::{Settled, Sink};
use transport::Taken;

use crate::deadline::Deadline;
use crate::page::Said;
use crate::reader::{Arrivals, Reader, serve};
use crate::refused::Refused;
use crate::{Pace, Shell, ShellError, clock, tables};

/// Time between two checkpoints [ns].
const CHECKPOINT_NS: u64 = 1_000_000_000;

/// The main loop of the sink, which `start` makes. Returns when it was asked to leave, has drained its input and
/// finished its files.
pub fn run_sink<K: Sink>(
    shell: Shell,
    start: impl FnOnce(&Shell, Settled) -> Result<K, ShellError>,
) -> Result<(), ShellError> {
    let shell = Arc::new(shell);
    let settling = Arc::clone(&shell);
    let sink = start(&shell, Arc::new(move |part| settling.page.count_settled(part)))?;
    let node = shell.join()?;
    let inlet = node.inlet::<K::Input>()?;
    shell.running();
    let checkpoint_ns = clock::now_ns() + CHECKPOINT_NS;
    let (arrivals, refused) = (Arrivals::new(&shell), Refused::default());
    let deadline = Deadline::of(&shell.plan, &shell.name);
    let mut end = End { sink, shell: &shell, arrivals, deadline, refused, checkpoint_ns, failed_files: 0 };
    serve(&shell, &inlet, &mut end)?;
    let finished = end.sink.finish();
    end.tell_failures();
    shell.left();
    Ok(finished?)
}

struct End<'a, K: Sink> {
    sink: K,
    shell: &'a Shell,
    arrivals: Arrivals<'a>,
    deadline: Deadline,
    refused: Refused,
    checkpoint_ns: u64,
    /// Files of which it was said that they failed.
    failed_files: u64,
}

impl<K: Sink> End<'_, K> {
    /// Notes when a sweep ended here, and how long after its last return it had left the last stage; says so where that was
    /// too long.
    fn note(&mut self, trace: &Trace, verdict: Verdict) {
        let (page, now_ns) = (&self.shell.page, clock::now_ns());
        page.sent_ns.set(now_ns);
        self.refused.note(page, &trace.part, verdict);
        for alert in self.sink.alerts() {
            let (a, b) = (alert.track, Danger::of(alert.collision_probability, alert.time_s).to_number());
            page.say(Said { id: EventId::CollisionAlert, time_ns: now_ns, sweep: trace.part.sweep, a, b });
        }
        if trace.part.is_last() {
            let sent_ns = trace.hops().last().map_or(now_ns, |hop| hop.finished_ns);
            let latency_ns = sent_ns.saturating_sub(trace.due_ns);
            page.latency_ns.set(latency_ns);
            page.answered_ns.set(now_ns);
            let deadline_us = (self.shell.plan.chain.deadline_ms * 1e3) as u64;
            if self.shell.plan.pace == Pace::Realtime && latency_ns > deadline_us * 1_000 {
                let (a, b) = (latency_ns / 1_000, deadline_us);
                page.say(Said { id: EventId::DeadlineMissed, time_ns: now_ns, sweep: trace.part.sweep, a, b });
            }
        }
    }

    /// Says that files cannot be written any more.
    fn tell_failures(&mut self) {
        let page = &self.shell.page;
        let failed = self.sink.failed_files();
        if failed > self.failed_files {
            let (sweep, a) = (
                page.next_ordinal_in.get() / u64::from(self.shell.plan.chain.sectors.max(1)),
                failed - self.failed_files,
            );
            page.say(Said { id: EventId::FileFailed, time_ns: clock::now_ns(), sweep, a, b: failed });
            self.failed_files = failed;
        }
    }
}

impl<K: Sink> Reader<K::Input> for End<'_, K> {
    /// One part: receive → in hand → accept → counted → out of hand → release. Settled comes later, from the sink.
    fn take(&mut self, taken: &Taken<K::Input>) -> Result<(), ShellError> {
        if self.arrivals.receive(taken.trace()) {
            self.shell.fault_in_hand();
            let started_ns = clock::now_ns();
            // A stage may have stood still between its own look at the age and its answer.
            let verdict = if self.deadline.is_stale(taken.trace(), started_ns) {
                self.sink.refuse(taken.trace(), taken.message(), Verdict::RejectedStale)
            } else {
                self.sink.accept(taken.trace(), taken.message())
            };
            self.shell.slow_down(taken.trace().part);
            self.shell.toil(started_ns);
            self.shell.page.count_accepted(verdict);
            self.shell.page.wanted_attempt.set(self.sink.wanted_attempt().into());
            self.shell.page.put_down();
            self.note(taken.trace(), verdict);
        }
        Ok(())
    }

    fn idle(&mut self) -> Result<(), ShellError> {
        tables::acknowledge(&self.shell.page);
        if clock::now_ns() >= self.checkpoint_ns {
            self.checkpoint_ns = clock::now_ns() + CHECKPOINT_NS;
            self.tell_failures();
            // A full disk costs statistics, not the chain.
            if let Err(error) = self.sink.checkpoint() {
                tracing::error!(stage = self.shell.name, %error, "statistics could not be saved");
            }
        }
        Ok(())
    }
}
