//! The support vectors of a machine laid out for evaluation, and the sums over their kernels.

use std::ops::Range;

use messages::Bin;
use pulp::{Arch, Simd, WithSimd};

use crate::BINS;
use crate::exponential::exp_of_negative;
use crate::svm::MAX_CLASSES;
use crate::svm_file::SvmFile;
use crate::tile::{Aligned, LANES, TILE, add_products, add_weighted};

/// Tiles of a span, for which lists of rare bins are kept: longer ones than of a tile, so that few are empty.
const TILES: usize = 16;

/// A bin that fewer support vectors have than one in this many is kept as a list of those that have it.
const RARE: usize = 16;

/// Where a bin's values stand.
#[derive(Clone, Copy, Debug)]
enum Row {
    /// No support vector has it.
    Unused,
    /// In this row of each tile, which has a value for each support vector.
    Dense(u32),
    /// In this list of each span.
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
    spans: Vec<Span>,
    dense_rows: usize,
    /// Tile after tile, and in each a row for each dense bin.
    dense: Vec<Aligned<[f32; TILE]>>,
    sparse_rows: usize,
    /// Span after span, and in each for each sparse bin, where its list begins in `sparse`; at last its end.
    lists: Vec<u32>,
    /// Places in the span, and values.
    sparse: Vec<(u32, f32)>,
}

/// Up to `TILES` tiles of support vectors of one class.
#[derive(Clone, Debug)]
struct Span {
    class: usize,
    /// Place of the first tile's first row in `dense`.
    first_row: usize,
    tiles: Vec<Tile>,
}

/// What is not in rows; 0 where a class has no more support vectors.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct Tile {
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
    /// x·s for each support vector of a span, of rare bins alone.
    rare: Aligned<[[f32; TILE]; TILES]>,
    /// The sums, in parts that are added side by side.
    lanes: Aligned<[[[f64; LANES]; MAX_CLASSES - 1]; MAX_CLASSES]>,
}

impl Query {
    pub(crate) const fn new() -> Self {
        let lanes = Aligned([[[0.0; LANES]; MAX_CLASSES - 1]; MAX_CLASSES]);
        Self { norm2: 0.0, rows: [(0, 0.0); BINS], dense: 0, sparse: BINS, rare: Aligned([[0.0; TILE]; TILES]), lanes }
    }

    /// Takes a descriptor: bins in order of index, each index under 1728 and given once.
    pub(crate) fn set(&mut self, kernels: &Kernels, bins: &[Bin]) {
        (self.dense, self.sparse) = (0, BINS);
        self.lanes.0 = [[[0.0; LANES]; MAX_CLASSES - 1]; MAX_CLASSES];
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

    /// The sums that [`Kernels::sum`] has made.
    pub(crate) fn sums(&self) -> Sums {
        Sums(self.lanes.0.map(|of_class| of_class.map(|lanes| lanes.iter().sum())))
    }

    /// Makes `rare` for a span, given its lists.
    #[inline(always)]
    fn add_rare(&mut self, lists: &[u32], sparse: &[(u32, f32)]) {
        let rare = self.rare.0.as_flattened_mut();
        rare.fill(0.0);
        for &(row, weight) in &self.rows[self.sparse..] {
            let list = lists[row as usize] as usize..lists[row as usize + 1] as usize;
            for &(place, value) in &sparse[list] {
                rare[place as usize % (TILE * TILES)] += weight * value;
            }
        }
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
            spans: Vec::new(),
            dense_rows: dense_rows as usize,
            dense: Vec::new(),
            sparse_rows: sparse_rows as usize,
            lists: vec![0],
            sparse: Vec::new(),
        };
        let mut first = 0;
        for (class, &count) in file.vectors_of_class.iter().enumerate() {
            for from in (first..first + count).step_by(TILE * TILES) {
                kernels.add_span(file, class, from..(from + TILE * TILES).min(first + count));
            }
            first += count;
        }
        kernels
    }

    fn add_span(&mut self, file: &SvmFile, class: usize, places: Range<usize>) {
        let empty = Tile { norm2: [0.0; TILE], coefficients: [[0.0; TILE]; MAX_CLASSES - 1] };
        let tiles = vec![empty; places.len().div_ceil(TILE)];
        let mut span = Span { class, first_row: self.dense.len(), tiles };
        self.dense.resize(span.first_row + span.tiles.len() * self.dense_rows, Aligned([0.0; TILE]));
        let mut lists = vec![Vec::new(); self.sparse_rows];
        let vectors = file.vectors[places.clone()].iter().zip(&file.coefficients[places]);
        for (place, (vector, coefficients)) in vectors.enumerate() {
            let (tile, lane) = (place / TILE, place % TILE);
            let first_row = span.first_row + tile * self.dense_rows;
            for bin in vector {
                match self.row_of_bin[bin.index as usize] {
                    Row::Unused => {}
                    Row::Dense(row) => self.dense[first_row + row as usize].0[lane] = bin.weight,
                    Row::Sparse(row) => lists[row as usize].push((place as u32, bin.weight)),
                }
            }
            let tile = &mut span.tiles[tile];
            tile.norm2[lane] = squared_norm(vector);
            for (of_other, &coefficient) in tile.coefficients.iter_mut().zip(coefficients) {
                of_other[lane] = coefficient;
            }
        }
        self.spans.push(span);
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
        for (place, span) in kernels.spans.iter().enumerate() {
            let lists = &kernels.lists[place * kernels.sparse_rows..][..=kernels.sparse_rows];
            for query in &mut *queries {
                query.add_rare(lists, &kernels.sparse);
            }
            for (place, tile) in span.tiles.iter().enumerate() {
                let dense = &kernels.dense[span.first_row + place * kernels.dense_rows..][..kernels.dense_rows];
                for query in &mut *queries {
                    let mut kernel = Aligned(query.rare.0[place]);
                    add_products(simd, &mut kernel.0, dense, &query.rows[..query.dense]);
                    for (product, of_vector) in kernel.0.iter_mut().zip(&tile.norm2) {
                        let distance2 = query.norm2 + of_vector - 2.0 * *product;
                        *product = exp_of_negative(-kernels.gamma * if distance2 > 0.0 { distance2 } else { 0.0 });
                    }
                    let sums = &mut query.lanes.0[span.class];
                    add_weighted(simd, sums, &kernel.0, &tile.coefficients);
                }
            }
        }
    }
}

fn squared_norm(bins: &[Bin]) -> f32 {
    bins.iter().map(|bin| f64::from(bin.weight) * f64::from(bin.weight)).sum::<f64>() as f32
}
