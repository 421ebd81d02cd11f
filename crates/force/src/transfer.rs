//! Receptance from unknown forces to measured channels, and its inverse, at one angular frequency.

use mechid_model::SecondOrderSystem;
use mechid_numerics::linear_algebra::svd;
use nalgebra::{Complex, DMatrix};

use crate::error::ForceError;
use crate::limits;
use crate::measurement::Channel;

type Line = Complex<f64>;

/// Ratio of measured channels to forces, frequency by frequency, from M, C and K or from modes.
pub trait FrequencyResponse {
    /// Returns the number of places where a force can act.
    fn inputs(&self) -> usize;

    /// Returns the number of places where a channel can measure; [`Channel::dof`] is an index of
    /// these places.
    fn sensors(&self) -> usize {
        self.inputs()
    }

    /// Returns the matrix of frequency responses (measured channels × forces) at ω (rad/s); `None`
    /// where it is not finite.
    fn response(
        &self,
        channels: &[Channel],
        forced: &[usize],
        omega: f64,
    ) -> Option<DMatrix<Complex<f64>>>;

    /// Returns the dynamic stiffness, if channels and forces are the degrees of freedom of one
    /// matrix: n × n for n degrees of freedom, in N/m.
    fn stiffness_matrix(&self, _omega: f64) -> Option<DMatrix<Complex<f64>>> {
        None
    }

    /// Returns the covariance E[δy δyᴴ] of the responses of the channels to given forces (one for
    /// each entry of `forced`, in N) due to the uncertainty of the system: channels × channels in
    /// the products of their units. `None` if the system is exact or if the caller takes its
    /// uncertainty into account in another way.
    fn response_covariance(
        &self,
        _channels: &[Channel],
        _forced: &[usize],
        _omega: f64,
        _forces: &[Complex<f64>],
    ) -> Option<DMatrix<Complex<f64>>> {
        None
    }
}

impl FrequencyResponse for SecondOrderSystem {
    fn inputs(&self) -> usize {
        self.dof()
    }

    fn response(
        &self,
        channels: &[Channel],
        forced: &[usize],
        omega: f64,
    ) -> Option<DMatrix<Complex<f64>>> {
        let forces = DMatrix::from_fn(self.dof(), forced.len(), |i, j| {
            Complex::new(if i == forced[j] { 1.0 } else { 0.0 }, 0.0)
        });
        let motion = self.dynamic_stiffness(omega).lu().solve(&forces)?;
        let is_finite = motion.iter().all(|z| z.re.is_finite() && z.im.is_finite());
        is_finite.then(|| {
            DMatrix::from_fn(channels.len(), forced.len(), |i, j| {
                let channel = channels[i];
                motion[(channel.dof, j)] * channel.quantity.per_displacement(omega)
            })
        })
    }

    fn stiffness_matrix(&self, omega: f64) -> Option<DMatrix<Complex<f64>>> {
        Some(self.dynamic_stiffness(omega))
    }
}

/// The system between the forced degrees of freedom and the measured channels.
pub(crate) struct Transfer<'a> {
    pub system: &'a dyn FrequencyResponse,
    pub channels: &'a [Channel],
    pub forced: &'a [usize],
    /// Divisor of the row of each channel: the standard deviation of its noise, or its size.
    pub scale: &'a [f64],
}

impl Transfer<'_> {
    /// Returns the transfer matrix at a line, measured channels × forces; each row is divided by
    /// the scale of its channel.
    pub fn scaled(&self, line: usize, omega: f64) -> Result<DMatrix<Line>, ForceError> {
        let mut response = self
            .system
            .response(self.channels, self.forced, omega)
            .ok_or(ForceError::Resonance { line, omega })?;
        for (mut row, scale) in response.row_iter_mut().zip(self.scale) {
            row /= Complex::from(*scale);
        }
        Ok(response)
    }

    /// Returns forces × measured channels: the matrix that turns a measured line into forces.
    ///
    /// If every degree of freedom is forced and measured once, this is the dynamic stiffness
    /// itself; otherwise it is the weighted least-squares inverse of the transfer matrix.
    pub fn inverse(&self, line: usize, omega: f64) -> Result<DMatrix<Line>, ForceError> {
        if self.measures_everything_once()
            && let Some(stiffness) = self.system.stiffness_matrix(omega)
        {
            return self.direct(&stiffness, line, omega);
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
        let n = self.system.inputs();
        let mut measured = vec![false; n];
        self.channels.iter().filter(|c| c.dof < n).for_each(|c| measured[c.dof] = true);
        self.forced.len() == n && self.channels.len() == n && measured.iter().all(|m| *m)
    }

    fn direct(
        &self,
        stiffness: &DMatrix<Line>,
        line: usize,
        omega: f64,
    ) -> Result<DMatrix<Line>, ForceError> {
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

    /// Returns an error that names the force with the smallest effect on the measured channels.
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
