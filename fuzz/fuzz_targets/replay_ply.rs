//! Replays PLY files, all encodings.

#![no_main]

use replay::Format;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::replayed(bytes, Some(Format::Ply)));
