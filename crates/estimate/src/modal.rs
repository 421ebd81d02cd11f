//! Natural frequencies, damping ratios and mode shapes of an identified machine, with the standard
//! errors that follow from the covariance of its matrices.

use mechid_model::{
    EIGENVALUE_ROUNDING, Matrix, Mode, Parameter, SecondOrderSystem, UncertainSystem,
};
use mechid_numerics::{NumericsError, Uncertain};
use nalgebra::{Complex, DMatrix, DVector};

use crate::covariance::Covariance;
use crate::limits::{RIGID_BODY_LEVEL, SAME_SHAPE};
use crate::{Estimate, EstimateError};

/// A mode of an identified machine.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifiedMode {
    /// Eigenvalue and shape of the identified matrices; the largest entry of the shape is 1.
    pub mode: Mode,
    /// Re λ, in 1/s: growth rate of the free response, negative if it decays. For a mode that does
    /// not oscillate it is the eigenvalue.
    pub growth_rate: Uncertain,
    /// Im λ / 2π, in Hz; 0 for a mode that does not oscillate.
    pub damped_frequency_hz: Uncertain,
    /// |λ| / 2π or, for an overdamped pair, √(λ₁ λ₂) / 2π, in Hz.
    pub natural_frequency_hz: Uncertain,
    /// −Re λ / |λ| or, for an overdamped pair, −(λ₁ + λ₂) / (2 √(λ₁ λ₂)).
    pub damping_ratio: Uncertain,
    /// Square of the natural frequency, |λ|² or, for a pair of real eigenvalues, λ₁ λ₂, in rad²/s².
    /// At zero the square is a smooth function of the matrices, but the frequency is not.
    pub squared_frequency: Uncertain,
    /// Index of the other mode of a pair of real eigenvalues; `None` for a mode that oscillates,
    /// and if the shapes do not show which real eigenvalues form a pair.
    pub partner: Option<usize>,
    /// `true` for a motion without restoring force: the 99 % interval of `squared_frequency`
    /// contains zero, or the eigenvalue is zero to rounding.
    pub is_rigid_body: bool,
    /// Standard errors of the real and the imaginary part of every entry of the shape; they are 0
    /// for the entry that is 1 by definition.
    pub shape_standard_error: DVector<Complex<f64>>,
}

impl IdentifiedMode {
    /// Returns the confidence interval of the natural frequency, in Hz, at `level` (0.95 for 95 %);
    /// for a rigid-body mode it extends from zero to the square root of the upper limit of the
    /// squared frequency.
    ///
    /// # Errors
    /// [`NumericsError::Level`] unless 0 < level < 1.
    pub fn natural_frequency_interval_hz(&self, level: f64) -> Result<[f64; 2], NumericsError> {
        if !self.is_rigid_body {
            return self.natural_frequency_hz.interval(level);
        }
        let [_, high] = self.squared_frequency.interval(level)?;
        Ok([0.0, high.max(0.0).sqrt() / std::f64::consts::TAU])
    }
}

impl Estimate {
    /// Returns the modes of the identified machine by rising natural frequency, with standard
    /// errors to first order in the errors of M̂, Ĉ and K̂.
    ///
    /// ```
    /// use mechid_model::ResponseQuantity;
    /// use mechid_estimate::Unknowns;
    /// use mechid_spectra::FrequencyData;
    /// use mechid_estimate::frequency_domain::equation_error;
    /// use nalgebra::{Complex, DMatrix};
    ///
    /// // 10 ẍ + 180 ẋ + 5000 x = F at three frequencies, displacements rounded to a micrometre.
    /// let omega = vec![10.0, 20.0, 30.0];
    /// let force = DMatrix::from_element(3, 1, Complex::new(50.0, 0.0));
    /// let displacement = DMatrix::from_fn(3, 1, |row, _| {
    ///     let w = omega[row];
    ///     let x: Complex<f64> =
    ///         force[(row, 0)] / Complex::new(5000.0 - 10.0 * w * w, 180.0 * w);
    ///     Complex::new((x.re * 1e6).round() * 1e-6, (x.im * 1e6).round() * 1e-6)
    /// });
    /// let quantity = ResponseQuantity::Displacement;
    /// let data = FrequencyData::from_amplitudes(omega, force, displacement, quantity)?;
    /// let modes = equation_error(&data, &Unknowns::unknown_mass(1)?)?.modes()?;
    /// let [low, high] = modes[0].damping_ratio.interval(0.95)?;
    /// assert!(low < 0.4025 && 0.4025 < high && high - low < 0.01);
    /// # Ok::<(), mechid_estimate::EstimateError>(())
    /// ```
    ///
    /// # Errors
    /// [`EstimateError::Undetermined`] if the data do not determine a parameter,
    /// [`EstimateError::Model`] if M̂ is singular or the eigenvalues do not converge.
    ///
    /// # Source
    /// Dissertation, Appendix E; derivatives after Nelson (1976), AIAA Journal 14, 1201–1205, here
    /// with damping and a bordered matrix.
    pub fn modes(&self) -> Result<Vec<IdentifiedMode>, EstimateError> {
        let parameters: Vec<Parameter> = self.parameters().map(|p| p.parameter).collect();
        modes(&self.system()?, &parameters, self.spread(), self.degrees_of_freedom())
    }
}

/// Returns the modes of a machine that was identified by another method or read from a file, as
/// [`Estimate::modes`] does; `degrees_of_freedom` is the number of degrees of freedom of the
/// residual variance in the covariance of this machine.
///
/// # Errors
/// [`EstimateError::Model`] if the eigenvalues do not converge.
///
/// # Source
/// As [`Estimate::modes`].
pub fn identified_modes(
    machine: &UncertainSystem,
    degrees_of_freedom: usize,
) -> Result<Vec<IdentifiedMode>, EstimateError> {
    let covariance = Covariance::Full(machine.covariance().clone());
    modes(machine.system(), machine.parameters(), &covariance, degrees_of_freedom)
}

fn modes(
    system: &SecondOrderSystem,
    parameters: &[Parameter],
    covariance: &Covariance,
    degrees_of_freedom: usize,
) -> Result<Vec<IdentifiedMode>, EstimateError> {
    let equations: Vec<usize> = parameters.iter().map(Parameter::row).collect();
    let spread = Spread { covariance, equations: &equations, degrees_of_freedom };
    let modes = system.modes()?;
    let partners = partners(&modes);
    let sensitivities: Vec<Sensitivity> =
        modes.iter().map(|mode| Sensitivity::new(mode, system, parameters)).collect();
    let largest = modes.iter().map(Mode::natural_frequency).fold(0.0, f64::max);
    let identify = |(at, partner): (usize, &Option<usize>)| {
        let partner = partner.map(|other| (other, &modes[other], &sensitivities[other]));
        spread.propagate(&modes[at], &sensitivities[at], partner, EIGENVALUE_ROUNDING * largest)
    };
    Ok(partners.iter().enumerate().map(identify).collect())
}

/// Pairs the real eigenvalues of overdamped modes. If there are only two, they form a pair. If
/// there are more, the pairs with the most similar shapes are formed first; the MAC of a pair must
/// be at least [`SAME_SHAPE`]. With proportional damping the two shapes of a pair are equal.
fn partners(modes: &[Mode]) -> Vec<Option<usize>> {
    let mut partners = vec![None; modes.len()];
    let real: Vec<usize> = (0..modes.len()).filter(|at| !modes[*at].oscillates()).collect();
    let likeness = |i: usize, j: usize| {
        let (p, q) = (modes[i].shape(), modes[j].shape());
        p.dotc(q).norm_sqr() / (p.norm_squared() * q.norm_squared())
    };
    let pairs = real.iter().enumerate().flat_map(|(at, i)| real[at + 1..].iter().map(|j| (*i, *j)));
    let mut pairs: Vec<(f64, usize, usize)> = pairs.map(|(i, j)| (likeness(i, j), i, j)).collect();
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (likeness, i, j) in pairs {
        let is_pair = real.len() == 2 || likeness >= SAME_SHAPE;
        if is_pair && partners[i].is_none() && partners[j].is_none() {
            (partners[i], partners[j]) = (Some(j), Some(i));
        }
    }
    partners
}

/// Uncertainty of the parameters.
struct Spread<'a> {
    covariance: &'a Covariance,
    /// Index of the equation of motion that contains each parameter.
    equations: &'a [usize],
    degrees_of_freedom: usize,
}

impl Spread<'_> {
    /// Returns a mode with standard errors; an eigenvalue whose modulus is at most `rounding`
    /// (rad/s) counts as zero.
    fn propagate(
        &self,
        mode: &Mode,
        sensitivity: &Sensitivity,
        partner: Option<(usize, &Mode, &Sensitivity)>,
        rounding: f64,
    ) -> IdentifiedMode {
        let (lambda, gradient) = (mode.eigenvalue(), &sensitivity.eigenvalue);
        let tau = std::f64::consts::TAU;
        // The partner of an oscillating mode is its conjugate; a real eigenvalue without a partner
        // is paired with itself.
        let (other, other_gradient) = match partner {
            Some((_, mode, sensitivity)) => (mode.eigenvalue(), sensitivity.eigenvalue.clone()),
            None => (lambda.conj(), gradient.map(|d| d.conj())),
        };
        let sum = Value {
            value: (lambda + other).re,
            gradient: gradient.zip_map(&other_gradient, |d, e| (d + e).re),
        };
        let square = Value {
            value: (lambda * other).re,
            gradient: gradient.zip_map(&other_gradient, |d, e| (d * other + e * lambda).re),
        };
        let squared_frequency = self.uncertain(square.value, &square.gradient);
        let [modulus, ratio] = modulus_and_damping(mode, gradient, &sum, &square);
        let is_rigid_body = lambda.norm() <= rounding
            || squared_frequency.standard_error.is_finite()
                && squared_frequency
                    .interval(RIGID_BODY_LEVEL)
                    .is_ok_and(|[low, high]| high.is_finite() && low <= 0.0 && 0.0 <= high)
                && squared_frequency.standard_error > 0.0;
        let natural_frequency_hz = if is_rigid_body {
            Uncertain {
                value: square.value.max(0.0).sqrt() / tau,
                standard_error: squared_frequency.standard_error.sqrt() / tau,
                degrees_of_freedom: self.degrees_of_freedom,
            }
        } else {
            self.uncertain(modulus.value / tau, &(modulus.gradient / tau))
        };
        let mut growth_rate = self.uncertain(lambda.re, &gradient.map(|d| d.re));
        if is_rigid_body && !mode.oscillates() {
            // Near a double zero the eigenvalues vary as the square root of their product; this
            // root has no derivative at zero.
            let of_root = squared_frequency.standard_error.sqrt();
            growth_rate.standard_error = growth_rate.standard_error.max(of_root);
        }
        IdentifiedMode {
            growth_rate,
            damped_frequency_hz: self
                .uncertain(mode.damped_frequency_hz(), &gradient.map(|d| d.im / tau)),
            natural_frequency_hz,
            damping_ratio: self.uncertain(ratio.value, &ratio.gradient),
            squared_frequency,
            partner: partner.map(|(at, ..)| at),
            is_rigid_body,
            shape_standard_error: self.shape_error(sensitivity),
            mode: mode.clone(),
        }
    }

    fn uncertain(&self, value: f64, gradient: &DVector<f64>) -> Uncertain {
        let (standard_error, degrees_of_freedom) =
            (self.deviation(gradient), self.degrees_of_freedom);
        Uncertain { value, standard_error, degrees_of_freedom }
    }

    /// Returns the standard errors of the real and imaginary parts of dφ = −U f, where f is the
    /// change of the equations of motion due to the parameters.
    fn shape_error(&self, sensitivity: &Sensitivity) -> DVector<Complex<f64>> {
        let response = &sensitivity.response;
        let n = response.ncols();
        if sensitivity.force_change.iter().any(|p| !(p.re.is_finite() && p.im.is_finite())) {
            return DVector::from_element(n, Complex::new(f64::INFINITY, f64::INFINITY));
        }
        let of_force_change =
            self.covariance.covariance_of_sums(&sensitivity.force_change, self.equations, n);
        let deviation =
            |weights: DVector<f64>| weights.dot(&(&of_force_change * &weights)).max(0.0).sqrt();
        DVector::from_fn(n, |entry, _| {
            let response_to = |i: usize| response[(entry, i % n)];
            let re = |i: usize, _| if i < n { response_to(i).re } else { -response_to(i).im };
            let im = |i: usize, _| if i < n { response_to(i).im } else { response_to(i).re };
            let deviations =
                [DVector::from_fn(2 * n, re), DVector::from_fn(2 * n, im)].map(deviation);
            Complex::new(deviations[0], deviations[1])
        })
    }

    /// Returns the standard error √(gᵀ Σ g) of a quantity with gradient g.
    fn deviation(&self, gradient: &DVector<f64>) -> f64 {
        if gradient.iter().any(|g| !g.is_finite()) {
            return f64::INFINITY;
        }
        self.covariance.variance(gradient).max(0.0).sqrt()
    }
}

/// A quantity with its gradient with respect to the free parameters.
struct Value {
    value: f64,
    gradient: DVector<f64>,
}

/// Returns the modulus (rad/s) and the damping ratio of a mode from the `sum` and the product
/// (`square`) of the eigenvalues of the mode and its partner; `gradient` is the derivative of the
/// eigenvalue of the mode.
fn modulus_and_damping(
    mode: &Mode,
    gradient: &DVector<Complex<f64>>,
    sum: &Value,
    square: &Value,
) -> [Value; 2] {
    if square.value > 0.0 {
        let modulus = square.value.sqrt();
        let ratio = -0.5 * sum.value / modulus;
        let of_modulus = &square.gradient / (2.0 * modulus);
        let of_ratio = sum.gradient.zip_map(&of_modulus, |s, g| (-0.5 * s - ratio * g) / modulus);
        [Value { value: modulus, gradient: of_modulus }, Value { value: ratio, gradient: of_ratio }]
    } else {
        // Real eigenvalues of opposite sign do not form an oscillator: the damping ratio of each is
        // ±1 for any matrices.
        let sign = mode.eigenvalue().re.signum();
        let of_ratio = DVector::zeros(gradient.len());
        [
            Value { value: mode.natural_frequency(), gradient: gradient.map(|d| d.re * sign) },
            Value { value: mode.damping_ratio(), gradient: of_ratio },
        ]
    }
}

/// Derivatives of one mode with respect to the free parameters.
struct Sensitivity {
    /// Derivative of λ with respect to each parameter.
    eigenvalue: DVector<Complex<f64>>,
    /// Derivative of each parameter's equation of motion with respect to this parameter, at fixed
    /// λ.
    force_change: Vec<Complex<f64>>,
    /// Matrix U of dφ = −U f for changes f of the equations of motion, n×n.
    response: DMatrix<Complex<f64>>,
}

impl Sensitivity {
    /// Solves for the derivatives of (λ²M + λC + K) φ = 0 with φ_r = 1:
    ///
    /// ```text
    /// ┌ λ²M + λC + K   (2λM + C) φ ┐ ┌ dφ ┐     ┌ d(λ²M + λC + K) φ ┐   at fixed λ
    /// └     e_rᵀ             0     ┘ └ dλ ┘ = − └         0         ┘
    /// ```
    ///
    /// The bordered matrix is regular for every simple eigenvalue; M, C and K need not be
    /// symmetric.
    fn new(mode: &Mode, system: &SecondOrderSystem, parameters: &[Parameter]) -> Self {
        let (m, c, k) = (system.mass(), system.damping(), system.stiffness());
        let (n, lambda, shape) = (mode.shape().len(), mode.eigenvalue(), mode.shape());
        let pencil =
            DMatrix::from_fn(n, n, |i, j| lambda * (lambda * m[(i, j)] + c[(i, j)]) + k[(i, j)]);
        let slope = DMatrix::from_fn(n, n, |i, j| 2.0 * lambda * m[(i, j)] + c[(i, j)]) * shape;
        let mut bordered = DMatrix::zeros(n + 1, n + 1);
        bordered.view_mut((0, 0), (n, n)).copy_from(&pencil);
        bordered.view_mut((0, n), (n, 1)).copy_from(&slope);
        // The row that fixes φ_r has the size of the other rows, for a small condition number.
        let size = m.norm() * lambda.norm_sqr() + c.norm() * lambda.norm() + k.norm();
        bordered[(n, fixed_entry(shape))] = Complex::from(size);
        // A change of entry (i, j) affects only equation i, so n right-hand sides are enough.
        let mut unit = DMatrix::identity(n + 1, n);
        let regular = bordered.lu().solve_mut(&mut unit);
        let force_change = |parameter: &Parameter| {
            let power = match parameter.matrix() {
                Matrix::Mass => lambda * lambda,
                Matrix::Damping => lambda,
                Matrix::Stiffness => Complex::from(1.0),
            };
            if regular { power * shape[parameter.column()] } else { Complex::from(f64::NAN) }
        };
        let force_change: Vec<Complex<f64>> = parameters.iter().map(force_change).collect();
        let of_eigenvalue =
            parameters.iter().zip(&force_change).map(|(p, change)| unit[(n, p.row())] * -change);
        Self {
            eigenvalue: DVector::from_iterator(parameters.len(), of_eigenvalue),
            response: unit.rows(0, n).into_owned(),
            force_change,
        }
    }
}

/// Returns the index of the entry of a scaled shape that is 1.
fn fixed_entry(shape: &DVector<Complex<f64>>) -> usize {
    shape.map(|z| (z - 1.0).norm()).imin()
}
