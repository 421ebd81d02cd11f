//! Poly-reference least-squares complex frequency-domain estimator (pLSCF, "PolyMAX") for tables of
//! frequency responses.
//!
//! The responses of a table are fitted by a right matrix fraction H = B(z) A(z)⁻¹ with real
//! coefficients in z = exp(−j(ω − ω₁)Δ), where Δ maps the band to half the unit circle. The fit
//! needs only sums over the lines. The sums for the highest order contain the sums for all lower
//! orders.

use std::f64::consts::{PI, TAU};

use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;
use thiserror::Error;

use crate::decomposition;
use crate::stabilisation::{Pole, PoleCluster, Stabilisation};

/// Fraction of the half circle to which the band is mapped. The fraction is below 1, so that the
/// edges of the band do not meet their mirror images.
const CIRCLE: f64 = 0.995;

/// Largest damping ratio of a pole that counts as a mode of the band.
const MAX_DAMPING: f64 = 0.1;

/// Minimum share of the orders in which a mode must have a pole.
const MIN_SHARE: f64 = 0.4;

/// Maximum number of rows of a companion matrix: the time for the eigenvalues rises with the third
/// power of this number.
const MAX_COMPANION: usize = 400;

/// Error of the pLSCF estimator, which estimates poles from frequency responses.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum PlscfError {
    /// Two sizes that must be equal are different.
    #[error("{what}: expected {expected}, got {got}")]
    Size {
        /// Name of the counted items.
        what: &'static str,
        /// Number expected.
        expected: usize,
        /// Number given.
        got: usize,
    },
    /// A frequency, response or weight cannot be used.
    #[error("line {line}: {what} {value} cannot be used")]
    Value {
        /// Name of the data.
        what: &'static str,
        /// Line, counted from 0.
        line: usize,
        /// The unusable value, in its unit.
        value: f64,
    },
    /// There are too few lines for the highest order.
    #[error(
        "{lines} lines do not determine a model of order {order}: at least {needed} are needed"
    )]
    TooFewLines {
        /// Number of lines.
        lines: usize,
        /// Highest order asked for.
        order: usize,
        /// Number of lines that the highest order needs.
        needed: usize,
    },
    /// The orders do not rise, are zero, or are too high.
    #[error("orders must rise from at least 1, and order × inputs must be at most {most}")]
    Orders {
        /// Largest product of order and number of inputs.
        most: usize,
    },
    /// The responses do not determine the model: all are zero, or lines coincide.
    #[error(
        "the normal equations of order {order} are singular: the responses are zero or lines coincide"
    )]
    Singular {
        /// Order of the model.
        order: usize,
    },
}

/// Table of frequency responses.
#[derive(Debug, Clone, PartialEq)]
pub struct ResponseTable {
    omega: Vec<f64>,
    responses: Vec<DMatrix<Complex<f64>>>,
    weights: Option<DMatrix<f64>>,
}

impl ResponseTable {
    /// Creates a table from the angular frequencies (rad/s, rising) and the responses H (outputs ×
    /// inputs) of each line.
    ///
    /// # Errors
    /// [`PlscfError::Size`], [`PlscfError::Value`].
    pub fn new(omega: Vec<f64>, responses: Vec<DMatrix<Complex<f64>>>) -> Result<Self, PlscfError> {
        check_size("frequency responses", omega.len(), responses.len())?;
        for (line, &value) in omega.iter().enumerate() {
            let rises = line == 0 || value > omega[line - 1];
            if !(value.is_finite() && value >= 0.0 && rises) {
                return Err(PlscfError::Value { what: "angular frequency", line, value });
            }
        }
        let shape = responses.first().map_or((0, 0), DMatrix::shape);
        for (line, response) in responses.iter().enumerate() {
            check_size("outputs of a frequency response", shape.0, response.nrows())?;
            check_size("inputs of a frequency response", shape.1, response.ncols())?;
            let parts = response.iter().map(|z| z.re + z.im);
            if let Some(value) = parts.into_iter().find(|v| !v.is_finite()) {
                return Err(PlscfError::Value { what: "frequency response", line, value });
            }
        }
        check_size("outputs and inputs (at least one each)", 1, shape.0.min(shape.1).min(1))?;
        Ok(Self { omega, responses, weights: None })
    }

    /// Weights every line of every output (lines × outputs) by the inverse of its standard
    /// deviation.
    ///
    /// The standard deviation must not come from the scatter about a response that was smoothed
    /// over frequency: at a narrow resonance this scatter is not noise.
    ///
    /// # Errors
    /// [`PlscfError::Size`], [`PlscfError::Value`].
    pub fn with_weights(mut self, weights: DMatrix<f64>) -> Result<Self, PlscfError> {
        check_size("rows of the weights", self.omega.len(), weights.nrows())?;
        check_size("columns of the weights", self.outputs(), weights.ncols())?;
        for (line, row) in weights.row_iter().enumerate() {
            if let Some(&value) = row.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
                return Err(PlscfError::Value { what: "weight", line, value });
            }
        }
        self.weights = Some(weights);
        Ok(self)
    }

    /// Returns the number of outputs.
    pub fn outputs(&self) -> usize {
        self.responses[0].nrows()
    }

    /// Returns the number of inputs.
    pub fn inputs(&self) -> usize {
        self.responses[0].ncols()
    }

    /// Returns the angular frequencies, in rad/s.
    pub fn omega(&self) -> &[f64] {
        &self.omega
    }

    /// Returns the responses H of the lines, outputs × inputs each.
    pub fn responses(&self) -> &[DMatrix<Complex<f64>>] {
        &self.responses
    }
}

/// Returns the poles and participations of models of all `orders` (orders of the denominator,
/// rising).
///
/// A model of order n with q inputs has n q poles. The function returns the decaying poles in the
/// band, with the participations of the inputs.
///
/// # Errors
/// [`PlscfError::Orders`], [`PlscfError::TooFewLines`], [`PlscfError::Singular`].
///
/// # Source
/// Guillaume, Verboven, Vanlanduit, Van der Auweraer & Peeters (2003), Proceedings of the 21st
/// International Modal Analysis Conference; Peeters, Van der Auweraer, Guillaume & Leuridan (2004),
/// Shock and Vibration 11, 395–409.
pub fn plscf(table: &ResponseTable, orders: &[usize]) -> Result<Stabilisation, PlscfError> {
    let inputs = table.inputs();
    let rising = orders.windows(2).all(|pair| pair[0] < pair[1]);
    let highest = match orders.last() {
        Some(highest) if rising && orders[0] > 0 && highest * inputs <= MAX_COMPANION => *highest,
        _ => return Err(PlscfError::Orders { most: MAX_COMPANION }),
    };
    let (lines, needed) = (table.omega.len(), highest + 1);
    if lines < needed {
        return Err(PlscfError::TooFewLines { lines, order: highest, needed });
    }
    let normal = NormalEquations::new(table, highest)?;
    let models: Result<Vec<_>, PlscfError> = orders
        .par_iter()
        .map(|&order| Ok((order, normal.poles(order).ok_or(PlscfError::Singular { order })?)))
        .collect();
    Ok(Stabilisation::new(models?))
}

/// Returns the clusters of the poles of a table over `orders`, by rising frequency. They are the
/// initial values of the modes in a maximum-likelihood fit.
///
/// # Errors
/// As [`plscf`].
///
/// # Source
/// As [`plscf`].
pub fn initial_poles(
    table: &ResponseTable,
    orders: &[usize],
) -> Result<Vec<PoleCluster>, PlscfError> {
    Ok(plscf(table, orders)?.clusters(MAX_DAMPING, MIN_SHARE))
}

/// Normal equations of the denominators of all orders up to a highest one.
struct NormalEquations {
    inputs: usize,
    /// Reduced normal matrix of each order n, (n + 1) q × (n + 1) q; entry n of the list belongs to
    /// order n.
    reduced: Vec<DMatrix<f64>>,
    /// First angular frequency ω₁, in rad/s, of z = exp(−j(ω − ω₁)Δ); the field `delta` is Δ, in s.
    first: f64,
    delta: f64,
}

impl NormalEquations {
    fn new(table: &ResponseTable, order: usize) -> Result<Self, PlscfError> {
        let (first, last) = (table.omega[0], table.omega[table.omega.len() - 1]);
        let singular = PlscfError::Singular { order };
        if last <= first {
            return Err(singular);
        }
        let delta = CIRCLE * PI / (last - first);
        let powers: Vec<Vec<Complex<f64>>> = table
            .omega
            .iter()
            .map(|omega| {
                let step = Complex::cis(-(omega - first) * delta);
                std::iter::successors(Some(Complex::from(1.0)), |z| Some(z * step))
                    .take(order + 1)
                    .collect()
            })
            .collect();
        let (len, inputs) = (order + 1, table.inputs());
        let outputs: Option<Vec<OutputSums>> = (0..table.outputs())
            .into_par_iter()
            .map(|output| OutputSums::new(table, &powers, output))
            .collect();
        let outputs = outputs.ok_or(singular)?;
        let mut total = DMatrix::zeros(len * inputs, len * inputs);
        for sums in &outputs {
            total += &sums.denominator;
        }
        // Row n of the whitened matrix gives the part of the denominator sums that a numerator of
        // order n explains in addition to a numerator of order n − 1.
        let mut explained = DMatrix::zeros(len * inputs, len * inputs);
        let mut reduced = Vec::with_capacity(len);
        for n in 0..len {
            for sums in &outputs {
                let row = sums.whitened.row(n);
                explained.ger(1.0, &row.transpose(), &row.transpose(), 1.0);
            }
            let size = (n + 1) * inputs;
            reduced.push(total.view((0, 0), (size, size)) - explained.view((0, 0), (size, size)));
        }
        Ok(Self { inputs, reduced, first, delta })
    }

    /// Returns the poles of one order in the band, with their participations.
    fn poles(&self, order: usize) -> Option<Vec<Pole>> {
        let (q, size) = (self.inputs, order * self.inputs);
        let normal = &self.reduced[order];
        let corner = normal.view((0, 0), (size, size)).into_owned();
        let right = normal.view((0, size), (size, q)).into_owned();
        // The highest coefficient is the identity: the poles that represent noise then tend to be
        // unstable, and unstable poles are not returned.
        let coefficients = -scaled_solve(corner, right)?;
        let block = |power: usize| coefficients.rows(power * q, q).transpose();
        let mut companion = DMatrix::zeros(size, size);
        companion.view_mut((0, q), (size - q, size - q)).fill_with_identity();
        for power in 0..order {
            companion.view_mut((size - q, power * q), (q, q)).copy_from(&-block(power));
        }
        let width = PI * CIRCLE / self.delta;
        let mut poles = Vec::new();
        for z in decomposition::eigenvalues(&companion)? {
            let exponent = -z.ln() / self.delta;
            let turn = if exponent.im < 0.0 { TAU / self.delta } else { 0.0 };
            let offset = exponent.im + turn;
            if !(exponent.re < 0.0 && offset > 0.0 && offset < width) {
                continue;
            }
            let mut polynomial = DMatrix::<Complex<f64>>::identity(q, q);
            for power in (0..order).rev() {
                polynomial = polynomial * z + block(power).map(Complex::from);
            }
            if let Some(vector) = decomposition::null_vector(polynomial) {
                let pole = Complex::new(exponent.re, offset + self.first);
                poles.push(Pole { pole, vector });
            }
        }
        Some(poles)
    }
}

/// Products of numerator and denominator terms of one output, summed over the lines.
struct OutputSums {
    /// L⁻¹ S, where L is the Cholesky factor of the sums of the numerator, and S contains the mixed
    /// sums of numerator and denominator. The leading rows and columns of L⁻¹ S belong to the lower
    /// orders.
    whitened: DMatrix<f64>,
    /// Sums of the denominator.
    denominator: DMatrix<f64>,
}

impl OutputSums {
    /// Sums the products of one output over the lines. The product of two powers of z depends only
    /// on their difference: all matrices have Toeplitz blocks.
    fn new(table: &ResponseTable, powers: &[Vec<Complex<f64>>], output: usize) -> Option<Self> {
        let (len, q) = (powers[0].len(), table.inputs());
        let mut numerator = vec![0.0; len];
        // The loop computes the sums of z^lag H_j and z^lag H_i* H_j for the lags −(len − 1) to len
        // − 1.
        let lags = 2 * len - 1;
        let mut mixed = DMatrix::<f64>::zeros(lags, q);
        let mut squared = DMatrix::<f64>::zeros(lags, q * q);
        for (line, z) in powers.iter().enumerate() {
            let weight = table.weights.as_ref().map_or(1.0, |w| w[(line, output)].powi(2));
            let row = table.responses[line].row(output);
            for lag in 0..len {
                numerator[lag] += weight * z[lag].re;
            }
            for j in 0..q {
                let response = row[j] * weight;
                accumulate(mixed.column_mut(j).as_mut_slice(), z, response);
                for i in 0..q {
                    let product = response * row[i].conj();
                    accumulate(squared.column_mut(i * q + j).as_mut_slice(), z, product);
                }
            }
        }
        let sums = DMatrix::from_fn(len, len, |a, b| numerator[a.abs_diff(b)]);
        let lag = |a: usize, b: usize| b + len - 1 - a;
        let crossed = DMatrix::from_fn(len, len * q, |a, b| -mixed[(lag(a, b / q), b % q)]);
        let denominator = DMatrix::from_fn(len * q, len * q, |a, b| {
            squared[(lag(a / q, b / q), (a % q) * q + b % q)]
        });
        let whitened = sums.cholesky()?.l().solve_lower_triangular(&crossed)?;
        Some(Self { whitened, denominator })
    }
}

/// Adds Re(z^lag · value) to the sum of each lag, negative lags first.
fn accumulate(sums: &mut [f64], powers: &[Complex<f64>], value: Complex<f64>) {
    let zero = powers.len() - 1;
    for (lag, z) in powers.iter().enumerate() {
        let (even, odd) = (z.re * value.re, z.im * value.im);
        sums[zero + lag] += even - odd;
        if lag > 0 {
            sums[zero - lag] += even + odd;
        }
    }
}

/// Solves A X = B for a positive definite A, after scaling so that the diagonal of A is 1. If
/// rounding makes A indefinite, LU factorisation replaces the Cholesky factorisation.
fn scaled_solve(mut matrix: DMatrix<f64>, mut right: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale: Vec<f64> = matrix.diagonal().iter().map(|d| d.max(0.0).sqrt()).collect();
    if scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        return None;
    }
    for i in 0..matrix.nrows() {
        for j in 0..matrix.ncols() {
            matrix[(i, j)] /= scale[i] * scale[j];
        }
        right.row_mut(i).unscale_mut(scale[i]);
    }
    let solved = match matrix.clone().cholesky() {
        Some(factor) => Some(factor.solve(&right)),
        None => matrix.lu().solve(&right),
    };
    let mut solution = solved?;
    for (i, s) in scale.iter().enumerate() {
        solution.row_mut(i).unscale_mut(*s);
    }
    solution.iter().all(|v| v.is_finite()).then_some(solution)
}

fn check_size(what: &'static str, expected: usize, got: usize) -> Result<(), PlscfError> {
    if expected == got { Ok(()) } else { Err(PlscfError::Size { what, expected, got }) }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::indicators::mac;

    struct Truth {
        poles: Vec<Complex<f64>>,
        shapes: Vec<DVector<Complex<f64>>>,
        participations: Vec<DVector<Complex<f64>>>,
    }

    fn truth(outputs: usize, inputs: usize) -> Truth {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut vector = |len: usize| {
            DVector::from_fn(len, |_, _| {
                Complex::new(random.random_range(-1.0..1.0), random.random_range(-0.1..0.1))
            })
        };
        let frequencies = [(31.0, 0.01), (58.0, 0.005), (58.6, 0.006), (94.0, 0.02)];
        let poles =
            frequencies.map(|(f, z): (f64, f64)| Complex::new(-z, (1.0 - z * z).sqrt()) * f * TAU);
        Truth {
            poles: poles.to_vec(),
            shapes: poles.iter().map(|_| vector(outputs)).collect(),
            participations: poles.iter().map(|_| vector(inputs)).collect(),
        }
    }

    fn table(truth: &Truth, noise: f64) -> ResponseTable {
        let omega: Vec<f64> = (0..800).map(|k| TAU * (20.0 + 0.1 * f64::from(k))).collect();
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let at = |omega: &f64| {
            let s = Complex::new(0.0, *omega);
            let (p, q) = (truth.shapes[0].len(), truth.participations[0].len());
            let mut response = DMatrix::zeros(p, q);
            for r in 0..truth.poles.len() {
                let residue = &truth.shapes[r] * truth.participations[r].transpose();
                response += &residue / (s - truth.poles[r]);
                response += residue.conjugate() / (s - truth.poles[r].conj());
            }
            response.map(|z: Complex<f64>| {
                let mut part = || noise * random.random_range(-1.0..1.0);
                z + Complex::new(part(), part())
            })
        };
        let responses = omega.iter().map(at).collect();
        ResponseTable::new(omega, responses).unwrap()
    }

    fn orders() -> Vec<usize> {
        (4..=24).collect()
    }

    #[test]
    fn exact_responses_give_the_poles_and_participations() {
        let truth = truth(5, 2);
        let clusters = initial_poles(&table(&truth, 0.0), &orders()).unwrap();
        assert_eq!(clusters.len(), 4);
        for (r, cluster) in clusters.iter().enumerate() {
            let gap = (cluster.pole.pole - truth.poles[r]).norm() / truth.poles[r].re.abs();
            // The poles are not exact, because a fraction in z has no modes at negative
            // frequencies.
            assert!(gap < 0.01, "{r}: {gap}");
            assert!(mac(&cluster.pole.vector, &truth.participations[r]) > 0.9999);
        }
    }

    #[test]
    fn a_single_input_and_noise() {
        let truth = truth(4, 1);
        let table = table(&truth, 1e-4);
        let weights = DMatrix::from_element(table.omega().len(), 4, 2.0);
        let weighted = table.clone().with_weights(weights).unwrap();
        let clusters = initial_poles(&table, &orders()).unwrap();
        for pole in &truth.poles {
            let near = clusters.iter().map(|c| (c.pole.pole - pole).norm());
            let gap = near.fold(f64::INFINITY, f64::min) / pole.re.abs();
            assert!(gap < 0.1, "{pole}: {gap}");
        }
        // A weight that is equal on all lines does not change the poles.
        let again = initial_poles(&weighted, &orders()).unwrap();
        assert_eq!(again.len(), clusters.len());
        for (one, two) in clusters.iter().zip(&again) {
            assert!((one.pole.pole - two.pole.pole).norm() < 1e-6 * one.pole.pole.norm());
        }
    }

    /// Reference: the sums over the lines for one order, computed directly.
    #[test]
    fn the_equations_of_every_order_are_those_of_direct_sums() {
        let table = table(&truth(3, 2), 1e-3);
        let normal = NormalEquations::new(&table, 6).unwrap();
        for order in [1, 4, 6] {
            let mut direct = DMatrix::zeros((order + 1) * 2, (order + 1) * 2);
            for output in 0..3 {
                let rows = table.omega.len();
                let power = |k: usize, a: usize| {
                    Complex::cis(-(table.omega[k] - normal.first) * normal.delta * a as f64)
                };
                let x = DMatrix::from_fn(rows, order + 1, power);
                let y = DMatrix::from_fn(rows, (order + 1) * 2, |k, b| {
                    -power(k, b / 2) * table.responses[k][(output, b % 2)]
                });
                let (r, s) = ((x.adjoint() * &x).map(|z| z.re), (x.adjoint() * &y).map(|z| z.re));
                let t = (y.adjoint() * &y).map(|z| z.re);
                direct += t - s.transpose() * r.lu().solve(&s).unwrap();
            }
            let gap = (&normal.reduced[order] - &direct).norm() / direct.norm();
            assert!(gap < 1e-10, "{order}: {gap}");
        }
    }

    #[test]
    fn what_cannot_be_fitted_is_refused() {
        let good = table(&truth(3, 1), 0.0);
        assert!(matches!(plscf(&good, &[]), Err(PlscfError::Orders { .. })));
        assert!(matches!(plscf(&good, &[3, 2]), Err(PlscfError::Orders { .. })));
        assert!(matches!(plscf(&good, &[401]), Err(PlscfError::Orders { .. })));
        let few = ResponseTable::new(good.omega[..5].to_vec(), good.responses[..5].to_vec());
        assert!(matches!(plscf(&few.unwrap(), &[9]), Err(PlscfError::TooFewLines { .. })));
        let zero = vec![DMatrix::zeros(3, 1); 800];
        let zero = ResponseTable::new(good.omega.clone(), zero).unwrap();
        assert!(matches!(plscf(&zero, &[4]), Err(PlscfError::Singular { order: 4 })));
        let mut falling = good.omega.clone();
        falling[7] = falling[6];
        let refused = ResponseTable::new(falling, good.responses.clone());
        assert!(matches!(refused, Err(PlscfError::Value { line: 7, .. })));
        assert!(ResponseTable::new(vec![], vec![]).is_err());
    }
}
