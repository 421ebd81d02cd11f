//! Draws one figure of each kind into the given folder, or into `target/gallery`.

use std::f64::consts::TAU;
use std::path::PathBuf;

use mechid_plot::charts::{self, FrequencyResponse, Quantity, Series};
use mechid_plot::{Axis, Curve, Figure, Panel, Reference};

/// Mass (kg), damping (N·s/m) and stiffness (N/m) of the machine, the same in all figures.
const MACHINE: (f64, f64, f64) = (10.0, 180.0, 5000.0);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder =
        std::env::args().nth(1).map_or_else(|| PathBuf::from("target/gallery"), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    let figures = [
        ("excitation", excitation()),
        ("bode", bode()),
        ("sweep", sweep()),
        ("sweep_grid", sweep_grid()),
        ("stability", stability()),
        ("force_spectrum", force_spectrum()),
        ("band", band()),
    ];
    for (name, figure) in figures {
        figure.save(folder.join(format!("{name}.svg")))?;
        figure.save(folder.join(format!("{name}.png")))?;
    }
    Ok(())
}

fn excitation() -> Figure {
    let (lines, amplitude, dt) = (127u32, 50.0, 0.00219526);
    let phase = |n: u32| if (n * n / 254).is_multiple_of(2) { 0.0 } else { TAU / 2.0 };
    let time: Vec<f64> = (0..256).map(|k| f64::from(k) * dt).collect();
    let force: Vec<f64> = (0..256)
        .map(|k| {
            (1..=lines).map(|n| amplitude * (TAU * f64::from(n * k) / 256.0 + phase(n)).cos()).sum()
        })
        .collect();
    let frequency: Vec<f64> = (1..=lines).map(|n| f64::from(n) / (256.0 * dt)).collect();
    let flat = vec![amplitude; frequency.len()];
    charts::time_and_spectrum(
        "Multisine of 127 lines with binary Schroeder phases",
        Quantity::new("Force", "N"),
        Series::new("", &time, &force),
        Series::new("", &frequency, &flat),
    )
}

fn receptance(omega: f64) -> (f64, f64) {
    let (m, c, k) = MACHINE;
    let (re, im) = (k - m * omega * omega, c * omega);
    (1.0 / re.hypot(im), -im.atan2(re).to_degrees())
}

fn bode() -> Figure {
    let fine: Vec<f64> = (0..400).map(|i| 1.5 * 10f64.powf(f64::from(i) * 0.005)).collect();
    let coarse: Vec<f64> = (1..=90).map(|i| 1.6 * f64::from(i)).collect();
    let noisy = |(index, &omega): (usize, &f64)| {
        let wobble = (index as f64 * 12.9898).sin() * 43_758.545_3;
        let noise = 0.16 * (wobble - wobble.floor() - 0.5);
        let (magnitude, phase) = receptance(omega);
        (magnitude * (1.0 + noise), phase + 40.0 * noise)
    };
    let (measured, measured_phase): (Vec<f64>, Vec<f64>) =
        coarse.iter().enumerate().map(noisy).unzip();
    let (fitted, fitted_phase): (Vec<f64>, Vec<f64>) =
        fine.iter().map(|&omega| receptance(omega)).unzip();
    charts::bode(
        "Receptance of the single-degree-of-freedom system",
        Axis::log10("Angular frequency ω", "rad/s"),
        Axis::log10("|X/F|", "m/N"),
        &[FrequencyResponse {
            name: "measured",
            frequency: &coarse,
            magnitude: &measured,
            phase_deg: &measured_phase,
            standard_error: &[],
        }],
        &[FrequencyResponse {
            name: "fitted: K̂ = 4 998 N/m, Ĉ = 180.3 N·s/m",
            frequency: &fine,
            magnitude: &fitted,
            phase_deg: &fitted_phase,
            standard_error: &[],
        }],
    )
}

const METHODS: [&str; 5] =
    ["Runge–Kutta 4", "Newmark", "Central difference", "Houbolt", "Wilson θ"];

fn sweep_data(truth: f64) -> (Vec<f64>, Vec<Vec<f64>>) {
    let npi: Vec<f64> = (0..=10).map(|i| 2.0 + 0.2 * f64::from(i)).collect();
    let bias = [0.01, -0.005, -0.03, -0.08, -0.14];
    let curves = bias
        .iter()
        .map(|bias| {
            npi.iter().map(|npi| truth * (1.0 + bias * (4.0 - npi) * (4.2 - npi))).collect()
        })
        .collect();
    (npi, curves)
}

fn sweep() -> Figure {
    let (npi, curves) = sweep_data(5000.0);
    let methods: Vec<Series<'_>> =
        METHODS.iter().zip(&curves).map(|(name, curve)| Series::new(name, &npi, curve)).collect();
    charts::sweep(
        "Stiffness identified in the time domain",
        Axis::linear("Number of integration periods NPI", ""),
        Quantity::new("Stiffness K̂", "N/m"),
        &methods,
        Some(5000.0),
    )
}

fn sweep_grid() -> Figure {
    let truths = [("K_{xx}", 40.0), ("K_{xy}", 50.0), ("K_{yx}", 20.0), ("K_{yy}", 60.0)];
    let mut figure =
        Figure::new("Stiffness of the journal bearing").columns(2).share_x().shared_legend();
    for (name, truth) in truths {
        let (npi, curves) = sweep_data(truth);
        let methods: Vec<Series<'_>> = METHODS
            .iter()
            .zip(&curves)
            .map(|(name, curve)| Series::new(name, &npi, curve))
            .collect();
        let setting = Axis::linear("NPI", "");
        figure = figure.panel(charts::sweep_panel(
            setting,
            Quantity::new(name, "N/m"),
            &methods,
            Some(truth),
        ));
    }
    figure
}

fn stability() -> Figure {
    let step: Vec<f64> = (0..300).map(|i| 0.02 * 10f64.powf(f64::from(i) * 0.01)).collect();
    let newmark = vec![1.0; step.len()];
    let central: Vec<f64> = step
        .iter()
        .map(|step| {
            let half = 1.0 - 0.5 * (TAU * step).powi(2);
            if half.abs() <= 1.0 { 1.0 } else { half.abs() + (half * half - 1.0).sqrt() }
        })
        .collect();
    let houbolt: Vec<f64> = step.iter().map(|step| 1.0 / (1.0 + (2.0 * step).powi(2))).collect();
    charts::stability(
        "Spectral radius of the undamped oscillator",
        &[
            Series::new("Newmark, average acceleration", &step, &newmark),
            Series::new("Central difference", &step, &central),
            Series::new("dissipative scheme", &step, &houbolt),
        ],
    )
}

fn force_spectrum() -> Figure {
    let omega: Vec<f64> = (1..=127).map(|n| 1.118 * f64::from(n)).collect();
    let mut panel = Panel::new(
        Axis::linear("Angular frequency ω", "rad/s"),
        Axis::log10("Amplitude of the identified force", "N"),
    )
    .reference(Reference::horizontal("true force", 50.0))
    .reference(Reference::vertical("natural frequency", 22.36));
    for (index, name) in METHODS.iter().enumerate() {
        let force: Vec<f64> = omega
            .iter()
            .map(|w| {
                50.0 * (1.0 - 0.0001 * index as f64 * w - 0.05 * index as f64 * (w / 30.0).sin())
            })
            .collect();
        panel = panel.curve(Curve::line(*name, &omega, &force));
    }
    Figure::new("Force identified with the continuous equation").panel(panel)
}

fn band() -> Figure {
    let time: Vec<f64> = (0..40_000).map(|k| f64::from(k) * 1e-4).collect();
    let decay = |t: f64| 2e-4 * (-0.9 * t).exp();
    let line: Vec<f64> = time.iter().map(|&t| decay(t) * (20.5 * t).sin()).collect();
    let (low, high): (Vec<f64>, Vec<f64>) = time.iter().map(|&t| (-decay(t), decay(t))).unzip();
    Figure::new("").panel(
        Panel::new(Axis::linear("Time", "s"), Axis::linear("Displacement x", "m"))
            .curve(Curve::band("envelope", &time, &low, &high))
            .curve(Curve::line("free decay", &time, &line)),
    )
}
