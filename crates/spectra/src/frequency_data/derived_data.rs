//! Data that are derived from other data: without the transients of open records, under a window,
//! with a delay, or with only one load.

use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_numerics::check_size;
use nalgebra::{Complex, DMatrix};

use super::FrequencyData;
use crate::SpectraError;
use crate::noise::pulse::PulseErrors;
use crate::thinning::thinned_rows;

impl FrequencyData {
    fn no_longer_open(&mut self) {
        self.transient = DMatrix::zeros(self.len(), 0);
        self.open.clear();
    }

    /// Returns the same lines, treated as lines of whole periods, with their forces replaced by
    /// `force` (N), rows × n.
    pub(crate) fn with_closed_force(&self, force: DMatrix<Complex<f64>>) -> Self {
        let mut closed = Self { force, ..self.clone() };
        closed.no_longer_open();
        closed
    }

    /// Returns one of every `step` rows, without the noise; `None` for data with errors of pulses,
    /// which are common to all rows, and for a step of 0.
    pub fn thinned(&self, step: usize) -> Option<Self> {
        if step == 0 || !self.pulses.is_empty() {
            return None;
        }
        let rows = thinned_rows(self.len(), step);
        Some(Self {
            omega: rows.iter().map(|row| self.omega[*row]).collect(),
            force: self.force.select_rows(&rows),
            displacement: self.displacement.select_rows(&rows),
            measured: self.measured,
            noise: None,
            force_variance: self.force_variance.select_rows(&rows),
            transient: self.transient.select_rows(&rows),
            open: self.open.clone(),
            pulses: Vec::new(),
        })
    }

    /// Returns the same data with the variance of the noise of all forces, as set by
    /// [`FrequencyData::with_force_noise`], times a factor.
    #[must_use]
    pub fn with_reduced_force_noise(&self, factor: f64) -> Self {
        Self { force_variance: &self.force_variance * factor, ..self.clone() }
    }

    /// Returns the same data with other forces (N) and other variances of their noise (N²), both
    /// rows × n.
    #[must_use]
    pub fn with_noisy_force(&self, force: DMatrix<Complex<f64>>, variance: DMatrix<f64>) -> Self {
        Self { force, force_variance: variance, ..self.clone() }
    }

    /// Returns the same data without the errors of the pulses of the forces (N), which are the
    /// `amplitudes` (pure numbers) times the patterns of all [`FrequencyData::pulse_errors`], in
    /// their order. The forces of the result count as exact.
    ///
    /// # Errors
    /// [`SpectraError::Numerics`] if the numbers of amplitudes and patterns differ.
    ///
    /// # Source
    /// As [`PulseErrors::at`](crate::noise::pulse::PulseErrors::at).
    pub fn without_pulse_errors(&self, amplitudes: &[f64]) -> Result<Self, SpectraError> {
        let count = self.pulses.iter().map(PulseErrors::count).sum();
        check_size("amplitudes of the errors of pulses", count, amplitudes.len())?;
        let mut corrected = self.clone();
        let mut following = amplitudes;
        for pulse in &self.pulses {
            let (own, rest) = following.split_at(pulse.count());
            following = rest;
            for row in pulse.rows() {
                let errors = pulse.at(self.omega[row]);
                let error: Complex<f64> = errors.iter().zip(own).map(|(e, a)| e * *a).sum();
                corrected.force[(row, pulse.input())] -= error;
                corrected.force_variance[(row, pulse.input())] = 0.0;
            }
        }
        Ok(corrected)
    }

    /// Returns the same data with the same first-order high-pass filter on all channels. The
    /// `corner` frequency is in rad/s. The channels in `responses` and `forces`, counted from 0,
    /// were already filtered during the measurement; the filter is applied to all other channels. A
    /// filter that is equal on all channels does not change the system, and a high-pass filter does
    /// not amplify noise. The errors of pulses are not filtered.
    ///
    /// # Source
    /// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapter 2 (first-order systems).
    #[must_use]
    pub fn with_high_pass_alike(&self, responses: &[usize], forces: &[usize], corner: f64) -> Self {
        let mut data = self.clone();
        for (row, omega) in self.omega.iter().enumerate() {
            let gain = Complex::new(1.0, -corner / omega).inv();
            for channel in 0..self.dof() {
                if !responses.contains(&channel) {
                    data.displacement[(row, channel)] *= gain;
                }
                if !forces.contains(&channel) {
                    data.force[(row, channel)] *= gain;
                    data.force_variance[(row, channel)] *= gain.norm_sqr();
                }
            }
        }
        data
    }

    /// Returns the same data with other displacements (m), rows × n.
    #[must_use]
    pub fn with_displacement(&self, displacement: DMatrix<Complex<f64>>) -> Self {
        Self { displacement, ..self.clone() }
    }

    /// Returns the lines as if all records were whole periods. The load of the transients is the
    /// force minus the `closed` force (N). The response of `system` to this load is subtracted from
    /// the displacement (m).
    ///
    /// # Source
    /// Ewins, *Modal Testing*, 2nd ed. (2000), chapter 2 (the response as receptance times force).
    #[must_use]
    pub fn without_response_to_transient(
        &self,
        closed: &DMatrix<Complex<f64>>,
        system: &SecondOrderSystem,
    ) -> Self {
        let mut alone = self.clone();
        for (row, omega) in self.omega.iter().enumerate() {
            // The receptance is infinite at an undamped resonance, so the displacement on this line
            // is not changed.
            if let Ok(receptance) = system.receptance(*omega) {
                let load = (closed.row(row) - self.force.row(row)).transpose();
                let displacement = self.displacement.row(row) - (receptance * load).transpose();
                alone.displacement.row_mut(row).copy_from(&displacement);
            }
        }
        alone.no_longer_open();
        alone
    }

    /// Returns data without a force, whose response is a step between the initial and final values
    /// of `channel`: the lines of this step decrease as 1/s.
    pub fn step_data(&self, channel: usize) -> Self {
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

    /// Returns data whose force is the term s^`power` of a transient on degree of freedom `dof`;
    /// all displacements are zero.
    pub fn load_data(&self, dof: usize, power: usize) -> Self {
        let load = |row: usize, column: usize| {
            let omega = self.omega[row];
            let unit = self.measured.per_displacement(omega).inv();
            if column == dof {
                unit * Complex::new(0.0, omega).powu(power as u32)
            } else {
                Complex::ZERO
            }
        };
        Self {
            force: DMatrix::from_fn(self.len(), self.dof(), load),
            displacement: DMatrix::zeros(self.len(), self.dof()),
            ..self.clone()
        }
    }

    /// Returns data of a force of 1 N on degree of freedom `dof` at every line, without a response.
    #[must_use]
    pub fn unit_force_data(&self, dof: usize) -> Self {
        let force = |_, column: usize| Complex::from(if column == dof { 1.0 } else { 0.0 });
        Self {
            force: DMatrix::from_fn(self.len(), self.dof(), force),
            displacement: DMatrix::zeros(self.len(), self.dof()),
            ..self.clone()
        }
    }

    /// Returns second differences of neighbouring lines of equal spacing. These are the spectra
    /// under a Hann window; transients have little weight in them. Rows at the ends of a band are
    /// unchanged.
    ///
    /// # Source
    /// Harris (1978), Proceedings of the IEEE 66, 51–83 (windows as convolutions of lines).
    pub fn under_hann_window(&self) -> Self {
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
            transient: DMatrix::zeros(self.len(), 0),
            open: Vec::new(),
            ..self.clone()
        }
    }

    /// Returns the data with the measured responses taken as those of `quantity`, without the noise
    /// of the displacements.
    ///
    /// # Source
    /// x = y/(iω)^d for the derivative y of order d.
    #[must_use]
    pub fn taken_as(&self, quantity: ResponseQuantity) -> Self {
        let mut taken = Self { measured: quantity, noise: None, ..self.clone() };
        for (row, omega) in self.omega.iter().enumerate() {
            let factor = self.measured.per_displacement(*omega) / quantity.per_displacement(*omega);
            taken.displacement.row_mut(row).apply(|x| *x *= factor);
            taken.transient.row_mut(row).apply(|x| *x *= factor);
        }
        taken
    }

    /// Returns the same data with the force delayed by `delay` seconds.
    ///
    /// # Source
    /// The shift theorem of Fourier transforms.
    #[must_use]
    pub fn with_later_force(&self, delay: f64) -> Self {
        let mut later = self.clone();
        for (row, omega) in self.omega.iter().enumerate() {
            let turn = Complex::cis(-omega * delay);
            later.force.row_mut(row).apply(|f| *f *= turn);
        }
        later.noise = self.noise.as_ref().map(|noise| noise.with_later_force(delay));
        later.pulses = self.pulses.iter().map(|pulse| pulse.delayed(delay)).collect();
        later
    }
}
