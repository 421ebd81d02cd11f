//! Receptance from unknown forces to measured channels, and its inverse, at one angular frequency.

use mechid_model::SecondOrderSystem;
use mechid_numerics::linear_algebra::svd;
use nalgebra::{Complex, DMatrix};

use crate::error::ForceError;
use crate::limits;
use crate::measurement::Channel;

type Line = Complex<f64>;

/// The system between the forced degrees of freedom and the measured channels.
pub(crate) struct Transfer<'a> {
    pub system: &'a SecondOrderSystem,
    pub channels: &'a [Channel],
    pub forced: &'a [usize],
    /// Standard deviation of each channel's noise, or its size: the divisor of its row.
    pub scale: &'a [f64],
}

impl Transfer<'_> {
    /// Measured channels × forces, each row divided by the scale of its channel.
    pub fn scaled(&self, line: usize, omega: f64) -> Result<DMatrix<Line>, ForceError> {
        let n = self.system.dof();
        let forces = DMatrix::from_fn(n, self.forced.len(), |i, j| {
            Complex::new(if i == self.forced[j] { 1.0 } else { 0.0 }, 0.0)
        });
        let motion = self
            .system
            .dynamic_stiffness(omega)
            .lu()
            .solve(&forces)
            .filter(|motion| motion.iter().all(|z| z.re.is_finite() && z.im.is_finite()))
            .ok_or(ForceError::Resonance { line, omega })?;
        Ok(DMatrix::from_fn(self.channels.len(), self.forced.len(), |i, j| {
            let channel = self.channels[i];
            motion[(channel.dof, j)] * channel.quantity.per_displacement(omega) / self.scale[i]
        }))
    }

    /// Forces × measured channels: the matrix that turns a measured line into forces.
    ///
    /// With every degree of freedom forced and measured once this is the dynamic stiffness itself;
    /// otherwise the weighted least-squares inverse of the transfer matrix.
    pub fn inverse(&self, line: usize, omega: f64) -> Result<DMatrix<Line>, ForceError> {
        if self.measures_everything_once() {
            return self.direct(line, omega);
        }
        let transfer = self.scaled(line, omega)?;
        let svd = svd(transfer.clone())?;
        let (largest, smallest) = (svd.singular_values.max(), svd.singular_values.min());
        let reciprocal_condition = if largest > 0.0 { smallest / largest } else { 0.0 };
        if reciprocal_condition < limits::NOT_TRANSMITTED {
            return Err(self.not_transmitted(line, omega, &transfer, reciprocal_condition));
        }
        let (u, v_t) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
        let mut right = v_t.adjoint();
        for (mut column, s) in right.column_iter_mut().zip(&svd.singular_values) {
            column /= Complex::new(*s, 0.0);
        }
        let mut inverse = right * u.adjoint();
        for (mut column, scale) in inverse.column_iter_mut().zip(self.scale) {
            column /= Complex::new(*scale, 0.0);
        }
        Ok(inverse)
    }

    fn measures_everything_once(&self) -> bool {
        let n = self.system.dof();
        let mut measured = vec![false; n];
        self.channels.iter().for_each(|c| measured[c.dof] = true);
        self.forced.len() == n && self.channels.len() == n && measured.iter().all(|m| *m)
    }

    fn direct(&self, line: usize, omega: f64) -> Result<DMatrix<Line>, ForceError> {
        let stiffness = self.system.dynamic_stiffness(omega);
        let mut inverse = DMatrix::zeros(self.forced.len(), self.channels.len());
        for (c, channel) in self.channels.iter().enumerate() {
            let derivative = channel.quantity.per_displacement(omega);
            if derivative.norm() == 0.0 {
                let (dof, reciprocal_condition) = (channel.dof, 0.0);
                return Err(ForceError::NotTransmitted { line, omega, dof, reciprocal_condition });
            }
            for (f, dof) in self.forced.iter().enumerate() {
                inverse[(f, c)] = stiffness[(*dof, channel.dof)] / derivative;
            }
        }
        Ok(inverse)
    }

    /// Returns the error with the force that has the smallest effect on the measured channels.
    fn not_transmitted(
        &self,
        line: usize,
        omega: f64,
        transfer: &DMatrix<Line>,
        reciprocal_condition: f64,
    ) -> ForceError {
        let norms = transfer.column_iter().map(|column| column.norm()).enumerate();
        let (column, _) = norms.min_by(|a, b| a.1.total_cmp(&b.1)).expect("a force is sought");
        ForceError::NotTransmitted { line, omega, dof: self.forced[column], reciprocal_condition }
    }
}
