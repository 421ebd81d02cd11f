//! Time of the triangular factorisation by row blocks, compared with nalgebra's QR of the same
//! matrix and with one pass over the matrix.

#![allow(clippy::print_stdout, reason = "the ratios are the result")]

use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use mechid_estimate::{EquationOfMotion, Unknowns};
use mechid_numerics::least_squares::LeastSquares;
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn random(rows: usize, columns: usize) -> DMatrix<f64> {
    let mut source = ChaCha8Rng::seed_from_u64(1);
    DMatrix::from_fn(rows, columns, |_, _| source.random_range(-1.0..1.0))
}

/// Reads every number once: a least-squares method cannot be faster.
fn one_pass(a: &DMatrix<f64>) -> f64 {
    let mut sums = [0.0; 8];
    for chunk in a.as_slice().as_chunks::<8>().0 {
        for (sum, value) in sums.iter_mut().zip(chunk) {
            *sum += value;
        }
    }
    sums.iter().sum()
}

fn triangles(criterion: &mut Criterion) {
    for (rows, columns) in [(100_000, 8), (1_000_000, 6)] {
        let matrix = random(rows, columns);
        let mut group = criterion.benchmark_group(format!("triangle of {rows} × {columns}"));
        group.sample_size(10).throughput(Throughput::Bytes(8 * (rows * columns) as u64));
        group.bench_function("one pass over the data", |b| b.iter(|| one_pass(black_box(&matrix))));
        group.bench_function("row blocks", |b| {
            b.iter(|| row_blocks(black_box(&matrix)));
        });
        group.bench_function("nalgebra QR", |b| {
            b.iter_batched(
                || matrix.clone(),
                |matrix| matrix.qr(),
                criterion::BatchSize::LargeInput,
            );
        });
        group.finish();
    }
}

fn row_blocks(matrix: &DMatrix<f64>) -> LeastSquares {
    // The last column is passed as right-hand side, so that the triangular factor is that of the QR
    // of the whole matrix.
    let unknowns = matrix.ncols() - 1;
    let mut rows = LeastSquares::new(unknowns, 1);
    rows.push_rows(matrix.columns(0, unknowns), matrix.columns(unknowns, 1))
        .expect("finite data of the right shape");
    rows
}

/// Returns the shortest of several runs, in seconds: the time without other load on the computer.
fn shortest<T>(runs: usize, mut job: impl FnMut() -> T) -> f64 {
    let time = |_| {
        let start = Instant::now();
        black_box(job());
        start.elapsed().as_secs_f64()
    };
    (0..runs).map(time).fold(f64::INFINITY, f64::min)
}

fn ratios(_: &mut Criterion) {
    for (rows, columns) in [(100_000, 8), (1_000_000, 6)] {
        let matrix = random(rows, columns);
        let runs = 20_000_000 / (rows * columns);
        let pass = shortest(runs, || one_pass(black_box(&matrix)));
        let ours = shortest(runs, || row_blocks(black_box(&matrix)));
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
        let single = alone.install(|| shortest(runs, || row_blocks(black_box(&matrix))));
        // Each run has its own clone, which is made before the clock starts.
        let theirs = (0..runs).map(|_| {
            let copy = std::cell::Cell::new(Some(matrix.clone()));
            shortest(1, || copy.take().map(DMatrix::qr))
        });
        let theirs = theirs.fold(f64::INFINITY, f64::min);
        println!(
            "{rows} × {columns}: row blocks {:.3} ms ({:.3} ms on one thread), {:.1} passes over the \
             data; nalgebra's QR {:.3} ms, {:.2} times as long ({:.2} on one thread)",
            1e3 * ours,
            1e3 * single,
            ours / pass,
            1e3 * theirs,
            theirs / ours,
            theirs / single,
        );
    }
}

/// Times least squares for all entries of M, C and K, with standard errors. The reference is
/// nalgebra's QR of the same rows, solved for all equations at once and without standard errors.
fn many_degrees_of_freedom(_: &mut Criterion) {
    const ROWS: usize = 2048;
    let mut before: Option<(usize, f64)> = None;
    for n in [2, 5, 10, 20, 50] {
        let motions = random(ROWS, 3 * n);
        let truth = random(3 * n, n);
        let force = &motions * truth + random(ROWS, n) * 0.01;
        let solve = || {
            let mut rows = EquationOfMotion::new(n);
            let [a, v, x] = [0, 1, 2].map(|kind| motions.columns(kind * n, n));
            rows.push_rows(a, v, x, force.as_view()).expect("finite");
            rows.solve(&Unknowns::unknown_mass(n).expect("some")).expect("determined")
        };
        let runs = if n < 20 { 20 } else { 5 };
        let ours = shortest(runs, solve);
        let theirs = shortest(runs, || {
            let qr = motions.clone().qr();
            let (q, r) = qr.unpack();
            r.solve_upper_triangular(&q.tr_mul(&force))
        });
        let modes = shortest(1, || solve().modes().map(|modes| modes.len()));
        let slope = before.map_or(String::new(), |(m, seconds)| {
            let slope = (ours / seconds).ln() / (n as f64 / m as f64).ln();
            format!("; grows as n^{slope:.1}")
        });
        println!(
            "{n} degrees of freedom, {ROWS} rows, {} unknowns: {:.3} ms, nalgebra's QR {:.3} ms, {:.2} \
             times as long{slope}; with modes {:.1} ms{}",
            3 * n * n,
            1e3 * ours,
            1e3 * theirs,
            theirs / ours,
            1e3 * modes,
            if n == 50 { " (goal: 2 s at most)" } else { "" }
        );
        before = Some((n, ours));
    }
}

criterion_group!(benches, triangles, ratios, many_degrees_of_freedom);
criterion_main!(benches);
