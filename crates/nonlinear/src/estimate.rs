//! The result of an identification of a nonlinear system.

use std::fmt;

use mechid_estimate::{Estimate, EstimateError};
use mechid_model::{Matrix, NonlinearParameter, NonlinearSystem, Terms, UncertainNonlinearSystem};
use mechid_numerics::{Uncertain, check_size};
use nalgebra::{DMatrix, DVector};

use super::{ChannelPhase, Misfit, Weighting};

/// A parameter with its name and unit.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedParameter {
    /// `m`, `k12`, the name of a term, `c3.b` for the constant b inside a term, `delay`, `p3` or `p5`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value and standard error, in this unit.
    pub estimate: Uncertain,
}

/// Origin of the standard errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StandardErrors {
    /// Noise of force and response as this many periods of all records show it: the errors hold for noise of any
    /// colour, and for a residual that is no more than that noise.
    Periods(usize),
    /// Scatter of the scores over this many blocks of time: the errors hold for a residual of any
    /// colour, and where the model misses part of the response.
    Blocks(usize),
    /// Size of the weighted residual, taken as white: the record is too short for blocks.
    White,
}

/// An identified nonlinear system with the covariance of all its parameters.
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
    /// Bias of the parameters by noise in their regressors, as several periods show it.
    pub(super) bias: DVector<f64>,
    pub(super) unexplained: Vec<f64>,
    pub(super) ranges: Vec<[f64; 2]>,
    pub(super) equations: usize,
}

impl NonlinearEstimate {
    /// A linear system with terms whose coefficients are zero: the start of a search.
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

    /// The linear part: M̂, Ĉ, K̂ with their covariance. Its modes are those of small amplitudes, apart from
    /// terms with a slope at rest.
    pub fn linear(&self) -> &Estimate {
        &self.linear
    }

    /// The identified system.
    ///
    /// # Errors
    /// [`EstimateError::Model`] if M̂ is singular.
    pub fn system(&self) -> Result<NonlinearSystem, EstimateError> {
        let (linear, terms) = (self.linear.system()?, self.terms.clone());
        Ok(NonlinearSystem::new(linear, terms, self.coefficients.clone())?)
    }

    /// The identified system with the covariance of its parameters; delay and phase of the channels
    /// are none of them.
    ///
    /// # Errors
    /// [`EstimateError::Model`] if M̂ is singular, or the covariance is not finite.
    pub fn uncertain_system(&self) -> Result<UncertainNonlinearSystem, EstimateError> {
        let system = self.system()?;
        let named = self.parameters.iter().enumerate();
        let (places, parameters): (Vec<usize>, Vec<NonlinearParameter>) = named
            .filter_map(|(at, p)| Some((at, NonlinearParameter::named(&p.name, &system).ok()?)))
            .unzip();
        let covariance = self.covariance.select_rows(&places).select_columns(&places);
        Ok(UncertainNonlinearSystem::new(system, parameters, covariance)?)
    }

    /// The terms, with the constants found inside them.
    pub fn terms(&self) -> &Terms {
        &self.terms
    }

    /// Returns every parameter estimated: free entries of M, C and K, coefficients of terms, shape constants.
    pub fn parameters(&self) -> &[NamedParameter] {
        &self.parameters
    }

    /// One parameter by its name, in its unit.
    ///
    /// # Errors
    /// [`EstimateError::NoSuchParameter`].
    pub fn parameter(&self, name: &str) -> Result<&NamedParameter, EstimateError> {
        self.parameters.iter().find(|parameter| parameter.name == name).ok_or_else(|| {
            let known: Vec<&str> = self.parameters.iter().map(|p| p.name.as_str()).collect();
            EstimateError::NoSuchParameter { name: name.to_owned(), known: known.join(", ") }
        })
    }

    /// Covariance of the parameters, one row and column for each, in the products of their units.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// Delay and phase of the channels; zero unless they were estimated.
    pub fn channels(&self) -> ChannelPhase {
        self.channels
    }

    /// The weighting of the rows that was used.
    pub fn weighting(&self) -> Weighting {
        self.weighting
    }

    /// Returns the origin of the standard errors.
    pub fn standard_errors(&self) -> StandardErrors {
        self.standard_errors
    }

    /// Returns the residual of the mean periods against the noise that the periods show; `None` of open records and of
    /// single periods.
    pub fn misfit(&self) -> Option<Misfit> {
        self.misfit
    }

    /// Part of each degree of freedom's response (a ratio, one for each) that the model does not
    /// explain: of a fit of lines what the equation error makes of displacement through the linear
    /// part, on these lines; of a fit in time what is left of the record.
    pub fn unexplained(&self) -> &[f64] {
        &self.unexplained
    }

    /// Returns for each term the largest displacement (m) and velocity (m/s) of its coordinate in the data.
    /// Beyond them the term is extrapolated.
    pub fn ranges(&self) -> &[[f64; 2]] {
        &self.ranges
    }

    /// The force (N, one for each degree of freedom) that holds the system at a displacement (m) and
    /// velocity (m/s), C ẋ + K x + Σ θ f, with the standard error that the covariance of its
    /// parameters gives (constants inside the laws are taken as known).
    ///
    /// A polynomial is held by the data within [`NonlinearEstimate::ranges`] only: how the standard
    /// error grows beyond them tells how far it can be extrapolated.
    ///
    /// # Errors
    /// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) unless there is one displacement and one velocity for each degree of
    /// freedom.
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
        let of = |dof: usize| {
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
        Ok((0..n).map(of).collect())
    }

    /// Real equations that were fitted.
    pub fn equations(&self) -> usize {
        self.equations
    }
}

impl fmt::Display for NamedParameter {
    /// `k3 = 3.951e0 ± 1.7e-3 N/m³`, the number after ± being one standard error.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit, Uncertain { value, standard_error, .. }) =
            (&self.name, &self.unit, self.estimate);
        write!(f, "{name} = {value:.6e} ± {standard_error:.1e} {unit}")
    }
}

impl fmt::Display for NonlinearEstimate {
    /// One parameter a line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.parameters.iter().try_for_each(|parameter| writeln!(f, "{parameter}"))
    }
}
