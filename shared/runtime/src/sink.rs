use std::sync::Arc;

use messages::{Trace, Verdict};
use stage::{Settled, Sink};
use transport::Taken;

use crate::deadline::Deadline;
use crate::reader::{Arrivals, Reader, serve};
use crate::{Shell, ShellError, clock};

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
    let deadline = Deadline::of(&shell.plan, &shell.name);
    let mut end = End { sink, shell: &shell, arrivals: Arrivals::new(&shell), deadline, checkpoint_ns };
    serve(&shell, &inlet, &mut end)?;
    let finished = end.sink.finish();
    shell.left();
    Ok(finished?)
}

struct End<'a, K: Sink> {
    sink: K,
    shell: &'a Shell,
    arrivals: Arrivals<'a>,
    deadline: Deadline,
    checkpoint_ns: u64,
}

impl<K: Sink> End<'_, K> {
    /// Notes when a sweep ended here, and how long after its last return it had left the last stage.
    fn note(&self, trace: &Trace) {
        let (page, now_ns) = (&self.shell.page, clock::now_ns());
        page.sent_ns.set(now_ns);
        if trace.part.is_last() {
            let sent_ns = trace.hops().last().map_or(now_ns, |hop| hop.finished_ns);
            page.latency_ns.set(sent_ns.saturating_sub(trace.due_ns));
            page.answered_ns.set(now_ns);
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
            self.note(taken.trace());
        }
        Ok(())
    }

    fn idle(&mut self) -> Result<(), ShellError> {
        if clock::now_ns() >= self.checkpoint_ns {
            self.checkpoint_ns = clock::now_ns() + CHECKPOINT_NS;
            // A full disk costs statistics, not the chain.
            if let Err(error) = self.sink.checkpoint() {
                tracing::error!(stage = self.shell.name, %error, "statistics could not be saved");
            }
        }
        Ok(())
    }
}
