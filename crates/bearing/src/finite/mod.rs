//! The bearing of finite length: Reynolds' equation solved on a mesh.

mod assembly;
mod banded;
mod equilibrium;
mod film;
mod pad;
mod step;

use std::f64::consts::PI;

pub use pad::Bore;

use crate::equilibrium::{Coefficients, Equilibrium};
use crate::error::{BearingError, require};
use equilibrium::Search;

/// Numbers of intervals of the mesh of a film.
///
/// The mesh moves with the start and the end of the film. Errors are inversely proportional to the
/// square of the number of intervals. With the default mesh and an eccentricity of at most 0.9, the
/// errors of stiffness and damping are below a thousandth of the largest stiffness and of the
/// largest damping.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mesh {
    /// Intervals from the start of the film to its end, at least 16.
    pub along: usize,
    /// Intervals from the middle of the bearing to its end, at least 8.
    pub across: usize,
}

impl Default for Mesh {
    fn default() -> Self {
        Self { along: 64, across: 12 }
    }
}

/// A bearing of finite length: the film obeys Reynolds' equation with constant viscosity, at
/// ambient pressure in the grooves and at the ends, and starts and ends where its pressure falls
/// to zero without a slope.
///
/// The coefficients are exact derivatives of the discrete equations, including those of the ends of
/// the film, not differences of forces.
///
/// ```
/// use mechid_bearing::{Bore, FiniteBearing};
///
/// // Two axial grooves of 20°, half as long as wide.
/// let bore = Bore::two_axial_grooves(20_f64.to_radians())?;
/// let equilibrium = FiniteBearing::new(bore, 0.5)?.equilibrium(1.656)?;
/// // Lund and Thomsen have 0.244, 65.85° and Kxy = 5.06.
/// assert!((equilibrium.eccentricity() - 0.244).abs() < 0.001);
/// assert!((equilibrium.attitude().to_degrees() - 65.85).abs() < 0.1);
/// assert!((equilibrium.coefficients().stiffness[0][1] - 5.06).abs() < 0.01);
/// # Ok::<(), mechid_bearing::BearingError>(())
/// ```
///
/// # Source
/// Lund and Thomsen (1978), for the equations, the boundary condition and the scaling; the moving
/// mesh and its derivatives are ours.
#[derive(Debug, Clone, PartialEq)]
pub struct FiniteBearing {
    bore: Bore,
    length_over_diameter: f64,
    mesh: Mesh,
}

impl FiniteBearing {
    /// Creates a bearing from its bore and the ratio of its length to its diameter.
    ///
    /// # Errors
    /// [`BearingError::Parameter`] if the ratio is not positive and finite.
    pub fn new(bore: Bore, length_over_diameter: f64) -> Result<Self, BearingError> {
        let positive = length_over_diameter > 0.0;
        require("length over diameter", length_over_diameter, "positive and finite", positive)?;
        Ok(Self { bore, length_over_diameter, mesh: Mesh::default() })
    }

    /// Returns the same bearing on another mesh.
    ///
    /// # Errors
    /// [`BearingError::Parameter`] for fewer than 16 intervals along the film or 8 across.
    pub fn with_mesh(self, mesh: Mesh) -> Result<Self, BearingError> {
        let (along, across) = (mesh.along as f64, mesh.across as f64);
        require("number of intervals along the film", along, "at least 16", along >= 16.0)?;
        require("number of intervals across the film", across, "at least 8", across >= 8.0)?;
        Ok(Self { mesh, ..self })
    }

    /// Solves the equilibrium at a Sommerfeld number S = μ N L D (R/c)² / W (dimensionless, N in
    /// revolutions per second, c the clearance of a pad).
    ///
    /// # Errors
    /// [`BearingError::Parameter`] if S is not positive and finite;
    /// [`BearingError::EquilibriumNotConverged`], [`BearingError::FilmNotConverged`] or
    /// [`BearingError::SingularFilm`] if no equilibrium is found (at extreme loads a finer mesh may
    /// help).
    pub fn equilibrium(&self, sommerfeld: f64) -> Result<Equilibrium, BearingError> {
        require("Sommerfeld number", sommerfeld, "positive and finite", sommerfeld > 0.0)?;
        // S is inversely proportional to the load; therefore the formula of `sommerfeld_number`
        // also gives the load from S.
        let load = self.sommerfeld_number(sommerfeld);
        let requirement = "such that the load is finite and not 0";
        require("Sommerfeld number", sommerfeld, requirement, load.is_normal())?;
        let mut search = Search::new(self, load);
        let tangent = search.equilibrium()? / load;
        let block =
            |first: usize| [0, 1].map(|row| [tangent[(row, first)], tangent[(row, first + 1)]]);
        let coefficients = Coefficients { stiffness: block(0), damping: block(2) };
        Ok(Equilibrium::new(sommerfeld, search.position.into(), coefficients))
    }

    /// Returns the Sommerfeld number S of a load that is divided by 6 μ Ω R² (R/c)².
    fn sommerfeld_number(&self, load: f64) -> f64 {
        self.length_over_diameter / (3.0 * PI * load)
    }
}
