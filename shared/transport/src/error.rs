/// Shared memory or its bookkeeping failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("shared memory: could not {action} {what}: {cause}")]
pub struct TransportError {
    /// What was attempted, as a verb.
    pub action: &'static str,
    /// On what: a message type, an instance.
    pub what: String,
    /// iceoryx2's own word for the cause.
    pub cause: String,
}

impl TransportError {
    pub(crate) fn new(action: &'static str, what: impl ToString, cause: impl std::fmt::Debug) -> Self {
        Self { action, what: what.to_string(), cause: format!("{cause:?}") }
    }
}
