use messages::Bin;

use crate::{Darboux, LEVELS, Neighbours};

/// Joint bins of the three angles: N = 12³ of Sec. III-B.3.
pub const BINS: usize = LEVELS * LEVELS * LEVELS;

/// Neighbours nearer than this count as this far: half the step in which the sensor gives ranges. Else one pair of
/// returns that quantisation has moved together would outweigh the rest of the cluster in Eq. 3.
const MIN_DISTANCE_M: f32 = 1e-3;

/// The joint histogram of one cluster: the sum of its points' FPFH (Eq. 3), scaled to sum 1.
///
/// With n_i the SPFH of point i (one count for each of its pairs), the sum over the cluster is
/// Σᵢ n_i + (1/k) Σᵢ Σⱼ n_j / w_ij = Σᵢ n_i (1 + (1/k) Σ_{l: i neighbour of l} 1 / w_li): every SPFH is entered once, with
/// a weight gathered before. k is the number of neighbours that a point has, w_ij their distance [m].
#[derive(Debug)]
pub struct Histogram {
    weight: Vec<f64>,
    /// Bit of each bin that holds something, so that empty ones are neither read nor cleared.
    held: [u64; BINS.div_ceil(64)],
    total: f64,
    share: Vec<f32>,
}

impl Histogram {
    /// An empty histogram for clusters of up to `capacity` points.
    pub fn new(capacity: usize) -> Self {
        Self { weight: vec![0.0; BINS], held: [0; BINS.div_ceil(64)], total: 0.0, share: vec![0.0; capacity] }
    }

    /// Empties it.
    pub fn clear(&mut self) {
        for (word, bits) in self.held.iter_mut().enumerate() {
            for bin in set_bits(word, *bits) {
                self.weight[bin] = 0.0;
            }
            *bits = 0;
        }
        self.total = 0.0;
    }

    /// Adds the FPFH of all points [m] with their unit normals and the neighbours found for them.
    /// Pairs that have no angles (see [`Darboux::between`]) are left out; no more points than the capacity.
    pub fn add(&mut self, points: &[[f32; 3]], normals: &[[f32; 3]], neighbours: &Neighbours) {
        let share = &mut self.share[..points.len()];
        share.fill(1.0);
        for index in 0..points.len() {
            let others = neighbours.of(index);
            for (&other, &distance_m) in others.iter().zip(neighbours.distances_m(index)) {
                share[other as usize] += 1.0 / (distance_m.max(MIN_DISTANCE_M) * others.len() as f32); // Eq. (3)
            }
        }
        for index in 0..points.len() {
            let point = points[index];
            let weight = f64::from(self.share[index]);
            for (&other, &distance_m) in neighbours.of(index).iter().zip(neighbours.distances_m(index)) {
                let other = other as usize;
                let offset = std::array::from_fn(|axis| points[other][axis] - point[axis]);
                if let Some(pair) = Darboux::between(normals[index], normals[other], offset, distance_m) {
                    let bin = pair.bin();
                    self.weight[bin] += weight;
                    self.held[bin / 64] |= 1 << (bin % 64);
                    self.total += weight;
                }
            }
        }
    }

    /// The bins that hold something, in order of index; their weights sum to 1. None when no pair had angles.
    pub fn bins(&self) -> impl Iterator<Item = Bin> + '_ {
        let scale = 1.0 / self.total; // not used when no bin is held
        self.held.iter().enumerate().flat_map(move |(word, &bits)| {
            set_bits(word, bits).map(move |bin| Bin { index: bin as u32, weight: (self.weight[bin] * scale) as f32 })
        })
    }
}

/// Bins of a word's set bits, lowest first.
fn set_bits(word: usize, mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (bit < 64).then_some(word * 64 + bit)
    })
}
