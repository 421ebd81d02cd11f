//! Identification of a journal bearing on a test rig with a floating housing.
//!
//! The housing floats on the film of a shaft that rotates in fixed supports; two shakers excite it,
//! in separate tests or on interleaved lines of the same test. With the mass M_s of the housing,
//! its acceleration a, the shaker forces f and the displacement d of the housing relative to the
//! shaft,
//!
//! ```text
//! f − M_s a = H d,   H(ω) = K − ω² M + iω C
//! ```
//!
//! is a linear system with noise on both sides. The twelve entries of K, C and M, or the eight
//! entries of K and C, are estimated by maximum likelihood with the noise from the scatter of the
//! periods. M is the inertia of the fluid: its entries may be negative.
//!
//! | File | What it does |
//! |---|---|
//! | `settings` | settings, as values |
//! | `data` | f − M_s a and d from records or from tables of frequency responses |
//! | `film` | eight or twelve coefficients without the baseline; the likelihood-ratio test |
//! | `selection` | intervals after the test has chosen twelve |
//! | `rotation` | the speed of rotation that would explain a misfit |
//! | `checks` | checks of the records and of the residual |
//! | `stiffness` | the dynamic stiffness line by line |
//! | `summary` | the result: numbers, remarks |
//! | `element` | the bearing as an element of a machine of named elements |
//! | `ross` | the coefficients in the axes of ROSS |
//! | `speeds` | tests at several speeds and loads, and their results as one table |
//!
//! # Source
//! Childs and Hale (1994), Journal of Tribology 116, 337–344; Rouvas and Childs (1993), Journal of
//! Vibration and Acoustics 115, 264–270.

mod checks;
mod data;
mod element;
mod film;
mod ross;
mod rotation;
mod selection;
mod settings;
mod speeds;
mod stiffness;
mod summary;

use mechid_estimate::frequency_domain::LikelihoodRatio;
use nalgebra::{DMatrix, Matrix2};
use serde::{Serialize, Serializer};

pub use self::data::BearingData;
use self::film::Film;
pub use self::settings::{BearingSize, Coefficients, IdentifyBearing};
pub use self::speeds::{BearingPlan, BearingPoint, BearingTable};
pub use self::stiffness::StiffnessLine;
pub use self::summary::{Amplitude, BearingSummary, CoefficientRow, Dimensionless, StabilityRow};
use crate::{AnalysisError, time_limit};

/// Identifies the film of a bearing from tests with excitation. If there are baseline tests (of the
/// same rig without the film), their coefficients are subtracted, and their covariance is added.
///
/// # Errors
/// [`AnalysisError::Setting`] for settings that are not positive, [`AnalysisError::Estimate`] if a
/// fit fails, such as for excitation in one direction only.
///
/// # Source
/// As this module; Wilks (1938) for the likelihood-ratio test.
pub fn identify_bearing(
    tests: &BearingData,
    baseline: Option<&BearingData>,
    how: &IdentifyBearing,
) -> Result<IdentifiedBearing, AnalysisError> {
    how.check()?;
    let film = Film::new(tests, baseline, how.coefficients)?;
    let lines = stiffness::lines(tests, &film)?;
    let mut checks = checks::rows(tests, baseline, &film, how.stator_mass)?;
    checks.extend(time_limit::check());
    let summary = BearingSummary::new(tests, baseline, &film, lines, checks, how)?;
    Ok(IdentifiedBearing { film, summary })
}

/// Coefficients of a bearing, with the fit of the tests.
///
/// [`Display`](std::fmt::Display) writes the result for people, `serde` for programs.
#[derive(Debug)]
pub struct IdentifiedBearing {
    film: Film,
    summary: BearingSummary,
}

impl IdentifiedBearing {
    /// Returns K, 2×2, in N/m.
    pub fn stiffness(&self) -> Matrix2<f64> {
        self.film.matrix(0)
    }

    /// Returns C, 2×2, in N·s/m.
    pub fn damping(&self) -> Matrix2<f64> {
        self.film.matrix(1)
    }

    /// Returns M, 2×2, in kg: zero if eight coefficients were identified.
    pub fn mass(&self) -> Matrix2<f64> {
        self.film.matrix(2)
    }

    /// Returns the covariance of the coefficients, one row per coefficient, in products of their
    /// units. The order is kxx, kxy, kyx, kyy, cxx, …, cyy, mxx, …, myy.
    pub fn covariance(&self) -> &DMatrix<f64> {
        self.film.covariance()
    }

    /// Returns the test whether the inertia of the fluid is negligible; `None` if the noise is not
    /// known.
    pub fn inertia_test(&self) -> Option<LikelihoodRatio> {
        self.film.inertia
    }

    /// Returns the numbers and remarks.
    pub fn summary(&self) -> &BearingSummary {
        &self.summary
    }
}

impl std::fmt::Display for IdentifiedBearing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.summary.fmt(f)
    }
}

impl Serialize for IdentifiedBearing {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.summary.serialize(serializer)
    }
}
