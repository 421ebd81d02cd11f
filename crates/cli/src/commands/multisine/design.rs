//! From options to multisines.

use mechid::signal::multi_input::{Mixing, orthogonal};
use mechid::signal::{CrestSearch, Multisine, Phases, Record, Sampling, SignalError, lines};

use super::{MultisineArgs, PhaseLaw, Separation};
use crate::error::CliError;

/// One column of the record.
#[derive(Debug)]
pub struct Channel {
    pub name: String,
    pub multisine: Multisine,
    /// One period.
    pub period: Record,
}

impl MultisineArgs {
    /// The columns of the record, experiment by experiment.
    pub fn channels(&self, sampling: Sampling) -> Result<Vec<Channel>, CliError> {
        let chosen = self.lines.lines(sampling)?;
        if self.inputs == 1 {
            return Ok(vec![self.channel("force".into(), self.input(chosen, 0)?, sampling)?]);
        }
        let own_lines = match self.uncorrelated {
            Separation::Interleaved => lines::interleaved(&chosen, self.inputs)?,
            Separation::Dft | Separation::Hadamard => vec![chosen; self.inputs],
        };
        let inputs = (0..).zip(own_lines).map(|(k, lines)| self.input(lines, k));
        let inputs: Vec<Multisine> = inputs.collect::<Result<_, _>>()?;
        let experiments = match self.uncorrelated {
            Separation::Interleaved => vec![inputs],
            Separation::Dft => orthogonal(&inputs, Mixing::Dft)?,
            Separation::Hadamard => orthogonal(&inputs, Mixing::Hadamard)?,
        };
        let single = experiments.len() == 1;
        let mut channels = Vec::new();
        for (e, inputs) in (1..).zip(experiments) {
            for (k, multisine) in (1..).zip(inputs) {
                let name =
                    if single { format!("force_{k}") } else { format!("experiment_{e}_force_{k}") };
                channels.push(self.channel(name, multisine, sampling)?);
            }
        }
        Ok(channels)
    }

    fn channel(
        &self,
        name: String,
        multisine: Multisine,
        sampling: Sampling,
    ) -> Result<Channel, CliError> {
        // After mixing, so that the peak is that of the signal written.
        let multisine = match (self.rms, self.peak) {
            (Some(rms), _) => multisine.with_rms(rms)?,
            (None, Some(peak)) => multisine.with_peak(peak)?,
            (None, None) => multisine,
        };
        let period = multisine.sample(sampling)?;
        Ok(Channel { name, multisine, period })
    }

    /// The multisine of one input before mixing; inputs differ by their seeds.
    fn input(&self, lines: Vec<usize>, input: u64) -> Result<Multisine, SignalError> {
        let seed = self.seed.wrapping_add(input);
        let law = match self.phases {
            // The search of a further input must not begin, and end, where the first one did.
            PhaseLaw::LowCrest if input > 0 => Phases::Random { seed },
            PhaseLaw::Schroeder | PhaseLaw::LowCrest => Phases::Schroeder,
            PhaseLaw::SchroederBinary => Phases::SchroederBinary,
            PhaseLaw::Random => Phases::Random { seed },
            PhaseLaw::Zero => Phases::Zero,
        };
        let first = lines.first().copied().unwrap_or(1) as f64;
        let amplitude = self.amplitude.unwrap_or(1.0);
        let sloped = |n: &usize| amplitude * (*n as f64 / first).powf(self.slope / 20.0);
        let amplitudes = lines.iter().map(sloped).collect();
        let multisine = Multisine::new(lines, amplitudes, law)?;
        if self.phases != PhaseLaw::LowCrest {
            return Ok(multisine);
        }
        CrestSearch { starts: self.starts, seed }.minimise(&multisine)
    }
}
