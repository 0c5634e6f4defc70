//! The support vectors of a machine laid out for evaluation, and the sums over their kernels.

use std::ops::Range;

use messages::Bin;
use pulp::{Arch, Simd, WithSimd};

use crate::BINS;
use crate::exponential::exp_of_negative;
use crate::svm::MAX_CLASSES;
use crate::svm_file::SvmFile;

/// Support vectors that are worked on at a time: their products fit into registers. Features are kept tile after tile, so
/// that one tile's stay in the cache while several descriptors pass by.
const TILE: usize = 64;

/// Vector registers that hold products, twice.
const ABREAST: usize = 4;

/// Numbers that are added side by side.
const LANES: usize = 8;

/// A bin that fewer support vectors have than one in this many is kept as a list of those that have it.
const RARE: usize = 32;

/// Where a bin's values stand.
#[derive(Clone, Copy, Debug)]
enum Row {
    /// No support vector has it.
    Unused,
    /// Of these rows of each tile, which have a value for each support vector.
    Dense(u32),
    /// Of these lists of each tile.
    Sparse(u32),
}

/// Kernels exp(−γ‖x − s‖²) of a descriptor with all support vectors, summed by class and coefficient.
///
/// ‖x − s‖² = ‖x‖² + ‖s‖² − 2 x·s. x is sparse: of bins that many support vectors have, each adds one row times its
/// weight; of the others, a few products. Kernel values are `f32`, their sums `f64`.
#[derive(Clone, Debug)]
pub(crate) struct Kernels {
    arch: Arch,
    gamma: f32,
    row_of_bin: Vec<Row>,
    /// Each holds support vectors of one class only.
    tiles: Vec<Tile>,
    dense_rows: usize,
    /// Tile after tile, and in each a row for each dense bin.
    dense: Vec<[f32; TILE]>,
    sparse_rows: usize,
    /// Tile after tile, and in each for each sparse bin, where its list begins in `sparse`; at last its end.
    lists: Vec<u32>,
    /// Places in the tile, and values.
    sparse: Vec<(u32, f32)>,
}

/// Up to `TILE` support vectors of one class; the rest is zero, with coefficient 0.
#[derive(Clone, Debug)]
struct Tile {
    class: usize,
    norm2: [f32; TILE],
    /// Against each other class: libsvm's `sv_coef`.
    coefficients: [[f64; TILE]; MAX_CLASSES - 1],
}

/// Sums of a descriptor's kernels over each class's support vectors, weighted against each other class.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums(pub(crate) [[f64; MAX_CLASSES - 1]; MAX_CLASSES]);

/// A descriptor, its bins found among the rows.
#[derive(Clone, Debug)]
pub(crate) struct Query {
    norm2: f32,
    /// Dense rows and weights from the front, sparse ones from the back.
    rows: [(u32, f32); BINS],
    dense: usize,
    sparse: usize,
    pub(crate) sums: Sums,
}

impl Query {
    pub(crate) const fn new() -> Self {
        let sums = Sums([[0.0; MAX_CLASSES - 1]; MAX_CLASSES]);
        Self { norm2: 0.0, rows: [(0, 0.0); BINS], dense: 0, sparse: BINS, sums }
    }

    /// Takes a descriptor: bins in order of index, each index under 1728 and given once.
    pub(crate) fn set(&mut self, kernels: &Kernels, bins: &[Bin]) {
        (self.dense, self.sparse, self.sums) = (0, BINS, Sums::default());
        for bin in bins {
            match kernels.row_of_bin[bin.index as usize] {
                Row::Unused => {}
                Row::Dense(row) => {
                    self.rows[self.dense] = (row, bin.weight);
                    self.dense += 1;
                }
                Row::Sparse(row) => {
                    self.sparse -= 1;
                    self.rows[self.sparse] = (row, bin.weight);
                }
            }
        }
        self.norm2 = squared_norm(bins);
    }
}

impl Kernels {
    pub(crate) fn new(file: &SvmFile) -> Self {
        let mut uses = vec![0; BINS];
        for bin in file.vectors.iter().flatten() {
            uses[bin.index as usize] += 1;
        }
        let (mut dense_rows, mut sparse_rows) = (0, 0);
        let next = |rows: &mut u32| {
            *rows += 1;
            *rows - 1
        };
        let row = |&uses: &usize| match uses {
            0 => Row::Unused,
            rare if rare * RARE < file.vectors.len() => Row::Sparse(next(&mut sparse_rows)),
            _ => Row::Dense(next(&mut dense_rows)),
        };
        let mut kernels = Self {
            arch: Arch::new(),
            gamma: file.gamma as f32,
            row_of_bin: uses.iter().map(row).collect(),
            tiles: Vec::new(),
            dense_rows: dense_rows as usize,
            dense: Vec::new(),
            sparse_rows: sparse_rows as usize,
            lists: vec![0],
            sparse: Vec::new(),
        };
        let mut first = 0;
        for (class, &count) in file.vectors_of_class.iter().enumerate() {
            for from in (first..first + count).step_by(TILE) {
                kernels.add_tile(file, class, from..(from + TILE).min(first + count));
            }
            first += count;
        }
        kernels
    }

    fn add_tile(&mut self, file: &SvmFile, class: usize, places: Range<usize>) {
        let start = self.dense.len();
        self.dense.resize(start + self.dense_rows, [0.0; TILE]);
        let mut lists = vec![Vec::new(); self.sparse_rows];
        let mut tile = Tile { class, norm2: [0.0; TILE], coefficients: [[0.0; TILE]; MAX_CLASSES - 1] };
        let vectors = file.vectors[places.clone()].iter().zip(&file.coefficients[places]);
        for (place, (vector, coefficients)) in vectors.enumerate() {
            for bin in vector {
                match self.row_of_bin[bin.index as usize] {
                    Row::Unused => {}
                    Row::Dense(row) => self.dense[start + row as usize][place] = bin.weight,
                    Row::Sparse(row) => lists[row as usize].push((place as u32, bin.weight)),
                }
            }
            tile.norm2[place] = squared_norm(vector);
            for (of_other, &coefficient) in tile.coefficients.iter_mut().zip(coefficients) {
                of_other[place] = coefficient;
            }
        }
        self.tiles.push(tile);
        for list in lists {
            self.sparse.extend(list);
            self.lists.push(self.sparse.len() as u32);
        }
    }

    /// Makes the sums of each query, tile by tile. They are the same however many there are.
    pub(crate) fn sum(&self, queries: &mut [Query]) {
        self.arch.dispatch(Sum { kernels: self, queries });
    }
}

struct Sum<'a> {
    kernels: &'a Kernels,
    queries: &'a mut [Query],
}

impl WithSimd for Sum<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { kernels, queries } = self;
        for (place, tile) in kernels.tiles.iter().enumerate() {
            let dense = &kernels.dense[place * kernels.dense_rows..(place + 1) * kernels.dense_rows];
            let lists = &kernels.lists[place * kernels.sparse_rows..][..=kernels.sparse_rows];
            for query in &mut *queries {
                let mut kernel = products(simd, dense, &query.rows[..query.dense]);
                for &(row, weight) in &query.rows[query.sparse..] {
                    let list = lists[row as usize] as usize..lists[row as usize + 1] as usize;
                    for &(place, value) in &kernels.sparse[list] {
                        kernel[place as usize % TILE] += weight * value;
                    }
                }
                for (product, of_vector) in kernel.iter_mut().zip(&tile.norm2) {
                    let distance2 = query.norm2 + of_vector - 2.0 * *product;
                    *product = exp_of_negative(-kernels.gamma * if distance2 > 0.0 { distance2 } else { 0.0 });
                }
                let sums = &mut query.sums.0[tile.class];
                for (sum, part) in sums.iter_mut().zip(weighted(&kernel, &tile.coefficients)) {
                    *sum += part;
                }
            }
        }
    }
}

/// x·s for each support vector of a tile, without sparse bins.
#[inline(always)]
fn products<S: Simd>(simd: S, dense: &[[f32; TILE]], rows: &[(u32, f32)]) -> [f32; TILE] {
    let mut result = [0.0; TILE];
    let (vectors, _) = S::as_mut_simd_f32s(&mut result);
    for from in (0..vectors.len()).step_by(ABREAST) {
        // Even and odd rows apart, so that additions need not wait for each other.
        let mut sums = [[simd.splat_f32s(0.0); ABREAST]; 2];
        let (pairs, last) = rows.as_chunks::<2>();
        for pair in pairs {
            for (sums, &(row, weight)) in sums.iter_mut().zip(pair) {
                add_row(simd, sums, &dense[row as usize], from, weight);
            }
        }
        for &(row, weight) in last {
            add_row(simd, &mut sums[0], &dense[row as usize], from, weight);
        }
        for place in 0..ABREAST {
            vectors[from + place] = simd.add_f32s(sums[0][place], sums[1][place]);
        }
    }
    result
}

#[inline(always)]
fn add_row<S: Simd>(simd: S, sums: &mut [S::f32s; ABREAST], row: &[f32; TILE], from: usize, weight: f32) {
    let (values, _) = S::as_simd_f32s(row);
    let weight = simd.splat_f32s(weight);
    for (sum, &value) in sums.iter_mut().zip(&values[from..from + ABREAST]) {
        *sum = simd.add_f32s(*sum, simd.mul_f32s(weight, value));
    }
}

/// Sums of kernel values times each row of coefficients.
#[inline(always)]
fn weighted(
    kernel: &[f32; TILE],
    coefficients: &[[f64; TILE]; MAX_CLASSES - 1],
) -> [f64; MAX_CLASSES - 1] {
    let mut lanes = [[0.0_f64; LANES]; MAX_CLASSES - 1];
    for from in (0..TILE).step_by(LANES) {
        for (lanes, coefficients) in lanes.iter_mut().zip(coefficients) {
            for lane in 0..LANES {
                lanes[lane] += f64::from(kernel[from + lane]) * coefficients[from + lane];
            }
        }
    }
    lanes.map(|lanes| lanes.iter().sum())
}

fn squared_norm(bins: &[Bin]) -> f32 {
    bins.iter().map(|bin| f64::from(bin.weight) * f64::from(bin.weight)).sum::<f64>() as f32
}
