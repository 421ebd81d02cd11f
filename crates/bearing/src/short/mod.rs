//! The short bearing in closed form.

mod film;
mod integrals;

use std::f64::consts::PI;

pub use film::{FilmForce, ShortFilm};

use crate::equilibrium::{Coefficients, Equilibrium};
use crate::error::{BearingError, require};
use film::HalfFilm;

/// A short bearing: the oil flows axially, and the converging part of the film has pressure.
///
/// The film covers half the circumference (Gümbel's condition, which for a short bearing is
/// equivalent to that of Swift and Stieber). The model is good for lengths of up to half the
/// diameter at moderate eccentricity.
///
/// ```
/// use mechid_bearing::ShortBearing;
///
/// let equilibrium = ShortBearing::new(0.25)?.at_eccentricity(0.5)?;
/// // tan φ = π √(1 − ε²) / (4 ε)
/// assert!((equilibrium.attitude().to_degrees() - 53.7).abs() < 0.05);
/// let again = ShortBearing::new(0.25)?.equilibrium(equilibrium.sommerfeld_number())?;
/// assert!((again.eccentricity() - 0.5).abs() < 1e-12);
/// # Ok::<(), mechid_bearing::BearingError>(())
/// ```
///
/// # Source
/// DuBois and Ocvirk (1953), NACA Report 1157.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShortBearing {
    length_over_diameter: f64,
}

impl ShortBearing {
    /// Creates a bearing from the ratio of its length to its diameter.
    ///
    /// # Errors
    /// [`BearingError::Parameter`] if the ratio is not positive and finite.
    pub fn new(length_over_diameter: f64) -> Result<Self, BearingError> {
        let positive = length_over_diameter > 0.0;
        require("length over diameter", length_over_diameter, "positive and finite", positive)?;
        Ok(Self { length_over_diameter })
    }

    /// Returns the equilibrium for a ratio of eccentricity to clearance.
    ///
    /// # Errors
    /// [`BearingError::Parameter`] if the eccentricity is not between 0 and 1, or leads to no
    /// finite Sommerfeld number.
    pub fn at_eccentricity(&self, eccentricity: f64) -> Result<Equilibrium, BearingError> {
        let inside = eccentricity > 0.0 && eccentricity < 1.0;
        require("eccentricity over clearance", eccentricity, "between 0 and 1", inside)?;
        let load = load(eccentricity);
        let sommerfeld = 1.0 / (4.0 * PI * self.length_over_diameter.powi(2) * load);
        let requirement = "such that the Sommerfeld number is finite";
        require("eccentricity over clearance", eccentricity, requirement, sommerfeld.is_normal())?;
        let attitude = attitude(eccentricity);
        let (sin, cos) = attitude.sin_cos();
        let position = [eccentricity * cos, eccentricity * sin];
        let film = HalfFilm::new(position, [0.0; 2], 1.0);
        let coefficients = Coefficients {
            stiffness: film.stiffness.map(|row| row.map(|k| k / load)),
            damping: film.damping.map(|row| row.map(|c| c / load)),
        };
        Ok(Equilibrium::new(sommerfeld, position, coefficients))
    }

    /// Returns the equilibrium at a Sommerfeld number S = μ N L D (R/c)² / W (dimensionless, N in
    /// revolutions per second), from S (L/D)² = (1 − ε²)² / (π ε √(π² (1 − ε²) + 16 ε²)).
    ///
    /// # Errors
    /// [`BearingError::Parameter`] if S is not positive and finite, or so extreme that the journal
    /// is at the centre or touches the bore.
    pub fn equilibrium(&self, sommerfeld: f64) -> Result<Equilibrium, BearingError> {
        require("Sommerfeld number", sommerfeld, "positive and finite", sommerfeld > 0.0)?;
        let wanted = 1.0 / (4.0 * PI * self.length_over_diameter.powi(2) * sommerfeld);
        // The load increases with the eccentricity, so bisection finds the eccentricity. The
        // bisection uses the logit of the eccentricity, because this scale resolves values near 0
        // and near 1.
        let [mut low, mut high] = [-36.0_f64, 36.0];
        let at = |logit: f64| 1.0 / (1.0 + (-logit).exp());
        for _ in 0..64 {
            let middle = 0.5 * (low + high);
            if load(at(middle)) < wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        let equilibrium = self.at_eccentricity(at(0.5 * (low + high)))?;
        let near = (equilibrium.sommerfeld_number() / sommerfeld - 1.0).abs() < 1e-6;
        let requirement = "less extreme (the journal is at the centre or touches the bore)";
        require("Sommerfeld number", sommerfeld, requirement, near)?;
        Ok(equilibrium)
    }
}

/// Returns the load divided by μ Ω R L³ / c².
fn load(eccentricity: f64) -> f64 {
    let square = eccentricity * eccentricity;
    let gap = (1.0 - eccentricity) * (1.0 + eccentricity);
    eccentricity / (4.0 * gap * gap) * (PI * PI * gap + 16.0 * square).sqrt()
}

/// Returns the angle from the load to the eccentricity, in rad.
fn attitude(eccentricity: f64) -> f64 {
    let gap = (1.0 - eccentricity) * (1.0 + eccentricity);
    (PI * gap.sqrt()).atan2(4.0 * eccentricity)
}
