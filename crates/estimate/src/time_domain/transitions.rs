//! Pairs of neighbouring samples from any number of records.

use mechid_model::Discretisation;
use mechid_numerics::triangular::TriangularFactor;
use mechid_numerics::{NumericsError, check_size};
use mechid_signal::Extent;
use mechid_signal::resample::refine;
use mechid_signal::{Interpolation, Record, Sampling};
use nalgebra::{DMatrix, DMatrixView};

use super::TimeDomainFit;
use crate::limits::TRANSITION_BLOCK;
use crate::{EstimateError, Unknowns};

/// Pairs of neighbouring samples, reduced block by block to one small triangular factor.
///
/// Memory does not grow with the records. A long open record can be pushed in pieces that overlap
/// by one sample; records of other experiments can follow.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), chapter 6 (a triangular factor updated
/// by rows).
#[derive(Debug, Clone)]
pub struct Transitions {
    dof: usize,
    dt: f64,
    /// Triangular factor of the columns \[x | ẋ | F | F⁺ | x⁺ − x | ẋ⁺ − ẋ\].
    factor: TriangularFactor,
}

impl Transitions {
    /// Creates transitions without any pair of samples, for records with the time step `dt` (s).
    ///
    /// # Errors
    /// [`EstimateError::NoDof`], [`EstimateError::Signal`] for an invalid time step.
    pub fn new(dof: usize, dt: f64) -> Result<Self, EstimateError> {
        if dof == 0 {
            return Err(EstimateError::NoDof);
        }
        let dt = Sampling::new(dt, 1)?.dt();
        Ok(Self { dof, dt, factor: TriangularFactor::new(dof.saturating_mul(6)) })
    }

    /// Degrees of freedom.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// Time step, in seconds.
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Number of pairs of neighbouring measured samples that have been added.
    pub fn rows(&self) -> usize {
        self.factor.rows()
    }

    /// Adds the pairs of one record: displacement (m), velocity (m/s), force (N).
    ///
    /// # Errors
    /// [`EstimateError::Signal`] if the time axes differ, [`NumericsError::Size`] for a wrong
    /// number of channels, [`EstimateError::Step`] if the time step is not [`Transitions::dt`],
    /// [`NumericsError::Overflow`].
    pub fn push(
        &mut self,
        displacement: &Record,
        velocity: &Record,
        force: &Record,
        extent: Extent,
    ) -> Result<(), EstimateError> {
        check_size("channels of the displacement", self.dof, displacement.channels())?;
        check_size("channels of the velocity", self.dof, velocity.channels())?;
        check_size("channels of the force", self.dof, force.channels())?;
        displacement.check_same_sampling(velocity)?;
        displacement.check_same_sampling(force)?;
        let got = displacement.sampling().dt();
        if (got - self.dt).abs() > 1e-9 * self.dt {
            return Err(EstimateError::Step { expected: self.dt, got });
        }
        let quantities = [displacement, velocity, force].map(|r| r.data().as_view());
        let pairs = match extent {
            Extent::Open => displacement.len() - 1,
            Extent::WholePeriod => displacement.len(),
        };
        let mut block = DMatrix::zeros(TRANSITION_BLOCK, 6 * self.dof);
        for start in (0..pairs).step_by(TRANSITION_BLOCK) {
            let len = TRANSITION_BLOCK.min(pairs - start);
            self.fill(&mut block, quantities, start, len);
            if !self.factor.push(&[block.rows(0, len)]) {
                return Err(NumericsError::Overflow.into());
            }
        }
        Ok(())
    }

    /// Adds the pairs of `other`.
    ///
    /// # Errors
    /// [`NumericsError::Size`], [`EstimateError::Step`], [`NumericsError::Overflow`].
    pub fn merge(&mut self, other: &Self) -> Result<(), EstimateError> {
        check_size("degrees of freedom", self.dof, other.dof)?;
        if (other.dt - self.dt).abs() > 1e-9 * self.dt {
            return Err(EstimateError::Step { expected: self.dt, got: other.dt });
        }
        if self.factor.merge(&other.factor) { Ok(()) } else { Err(NumericsError::Overflow.into()) }
    }

    /// Adds the pairs of one record with `factor − 1` interpolated points in every interval; the
    /// time step of these transitions is `factor` times smaller than the step of the record.
    ///
    /// Band-limited interpolation assumes that the record is one whole period; after any other
    /// interpolation the refined record is open. [`Transitions::rows`] and all standard errors
    /// count the measured intervals, as explained at [`super::TimeDomain::fit_refined`].
    ///
    /// # Errors
    /// As [`Transitions::push`], and [`EstimateError::Signal`] if the record cannot be refined.
    pub fn push_refined(
        &mut self,
        [displacement, velocity, force]: [&Record; 3],
        extent: Extent,
        factor: usize,
        interpolation: Interpolation,
    ) -> Result<(), EstimateError> {
        let finer = |record| refine(record, factor, interpolation);
        let extent = match interpolation {
            Interpolation::BandLimited => extent,
            _ => Extent::Open,
        };
        let before = self.rows();
        self.push(&finer(displacement)?, &finer(velocity)?, &finer(force)?, extent)?;
        self.factor.stand_for(before + (self.rows() - before) / factor);
        Ok(())
    }

    /// Estimates M, C and K from all pairs so far.
    ///
    /// If M is known and C and K are free, the estimates are K̂ = −M A₂₁ and Ĉ = −M A₂₂ from the
    /// lower half of the state matrix A; the free coefficient of the force is not used. Otherwise
    /// the equation of motion is fitted to the accelerations A₂₁x + A₂₂ẋ + B₂F at the samples, with
    /// the known entries fixed. Standard errors follow from the delta method with the derivative of
    /// the matrix logarithm.
    ///
    /// # Errors
    /// [`NumericsError::TooFewRows`], [`NumericsError::Underflow`]; [`NumericsError::NoLogarithm`]
    /// if no continuous-time system has these samples; and as [`crate::EquationOfMotion::solve`].
    ///
    /// # Source
    /// Dissertation eqs. (4.5.12), (4.5.28) with its last rows corrected to Δt/M.
    pub fn fit(
        &self,
        discretisation: Discretisation,
        unknowns: &Unknowns,
    ) -> Result<TimeDomainFit, EstimateError> {
        check_size("degrees of freedom of the unknowns", self.dof, unknowns.dof())?;
        unknowns.check_unrelated("a fit from sample to sample")?;
        TimeDomainFit::new(self, discretisation, unknowns)
    }

    /// Returns the condition number of the scaled regressors (a pure number), and the number of
    /// combinations of coefficients that the regressors do not determine.
    ///
    /// # Errors
    /// As [`Transitions::fit`].
    pub fn condition(&self, discretisation: Discretisation) -> Result<(f64, usize), EstimateError> {
        let solution = super::fit::regression(self, discretisation)?.solution;
        Ok((solution.condition, solution.undetermined.len()))
    }

    /// Returns A of ż = A z + B F, 2n × 2n, in 1/s.
    ///
    /// # Errors
    /// As [`Transitions::fit`].
    pub fn state_matrix(
        &self,
        discretisation: Discretisation,
    ) -> Result<DMatrix<f64>, EstimateError> {
        let change = super::fit::regression(self, discretisation)?.change(self.dof);
        let continuous = super::continuous::Continuous::new(&change, self.dt, discretisation)?;
        Ok(continuous.value.columns(0, 2 * self.dof).into_owned())
    }

    fn fill(
        &self,
        block: &mut DMatrix<f64>,
        quantities: [DMatrixView<'_, f64>; 3],
        start: usize,
        len: usize,
    ) {
        let n = self.dof;
        let samples = quantities[0].nrows();
        for (kind, quantity) in quantities.iter().enumerate() {
            // Columns of the present value and of the next value (force) or increment (state).
            let (now, next) = [(0, 4), (1, 5), (2, 3)][kind];
            for channel in 0..n {
                let values = quantity.column(channel);
                for row in 0..len {
                    let (k, value) = (start + row, values[start + row]);
                    let after = values[(k + 1) % samples];
                    block[(row, now * n + channel)] = value;
                    block[(row, next * n + channel)] =
                        if kind == 2 { after } else { after - value };
                }
            }
        }
    }

    /// Returns an error if the squares of a quantity underflow.
    pub(super) fn check_size(&self) -> Result<(), EstimateError> {
        if self.rows() == 0 {
            return Err(NumericsError::TooFewRows { rows: 0, unknowns: 3 * self.dof }.into());
        }
        match self.factor.too_small() {
            Some((at, norm)) if at < 3 * self.dof => {
                let what = ["displacement", "velocity", "force"][at / self.dof];
                Err(NumericsError::Underflow { what, column: at % self.dof, norm }.into())
            }
            _ => Ok(()),
        }
    }

    /// Returns columns of the triangular factor by kind: 0 x, 1 ẋ, 2 F, 3 F⁺, 4 increments of x, 5
    /// increments of ẋ.
    pub(super) fn columns(&self, kind: usize) -> DMatrixView<'_, f64> {
        self.factor.r().columns(kind * self.dof, self.dof)
    }
}
