//! Step of a converter or of printed digits in the values of a channel.

use crate::limits;

/// Returns the step between the values of a channel, in its unit, if the distance of any two values
/// is a whole number of steps. `None` if the distances are not whole numbers of steps, if there are
/// too many levels for the number of samples, and for fewer than 16 different values.
///
/// Rounding to such steps adds an error of step/√12 RMS, which is the same in every period of a
/// signal without other noise.
///
/// ```
/// use mechid_signal::quantisation_step;
///
/// let exact: Vec<f64> = (0..500).map(|k| (0.1 * f64::from(k)).sin()).collect();
/// let rounded: Vec<f64> = exact.iter().map(|x| (x / 0.01).round() * 0.01).collect();
/// assert!((quantisation_step(&rounded).unwrap() / 0.01 - 1.0).abs() < 1e-9);
/// assert_eq!(quantisation_step(&exact), None);
/// ```
///
/// # Source
/// Widrow & Kollár, *Quantization Noise* (2008), for the error; the search is ours.
pub fn quantisation_step(samples: &[f64]) -> Option<f64> {
    let mut values = samples[..samples.len().min(limits::QUANTISATION_SAMPLES)].to_vec();
    if values.iter().any(|value| !value.is_finite()) {
        return None;
    }
    values.sort_unstable_by(f64::total_cmp);
    values.dedup();
    if values.len() < limits::QUANTISATION_LEVELS {
        return None;
    }
    let distances = || values.windows(2).map(|pair| pair[1] - pair[0]);
    let smallest = distances().fold(f64::INFINITY, f64::min);
    // The smallest distance has the rounding errors of two printed values; the mean of all
    // distances of about one step is more precise.
    let (sum, count) = distances()
        .filter(|distance| *distance < 1.5 * smallest)
        .fold((0.0, 0.0), |(sum, count), distance| (sum + distance, count + 1.0));
    let steps: f64 = distances().map(|distance| (distance * count / sum).round()).sum();
    let step = (values[values.len() - 1] - values[0]) / steps;
    let off = |distance: f64| {
        let count = distance / step;
        (count - count.round()).abs()
    };
    distances().all(|distance| off(distance) <= limits::QUANTISATION_DEVIATION).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise;
    use crate::sampling::Sampling;

    fn white(samples: usize, seed: u64) -> Vec<f64> {
        let sampling = Sampling::new(0.001, samples).unwrap();
        noise::white(sampling, 1, 1.0, seed).unwrap().channel(0).to_vec()
    }

    #[test]
    fn steps_of_converters_and_of_printed_digits_are_found() {
        for (bits, seed) in [(8, 1), (10, 2), (12, 3), (14, 4), (16, 5)] {
            let step = 8.0 / f64::from(1 << bits);
            let exact = white(4096, seed);
            let rounded: Vec<f64> = exact.iter().map(|x| (x / step).round() * step).collect();
            assert!((quantisation_step(&rounded).unwrap() / step - 1.0).abs() < 1e-6, "{bits}");
            let printed: Vec<f64> =
                rounded.iter().map(|x| format!("{x:.5e}").parse().unwrap()).collect();
            let found = quantisation_step(&printed);
            // Values with six digits do not resolve the steps of a 16-bit converter.
            assert!(
                bits > 14 || (found.unwrap() / step - 1.0).abs() < 1e-2,
                "{bits}: {found:?} for {step}"
            );
        }
    }

    #[test]
    fn signals_without_steps_and_of_few_values_have_none() {
        for seed in 0..20 {
            assert_eq!(quantisation_step(&white(4096, seed)), None);
            assert_eq!(quantisation_step(&white(100, seed)), None);
        }
        let binary: Vec<f64> = white(4096, 1).iter().map(|x| x.signum()).collect();
        assert_eq!(quantisation_step(&binary), None);
        assert_eq!(quantisation_step(&[0.0; 100]), None);
        assert_eq!(quantisation_step(&[f64::NAN; 100]), None);
    }
}
