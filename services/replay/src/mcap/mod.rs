//! MCAP files: sweeps of Encke, and clouds of others.

/// Whether a file begins as an MCAP file does.
pub(crate) fn is_mcap(head: &[u8]) -> bool {
    head.starts_with(b"\x89MCAP")
}
