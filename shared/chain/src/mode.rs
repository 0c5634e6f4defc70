use serde::{Deserialize, Serialize};

/// What the chain as a whole is doing.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
#[repr(u64)]
pub enum Mode {
    /// All of its work.
    #[default]
    Nominal = 0,
    /// Something is left out: under overload, or because it was told to.
    Degraded = 1,
    /// The least that is useful: obstacles are located, not classified.
    Safe = 2,
    /// Nothing is sent; all processes wait.
    Paused = 3,
}

impl Mode {
    /// All modes, by their number.
    pub const ALL: [Self; 4] = [Self::Nominal, Self::Degraded, Self::Safe, Self::Paused];

    /// The mode of a number; nominal for numbers beyond.
    pub fn from_number(number: u64) -> Self {
        Self::ALL.get(number as usize).copied().unwrap_or_default()
    }

    /// The mode's word in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nominal => "nominal",
            Self::Degraded => "degraded",
            Self::Safe => "safe",
            Self::Paused => "paused",
        }
    }
}
