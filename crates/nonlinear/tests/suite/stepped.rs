//! Responses of nonlinear systems, computed by extrapolation of very high order. They are the
//! reference for the nonlinear estimators, which share no code with this module.

use std::f64::consts::TAU;

use mechid_signal::{Record, Sampling};

/// Line n, amplitude A and phase φ of the signal A cos(n ω₀ t + φ).
pub type Cosine = (usize, f64, f64);

/// Number of periods after which a system that decays within a tenth of a period is independent of
/// its initial state.
const SETTLED: usize = 3;

/// Numbers of substeps of the extrapolated midpoint rule; the extrapolation has order 12.
const SUBSTEPS: [usize; 6] = [2, 4, 6, 8, 10, 12];

/// Returns force and displacement over one period of the steady motion ẍ = acceleration(x, ẋ, F).
///
/// The method is Gragg's midpoint rule, extrapolated in h² (Hairer, Nørsett & Wanner, *Solving
/// Ordinary Differential Equations I*, section II.9), with one step per sample and the exact force
/// at every instant.
pub fn steady<const N: usize>(
    sampling: Sampling,
    forces: &[Vec<Cosine>; N],
    acceleration: impl Fn(&[f64; N], &[f64; N], &[f64; N]) -> [f64; N],
) -> (Record, Record) {
    steady_after(SETTLED, sampling, forces, acceleration)
}

/// Returns force and displacement in the last of `settled` periods; the motion begins from rest.
pub fn steady_after<const N: usize>(
    settled: usize,
    sampling: Sampling,
    forces: &[Vec<Cosine>; N],
    acceleration: impl Fn(&[f64; N], &[f64; N], &[f64; N]) -> [f64; N],
) -> (Record, Record) {
    let (dt, len) = (sampling.dt(), sampling.len());
    let turns: Vec<(f64, f64)> =
        (0..len).map(|k| (TAU * k as f64 / len as f64).sin_cos()).collect();
    // Returns the forces at a fraction of each sampling interval. From one sample to the next, the
    // phase of line n advances by 2πn/len.
    let forces_at = |fraction: f64| {
        let mut all = vec![[0.0; N]; len];
        for (dof, lines) in forces.iter().enumerate() {
            for (n, amplitude, phase) in lines {
                let angle = TAU * *n as f64 * fraction / len as f64 + phase;
                let (sine, cosine) = angle.sin_cos();
                for (sample, force) in all.iter_mut().enumerate() {
                    let turn = turns[n * sample % len];
                    force[dof] += amplitude * (cosine * turn.1 - sine * turn.0);
                }
            }
        }
        all
    };
    // Forces at the instants of all substeps: levels × instants × samples. They are the same in
    // every period.
    let table = SUBSTEPS.map(|count| -> Vec<_> {
        (0..count).map(|k| forces_at(k as f64 / count as f64)).collect()
    });
    let rate = |z: &[[f64; N]; 2], f: &[f64; N]| [z[1], acceleration(&z[0], &z[1], f)];
    let mut z = [[0.0; N]; 2];
    let mut x = vec![vec![0.0; len]; N];
    for period in 0..settled {
        for sample in 0..len {
            if period + 1 == settled {
                x.iter_mut().zip(z[0]).for_each(|(channel, value)| channel[sample] = value);
            }
            z = step(&z, dt, |level, instant| &table[level][instant][sample], &rate);
        }
    }
    let at_samples = &table[0][0];
    let data: Vec<Vec<f64>> =
        (0..N).map(|dof| at_samples.iter().map(|force| force[dof]).collect()).collect();
    let record = |channels: &[Vec<f64>]| Record::from_channels(sampling, channels).unwrap();
    (record(&data), record(&x))
}

fn step<'a, const N: usize>(
    z: &[[f64; N]; 2],
    dt: f64,
    forces: impl Fn(usize, usize) -> &'a [f64; N],
    rate: &impl Fn(&[[f64; N]; 2], &[f64; N]) -> [[f64; N]; 2],
) -> [[f64; N]; 2] {
    let plus = |a: &[[f64; N]; 2], h: f64, b: &[[f64; N]; 2]| {
        let mut sum = *a;
        for (sum, b) in sum.iter_mut().flatten().zip(b.iter().flatten()) {
            *sum += h * b;
        }
        sum
    };
    let mut table: Vec<[[f64; N]; 2]> = Vec::new();
    for (level, count) in SUBSTEPS.iter().enumerate() {
        let h = dt / *count as f64;
        let (mut before, mut now) = (*z, plus(z, h, &rate(z, forces(level, 0))));
        for instant in 1..*count {
            let next = plus(&before, 2.0 * h, &rate(&now, forces(level, instant)));
            (before, now) = (now, next);
        }
        // The Aitken–Neville scheme extrapolates in h²; the row begins with the newest value.
        let mut row = vec![now];
        for column in 0..level {
            let ratio = (*count as f64 / SUBSTEPS[level - 1 - column] as f64).powi(2) - 1.0;
            let (fine, coarse) = (row[column], &table[column]);
            let difference = plus(&fine, -1.0, coarse);
            row.push(plus(&fine, 1.0 / ratio, &difference));
        }
        table = row;
    }
    table[SUBSTEPS.len() - 1]
}

/// Returns cosines of equal amplitude with random phases from a seed.
pub fn random_phases(lines: impl Iterator<Item = usize>, amplitude: f64, seed: u64) -> Vec<Cosine> {
    use rand::{RngExt, SeedableRng};
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    lines.map(|n| (n, amplitude, random.random_range(0.0..TAU))).collect()
}
