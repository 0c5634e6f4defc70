//! What a sweep costs.

fn main() {}
