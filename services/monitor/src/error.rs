/// Why a viewer could not start or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MonitorError {
    /// A file of the instance is not there or not what it should be, or signals cannot be had.
    #[error(transparent)]
    Shell(#[from] runtime::ShellError),
    /// Shared memory failed, or all places for viewers are taken.
    #[error(transparent)]
    Transport(#[from] transport::TransportError),
    /// The address cannot be listened on.
    #[error("{address}: {cause}; choose another with --port or --bind")]
    Listen {
        /// Address and port as asked for.
        address: String,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The same for Prometheus.
    #[error("{address}: {cause}; choose another with --listen")]
    Metrics {
        /// Address and port as asked for.
        address: String,
        /// What the system said.
        cause: std::io::Error,
    },
    /// There is no memory to join sweeps in.
    #[error("no memory for a sweep; free some")]
    Memory,
    /// The terminal failed.
    #[error("terminal: {0}")]
    Terminal(std::io::Error),
    /// Standard output failed.
    #[error("standard output: {0}")]
    Output(std::io::Error),
}
