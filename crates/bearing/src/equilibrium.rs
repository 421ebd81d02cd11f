//! Static equilibrium of a bearing under its load.

/// Position of the journal under a static load, and the coefficients of the film at this position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equilibrium {
    sommerfeld: f64,
    position: [f64; 2],
    coefficients: Coefficients,
}

impl Equilibrium {
    pub(crate) fn new(sommerfeld: f64, position: [f64; 2], coefficients: Coefficients) -> Self {
        Self { sommerfeld, position, coefficients }
    }

    /// Sommerfeld number S = μ N L D (R/c)² / W, dimensionless.
    pub fn sommerfeld_number(&self) -> f64 {
        self.sommerfeld
    }

    /// Position of the journal along the load and across, in clearances (a ratio each).
    pub fn position(&self) -> [f64; 2] {
        self.position
    }

    /// Eccentricity of the journal over the clearance of a pad, a ratio.
    pub fn eccentricity(&self) -> f64 {
        self.position[0].hypot(self.position[1])
    }

    /// Attitude angle from the load to the eccentricity in the direction of rotation, in rad.
    pub fn attitude(&self) -> f64 {
        self.position[1].atan2(self.position[0])
    }

    /// The eight coefficients of the film.
    pub fn coefficients(&self) -> &Coefficients {
        &self.coefficients
    }
}

/// Eight coefficients of a film, dimensionless. The coefficient of a stiffness k (N/m) is k c / W,
/// and that of a damping b (N·s/m) is b Ω c / W, with the clearance c, the load W and the speed of
/// rotation Ω.
///
/// Index 0 is along the load, 1 across it in the direction of rotation; the first index belongs to
/// the force, the second to the motion. [`Conditions`](crate::Conditions) converts the coefficients
/// to SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients {
    /// Stiffness coefficients, a 2×2 matrix, dimensionless.
    pub stiffness: [[f64; 2]; 2],
    /// Damping coefficients, a 2×2 matrix, dimensionless.
    pub damping: [[f64; 2]; 2],
}
