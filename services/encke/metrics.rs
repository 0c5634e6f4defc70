use monitor::metrics::Settings;

use crate::cli::MetricsArgs;
use crate::{Failure, instances, top};

/// Serves a running chain's counters to Prometheus.
pub(crate) fn metrics(args: &MetricsArgs) -> Result<(), Failure> {
    if !args.anywhere && !args.listen.ip().is_loopback() {
        return Err(Failure::start(format!(
            "--listen {}: others than this machine can reach it, must be a loopback address, or come with --anywhere",
            args.listen
        )));
    }
    let (instance, _) = instances::find(args.instance.as_deref())?;
    let runs = || supervisor::Running::of(&instance).is_some();
    monitor::metrics::metrics(&instance, &Settings { listen: args.listen }, runs).map_err(top::failure)
}
