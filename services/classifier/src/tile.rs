//! Arithmetic on a tile of support vectors.

use pulp::Simd;

use crate::svm::MAX_CLASSES;

/// Support vectors of a tile. Features are kept tile after tile, so that one tile's stay in the first-level cache while all
/// queries pass by.
pub(crate) const TILE: usize = 64;

/// Vector registers that hold products, twice.
const ABREAST: usize = 4;

/// Numbers that are added side by side.
pub(crate) const LANES: usize = 8;

/// Numbers that begin where a cache line does: vectors of them are then each read from one line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Aligned<T>(pub(crate) T);

/// Adds x·s for each support vector of a tile, without rare bins.
#[inline(always)]
pub(crate) fn add_products<S: Simd>(
    simd: S,
    result: &mut [f32; TILE],
    dense: &[Aligned<[f32; TILE]>],
    rows: &[(u32, f32)],
) {
    let (vectors, _) = S::as_mut_simd_f32s(result);
    for from in (0..vectors.len()).step_by(ABREAST) {
        // Even and odd rows apart, so that additions need not wait for each other.
        let mut sums = [[simd.splat_f32s(0.0); ABREAST]; 2];
        let (pairs, last) = rows.as_chunks::<2>();
        for pair in pairs {
            for (sums, &(row, weight)) in sums.iter_mut().zip(pair) {
                add_row(simd, sums, &dense[row as usize].0, from, weight);
            }
        }
        for &(row, weight) in last {
            add_row(simd, &mut sums[0], &dense[row as usize].0, from, weight);
        }
        for place in 0..ABREAST {
            let sum = simd.add_f32s(sums[0][place], sums[1][place]);
            vectors[from + place] = simd.add_f32s(vectors[from + place], sum);
        }
    }
}

#[inline(always)]
fn add_row<S: Simd>(simd: S, sums: &mut [S::f32s; ABREAST], row: &[f32; TILE], from: usize, weight: f32) {
    let (values, _) = S::as_simd_f32s(row);
    let weight = simd.splat_f32s(weight);
    for (sum, &value) in sums.iter_mut().zip(&values[from..from + ABREAST]) {
        *sum = simd.add_f32s(*sum, simd.mul_f32s(weight, value));
    }
}

/// Adds kernel values times each row of coefficients, lane by lane: so the sums are the same on every machine.
#[inline(always)]
pub(crate) fn add_weighted<S: Simd>(
    simd: S,
    sums: &mut [[f64; LANES]; MAX_CLASSES - 1],
    kernel: &[f32; TILE],
    coefficients: &[[f64; TILE]; MAX_CLASSES - 1],
) {
    let mut wide = Aligned([0.0; TILE]);
    for (wide, &value) in wide.0.iter_mut().zip(kernel) {
        *wide = f64::from(value);
    }
    let (kernel, _) = S::as_simd_f64s(&wide.0);
    for (sums, coefficients) in sums.iter_mut().zip(coefficients) {
        let (sums, _) = S::as_mut_simd_f64s(sums);
        let (coefficients, _) = S::as_simd_f64s(coefficients);
        for (place, sum) in sums.iter_mut().enumerate() {
            let mut total = *sum;
            for place in (place..kernel.len()).step_by(LANES / S::F64_LANES) {
                total = simd.add_f64s(total, simd.mul_f64s(kernel[place], coefficients[place]));
            }
            *sum = total;
        }
    }
}
