//! Threshold of instability of a rigid rotor on a film.

use mechid_model::OilFilm;
use nalgebra::{DMatrix, SVector};

use crate::error::{BearingError, require};

/// Whirl at the threshold of instability of a rigid rotor, from eight coefficients.
///
/// A rotor of mass m per bearing obeys m ẍ + C ẋ + K x = 0. At the threshold it whirls with a
/// frequency ω_w without growing or decaying, which requires
///
/// ```text
/// m ω_w² = k_eq = (kxx cyy + kyy cxx − kxy cyx − kyx cxy) / (cxx + cyy)
///   ω_w² = [(k_eq − kxx) (k_eq − kyy) − kxy kyx] / (cxx cyy − cxy cyx)
/// ```
///
/// The whirl frequency ratio ω_w / Ω does not depend on the rotor. A rotor that is heavier than the
/// critical mass k_eq / ω_w² is unstable.
///
/// ```
/// use mechid_bearing::{ShortBearing, Threshold};
///
/// // A lightly loaded short bearing whirls at half the speed of rotation.
/// let equilibrium = ShortBearing::new(0.25)?.at_eccentricity(0.01)?;
/// let threshold = Threshold::from_coefficients(equilibrium.coefficients())?;
/// assert!((threshold.whirl_frequency_ratio().unwrap() - 0.5).abs() < 1e-3);
/// # Ok::<(), mechid_bearing::BearingError>(())
/// ```
///
/// # Source
/// Lund (1966), as in Lund and Thomsen (1978).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Threshold {
    omega: f64,
    equivalent_stiffness: f64,
    /// ω_w², in rad²/s².
    whirl_squared: f64,
    gradient: Gradient,
}

/// Derivatives with respect to kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Gradient {
    equivalent_stiffness: SVector<f64, 8>,
    whirl_squared: SVector<f64, 8>,
}

/// Standard errors of the values of a [`Threshold`], to first order in the standard errors of the
/// coefficients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThresholdErrors {
    /// Standard error of the equivalent stiffness, in N/m.
    pub equivalent_stiffness: f64,
    /// Standard error of the whirl frequency ratio, a ratio; `None` if there is no whirl.
    pub whirl_frequency_ratio: Option<f64>,
    /// Standard error of the critical mass, in kg; `None` if there is no critical mass.
    pub critical_mass: Option<f64>,
}

impl Threshold {
    /// Returns the threshold of a film at a speed of rotation (rad/s). The coefficients of the film
    /// are entries of the stiffness matrix (N/m) and of the damping matrix (N·s/m).
    ///
    /// # Errors
    /// [`BearingError::Parameter`] if the speed is not positive, a coefficient is not finite, or
    /// the damping matrix has no positive trace and determinant.
    pub fn new(film: &OilFilm, omega: f64) -> Result<Self, BearingError> {
        require("speed of rotation", omega, "positive and finite", omega > 0.0)?;
        let OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy } = *film;
        for (name, value) in [("kxx", kxx), ("kxy", kxy), ("kyx", kyx), ("kyy", kyy)] {
            require(name, value, "finite", true)?;
        }
        let trace = cxx + cyy;
        let determinant = cxx * cyy - cxy * cyx;
        require("trace of the damping", trace, "positive and finite", trace > 0.0)?;
        let positive = determinant > 0.0;
        require("determinant of the damping", determinant, "positive and finite", positive)?;

        let equivalent = (kxx * cyy + kyy * cxx - kxy * cyx - kyx * cxy) / trace;
        let [x, y] = [equivalent - kxx, equivalent - kyy];
        let whirl_squared = (x * y - kxy * kyx) / determinant;

        let by_equivalent = SVector::from([cyy, -cyx, -cxy, cxx, -y, -kyx, -kxy, -x]) / trace;
        // The entries are the derivatives of x y − kxy kyx − ω_w² det C, with x = k_eq − kxx and y
        // = k_eq − kyy, for constant k_eq and ω_w.
        let explicit_derivatives = SVector::from([
            -y,
            -kyx,
            -kxy,
            -x,
            -whirl_squared * cyy,
            whirl_squared * cyx,
            whirl_squared * cxy,
            -whirl_squared * cxx,
        ]);
        let gradient = Gradient {
            equivalent_stiffness: by_equivalent,
            whirl_squared: (explicit_derivatives + by_equivalent * (x + y)) / determinant,
        };
        Ok(Self { omega, equivalent_stiffness: equivalent, whirl_squared, gradient })
    }

    /// Returns the threshold in dimensionless form. The stiffness is divided by W / c and the mass
    /// by W / (c Ω²): the critical mass is given as c Ω² m / W.
    ///
    /// # Errors
    /// The errors of [`Threshold::new`].
    pub fn from_coefficients(coefficients: &crate::Coefficients) -> Result<Self, BearingError> {
        let [[kxx, kxy], [kyx, kyy]] = coefficients.stiffness;
        let [[cxx, cxy], [cyx, cyy]] = coefficients.damping;
        Self::new(&OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy }, 1.0)
    }

    /// Equivalent stiffness k_eq, in N/m.
    pub fn equivalent_stiffness(&self) -> f64 {
        self.equivalent_stiffness
    }

    /// Square of the whirl frequency ratio, (ω_w / Ω)², a ratio; negative if no rotor can whirl
    /// with constant amplitude.
    pub fn whirl_frequency_ratio_squared(&self) -> f64 {
        self.whirl_squared / (self.omega * self.omega)
    }

    /// Whirl frequency ratio ω_w / Ω, a ratio; `None` if (ω_w / Ω)² is not positive.
    pub fn whirl_frequency_ratio(&self) -> Option<f64> {
        (self.whirl_squared > 0.0).then(|| self.whirl_squared.sqrt() / self.omega)
    }

    /// Mass per bearing (kg) above which the rotor is unstable; `None` if there is no such mass.
    pub fn critical_mass(&self) -> Option<f64> {
        let exists = self.whirl_squared > 0.0 && self.equivalent_stiffness > 0.0;
        exists.then(|| self.equivalent_stiffness / self.whirl_squared)
    }

    /// Returns the speed (rad/s) at which a rotor of `mass` (kg) per bearing becomes unstable, at
    /// the same load and Sommerfeld number; `None` if there is no critical mass.
    ///
    /// At a constant Sommerfeld number neither the equivalent stiffness k_eq nor ω_w / Ω depends on
    /// the speed. The relative standard error of this speed is half that of the critical mass.
    ///
    /// # Errors
    /// [`BearingError::Parameter`] if the mass is not positive and finite.
    pub fn speed(&self, mass: f64) -> Result<Option<f64>, BearingError> {
        require("mass", mass, "positive and finite", mass > 0.0)?;
        Ok(self.critical_mass().map(|critical| self.omega * (critical / mass).sqrt()))
    }

    /// Returns the standard errors from the covariance of the coefficients, 8×8 in the order kxx,
    /// kxy, kyx, kyy, cxx, cxy, cyx, cyy (products of N/m and N·s/m), by the delta method.
    ///
    /// # Errors
    /// [`BearingError::CovarianceShape`] if the covariance is not 8×8,
    /// [`BearingError::CovarianceEntry`] if the covariance has an entry that is not finite or a
    /// negative variance.
    ///
    /// # Source
    /// Seber and Wild (1989), section 2.1: σ² = gᵀ Σ g with the gradient g.
    pub fn standard_errors(
        &self,
        covariance: &DMatrix<f64>,
    ) -> Result<ThresholdErrors, BearingError> {
        let (rows, columns) = covariance.shape();
        if (rows, columns) != (8, 8) {
            return Err(BearingError::CovarianceShape { rows, columns });
        }
        for row in 0..8 {
            for column in 0..8 {
                let value = covariance[(row, column)];
                if !value.is_finite() || row == column && value < 0.0 {
                    let (row, column) = (row + 1, column + 1);
                    return Err(BearingError::CovarianceEntry { row, column, value });
                }
            }
        }
        let error =
            |gradient: SVector<f64, 8>| gradient.dot(&(covariance * gradient)).max(0.0).sqrt();
        let Gradient { equivalent_stiffness, whirl_squared } = self.gradient;
        let ratio = self
            .whirl_frequency_ratio()
            .map(|ratio| error(whirl_squared) / (2.0 * ratio * self.omega * self.omega));
        let mass = self
            .critical_mass()
            .map(|mass| error((equivalent_stiffness - whirl_squared * mass) / self.whirl_squared));
        Ok(ThresholdErrors {
            equivalent_stiffness: error(equivalent_stiffness),
            whirl_frequency_ratio: ratio,
            critical_mass: mass,
        })
    }
}
