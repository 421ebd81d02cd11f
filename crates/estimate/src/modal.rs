//! Natural frequencies, damping ratios and mode shapes of an identified machine, with what the
//! uncertainty of its matrices makes of them.

use mechid_model::{Matrix, Mode, Parameter, SecondOrderSystem, UncertainSystem};
use nalgebra::{Complex, DMatrix, DVector};

use crate::estimate::student_interval;
use crate::{Estimate, EstimateError};

/// A value with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertain {
    /// The value, in the unit its owner gives.
    pub value: f64,
    /// Standard error, in the same unit; infinite where it has no derivative with
    /// respect to the matrices (repeated eigenvalues).
    pub standard_error: f64,
    /// Degrees of freedom of the variance behind the standard error.
    pub degrees_of_freedom: usize,
}

impl Uncertain {
    /// The confidence interval [low, high] at `level` (0.95 for 95 %), by Student's t.
    ///
    /// # Errors
    /// [`EstimateError::Level`] unless 0 < level < 1.
    pub fn interval(&self, level: f64) -> Result<[f64; 2], EstimateError> {
        student_interval(self.value, self.standard_error, self.degrees_of_freedom, level)
    }
}

/// A mode of an identified machine.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifiedMode {
    /// Eigenvalue and shape of the identified matrices, the shape's largest entry being 1.
    pub mode: Mode,
    /// Im λ / 2π, in Hz; 0 for a mode that does not oscillate.
    pub damped_frequency_hz: Uncertain,
    /// |λ| / 2π, in Hz.
    pub natural_frequency_hz: Uncertain,
    /// −Re λ / |λ|.
    pub damping_ratio: Uncertain,
    /// Standard errors of the real and the imaginary part of every entry of the shape; those
    /// of the entry that is 1 by definition are 0.
    pub shape_standard_error: DVector<Complex<f64>>,
}

impl Estimate {
    /// The modes of the identified machine by rising natural frequency, with standard errors
    /// to first order in those of M̂, Ĉ and K̂.
    ///
    /// ```
    /// use mechid_model::ResponseQuantity;
    /// use mechid_estimate::{Unknowns, frequency_domain::{FrequencyData, equation_error}};
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
        modes(&self.system()?, &parameters, self.covariance(), self.degrees_of_freedom())
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
    modes(machine.system(), machine.parameters(), machine.covariance(), degrees_of_freedom)
}

fn modes(
    system: &SecondOrderSystem,
    parameters: &[Parameter],
    covariance: &DMatrix<f64>,
    degrees_of_freedom: usize,
) -> Result<Vec<IdentifiedMode>, EstimateError> {
    let spread = Spread { covariance, degrees_of_freedom };
    let identify = |mode: Mode| {
        let sensitivity = Sensitivity::of(&mode, system, parameters);
        spread.propagate(mode, &sensitivity)
    };
    Ok(system.modes()?.into_iter().map(identify).collect())
}

/// What is known of the scatter of the parameters.
struct Spread<'a> {
    covariance: &'a DMatrix<f64>,
    degrees_of_freedom: usize,
}

impl Spread<'_> {
    fn propagate(&self, mode: Mode, sensitivity: &Sensitivity) -> IdentifiedMode {
        let (lambda, size) = (mode.eigenvalue(), mode.natural_frequency());
        let tau = std::f64::consts::TAU;
        let growth = sensitivity.eigenvalue.map(|d| (lambda.conj() * d).re / size);
        let damping = sensitivity
            .eigenvalue
            .zip_map(&growth, |d, growth| (-d.re - mode.damping_ratio() * growth) / size);
        let uncertain = |value: f64, gradient: DVector<f64>| Uncertain {
            value,
            standard_error: self.deviation(&gradient),
            degrees_of_freedom: self.degrees_of_freedom,
        };
        let shape = sensitivity.shape.row_iter().map(|row| {
            let row = row.transpose();
            Complex::new(self.deviation(&row.map(|d| d.re)), self.deviation(&row.map(|d| d.im)))
        });
        IdentifiedMode {
            damped_frequency_hz: uncertain(
                mode.damped_frequency_hz(),
                sensitivity.eigenvalue.map(|d| d.im / tau),
            ),
            natural_frequency_hz: uncertain(size / tau, growth / tau),
            damping_ratio: uncertain(mode.damping_ratio(), damping),
            shape_standard_error: DVector::from_iterator(mode.shape().len(), shape),
            mode,
        }
    }

    /// √(gᵀ Σ g).
    fn deviation(&self, gradient: &DVector<f64>) -> f64 {
        if gradient.iter().any(|g| !g.is_finite()) {
            return f64::INFINITY;
        }
        gradient.dot(&(self.covariance * gradient)).max(0.0).sqrt()
    }
}

/// Derivatives of one mode with respect to the free parameters.
struct Sensitivity {
    /// dλ, one per parameter.
    eigenvalue: DVector<Complex<f64>>,
    /// dφ, degrees of freedom × parameters.
    shape: DMatrix<Complex<f64>>,
}

impl Sensitivity {
    /// From (λ²M + λC + K) φ = 0 and φ_r = 1:
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
        let mut derivatives = Self {
            eigenvalue: DVector::zeros(parameters.len()),
            shape: DMatrix::zeros(n, parameters.len()),
        };
        for (at, parameter) in parameters.iter().enumerate() {
            let power = match parameter.matrix() {
                Matrix::Mass => lambda * lambda,
                Matrix::Damping => lambda,
                Matrix::Stiffness => Complex::from(1.0),
            };
            let push =
                if regular { power * shape[parameter.column()] } else { Complex::from(f64::NAN) };
            let answer = unit.column(parameter.row()) * -push;
            derivatives.eigenvalue[at] = answer[n];
            derivatives.shape.column_mut(at).copy_from(&answer.rows(0, n));
        }
        derivatives
    }
}

/// The entry of a scaled shape that is 1.
fn fixed_entry(shape: &DVector<Complex<f64>>) -> usize {
    shape.map(|z| (z - 1.0).norm()).imin()
}
