/// Why a run could not start, or could not go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SupervisorError {
    /// Somebody supervises the instance already.
    #[error("instance {name:?} is running (supervisor {pid}): choose another --instance, or stop it")]
    Running {
        /// The instance.
        name: String,
        /// Its supervisor.
        pid: u32,
    },
    /// A message that no service is known for.
    #[error("chain.toml: stage {stage:?} writes {message:?}, which is no message of this version")]
    Message {
        /// The stage.
        stage: String,
        /// The message.
        message: String,
    },
    /// A process could not be started.
    #[error("stage {stage:?} cannot be started: {cause}")]
    Spawn {
        /// The stage.
        stage: String,
        /// What the system said.
        cause: std::io::Error,
    },
    /// A stage said that it cannot start; its own line on stderr says why.
    #[error("stage {0:?} refused to start")]
    Refused(String),
    /// The stages did not come up.
    #[error("stages {0:?} did not start within 10 s")]
    NotUp(Vec<String>),
    /// Signals or files of the system failed.
    #[error("{what}: {cause}")]
    System {
        /// What was attempted.
        what: String,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The runtime failed.
    #[error(transparent)]
    Shell(#[from] runtime::ShellError),
    /// The log of the run cannot be written.
    #[error(transparent)]
    Log(#[from] events::LogError),
    /// Shared memory failed.
    #[error(transparent)]
    Transport(#[from] transport::TransportError),
    /// The instance cannot be had.
    #[error(transparent)]
    Instance(#[from] transport::InstanceError),
}
