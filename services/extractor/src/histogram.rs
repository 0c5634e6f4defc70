use messages::Bin;
use pulp::{Simd, WithSimd};

use crate::neighbours::MAX_OTHERS;
use crate::{Darboux, LEVELS, Neighbours};

/// Joint bins of the three angles: N = 12³ of Sec. III-B.3.
pub const BINS: usize = LEVELS * LEVELS * LEVELS;

/// Neighbours nearer than this count as this far: half the step in which the sensor gives ranges. Else one pair of
/// returns that quantisation has moved together would outweigh the rest of the cluster in Eq. 3.
const MIN_DISTANCE_M: f32 = 1e-3;

/// Points that are worked on side by side.
const LANES: usize = 16;

/// Bin of a pair that has no angles.
const UNDEFINED: u32 = u32::MAX;

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
        neighbours.arch().dispatch(Add { histogram: self, points, normals, neighbours });
    }

    /// The bins that hold something, in order of index; their weights sum to 1. None when no pair had angles.
    pub fn bins(&self) -> impl Iterator<Item = Bin> + '_ {
        let scale = 1.0 / self.total; // not used when no bin is held
        self.held.iter().enumerate().flat_map(move |(word, &bits)| {
            set_bits(word, bits).map(move |bin| Bin { index: bin as u32, weight: (self.weight[bin] * scale) as f32 })
        })
    }
}

struct Add<'a> {
    histogram: &'a mut Histogram,
    points: &'a [[f32; 3]],
    normals: &'a [[f32; 3]],
    neighbours: &'a Neighbours,
}

impl WithSimd for Add<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { histogram, points, normals, neighbours } = self;
        let each = neighbours.each();
        let count = points.len();
        if each == 0 {
            return;
        }
        let share = &mut histogram.share[..count];
        share.fill(1.0);
        for first in (0..count).step_by(LANES) {
            let held = LANES.min(count - first);
            let near = neighbours.of_range(first..first + held);
            let mut part = [0.0; LANES * MAX_OTHERS];
            for (part, &distance_m) in part.iter_mut().zip(near.1) {
                *part = 1.0 / (distance_m.max(MIN_DISTANCE_M) * each as f32); // Eq. (3)
            }
            for (&other, part) in near.0.iter().zip(part) {
                share[other as usize] += part;
            }
        }
        let mut total = histogram.total;
        for first in (0..count).step_by(LANES) {
            let held = LANES.min(count - first);
            let (near, distance_m) = neighbours.of_range(first..first + held);
            let here = Group::of(points, first..first + held);
            let normal_i = Group::of(normals, first..first + held);
            let mut bins = [[UNDEFINED; LANES]; MAX_OTHERS];
            for (rank, bins) in bins.iter_mut().enumerate().take(each) {
                let (mut there, mut normal_j, mut distance) = (Group::default(), Group::default(), [0.0; LANES]);
                for lane in 0..held {
                    let other = near[lane * each + rank] as usize;
                    there.put(lane, points[other]);
                    normal_j.put(lane, normals[other]);
                    distance[lane] = distance_m[lane * each + rank];
                }
                for lane in 0..LANES {
                    let (there, here) = (there.get(lane), here.get(lane));
                    let offset = std::array::from_fn(|axis| there[axis] - here[axis]);
                    let (pair, defined) =
                        Darboux::or_undefined(normal_i.get(lane), normal_j.get(lane), offset, distance[lane]);
                    let place = pair.place();
                    bins[lane] = if defined { place } else { UNDEFINED };
                }
            }
            for lane in 0..held {
                let weight = f64::from(histogram.share[first + lane]);
                for bins in &bins[..each] {
                    let bin = bins[lane] as usize;
                    if bin < BINS {
                        histogram.weight[bin] += weight;
                        histogram.held[bin / 64] |= 1 << (bin % 64);
                        total += weight;
                    }
                }
            }
        }
        histogram.total = total;
    }
}

/// Vectors side by side.
#[derive(Default)]
#[repr(align(64))]
struct Group([[f32; LANES]; 3]);

impl Group {
    #[inline(always)]
    fn of(vectors: &[[f32; 3]], places: std::ops::Range<usize>) -> Self {
        let mut group = Self::default();
        for (lane, &vector) in vectors[places].iter().enumerate() {
            group.put(lane, vector);
        }
        group
    }

    #[inline(always)]
    fn put(&mut self, lane: usize, vector: [f32; 3]) {
        for (values, value) in self.0.iter_mut().zip(vector) {
            values[lane] = value;
        }
    }

    #[inline(always)]
    fn get(&self, lane: usize) -> [f32; 3] {
        [self.0[0][lane], self.0[1][lane], self.0[2][lane]]
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
