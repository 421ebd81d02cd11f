//! Arguments of `mechid identify --machine`: a machine of named elements.

use std::path::PathBuf;

use clap::Args;
use mechid::io::{FrequencyResponses, Table, read_machine};
use mechid::{ElementData, IdentifiedElements, IdentifyElements};

use super::at_least_one;
use super::fit::{FitArgs, TableArgs};
use crate::error::CliError;

/// Machine of named elements.
#[derive(Debug, Args)]
#[command(next_help_heading = "Machine of named elements")]
pub struct ElementArgs {
    /// Find the unknown coefficients of the machine in this description. The description has
    /// degrees of freedom, elements (masses, springs and dampers, bearings, known matrices),
    /// sensors at any positions, and inputs (forces, motion of the support, unbalance). The columns
    /// of the record must have the names of the sensors and inputs. With --period the record is
    /// read as whole periods, with --hits as the hits of a hammer, otherwise as an open record (any
    /// part of a response)
    #[arg(long, value_name = "MACHINE.json", conflicts_with_all = ["force", "displacement", "velocity",
          "acceleration", "domain", "lines", "without_lines", "method", "extent",
          "between_samples", "ac_coupling", "mass", "structure", "struck", "nonlinear", "candidates",
          "derivatives", "refine", "from_frf", "segment", "validate", "fitted_lines", "more_starts", "quantity", "averages", "points"])]
    machine: Option<PathBuf>,
    /// The files are tables of synchronous responses, with one row per speed of a run. Columns:
    /// speed_rpm (or speed_hz), and for each sensor and unbalance NAME_amplitude and
    /// NAME_phase_deg, or NAME_real and NAME_imaginary; in SI units, unbalance in kg·m
    #[arg(long, requires = "machine", conflicts_with_all = ["frf_table", "period", "start",
          "sample_rate", "time", "detrend", "noise", "force_noise", "hits"])]
    speed_table: bool,
    /// Table of frequency responses of one part, measured while it was not connected to the other
    /// parts; its receptance replaces a model of the part; may be repeated
    #[arg(long, value_name = "TABLE", requires = "machine")]
    part: Vec<PathBuf>,
    /// Maximum number of searches: the first begins at the initial values of the description, the
    /// others at random values [default: 12]
    #[arg(long, value_name = "COUNT", requires = "machine", value_parser = at_least_one)]
    starts: Option<usize>,
    /// Seed of the random initial values [default: 0]
    #[arg(long, value_name = "SEED", requires = "machine")]
    seed: Option<u64>,
    /// Confidence level of the intervals, in per cent [default: 95]
    #[arg(long, value_name = "PERCENT", requires = "machine", value_parser = super::positive,
          allow_negative_numbers = true)]
    confidence: Option<f64>,
}

impl ElementArgs {
    /// Returns the files that are read.
    pub fn inputs(&self) -> impl Iterator<Item = &PathBuf> {
        self.machine.iter().chain(&self.part)
    }
}

impl FitArgs {
    /// Identifies a machine of named elements, if one is described.
    pub fn identify_elements(
        &self,
        table: &TableArgs,
        elements: &ElementArgs,
    ) -> Result<Option<IdentifiedElements>, CliError> {
        let Some(path) = &elements.machine else { return Ok(None) };
        let usual = IdentifyElements::new(read_machine(path)?);
        let how = IdentifyElements {
            band: self.lines.band_hz,
            without_hz: self.lines.without_hz.clone(),
            hits: self.hits.rule(),
            noise: self.noise.unwrap_or_default(),
            force_noise: self.force_noise(),
            starts: elements.starts.unwrap_or(usual.starts),
            seed: elements.seed.unwrap_or(usual.seed),
            confidence: elements.confidence.map_or(usual.confidence, |percent| percent / 100.0),
            ..usual
        };
        let files = || std::iter::once(&self.input.record).chain(&self.more);
        let mut data = if elements.speed_table {
            self.input.refuse_units()?;
            let tables = files().map(Table::read).collect::<Result<Vec<_>, _>>()?;
            ElementData::from_speeds(&tables, &how)?
        } else if table.frf_table {
            let tables = self.input.read_responses(&self.more)?;
            ElementData::from_responses(&tables, &how)?
        } else {
            let channels = how.channels()?;
            let open = |path| self.input.open_other(path, &channels, self.input.window());
            let records = files().map(|path| open(path)).collect::<Result<Vec<_>, _>>()?;
            ElementData::from_records(&records, &how)?
        };
        if !elements.part.is_empty() {
            let parts: Vec<FrequencyResponses> = elements
                .part
                .iter()
                .map(|part| self.input.read_table(part))
                .collect::<Result<_, _>>()?;
            data = data.with_parts(&parts, &how)?;
        }
        Ok(Some(mechid::identify_elements(&data, &how)?))
    }

    /// Returns the result as text, with every check if requested.
    pub fn text_of_elements(&self, identified: &IdentifiedElements) -> String {
        if !self.verbose {
            return identified.to_string();
        }
        let checks = identified.summary().checks.iter();
        let lines: Vec<String> = checks.map(|check| format!("  {}", check.sentence())).collect();
        format!("{identified}\nchecks:\n{}\n", lines.join("\n"))
    }
}
