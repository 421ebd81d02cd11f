//! The dissertation's simulations: machine, sampling and force.

use mechid::model::{KyxSign, OilFilm, Sdof, SecondOrderSystem, npi_sampling};
use mechid::signal::{Multisine, Phases, Record, Sampling, lines};
use mechid_problems::{dissertation_bearing, dissertation_sdof};
use nalgebra::DMatrix;

/// Model of the dissertation: one degree of freedom, or the bearing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Machine {
    /// One degree of freedom with this damping in N·s/m (180, in some figures 50).
    SingleDof {
        /// c, in N·s/m.
        damping: f64,
    },
    /// The shaft on the journal bearing, with this sign of Kyx.
    Bearing {
        /// Sign of Kyx in the second row of K.
        kyx: KyxSign,
    },
}

impl Machine {
    /// The single degree of freedom of table 5.2.1.
    pub const SDOF: Machine = Machine::SingleDof { damping: 180.0 };

    /// M, C, K.
    pub fn system(self) -> SecondOrderSystem {
        match self {
            Machine::SingleDof { damping } => {
                let adopted = dissertation_sdof();
                Sdof::new(adopted.mass(), damping, adopted.stiffness())
                    .expect("positive mass and stiffness")
                    .system()
            }
            Machine::Bearing { kyx } => dissertation_bearing(kyx).system(),
        }
    }

    /// The "natural frequency" in the formula for the step size, in rad/s.
    ///
    /// For the bearing it is the largest damped frequency of the system with −Kyx, even if the
    /// simulation uses +Kyx.
    pub fn omega_n(self) -> f64 {
        match self {
            Machine::SingleDof { .. } => dissertation_sdof().natural_frequency(),
            Machine::Bearing { .. } => dissertation_bearing(KyxSign::Minus)
                .system()
                .modes()
                .expect("eigenvalues of a 4×4 matrix")
                .iter()
                .map(|m| m.damped_frequency())
                .fold(0.0, f64::max),
        }
    }

    /// Amplitude of every line of the force, in N.
    pub fn amplitude(self) -> f64 {
        match self {
            Machine::SingleDof { .. } => 50.0,
            Machine::Bearing { .. } => 100.0,
        }
    }

    /// Names of the estimated parameters: stiffness first, then damping.
    pub fn parameters(self) -> &'static [&'static str] {
        match self {
            Machine::SingleDof { .. } => &["K", "C"],
            Machine::Bearing { .. } => &["Kxx", "Kxy", "Kyx", "Kyy", "Cxx", "Cxy", "Cyx", "Cyy"],
        }
    }

    /// The true values, in the order and with the signs of [`Machine::parameters`].
    pub fn truth(self) -> Vec<f64> {
        match self {
            Machine::SingleDof { damping } => vec![dissertation_sdof().stiffness(), damping],
            Machine::Bearing { kyx } => {
                let OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy } =
                    dissertation_bearing(kyx).film();
                vec![kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy]
            }
        }
    }

    /// K and C as the tables list them: Kyx without the sign under which it enters K.
    pub fn listed(self, stiffness: &DMatrix<f64>, damping: &DMatrix<f64>) -> Vec<f64> {
        let sign = match self {
            Machine::Bearing { kyx } => kyx.factor(),
            Machine::SingleDof { .. } => 1.0,
        };
        let mut values: Vec<f64> = [stiffness, damping].iter().flat_map(|m| rows(m)).collect();
        if values.len() == 8 {
            values[2] *= sign;
        }
        values
    }
}

fn rows(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().iter().copied().collect()
}

/// One simulation: a machine, the samples of one period, and NPI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Case {
    /// The machine.
    pub machine: Machine,
    /// Number of samples in one period.
    pub nt: usize,
    /// Ratio of the natural to the fundamental frequency.
    pub npi: f64,
}

impl Case {
    /// Dt = 2π·NPI / (Nt·ωn).
    pub fn sampling(self) -> Sampling {
        npi_sampling(self.npi, self.nt, self.machine.omega_n()).expect("positive NPI and frequency")
    }

    /// One period of the Schroeder signal on every line strictly between DC and Nyquist, acting
    /// on the last degree of freedom (on Y alone for the bearing).
    pub fn force(self) -> Record {
        let sampling = self.sampling();
        let signal = Multisine::flat(
            lines::full(sampling),
            self.machine.amplitude(),
            Phases::SchroederBinary,
        )
        .and_then(|m| m.sample(sampling))
        .expect("lines below Nyquist");
        let dof = self.machine.system().dof();
        let data =
            DMatrix::from_fn(
                self.nt,
                dof,
                |k, c| {
                    if c + 1 == dof { signal.channel(0)[k] } else { 0.0 }
                },
            );
        Record::new(sampling, data).expect("finite samples")
    }
}
