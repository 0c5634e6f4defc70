use std::collections::VecDeque;
use std::io::Read;
use std::process::{Child, Stdio};

use crate::Injection;
use crate::look::{Looked, Observer};
use crate::matrix::{Baseline, Open, Row};
use crate::run::encke;

/// How long a second injection is tried, while its target has no process [ns].
const AGAIN_PATIENCE_NS: u64 = 3_000_000_000;
/// Most that a command may say and still be read [bytes].
const MOST_SAID: u64 = 4096;

/// Injects faults at their times and watches what becomes of each.
pub(crate) struct Conductor {
    instance: String,
    settle_ns: u64,
    coming: VecDeque<Injection>,
    open: Option<Open>,
    first: Option<Baseline>,
    again: Option<Again>,
    /// Of faults that are over.
    pub(crate) rows: Vec<Row>,
    last_whole_ns: Option<u64>,
    /// The last fault ended the supervisor, or may have.
    pub(crate) supervisor_may_be_dead: bool,
}

/// A second injection.
struct Again {
    from_ns: u64,
    child: Option<Child>,
}

impl Conductor {
    /// Of these faults, by time; after each so long does not count.
    pub(crate) fn new(instance: &str, list: Vec<Injection>, settle_s: f64) -> Self {
        Self {
            instance: instance.to_owned(),
            settle_ns: (settle_s * 1e9) as u64,
            coming: list.into(),
            open: None,
            first: None,
            again: None,
            rows: Vec::new(),
            last_whole_ns: None,
            supervisor_may_be_dead: false,
        }
    }

    /// Looks after what is under way, and injects what is due.
    pub(crate) fn turn(&mut self, looked: &Looked, observer: &mut Observer<'_>, now_ns: u64) {
        if let Some(open) = &mut self.open {
            open.note(&looked.answers, &looked.events, observer, now_ns);
        }
        let whole = looked.answers.iter().rev().find(|answer| answer.whole);
        self.last_whole_ns = whole.map(|answer| answer.answered_ns).or(self.last_whole_ns);
        self.reap();
        self.inject_again(observer, now_ns);
        let t_s = observer.t_s(now_ns);
        if self.coming.front().is_some_and(|next| next.at_s <= t_s) {
            self.close(observer, now_ns);
            if let Some(next) = self.coming.pop_front() {
                self.inject(next, observer, now_ns);
            }
        }
    }

    /// The last fault's time is over.
    pub(crate) fn close(&mut self, observer: &Observer<'_>, now_ns: u64) {
        self.again = None;
        if let Some(mut open) = self.open.take() {
            if let Some(mut child) = open.child.take() {
                // Whatever still goes on is of no use any more.
                let _ = child.kill();
                let _ = child.wait();
            }
            self.rows.push(open.close(observer, now_ns));
        }
    }

    fn inject(&mut self, injection: Injection, observer: &mut Observer<'_>, now_ns: u64) {
        let lasts_ns = (injection.lasts_s * 1e9) as u64;
        observer.marks.after_injections.add(now_ns, now_ns + self.settle_ns);
        observer.marks.faults.add(now_ns, now_ns + lasts_ns + self.settle_ns);
        self.supervisor_may_be_dead = injection.ends_supervisor() || injection.fault == "shared-memory-gone";
        self.again = injection.again_ms.map(|ms| Again { from_ns: now_ns + (ms * 1e6) as u64, child: None });
        let first = self.first.get_or_insert_with(|| Baseline::of(observer));
        let mut open = Open::new(injection, None, now_ns, self.last_whole_ns, first, observer);
        match command(&open.injection, &self.instance) {
            Ok(child) => open.child = Some(child),
            Err(cause) => open.refused = Some(cause),
        }
        self.open = Some(open);
    }

    /// Hears whether the command did what it should.
    fn reap(&mut self) {
        let Some(open) = &mut self.open else { return };
        let Some(child) = &mut open.child else { return };
        let Ok(Some(status)) = child.try_wait() else { return };
        if !status.success() {
            open.refused = Some(said(child));
        }
        open.child = None;
    }

    /// The same fault once more, as soon as its target can have it.
    fn inject_again(&mut self, observer: &mut Observer<'_>, now_ns: u64) {
        let (Some(open), Some(again)) = (&mut self.open, &mut self.again) else { return };
        if now_ns < again.from_ns || open.child.is_some() {
            return;
        }
        let done = match again.child.as_mut().map(Child::try_wait) {
            Some(Ok(Some(status))) if status.success() => true,
            // Not yet.
            Some(Ok(None)) => return,
            // Its target has no process at this moment, or could not be asked: once more.
            _ => now_ns > again.from_ns + AGAIN_PATIENCE_NS,
        };
        if done {
            open.again(now_ns);
            observer.marks.after_injections.add(now_ns, now_ns + self.settle_ns);
            observer.marks.faults.add(now_ns, now_ns + self.settle_ns);
            self.again = None;
        } else {
            again.child = command(&open.injection, &self.instance).ok();
        }
    }
}

/// Starts `encke inject …`.
fn command(injection: &Injection, instance: &str) -> Result<Child, String> {
    let words = ["inject"].into_iter().chain(injection.words.iter().map(String::as_str));
    let mut command = encke(words.chain(["--instance", instance]));
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().map_err(|cause| cause.to_string())
}

/// What a command that has ended said on stderr.
pub(super) fn said(child: &mut Child) -> String {
    first_line(child.stderr.take(), "it said nothing")
}

/// What a command that has ended said on stdout.
pub(super) fn answer(child: &mut Child) -> String {
    first_line(child.stdout.take(), "")
}

fn first_line(pipe: Option<impl Read>, else_say: &str) -> String {
    let mut text = Vec::new();
    if let Some(pipe) = pipe {
        let _ = pipe.take(MOST_SAID).read_to_end(&mut text);
    }
    String::from_utf8_lossy(&text).lines().next().unwrap_or(else_say).to_owned()
}
