//! Errors of identified modes against the truth, over many records.
#![allow(dead_code, reason = "the study uses more of it than the tests")]

use std::ops::Range;

use mechid_modal::{DrivingPoint, IdentifiedMode, ModalEstimate, ModalSettings, identify_modes};

use nalgebra::Complex;

use crate::generator::Case;

type C = Complex<f64>;

/// Errors and standard errors of one quantity: `[mode][record]`.
#[derive(Debug, Clone, Default)]
pub struct Errors(Vec<Vec<(f64, f64)>>);

impl Errors {
    /// Returns the percentage of 95 % intervals that contain the truth.
    pub fn coverage(&self) -> f64 {
        let all: Vec<_> = self.0.iter().flatten().collect();
        let holds = all.iter().filter(|(error, spread)| error.abs() < 1.96 * spread).count();
        100.0 * holds as f64 / all.len().max(1) as f64
    }

    /// Returns the mean of the ratio of squared error to squared standard error.
    pub fn mean_square(&self) -> f64 {
        let all = self.0.iter().flatten().map(|(error, spread)| (error / spread).powi(2));
        all.clone().sum::<f64>() / all.count().max(1) as f64
    }

    /// Returns the ratio of scatter to mean standard error of each mode.
    pub fn scatter(&self) -> Vec<f64> {
        self.each(|_, scatter, spread| scatter / spread)
    }

    /// Returns the ratio of bias to scatter of each mode.
    pub fn bias(&self) -> Vec<f64> {
        self.each(|mean, scatter, _| mean / scatter)
    }

    /// Returns the root-mean-square standard error of each mode.
    pub fn standard_error(&self) -> Vec<f64> {
        self.each(|_, _, spread| spread)
    }

    /// Returns the standard deviation of the errors of each mode.
    pub fn deviation(&self) -> Vec<f64> {
        self.each(|_, scatter, _| scatter)
    }

    fn each(&self, value: impl Fn(f64, f64, f64) -> f64) -> Vec<f64> {
        let of_mode = |errors: &Vec<(f64, f64)>| {
            let count = errors.len() as f64;
            let mean = errors.iter().map(|(error, _)| error).sum::<f64>() / count;
            let square = errors.iter().map(|(error, _)| (error - mean).powi(2)).sum::<f64>();
            let spread = errors.iter().map(|(_, spread)| spread * spread).sum::<f64>() / count;
            value(mean, (square / (count - 1.0)).sqrt(), spread.sqrt())
        };
        self.0.iter().filter(|errors| errors.len() > 1).map(of_mode).collect()
    }
}

/// Errors of all modes of a case.
#[derive(Debug, Clone, Default)]
pub struct Score {
    pub records: usize,
    pub frequency: Errors,
    pub damping: Errors,
    /// Relative errors of the modal masses at the first output and the first input.
    pub mass: Errors,
    shape_holds: usize,
    shape_count: usize,
    found: usize,
    wanted: usize,
    pub false_modes: usize,
    /// Number of tests of constraints, and number of tests that reject at 5 %.
    pub tests: [usize; 2],
}

impl Score {
    /// Identifies the records of `seeds` and compares with the truth.
    pub fn of(case: &Case, seeds: Range<u64>) -> Self {
        Self::with(case, seeds, &ModalSettings::default())
    }

    /// Identifies the records of `seeds` with some settings and compares with the truth.
    pub fn with(case: &Case, seeds: Range<u64>, settings: &ModalSettings) -> Self {
        let modes = case.in_band();
        let mut score = Self::default();
        score.frequency.0 = vec![Vec::new(); modes.len()];
        score.damping.0 = vec![Vec::new(); modes.len()];
        score.mass.0 = vec![Vec::new(); modes.len()];
        for seed in seeds {
            score.records += 1;
            score.wanted += modes.len();
            let Ok(estimate) = identify_modes(&case.lines(seed), settings) else {
                continue;
            };
            for test in estimate.constraint_tests() {
                score.tests[0] += 1;
                score.tests[1] += usize::from(test.p_value < 0.05);
            }
            let pairs = score.pair(case, &modes, estimate.modes());
            score.false_modes += estimate.modes().len() - pairs.len();
            score.found += pairs.len();
            for &(place, mode) in &pairs {
                score.add(case, modes[place], place, &estimate, mode);
            }
        }
        score
    }

    /// Pairs true modes with identified modes, the nearest pair first, within five half-widths.
    fn pair(&self, case: &Case, modes: &[usize], all: &[IdentifiedMode]) -> Vec<(usize, usize)> {
        let mut distances = Vec::new();
        for (place, &truth) in modes.iter().enumerate() {
            let pole = case.poles()[truth];
            for (mode, identified) in all.iter().enumerate() {
                let distance = (identified.pole - pole).norm() / -pole.re;
                if distance < 5.0 {
                    distances.push((distance, place, mode));
                }
            }
        }
        distances.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut pairs: Vec<(usize, usize)> = Vec::new();
        for (_, place, mode) in distances {
            if pairs.iter().all(|(p, m)| *p != place && *m != mode) {
                pairs.push((place, mode));
            }
        }
        pairs.sort_unstable();
        pairs
    }

    fn add(
        &mut self,
        case: &Case,
        truth: usize,
        place: usize,
        estimate: &ModalEstimate,
        index: usize,
    ) {
        let mode = &estimate.modes()[index];
        let (f, z) = (mode.natural_frequency_hz, mode.damping_ratio);
        self.frequency.0[place].push((f.value - case.frequency_hz[truth], f.standard_error));
        self.damping.0[place].push((z.value - case.damping[truth], z.standard_error));
        // The true modal mass is φ²/ψ²: the residue at the driving point gives ψ², and φ is the
        // entry of the shape at this point. The largest entry of the shape is 1.
        let is_largest = |value: &C| (value - 1.0).norm() < 1e-12;
        let largest = mode.shape.iter().position(is_largest).unwrap_or(0);
        let shape = &case.shape[truth];
        let true_mass =
            shape[0].norm() / (shape[largest].norm_sqr() * case.participation[truth][0]);
        let point = DrivingPoint::new(0, 0);
        if let Some(mass) = estimate.modal_mass(index, point, 2) {
            let relative =
                (mass.value.abs() / true_mass.abs() - 1.0, mass.standard_error / mass.value.abs());
            self.mass.0[place].push(relative);
        }
        if case.roving {
            // The shape of the single output is 1, so the participations are the residues at the
            // struck points.
            let scale = C::new(0.0, 2.0 * case.poles()[truth].im);
            let residue = |participation: &f64| case.shape[truth][0] * *participation / scale;
            let s = case.poles()[truth];
            let values = case.participation[truth].iter().map(|p| residue(p) * s * s);
            let pairs = mode.participation.iter().zip(&mode.participation_standard_error);
            for ((value, spread), truth) in pairs.zip(values) {
                self.add_shape(value - truth, *spread);
            }
            return;
        }
        for (output, value) in mode.shape.iter().enumerate().filter(|(k, _)| *k != largest) {
            self.add_shape(
                value - shape[output] / shape[largest],
                mode.shape_standard_error[output],
            );
        }
    }

    fn add_shape(&mut self, error: C, spread: C) {
        // A quantity that a constraint fixes has no error except rounding.
        const ROUNDING: f64 = 1e-9;
        self.shape_count += 2;
        self.shape_holds += usize::from(error.re.abs() < 1.96 * spread.re + ROUNDING);
        self.shape_holds += usize::from(error.im.abs() < 1.96 * spread.im + ROUNDING);
    }

    /// Returns the percentage of 95 % intervals of shapes that contain the truth; NaN without shapes.
    pub fn shape_coverage(&self) -> f64 {
        100.0 * self.shape_holds as f64 / self.shape_count as f64
    }

    /// Returns the percentage of modes that were found.
    pub fn found_share(&self) -> f64 {
        100.0 * self.found as f64 / self.wanted as f64
    }
}
