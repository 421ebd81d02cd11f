//! Some of the modes of a large machine.

use std::f64::consts::TAU;
use std::fmt;

use mechid_analysis::text::{significant, text_table};
use mechid_integrate::{IntegrateError, ModeSearch, SparseMode, sparse_modes};
use mechid_model::SparseSystem;
use mechid_signal::message;
use serde::Serialize;

/// Modes of an exactly known machine of any size: those with the lowest natural frequencies, or
/// those nearest to a frequency; `Display` writes them as text, `Serialize` as data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelectedModes {
    /// Name of the machine.
    pub file: String,
    /// Number of degrees of freedom.
    pub degrees_of_freedom: usize,
    /// Frequency to which the modes are nearest, in Hz; `None` if they are the lowest.
    pub near_hz: Option<f64>,
    /// Modes, in the order of the search.
    pub modes: Vec<SelectedMode>,
}

/// One computed mode of a large machine.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelectedMode {
    /// `true` if the mode is underdamped.
    pub oscillates: bool,
    /// `true` for a motion without restoring force: the eigenvalue is zero up to rounding.
    pub is_rigid_body: bool,
    /// Natural frequency, in Hz; for a real eigenvalue its modulus over 2π.
    pub natural_frequency_hz: f64,
    /// Damped frequency, in Hz.
    pub damped_frequency_hz: f64,
    /// Damping ratio, a pure number; negative if unstable, ±1 for a real eigenvalue.
    pub damping_ratio: f64,
    /// Real and imaginary part of the eigenvalue, in rad/s.
    pub eigenvalue: [f64; 2],
    /// ‖(λ²M + λC + K) φ‖ relative to the size of its terms (pure number).
    pub residual: f64,
    /// Number, from 1, of the degree of freedom with the largest motion.
    pub largest: usize,
    /// Real and imaginary part of one entry per degree of freedom; the largest is 1.
    pub shape: Vec<[f64; 2]>,
}

impl SelectedModes {
    /// Computes `count` modes of the machine in `file`, or fewer if it has no more.
    ///
    /// ```
    /// use mechid::integrate::ModeSearch;
    /// use mechid::selected_modes::SelectedModes;
    /// use mechid::model::{SparseSystem, band};
    ///
    /// // A chain of 1,000 masses.
    /// let stiffness = band(1000, &[(-1, -900.0), (0, 1800.0), (1, -900.0)]);
    /// let chain = SparseSystem::new(band(1000, &[(0, 1.0)]), band(1000, &[]), stiffness)?;
    /// let selected = SelectedModes::compute("the chain", &chain, ModeSearch::NearOmega(30.0), 4)?;
    /// assert_eq!(selected.modes.len(), 4);
    /// println!("{selected}");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`sparse_modes`].
    pub fn compute(
        file: impl Into<String>,
        machine: &SparseSystem,
        search: ModeSearch,
        count: usize,
    ) -> Result<Self, IntegrateError> {
        let modes = sparse_modes(machine, search, count)?;
        Ok(Self {
            file: file.into(),
            degrees_of_freedom: machine.dof(),
            near_hz: match search {
                ModeSearch::Lowest => None,
                ModeSearch::NearOmega(omega) => Some(omega / TAU),
            },
            modes: modes.iter().map(SelectedMode::new).collect(),
        })
    }
}

impl SelectedMode {
    fn new(sparse: &SparseMode) -> Self {
        let mode = &sparse.mode;
        let eigenvalue = mode.eigenvalue();
        Self {
            oscillates: mode.oscillates(),
            is_rigid_body: sparse.is_rigid_body,
            natural_frequency_hz: mode.natural_frequency() / TAU,
            damped_frequency_hz: mode.damped_frequency_hz(),
            damping_ratio: mode.damping_ratio(),
            eigenvalue: [eigenvalue.re, eigenvalue.im],
            residual: sparse.residual,
            largest: mode.shape().icamax() + 1,
            shape: mode.shape().iter().map(|entry| [entry.re, entry.im]).collect(),
        }
    }

    fn cells(&self) -> [String; 5] {
        let [re, im] = self.eigenvalue;
        let [frequency, damping, eigenvalue] = match (self.is_rigid_body, self.oscillates) {
            (true, _) => ["rigid body".into(), "–".into(), "0".into()],
            (false, true) => [
                significant(self.natural_frequency_hz, 7),
                significant(100.0 * self.damping_ratio, 5),
                format!("{} ± {}i", significant(re, 5), significant(im, 7)),
            ],
            (false, false) => ["–".into(), "–".into(), significant(re, 7)],
        };
        let residual = format!("{:.0e}", self.residual);
        [frequency, damping, eigenvalue, self.largest.to_string(), residual]
    }
}

impl fmt::Display for SelectedModes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let dof = message::count(self.degrees_of_freedom, "degree of freedom");
        let modes = message::count(self.modes.len(), "mode");
        match self.near_hz {
            None => writeln!(f, "{}: {dof}, {modes} of lowest frequency\n", self.file)?,
            Some(hz) => {
                writeln!(f, "{}: {dof}, {modes} nearest to {} Hz\n", self.file, significant(hz, 6))?
            }
        }
        let header = [
            "mode",
            "natural frequency, Hz",
            "damping ratio, %",
            "eigenvalue, rad/s",
            "moves most",
            "residual",
        ];
        let mut rows = vec![header.map(String::from).to_vec()];
        for (number, mode) in (1..).zip(&self.modes) {
            let mut row = vec![format!("{number}")];
            row.extend(mode.cells());
            rows.push(row);
        }
        f.write_str(&text_table(&rows))?;
        for (number, mode) in (1..).zip(&self.modes) {
            let growth = mode.eigenvalue[0];
            // The real part of an undamped mode is only rounding.
            let rounding = 1e-9 * TAU * mode.natural_frequency_hz;
            if !mode.is_rigid_body && growth > rounding {
                writeln!(
                    f,
                    "\nmode {number} is unstable: its free response grows e-fold every {} s, at {} 1/s",
                    significant(growth.recip(), 3),
                    significant(growth, 3)
                )?;
            }
        }
        Ok(())
    }
}
