//! The source between two sweeps: paused, at its end, waiting; and what its page says then.

use stage::Source;

use super::{LOOK_NS, Out, wait_while};
use crate::page::State;
use crate::{Shell, clock};

/// Between two looks at the flags while it stands still [ns]: a twentieth of a turn at 10 Hz.
const PAUSE_LOOK_NS: u64 = 5_000_000;

/// Nothing is under way: the next sweep will be at the step that is asked for.
pub(super) fn between_sweeps(shell: &Shell) {
    shell.page.step_sent.set(shell.page.step.get());
}

impl Out<'_> {
    /// Whether it is to stand still here.
    pub(super) fn is_to_pause(&self) -> bool {
        self.is_between_sweeps() && self.shell.page.pause.get() > 0
    }

    /// Stands still between two sweeps as long as it is told to. Then time begins anew: nobody catches up.
    pub(super) fn pause_if_asked<S: Source>(&mut self, source: &mut S) {
        if !self.is_to_pause() || self.shell.leaving() {
            return;
        }
        let page = &self.shell.page;
        page.paused.set(1);
        while self.is_to_pause() && !self.shell.leaving() {
            page.beat(clock::now_ns());
            between_sweeps(self.shell);
            source.discard();
            clock::sleep_ns(PAUSE_LOOK_NS);
        }
        source.discard();
        self.pacer.start_anew();
        if self.has_sweep() {
            // Made before, and not sent.
            let now_ns = clock::now_ns();
            let made = self.kept.get(self.ordinal / self.sectors());
            made.start_ns = self.pacer.start_ns(made.whole.header.sensor_time_ns, now_ns);
            made.began_ns = now_ns;
        }
        page.paused.set(0);
    }

    /// Waits at the end of the data, until it is told to leave or to send something again.
    pub(super) fn wait_at_the_end(&self) {
        let page = &self.shell.page;
        page.set_state(State::Ended);
        wait_while(self.shell, LOOK_NS, || {
            between_sweeps(self.shell);
            page.paused.set(page.pause.get());
            !self.is_asked_back()
        });
        if !self.shell.leaving() {
            page.set_state(State::Running);
        }
    }
}
