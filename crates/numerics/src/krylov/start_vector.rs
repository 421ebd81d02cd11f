//! Pseudo-random start vectors of an iteration, the same in every run.

use nalgebra::DVector;

/// Returns a pseudo-random vector of norm 1 with `len` entries, pure numbers. The vector is the
/// same in every run.
pub fn start_vector(len: usize) -> DVector<f64> {
    numbered_start_vector(len, 0)
}

/// Returns a pseudo-random vector of norm 1 with `len` entries, pure numbers. Each `number` gives a
/// different vector, which is the same in every run.
pub fn numbered_start_vector(len: usize, number: usize) -> DVector<f64> {
    let vector = DVector::from_iterator(len, pseudo_random(number).take(len));
    vector.normalize()
}

/// Returns pseudo-random pure numbers between −½ and ½, the same in every run; `number` chooses the
/// sequence.
pub fn pseudo_random(number: usize) -> impl Iterator<Item = f64> {
    let mut seed = 0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(2 * number as u64 + 1);
    std::iter::repeat_with(move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    })
}
