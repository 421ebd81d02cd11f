//! The row-blocked triangle against nalgebra's QR on the same matrix, and against one pass over it.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use mechid_estimate::LeastSquares;
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn random(rows: usize, columns: usize) -> DMatrix<f64> {
    let mut source = ChaCha8Rng::seed_from_u64(1);
    DMatrix::from_fn(rows, columns, |_, _| source.random_range(-1.0..1.0))
}

/// Reads every number once: no least squares can be faster.
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
            b.iter(|| {
                // The last column as right-hand side: the same triangle as QR of the matrix.
                let mut rows = LeastSquares::new(columns - 1, 1);
                rows.push_rows(matrix.columns(0, columns - 1), matrix.columns(columns - 1, 1))
                    .map(|()| rows.rows())
            });
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

criterion_group!(benches, triangles);
criterion_main!(benches);
