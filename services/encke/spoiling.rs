//! Every source can be asked to spoil its sweeps.

use faults::{Corrupted, Fault, Held};
use runtime::Shell;
use stage::Source;

/// A source whose sweeps are spoiled while its page asks for it.
pub(crate) fn spoiled<S: Source>(source: S, shell: &Shell) -> impl Source {
    Corrupted::new(source, || {
        let asked = shell.sweep_fault()?;
        let fault = Fault::from_number(asked.number)?;
        Some(Held { fault, by: asked.by.into(), seed: asked.seed.into() })
    })
}
