use std::time::Duration;

use monitor::MonitorError;
use monitor::top::Settings;
use supervisor::Running;

use crate::cli::TopArgs;
use crate::{Failure, instances};

/// Between two looks, at least: nearer ones tell nothing more.
const NEAREST: Duration = Duration::from_millis(50);

/// Shows a running chain in the terminal.
pub(crate) fn top(args: &TopArgs) -> Result<(), Failure> {
    let (instance, _) = instances::find(args.instance.as_deref())?;
    let interval_ns = args.interval.max(NEAREST).as_nanos().min(u128::from(u32::MAX)) as u64;
    let settings = Settings { interval_ns, once: args.once, json: args.json };
    monitor::top::top(&instance, settings, || Running::of(&instance).is_some()).map_err(failure)
}

/// What a viewer cannot attach to it cannot start on.
pub(crate) fn failure(error: MonitorError) -> Failure {
    match error {
        MonitorError::Terminal(_) | MonitorError::Output(_) => Failure::run(error),
        error => Failure::start(error),
    }
}
