use std::marker::PhantomData;

use stage::{InitError, Part, Stage, Verdict};

use crate::{Shell, ShellError, run_stage};

/// The main loop of a stand-in for stage `S`, which could not be kept running: every part passes with what the stage
/// only hands on, rejected as
/// [`Verdict::RejectedDown`], so that each is still answered and accounted for.
pub fn run_stand_in<S: Stage>(shell: &Shell) -> Result<(), ShellError> {
    run_stage(StandIn::<S>(PhantomData), shell, |_| Ok(StandIn(PhantomData)))
}

struct StandIn<S>(PhantomData<S>);

impl<S: Stage> Stage for StandIn<S> {
    const NAME: &'static str = S::NAME;
    type Params = ();
    type Input = S::Input;
    type Output = S::Output;

    fn init((): ()) -> Result<Self, InitError> {
        Ok(Self(PhantomData))
    }

    fn process(&mut self, _part: Part, input: &S::Input, output: &mut S::Output) -> Verdict {
        S::pass_by(input, output);
        Verdict::RejectedDown
    }
}
