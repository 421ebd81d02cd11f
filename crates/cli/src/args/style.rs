//! Look of pictures of frequency responses.

use clap::{Args, ValueEnum};
use mechid::analysis::ResponseQuantity;
use mechid::report::{FigureStyle, FrequencyScale, MagnitudeScale, PhaseStyle};

/// Look of the frequency responses in the picture.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Output")]
pub struct StyleArgs {
    /// Phase in the picture: between -180° and 180°, or without jumps
    #[arg(long, value_name = "PHASE", value_enum, default_value_t, requires = "plot")]
    plot_phase: PlotPhase,
    /// Frequency axis of the picture [default: logarithmic for mechid modes, linear otherwise]
    #[arg(long, value_name = "SCALE", value_enum, requires = "plot")]
    plot_frequency: Option<PlotFrequency>,
    /// Magnitude axis of the picture
    #[arg(long, value_name = "SCALE", value_enum, default_value_t, requires = "plot")]
    plot_magnitude: PlotMagnitude,
    /// Response per unit force in the picture [default: as measured; receptance for a machine]
    #[arg(long, value_name = "QUANTITY", value_enum, requires = "plot")]
    plot_quantity: Option<PlotQuantity>,
}

/// Response per unit force, by name.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum PlotQuantity {
    /// Displacement per force
    Receptance,
    /// Velocity per force
    Mobility,
    /// Acceleration per force
    Accelerance,
}

/// Branch of the phase, by name.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
enum PlotPhase {
    /// Between -180° and 180°
    #[default]
    Wrapped,
    /// Without jumps
    Continuous,
}

/// Scale of the frequency axis, by name.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum PlotFrequency {
    /// Equal distances for equal differences
    Linear,
    /// Equal distances for equal ratios
    Log,
}

/// Scale of the magnitude axis, by name.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
enum PlotMagnitude {
    /// Logarithmic, in the unit of the response
    #[default]
    Log,
    /// Decibels relative to one unit of the response
    Db,
}

impl StyleArgs {
    /// Returns the style.
    pub fn style(&self) -> FigureStyle {
        FigureStyle {
            phase: match self.plot_phase {
                PlotPhase::Wrapped => PhaseStyle::Wrapped,
                PlotPhase::Continuous => PhaseStyle::Continuous,
            },
            frequency: self.plot_frequency.map(|scale| match scale {
                PlotFrequency::Linear => FrequencyScale::Linear,
                PlotFrequency::Log => FrequencyScale::Logarithmic,
            }),
            magnitude: match self.plot_magnitude {
                PlotMagnitude::Log => MagnitudeScale::Logarithmic,
                PlotMagnitude::Db => MagnitudeScale::Decibel,
            },
            quantity: self.plot_quantity.map(|quantity| match quantity {
                PlotQuantity::Receptance => ResponseQuantity::Displacement,
                PlotQuantity::Mobility => ResponseQuantity::Velocity,
                PlotQuantity::Accelerance => ResponseQuantity::Acceleration,
            }),
        }
    }
}
