use monitor::live::{Settings, Supervisor};
use supervisor::Running;
use transport::Instance;

use crate::cli::LiveArgs;
use crate::{Failure, instances, top};

/// Serves a running chain to Foxglove.
pub(crate) fn live(args: &LiveArgs) -> Result<(), Failure> {
    let (instance, _) = instances::find(args.instance.as_deref())?;
    let settings = Settings { bind: args.bind.clone(), port: args.port, wait: args.wait, json: args.json };
    monitor::live::live(&instance, &settings, &Of(&instance)).map_err(top::failure)
}

struct Of<'a>(&'a Instance);

impl Supervisor for Of<'_> {
    fn runs(&self) -> bool {
        Running::of(self.0).is_some()
    }

    fn status(&self) -> Option<Vec<u8>> {
        serde_json::to_vec(&supervisor::status(self.0).ok()?).ok()
    }
}
