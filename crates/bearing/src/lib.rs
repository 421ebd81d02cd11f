//! Journal bearings from their geometry: film force, equilibrium, dynamic coefficients, threshold
//! of instability.
//!
//! ```
//! use mechid_bearing::{Bore, Conditions, FiniteBearing, Threshold};
//!
//! // An elliptical bearing with two grooves of 20° and a preload of one half.
//! let bore = Bore::elliptical(0.5, 20_f64.to_radians())?;
//! let conditions = Conditions {
//!     diameter: 0.1, length: 0.1, clearance: 200e-6, viscosity: 0.02, omega: 314.16,
//! };
//! let load = 3000.0;
//! let bearing = FiniteBearing::new(bore, conditions.length_over_diameter()?)?;
//! let equilibrium = bearing.equilibrium(conditions.sommerfeld_number(load)?)?;
//!
//! // Eight coefficients in N/m and N·s/m, and the heaviest rotor that they keep stable.
//! let film = conditions.film(equilibrium.coefficients(), load)?;
//! let threshold = Threshold::new(&film, conditions.omega)?;
//! assert!(threshold.whirl_frequency_ratio().unwrap() < 0.5);
//! assert!(threshold.critical_mass().unwrap() > 0.0);
//! # Ok::<(), mechid_bearing::BearingError>(())
//! ```
//!
//! | To get | Use |
//! |---|---|
//! | eccentricity and coefficients of a short bearing, in closed form | [`ShortBearing`] |
//! | the force of a short film at any position and velocity | [`ShortFilm`] |
//! | eccentricity and coefficients of a bearing of any length | [`FiniteBearing`] with a [`Bore`] |
//! | numbers with units from numbers without, and back | [`Conditions`] |
//! | whirl frequency ratio, critical mass and their standard errors | [`Threshold`] |
//!
//! x is along the static load and y across it, such that the journal rotates from x to y.
//! Eccentricities and coefficients are scaled by the clearance of a pad. For an elliptical bearing
//! this clearance is the difference between the radii of a lobe and of the journal, not the
//! assembled clearance.

mod conditions;
mod equilibrium;
mod error;
mod finite;
mod limits;
mod short;
mod stability;

pub use conditions::Conditions;
pub use equilibrium::{Coefficients, Equilibrium};
pub use error::BearingError;
pub use finite::{Bore, FiniteBearing, Mesh};
pub use short::{FilmForce, ShortBearing, ShortFilm};
pub use stability::{Threshold, ThresholdErrors};
