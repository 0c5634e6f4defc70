use std::path::PathBuf;

/// Why a process of the chain could not start or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShellError {
    /// The stage refused its parameters.
    #[error("{stage}: {cause}")]
    Init {
        /// The stage.
        stage: &'static str,
        /// Its own words.
        cause: stage::InitError,
    },
    /// The instance did not come up within the time that a stage waits for it.
    #[error("instance {0:?} has no supervisor: start one with `encke run --instance {0}`")]
    NoInstance(String),
    /// Another process of the same stage lives.
    #[error("{0}: another process of this stage is running; there may be one")]
    Taken(String),
    /// The supervisor has not settled the account of this stage's last life.
    #[error("{0}: its supervisor does not answer for its last life; is it running?")]
    Unsettled(String),
    /// A file of the instance is not what it should be.
    #[error("{path}: {cause}")]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        cause: String,
    },
    /// The system has no memory for what a process needs at its start.
    #[error("no memory for {0}; free some, or run fewer chains")]
    Memory(&'static str),
    /// Shared memory failed.
    #[error(transparent)]
    Transport(#[from] transport::TransportError),
    /// The instance cannot be had.
    #[error(transparent)]
    Instance(#[from] transport::InstanceError),
    /// The source cannot go on.
    #[error(transparent)]
    Source(#[from] stage::SourceError),
    /// The sink could not finish.
    #[error(transparent)]
    Sink(#[from] stage::SinkError),
    /// The system refused to set up signals.
    #[error("signals: {0}")]
    Signals(std::io::Error),
}
