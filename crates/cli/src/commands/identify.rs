//! `mechid identify`: identification of a machine from its records.

use std::ffi::OsString;

use clap::Args;

use crate::args::elements::ElementArgs;
use crate::args::fit::{FitArgs, TableArgs};
use crate::args::{FigureArgs, ReportArgs, StyleArgs, TimeLimitArgs};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Find mass, damping and stiffness from a measured force and response
///
/// In the frequency domain (the default) one kind of response is enough. For a periodic excitation
/// the window must contain whole periods, which are averaged. For a random excitation, or any
/// record that is not whole periods, the transient is estimated together with the machine. For a
/// hammer test (--hits) each good hit has its own transient; with --machine, each series of good
/// hits without a gap has one. In the time domain any record is possible. The equation of motion at
/// the samples needs displacement, velocity and acceleration; displacement and velocity are enough
/// with an assumption on the force between the samples. --derivatives computes the responses that
/// were not measured.
///
/// With --frf-table the files are frequency responses measured elsewhere.
///
/// With --machine, a file describes the elements of the machine, and their unknown coefficients are
/// identified from sensors at any positions. Examples: springs and dampers of a chain, the bearings
/// of a rotor, a frame on a shake table.
///
/// A long text is read in chunks and not kept in memory: the fit uses all of it; checks and plots
/// in the time domain use at most the first 262144 samples. The following are kept in memory:
/// windows for spectral --derivatives, windows for --refine with spline or band-limited
/// interpolation, one long period, and a record that --validate predicts as a steady state.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid identify record.csv --force force --displacement displacement
  mechid identify rig.csv --sample-rate 610.35 --force V1 --displacement V2 \\
      --start 10585 --period 1024 --periods 1 --lines 1:2:335 --detrend mean --plot receptance.svg
  mechid identify rotor.csv --force fx,fy --displacement x,y --mass 14.8,unknown --band-hz 20:90 --json
  mechid identify a.csv b.csv --force f --displacement x --period 512 --method maximum-likelihood \\
      --validate c.csv
  mechid identify point1.csv point2.csv --force f --struck 1,2 --acceleration a1,a2 --hits
  mechid identify random.csv --force f --acceleration a --from-frf h1 --segment 1024
  mechid identify modal.unv --frf-table --averages 32 --band-hz 20:400
  mechid identify t.csv --force f --displacement x --velocity v --domain time \\
      --between-samples euler --extent period --refine 8:band-limited --plot t.svg
  mechid identify chain.csv --machine chain.json --period 2048
  mechid identify runs.csv --machine rotor.json --speed-table --json
  mechid identify t.csv --force f --acceleration a --domain time --derivatives savitzky-golay:11:4")]
pub struct IdentifyArgs {
    #[command(flatten)]
    fit: FitArgs,
    #[command(flatten)]
    table: TableArgs,
    #[command(flatten)]
    elements: ElementArgs,
    #[command(flatten)]
    page: FigureArgs,
    #[command(flatten)]
    style: StyleArgs,
    #[command(flatten)]
    pub limit: TimeLimitArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl IdentifyArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        self.page.add_files(self.fit.files().reads(self.elements.inputs()))
    }

    /// Reads, identifies, and reports.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        if let Some(identified) = self.fit.identify_elements(&self.table, &self.elements)? {
            let text = self.fit.text_of_elements(&identified);
            return Outcome::new(text, &identified)?.with_result_page(
                &self.page,
                (self.fit.record(), words),
                &identified,
                self.style.style(),
            );
        }
        if let Some(identified) = self.fit.identify_tables(&self.table)? {
            return Outcome::new(identified.to_string(), &identified)?.with_result_page(
                &self.page,
                (self.fit.record(), words),
                &identified,
                self.style.style(),
            );
        }
        let identified = self.fit.identify()?;
        Outcome::new(self.fit.text(&identified), &identified)?.with_result_page(
            &self.page,
            (self.fit.record(), words),
            &identified,
            self.style.style(),
        )
    }
}
