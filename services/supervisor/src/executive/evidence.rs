use std::fmt::{Display, Formatter, Result};

/// What a stage's condition was found by, with the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Evidence {
    /// Its process has ended: which one, counted from 1.
    Ended { process: u64 },
    /// Not connected for this long after it was started [ns].
    NotUp { for_ns: u64 },
    /// No progress for this long, and stopped by a signal [ns].
    Stopped { age_ns: u64 },
    /// No progress for this long, and no computing [ns].
    Still { age_ns: u64 },
    /// No progress for this long, and so much computed [ns].
    Computes { age_ns: u64, cpu_ns: u64 },
    /// Sweeps over the budget, of the last ten.
    Overruns { of_ten: u32 },
    /// Parts that wait, and how long none was taken [ns].
    NotTaken { parts: u64, for_ns: u64 },
    /// Nothing was sent for this long [ns].
    NotSent { for_ns: u64 },
    /// Sweeps sent beyond what the sensor turns.
    TooManySweeps { sweeps: u64 },
    /// Events said beyond what is allowed.
    TooManyEvents { events: u64 },
}

impl Display for Evidence {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let ms = |ns: &u64| ns / 1_000_000;
        match self {
            Self::Ended { process } => write!(f, "process {process} of it has ended"),
            Self::NotUp { for_ns } => write!(f, "not connected {} ms after it was started", ms(for_ns)),
            Self::Stopped { age_ns } => write!(f, "no progress for {} ms: stopped by a signal", ms(age_ns)),
            Self::Still { age_ns } => write!(f, "no progress for {} ms, and it computes nothing", ms(age_ns)),
            Self::Computes { age_ns, cpu_ns } => {
                write!(f, "no progress for {} ms, though it computed {} ms since", ms(age_ns), ms(cpu_ns))
            }
            Self::Overruns { of_ten } => write!(f, "over its budget in {of_ten} of the last 10 sweeps"),
            Self::NotTaken { parts, for_ns } => write!(f, "{parts} parts wait, none taken for {} ms", ms(for_ns)),
            Self::NotSent { for_ns } => write!(f, "nothing sent for {} ms", ms(for_ns)),
            Self::TooManySweeps { sweeps } => write!(f, "{sweeps} sweeps more than its sensor turns"),
            Self::TooManyEvents { events } => write!(f, "{events} events more than it may say"),
        }
    }
}
