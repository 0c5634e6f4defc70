//! The processes of a chain: started, looked at, ended; what each uses, and the machine under them.

pub(crate) mod beside;
pub(crate) mod child;
pub(crate) mod machine;
pub(crate) mod noise;
pub(crate) mod scheduling;
pub(crate) mod usage;
