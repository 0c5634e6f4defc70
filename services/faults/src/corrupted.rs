use messages::{Message, Sweep, Truth};
use stage::{Next, Source, SourceError};
use zerocopy::FromZeros;

use crate::Fault;
use crate::corrupt::Corruptor;

const NS_PER_MS: i64 = 1_000_000;

/// A fault that holds for one sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Held {
    /// What.
    pub fault: Fault,
    /// How strong: a level of 1 to 3, or a step of the clock [ms].
    pub by: i64,
    /// Of what is random in it.
    pub seed: u64,
}

/// A source whose sweeps are spoiled where somebody asks for it.
///
/// `held` is asked once for each sweep that the source makes, and never while it is skipped forth. Without a fault a sweep
/// passes as it is, and nothing is allocated. Sweeps are numbered by whoever sends them, in 64 bits: no number wraps.
pub struct Corrupted<S, F> {
    source: S,
    held: F,
    corruptor: Corruptor,
    /// Sweeps that were spoiled so far.
    spoiled: u64,
    /// What the sensor's clock is off by since it was stepped [ns].
    off_ns: i64,
    turn: Turn,
    /// The sweep that comes later than it should.
    kept: Option<(Box<Sweep>, Box<Truth>)>,
}

/// When the kept sweep's turn is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Turn {
    /// None is kept.
    Never,
    /// It comes next.
    Now,
    /// One other comes before.
    AfterNext,
}

impl<S: Source, F: FnMut() -> Option<Held>> Corrupted<S, F> {
    /// Spoils what `source` gives as `held` says.
    pub fn new(source: S, held: F) -> Self {
        Self { source, held, corruptor: Corruptor::default(), spoiled: 0, off_ns: 0, turn: Turn::Never, kept: None }
    }

    /// The next sweep of the source, by its own clock, changed as somebody asks.
    fn make(&mut self, sweep: &mut Sweep, truth: &mut Truth) -> Result<Next, SourceError> {
        let next = self.source.next(sweep, truth)?;
        if next != Next::Sweep {
            return Ok(next);
        }
        let Some(Held { fault, by, seed }) = (self.held)() else { return Ok(next) };
        self.spoiled += 1;
        match fault {
            Fault::DuplicatedSweep => self.keep(sweep, truth, Turn::Now)?,
            Fault::ReorderedSweeps => {
                self.keep(sweep, truth, Turn::AfterNext)?;
                return self.make_other(sweep, truth);
            }
            Fault::SkippedSweep => {
                sweep.clear();
                truth.clear();
                return Ok(Next::Nothing);
            }
            Fault::ClockStepped => {
                // A clock cannot show a time before its beginning.
                let earliest_ns = -i64::try_from(sweep.header.sensor_time_ns).unwrap_or(i64::MAX);
                self.off_ns = self.off_ns.saturating_add(by.saturating_mul(NS_PER_MS)).max(earliest_ns);
            }
            _ => {
                let level = u32::try_from(by).unwrap_or(1);
                self.corruptor.corrupt(fault, level, (seed, self.spoiled), sweep, truth);
            }
        }
        Ok(next)
    }

    /// The sweep that comes before the one kept, which nobody spoils further.
    fn make_other(&mut self, sweep: &mut Sweep, truth: &mut Truth) -> Result<Next, SourceError> {
        sweep.clear();
        truth.clear();
        let next = self.source.next(sweep, truth)?;
        match next {
            Next::Sweep => self.turn = Turn::Now,
            Next::Nothing => {}
            // It was the last one: there is nothing to change places with.
            Next::End => {
                self.bring(sweep, truth);
                return Ok(Next::Sweep);
            }
        }
        Ok(next)
    }

    fn keep(&mut self, sweep: &Sweep, truth: &Truth, turn: Turn) -> Result<(), SourceError> {
        if self.kept.is_none() {
            let kept = Sweep::new_box_zeroed().ok().zip(Truth::new_box_zeroed().ok());
            self.kept = Some(kept.ok_or_else(|| SourceError("no memory to keep a sweep; free some".to_owned()))?);
        }
        if let Some((kept, known)) = &mut self.kept {
            copy(sweep, kept);
            known.copy_from(truth);
            self.turn = turn;
        }
        Ok(())
    }

    fn bring(&mut self, sweep: &mut Sweep, truth: &mut Truth) {
        self.turn = Turn::Never;
        if let Some((kept, known)) = &self.kept {
            copy(kept, sweep);
            truth.copy_from(known);
        }
    }
}

impl<S: Source, F: FnMut() -> Option<Held>> Source for Corrupted<S, F> {
    fn next(&mut self, sweep: &mut Sweep, truth: &mut Truth) -> Result<Next, SourceError> {
        let next = match self.turn {
            Turn::Never => self.make(sweep, truth)?,
            Turn::AfterNext => self.make_other(sweep, truth)?,
            Turn::Now => {
                self.bring(sweep, truth);
                Next::Sweep
            }
        };
        if next == Next::Sweep && self.off_ns != 0 {
            for time_ns in [&mut sweep.header.sensor_time_ns, &mut truth.sensor_time_ns] {
                *time_ns = time_ns.saturating_add_signed(self.off_ns);
            }
        }
        Ok(next)
    }

    fn skip(&mut self, sweeps: u64, sweep: &mut Sweep, truth: &mut Truth) -> Result<(), SourceError> {
        self.source.skip(sweeps, sweep, truth)
    }

    fn discard(&mut self) {
        self.source.discard();
    }

    fn is_live(&self) -> bool {
        self.source.is_live()
    }
}

/// Makes a sweep the same as another.
fn copy(from: &Sweep, to: &mut Sweep) {
    to.clear();
    to.header = from.header;
    (to.first_column, to.first_return) = (from.first_column, from.first_return);
    // As large as the other: all fit.
    let _ = to.rings.extend_from_slice(&from.rings);
    let _ = to.columns.extend_from_slice(&from.columns);
    let _ = to.returns.extend_from_slice(&from.returns);
    let _ = to.recorded_index.extend_from_slice(&from.recorded_index);
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 100_000_000;

    /// Sweeps without returns, `sweeps` of them, from the tenth second on.
    struct Empty {
        made: u64,
        sweeps: u64,
    }

    impl Source for Empty {
        fn next(&mut self, sweep: &mut Sweep, truth: &mut Truth) -> Result<Next, SourceError> {
            if self.made == self.sweeps {
                return Ok(Next::End);
            }
            sweep.header.sensor_time_ns = (100 + self.made) * PERIOD_NS;
            truth.sensor_time_ns = sweep.header.sensor_time_ns;
            self.made += 1;
            Ok(Next::Sweep)
        }
    }

    /// The sensor times of what comes, in periods after the first, where `fault` holds for the sweep at `place`.
    fn times(fault: Fault, by: i64, place: usize, sweeps: u64) -> Vec<i64> {
        let mut asked = 0;
        let held = || {
            asked += 1;
            (asked == place + 1).then_some(Held { fault, by, seed: 1 })
        };
        let mut sut = Corrupted::new(Empty { made: 0, sweeps }, held);
        let (mut sweep, mut truth) = (Sweep::new_box_zeroed().unwrap(), Truth::new_box_zeroed().unwrap());
        let mut times = Vec::new();
        loop {
            sweep.clear();
            truth.clear();
            match sut.next(&mut sweep, &mut truth).unwrap() {
                Next::End => return times,
                Next::Nothing => {}
                Next::Sweep => {
                    assert_eq!(truth.sensor_time_ns, sweep.header.sensor_time_ns);
                    times.push((sweep.header.sensor_time_ns / PERIOD_NS) as i64 - 100);
                }
            }
        }
    }

    #[test]
    fn a_sweep_comes_twice_or_not_at_all_or_changes_places() {
        assert_eq!(times(Fault::DuplicatedSweep, 0, 1, 4), [0, 1, 1, 2, 3]);
        assert_eq!(times(Fault::SkippedSweep, 0, 1, 4), [0, 2, 3]);
        assert_eq!(times(Fault::ReorderedSweeps, 0, 1, 4), [0, 2, 1, 3]);
        assert_eq!(times(Fault::ReorderedSweeps, 0, 3, 4), [0, 1, 2, 3], "nothing comes after the last");
    }

    #[test]
    fn a_clock_that_steps_goes_on_from_there_and_never_before_its_beginning() {
        assert_eq!(times(Fault::ClockStepped, 3_600_000, 1, 3), [0, 36_001, 36_002]);
        assert_eq!(times(Fault::ClockStepped, -500, 1, 3), [0, -4, -3]);
        assert_eq!(times(Fault::ClockStepped, -3_600_000, 1, 3), [0, -100, -99]);
    }
}
