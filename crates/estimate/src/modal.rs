//! Natural frequencies, damping ratios and mode shapes of an identified machine, with what the
//! uncertainty of its matrices makes of them.

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
    /// Eigenvalue and shape of the identified matrices, the shape's largest entry being 1.
    pub mode: Mode,
    /// Re λ, in 1/s: rate at which the free response grows, negative where it decays. Of a mode that does
    /// not oscillate it is the eigenvalue.
    pub growth_rate: Uncertain,
    /// Im λ / 2π, in Hz; 0 for a mode that does not oscillate.
    pub damped_frequency_hz: Uncertain,
    /// |λ| / 2π, of an overdamped pair √(λ₁ λ₂) / 2π, in Hz.
    pub natural_frequency_hz: Uncertain,
    /// −Re λ / |λ|, of an overdamped pair −(λ₁ + λ₂) / (2 √(λ₁ λ₂)).
    pub damping_ratio: Uncertain,
    /// Square of the natural frequency, |λ|² or, of a pair of real eigenvalues, λ₁ λ₂, in rad²/s². Unlike
    /// the frequency it is smooth in the matrices where it is zero.
    pub squared_frequency: Uncertain,
    /// Index of the other mode of a pair of real eigenvalues; `None` for a mode that oscillates, and where
    /// no shape tells which real eigenvalues belong together.
    pub partner: Option<usize>,
    /// `true` for a motion without restoring force: the 99 % interval of `squared_frequency` contains
    /// zero, or the eigenvalue is zero to rounding.
    pub is_rigid_body: bool,
    /// Standard errors of the real and the imaginary part of every entry of the shape; those
    /// of the entry that is 1 by definition are 0.
    pub shape_standard_error: DVector<Complex<f64>>,
}

impl IdentifiedMode {
    /// The confidence interval of the natural frequency, in Hz, at `level` (0.95 for 95 %); of a rigid-body
    /// mode from zero to the square root of the upper limit of the squared frequency.
    ///
    /// # Errors
    /// [`NumericsError::Level`] unless 0 < level < 1.
    pub fn natural_frequency_interval_hz(&self, level: f64) -> Result<[f64; 2], NumericsError> {
        match self.is_rigid_body {
            true => {
                let [_, high] = self.squared_frequency.interval(level)?;
                Ok([0.0, high.max(0.0).sqrt() / std::f64::consts::TAU])
            }
            false => self.natural_frequency_hz.interval(level),
        }
    }
}

impl Estimate {
    /// The modes of the identified machine by rising natural frequency, with standard errors
    /// to first order in those of M̂, Ĉ and K̂.
    ///
    /// ```
    /// use mechid_model::ResponseQuantity;
    /// use mechid_estimate::Unknowns;
    /// use mechid_spectra::FrequencyData;
    /// use mechid_estimate::frequency_domain::equation_error;
    /// use nalgebra::{Complex, DMatrix};
    ///
    /// // 10 ẍ + 180 ẋ + 5000 x = F at three frequencies, displacements read to a micrometre.
    /// let omega = vec![10.0, 20.0, 30.0];
    /// let force = DMatrix::from_element(3, 1, Complex::new(50.0, 0.0));
    /// let displacement = DMatrix::from_fn(3, 1, |row, _| {
    ///     let w = omega[row];
    ///     let x: Complex<f64> =
    ///         force[(row, 0)] / Complex::new(5000.0 - 10.0 * w * w, 180.0 * w);
    ///     Complex::new((x.re * 1e6).round() * 1e-6, (x.im * 1e6).round() * 1e-6)
    /// });
    /// let data = FrequencyData::from_amplitudes(omega, force, displacement, ResponseQuantity::Displacement)?;
    /// let modes = equation_error(&data, &Unknowns::unknown_mass(1)?)?.modes()?;
    /// let [low, high] = modes[0].damping_ratio.interval(0.95)?;
    /// assert!(low < 0.4025 && 0.4025 < high && high - low < 0.01);
    /// # Ok::<(), mechid_estimate::EstimateError>(())
    /// ```
    ///
    /// # Errors
    /// [`EstimateError::Undetermined`] if the data leave a parameter open,
    /// [`EstimateError::Model`] if M̂ is singular or the eigenvalues do not converge.
    ///
    /// # Source
    /// Dissertation, Appendix E; derivatives after Nelson (1976), AIAA Journal 14, 1201–1205,
    /// here bordered and with damping.
    pub fn modes(&self) -> Result<Vec<IdentifiedMode>, EstimateError> {
        let parameters: Vec<Parameter> = self.parameters().map(|p| p.parameter).collect();
        modes(&self.system()?, &parameters, self.spread(), self.degrees_of_freedom())
    }
}

/// The modes of a machine identified elsewhere or read back from a file, as [`Estimate::modes`]:
/// `degrees_of_freedom` are those of the residual variance behind its covariance.
///
/// # Errors
/// [`EstimateError::Model`] if the eigenvalues do not converge.
///
/// # Source
/// That of [`Estimate::modes`].
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
        modes.iter().map(|mode| Sensitivity::of(mode, system, parameters)).collect();
    let largest = modes.iter().map(Mode::natural_frequency).fold(0.0, f64::max);
    let identify = |(at, partner): (usize, &Option<usize>)| {
        let partner = partner.map(|other| (other, &modes[other], &sensitivities[other]));
        spread.propagate(&modes[at], &sensitivities[at], partner, EIGENVALUE_ROUNDING * largest)
    };
    Ok(partners.iter().enumerate().map(identify).collect())
}

/// Pairs the real eigenvalues of overdamped modes: the only two there are, otherwise those whose shapes
/// agree best, as proportional damping makes them do exactly.
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
        let alike = real.len() == 2 || likeness >= SAME_SHAPE;
        if alike && partners[i].is_none() && partners[j].is_none() {
            (partners[i], partners[j]) = (Some(j), Some(i));
        }
    }
    partners
}

/// Scatter of the parameters.
struct Spread<'a> {
    covariance: &'a Covariance,
    /// Equation of motion of each of them.
    equations: &'a [usize],
    degrees_of_freedom: usize,
}

impl Spread<'_> {
    /// An eigenvalue up to `rounding` (rad/s) is zero.
    fn propagate(
        &self,
        mode: &Mode,
        sensitivity: &Sensitivity,
        partner: Option<(usize, &Mode, &Sensitivity)>,
        rounding: f64,
    ) -> IdentifiedMode {
        let (lambda, own) = (mode.eigenvalue(), &sensitivity.eigenvalue);
        let tau = std::f64::consts::TAU;
        // The mode that oscillates has its conjugate for a partner, the real one without any itself.
        let (other, of_other) = match partner {
            Some((_, mode, sensitivity)) => (mode.eigenvalue(), sensitivity.eigenvalue.clone()),
            None => (lambda.conj(), own.map(|d| d.conj())),
        };
        let sum_slope = own.zip_map(&of_other, |d, e| (d + e).re);
        let (square, square_slope) =
            ((lambda * other).re, own.zip_map(&of_other, |d, e| (d * other + e * lambda).re));
        let squared_frequency = self.uncertain(square, &square_slope);
        // Real eigenvalues of opposite sign are no oscillator.
        let (size, ratio) = match square > 0.0 {
            true => (square.sqrt(), -0.5 * (lambda + other).re / square.sqrt()),
            false => (mode.natural_frequency(), mode.damping_ratio()),
        };
        let (growth, damping) = match square > 0.0 {
            true => {
                let growth = square_slope / (2.0 * size);
                let damping = sum_slope.zip_map(&growth, |s, g| (-0.5 * s - ratio * g) / size);
                (growth, damping)
            }
            // The modulus of a real eigenvalue; its damping ratio is ±1 whatever the matrices.
            false => (own.map(|d| d.re * lambda.re.signum()), DVector::zeros(own.len())),
        };
        let is_rigid_body = lambda.norm() <= rounding
            || squared_frequency.standard_error.is_finite()
                && squared_frequency
                    .interval(RIGID_BODY_LEVEL)
                    .is_ok_and(|[low, high]| high.is_finite() && low <= 0.0 && 0.0 <= high)
                && squared_frequency.standard_error > 0.0;
        let natural_frequency_hz = match is_rigid_body {
            true => Uncertain {
                value: square.max(0.0).sqrt() / tau,
                standard_error: squared_frequency.standard_error.sqrt() / tau,
                degrees_of_freedom: self.degrees_of_freedom,
            },
            false => self.uncertain(size / tau, &(growth / tau)),
        };
        let mut growth_rate = self.uncertain(lambda.re, &own.map(|d| d.re));
        if is_rigid_body && !mode.oscillates() {
            // Near a double zero the eigenvalues are as roots of their product, and no derivative says how far.
            let of_root = squared_frequency.standard_error.sqrt();
            growth_rate.standard_error = growth_rate.standard_error.max(of_root);
        }
        IdentifiedMode {
            growth_rate,
            damped_frequency_hz: self
                .uncertain(mode.damped_frequency_hz(), &own.map(|d| d.im / tau)),
            natural_frequency_hz,
            damping_ratio: self.uncertain(ratio, &damping),
            squared_frequency,
            partner: partner.map(|(at, ..)| at),
            is_rigid_body,
            shape_standard_error: self.of_shape(sensitivity),
            mode: mode.clone(),
        }
    }

    fn uncertain(&self, value: f64, gradient: &DVector<f64>) -> Uncertain {
        let (standard_error, degrees_of_freedom) =
            (self.deviation(gradient), self.degrees_of_freedom);
        Uncertain { value, standard_error, degrees_of_freedom }
    }

    /// Standard errors of real and imaginary parts of dφ = −U f, f being what the parameters change in the
    /// equations of motion.
    fn of_shape(&self, sensitivity: &Sensitivity) -> DVector<Complex<f64>> {
        let answers = &sensitivity.answers;
        let n = answers.ncols();
        if sensitivity.push.iter().any(|p| !(p.re.is_finite() && p.im.is_finite())) {
            return DVector::from_element(n, Complex::new(f64::INFINITY, f64::INFINITY));
        }
        let of_push = self.covariance.of_sums(&sensitivity.push, self.equations, n);
        let deviation = |weights: DVector<f64>| weights.dot(&(&of_push * &weights)).max(0.0).sqrt();
        DVector::from_fn(n, |entry, _| {
            let answer = |i: usize| answers[(entry, i % n)];
            let re = |i: usize, _| if i < n { answer(i).re } else { -answer(i).im };
            let im = |i: usize, _| if i < n { answer(i).im } else { answer(i).re };
            let deviations =
                [DVector::from_fn(2 * n, re), DVector::from_fn(2 * n, im)].map(deviation);
            Complex::new(deviations[0], deviations[1])
        })
    }

    /// √(gᵀ Σ g).
    fn deviation(&self, gradient: &DVector<f64>) -> f64 {
        if gradient.iter().any(|g| !g.is_finite()) {
            return f64::INFINITY;
        }
        self.covariance.variance(gradient).max(0.0).sqrt()
    }
}

/// Derivatives of one mode with respect to the free parameters.
struct Sensitivity {
    /// dλ, one per parameter.
    eigenvalue: DVector<Complex<f64>>,
    /// Change of the equation of motion of each parameter by its own, at fixed λ.
    push: Vec<Complex<f64>>,
    /// U of dφ = −U f for changes f of the equations of motion, n×n.
    answers: DMatrix<Complex<f64>>,
}

impl Sensitivity {
    /// Solves for the derivatives of (λ²M + λC + K) φ = 0 with φ_r = 1:
    ///
    /// ```text
    /// ┌ λ²M + λC + K   (2λM + C) φ ┐ ┌ dφ ┐     ┌ d(λ²M + λC + K) φ ┐   at fixed λ
    /// └     e_rᵀ             0     ┘ └ dλ ┘ = − └         0         ┘
    /// ```
    ///
    /// The bordered matrix is regular for every simple eigenvalue, M, C and K of any symmetry.
    fn of(mode: &Mode, system: &SecondOrderSystem, parameters: &[Parameter]) -> Self {
        let (m, c, k) = (system.mass(), system.damping(), system.stiffness());
        let (n, lambda, shape) = (mode.shape().len(), mode.eigenvalue(), mode.shape());
        let pencil =
            DMatrix::from_fn(n, n, |i, j| lambda * (lambda * m[(i, j)] + c[(i, j)]) + k[(i, j)]);
        let slope = DMatrix::from_fn(n, n, |i, j| 2.0 * lambda * m[(i, j)] + c[(i, j)]) * shape;
        let mut bordered = DMatrix::zeros(n + 1, n + 1);
        bordered.view_mut((0, 0), (n, n)).copy_from(&pencil);
        bordered.view_mut((0, n), (n, 1)).copy_from(&slope);
        // Any row that fixes φ_r will do; this one is as large as the terms of the others.
        let size = m.norm() * lambda.norm_sqr() + c.norm() * lambda.norm() + k.norm();
        bordered[(n, fixed_entry(shape))] = Complex::from(size);
        // Entry (i, j) of a matrix acts on equation i alone: n right-hand sides serve all.
        let mut unit = DMatrix::identity(n + 1, n);
        let regular = bordered.lu().solve_mut(&mut unit);
        let push = |parameter: &Parameter| {
            let power = match parameter.matrix() {
                Matrix::Mass => lambda * lambda,
                Matrix::Damping => lambda,
                Matrix::Stiffness => Complex::from(1.0),
            };
            if regular { power * shape[parameter.column()] } else { Complex::from(f64::NAN) }
        };
        let push: Vec<Complex<f64>> = parameters.iter().map(push).collect();
        let of_eigenvalue =
            parameters.iter().zip(&push).map(|(p, push)| unit[(n, p.row())] * -push);
        Self {
            eigenvalue: DVector::from_iterator(parameters.len(), of_eigenvalue),
            answers: unit.rows(0, n).into_owned(),
            push,
        }
    }
}

/// The entry of a scaled shape that is 1.
fn fixed_entry(shape: &DVector<Complex<f64>>) -> usize {
    shape.map(|z| (z - 1.0).norm()).imin()
}
