//! Data made of others: with the ends of open records taken off, under a window, later, or of one load alone.

use mechid_model::SecondOrderSystem;
use nalgebra::{Complex, DMatrix};

use super::FrequencyData;
use crate::frequency_domain::ends::Ends;

impl FrequencyData {
    fn no_longer_open(&mut self) {
        self.ends = DMatrix::zeros(self.len(), 0);
        self.open.clear();
    }

    /// The same data with other displacements (m), rows × n.
    pub(in crate::frequency_domain) fn with_displacement(
        &self,
        displacement: DMatrix<Complex<f64>>,
    ) -> Self {
        Self { displacement, ..self.clone() }
    }

    /// The rows that belong to periods: those of open records with the unknown load of their ends, by `tau`
    /// in the order of [`Ends`], taken off the force.
    pub(crate) fn with_load_of_ends(&self, tau: &[f64]) -> Self {
        let ends = Ends::new(self, tau);
        let mut closed = self.clone();
        for row in 0..self.len() {
            let mut force = self.force.row(row).transpose();
            ends.take_off(row, force.as_mut_slice());
            closed.force.row_mut(row).copy_from(&force.transpose());
        }
        closed.no_longer_open();
        closed
    }

    /// The rows that belong to periods, those of open records with the response of `system` to the load of their
    /// ends, the force less the `closed` one, taken off the displacement.
    pub(crate) fn with_response_of_load_taken_off(
        &self,
        closed: &DMatrix<Complex<f64>>,
        system: &SecondOrderSystem,
    ) -> Self {
        let mut alone = self.clone();
        for (row, omega) in self.omega.iter().enumerate() {
            // At an undamped resonance the motion is that of rounding: it stays as it is.
            if let Ok(receptance) = system.receptance(*omega) {
                let load = (closed.row(row) - self.force.row(row)).transpose();
                let displacement = self.displacement.row(row) - (receptance * load).transpose();
                alone.displacement.row_mut(row).copy_from(&displacement);
            }
        }
        alone.no_longer_open();
        alone
    }

    /// A jump between the ends of a record in what channel `channel` reads, without a force: its lines fall as 1/s.
    pub(crate) fn of_jump(&self, channel: usize) -> Self {
        let jump = |row: usize, column: usize| {
            let omega = self.omega[row];
            let read = Complex::new(0.0, omega) * self.measured.per_displacement(omega);
            if column == channel { read.inv() } else { Complex::ZERO }
        };
        Self {
            force: DMatrix::zeros(self.len(), self.dof()),
            displacement: DMatrix::from_fn(self.len(), self.dof(), jump),
            ..self.clone()
        }
    }

    /// A load that the ends of a record put on degree of freedom `dof`, a polynomial's term s^`power`, without a motion.
    pub(crate) fn of_load(&self, dof: usize, power: usize) -> Self {
        let load = |row: usize, column: usize| {
            let omega = self.omega[row];
            let unit = self.measured.per_displacement(omega).inv();
            match column == dof {
                true => unit * Complex::new(0.0, omega).powu(power as u32),
                false => Complex::ZERO,
            }
        };
        Self {
            force: DMatrix::from_fn(self.len(), self.dof(), load),
            displacement: DMatrix::zeros(self.len(), self.dof()),
            ..self.clone()
        }
    }

    /// A force of 1 N on degree of freedom `dof` at every line, without a motion.
    pub(in crate::frequency_domain) fn of_force(&self, dof: usize) -> Self {
        let force = |_, column: usize| Complex::from(if column == dof { 1.0 } else { 0.0 });
        Self {
            force: DMatrix::from_fn(self.len(), self.dof(), force),
            displacement: DMatrix::zeros(self.len(), self.dof()),
            ..self.clone()
        }
    }

    /// Second differences of neighbouring lines of the same spacing, in which the ends of a record count little:
    /// the spectra under a Hann window. Rows at the ends of a band stay as they are.
    ///
    /// # Source
    /// Harris (1978), Proceedings of the IEEE 66, 51–83 (windows as convolutions of lines).
    pub(crate) fn under_hann_window(&self) -> Self {
        let windowed = |amplitudes: &DMatrix<Complex<f64>>, unit: &dyn Fn(f64) -> Complex<f64>| {
            let mut windowed = amplitudes.clone();
            for row in 1..self.len().saturating_sub(1) {
                let [before, at, after] = [row - 1, row, row + 1].map(|row| self.omega[row]);
                if ((at - before) - (after - at)).abs() > 1e-6 * (at - before).abs() {
                    continue;
                }
                let sides = amplitudes.row(row - 1) * (unit(before) / unit(at))
                    + amplitudes.row(row + 1) * (unit(after) / unit(at));
                let here = amplitudes.row(row).scale(0.5) - sides.scale(0.25);
                windowed.row_mut(row).copy_from(&here);
            }
            windowed
        };
        Self {
            force: windowed(&self.force, &|_| Complex::from(1.0)),
            displacement: windowed(&self.displacement, &|w| self.measured.per_displacement(w)),
            ends: DMatrix::zeros(self.len(), 0),
            open: Vec::new(),
            ..self.clone()
        }
    }

    /// The same data with the force `delay` seconds later.
    pub(crate) fn with_later_force(&self, delay: f64) -> Self {
        let mut later = self.clone();
        for (row, omega) in self.omega.iter().enumerate() {
            let turn = Complex::cis(-omega * delay);
            later.force.row_mut(row).apply(|f| *f *= turn);
        }
        later.noise = self.noise.as_ref().map(|noise| noise.with_later_force(delay));
        later
    }
}
