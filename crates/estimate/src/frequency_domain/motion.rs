//! Which quantity a motion was measured as.

use std::fmt;

use nalgebra::Complex;

/// The quantity a sensor of motion delivers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Motion {
    /// x, in m.
    Displacement,
    /// ẋ, in m/s.
    Velocity,
    /// ẍ, in m/s².
    Acceleration,
}

impl Motion {
    /// The quantity's amplitude per unit of displacement at `omega` (rad/s): 1, iω or −ω².
    pub fn per_displacement(self, omega: f64) -> Complex<f64> {
        match self {
            Motion::Displacement => Complex::new(1.0, 0.0),
            Motion::Velocity => Complex::new(0.0, omega),
            Motion::Acceleration => Complex::new(-omega * omega, 0.0),
        }
    }
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Motion::Displacement => "displacement",
            Motion::Velocity => "velocity",
            Motion::Acceleration => "acceleration",
        })
    }
}
