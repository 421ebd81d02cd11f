//! Elements of a machine.

use nalgebra::DMatrix;

use super::Coefficient;

/// Name that refers to the ground or the moving support instead of a degree of freedom.
pub const SUPPORT: &str = "support";

/// Part of a machine; degrees of freedom are given by name, and [`SUPPORT`] is the ground.
#[derive(Debug, Clone, PartialEq)]
pub enum Element {
    /// Mass (kg), or moment of inertia (kg·m²) for a rotation.
    Mass {
        /// Degree of freedom.
        at: String,
        /// Mass.
        mass: Coefficient,
    },
    /// Spring, damper or both between two degrees of freedom, or between a degree of freedom and
    /// the support.
    Link {
        /// Degrees of freedom at the two ends.
        between: [String; 2],
        /// Stiffness k, in N/m.
        stiffness: Coefficient,
        /// Damping c, in N·s/m.
        damping: Coefficient,
        /// Loss factor η of the stiffness: k (1 + iη).
        loss_factor: Coefficient,
    },
    /// Bearing: a general 2 × 2 block of coefficients between two directions at one point and the
    /// same directions at another point or the support.
    Bearing(Box<Bearing>),
    /// Known matrices of a part of the machine, each multiplied by a factor.
    Matrices(Box<MatrixElement>),
    /// Residual unbalance U = m e of a rotor, known or unknown. At the speed Ω it causes the force
    /// Ω² U in x and −iΩ² U in y.
    Unbalance {
        /// Degrees of freedom in the directions x and y; the rotor turns from x to y.
        at: [String; 2],
        /// Real part of the unbalance U, in kg·m.
        real: Coefficient,
        /// Imaginary part of the unbalance U, in kg·m.
        imaginary: Coefficient,
    },
}

/// Coefficients of a bearing or of any other 2 × 2 block, in the order xx, xy, yx, yy.
#[derive(Debug, Clone, PartialEq)]
pub struct Bearing {
    /// Degrees of freedom in the directions x and y.
    pub at: [String; 2],
    /// Degrees of freedom of the housing in the directions x and y; `None` if the bearing ends at
    /// the support.
    pub to: Option<[String; 2]>,
    /// Stiffness k, in N/m.
    pub stiffness: [Coefficient; 4],
    /// Damping c, in N·s/m.
    pub damping: [Coefficient; 4],
    /// Fluid mass m, in kg.
    pub mass: [Coefficient; 4],
}

/// Matrices over some degrees of freedom, d × d; a matrix that is `None` is zero.
#[derive(Debug, Clone, PartialEq)]
pub struct MatrixElement {
    /// Degrees of freedom of the rows and columns.
    pub dofs: Vec<String>,
    /// Mass matrix M, d × d, in kg, and the coefficient that multiplies it.
    pub mass: Option<(DMatrix<f64>, Coefficient)>,
    /// Damping matrix C, d × d, in N·s/m, and the coefficient that multiplies it.
    pub damping: Option<(DMatrix<f64>, Coefficient)>,
    /// Stiffness matrix K, d × d, in N/m, and the coefficient that multiplies it.
    pub stiffness: Option<(DMatrix<f64>, Coefficient)>,
    /// Matrix G of the gyroscopic force Ω G ẋ, d × d, in kg·m² (kg for translations), and the
    /// coefficient that multiplies G.
    pub gyroscopic: Option<(DMatrix<f64>, Coefficient)>,
}

impl MatrixElement {
    /// Creates an element of known matrices M (kg), C (N·s/m) and K (N/m) over these degrees of
    /// freedom.
    pub fn new(
        dofs: Vec<String>,
        mass: DMatrix<f64>,
        damping: DMatrix<f64>,
        stiffness: DMatrix<f64>,
    ) -> Self {
        let known = |matrix| Some((matrix, Coefficient::Known(1.0)));
        let (mass, damping, stiffness) = (known(mass), known(damping), known(stiffness));
        Self { dofs, mass, damping, stiffness, gyroscopic: None }
    }

    /// Returns the element with a known gyroscopic matrix G of the force Ω G ẋ.
    #[must_use]
    pub fn with_gyroscopic(self, gyroscopic: DMatrix<f64>) -> Self {
        Self { gyroscopic: Some((gyroscopic, Coefficient::Known(1.0))), ..self }
    }
}

impl Element {
    /// Returns a mass at a degree of freedom, in kg.
    pub fn mass(at: &str, mass: impl Into<Coefficient>) -> Self {
        Self::Mass { at: at.to_owned(), mass: mass.into() }
    }

    /// Returns a spring between two degrees of freedom, in N/m.
    pub fn spring(between: [&str; 2], stiffness: impl Into<Coefficient>) -> Self {
        Self::spring_damper(between, stiffness, 0.0)
    }

    /// Returns a damper between two degrees of freedom, in N·s/m.
    pub fn damper(between: [&str; 2], damping: impl Into<Coefficient>) -> Self {
        Self::spring_damper(between, 0.0, damping)
    }

    /// Returns a spring (N/m) and a damper (N·s/m), in parallel between two degrees of freedom.
    pub fn spring_damper(
        between: [&str; 2],
        stiffness: impl Into<Coefficient>,
        damping: impl Into<Coefficient>,
    ) -> Self {
        Self::Link {
            between: between.map(str::to_owned),
            stiffness: stiffness.into(),
            damping: damping.into(),
            loss_factor: Coefficient::default(),
        }
    }

    /// Returns a bearing to the support with stiffness (N/m) and damping (N·s/m) in the order xx,
    /// xy, yx, yy.
    pub fn bearing(at: [&str; 2], stiffness: [Coefficient; 4], damping: [Coefficient; 4]) -> Self {
        Self::Bearing(Box::new(Bearing {
            at: at.map(str::to_owned),
            to: None,
            stiffness,
            damping,
            mass: [0.0; 4].map(Coefficient::Known),
        }))
    }
}
