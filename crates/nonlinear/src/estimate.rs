//! The result of an identification of a nonlinear system.

use std::fmt;

use mechid_estimate::{Estimate, EstimateError};
use mechid_model::{Matrix, NonlinearParameter, NonlinearSystem, Terms, UncertainNonlinearSystem};
use mechid_numerics::{Uncertain, check_size};
use nalgebra::{DMatrix, DVector};

use super::{ChannelPhase, Misfit, Weighting};

/// Parameter with its name and unit.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedParameter {
    /// Name: `m`, `k12`, the name of a term, `c3.b` for the constant b of the term `c3`, `delay`,
    /// `p3` or `p5`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value and standard error, in `unit`.
    pub estimate: Uncertain,
}

/// Origin of the standard errors of an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StandardErrors {
    /// Noise of force and response, estimated from the scatter of the periods; the number is the
    /// total of the periods of all records. The standard errors are valid for noise of any
    /// spectrum, if the residual does not exceed this noise.
    Periods(usize),
    /// Scatter of the scores over this number of blocks of time. The standard errors are valid for
    /// a residual of any spectrum, even if the model does not explain a part of the response.
    Blocks(usize),
    /// White noise on the samples of force and response; its variances are estimated from the
    /// residual. The standard errors are valid if the residual is consistent with this noise.
    Noise,
    /// Size of the weighted residual. The residual is assumed to be white, because the record is
    /// too short for blocks.
    White,
}

/// Identified nonlinear system with the covariance of all its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct NonlinearEstimate {
    pub(super) linear: Estimate,
    pub(super) terms: Terms,
    pub(super) coefficients: Vec<f64>,
    pub(super) parameters: Vec<NamedParameter>,
    pub(super) covariance: DMatrix<f64>,
    pub(super) channels: ChannelPhase,
    pub(super) weighting: Weighting,
    pub(super) standard_errors: StandardErrors,
    pub(super) misfit: Option<Misfit>,
    /// Bias of the parameters due to noise in their regressors, estimated from several periods.
    pub(super) bias: DVector<f64>,
    pub(super) unexplained: Vec<f64>,
    pub(super) ranges: Vec<[f64; 2]>,
    pub(super) equations: usize,
}

impl NonlinearEstimate {
    /// Creates a linear system with terms whose coefficients are zero, as the initial estimate of a
    /// search.
    pub(super) fn without_force(linear: &Estimate, terms: &Terms) -> Result<Self, EstimateError> {
        terms.check_dof(linear.dof())?;
        linear.unknowns().check_unrelated("a fit with nonlinear terms")?;
        Ok(Self {
            linear: linear.clone(),
            terms: terms.clone(),
            coefficients: vec![0.0; terms.len()],
            parameters: Vec::new(),
            covariance: DMatrix::zeros(0, 0),
            channels: ChannelPhase::default(),
            weighting: Weighting::default(),
            standard_errors: StandardErrors::White,
            misfit: None,
            bias: DVector::zeros(0),
            unexplained: Vec::new(),
            ranges: Vec::new(),
            equations: 0,
        })
    }

    /// Returns the linear part: M̂, Ĉ, K̂ with their covariance. Its modes are the modes for small
    /// amplitudes, unless a term has a slope at rest.
    pub fn linear(&self) -> &Estimate {
        &self.linear
    }

    /// Returns the identified system.
    ///
    /// # Errors
    /// [`EstimateError::Model`] if M̂ is singular.
    pub fn system(&self) -> Result<NonlinearSystem, EstimateError> {
        let (linear, terms) = (self.linear.system()?, self.terms.clone());
        Ok(NonlinearSystem::new(linear, terms, self.coefficients.clone())?)
    }

    /// Returns the identified system with the covariance of its parameters, without delay and phase
    /// of the channels.
    ///
    /// # Errors
    /// [`EstimateError::Model`] if M̂ is singular, or the covariance is not finite.
    pub fn uncertain_system(&self) -> Result<UncertainNonlinearSystem, EstimateError> {
        let system = self.system()?;
        let named = self.parameters.iter().enumerate();
        let (indices, parameters): (Vec<usize>, Vec<NonlinearParameter>) = named
            .filter_map(|(at, p)| Some((at, NonlinearParameter::named(&p.name, &system).ok()?)))
            .unzip();
        let covariance = self.covariance.select_rows(&indices).select_columns(&indices);
        Ok(UncertainNonlinearSystem::new(system, parameters, covariance)?)
    }

    /// Returns the terms, with the estimated constants in their laws.
    pub fn terms(&self) -> &Terms {
        &self.terms
    }

    /// Returns every estimated parameter: free entries of M, C and K, coefficients of terms, and
    /// nonlinear constants.
    pub fn parameters(&self) -> &[NamedParameter] {
        &self.parameters
    }

    /// Returns one parameter by its name.
    ///
    /// # Errors
    /// [`EstimateError::NoSuchParameter`].
    pub fn parameter(&self, name: &str) -> Result<&NamedParameter, EstimateError> {
        self.parameters.iter().find(|parameter| parameter.name == name).ok_or_else(|| {
            let known: Vec<&str> = self.parameters.iter().map(|p| p.name.as_str()).collect();
            EstimateError::NoSuchParameter { name: name.to_owned(), known: known.join(", ") }
        })
    }

    /// Returns the covariance of the parameters, in the products of their units.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// Returns delay and phase of the channels; zero unless they were estimated.
    pub fn channels(&self) -> ChannelPhase {
        self.channels
    }

    /// Returns the weighting of the rows.
    pub fn weighting(&self) -> Weighting {
        self.weighting
    }

    /// Returns the origin of the standard errors.
    pub fn standard_errors(&self) -> StandardErrors {
        self.standard_errors
    }

    /// Returns the comparison of the residual of the mean period with the noise of the periods;
    /// `None` for open records and single periods.
    pub fn misfit(&self) -> Option<Misfit> {
        self.misfit
    }

    /// Returns, for each degree of freedom, the fraction (RMS) of the response that the model does
    /// not explain. For a fit of lines, the unexplained part is the response of the linear part to
    /// the equation error; for a fit in time, it is the residual.
    pub fn unexplained(&self) -> &[f64] {
        &self.unexplained
    }

    /// Returns, for each term, the largest displacement (m) and velocity (m/s) of its coordinate in
    /// the data. For larger motions the term is an extrapolation.
    pub fn ranges(&self) -> &[[f64; 2]] {
        &self.ranges
    }

    /// Returns the restoring force C ẋ + K x + Σ θ f (N, one for each degree of freedom) at a
    /// displacement (m) and velocity (m/s), with the standard error from the covariance of the
    /// parameters (constants inside the laws count as known).
    ///
    /// The data determine a polynomial only within [`NonlinearEstimate::ranges`]. Outside these
    /// ranges the standard error grows; it shows how far the force can be extrapolated.
    ///
    /// # Errors
    /// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) unless there is one
    /// displacement and one velocity for each degree of freedom.
    ///
    /// # Source
    /// Worden & Tomlinson, *Nonlinearity in Structural Dynamics* (2001), chapter 7 (restoring force
    /// surfaces).
    pub fn restoring_force(
        &self,
        displacement: &[f64],
        velocity: &[f64],
    ) -> Result<Vec<Uncertain>, EstimateError> {
        let n = self.linear.dof();
        check_size("displacements", n, displacement.len())?;
        check_size("velocities", n, velocity.len())?;
        let free = self.linear.unknowns().free();
        let matrices = [self.linear.damping(), self.linear.stiffness()];
        let force_of = |dof: usize| {
            let linear = |column: usize| {
                matrices[0][(dof, column)] * velocity[column]
                    + matrices[1][(dof, column)] * displacement[column]
            };
            let mut value: f64 = (0..n).map(linear).sum();
            let mut slope = DVector::zeros(self.parameters.len());
            for (at, entry) in free.iter().enumerate().filter(|(_, entry)| entry.row() == dof) {
                slope[at] = match entry.matrix() {
                    Matrix::Mass => 0.0,
                    Matrix::Damping => velocity[entry.column()],
                    Matrix::Stiffness => displacement[entry.column()],
                };
            }
            for (at, (term, coefficient)) in self.terms.iter().zip(&self.coefficients).enumerate() {
                let force = term.coordinate().sign(dof) * term.value(displacement, velocity);
                value += coefficient * force;
                slope[free.len() + at] = force;
            }
            let variance = slope.dot(&(&self.covariance * &slope));
            let degrees_of_freedom = self.linear.degrees_of_freedom();
            Uncertain { value, standard_error: variance.max(0.0).sqrt(), degrees_of_freedom }
        };
        Ok((0..n).map(force_of).collect())
    }

    /// Returns the estimate with a mean square error added to its covariance. Both are parameters ×
    /// parameters, in the products of the units of [`NonlinearEstimate::parameters`].
    ///
    /// # Errors
    /// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) for another number of
    /// parameters.
    pub fn with_mean_square(
        mut self,
        mean_square_error: &DMatrix<f64>,
    ) -> Result<Self, EstimateError> {
        check_size("parameters", self.parameters.len(), mean_square_error.nrows())?;
        self.covariance += mean_square_error;
        for (at, parameter) in self.parameters.iter_mut().enumerate() {
            parameter.estimate.standard_error = self.covariance[(at, at)].sqrt();
        }
        let free = self.linear.unknowns().free().len();
        let of_linear = mean_square_error.view((0, 0), (free, free)).into_owned();
        self.linear = self.linear.with_mean_square(&of_linear)?;
        Ok(self)
    }

    /// Returns the number of real equations of the fit.
    pub fn equations(&self) -> usize {
        self.equations
    }
}

impl fmt::Display for NamedParameter {
    /// Writes `k3 = 3.951e0 ± 1.7e-3 N/m³`; the number after ± is one standard error.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit, Uncertain { value, standard_error, .. }) =
            (&self.name, &self.unit, self.estimate);
        write!(f, "{name} = {value:.6e} ± {standard_error:.1e} {unit}")
    }
}

impl fmt::Display for NonlinearEstimate {
    /// Writes one parameter per line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.parameters.iter().try_for_each(|parameter| writeln!(f, "{parameter}"))
    }
}
