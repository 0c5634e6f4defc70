use chain::executive::Action;

/// What is to be done now.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Order {
    /// What.
    pub(crate) action: Action,
    /// Place of the stage in flow order that it is about; none where it is the chain.
    pub(crate) stage: Option<usize>,
    /// Because of what, in words.
    pub(crate) reason: String,
}
