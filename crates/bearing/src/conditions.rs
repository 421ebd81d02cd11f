//! Size, oil and speed of a bearing, and conversions between SI units and dimensionless numbers.

use std::f64::consts::TAU;

use mechid_model::OilFilm;

use crate::equilibrium::Coefficients;
use crate::error::{BearingError, require};

/// Size, oil and speed of a bearing.
///
/// ```
/// use mechid_bearing::{Conditions, ShortBearing};
///
/// let conditions = Conditions {
///     diameter: 0.1, length: 0.05, clearance: 100e-6, viscosity: 0.02, omega: 314.0,
/// };
/// let load = 1000.0;
/// let sommerfeld = conditions.sommerfeld_number(load)?;
/// let bearing = ShortBearing::new(conditions.length_over_diameter()?)?;
/// let equilibrium = bearing.equilibrium(sommerfeld)?;
/// let film = conditions.film(equilibrium.coefficients(), load)?;
/// assert!(film.kxy > 0.0 && film.kyx < 0.0);
/// # Ok::<(), mechid_bearing::BearingError>(())
/// ```
///
/// # Source
/// Lund and Thomsen (1978), for the dimensionless groups.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditions {
    /// Diameter of the journal, in m.
    pub diameter: f64,
    /// Length of the bearing, in m.
    pub length: f64,
    /// Radial clearance of a pad, in m.
    pub clearance: f64,
    /// Dynamic viscosity of the oil, in Pa·s.
    pub viscosity: f64,
    /// Speed of rotation Ω, in rad/s.
    pub omega: f64,
}

impl Conditions {
    /// Ratio L / D of length to diameter.
    ///
    /// # Errors
    /// [`BearingError::Parameter`] naming the value that is not positive and finite.
    pub fn length_over_diameter(&self) -> Result<f64, BearingError> {
        self.check()?;
        Ok(self.length / self.diameter)
    }

    /// Returns the Sommerfeld number S = μ N L D (R/c)² / W (dimensionless) for a static load (N),
    /// with N in revolutions per second.
    ///
    /// # Errors
    /// [`BearingError::Parameter`] naming the value that is not positive and finite.
    pub fn sommerfeld_number(&self, load: f64) -> Result<f64, BearingError> {
        self.check()?;
        require("load", load, "positive and finite", load > 0.0)?;
        Ok(self.load_of_unit() / load)
    }

    /// Returns the static load W (N) of a Sommerfeld number (dimensionless).
    ///
    /// # Errors
    /// [`BearingError::Parameter`] naming the value that is not positive and finite.
    pub fn load(&self, sommerfeld: f64) -> Result<f64, BearingError> {
        self.check()?;
        require("Sommerfeld number", sommerfeld, "positive and finite", sommerfeld > 0.0)?;
        Ok(self.load_of_unit() / sommerfeld)
    }

    /// Returns the coefficients with their units under a load W (N): stiffness K W / c and damping
    /// C W / (c Ω), with the dimensionless K and C and the radial clearance c.
    ///
    /// x is along the load, y across it in the direction of rotation; kyx is an entry of the
    /// stiffness matrix (`KyxSign::Plus`).
    ///
    /// # Errors
    /// [`BearingError::Parameter`] naming the value that is not positive and finite.
    pub fn film(&self, coefficients: &Coefficients, load: f64) -> Result<OilFilm, BearingError> {
        let [stiffness, damping] = self.units(load)?;
        let [[kxx, kxy], [kyx, kyy]] = coefficients.stiffness.map(|row| row.map(|k| k * stiffness));
        let [[cxx, cxy], [cyx, cyy]] = coefficients.damping.map(|row| row.map(|c| c * damping));
        Ok(OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy })
    }

    /// Returns the dimensionless coefficients of a film under a load (N), the inverse of
    /// [`film`](Self::film).
    ///
    /// # Errors
    /// [`BearingError::Parameter`] naming the value that is not positive and finite.
    pub fn coefficients(&self, film: &OilFilm, load: f64) -> Result<Coefficients, BearingError> {
        let [stiffness, damping] = self.units(load)?;
        let OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy } = *film;
        Ok(Coefficients {
            stiffness: [[kxx, kxy], [kyx, kyy]].map(|row| row.map(|k| k / stiffness)),
            damping: [[cxx, cxy], [cyx, cyy]].map(|row| row.map(|c| c / damping)),
        })
    }

    /// Returns the factors W / c (N/m) and W / (c Ω) (N·s/m) of stiffness and damping.
    fn units(&self, load: f64) -> Result<[f64; 2], BearingError> {
        self.check()?;
        require("load", load, "positive and finite", load > 0.0)?;
        let stiffness = load / self.clearance;
        Ok([stiffness, stiffness / self.omega])
    }

    fn load_of_unit(&self) -> f64 {
        let slenderness = self.diameter / (2.0 * self.clearance);
        let pressure = self.viscosity * self.omega / TAU;
        pressure * self.length * self.diameter * slenderness * slenderness
    }

    pub(crate) fn check(&self) -> Result<(), BearingError> {
        for (name, value) in [
            ("diameter", self.diameter),
            ("length", self.length),
            ("clearance", self.clearance),
            ("viscosity", self.viscosity),
            ("speed of rotation", self.omega),
        ] {
            require(name, value, "positive and finite", value > 0.0)?;
        }
        Ok(())
    }
}
