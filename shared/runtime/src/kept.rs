use messages::{Message, Sweep, Truth};
use stage::{Next, Source};
use zerocopy::FromZeros;

use crate::ShellError;

/// A sweep as its source made it, kept until nobody can ask for it again.
pub(crate) struct Made {
    pub(crate) whole: Box<Sweep>,
    pub(crate) truth: Box<Truth>,
    /// Host time at which the sweep's first firing is due [ns].
    pub(crate) start_ns: u64,
    /// Host time at which the source began to make it [ns].
    pub(crate) began_ns: u64,
    /// Number of the step of degradation at which it is to be processed.
    pub(crate) step: u32,
}

/// The latest sweeps of a source, in places that are used again in turn.
pub(crate) struct Kept {
    places: Vec<Made>,
    /// The sweeps kept are those from `first` on, below `end`.
    first: u64,
    end: u64,
}

impl Kept {
    /// With room for `sweeps`, at least 1.
    pub(crate) fn new(sweeps: usize) -> Result<Self, ShellError> {
        let made = || -> Option<Made> {
            let (whole, truth) = (Sweep::new_box_zeroed().ok()?, Truth::new_box_zeroed().ok()?);
            Some(Made { whole, truth, start_ns: 0, began_ns: 0, step: 0 })
        };
        let places = (0..sweeps.max(1)).map(|_| made()).collect::<Option<_>>();
        Ok(Self { places: places.ok_or(ShellError::Memory("the latest sweeps"))?, first: 0, end: 0 })
    }

    /// Begins with sweep `number`: what was made before it is left out.
    pub(crate) fn begin<S: Source>(&mut self, number: u64, source: &mut S) -> Result<(), ShellError> {
        (self.first, self.end) = (number, number);
        let place = &mut self.places[0];
        if number > 0 {
            source.skip(number, &mut place.whole, &mut place.truth)?;
        }
        Ok(())
    }

    /// Number of the earliest sweep that can be sent again.
    pub(crate) fn first(&self) -> u64 {
        self.first
    }

    /// Whether sweep `number` has been made already.
    pub(crate) fn has(&self, number: u64) -> bool {
        (self.first..self.end).contains(&number)
    }

    /// Sweep `number`, or another one where that is not kept.
    pub(crate) fn get(&mut self, number: u64) -> &mut Made {
        let place = (number % self.places.len() as u64) as usize;
        &mut self.places[place]
    }

    /// Makes the next sweep in the place of the earliest, `while_nothing` comes as long as that says so. Its number counts
    /// once [`Kept::keep`] says that it is used.
    pub(crate) fn make<S: Source>(
        &mut self,
        source: &mut S,
        while_nothing: impl Fn() -> bool,
    ) -> Result<(&mut Made, Next), ShellError> {
        if self.end - self.first >= self.places.len() as u64 {
            self.first += 1;
        }
        let made = self.get(self.end);
        made.whole.clear();
        made.truth.clear();
        let mut next = source.next(&mut made.whole, &mut made.truth)?;
        while next == Next::Nothing && while_nothing() {
            next = source.next(&mut made.whole, &mut made.truth)?;
        }
        Ok((made, next))
    }

    /// The sweep made last is used.
    pub(crate) fn keep(&mut self) {
        self.end += 1;
    }
}
