//! Sensors and inputs by the index of their degrees of freedom.

use nalgebra::Complex;

use super::Speed;
use crate::ResponseQuantity;

/// What a sensor reads: a sum of motions; index n is the support.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorRow {
    /// Name of the channel.
    pub name: String,
    /// Degrees of freedom with their weights, the gain included.
    pub entries: Vec<(usize, f64)>,
    /// Quantity measured.
    pub quantity: ResponseQuantity,
}

/// What an input does.
#[derive(Debug, Clone, PartialEq)]
pub enum InputColumn {
    /// Forces on degrees of freedom, per unit of the input.
    Force(Vec<(usize, f64)>),
    /// Motion of the support.
    Support(ResponseQuantity),
    /// Unbalance with its degrees of freedom in x and y.
    Unbalance([usize; 2]),
}

impl InputColumn {
    /// Returns the load per unit of the input at `omega` (rad/s): forces (N) by degree of freedom, and the
    /// displacement (m) of the support at index `dof`.
    pub fn load(&self, dof: usize, omega: f64, speed: Speed) -> Vec<(usize, Complex<f64>)> {
        match self {
            Self::Force(entries) => {
                entries.iter().map(|(at, w)| (*at, Complex::from(*w))).collect()
            }
            Self::Support(quantity) => vec![(dof, quantity.per_displacement(omega).inv())],
            Self::Unbalance(at) => unbalance(*at, omega, speed).to_vec(),
        }
    }
}

/// Forces in x and y per kg·m of unbalance on a rotor that turns from x to y; backwards at a negative speed.
pub(super) fn unbalance(
    [x, y]: [usize; 2],
    omega: f64,
    speed: Speed,
) -> [(usize, Complex<f64>); 2] {
    let turn = speed.at(omega);
    [(x, Complex::from(turn * turn)), (y, Complex::new(0.0, -turn * turn.abs()))]
}
