//! Eight or twelve coefficients of a film, after subtraction of the baseline.

use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::{
    LikelihoodRatio, OutputErrorFit, likelihood_ratio, output_error,
};
use mechid_model::{Matrix, Parameter};
use mechid_numerics::NumericsError;
use nalgebra::{DMatrix, DVector, Matrix2};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::checks::excess;
use super::selection::{conditional_interval, gap};
use super::{BearingData, Coefficients};
use crate::AnalysisError;

/// Significance level of the test of the inertia of the fluid.
const SIGNIFICANCE: f64 = 0.05;

/// Number of coefficients of each matrix.
const EACH: usize = 4;

/// Names of the coefficients, in the order of every covariance.
pub(super) const NAMED: [&str; 3 * EACH] =
    ["kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy", "mxx", "mxy", "myx", "myy"];

/// Coefficients of a film with their covariance, in the order kxx, kxy, kyx, kyy, cxx, …, cyy, mxx,
/// …, myy.
#[derive(Debug, Clone)]
pub(super) struct Film {
    /// Coefficients, 12 or 8.
    values: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Likelihood-ratio test of the hypothesis that the mass coefficients M of the film are zero.
    pub inertia: Option<LikelihoodRatio>,
    /// All twelve coefficients of the rig before the baseline is subtracted, for the dynamic
    /// stiffness line by line.
    pub rig: DVector<f64>,
    /// All twelve coefficients of the baseline, with their covariance.
    pub baseline: Option<(DVector<f64>, DMatrix<f64>)>,
    /// Fit of the tests, for the checks of the result.
    pub fit: OutputErrorFit,
    /// Fit of the baseline tests, for the checks of the result.
    pub baseline_fit: Option<OutputErrorFit>,
    /// Ratio of residual power to noise power if the residual is significantly larger, otherwise 1;
    /// all variances are multiplied by it.
    pub excess: f64,
    /// Critical value of the statistic of the test of M = 0; `None` if the test did not choose the
    /// model with twelve coefficients.
    critical: Option<f64>,
    pub degrees_of_freedom: usize,
}

impl Film {
    pub fn new(
        tests: &BearingData,
        baseline: Option<&BearingData>,
        coefficients: Coefficients,
    ) -> Result<Self, AnalysisError> {
        let rig = Fitted::new(tests)?;
        let base = baseline.map(Fitted::new).transpose()?;
        let (values, covariance) = rig.minus(base.as_ref());
        let fits = std::iter::once(&rig).chain(&base);
        let freedoms = fits.map(|fitted| fitted.full.estimate.degrees_of_freedom());
        let degrees_of_freedom = freedoms.min().unwrap_or(0);
        let mut film = Self {
            values,
            covariance,
            inertia: None,
            rig: rig.values.clone(),
            baseline: base.as_ref().map(|base| (base.values.clone(), base.covariance.clone())),
            fit: rig.full.clone(),
            baseline_fit: base.as_ref().map(|base| base.full.clone()),
            excess: 1.0,
            critical: None,
            degrees_of_freedom,
        };
        let before_choice = film.excess_of(tests, baseline)?;
        let common = rig.common_mass(base.as_ref())?;
        let reduced = rig.with_mass(tests, &common)?;
        let reduced_base = match (baseline, &base) {
            (Some(data), Some(base)) => Some(base.with_mass(data, &common)?),
            _ => None,
        };
        let mut pairs = vec![(&rig.full, &reduced)];
        if let (Some(base), Some(reduced)) = (&base, &reduced_base) {
            pairs.push((&base.full, reduced));
        }
        let fisher = FisherSnedecor::new(EACH as f64, degrees_of_freedom.max(1) as f64).ok();
        film.inertia = likelihood_ratio(&pairs, EACH);
        let eight = match coefficients {
            Coefficients::Eight => true,
            Coefficients::Twelve => false,
            Coefficients::Automatic => film.inertia.is_some_and(|t| t.p_value >= SIGNIFICANCE),
        };
        if !eight {
            let chosen = coefficients == Coefficients::Automatic && film.inertia.is_some();
            film.critical = fisher
                .filter(|_| chosen)
                // `widen` multiplies the covariance by `before_choice`, which divides the statistic
                // by the same factor. The critical value is therefore also divided by this factor.
                .map(|fisher| EACH as f64 * fisher.inverse_cdf(1.0 - SIGNIFICANCE) / before_choice);
            film.widen(before_choice);
            return Ok(film);
        }
        film.replace_by_eight(reduced, reduced_base, &common)?;
        if base.is_none() {
            film.fit = rig.with_mass(tests, &rig.least_mass())?;
        }
        let excess = film.excess_of(tests, baseline)?;
        film.widen(excess);
        Ok(film)
    }

    /// Replaces the coefficients by the eight of K and C from the fits `rig` and `baseline`. In
    /// both fits the mass is known: `common`.
    fn replace_by_eight(
        &mut self,
        rig: OutputErrorFit,
        baseline: Option<OutputErrorFit>,
        common: &Matrix2<f64>,
    ) -> Result<(), AnalysisError> {
        let eight = 2 * EACH;
        let (rig_values, rig_covariance) = in_order(&rig, common);
        self.values = rig_values.rows(0, eight).into_owned();
        self.covariance = match &baseline {
            None => rig_covariance.view((0, 0), (eight, eight)).into_owned(),
            // The common mass is an estimate, and its uncertainty contributes to this covariance.
            Some(_) => without_mass(&self.covariance)?,
        };
        self.rig = rig_values;
        if let Some(fit) = &baseline {
            let values = in_order(fit, common).0;
            self.values -= values.rows(0, eight);
            if let Some((baseline_values, _)) = &mut self.baseline {
                *baseline_values = values;
            }
        }
        self.fit = rig;
        self.baseline_fit = baseline;
        Ok(())
    }

    /// Returns the larger of two ratios: the [`excess`] of the tests and the [`excess`] of the
    /// baseline tests.
    fn excess_of(
        &self,
        tests: &BearingData,
        baseline: Option<&BearingData>,
    ) -> Result<f64, AnalysisError> {
        let of_tests = excess(tests, &self.fit)?;
        match baseline.zip(self.baseline_fit.as_ref()) {
            Some((baseline, fit)) => Ok(of_tests.max(excess(baseline, fit)?)),
            None => Ok(of_tests),
        }
    }

    /// Multiplies all variances by the ratio of residual power to noise power.
    ///
    /// # Source
    /// Birge (1932), Physical Review 40, 207–227.
    fn widen(&mut self, excess: f64) {
        self.excess = excess;
        self.covariance *= excess;
        if let Some((_, covariance)) = &mut self.baseline {
            *covariance *= excess;
        }
    }

    /// Returns the interval of a coefficient at a level, given that the test chose the model with
    /// twelve coefficients. `None` if the test did not choose this model, or if its choice does not
    /// depend on the coefficient.
    pub fn interval_after_choice(&self, at: usize, level: f64) -> Option<[f64; 2]> {
        let masses = 2 * EACH..3 * EACH;
        let gap = gap(&self.values, &self.covariance, at, masses, self.critical?)?;
        let estimate = [self.values[at], self.covariance[(at, at)].sqrt()];
        conditional_interval(estimate, self.degrees_of_freedom, gap, level)
    }

    /// Returns K, C or M, 2×2; M is zero if it was not identified.
    pub fn matrix(&self, kind: usize) -> Matrix2<f64> {
        let at = kind * EACH;
        match self.values.as_slice().get(at..at + EACH) {
            Some(entries) => Matrix2::from_row_slice(entries),
            None => Matrix2::zeros(),
        }
    }

    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    pub fn values(&self) -> &[f64] {
        self.values.as_slice()
    }
}

/// Fit of twelve coefficients to the tests of one condition of the rig.
struct Fitted {
    full: OutputErrorFit,
    values: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Fitted {
    fn new(data: &BearingData) -> Result<Self, AnalysisError> {
        let full = output_error(&data.data, &Unknowns::unknown_mass(2)?)?;
        let (values, covariance) = in_order(&full, &Matrix2::zeros());
        Ok(Self { full, values, covariance })
    }

    /// Returns the fit with a known M.
    fn with_mass(
        &self,
        data: &BearingData,
        mass: &Matrix2<f64>,
    ) -> Result<OutputErrorFit, AnalysisError> {
        let mass = DMatrix::from_column_slice(2, 2, mass.as_slice());
        Ok(output_error(&data.data, &Unknowns::known_mass(&mass)?)?)
    }

    /// Returns the coefficients minus those of the baseline, and the sum of both covariances.
    fn minus(&self, base: Option<&Self>) -> (DVector<f64>, DMatrix<f64>) {
        match base {
            None => (self.values.clone(), self.covariance.clone()),
            Some(base) => (&self.values - &base.values, &self.covariance + &base.covariance),
        }
    }

    /// Returns a mass too small to change the fit: the checks of a fit need an invertible mass
    /// matrix.
    fn least_mass(&self) -> Matrix2<f64> {
        let least = self.values.rows(EACH, EACH).amax() * f64::EPSILON * f64::EPSILON;
        Matrix2::from_diagonal_element(least)
    }

    /// Returns the estimate of M from both rig and baseline, which have the same M if the film has
    /// no inertia; zero without a baseline.
    fn common_mass(&self, base: Option<&Self>) -> Result<Matrix2<f64>, AnalysisError> {
        let Some(base) = base else { return Ok(Matrix2::zeros()) };
        let mass = |fitted: &Self| {
            let at = 2 * EACH;
            let covariance = fitted.covariance.view((at, at), (EACH, EACH)).into_owned();
            (fitted.values.rows(at, EACH).into_owned(), covariance)
        };
        let ((rig, of_rig), (base, of_base)) = (mass(self), mass(base));
        let total = solve(
            &(&of_rig + of_base),
            &DMatrix::from_column_slice(EACH, 1, (&rig - base).as_slice()),
        )?;
        let mean = rig - of_rig * total.column(0);
        Ok(Matrix2::from_row_slice(mean.as_slice()))
    }
}

/// Returns the covariance of the coefficients of K and C, conditional on M = 0.
///
/// # Source
/// The conditional normal distribution: Anderson, *An Introduction to Multivariate Statistical
/// Analysis*, 3rd ed. (2003), section 2.5.
fn without_mass(all: &DMatrix<f64>) -> Result<DMatrix<f64>, AnalysisError> {
    let eight = 2 * EACH;
    let cross = all.view((eight, 0), (EACH, eight)).into_owned();
    let mass = all.view((eight, eight), (EACH, EACH)).into_owned();
    let explained = cross.transpose() * solve(&mass, &cross)?;
    Ok(all.view((0, 0), (eight, eight)) - explained)
}

/// Returns A⁻¹B for a covariance A with entries of different units.
fn solve(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<DMatrix<f64>, AnalysisError> {
    let scale = a.diagonal().map(|v| if v > 0.0 { v.sqrt().recip() } else { 1.0 });
    let scaling = DMatrix::from_diagonal(&scale);
    let solution = (&scaling * a * &scaling).lu().solve(&(&scaling * b));
    Ok(&scaling * solution.ok_or(NumericsError::Overflow)?)
}

fn row_by_row(matrix: &Matrix2<f64>) -> [f64; EACH] {
    [matrix[(0, 0)], matrix[(0, 1)], matrix[(1, 0)], matrix[(1, 1)]]
}

/// Returns the coefficients of a fit in the order kxx, kxy, kyx, kyy, cxx, …, cyy, mxx, …, myy,
/// with their covariance. If the fit did not estimate the mass coefficients, they are those of
/// `mass`, with a covariance of zero.
fn in_order(fit: &OutputErrorFit, mass: &Matrix2<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let estimate = &fit.estimate;
    let free: Vec<Parameter> = estimate.parameters().map(|p| p.parameter).collect();
    let index = |p: &Parameter| {
        let kind = match p.matrix() {
            Matrix::Stiffness => 0,
            Matrix::Damping => 1,
            Matrix::Mass => 2,
        };
        EACH * kind + 2 * p.row() + p.column()
    };
    let places: Vec<usize> = free.iter().map(index).collect();
    let mut values = DVector::zeros(3 * EACH);
    values.rows_mut(2 * EACH, EACH).copy_from_slice(&row_by_row(mass));
    let mut covariance = DMatrix::zeros(3 * EACH, 3 * EACH);
    let fitted = estimate.covariance();
    for (from, (p, to)) in estimate.parameters().zip(&places).enumerate() {
        values[*to] = p.value;
        for (other, column) in places.iter().enumerate() {
            covariance[(*to, *column)] = fitted[(from, other)];
        }
    }
    (values, covariance)
}
