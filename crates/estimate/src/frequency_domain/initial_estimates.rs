//! Initial estimates for the search for the maximum of the likelihood: linear estimates of the
//! equation of motion, with weights and corrections for noise.

use std::borrow::Cow;

use mechid_model::{Matrix, Parameter, SecondOrderSystem};
use mechid_numerics::linear_algebra::hermitian_eigen;
use mechid_numerics::time_limit;
use mechid_numerics::triangular::TriangularFactor;
use mechid_spectra::transient;
use mechid_spectra::transient::powers;
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{Complex, DMatrix, DVector};

use super::equation_error::weighted_equation_errors;
use super::multi_start::thin_step;
use crate::limits::INITIAL_ROUNDS;
use crate::relations::Relations;
use crate::{Estimate, Unknowns};

/// Exponents e of the weights ω^e, for white noise on the displacement: the equation error that it
/// causes grows with ω² where the mass dominates.
const EXPONENTS: [i32; 3] = [0, -2, -3];
/// Linear estimates from spectra, one equation of motion after another.
pub(super) struct InitialEstimates<'a> {
    /// Measured data. A Hann window is applied to open records, because it reduces their
    /// transients.
    data: Cow<'a, FrequencyData>,
    /// Number of unknown transient loads; their initial estimates are zero.
    transient_loads: usize,
    unknowns: &'a Unknowns,
    noise: Cow<'a, NoiseSpectrum>,
    equations: Vec<Equation>,
    /// Linear relations between entries; with relations all equations are solved together.
    linear: Option<Relations>,
    nominal: Option<DVector<f64>>,
}

/// Unknowns of one equation of motion; each has its index among all unknowns.
struct Equation {
    row: usize,
    parameters: Vec<(usize, Parameter)>,
}

/// Treatment of noise on the regressors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Ordinary least squares: the noise of the regressors is neglected.
    Ordinary,
    /// Total least squares in the metric of the noise of regressors and force; the estimate is
    /// consistent.
    Total,
}

/// Weights of the equations, rows × dof.
type Weights = DMatrix<f64>;

impl<'a> InitialEstimates<'a> {
    pub(super) fn new(
        data: &'a FrequencyData,
        unknowns: &'a Unknowns,
        noise: &'a NoiseSpectrum,
    ) -> Self {
        let free = unknowns.free();
        let equation = |row| {
            let parameters = free.iter().copied().enumerate().filter(|(_, p)| p.row() == row);
            Equation { row, parameters: parameters.collect() }
        };
        let equations =
            (0..unknowns.dof()).map(equation).filter(|e| !e.parameters.is_empty()).collect();
        let transient_loads = transient::len(data);
        let lines = match transient_loads {
            0 => Cow::Borrowed(data),
            _ => Cow::Owned(data.under_hann_window()),
        };
        let step = thin_step(data, unknowns);
        let thinned = || lines.thinned(step).zip(noise.thinned(step)).filter(|_| step > 1);
        let (data, noise) = match thinned() {
            Some((data, noise)) => (Cow::Owned(data), Cow::Owned(noise)),
            None => (lines, Cow::Borrowed(noise)),
        };
        Self {
            data,
            transient_loads,
            unknowns,
            noise,
            equations,
            linear: Relations::linear(unknowns),
            nominal: None,
        }
    }

    /// Adds the entries of a nominal system as an initial estimate.
    pub(super) fn with_nominal(mut self, nominal: Option<&SecondOrderSystem>) -> Self {
        let entry = |system: &SecondOrderSystem, p: &Parameter| {
            system.matrix(p.matrix())[(p.row(), p.column())]
        };
        let free = self.unknowns.free();
        self.nominal = nominal.map(|system| {
            DVector::from_iterator(free.len(), free.iter().map(|p| entry(system, p)))
        });
        self
    }

    /// Returns all initial estimates, the most reliable first. The order is: total and ordinary
    /// least squares in rounds, each weighted by the dynamic stiffness of the previous round; total
    /// least squares with equal weights; the nominal system; ordinary least squares with the
    /// weights ω^e and with the weights of the noise. All rounds of total least squares form one
    /// family; ordinary least squares has one family for each of its initial weightings.
    pub(super) fn families(&self) -> Vec<Vec<DVector<f64>>> {
        let powers =
            EXPONENTS.map(|exponent| self.estimate(Kind::Ordinary, &self.powers(exponent)));
        let reweighted = |kind| powers[..2].iter().flatten().map(move |s| self.reweighted(kind, s));
        let total: Vec<_> = reweighted(Kind::Total).flatten().collect();
        let ordinary = reweighted(Kind::Ordinary);
        let weighted = weighted_equation_errors(&self.data, self.unknowns);
        let single = self.estimate(Kind::Total, &self.powers(0)).into_iter();
        let single = single.chain(self.nominal.clone()).chain(powers.iter().flatten().cloned());
        let single = single.chain(weighted.map(|solution| values(&solution)));
        let families = std::iter::once(total).chain(ordinary);
        let families = families.chain(single.map(|start| vec![start]));
        let relations = Relations::from_unknowns(self.unknowns);
        let with_transient_loads = |start: DVector<f64>| {
            let independent = match &relations {
                None => start,
                Some(relations) => relations.unknowns(start.as_slice()),
            };
            let len = independent.len() + self.transient_loads;
            independent.resize_vertically(len, 0.0)
        };
        families.map(|family| family.into_iter().map(with_transient_loads).collect()).collect()
    }

    /// Returns the estimates of every round of weighting, beginning with the weights of `start`;
    /// there are no more rounds after the time limit.
    fn reweighted(&self, kind: Kind, start: &DVector<f64>) -> Vec<DVector<f64>> {
        let mut rounds: Vec<DVector<f64>> = Vec::new();
        for _ in 0..INITIAL_ROUNDS {
            if time_limit::is_over() {
                break;
            }
            let weights = self.weights(rounds.last().unwrap_or(start));
            let Some(next) = weights.and_then(|w| self.estimate(kind, &w)) else { break };
            rounds.push(next);
        }
        rounds
    }

    fn powers(&self, exponent: i32) -> Weights {
        let omega = self.data.omega();
        let middle = omega[omega.len() / 2];
        DMatrix::from_fn(omega.len(), self.data.dof(), |row, _| {
            (omega[row] / middle).powi(exponent)
        })
    }

    /// Returns the inverse standard deviations of D ΔX − ΔF, with the dynamic stiffness D of
    /// `theta` and the noise ΔX and ΔF of displacement and force.
    fn weights(&self, theta: &DVector<f64>) -> Option<Weights> {
        let matrices = self.unknowns.assemble(theta.as_slice());
        let n = self.data.dof();
        let mut weights = DMatrix::zeros(self.data.len(), n);
        let mut z = DVector::zeros(2 * n);
        for (line, &omega) in self.data.omega().iter().enumerate() {
            let powers = powers(omega);
            let covariance = self.noise.covariance(line);
            for i in 0..n {
                for j in 0..n {
                    let stiffness =
                        Matrix::ALL.map(|m| powers[m as usize] * matrices[m as usize][(i, j)]);
                    z[j] = stiffness.iter().sum::<Complex<f64>>().conj();
                    z[n + j] = Complex::from(if i == j { -1.0 } else { 0.0 });
                }
                let variance = z.dotc(&(covariance * &z)).re;
                weights[(line, i)] = variance.sqrt().recip();
            }
        }
        weights.iter().all(|w| w.is_finite()).then_some(weights)
    }

    /// Estimates the free entries of each equation of motion or, if entries are related, of all
    /// equations together.
    fn estimate(&self, kind: Kind, weights: &Weights) -> Option<DVector<f64>> {
        let theta = match &self.linear {
            Some(linear) => self.estimate_together(kind, weights, linear)?,
            None => {
                let count = self.equations.iter().map(|e| e.parameters.len()).sum();
                let mut theta = DVector::zeros(count);
                for equation in &self.equations {
                    let weights: Vec<f64> = weights.column(equation.row).iter().copied().collect();
                    let triangle = self.triangle(equation, &weights)?;
                    let noise = || self.noise_gram(equation, &weights);
                    let values = solve(kind, triangle, noise)?;
                    for ((index, _), value) in equation.parameters.iter().zip(values.iter()) {
                        theta[*index] = *value;
                    }
                }
                theta
            }
        };
        theta.iter().all(|v| v.is_finite()).then_some(theta)
    }

    fn estimate_together(
        &self,
        kind: Kind,
        weights: &Weights,
        linear: &Relations,
    ) -> Option<DVector<f64>> {
        let count = linear.count();
        let mut factor = TriangularFactor::new(count + 1);
        let mut noise = DMatrix::zeros(count + 1, count + 1);
        for equation in &self.equations {
            let weights: Vec<f64> = weights.column(equation.row).iter().copied().collect();
            // Columns of the unknowns of this equation and, last, of its force.
            let unknowns = equation.parameters.iter().map(|(index, _)| linear.shared(*index));
            let places: Vec<usize> = unknowns.chain([count]).collect();
            let of_equation = self.triangle(equation, &weights)?;
            let mut triangle = DMatrix::zeros(of_equation.nrows(), count + 1);
            for (column, at) in of_equation.column_iter().zip(&places) {
                triangle.column_mut(*at).axpy(1.0, &column, 1.0);
            }
            factor.push(&[triangle.as_view()]).then_some(())?;
            if kind == Kind::Total {
                let gram = self.noise_gram(equation, &weights);
                for (column, to) in gram.column_iter().zip(&places) {
                    for (value, at) in column.iter().zip(&places) {
                        noise[(*at, *to)] += value;
                    }
                }
            }
        }
        let values = solve(kind, factor.r().clone(), || noise)?;
        Some(linear.entries(values.as_slice()))
    }

    /// Returns the triangular factor R of the weighted regressors. Its last column belongs to the
    /// force minus the forces of the known entries.
    fn triangle(&self, equation: &Equation, weights: &[f64]) -> Option<DMatrix<f64>> {
        let (lines, last) = (self.data.len(), equation.parameters.len());
        let (x, force) = (self.data.displacement(), self.data.force());
        let mut rows = DMatrix::zeros(2 * lines, last + 1);
        for (line, &omega) in self.data.omega().iter().enumerate() {
            let powers = powers(omega);
            let mut put = |column: usize, z: Complex<f64>| {
                let z = z * weights[line];
                (rows[(line, column)], rows[(lines + line, column)]) = (z.re, z.im);
            };
            for (at, (_, p)) in equation.parameters.iter().enumerate() {
                put(at, powers[p.matrix() as usize] * x[(line, p.column())]);
            }
            let mut target = force[(line, equation.row)];
            for (matrix, column, value) in self.known(equation.row) {
                target -= powers[matrix as usize] * x[(line, column)] * value;
            }
            put(last, target);
        }
        let mut factor = TriangularFactor::new(last + 1);
        factor.push(&[rows.as_view()]).then(|| factor.r().clone())
    }

    /// Returns the expected Gram matrix of the noise in the columns of
    /// [`InitialEstimates::triangle`].
    fn noise_gram(&self, equation: &Equation, weights: &[f64]) -> DMatrix<f64> {
        let (n, last) = (self.data.dof(), equation.parameters.len());
        // For each displacement, then for each force: the columns that contain its noise. Each
        // column is given by its index, the index of the power of the frequency that multiplies the
        // noise (3: no power), and a real factor.
        let mut enters: Vec<Vec<(usize, usize, f64)>> = vec![Vec::new(); 2 * n];
        for (at, (_, p)) in equation.parameters.iter().enumerate() {
            enters[p.column()].push((at, p.matrix() as usize, 1.0));
        }
        for (m, column, value) in self.known(equation.row) {
            enters[column].push((last, m as usize, -value));
        }
        enters[n + equation.row].push((last, 3, 1.0));
        let mut gram = DMatrix::zeros(last + 1, last + 1);
        for (line, &omega) in self.data.omega().iter().enumerate() {
            let [m, c, k] = powers(omega);
            let powers = [m, c, k, Complex::ONE].map(|power| power * weights[line]);
            // Most covariances are 0, because the noise of most channels is independent.
            let covariance = self.noise.covariance(line);
            let entering = || enters.iter().enumerate().filter(|(_, columns)| !columns.is_empty());
            for (j, right) in entering() {
                for (i, left) in entering() {
                    // E[Δz̄_i Δz_j] is the conjugate of the entry (i, j) of the covariance.
                    let expected = covariance[(j, i)];
                    if expected == Complex::ZERO {
                        continue;
                    }
                    for (b, power, factor) in right {
                        let of_b = powers[*power] * expected * *factor;
                        for (a, power, factor) in left.iter().filter(|(a, ..)| a <= b) {
                            gram[(*a, *b)] += (powers[*power].conj() * of_b).re * factor;
                        }
                    }
                }
            }
        }
        gram.fill_lower_triangle_with_upper_triangle();
        gram
    }

    /// Returns the known nonzero entries of an equation of motion.
    fn known(&self, row: usize) -> impl Iterator<Item = (Matrix, usize, f64)> + '_ {
        let entries = Matrix::ALL
            .into_iter()
            .flat_map(|m| (0..self.data.dof()).map(move |column| (m, column)));
        entries.filter_map(move |(matrix, column)| {
            let value = self.unknowns.fixed(matrix, row, column).filter(|v| *v != 0.0)?;
            Some((matrix, column, value))
        })
    }
}

/// Solves for the unknowns of a triangular factor whose last column is the force; `noise` returns
/// the expected Gram matrix of the noise in its columns.
fn solve(
    kind: Kind,
    mut triangle: DMatrix<f64>,
    noise: impl FnOnce() -> DMatrix<f64>,
) -> Option<DVector<f64>> {
    let scale = DVector::from_iterator(
        triangle.ncols(),
        triangle.column_iter().map(|c| c.norm()).map(|l| if l > 0.0 { l } else { 1.0 }),
    );
    triangle.column_iter_mut().zip(scale.iter()).for_each(|(mut c, s)| c.unscale_mut(*s));
    let last = scale.len() - 1;
    let values = match kind {
        Kind::Ordinary => triangle
            .view((0, 0), (last, last))
            .solve_upper_triangular(&triangle.view((0, last), (last, 1)))?,
        Kind::Total => {
            let mut noise = noise();
            for (at, value) in noise.iter_mut().enumerate() {
                *value /= scale[at % scale.len()] * scale[at / scale.len()];
            }
            total_least_squares(&triangle, &noise)?
        }
    };
    Some(DVector::from_fn(last, |at, _| values[at] * (scale[last] / scale[at])))
}

fn values(estimate: &Estimate) -> DVector<f64> {
    let parameters = estimate.parameters();
    DVector::from_iterator(parameters.len(), parameters.map(|p| p.value))
}

/// Returns the θ that minimises the ratio of |R [θ; −1]|² to [θ; −1]ᵀ N [θ; −1], with the
/// triangular factor R of the data and the Gram matrix N of their noise.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 6.3; Pintelon & Schoukens,
/// *System Identification: A Frequency Domain Approach*, the chapter on estimation with known noise
/// models (weighted generalized total least squares, bootstrapped).
fn total_least_squares(triangle: &DMatrix<f64>, noise: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let lower = triangle.transpose();
    let half = lower.solve_lower_triangular(noise)?;
    let ratio = lower.solve_lower_triangular(&half.transpose())?;
    let eigen = hermitian_eigen(ratio).ok()?;
    let most = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    let solution = triangle.solve_upper_triangular(&most)?;
    let last = triangle.ncols() - 1;
    Some(DMatrix::from_fn(last, 1, |at, _| -solution[at] / solution[last]))
}
