//! Difference of measured and modelled displacement, in units of the noise.

#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use mechid_numerics::cholesky::Cholesky;
use mechid_numerics::gauss_newton::SumOfSquares;
use mechid_numerics::{kronecker, time_limit};
use mechid_signal::{Sampling, noise};
use mechid_spectra::transient::{self, TransientLoad, powers};
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use super::line::{Line, lower_factor, noisy_forces};
use super::line_block::{BlockFactors, LineBlock};
use super::normal_equations::{Layout, NormalEquations};
use super::search::Restartable;
use crate::limits::{LINES_AT_ONCE, PASS_OPERATIONS};
use crate::relations::Relations;
use crate::{EstimateError, Unknowns};

type ComplexMatrix = DMatrix<Complex<f64>>;
type ComplexVector = DVector<Complex<f64>>;

/// Covariance of the noise of each row.
enum Noise<'a> {
    /// Exact force; the factor L of the covariance L Lᴴ of the displacement.
    Output(Vec<ComplexMatrix>),
    /// Noise of force and displacement, and the indices of the forces that have noise on at least
    /// one line.
    Both(&'a NoiseSpectrum, Vec<usize>),
}

/// Sum of squares of the weighted errors e = X − G(ω) F of every row, with G = (K + iωC − ω²M)⁻¹.
/// The weight is L⁻¹ with L Lᴴ = E[e eᴴ]: the real and imaginary parts of √2·L⁻¹e have unit
/// variance and no correlation.
///
/// With a noisy force the covariance [I −G] E[z zᴴ] [I −G]ᴴ depends on the parameters; the sum of
/// squares is the likelihood after the true force and displacement of each row have been
/// eliminated.
///
/// The Jacobian of row l has the columns W_l E_ij X̂_l s^p for the entry (i, j) of K, C or M (p =
/// 0, 1, 2), with W = L⁻¹G, s = iω and the matrix E_ij of zeros with a 1 at this entry. X̂ is the
/// displacement under the most likely force F̂. Because F̂ minimises the sum of squares for given
/// parameters, Jᵀr is the gradient of the sum, and JᵀJ is the Fisher information.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the
/// chapter on maximum likelihood in errors-in-variables.
pub(super) struct Misfit<'a> {
    data: &'a FrequencyData,
    unknowns: &'a Unknowns,
    relations: Option<Relations>,
    layout: Layout,
    noise: Noise<'a>,
    /// Forces, n × rows so that the forces of one row are contiguous, minus the transient loads of
    /// the last trial parameters.
    force: ComplexMatrix,
    displacement: ComplexMatrix,
    /// Independent unknowns last accepted.
    at: DVector<f64>,
    /// Independent unknowns of the last trial.
    tried_at: DVector<f64>,
    /// All rows at the parameters last accepted.
    rows: Vec<Line>,
    /// All rows at the parameters of the last trial.
    tried: Vec<Line>,
    /// All lines, block by block.
    blocks: Vec<LineBlock>,
    /// Factors of the Jacobian at the last linearisation, with orthonormal regressors.
    factors: Vec<BlockFactors>,
    /// Weight of each row; 1 except in the restarts of a search.
    shares: Vec<f64>,
}

impl<'a> Misfit<'a> {
    /// # Errors
    /// [`EstimateError::SingularNoise`] if the force is exact, and either a displacement has no
    /// noise or two displacements have the same noise.
    pub(super) fn new(
        data: &'a FrequencyData,
        unknowns: &'a Unknowns,
        noise: &'a NoiseSpectrum,
    ) -> Result<Self, EstimateError> {
        let noise = if noise.has_force() {
            let forces = (0..data.len()).flat_map(|row| noisy_forces(noise.covariance(row)));
            Noise::Both(noise, BTreeSet::from_iter(forces).into_iter().collect())
        } else {
            Noise::Output(output_weights(noise)?)
        };
        let rows = vec![Line::new(data.dof()); data.len()];
        let layout = Layout::new(unknowns, data.transient().ncols());
        // Each spectral line belongs to one record; only the transient of this record is nonzero on
        // the line.
        let is_used = |line: usize, at: usize| match layout.columns()[at].1.checked_sub(data.dof())
        {
            None => true,
            Some(column) => data.transient()[(line, column)] != Complex::ZERO,
        };
        Ok(Self {
            blocks: LineBlock::all(data.len(), layout.columns().len(), is_used),
            factors: Vec::new(),
            data,
            unknowns,
            relations: Relations::from_unknowns(unknowns),
            layout,
            noise,
            force: data.force().transpose(),
            displacement: data.displacement().transpose(),
            at: DVector::zeros(0),
            tried_at: DVector::zeros(0),
            tried: rows.clone(),
            rows,
            shares: vec![1.0; data.len()],
        })
    }

    /// Returns X − G F, rows × n, at the parameters last accepted.
    pub(super) fn errors(&self) -> ComplexMatrix {
        let mut errors = self.displacement.clone();
        for (mut error, row) in errors.column_iter_mut().zip(&self.rows) {
            error -= row.displacement();
        }
        errors.transpose()
    }

    /// Returns the variance of the displacement due to the stated noise of the forces, rows × n, in
    /// m²: the diagonal of G S_FF Gᴴ at the parameters last accepted.
    pub(super) fn variance_by_force(&self) -> DMatrix<f64> {
        let of_force = self.data.force_variance();
        DMatrix::from_fn(self.rows.len(), self.data.dof(), |row, channel| {
            let gain = self.rows[row].receptance().row(channel).map(|g| g.norm_sqr());
            gain.iter().zip(of_force.row(row).iter()).map(|(gain, variance)| gain * variance).sum()
        })
    }

    /// Returns Σ |G|² of each channel over the forces, rows × n, in (m/N)², at the parameters last
    /// accepted: the power of the displacement under independent forces of equal power.
    pub(super) fn gain(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.rows.len(), self.data.dof(), |row, channel| {
            self.rows[row].receptance().row(channel).iter().map(|g| g.norm_sqr()).sum()
        })
    }

    /// Returns L⁻¹(X − G F), rows × n, at the parameters last accepted.
    pub(super) fn white(&self) -> ComplexMatrix {
        let rows: Vec<_> = self.rows.iter().map(|row| row.white().transpose()).collect();
        DMatrix::from_rows(&rows)
    }

    /// Returns the derivatives of the matrix entries and transient loads with respect to the
    /// independent unknowns, at the values last accepted; `None` if no relations between entries
    /// are given.
    fn tangent(&self) -> Option<DMatrix<f64>> {
        let relations = self.relations.as_ref()?;
        let ends = transient::len(self.data);
        let tangent = relations.tangent(self.at.rows(0, self.at.len() - ends).as_slice());
        let (entries, unknowns) = tangent.shape();
        let mut extended = tangent.resize(entries + ends, unknowns + ends, 0.0);
        extended.view_mut((entries, unknowns), (ends, ends)).fill_with_identity();
        Some(extended)
    }

    /// Counts the operations of one pass over all rows, with this number of products of n × n
    /// matrices for each row.
    fn spend(&self, products: usize) {
        let n = self.data.dof() as f64;
        let of_row = PASS_OPERATIONS + products as f64 * n.powi(3);
        time_limit::spend(self.data.len() as f64 * of_row);
    }

    fn evaluate(&mut self, theta: &DVector<f64>) -> Option<f64> {
        self.spend(10);
        let (unknowns, tau) = theta.as_slice().split_at(theta.len() - transient::len(self.data));
        let matrices = match &self.relations {
            None => self.unknowns.assemble(unknowns),
            Some(relations) => self.unknowns.assemble(relations.entries(unknowns).as_slice()),
        };
        if !tau.is_empty() {
            let ends = TransientLoad::new(self.data, tau);
            self.data.force().transpose_to(&mut self.force);
            ends.subtract_from(&mut self.force);
        }
        let Self { data, noise, force, displacement, shares, tried, .. } = self;
        let costs =
            tried.par_iter_mut().with_min_len(LINES_AT_ONCE).enumerate().map(|(at, row)| {
                let (force, displacement) = (force.column(at), displacement.column(at));
                let exists = row.model(&matrices, data.omega()[at], force.iter())
                    && match &*noise {
                        Noise::Output(lower) => row.whiten(displacement.iter(), &lower[at]),
                        Noise::Both(noise, noisy) => {
                            row.whiten_both(displacement.iter(), noise.covariance(at), noisy)
                        }
                    };
                row.scale(shares[at].sqrt());
                exists.then(|| 2.0 * row.white().norm_squared())
            });
        // The sum has the same order for any number of threads.
        let costs: Vec<Option<f64>> = costs.collect();
        let cost: f64 = costs.into_iter().sum::<Option<f64>>()?;
        cost.is_finite().then_some(cost)
    }

    /// Returns, block by block, the regressors φ, the weights WᴴW and the weighted residuals Wᴴr.
    /// `displacement` gives the displacement in φ for a row and a channel.
    fn factors(
        &self,
        displacement: impl Fn(usize, usize) -> Complex<f64> + Sync,
    ) -> Vec<BlockFactors> {
        self.spend(3 * self.data.dof());
        self.blocks.par_iter().map(|block| self.factors_of(block, &displacement)).collect()
    }

    fn factors_of(
        &self,
        block: &LineBlock,
        displacement: &impl Fn(usize, usize) -> Complex<f64>,
    ) -> BlockFactors {
        let (lines, n) = (block.lines.len(), self.data.dof());
        let columns = self.layout.columns();
        let mut regressors = DMatrix::zeros(2 * lines, block.columns.len());
        for (to, column) in block.columns.iter().enumerate() {
            let (matrix, column) = columns[*column];
            for (at, line) in block.lines.clone().enumerate() {
                let x = match column.checked_sub(n) {
                    None => displacement(line, column),
                    Some(column) => self.data.transient()[(line, column)],
                };
                let z = powers(self.data.omega()[line])[matrix as usize] * x;
                (regressors[(at, to)], regressors[(lines + at, to)]) = (z.re, z.im);
            }
        }
        let mut weights = DMatrix::zeros(lines, n * n);
        for (at, row) in self.rows[block.lines.clone()].iter().enumerate() {
            let white = row.white_receptance();
            for j in 0..n {
                for i in 0..=j {
                    let z = white.column(i).dotc(&white.column(j));
                    weights[(at, kronecker::real_part(i, j))] = z.re;
                    if i < j {
                        weights[(at, kronecker::imaginary_part(i, j, n))] = z.im;
                    }
                }
            }
        }
        let residuals = self.weighted(block, |line| self.rows[line].white().clone());
        BlockFactors { block: block.clone(), regressors, weights, residuals }
    }

    /// Returns Wᴴy of the lines of a block, 2·lines × n, real parts first.
    fn weighted(&self, block: &LineBlock, y: impl Fn(usize) -> ComplexVector) -> DMatrix<f64> {
        let lines = block.lines.len();
        let mut weighted = DMatrix::zeros(2 * lines, self.data.dof());
        for (at, line) in block.lines.clone().enumerate() {
            let y = y(line);
            for (i, column) in self.rows[line].white_receptance().column_iter().enumerate() {
                let z = column.dotc(&y);
                (weighted[(at, i)], weighted[(lines + at, i)]) = (z.re, z.im);
            }
        }
        weighted
    }
}

impl SumOfSquares for Misfit<'_> {
    type Linearisation = NormalEquations;

    fn try_at(&mut self, theta: &DVector<f64>) -> Option<f64> {
        self.tried_at.clone_from(theta);
        self.evaluate(theta)
    }

    fn accept(&mut self) {
        std::mem::swap(&mut self.at, &mut self.tried_at);
        std::mem::swap(&mut self.rows, &mut self.tried);
    }

    fn linearise(&mut self) -> Option<NormalEquations> {
        let mut factors = self.factors(|at, column| self.rows[at].likely_displacement()[column]);
        let equations = self.layout.normal_equations(&mut factors, self.tangent().as_ref());
        self.factors = factors;
        equations
    }

    /// Returns Jᵀr″, where r″ = −2 W dD G dD X̂ is the second derivative of the residuals along the
    /// change dD of the dynamic stiffness. The result neglects the curvature of the weights of a
    /// noisy force, and of the entries of proportional damping.
    fn curvature(
        &self,
        linearisation: &NormalEquations,
        step: &DVector<f64>,
    ) -> Option<DVector<f64>> {
        self.spend(10);
        let step = match self.tangent() {
            None => step.clone(),
            Some(tangent) => tangent * step,
        };
        let (entries, tau) = step.as_slice().split_at(step.len() - transient::len(self.data));
        let zero = self.unknowns.assemble(&vec![0.0; entries.len()]);
        let moved = self.unknowns.assemble(entries);
        let [m, c, k] = [0, 1, 2].map(|at| &moved[at] - &zero[at]);
        let mut without_ends = DMatrix::zeros(self.data.dof(), self.data.len());
        TransientLoad::new(self.data, tau).subtract_from(&mut without_ends);
        let second = |line: usize| {
            let (row, omega) = (&self.rows[line], self.data.omega()[line]);
            let change =
                k.zip_zip_map(&c, &m, |k, c, m| Complex::new(k - omega * omega * m, omega * c));
            let load = &change * row.likely_displacement() - without_ends.column(line);
            let second = &change * (row.receptance() * load);
            row.white_receptance() * second * Complex::from(-2.0)
        };
        let weighted: Vec<DMatrix<f64>> =
            self.factors.par_iter().map(|of| self.weighted(&of.block, second)).collect();
        Some(linearisation.coordinates.project(self.factors.iter().zip(&weighted)))
    }
}

impl Restartable for Misfit<'_> {
    /// Returns the step to the minimum of |W (D X − F)|², where D is the dynamic stiffness and W is
    /// kept fixed: the Gauss–Newton equations with the measured X instead of X̂.
    fn linear_step(&mut self) -> Option<DVector<f64>> {
        let mut factors = self.factors(|at, column| self.displacement[(column, at)]);
        let NormalEquations { gram, gradient, coordinates } =
            self.layout.normal_equations(&mut factors, self.tangent().as_ref())?;
        Some(coordinates.unknowns(&-Cholesky::new(&gram, 0.0)?.solve(&gradient)))
    }

    fn resample(&mut self, seed: Option<u64>) {
        self.shares.fill(1.0);
        let drawn = seed.and_then(|seed| {
            let rows = Sampling::new(1.0, self.shares.len()).ok()?;
            noise::white(rows, 2, 1.0, seed).ok()
        });
        // The share of a row is (|z|²/2)²/2 for a complex normal number z whose real and imaginary
        // parts have unit variance. Then |z|²/2 has an exponential distribution, and the mean share
        // is 1.
        for (share, pair) in
            self.shares.iter_mut().zip(drawn.iter().flat_map(|d| d.data().row_iter()))
        {
            *share = 0.125 * pair.norm_squared().powi(2);
        }
    }
}

/// Returns the factor L of the displacement block of every covariance.
fn output_weights(noise: &NoiseSpectrum) -> Result<Vec<ComplexMatrix>, EstimateError> {
    let n = noise.dof();
    noise
        .omega()
        .iter()
        .enumerate()
        .map(|(row, &omega)| {
            let covariance = noise.covariance(row).view((0, 0), (n, n)).into_owned();
            lower_factor(covariance)
                .ok_or(EstimateError::SingularNoise { frequency_hz: omega / std::f64::consts::TAU })
        })
        .collect()
}
