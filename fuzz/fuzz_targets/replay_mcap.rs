//! Replays MCAP files, of Encke and of others.

#![no_main]

use replay::Format;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::replayed(bytes, Some(Format::Mcap)));
