//! Bytes that are not what they were.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The text of a table in which the highest bit of `bytes` letters is flipped, comments apart: what reads them notices.
/// All are flipped where there are fewer.
pub fn damaged_text(text: &str, bytes: usize, seed: u64) -> String {
    let is_read = |line: &str| !line.trim_start().starts_with('#') && !line.trim().is_empty();
    let mut places = Vec::new();
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        if is_read(line) {
            let code = line.split('#').next().unwrap_or_default().trim_end();
            places.extend((start..start + code.len()).filter(|place| text.as_bytes()[*place].is_ascii_graphic()));
        }
        start += line.len();
    }
    let flipped = some_of(places, bytes, seed);
    let flip = |(place, letter): (usize, char)| match flipped.binary_search(&place) {
        Ok(_) => char::from(letter as u8 | 0x80),
        Err(_) => letter,
    };
    text.char_indices().map(flip).collect()
}

/// Flips the highest bit of `bytes` bytes, or of all where there are fewer.
pub fn damage(data: &mut [u8], bytes: usize, seed: u64) {
    for place in some_of((0..data.len()).collect(), bytes, seed) {
        data[place] ^= 0x80;
    }
}

/// The numbers below `count` in an order that the seed decides.
pub fn shuffled(count: usize, seed: u64) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut order: Vec<usize> = (0..count).collect();
    for place in (1..count).rev() {
        order.swap(place, rng.random_range(0..=place));
    }
    order
}

/// So many of the places, in their order.
fn some_of(places: Vec<usize>, count: usize, seed: u64) -> Vec<usize> {
    let chosen = shuffled(places.len(), seed).into_iter().take(count);
    let mut chosen: Vec<usize> = chosen.map(|place| places[place]).collect();
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damage_is_done_to_what_is_read_and_the_seed_decides_where() {
        let text = "# a comment stays\nrange_d_m = 1.0 # so does this\n";
        for seed in 0..50 {
            let damaged = damaged_text(text, 3, seed);
            assert_eq!(damaged, damaged_text(text, 3, seed));
            let changed = damaged.chars().zip(text.chars()).filter(|(now, then)| now != then).count();
            assert_eq!(changed, 3);
            assert!(damaged.starts_with("# a comment stays\n") && damaged.ends_with("# so does this\n"));
            assert!(toml::from_str::<toml::Table>(&damaged).is_err(), "{damaged}");
        }
        assert_eq!(damaged_text("", 3, 1), "");
        let mut data = [0; 8];
        damage(&mut data, 3, 9);
        assert_eq!(data.iter().filter(|byte| **byte == 0x80).count(), 3);
    }

    #[test]
    fn an_order_has_each_number_once() {
        let mut order = shuffled(7, 3);
        assert_ne!(order, shuffled(7, 4));
        order.sort_unstable();
        assert_eq!(order, [0, 1, 2, 3, 4, 5, 6]);
        assert!(shuffled(0, 1).is_empty());
    }
}
