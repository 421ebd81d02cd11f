//! Data that do not allow an identification of modes are refused, with the reason.

use mechid_modal::{ModalError, ModalSettings, identify_modes};
use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix};

use crate::generator::{Normal, pair};

type C = Complex<f64>;

fn data(change: impl Fn(&mut DMatrix<C>, &mut DMatrix<C>)) -> LineData {
    let good = pair(8).lines(1);
    let (mut inputs, mut outputs) = (good.inputs().clone(), good.outputs().clone());
    change(&mut inputs, &mut outputs);
    let transient = Transient::Open { sample_interval: 1.0 / 1024.0 };
    LineData::new(good.omega().to_vec(), inputs, outputs, transient).unwrap()
}

fn refusal(data: &LineData) -> ModalError {
    identify_modes(data, &ModalSettings::default()).unwrap_err()
}

#[test]
fn dead_channels_are_named() {
    let dead = data(|inputs, outputs| {
        inputs.column_mut(1).fill(C::default());
        outputs.column_mut(0).fill(C::default());
    });
    assert_eq!(refusal(&dead), ModalError::DeadOutputs { outputs: vec![0] });
    let dead = data(|inputs, _| inputs.column_mut(1).fill(C::default()));
    assert_eq!(refusal(&dead), ModalError::DeadInputs { inputs: vec![1] });
}

#[test]
fn two_shakers_that_are_one_are_named() {
    let same = data(|inputs, _| {
        let double = inputs.column(0) * C::from(2.0);
        inputs.column_mut(1).copy_from(&double);
    });
    assert!(matches!(refusal(&same), ModalError::DependentInputs { input: 1, .. }));
}

#[test]
fn noise_has_no_modes() {
    let noise = data(|inputs, outputs| {
        let mut normal = Normal::new(3);
        for value in inputs.iter_mut().chain(outputs.iter_mut()) {
            *value = C::new(normal.next(), normal.next());
        }
    });
    assert!(matches!(refusal(&noise), ModalError::NoMode { .. }));
}

#[test]
fn few_lines_and_no_outputs_are_refused() {
    let one = |inputs: usize, outputs: usize| {
        let values = DMatrix::from_element(3, outputs, C::new(1.0, 0.5));
        let inputs = DMatrix::from_element(3, inputs, C::new(1.0, 0.0));
        LineData::new(vec![1.0, 2.0, 3.0], inputs, values, Transient::None).unwrap()
    };
    assert_eq!(refusal(&one(1, 0)), ModalError::NoOutput);
    assert_eq!(refusal(&one(0, 1)), ModalError::NoExcitation);
    assert!(matches!(refusal(&one(1, 1)), ModalError::TooFewLines { lines: 3, .. }));
}

#[test]
fn settings_out_of_range_are_refused() {
    let none = ModalSettings { modes: Some(0), ..ModalSettings::default() };
    let refused = identify_modes(&pair(8).lines(1), &none);
    assert!(matches!(refused, Err(ModalError::Setting { setting: "modes", .. })));
}

/// Short records of noise, with different numbers of lines and channels, must give modes or an
/// error with a reason, but no panic.
#[test]
fn any_data_gives_modes_or_a_reason() {
    let mut normal = Normal::new(11);
    for (round, lines) in [1, 2, 7, 12, 20, 33, 50, 64].into_iter().enumerate() {
        for (outputs, inputs) in [(1, 0), (1, 1), (3, 0), (2, 2), (9, 1)] {
            let mut values = |columns: usize| {
                DMatrix::from_fn(lines, columns, |_, _| C::new(normal.next(), normal.next()))
            };
            let omega = (0..lines).map(|k| 5.0 + 0.3 * k as f64).collect();
            let transient = if round % 2 == 0 {
                Transient::None
            } else {
                Transient::Open { sample_interval: 0.01 }
            };
            let data = LineData::new(omega, values(inputs), values(outputs), transient).unwrap();
            for data in [data.clone(), data.clone().followed_by(&data).unwrap()] {
                match identify_modes(&data, &ModalSettings { max_modes: 5, ..Default::default() }) {
                    Ok(estimate) => assert!(!estimate.modes().is_empty()),
                    Err(error) => assert!(!error.to_string().is_empty()),
                }
            }
        }
    }
}
