//! Sums of products; the order of the additions is the same for every width of vector registers.

/// Number of partial sums of a product: enough to avoid waiting for the previous addition.
pub(crate) const LANES: usize = 16;

/// Returns xᵀy.
#[inline(always)]
pub(crate) fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (xs, x_rest) = x.as_chunks::<LANES>();
    let (ys, y_rest) = y.as_chunks::<LANES>();
    for (a, b) in xs.iter().zip(ys) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    total(sums) + rest(x_rest, y_rest)
}

/// Returns xᵀy for each of four vectors y, each as [`dot`] returns it.
#[inline(always)]
pub(crate) fn dots(x: &[f64], ys: [&[f64]; 4]) -> [f64; 4] {
    let mut sums = [[0.0; LANES]; 4];
    let (xs, x_rest) = x.as_chunks::<LANES>();
    let [y0, y1, y2, y3] = ys.map(|y| y.as_chunks::<LANES>());
    for ((((a, b0), b1), b2), b3) in xs.iter().zip(y0.0).zip(y1.0).zip(y2.0).zip(y3.0) {
        for lane in 0..LANES {
            sums[0][lane] += a[lane] * b0[lane];
            sums[1][lane] += a[lane] * b1[lane];
            sums[2][lane] += a[lane] * b2[lane];
            sums[3][lane] += a[lane] * b3[lane];
        }
    }
    let rests = [y0.1, y1.1, y2.1, y3.1];
    std::array::from_fn(|at| total(sums[at]) + rest(x_rest, rests[at]))
}

/// Returns the sum of all partial sums: repeatedly adds the second half of the sums to the first
/// half.
#[inline(always)]
pub(crate) fn total<const N: usize>(mut sums: [f64; N]) -> f64 {
    let mut half = N / 2;
    while half > 0 {
        for lane in 0..half {
            sums[lane] += sums[lane + half];
        }
        half /= 2;
    }
    sums[0]
}

/// Returns xᵀy of the entries that remain after the last full group of [`LANES`] entries.
#[inline(always)]
pub(crate) fn rest(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(a, b)| a * b).sum()
}
