//! The contract between a room and the shell that runs it.
//!
//! A stage is a pure function from message to message. The shell (`runtime`) waits, stamps, counts, sends and restarts;
//! a room only computes. Nothing here knows of processes, clocks, files or shared memory.

use std::sync::Arc;

use serde::de::DeserializeOwned;

use messages::{Clusters, Descriptors, Sweep, Trace, Tracks, Truth};
pub use messages::{Message, Part, Verdict};

/// One room of the chain. Touches no clock, file, thread or IPC.
pub trait Stage: Sized {
    /// The stage's name in chain.toml, on the command line and in reports.
    const NAME: &'static str;
    /// Its parameters as written in `config/stages/<name>.toml`.
    type Params: DeserializeOwned;
    /// What it takes.
    type Input: Message;
    /// What it gives.
    type Output: Message;

    /// Checks the parameters and allocates everything that the stage will ever use.
    fn init(params: Self::Params) -> Result<Self, InitError>;

    /// Fills `output`, which arrives empty. Never allocates, panics or fails: a bad part is a [`Verdict`].
    fn process(&mut self, part: Part, input: &Self::Input, output: &mut Self::Output) -> Verdict;

    /// Goes on where `before` stood between two sweeps: it is replaced by this stage, which has other parameters. For
    /// rooms that remember sweeps.
    fn take_over(&mut self, _before: &Self) {}

    /// Fills `output`, which arrives empty, where the room itself cannot be kept running: with what passes it unchanged.
    fn pass_by(_input: &Self::Input, _output: &mut Self::Output) {}
}

/// Where sweeps come from.
pub trait Source {
    /// Fills `sweep` (and `truth`, where there is one) with the next sweep; both arrive empty. Waits no longer than some
    /// 50 ms: where nothing comes, both stay empty.
    fn next(&mut self, sweep: &mut Sweep, truth: &mut Truth) -> Result<Next, SourceError>;

    /// Leaves out the next `sweeps` sweeps, as a restarted source must. `sweep` and `truth` are scratch space.
    fn skip(&mut self, sweeps: u64, sweep: &mut Sweep, truth: &mut Truth) -> Result<(), SourceError> {
        for _ in 0..sweeps {
            sweep.clear();
            truth.clear();
            if self.next(sweep, truth)? == Next::End {
                break;
            }
        }
        Ok(())
    }

    /// Drops what has come in the meantime, and what is gathered of a sweep. Called again and again while the chain is
    /// paused. What is read from a file waits by itself.
    fn discard(&mut self) {}

    /// Whether its sweeps come when they come: each is due at once.
    fn is_live(&self) -> bool {
        false
    }
}

/// What a source gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// A sweep.
    Sweep,
    /// The recording has ended; nothing was filled in.
    End,
    /// Nothing yet: ask again. Only a live source says so.
    Nothing,
}

/// Whom a sink tells of every accepted part that is finished for good (written and flushed): in order, at once, from
/// whatever thread.
pub type Settled = Arc<dyn Fn(Part) + Send + Sync>;

/// Reads along beside the chain and keeps what it needs. No stage waits for it, unless nothing may be lost: then the source
/// runs ahead of [`Tap::done_sweeps`] by no more than its window.
pub trait Tap {
    /// Takes a part from the source. `utc_ns` is the time of day [ns since 1970], here and below.
    fn sweep(&mut self, trace: &Trace, part: &Sweep, utc_ns: u64);

    /// Takes a part from the last stage.
    fn tracks(&mut self, trace: &Trace, part: &Tracks, utc_ns: u64);

    /// Whether parts between the stages are wanted, too: of the clusterer, of the extractor.
    fn wants_between(&self) -> (bool, bool) {
        (false, false)
    }

    /// Takes a part from the clusterer, where wanted.
    fn clusters(&mut self, _trace: &Trace, _part: &Clusters, _utc_ns: u64) {}

    /// Takes a part from the extractor, where wanted.
    fn descriptors(&mut self, _trace: &Trace, _part: &Descriptors, _utc_ns: u64) {}

    /// Takes what is known of a sweep.
    fn truth(&mut self, trace: &Trace, truth: &Truth, utc_ns: u64);

    /// Files begun by now, and how many of them failed.
    fn files(&mut self) -> (u64, u64) {
        (0, 0)
    }

    /// Called about once a second.
    fn tick(&mut self, utc_ns: u64);

    /// What was taken is to survive this process's death. Called about once a second; where nothing may be lost, whenever
    /// a sweep has ended and nothing more waits.
    fn checkpoint(&mut self, utc_ns: u64);

    /// All sweeps below this number are kept, or given up.
    fn done_sweeps(&mut self) -> u64;

    /// Keeps what there still is to keep.
    fn finish(&mut self, utc_ns: u64) -> Result<(), SinkError>;
}

/// Where the chain ends. May own files and a writer thread; never makes the chain wait for them.
pub trait Sink {
    /// What it takes.
    type Input: Message;

    /// Takes over what it needs of a part; the message leaves shared memory when this returns.
    /// Anything but a rejection means that [`Settled`] will be told of the part.
    fn accept(&mut self, trace: &Trace, input: &Self::Input) -> Verdict;

    /// Notes a part that the shell refuses with `verdict`, because nobody may act on it any more: nothing that it says is
    /// used, and its sweep is not whole. Gives the verdict back; [`Settled`] is not told.
    fn refuse(&mut self, trace: &Trace, input: &Self::Input, verdict: Verdict) -> Verdict;

    /// What began to be too near with the part that was accepted last.
    fn alerts(&self) -> &[Alert] {
        &[]
    }

    /// The attempt ([`Part::attempt`]) that is needed because parts are missing, where parts are sent again; else 0.
    fn wanted_attempt(&self) -> u32 {
        0
    }

    /// Files that could not be written and are closed.
    fn failed_files(&self) -> u64 {
        0
    }

    /// Saves what must outlive a sudden death. Called about once a second.
    fn checkpoint(&mut self) -> Result<(), SinkError>;

    /// Finishes every accepted part and closes the files.
    fn finish(&mut self) -> Result<(), SinkError>;
}

/// A track that has become likelier to be met than is allowed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Alert {
    /// Number of the track.
    pub track: u64,
    /// When it comes closest [s].
    pub time_s: f32,
    /// How likely it is met, 0 to 1.
    pub collision_probability: f32,
}

/// What a sink could not finish: one line that names file and remedy.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct SinkError(pub String);

/// A source that cannot go on: one line that names file, place and remedy.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct SourceError(pub String);

/// Why a stage cannot start: one line that names the key, its value and what it must be.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct InitError(Box<dyn std::error::Error + Send + Sync>);

impl InitError {
    /// Wraps a room's own error.
    pub fn new(cause: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self(Box::new(cause))
    }
}
