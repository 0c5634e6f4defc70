//! Replays whatever its bytes are taken for.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::replayed(bytes, None));
